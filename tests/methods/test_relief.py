"""Depth maps as impostors: several maps, both intersectors, what moves, mirrors in mirrors, and bad parameters."""

from __future__ import annotations

from dataclasses import replace

import mitsuba as mi
import numpy as np
import pytest
from scipy.ndimage import binary_erosion
from support.answers import picture
from support.depth_scenes import (
    GREEN,
    RED,
    before_a_comb,
    before_grey,
    egg,
    halves,
    in_a_room,
    moved,
    pair,
    sheet,
    thing,
    turned,
    two_in_one,
    view,
)
from support.mirror_room import Answer, mirror_ball, plain, shaded
from support.small_room import quad
from support.tiers import first

from benchharness.render.frame import FrameRenderer
from benchharness.study import params
from methods.billboard_impostor import BillboardImpostor
from methods.depth_impostor import DepthImpostor
from methods.ray_traced import RayTraced

SIZE = (240, 180)


def answers(made, *methods, size=SIZE):
    renderer = FrameRenderer(made, *size)
    return [shaded(method, made, 0, renderer=renderer)[0] for method in methods]


def total(answer, counter) -> int:
    return int(np.array(answer.reflection.counters[counter], np.int64).sum())


def differ(one, other, by=0.02):
    """Pixels of mirrors that differ."""
    return one.active & (np.abs(one.L - other.L).max(axis=-1) > by)


def rms(one, other, where) -> float:
    return float(np.sqrt(((one.L - other.L)[where] ** 2).mean()))


def there(answer):
    return answer.active & np.isfinite(answer.distance)


# Several maps


@pytest.fixture(scope="module")
def eggs():
    made = egg()
    return made, answers(
        made, RayTraced(), *(DepthImpostor(maps=n) for n in (1, 6)), DepthImpostor(maps=6, intersector="march")
    )


def test_six_maps_of_a_convex_body_join_without_seams(eggs):
    _, (exact, *found) = eggs
    inner = binary_erosion(there(exact), iterations=2)
    assert inner.sum() > 2000
    for answer in found:
        assert there(answer)[inner].all()
        assert not (differ(answer, exact, 0.05) & inner).any() and (differ(answer, exact) & inner).sum() <= 3
        assert (there(answer) ^ there(exact)).sum() < 0.05 * inner.sum()  # of the outline's 350 pixels, a quarter


def test_the_nearest_hit_counts_whatever_the_order_of_the_maps(eggs):
    made, (_, one, *_) = eggs
    renderer = FrameRenderer(made, *SIZE)
    frame, method = renderer.render(0), DepthImpostor(maps=6)
    state = method.update(method.prepare(made), frame)
    found = []
    for order in (slice(None), slice(None, None, -1)):
        reliefs = state.impostors.reliefs
        table = mi.UInt32(np.ascontiguousarray(np.array(reliefs.candidates.table)[order]))
        reliefs = replace(reliefs, candidates=replace(reliefs.candidates, table=table))
        asked = replace(state, impostors=replace(state.impostors, reliefs=reliefs))
        found.append(Answer(frame, *method.shade(asked, frame)))
    assert np.array_equal(found[0].distance, found[1].distance)
    assert differ(*found, by=0).mean() < 1e-4  # maps that meet at the same distance, to the bit
    assert total(found[0], "depth_steps") < 6 * total(one, "depth_steps") + 6 * SIZE[0] * SIZE[1]


def test_a_plane_before_a_body_hides_it_and_behind_is_hidden_by_it():
    """Planes are billboards: whichever is nearer along the ray is shown."""
    made = egg((1.6, 0.0, 1.6))
    for away, seen in ((1.4, True), (3.0, False)):
        way = np.array([1.0, 0.0, 1.0]) / np.sqrt(2)
        plate = plain(sheet(0.12, way).mesh.transformed(moved(*(away * way))), GREEN)
        both = replace(made, objects=(*made.objects, thing(plate, "plate")))
        exact, found = answers(both, RayTraced(), DepthImpostor())
        assert differ(found, exact, 0.1).sum() < 0.05 * there(exact).sum()
        green = there(exact) & (np.abs(exact.L - GREEN).max(axis=-1) < 0.01)
        assert green.any() == seen


# Rows and texels


def test_rows_agree_with_texels_and_look_at_less(eggs):
    _, (_, _, rows, texels) = eggs
    assert differ(rows, texels)[there(texels)].mean() < 0.02
    assert total(rows, "depth_steps") < 0.6 * total(texels, "depth_steps")
    assert total(texels, "spans_dropped") == 0


