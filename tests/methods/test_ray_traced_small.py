"""Ray tracing finds small things in curved mirrors: rays that part from one another must not be traced as coherent ones."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from support.answers import picture
from support.depth_scenes import off_axis, view
from support.mirror_room import shaded

from methods.ray_traced import RayTraced

SIZE = (241, 181)


def test_a_small_ball_at_the_outline_of_a_mirror_is_whole():
    made = replace(off_axis(0.05, 1.5), camera=view((0, 2.5, 3.5), (0, 0.93, 0.37), fov_deg=5.0))
    truth = picture(made, SIZE)
    there = truth.mask & (truth.image[..., 0] > 0.5)
    found = shaded(RayTraced(), made, 0, size=SIZE)[0].L[..., 0] > 0.5
    assert there.sum() > 400
    assert np.mean(found != there) < 3e-4
