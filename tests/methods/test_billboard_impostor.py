"""Billboard impostors as a method: against ray tracing, and by what billboards get right and wrong."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.ndimage import binary_dilation, binary_erosion
from support.answers import hollow
from support.board_scenes import (
    CARD,
    CARD_RADIUS,
    SKY,
    card,
    floor,
    one,
    rays,
    rms,
    row_of_mirrors,
    sheet,
)
from support.mirror_room import ball, balls, mirror_ball, mirror_room, plain, scene, smooth, still, walls
from support.small_room import box
from support.touching_ball import contact_gap_px, image, overlap, overlap_of_ends

from benchharness.execution import findings
from benchharness.scene import Mesh, Object, merged
from benchharness.study import plugins
from methods.billboard_impostor import BillboardImpostor
from methods.environment_map import EnvironmentMap
from methods.ray_traced import RayTraced

# A flat card


def card_scene():
    return card(camera=still((0.2, -1.7, 0.25), (0.05, -0.41, 0.28), 16.0))


@cache
def card_traced():
    made = card_scene()
    answer = one(RayTraced(), made)
    o, d = rays(answer)
    middle, u, v = CARD
    k = np.cross(u, v)
    t = ((middle - o) @ k) / (d @ k)
    at = o + t[..., None] * d - middle
    radius = np.where(t > 0, np.hypot(at @ u, at @ v), np.inf)
    return made, answer, np.where(answer.active, radius, np.inf)


def test_a_flat_card_is_as_traced_to_texture_filtering():
    made, exact, radius = card_traced()
    inner = radius < 0.9 * CARD_RADIUS
    assert inner.sum() > 300
    sizes, errors = [32, 64, 128, 256], []
    for size in sizes:
        answer = one(BillboardImpostor(planes=size, mip=False), made)
        errors.append(rms(answer, exact, inner))
        np.testing.assert_allclose(answer.distance[inner], exact.distance[inner], atol=3e-4)
        # Its outline is where it is, to a texel.
        wrong = answer.active & (np.isfinite(answer.distance) != np.isfinite(exact.distance))
        assert np.abs(radius - CARD_RADIUS)[wrong].max(initial=0) < 2 * np.sqrt(2) * CARD_RADIUS / size
    order = -np.polyfit(np.log(sizes[:3]), np.log(errors[:3]), 1)[0]
    assert 1.6 < order < 2.4, errors
    assert errors[-1] < 3e-4, errors


def test_a_flat_card_has_one_picture_and_no_other_resolution_changes_it():
    made, _, _ = card_traced()
    coarse, fine = (one(BillboardImpostor(resolution=n), made) for n in (16, 64))
    assert coarse.same(fine)
    assert coarse.counted("pictures_taken") == 1


# A ball that touches


def test_i01_how_much_of_the_image_of_a_touching_ball_is_where_it_should_be():
    """I-01: on the arc between its ends about 0.01 for an environment map and 0.683 for a billboard (F-29)."""
    exact, mapped, board = image(RayTraced()), image(EnvironmentMap()), image(BillboardImpostor())
    assert overlap(exact, exact) == 1
    assert 0 < overlap_of_ends(mapped, exact) < 0.016
    assert overlap_of_ends(board, exact) == pytest.approx(0.683, abs=0.015)
    assert 0 < overlap(mapped, exact) < 0.01
    assert overlap(board, exact) == pytest.approx(0.722, abs=0.015)


def test_i02_a_billboard_loses_the_end_at_which_a_ball_touches():
    """I-02: seen at 27.3 to 44.9 degrees instead of 27.0 to 52.9; 16 of 71 pixels."""
    exact, board = image(RayTraced()), image(BillboardImpostor())
    assert exact.ends == pytest.approx((27.0, 52.9), abs=0.6)
    assert board.ends == pytest.approx((27.3, 44.9), abs=0.6)
    assert exact.ends_px == (117, 187)
    assert contact_gap_px(board, exact) == pytest.approx(16, abs=1)
    # The plane through the ball's middle is 0.3 from the mirror at least.
    assert board.answer.distance[board.mask].min() > 0.29
    assert exact.answer.distance[exact.mask].min() < 0.03


# What billboards cannot


def torus(radius: float, tube: float) -> Object:
    s, t = np.meshgrid(2 * np.pi * np.arange(96) / 96, 2 * np.pi * np.arange(32) / 32, indexing="ij")
    r = radius + tube * np.cos(t)
    points = np.stack([r * np.cos(s), r * np.sin(s), tube * np.sin(t)], axis=-1).reshape(-1, 3)
    i, j = (a.ravel() for a in np.meshgrid(np.arange(96), np.arange(32), indexing="ij"))
    a, b = i * 32 + j, i * 32 + (j + 1) % 32
    c, e = (i + 1) % 96 * 32 + (j + 1) % 32, (i + 1) % 96 * 32 + j
    faces = np.concatenate([np.stack([a, e, c], 1), np.stack([a, c, b], 1)])
    return Object("ring", Mesh(points, faces, radiance=smooth(points)), "goes around")


def test_i04_what_holds_the_mirror_goes_to_its_environment_map():
    """I-04: a ring whose box encloses the mirror's is no billboard."""
    made = scene((torus(1.0, 0.35),), (mirror_ball(radius=0.25),), still((0.1, -2.4, 1.6)), background=SKY)
    answer, mapped = one(BillboardImpostor(), made), one(EnvironmentMap(mip=False), made)
    assert (answer.counted("quad_tests") == 0).all() and answer.counted("pictures_taken") == 0
    np.testing.assert_allclose(answer.L[answer.active], mapped.L[answer.active], atol=1e-5)
    assert np.isfinite(answer.distance[answer.active]).mean() == pytest.approx(0.35, abs=0.03)