def test_a_row_shows_nothing_where_the_picture_is_empty():
    """It lies beside the ray's image, and may reach farther than the body there; all radiance here is 0.25 or more."""
    (found,) = answers(egg(), DepthImpostor(maps=6), size=(360, 256))
    assert found.L[found.active].min() > 0.249


def test_the_row_may_go_through_the_start_of_the_image():
    """Farther from it: with few rotations more of the outline is off."""
    exact, *found = answers(egg(), RayTraced(), *(DepthImpostor(rotations=9, anchor=a) for a in ("mid", "start")))
    off = [(there(a) ^ there(exact)).sum() for a in found]
    assert off[0] < off[1] < 0.3 * there(exact).sum()


def test_a_comb_has_more_spans_than_rows_have_points():
    made = before_a_comb()
    exact, few, many, texels = answers(
        made, RayTraced(), DepthImpostor(points=8), DepthImpostor(points=64), DepthImpostor(intersector="march")
    )
    assert total(few, "spans_dropped") > 10_000 and total(many, "spans_dropped") == total(texels, "spans_dropped") == 0
    seen = [float((there(a) & there(exact)).sum() / there(exact).sum()) for a in (few, many, texels)]
    assert seen[0] < 0.75 * seen[1] and seen[1] > 0.5 and seen[2] > 0.65, seen


# What moves


def taken(found):
    return [total(answer, "pictures_taken") for answer in found]


MOTIONS = {
    "object": (lambda t: moved(0.9, 0.25 * t, 1.3), None),
    "mirror": (lambda t: moved(0.9, 0.0, 1.3), lambda t: moved(0.0, -0.2 * t, 0.0)),
    "object turns": (lambda t: moved(0.9, 0.0, 1.3) @ turned(12 * t), None),
}


@pytest.mark.parametrize("name", first(MOTIONS, ["object"]))
def test_maps_are_taken_again_beyond_the_turn_and_always_appear_where_the_object_is(name):
    """Against ray tracing: what stays is right too, but for the rim that the map does not see."""
    made = halves(*MOTIONS[name])
    renderer = FrameRenderer(made, *SIZE)
    exact = shaded(RayTraced(), made, 0, 1, 2, 3, renderer=renderer)
    always, some, never = (shaded(DepthImpostor(turn=d), made, 0, 1, 2, 3, renderer=renderer) for d in (0.0, 15.0, 179.0))
    assert taken(always) == [1, 1, 1, 1] and taken(never) == [1, 0, 0, 0]
    assert taken(some)[:2] == [1, 0] and sum(taken(some)) == 2
    for found in (always, some, never):
        for answer, truth in zip(found, exact, strict=True):
            assert differ(answer, truth, 0.1).sum() < 0.2 * there(truth).sum()
    assert differ(exact[0], exact[3], 0.1).sum() > 0.25 * there(exact[0]).sum()


def test_mirror_and_object_that_move_together_keep_their_maps():
    """Shifts that floats hold exactly retake nothing even at turn 0; turns are rounded, and need a turn above rounding."""
    shift = halves(lambda t: moved(0.9375 + 0.0625 * t, 0.0, 1.25), lambda t: moved(0.0625 * t, 0.0, 0.0))
    assert taken(shaded(DepthImpostor(), shift, 0, 1, 2, size=(48, 36))) == [1, 0, 0]
    turn = halves(lambda t: turned(10 * t, (0.05 * t, 0, 0)) @ moved(0.9, 0, 1.3), lambda t: turned(10 * t, (0.05 * t, 0, 0)))
    assert taken(shaded(DepthImpostor(turn=0.001), turn, 0, 1, 2, size=(48, 36))) == [1, 0, 0]


# Mirrors in mirrors


def test_own_maps_show_a_mirror_in_itself():
    made = two_in_one()
    exact, without, rows, texels = answers(
        made, RayTraced(bounces=4), DepthImpostor(), DepthImpostor(own_maps=6), DepthImpostor(own_maps=6, intersector="march")
    )
    second = picture(made, SIZE).second
    assert second.sum() > 500 and total(without, "second_order") == 0
    for found in (rows, texels):
        again = found.counted("second_order") > 0
        assert (again & second).sum() > 0.9 * second.sum() and (again & ~second).sum() < 0.06 * second.sum()
        assert rms(found, exact, second) < 0.6 * rms(without, exact, second)


@pytest.mark.parametrize("intersector", ["srdm", "march"])
def test_a_convex_mirror_does_not_meet_itself(intersector):
    """Measured: 0.1 % of the pixels; 0.9 % with 64 texels, and 1.3 % by texels for a ray that may meet it from its start."""
    made = in_a_room(mirror_ball("mirror", radius=0.6, fine=192))
    plainly, owned = answers(made, *(DepthImpostor(own_maps=n, intersector=intersector) for n in (0, 6)))
    assert differ(owned, plainly, 1e-3)[owned.active].mean() < 0.005


