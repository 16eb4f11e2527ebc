"""The ground that goes on behind billboards, and which pictures are taken again when something moves."""

from __future__ import annotations

from dataclasses import replace

import mitsuba as mi
import numpy as np
import pytest
from support.board_scenes import (
    GROUND_CENTRE,
    SIZE,
    SKY,
    on_the_ground,
    one,
    paint,
    rays,
    rms,
    row_of_mirrors,
)
from support.mirror_room import balls, mirror_ball, scene, shaded, still

from benchharness.kernels.differentials import RayDifferential
from benchharness.kernels.images import backdrop, billboard
from benchharness.kernels.images.candidates import Ray
from benchharness.render.frame import FrameRenderer
from benchharness.scene import Mesh, Object
from methods.billboard_impostor import BillboardImpostor
from methods.ray_traced import RayTraced

# The ground that goes on


def ground_probe(wall_height: float):
    """(colour just inside, just outside of the ground's border [N, 3]) along rays from the mirror, by the method's own cast."""
    made = on_the_ground()
    method = BillboardImpostor(walls=wall_height, mip=False, planes=1024, environment=512)
    cast = one(method, made).state.impostors
    o = np.array([0.3, 0.1, 0.9])
    s = np.linspace(-1.9, 1.9, 25)
    sides = []
    for away in (-2e-4, 2e-4):
        edge = np.full_like(s, 2.0 + away)
        border = np.concatenate([np.stack(p, axis=1) for p in ((edge, s), (-edge, s), (s, edge), (s, -edge))])
        d = np.column_stack([border, np.zeros(len(border))]) - o
        d /= np.linalg.norm(d, axis=1, keepdims=True)
        d = mi.Vector3f(*(mi.Float(np.ascontiguousarray(x, np.float32)) for x in d.T))
        start = mi.Point3f(*map(float, o)) + mi.Vector3f(mi.Float(np.zeros(len(border), np.float32)))
        none = [mi.Vector3f(0), mi.Vector3f(0)]
        ray = Ray(mi.UInt32(0), start, d, RayDifferential(none, none))
        met = billboard.none()
        columns = cast.planes.candidates.columns
        if columns:
            met = billboard.nearest(cast.planes, cast.plane_pictures, columns, ray, met)
        direction, _ = backdrop.behind(cast.backdrop, start, d)
        L, _ = backdrop.look_up(cast.backdrop, mi.UInt32(0), direction, mi.Bool(True))
        hit = np.isfinite(np.array(met.t))[:, None]
        sides.append(np.where(hit, np.array(met.value).T[:, :3], np.array(L).T))
    return sides


def test_i08_the_ground_goes_on_over_its_border_with_walls_and_jumps_without():
    """I-08: colours differ by less than 1/255 across the border at h = 0."""
    inside, outside = ground_probe(0.7)
    assert np.abs(inside - outside).max() < 1 / 255
    inside, outside = ground_probe(0.0)
    assert np.abs(inside - outside).max(axis=1).mean() > 20 / 255


@pytest.mark.parametrize("lighter", [0.0, 0.15])
def test_i08_the_picture_is_the_ground_below_and_the_environment_above_the_walls(lighter):
    """I-08: above h = H the environment alone, on the ground what is there, seen with the map's parallax."""
    made = on_the_ground(lighter)
    height = 0.7
    answer, exact = one(BillboardImpostor(walls=height, environment=512), made), one(RayTraced(), made)
    o, d = rays(answer)
    ground = np.isfinite(answer.distance) & answer.active
    true = np.isfinite(exact.distance) & exact.active
    assert (ground != true).sum() < 0.02 * true.sum() + 3
    both = ground & true
    assert both.sum() > 150
    np.testing.assert_allclose(answer.distance[both], exact.distance[both], atol=1e-3)
    assert rms(answer, exact, both) < 0.01
    with np.errstate(divide="ignore", invalid="ignore"):
        leave = np.minimum(
            *(np.where(d[..., k] > 0, (2 - o[..., k]) / d[..., k], (-2 - o[..., k]) / d[..., k]) for k in (0, 1))
        )
        top = answer.active & (o[..., 2] + leave * d[..., 2] > height + 1e-3)
    assert top.sum() > 100
    np.testing.assert_allclose(answer.L[top], paint(d[top]), atol=0.01)
    between = answer.active & ~top & ~ground
    assert between.sum() > 50 and np.isfinite(answer.L[between]).all()
    # On the walls it goes from one to the other: never further from both than they are from each other.
    assert answer.L[between].min() > 0.1 and answer.L[between].max() < 0.9