def test_i04_a_ring_around_a_mirror_that_its_box_does_not_hold_is_a_billboard_that_cuts_it():
    """I-04: the quad passes through the mirror; rays meet it in front of them only, at the ring and not in its hole."""
    made = scene((torus(0.9, 0.1),), (mirror_ball(),), still((0.1, -2.4, 1.6)), background=SKY)
    answer, exact = one(BillboardImpostor(), made), one(RayTraced(), made)
    assert (answer.counted("quad_tests")[answer.active] == 1).all()
    seen, there = (np.isfinite(a.distance) & a.active for a in (answer, exact))
    assert (answer.distance[answer.active] > 0).all() and np.isfinite(answer.L).all()
    o, d = rays(answer)
    at = (o + answer.distance[..., None] * d)[seen]
    r = np.hypot(at[:, 0], at[:, 1])
    assert r.min() > 0.78 and r.max() < 1.02  # of the quad only the ring is opaque
    assert np.abs(at[:, 2]).max() < 0.01  # and it stands where the ring's middle is
    # Rays that run along the plane pass above what is thick.
    assert (seen & there).sum() / (seen | there).sum() == pytest.approx(0.29, abs=0.06)


def two_coloured(front, back, middle=(0.0, 0.3, 0.0), radius=0.2) -> Object:
    made = ball(radius, middle, front, 4)
    forward = (made.vertices[made.faces].mean(axis=1) - middle)[:, 1] > 0
    halves = [Mesh(made.vertices, made.faces[f], made.normals, radiance=np.array(c, float)) for f, c in
              ((forward, front), (~forward, back))]  # fmt: skip
    return Object("ball", merged(*halves), "has a front and a back")


