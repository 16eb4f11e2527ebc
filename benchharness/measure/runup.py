"""Frames in order, each with the state that the frame before left: the run-up of a frame, and whole animations."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

from benchharness.api import Frame, Method, Reflection
from benchharness.measure import contract
from benchharness.scene import Scene

RUN_UP = 2  # frames shaded before the one that is measured; jitter is a second difference and needs both


@dataclass(frozen=True, eq=False)
class Step:
    """A frame that a method answered.

    outdated  the state before the last update up to here
    before    the state that the frame was shaded from, after the update where something moved
    ms        that shading it took
    """

    frame: Frame
    outdated: Any
    before: Any
    reflection: Reflection
    ms: float


def numbers(index: int, frames: int) -> list[int]:
    """Frames to shade in order, `index` last: those just before it, or, at the start of the animation, those just after."""
    if index >= RUN_UP:
        return [index - 2, index - 1, index]
    return [i for i in (index + 2, index + 1) if i < frames] + [index]


def carried(scene: Scene, method: Method, state: Any, frames: Iterable[Frame]) -> Iterator[Step]:
    """A method's answers to frames in order, from `state`, which `prepare` returned: updated at the first frame and where a
    part moved, else as the frame before left it. Raises whatever the method does, and as `contract.answer`."""
    outdated, before = state, None
    for frame in frames:
        if before is None or scene.moves(before, frame.time):
            outdated = state
            state, _ = contract.updated(method, state, frame)
        at, before = state, frame.time
        reflection, state, ms = contract.shaded(method, at, frame, scene)
        yield Step(frame, outdated, at, reflection, ms)
