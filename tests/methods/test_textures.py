"""Every method shows pictures on surfaces: against the same scene with the pictures in the colours of many vertices."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import binary_erosion, maximum_filter, minimum_filter
from support.answers import hollow
from support.mirror_room import mirror_for, scene, shaded, still
from support.small_room import box
from support.textured_rooms import SHEET, SQUARE, noise, room, untextured, walls, wavy, without_pictures
from support.tiers import exhaustive, first

from benchharness.scene import Object, Scene, Texture, subdivided
from benchharness.study import plugins
from methods.image_space_search import ImageSpaceSearch
from methods.newton import Newton
from methods.planar_mirror import PlanarMirror
from methods.ray_traced import RayTraced
from methods.secant_triangle import SecantTriangle

METHODS = {name: plugin.target for name, plugin in plugins.discover("method").items() if plugin.error is None}
BY_VERTEX = {"image_space_search": ImageSpaceSearch, "newton": Newton, "secant_triangle": SecantTriangle}
SIZE = (96, 72)


def split(made: Scene, h: tuple[float, ...]) -> Scene:
    """With edges of objects no longer than h."""
    objects = (replace(o, mesh=subdivided(o.mesh, step)) for o, step in zip(made.objects, h, strict=True))
    return replace(made, objects=tuple(objects))


def rms(one, other, where) -> float:
    return float(np.sqrt(np.square(one.L - other.L)[where].mean()))


@pytest.mark.parametrize("name", first(METHODS, ["billboard_impostor", "newton", "screen_space"]))
def test_a_picture_is_seen_as_the_same_colours_on_many_vertices_are(name):
    method = METHODS[name]()
    skin = Texture(1.1 - wavy().pixels, ("repeat", "clamp"))
    made = room(wavy(), skin, mirror_for(method))
    if any(knob.split for knob in method.knobs):  # what draws images straight, however long they are
        made = split(made, (0.3, 0.1))
    assert method.refuses(made) is None
    pictures, colours, bare = (
        shaded(method, each, 0, size=SIZE)[0] for each in (made, without_pictures(made, (0.12, 0.03)), untextured(made))
    )
    inner = binary_erosion(pictures.active & pictures.found & colours.found, iterations=1)
    assert inner.sum() > 0.5 * pictures.active.sum()
    # Straight between vertices of walls 12 cm apart and bilinear are alike to 1 %; edges of the globe lie a pixel off.
    assert rms(pictures, colours, inner) < 0.03
    assert rms(pictures, bare, inner) > 0.15


# Pictures finer than vertices, for those that draw triangles or ask them


def papered(mirror) -> Scene:
    return room(noise(8, 6, "mirror"), noise(8, 8, ("repeat", "clamp"), 1), mirror, 1.5 * SQUARE)


def sharp(answer, traced) -> np.ndarray:
    """Where a picture hangs together: away from outlines, at which a pixel decides."""
    jumps = maximum_filter(traced.distance, 3) > 1.15 * minimum_filter(traced.distance, 3)
    return binary_erosion(answer.active & answer.found & traced.found & ~jumps, iterations=1)


@pytest.mark.parametrize("resolve", ["ray", "interpolate"])
@pytest.mark.parametrize("name", first(BY_VERTEX, ["newton"]))
def test_vertex_methods_show_pictures_finer_than_vertices(name, resolve):
    made = papered(mirror_for(RayTraced()))
    [traced], [answer] = (shaded(m, made, 0, size=SIZE) for m in (RayTraced(), BY_VERTEX[name](resolve=resolve)))
    where = sharp(answer, traced)
    off = np.abs(answer.L - traced.L).max(axis=2)[where]
    assert where.sum() > 500
    # By rays: the very same points. Drawn straight to half a pixel: half a pixel of the picture's slope, of 0.1 in the median.
    assert np.median(off) < (1e-3 if resolve == "ray" else 0.05)


def test_split_edges_carry_where_in_the_picture_they_are():
    made = papered(mirror_for(RayTraced()))
    [traced] = shaded(RayTraced(), made, 0, size=SIZE)
    off = []
    for pixels in (0.0, 0.25):
        [answer] = shaded(Newton(split_px=pixels), made, 0, size=SIZE)
        off.append(np.abs(answer.L - traced.L)[sharp(answer, traced)].mean())
    assert off[1] < 0.3 * off[0], off


def test_what_is_kept_of_the_last_frame_keeps_its_picture():
    made = papered(mirror_for(RayTraced()))
    first, second = shaded(Newton(split_px=0.5), made, 0, 0, size=SIZE)
    [traced] = shaded(RayTraced(), made, 0, size=SIZE)
    for answer in (first, second):
        assert np.median(np.abs(answer.L - traced.L)[sharp(answer, traced)]) < 0.05


def test_several_images_of_a_vertex_carry_their_pictures():
    # In a hollow mirror; of many vertices, as edges are not split where a vertex may have several images.
    made = split(room(wavy(), wavy(("repeat", "clamp")), hollow("concave")), (0.3, 0.1))
    several = Newton(multi=3, resolve="interpolate", split_px=0)
    [traced], [answer] = (shaded(method, made, 0, size=SIZE) for method in (RayTraced(), several))
    where = answer.active & answer.found & traced.found
    assert where.sum() > 400 and rms(answer, traced, where) < 0.01


@pytest.mark.parametrize("clip", first(["discard", "oblique"], ["discard"]))
def test_a_flat_mirror_shows_a_wall_s_picture_to_the_pixel(clip):
    made = papered(SHEET)
    [traced], [answer] = (shaded(m, made, 0, size=SIZE) for m in (RayTraced(), PlanarMirror(clip=clip)))
    off = np.abs(answer.L - traced.L).max(axis=2)[answer.active]
    assert (off > 2e-3).sum() <= 12 and np.median(off) < 1e-4  # rounding decides on outlines


def test_a_table_that_goes_into_a_flat_mirror_keeps_its_picture():
    table = box((-0.5, -1.0, -0.35), (0.6, 0.8, -0.3), uv=SQUARE, texture=noise(8, 8))
    table = replace(table, radiance=(0.9, 0.9, 0.9))
    made = scene((Object("table", table, "goes into the mirror"), Object("walls", walls(wavy()), "around")), (SHEET,), still())
    for method in (Newton(resolve="ray"), PlanarMirror()):
        [traced], [answer] = (shaded(m, made, 0, size=SIZE) for m in (RayTraced(), method))
        where = sharp(answer, traced)
        off = np.abs(answer.L - traced.L).max(axis=2)
        assert where.sum() > 1000 and np.quantile(off[where], 0.99) < 1e-3, method


@exhaustive
def test_what_moves_takes_its_picture_along():
    def slide(time: float) -> np.ndarray:
        pose = np.eye(4)
        pose[:3, 3] = [-0.3 * time, 0.1 * time, 0.2 * time]
        return pose

    made = papered(mirror_for(RayTraced()))
    paper, ball = made.objects
    moving = replace(made, objects=(paper, replace(ball, motion=slide)), fps=1.0)
    built = replace(made, objects=(paper, replace(ball, mesh=ball.mesh.transformed(slide(1.0)))))
    for method in (Newton(resolve="interpolate"), METHODS["depth_impostor"]()):
        moved, there = shaded(method, moving, 0, 1, size=SIZE)[1], shaded(method, built, 1, size=SIZE)[0]
        off = np.abs(moved.L - there.L).max(axis=2)[moved.active & there.active]
        assert np.quantile(off, 0.97) < 0.02, method
