"""The explosion map in a room that is its sphere, and in others; what it says of itself, and which mirrors it refuses."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import trimesh
from support.answers import hollow, picture
from support.mirror_room import error, mirror_ball, scene, shaded, smooth, walls

from benchharness.scene import Mesh, Object
from methods.explosion_map import ExplosionMap
from methods.newton import Newton

SIZE = (96, 72)
METHOD = ExplosionMap(radius=4.0)  # of a ball of half a metre


@cache
def shell(radius: float):
    """A mirror ball of half a metre in a ball of this radius."""
    made = trimesh.creation.icosphere(subdivisions=5, radius=radius)
    mesh = Mesh(made.vertices, made.faces[:, ::-1], -made.vertices / radius, radiance=smooth(made.vertices, radius / 2))
    return scene((Object("shell", mesh, "what is equally far everywhere"),), (mirror_ball(),))


@cache
def truth(radius: float):
    return picture(shell(radius), SIZE)


@cache
def answer(method, radius: float):
    return shaded(method, shell(radius), 0, size=SIZE)[0]


def off(method, radius: float) -> float:
    return error(answer(method, radius), truth(radius))


def vertex(answer, field):
    return np.array(getattr(answer.reflection.vertices, field))


def test_a_room_that_is_the_sphere_is_shown_as_newtons_method_shows_it_and_others_are_not():
    exact = off(Newton(split_px=0.0), 2.0)
    assert off(METHOD, 2.0) < exact + 0.003
    assert off(METHOD, 2.6) > 3 * exact and off(METHOD, 8.0) > off(METHOD, 2.6)
    assert off(ExplosionMap(radius=16.0), 8.0) < off(METHOD, 8.0) / 3


def test_mirrored_in_the_plane_is_nearly_the_same_on_the_sphere_and_farther_off_elsewhere():
    """Measured: 0.0053 to 0.0003 of radiance, where what is left of the point's error counts more, and 0.156 to 0.035."""
    plane = replace(METHOD, placement="plane")
    assert off(plane, 2.0) < 0.008
    assert off(plane, 8.0) > 2 * off(METHOD, 8.0)


def test_what_is_off_the_sphere_has_not_converged_and_is_doubted():
    right, wrong = answer(METHOD, 2.0), answer(METHOD, 8.0)
    shares = []
    for one in (right, wrong):
        seen = vertex(one, "region") == 1
        assert seen.sum() > 5000 and (vertex(one, "iterations")[seen] == 1).all()
        assert not (vertex(one, "converged") & ~seen).any()
        shares.append(vertex(one, "converged")[seen].mean())
    assert shares[0] > 0.9 and shares[1] < 0.05
    doubt = [float(np.array(one.reflection.doubt)[one.active.ravel()].mean()) for one in (right, wrong)]
    assert doubt[0] < 0.25 and doubt[1] > 0.9
    assert right.found[right.active].mean() > 0.999 and wrong.found[wrong.active].mean() > 0.999


def test_hollow_mirrors_are_refused_with_what_is_accepted():
    made = scene((walls(),), (mirror_ball(), hollow("concave")))
    name = made.reflectors[1].name
    said = f"reflector {name}: it is hollow somewhere; accepted: a mirror that bulges or is flat everywhere"
    assert METHOD.refuses(made) == said
    assert METHOD.refuses(scene((walls(),), (mirror_ball(),))) is None


def test_levels_of_detail_without_rays_are_refused():
    with pytest.raises(ValueError, match='explosion_map: lod_px 1 with resolve "interpolate"; accepted: 0, or "ray"'):
        ExplosionMap(lod_px=1.0)
