"""What hears a run."""

from __future__ import annotations

import mitsuba as mi  # noqa: F401  (so that the variant is set)


class Ear:
    """Hears what a run says."""

    def __init__(self):
        self.notes, self.frames, self.shares = [], [], []

    def job(self, number, job, left):
        self.frames.append(left)

    def frame(self, frame, records):
        self.frames.append(frame)

    def making(self, share):
        self.shares.append(share)

    def note(self, text):
        self.notes.append(text)
