"""A small scene that moves, and methods that break as time goes on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import drjit as dr
import mitsuba as mi
import numpy as np
from support.mirror_room import ball, mirror_ball, orbit, scene, walls

from benchharness.api import Frame, Method, Reflection
from benchharness.scene import Object, Scene
from methods.ray_traced import RayTraced

SHIFT = 3  # columns


def turning() -> Scene:
    """The camera goes round a mirror ball by 2 degrees a frame, and a red ball rises by 5 mm."""

    def rise(time: float) -> np.ndarray:
        pose = np.eye(4)
        pose[2, 3] = 0.005 * 25 * time
        return pose

    red = Object("red", ball(0.28, (0.4, -0.35, 0.75), (0.9, 0.1, 0.1)), "something near that moves", rise)
    blue = Object("blue", ball(0.3, (0.4, -0.4, -0.8), (0.1, 0.2, 0.9)), "something near")
    return scene((walls(), red, blue), (mirror_ball(fine=64),), orbit(2.0), frames=40)


@dataclass(frozen=True)
class Shaky(Method):
    """Traced rays; every second picture is shifted by SHIFT columns."""

    paper: ClassVar[str] = "none"

    def prepare(self, scene: Scene) -> Any:
        return RayTraced().prepare(scene)

    def update(self, state: Any, frame: Frame) -> Any:
        return RayTraced().update(state, frame)

    def shade(self, state: Any, frame: Frame) -> tuple[Reflection, Any]:
        answer, state = RayTraced().shade(state, frame)
        if frame.index % 2:
            lane = dr.arange(mi.UInt32, frame.view.width * frame.view.height)
            beside = mi.UInt32(dr.maximum(mi.Int32(lane) - SHIFT, 0))
            # What is no mirror there has no answer to take.
            there = dr.gather(mi.Bool, frame.active, beside)
            answer.L = dr.select(there, dr.gather(mi.Color3f, mi.Color3f(answer.L), beside), answer.L)
        return answer, state


@dataclass(frozen=True)
class Lagging(Method):
    """Traced rays; once it has shown two pictures it shows what was there two frames ago."""

    paper: ClassVar[str] = "none"

    def prepare(self, scene: Scene) -> Any:
        return RayTraced().prepare(scene), []

    def update(self, state: Any, frame: Frame) -> Any:
        return RayTraced().update(state[0], frame), state[1]

    def shade(self, state: Any, frame: Frame) -> tuple[Reflection, Any]:
        answer, inner = RayTraced().shade(state[0], frame)
        kept = [*state[1], dr.select(frame.active, answer.L, 0)][-3:]
        answer.L = kept[0] if len(kept) == 3 else answer.L
        return answer, (inner, kept)