@pytest.mark.parametrize("end", [-1.0, 1.0])
def test_i05_the_back_of_an_object_is_never_seen_from_either_end_of_a_long_mirror(end):
    """I-05: one picture, from the mirror's middle: no parallax within a billboard."""
    made = scene((two_coloured((1, 0, 0), (0, 0, 1)),), (sheet(),), still((end * 3.6, 0.2, 0.0), (end * 1.0, 1.0, 0.0), 40.0))
    answer, exact = one(BillboardImpostor(), made), one(RayTraced(), made)
    blue = [(a.L[..., 2] > 0.5) & a.active for a in (answer, exact)]
    red = [(a.L[..., 0] > 0.5) & a.active for a in (answer, exact)]
    assert blue[1].sum() > 10 and red[1].sum() > 5  # the truth: both
    assert red[0].sum() > 5 and not blue[0].any()


BALL, BEHIND = np.array([0.9, 0.2, 0.1]), np.array([0.1, 0.3, 0.8])


def edge_scene():
    """A ball far from a mirror ball for its size, before one colour."""
    red = Object("red", ball(0.2, (0.3, -1.5, 0.6), BALL, 4), "has an outline")
    return scene(
        (red,), (mirror_ball(),), still((0.2, -1.7, 0.25), (0.06, -0.45, 0.1), 12.0), background=tuple(BEHIND.tolist())
    )


@pytest.mark.parametrize("mip", [True, False])
@pytest.mark.parametrize("resolution", [32, 256])
def test_i06_outlines_have_no_halo(mip, resolution):
    """I-06: in the band of 2 pixels around outlines all colours lie between the ball's and what is behind it, here on it."""
    made = edge_scene()
    answer, exact = one(BillboardImpostor(resolution=resolution, mip=mip), made), one(RayTraced(), made)
    mask, true = (np.isfinite(a.distance) & a.active for a in (answer, exact))
    assert true.sum() > 100
    band = binary_dilation(true, iterations=2) & ~binary_erosion(true, iterations=2) & answer.active
    colours = answer.L[band]
    share = np.clip((colours - BEHIND) @ (BALL - BEHIND) / ((BALL - BEHIND) ** 2).sum(), 0, 1)
    assert np.abs(BEHIND + share[:, None] * (BALL - BEHIND) - colours).max() < 1e-5
    assert np.minimum(share, 1 - share).max() < 1e-5  # opaque or not: nothing in between
    assert rms(answer, exact, band) < (0.2 if resolution == 256 else 0.3)
    assert (mask != true).sum() < 0.2 * true.sum()


def test_mip_levels_smooth_what_a_mirror_shrinks():
    """A checker whose squares are smaller than a pixel."""
    points = floor(3.0).mesh
    odd = np.floor(points.vertices[:, :2] / 0.1 + 0.5).sum(axis=1) % 2
    checker = Object("floor", replace(points, radiance=np.repeat(odd[:, None], 3, axis=1)), "too fine")
    made = scene((checker,), (mirror_ball(radius=0.2),), still(fov_deg=30.0))
    smoothed, rough = (one(BillboardImpostor(mip=mip), made) for mip in (True, False))
    shown = np.isfinite(smoothed.distance) & np.isfinite(rough.distance) & smoothed.active
    assert shown.sum() > 100
    assert smoothed.L[shown].std() < 0.9 * rough.L[shown].std()


# What every method owes


def test_two_runs_are_bit_identical():
    made = row_of_mirrors(3, 4)
    assert one(BillboardImpostor(), made).same(one(BillboardImpostor(), made))


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e5])
def test_scenes_of_any_size_have_finite_answers(scale):
    made = row_of_mirrors(3, 2)
    camera = made.camera(0.0)
    eye, target = (tuple(scale * np.array(x)) for x in (camera.eye, camera.target))

    def sized(part):
        mesh = part.mesh
        return replace(part, mesh=Mesh(scale * mesh.vertices, mesh.faces, mesh.normals, radiance=mesh.radiance))

    parts = [tuple(map(sized, parts)) for parts in (made.objects, made.reflectors)]
    large = replace(made, objects=parts[0], reflectors=parts[1], near=scale * 0.01, camera=still(eye, target))
    answer = one(BillboardImpostor(), large)
    assert answer.active.sum() > 500
    assert np.isfinite(answer.L).all() and (answer.L >= 0).all()
    assert not np.isnan(answer.distance).any() and (answer.distance[answer.active] > 0).all()
    if scale >= 1:
        usual = one(BillboardImpostor(), made)
        same = np.abs(answer.L - usual.L)[answer.active & usual.active].max(axis=1) < 0.02
        assert same.mean() > 0.97


