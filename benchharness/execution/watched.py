"""A method's answer to one frame, with an eye on what each verb launches, writes and leaves to others."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import drjit as dr
import numpy as np

from benchharness.api import Frame, Method, Reflection
from benchharness.measure import contract, host
from benchharness.scene import Scene


class Watched:
    """One frame from a fresh state, updated to that frame or to another one.

    broken    why it cannot be looked at, or None
    wrote     the fields of the frame that changed while it was shaded, or updated to
    launched  kernels inside shade
    work      of shade and its answer, see `_watched`; `updated`: of update
    """

    def __init__(self, method: Method, scene: Scene, frame: Frame, updated_to: Frame | None = None) -> None:
        self._begin(method, scene)
        with self._guarded():
            prepared = method.prepare(scene)
            state, _, self.updated = self._watched(lambda own: method.update(prepared, own), updated_to or frame)
            self._shade(state, frame)

    def _begin(self, method: Method, scene: Scene) -> None:
        self.method, self.scene = method, scene
        self.broken: str | None = None
        self.wrote, self.launched, self.work, self.updated = "", 0, 0, 0

    def again(self, frame: Frame, *, cold: bool = False) -> Watched:
        """The answer to a frame that follows, from the state that this one left; `cold`: from the state that it had."""
        other = object.__new__(Watched)
        other._begin(self.method, self.scene)
        with other._guarded():
            other._shade(self.start if cold else self.state, frame)
        return other

    @contextlib.contextmanager
    def _guarded(self) -> Iterator[None]:
        try:
            yield
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # a plugin may raise what is no Exception
            self.broken = contract.account(error)

    def _shade(self, state: Any, frame: Frame) -> None:
        shaded, self.launched, self.work = self._watched(lambda own: self.method.shade(state, own), replace(frame, doubts=True))
        reflection, self.state = contract.answer(shaded, frame, self.scene)
        self.start = state
        self._read(reflection, frame)

    def _watched(self, verb: Callable[[Frame], Any], frame: Frame) -> tuple[Any, int, int]:
        """What a verb makes of a frame that it is lent, evaluated; the kernels that it launched itself; and the work of all,
        lanes times operations. Notes what it wrote into the frame."""
        own, before = contract.lent(frame), contract.fingerprint(frame)
        dr.sync_thread()
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
            dr.kernel_history_clear()
            result = verb(own)
            inside = dr.kernel_history([dr.KernelType.JIT])
            dr.eval(result)
            dr.sync_thread()
            kernels = inside + dr.kernel_history([dr.KernelType.JIT])
        self.wrote = self.wrote or contract.written(before, own) or contract.written(before, frame)
        return result, len(inside), sum(kernel["size"] * kernel["operation_count"] for kernel in kernels)

    def _read(self, reflection: Reflection, frame: Frame) -> None:
        said = host.answer(frame, reflection)
        self.active, self.distance, self.found = said.mirror, said.distance, said.found
        self.L = host.image(reflection.L, frame)

    def same(self, other: Watched) -> bool:
        """Bit for bit, in the pixels where both see a reflector."""
        if self.broken or other.broken:
            return False
        both = self.active & other.active
        return all(
            getattr(self, name)[both].tobytes() == getattr(other, name)[both].tobytes() for name in ("L", "distance", "found")
        )

    def shows(self, other: Watched) -> bool:
        """Whether the other's picture is this one, bit for bit, in the pixels where both see a reflector."""
        both = self.active & other.active if not (self.broken or other.broken) else np.zeros(1, bool)
        return bool(both.any()) and self.L[both].tobytes() == other.L[both].tobytes()

    def mean(self) -> np.ndarray:
        return self.L[self.found].mean(axis=0)
