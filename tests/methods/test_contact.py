"""What touches a mirror touches its own image: the hand on the kettle, and the back of the chair that only the kettle shows."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.ndimage import distance_transform_edt
from support.mirror_room import Answer, shaded
from support.tiers import first

from benchharness.render.frame import FrameRenderer
from benchharness.scene import Scene, refined
from methods.environment_map import EnvironmentMap
from methods.image_space_search import ImageSpaceSearch
from methods.newton import Newton
from methods.ray_traced import RayTraced
from methods.secant_triangle import SecantTriangle
from scenes.kettle import kettle, touch

SIZE = (720, 512)
TOUCHED = touch()[1]


@cache
def lit(only: str) -> tuple[Scene, FrameRenderer]:
    """The kettle's scene, in which everything is black but the object `only`: no path needs tracing; and what draws it."""
    made = kettle("lean")
    objects = []
    for o in made.objects:
        light = np.full(np.shape(o.mesh.vertices), 1.0 if o.name == only else 0.0)
        objects.append(replace(o, mesh=replace(o.mesh, radiance=light), gloss=None))
    mirrors = [replace(r, mesh=replace(r.mesh, radiance=np.zeros(3))) for r in made.reflectors]
    made = refined(replace(made, objects=tuple(objects), reflectors=tuple(mirrors)))
    return made, FrameRenderer(made, *SIZE)


@cache
def answer(method: type, only: str, index: int) -> Answer:
    made, renderer = lit(only)
    return shaded(method(), made, index, renderer=renderer)[0]


def gap_px(seen: Answer) -> float:
    """Pixels between what is seen directly and what is seen in the mirror; 0 where they adjoin."""
    direct = (np.array(seen.frame.radiance).T[:, 0] > 0.5).reshape(seen.active.shape)
    mirrored = seen.active & (seen.L[..., 0] > 0.5)
    assert direct.any() and mirrored.any()
    return float(distance_transform_edt(~direct)[mirrored].min()) - 1


@pytest.mark.parametrize("method", [RayTraced, ImageSpaceSearch, SecantTriangle, Newton])
@pytest.mark.parametrize("index", first([TOUCHED, 99], [TOUCHED]))
def test_the_hand_touches_its_image_where_it_touches_the_kettle(method, index):
    # One pixel: the tip is a point, and pixels are asked at their centres only.
    assert gap_px(answer(method, "hand", index)) <= 1


def test_an_environment_map_keeps_them_apart():
    # The hand is as far from the kettle's middle as the kettle is wide: a map of directions puts its image there.
    assert gap_px(answer(EnvironmentMap, "hand", 99)) > 8


@pytest.mark.parametrize("method", [RayTraced, ImageSpaceSearch, SecantTriangle, Newton])
def test_before_the_touch_there_is_a_gap(method):
    exact = gap_px(answer(RayTraced, "hand", 30))
    assert exact > 3
    assert abs(gap_px(answer(method, "hand", 30)) - exact) <= 1


@pytest.mark.parametrize("method", [ImageSpaceSearch, SecantTriangle, Newton])
def test_the_back_of_the_chair_is_seen_in_the_mirror_alone(method):
    exact, seen = answer(RayTraced, "chair-rear", 0), answer(method, "chair-rear", 0)
    assert not (np.array(exact.frame.radiance) > 0.5).any()  # not directly
    there = exact.active & (exact.L[..., 0] > 0.5)
    assert there.sum() > 100
    # Long panels close behind each other, at a slant: most of it, not all.
    assert (seen.L[..., 0][there] > 0.5).mean() > 0.7
    mapped = answer(EnvironmentMap, "chair-rear", 0)
    assert not (mapped.L[mapped.active][:, 0] > 0.5).any()  # the map's centre does not see it