@pytest.mark.parametrize("name", ["concave", "torus"])
def test_any_mirror_is_taken(name):
    made = scene((walls(), *balls()), (hollow(name),), still((0.2, -1.0, 0.5)))
    assert BillboardImpostor().refuses(made) is None
    answer = one(BillboardImpostor(), made)
    assert np.isfinite(answer.L).all() and answer.found[answer.active].all()


def test_a_scene_without_mirrors_is_no_error():
    answer = one(BillboardImpostor(), scene(balls(), (), background=SKY))
    assert not answer.active.any() and not answer.L.any()


def test_what_has_no_area_is_not_seen_and_no_error():
    needle = Mesh(np.array([(0, -1, 0), (0, -1, 1), (0, -1, 0.5)], float), [[0, 1, 2]], radiance=np.ones((3, 3)))
    lost = (Object("needle", needle, "nothing"),)
    made = [scene((*balls(), *more), (mirror_ball(),), background=SKY) for more in (lost, ())]
    with_, without = (one(BillboardImpostor(), m) for m in made)
    np.testing.assert_array_equal(with_.L, without.L)


@pytest.mark.parametrize("thick", [0.04, 0.1])
def test_a_rod_is_as_wide_as_it_is_from_wherever_mirrors_see_it(thick):
    """Two mirrors at right angles around it: a plane of its own would vanish in one of them."""
    half = 0.5 * thick
    red = plain(box((-half, -half, -0.5), (half, half, 0.5)), (0.9, 0.1, 0.1))
    places = ((0.0, 0.9, 0.0), (0.9, 0.0, 0.0))
    for place in places:
        at = np.array(place)
        aside = -at[[1, 0, 2]] / 0.9 + (0, 0, 0.4)  # of the mirror, where the rod is not in the way
        halfway = aside / np.linalg.norm(aside) - at / 0.9
        camera = still((at + 1.2 * aside).tolist(), (at + 0.3 * halfway / np.linalg.norm(halfway)).tolist(), 12.0)
        mirrors = tuple(mirror_ball(f"m{i}", p, 0.3) for i, p in enumerate(places))
        made = scene((Object("rod", red, "is thin"),), mirrors, camera, background=SKY)
        answer, exact = one(BillboardImpostor(other_mirrors="black"), made), one(RayTraced(), made)
        seen, true = ((a.L[..., 0] > 0.5) & a.active for a in (answer, exact))
        assert true.sum() > 30
        assert (seen & true).sum() > 0.6 * (seen | true).sum()


def test_in_a_room_balls_are_billboards_and_the_room_is_the_environment():
    made = mirror_room()
    answer, mapped, exact = (one(m, made) for m in (BillboardImpostor(), EnvironmentMap(), RayTraced()))
    assert (answer.counted("quad_tests")[answer.active] == 3).all()
    assert rms(answer, exact, answer.active) < 0.7 * rms(mapped, exact, answer.active)


@pytest.mark.parametrize("name", ["resolution", "planes"])
def test_a_resolution_that_is_no_power_of_two_is_refused(name):
    with pytest.raises(ValueError, match=f"billboard_impostor: {name} is 100; accepted: a power of two"):
        BillboardImpostor(**{name: 100})


@pytest.mark.parametrize("name", ["billboard_impostor", "depth_impostor"])
def test_the_contract_is_kept(name):
    found = list(findings.findings(plugins.discover("method")[name]))
    assert [f for f in found if f.level == "fail"] == []
    assert len(found) >= 12
