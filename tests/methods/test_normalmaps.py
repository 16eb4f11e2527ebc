"""Methods that start from pixels show normal maps, each as well as it shows anything; those that move vertices refuse them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.mapped_mirrors import ball, ripples, room, sheet, smooth
from support.mirror_room import plain, scene, shaded, still
from support.small_room import quad
from support.tiers import first

from benchharness.measure import metrics
from benchharness.render.reference import ReferenceOptions, render
from benchharness.scene import Environment, Object, Reflector, Scene
from benchharness.study import plugins
from methods.billboard_impostor import BillboardImpostor
from methods.depth_impostor import DepthImpostor
from methods.environment_map import EnvironmentMap

METHODS = {name: plugin.target for name, plugin in plugins.discover("method").items() if plugin.error is None}
REFUSE = {
    "angle_iteration",
    "explosion_map",
    "image_space_search",
    "near_far",
    "newton",
    "planar_mirror",
    "secant_triangle",
    "specular_polynomial",
}
SIZE = (96, 72)


@pytest.fixture(scope="module")
def wall():
    """A rippled wall mirror, and what it shows in truth, with ripples and without."""
    made = room(sheet(ripples(0.25)))
    return made, *(render(each, 0.0, SIZE) for each in (made, smooth(made)))


def flip(image: np.ndarray, truth: np.ndarray, mask: np.ndarray, made: Scene) -> float:
    found = metrics.evaluate(image, truth, mask, ppd=made.ppd, exposure=made.exposure)["flip"]
    assert found is not None
    return found


@pytest.mark.parametrize("name", sorted(REFUSE))
def test_methods_that_know_the_smooth_surface_alone_refuse(name):
    method = METHODS[name]()
    made = room(sheet(ripples(0.2), name="wall"))
    said = method.refuses(made)
    assert said is not None and "wall" in said and "normal map" in said and "accepted: " in said
    # One of several is enough; none is taken as it was before.
    several = replace(made, reflectors=(*smooth(made).reflectors, *made.reflectors))
    assert method.refuses(several) is not None
    assert "normal map" not in (method.refuses(smooth(made)) or "")


@pytest.mark.parametrize("name", first(sorted(METHODS.keys() - REFUSE), ["depth_impostor", "distance_impostor"]))
def test_all_others_show_it_about_as_well_as_they_show_a_smooth_mirror(name, wall):
    made, truth, plain_truth = wall
    method = METHODS[name]()
    assert method.refuses(made) is None
    [answer], [without] = (shaded(method, each, 0, size=SIZE) for each in (made, smooth(made)))
    mask = truth.mask & answer.active & answer.found
    rippled, still_ = flip(answer.L, truth.image, mask, made), flip(without.L, plain_truth.image, mask, made)
    missed = flip(without.L, truth.image, mask, made)
    assert rippled < 1.25 * still_ + 0.02, (rippled, still_)
    assert rippled < missed - 0.03, (rippled, missed)


def under_the_sky(*mirrors: Reflector) -> Scene:
    sky = Environment.painted(lambda d: 0.5 + 0.4 * np.sin(3 * d + [0.0, 1.0, 2.0]), 64)
    speck = Object("speck", plain(quad((40, 40, 40), (0.1, 0, 0), (0, 0.1, 0)), (1, 1, 1)), "that there is an object")
    return scene((speck,), mirrors, still(), environment=sky)


def test_an_environment_map_is_right_where_all_is_far_away():
    for mirror in (sheet(ripples(0.4)), ball(ripples(0.4))):
        made = under_the_sky(mirror)
        truth = render(made, 0.0, SIZE)
        [answer] = shaded(EnvironmentMap(resolution=512, mip=False), made, 0, size=SIZE)
        mask = truth.mask & answer.active & np.isinf(truth.distance)
        assert mask.sum() > 1000
        assert flip(answer.L, truth.image, mask, made) < 0.01


@pytest.mark.parametrize("kind", first([DepthImpostor, BillboardImpostor], [BillboardImpostor]))
def test_a_picture_of_a_mapped_mirror_has_its_normals(kind):
    # A ball that shows a rippled sheet, which shows the sky.
    other = sheet(ripples(0.3), name="other")
    there = replace(other.mesh, vertices=1.6 * other.mesh.vertices + np.array([1.5, -0.9, 0.1]))
    made = under_the_sky(ball(None), replace(other, mesh=there))
    truth = render(made, 0.0, SIZE, ReferenceOptions(max_depth=3))
    [answer], [missed] = (shaded(kind(resolution=512, planes=1024), each, 0, size=SIZE) for each in (made, smooth(made)))
    again = truth.second & (truth.reflector == 0) & answer.active
    assert again.sum() > 150
    off, without = (float(np.abs(one.L - truth.image)[again].mean()) for one in (answer, missed))
    assert off < 0.4 * without, (off, without)
