"""One frame with everything warm, and works timed on it in interleaved rounds.

A round times every work once, in the same order (A B C A B C ...), so that drift of the machine hits all alike and a ratio
of two works can be taken over rounds. Before each comes a pause in which the threads of the one before fall asleep: those
of Dr.Jit go on looking for work for a while, on cores that another renderer's threads need.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Hashable, Mapping, Sequence
from typing import Any, TypeVar

import drjit as dr
import numpy as np

from benchharness.api import Frame, Method, Reflection
from benchharness.measure import runup, timing
from benchharness.render.frame import FrameRenderer
from benchharness.scene import Scene
from benchharness.study import plugins

PAUSE_S = 0.01
UNTIMED = 3  # rounds: `dr.freeze` may record once more when works alternate
DRAWS = 2000  # of the bootstrap

Work = Callable[[], Any]
Key = TypeVar("Key", bound=Hashable)


class Stage:
    """Frame `index` of a baked scene, and those before it that methods warm up on."""

    def __init__(self, scene: Scene, size: tuple[int, int], index: int) -> None:
        self.scene, self.size = scene, size
        self.renderer = FrameRenderer(scene, *size)
        self.frames = [self.renderer.render(i) for i in runup.numbers(index, scene.frames)]
        dr.eval(self.frames)

    @property
    def frame(self) -> Frame:
        """The frame that is timed, evaluated."""
        return self.frames[-1]

    def warmed(self, method: Method) -> Any:
        """The method's state before it shades `frame`: it shaded the frames before, and took in what moved."""
        *_, last = runup.carried(self.scene, method, method.prepare(self.scene), self.frames)
        return last.before


def method(name: str, **params: Any) -> Method:
    """A method, with its defaults but for `params`. Raises ValueError where there is none of that name."""
    return plugins.find("method", name, "speed").target(**params)


def answer(shaded: tuple[Reflection, Any]) -> tuple:
    """What a frame needs of `shade`, and so what is timed: the picture, and the state that the next frame starts from."""
    reflection, state = shaded
    return reflection.L, reflection.distance, reflection.found, state


def interleaved(works: Mapping[Key, Work], rounds: int, watch: Callable[[int], None]) -> tuple[dict[Key, list[float]], set]:
    """Times in ms per work, one per round, and the works that compiled something even after the warm-up.

    `watch` is told the number of rounds that are done.
    """
    cold = {key for key, work in works.items() if not timing.warm_up(work)}
    samples: dict[Key, list[float]] = {key: [] for key in works}
    for number in range(-UNTIMED, rounds):
        for key, work in works.items():
            time.sleep(PAUSE_S)
            _, ms = timing.timed(work)
            if number >= 0:
                samples[key].append(ms)
        watch(max(number + 1, 0))
    return samples, cold


def ratio_interval(rival: Sequence[float], ours: Sequence[float]) -> tuple[float, float, float]:
    """median(rival) / median(ours) and its 95 % bootstrap interval over rounds. Deterministic.

    Both are times of the same rounds: a draw takes whole rounds, so that what slowed a round down counts on both sides.
    """
    values = np.array([rival, ours], np.float64)
    draws = np.random.default_rng(0).integers(0, values.shape[1], (DRAWS, values.shape[1]))
    above, below = np.median(values[:, draws], axis=2)
    ratio = np.median(values[0]) / np.median(values[1])
    return float(ratio), float(np.quantile(above / below, 0.025)), float(np.quantile(above / below, 0.975))