def test_reflections_of_second_order_are_nearer_than_by_billboards():
    made = pair()
    exact, boards, maps, black = answers(
        made, RayTraced(bounces=4), BillboardImpostor(), DepthImpostor(), DepthImpostor(other_mirrors="black")
    )
    second = picture(made, SIZE).second
    again = maps.counted("second_order") > 0
    assert second.sum() > 500 and (again & second).sum() > 0.98 * second.sum() and (again & ~second).sum() < 0.02 * second.sum()
    assert rms(maps, exact, second) < 0.75 * rms(boards, exact, second)
    assert not black.L[again].any()

    # First-order distances of those pixels: the other mirror itself.
    off = [float(np.median(np.abs(a.distance[second] / exact.distance[second] - 1))) for a in (boards, maps)]
    assert off[1] < 0.015 and off[0] > 10 * off[1]


# Distance


def test_distance_is_that_of_the_ray_and_dims_it(eggs):
    made, (exact, one, *_) = eggs
    inner = binary_erosion(there(exact), iterations=2)
    texel = 2 * 0.52 / 256
    assert np.median(np.abs(one.distance[inner] - exact.distance[inner])) < 1.5 * texel
    assert np.median(np.abs(one.distance[inner] / exact.distance[inner] - 1)) < 0.03
    (dim,) = answers(made, DepthImpostor(attenuation=0.7))
    np.testing.assert_allclose(dim.L[inner], one.L[inner] * np.exp(-0.7 * one.distance[inner])[:, None], rtol=1e-4)
    assert not dim.L[dim.active & ~there(dim)].any()  # nothing comes from infinity


# What every method owes


def test_twice_the_same_and_always_finite():
    made = pair()
    method = DepthImpostor(maps=2, own_maps=2, points=8, resolution=64, walls=0.0)
    (one,), (other,) = (shaded(method, made, 0, size=(96, 72)) for _ in range(2))
    assert one.same(other)
    assert np.isfinite(one.L).all() and (one.L >= 0).all() and (one.distance[one.active] > 0).all()


@pytest.mark.parametrize("own_maps", [0, 6])
def test_a_mirror_out_of_view(own_maps):
    made = replace(egg(), camera=view((0.0, 0.0, 4.0), (0.0, 0.0, 9.0)))
    (found,) = answers(made, DepthImpostor(own_maps=own_maps, resolution=32), size=(48, 36))
    assert not found.active.any() and np.isfinite(found.L).all()


def test_a_scene_of_planes_has_no_depth_maps():
    floor = thing(plain(quad((-1, -1, -0.6), (2, 0, 0), (0, 2, 0)), RED))
    for mirror in (mirror_ball(), sheet(0.5)):
        made = before_grey([floor], [mirror], view((0.0, -1.5, 0.8), fov_deg=50.0, up=(0, 0, 1)))
        exact, found = answers(made, RayTraced(), DepthImpostor())
        assert total(found, "depth_steps") == 0 and total(found, "pictures_taken") == 1
        assert np.isfinite(found.L).all() and differ(found, exact, 0.05)[exact.active].mean() < 0.01


# Parameters


@pytest.mark.parametrize(
    ("name", "value", "text"),
    [
        ("points", 7, "a multiple of 2"),
        ("points", 66, "at most 64"),
        ("rotations", 0, "at least 1"),
        ("maps", 7, "at most 6"),
        ("maps", 0, "at least 1"),
        ("own_maps", 7, "at most 6"),
        ("intersector", "rows", '"srdm" or "srdm_interpolated" or "march"'),
        ("anchor", "end", '"mid" or "start"'),
        ("split_jump", -0.1, "at least 0"),
        ("turn", 181.0, "at most 180"),
        ("attenuation", -1.0, "at least 0"),
        ("resolution", 4, "at least 8"),
        ("other_mirrors", "grey", '"reflective" or "black" or "omitted"'),
    ],
)
def test_a_bad_value_is_refused_with_what_is_accepted(name, value, text):
    with pytest.raises(ValueError, match=rf"{name} is .*; accepted: .*{text}"):
        params.sweep({name: value}, params.of_method(DepthImpostor), "study.toml: [methods.depth_impostor]")


def test_a_resolution_that_is_no_power_of_two_is_refused_at_once():
    with pytest.raises(ValueError, match="resolution is 100; accepted: a power of two"):
        DepthImpostor(resolution=100)
