"""Interleaved rounds of all methods, so that drift of the machine hits all alike; every round is a frame of its own.

Dr.Jit records once more when the sizes of a picture's lists stand in another relation to each other; warm-up and medians
are for that.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from itertools import cycle
from typing import Any

import drjit as dr
import numpy as np

from benchharness.api import Frame, Reflection
from benchharness.measure import contract, host, timing
from benchharness.measure.beside import Beside
from benchharness.measure.entry import Entry, guarded
from benchharness.render.frame import FrameRenderer

KERNEL_ROUNDS = 3
WARM_FRAMES = 2
COLOURS = 16  # a picture of fewer may be the same from a pixel aside


class Rounds:
    """Rounds on one frame, the last of `frames`, which follow each other. `rounds`: at least, and at most."""

    def __init__(self, renderer: FrameRenderer, frames: list[Frame], rounds: tuple[int, int]) -> None:
        self.renderer, self.frame, self.rounds = renderer, frames[-1], rounds
        self.beside = Beside(renderer, frames)
        self.moved = self.beside.moved()
        self.warm = self.beside.several(WARM_FRAMES)

    def warm_up(self, entry: Entry) -> None:
        """Until both verbs compile nothing more."""
        frames = cycle(self.warm)
        timing.warm_up(lambda: entry.method.update(entry.outdated, contract.lent(next(self.moved))))
        timing.warm_up(lambda: _timed_part(entry.method.shade(entry.before, contract.lent(next(frames)))))

    def run(self, entries: Mapping[str, Entry], watch: Callable[[str], None]) -> dict[str, list[float]]:
        """Leaves its samples in every entry that goes on; returns what no method owns: G-buffer, composite, calibration."""
        common: dict[str, list[float]] = {"gbuffer": [], "composite": [], "calibration": []}
        running = {name: entry for name, entry in entries.items() if entry.broken is None}
        for _ in range(3):
            self.beside.drawn(self.beside.view())
        least, most = self.rounds
        for number in range(most):
            common["calibration"].append(timing.calibration_ms())
            frame, ms = self._drawn()
            common["gbuffer"].append(ms)
            for name, entry in _going(running):
                with guarded(name, entry, watch):
                    self._round(entry, frame, first=number < least)
            L = next((entry.shown[-1][1].L for _, entry in _going(running)), None)
            if L is not None:
                common["composite"].append(timing.timed(lambda L=L: self.renderer.compose(self.frame, L))[1])
            if number + 1 >= least and all(timing.settled(entry.samples["shade"]) for _, entry in _going(running)):
                break
        frames = self.beside.several(KERNEL_ROUNDS)
        for name, entry in _going(running):
            with guarded(name, entry, watch):
                entry.samples["kernel"] = [timing.kernel_ms(_kernels(entry, contract.lent(frame))) for frame in frames]
        return common

    def _drawn(self) -> tuple[Frame, float]:
        """The next frame, evaluated, and the ms that its G-buffer took."""
        view, held = self.beside.view(), []

        def draw() -> Any:
            held.append(self.beside.drawn(view))
            return held[0].pixels

        _, ms = timing.timed(draw)
        dr.eval(held)
        return held[0], ms

    def _round(self, entry: Entry, frame: Frame, *, first: bool) -> None:
        """Times a round of one method; `first`: one of those that always are, with an update."""
        if first:
            entry.samples["update"].append(contract.updated(entry.method, entry.outdated, next(self.moved))[1])
        own = contract.lent(frame)
        shaded, ms = timing.timed(lambda: _timed_part(entry.method.shade(entry.before, own)))
        entry.samples["shade"].append(ms)
        if first and not entry.varies:
            both = self.frame.active & frame.active
            entry.varies = bool(dr.any(both & dr.any(shaded[0] != entry.shown[-1][1].L))[0])


def kept(entry: Entry, frame: Frame) -> str | None:
    """Why the times of a method are those of an answer that it kept; None where they are not."""
    L = host.image(entry.shown[-1][1].L, frame)[host.plane(frame.active, frame)]
    if entry.varies or len(np.unique(L, axis=0)) < COLOURS:
        return None
    return "cameras a pixel aside are shown the same picture, bit for bit: what was timed is an answer that was kept"


def _going(entries: Mapping[str, Entry]) -> Iterator[tuple[str, Entry]]:
    return ((name, entry) for name, entry in entries.items() if entry.broken is None)


def _kernels(entry: Entry, frame: Frame) -> list[dict]:
    return timing.kernels_of(lambda: _timed_part(entry.method.shade(entry.before, frame)))


def _timed_part(shaded: tuple[Reflection, Any]) -> tuple:
    """What a frame needs of `shade`: the picture and the state that the next frame starts from."""
    reflection, state = shaded
    return reflection.L, reflection.distance, reflection.found, state