def test_i08_the_walls_are_as_high_as_asked_and_the_map_is_taken_where_the_panorama_was():
    """I-08: directions of rays through a wall, from the method's own cast."""
    cast = one(BillboardImpostor(walls=0.7), on_the_ground()).state.impostors
    o, heights = np.array([0.3, 0.1, 0.5]), np.array([0.1, 0.35, 0.69, 0.71, 0.9])
    exits = np.column_stack([np.full(5, 2.0), np.full(5, 0.4), heights])
    d = (exits - o) / np.linalg.norm(exits - o, axis=1, keepdims=True)
    start = mi.Point3f(*map(float, o)) + mi.Vector3f(mi.Float(np.zeros(5, np.float32)))
    direction, _ = backdrop.behind(cast.backdrop, start, mi.Vector3f(*(mi.Float(x.astype(np.float32)) for x in d.T)))
    from_map = exits - GROUND_CENTRE
    share = np.minimum(heights / 0.7, 1)[:, None]
    blend = (1 - share) * from_map / np.linalg.norm(from_map, axis=1, keepdims=True) + share * d
    np.testing.assert_allclose(np.array(direction).T, blend / np.linalg.norm(blend, axis=1, keepdims=True), atol=1e-5)


def test_walls_of_a_scene_whose_panorama_goes_on_from_nothing_change_nothing():
    made = row_of_mirrors(2, 2)
    np.testing.assert_array_equal(one(BillboardImpostor(walls=1.0), made).L, one(BillboardImpostor(), made).L)


# What is taken again


def shift(x: float, y: float = 0.0, z: float = 0.0):
    def pose(time: float) -> np.ndarray:
        made = np.eye(4)
        made[:3, 3] = time * np.array([x, y, z])
        return made

    return pose


def moving(**moved):
    """Two balls and a card, two mirrors; `moved`: name -> motion. Frame i is at i seconds."""
    objects = [o for o in balls()[:2]]
    sheet_ = Object("card", Mesh(np.array([[-0.4, -0.9, 0.8], [0.4, -0.9, 0.8], [0.4, -0.3, 0.9], [-0.4, -0.3, 0.9]]),
                                 [[0, 1, 2], [0, 2, 3]], radiance=np.array([0.9, 0.8, 0.1])), "flat")  # fmt: skip
    mirrors = [mirror_ball("one", (-0.45, 0.0, 0.0), 0.35), mirror_ball("two", (0.45, 0.1, 0.0), 0.35)]
    objects, mirrors = ([replace(p, motion=moved.get(p.name)) for p in parts] for parts in ([*objects, sheet_], mirrors))
    return scene(objects, mirrors, still((0.2, -1.9, 0.6)), frames=4, fps=1.0, background=SKY)


def taken_in(made, updates=(0, 1)) -> list[int]:
    """How many pictures each of the updates to some frames took."""
    method, renderer = BillboardImpostor(resolution=32, planes=32), FrameRenderer(made, *SIZE)
    state, counts = method.prepare(made), []
    for index in updates:
        frame = renderer.render(index)
        state = method.update(state, frame)
        renewed = list(state.captured.renewed)
        reflection, state = method.shade(state, frame)
        counts.append(int(np.array(reflection.counters["pictures_taken"])[0]))
        assert len(renewed) == counts[-1]
        reflection, state = method.shade(state, frame)  # without an update between, nothing is taken
        assert np.array(reflection.counters["pictures_taken"])[0] == 0
    return counts


ALL = 2 * 2 + 1 + 2  # two balls for each of two mirrors, the card, each mirror for the other


@pytest.mark.parametrize(
    ("moved", "expected"),
    [({}, 0), ({"red": shift(0.1)}, 2), ({"red": shift(0.1), "green": shift(0, 0.1)}, 4), ({"card": shift(0, 0.1)}, 0),
     ({"one": shift(-0.05)}, 2 + 1 + 1), ({"two": shift(0, 0.1), "card": shift(0.1)}, 2 + 1 + 1),
     ({"one": shift(-0.05), "two": shift(0.05)}, 4 + 2)],
)  # fmt: skip
def test_what_moved_is_taken_again_and_nothing_else(moved, expected):
    assert taken_in(moving(**moved), (0, 1, 1)) == [ALL, expected, 0]


def test_a_scene_in_which_only_the_eye_moves_is_never_taken_again():
    made = replace(moving(), camera=lambda t: still((0.2 + t, -1.9, 0.6))(t))
    assert taken_in(made, (0, 1, 2)) == [ALL, 0, 0]
    first, later = shaded(BillboardImpostor(), made, 0, 1, size=SIZE)
    assert not first.same(later)
    assert later.counted("pictures_taken") == 0


def test_a_card_that_moved_is_shown_where_it_is_without_a_new_picture():
    made = moving(card=shift(0.3, -0.1, 0.2))
    before, answer = shaded(BillboardImpostor(other_mirrors="black"), made, 0, 1, size=(192, 128))
    exact = one(RayTraced(), made, (192, 128), 1)
    yellow = [(np.abs(a.L - (0.9, 0.8, 0.1)).max(axis=2) < 0.01) & a.active for a in (before, answer, exact)]
    assert yellow[2].sum() > 100
    assert (yellow[1] & yellow[2]).sum() > 0.97 * (yellow[1] | yellow[2]).sum()
    assert (yellow[0] & yellow[2]).sum() < 0.8 * (yellow[0] | yellow[2]).sum()
