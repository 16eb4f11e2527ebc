"""Every method shows light that is finer than vertices: against the same light at the vertices of many triangles."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import binary_erosion, maximum_filter, minimum_filter
from support.answers import hollow
from support.lit_rooms import disc, room
from support.mirror_room import mirror_for, shaded
from support.textured_rooms import SHEET
from support.tiers import exhaustive, first

from benchharness.scene import Scene, subdivided
from benchharness.study import plugins
from methods.image_space_search import ImageSpaceSearch
from methods.newton import Newton
from methods.planar_mirror import PlanarMirror
from methods.ray_traced import RayTraced
from methods.secant_triangle import SecantTriangle

METHODS = {name: plugin.target for name, plugin in plugins.discover("method").items() if plugin.error is None}
BY_VERTEX = {"image_space_search": ImageSpaceSearch, "newton": Newton, "secant_triangle": SecantTriangle}
SIZE = (96, 72)


def split(made: Scene, h: float) -> Scene:
    """With edges of objects no longer than h."""
    return replace(made, objects=tuple(replace(o, mesh=subdivided(o.mesh, h)) for o in made.objects))


def rms(one, other, where) -> float:
    return float(np.sqrt(np.square(one.L - other.L)[where].mean()))


def at_vertices(made: Scene) -> Scene:
    """As if nobody looked at the maps."""
    return replace(made, objects=tuple(replace(o, mesh=replace(o.mesh, light=None)) for o in made.objects))


@pytest.mark.parametrize("name", first(METHODS, ["billboard_impostor", "newton", "screen_space"]))
def test_light_in_maps_is_seen_as_the_same_light_at_many_vertices_is(name):
    method = METHODS[name]()
    mirror = mirror_for(method)
    made, many = room(mirror), room(mirror, in_maps=False)
    if any(knob.split for knob in method.knobs):  # what draws images straight, however long they are
        made = split(made, 0.3)
    assert method.refuses(made) is None
    maps, vertices, bare = (shaded(method, each, 0, size=SIZE)[0] for each in (made, many, at_vertices(made)))
    inner = binary_erosion(maps.active & maps.found & vertices.found, iterations=1)
    assert inner.sum() > 0.5 * maps.active.sum()
    # Both are the field to within 0.013; edges of the globe, and of walls that a method moves, lie a pixel off.
    assert rms(maps, vertices, inner) < 0.03
    assert rms(maps, bare, inner) > 0.05


def sharp(answer, traced) -> np.ndarray:
    """Where a picture hangs together: away from outlines, at which a pixel decides."""
    jumps = maximum_filter(traced.distance, 3) > 1.15 * minimum_filter(traced.distance, 3)
    return binary_erosion(answer.active & answer.found & traced.found & ~jumps, iterations=1)


@pytest.mark.parametrize("resolve", ["ray", "interpolate"])
@pytest.mark.parametrize("name", first(BY_VERTEX, ["newton"]))
def test_vertex_methods_show_a_disc_on_a_floor_of_two_triangles(name, resolve):
    # Triangles are cut at the mirror's outline, and split where their images bend.
    made = room(field=disc)
    [traced], [answer] = (shaded(m, made, 0, size=SIZE) for m in (RayTraced(), BY_VERTEX[name](resolve=resolve)))
    where = sharp(answer, traced)
    off = np.abs(answer.L - traced.L).max(axis=2)[where]
    assert where.sum() > 500 and traced.L[where].std() > 0.05
    # By rays: the very same points. Drawn straight to half a pixel: wrong on the disc's edge alone.
    assert np.quantile(off, 0.95) < (1e-3 if resolve == "ray" else 0.1) and np.median(off) < 1e-3


def test_what_is_kept_of_the_last_frame_keeps_its_light():
    made = room(field=disc)
    [traced] = shaded(RayTraced(), made, 0, size=SIZE)
    for answer in shaded(Newton(split_px=0.5), made, 0, 0, size=SIZE):
        off = np.abs(answer.L - traced.L).max(axis=2)[sharp(answer, traced)]
        assert np.median(off) < 1e-3 and np.quantile(off, 0.95) < 0.1


def test_several_images_of_a_vertex_carry_their_light():
    # In a hollow mirror; of many vertices, as edges are not split where a vertex may have several images.
    made = split(room(hollow("concave")), 0.3)
    several = Newton(multi=3, resolve="interpolate", split_px=0)
    [traced], [answer] = (shaded(method, made, 0, size=SIZE) for method in (RayTraced(), several))
    where = answer.active & answer.found & traced.found
    assert where.sum() > 400 and rms(answer, traced, where) < 0.02


@pytest.mark.parametrize("clip", first(["discard", "oblique"], ["discard"]))
def test_a_flat_mirror_shows_the_light_on_a_wall_to_the_pixel(clip):
    made = room(SHEET)
    [traced], [answer] = (shaded(m, made, 0, size=SIZE) for m in (RayTraced(), PlanarMirror(clip=clip)))
    off = np.abs(answer.L - traced.L).max(axis=2)[answer.active]
    assert (off > 2e-3).sum() <= 12 and np.median(off) < 1e-4  # rounding decides on outlines


@exhaustive
def test_what_moves_takes_its_light_along():
    def slide(time: float) -> np.ndarray:
        pose = np.eye(4)
        pose[:3, 3] = [0.02 * time, 0.01 * time, 0.03 * time]
        return pose

    made = room(mirror_for(RayTraced()))
    walls, ball = made.objects
    moving = replace(made, objects=(replace(walls, motion=slide), ball), fps=1.0)
    built = replace(made, objects=(replace(walls, mesh=walls.mesh.transformed(slide(1.0))), ball))
    for method in (Newton(resolve="interpolate"), METHODS["depth_impostor"]()):
        moved, there = shaded(method, moving, 0, 1, size=SIZE)[1], shaded(method, built, 1, size=SIZE)[0]
        off = np.abs(moved.L - there.L).max(axis=2)[moved.active & there.active]
        assert np.quantile(off, 0.97) < 0.02, method
