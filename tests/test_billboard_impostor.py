"""Billboard impostors as a method: against ray tracing, by what billboards get right and wrong, and by what they retake."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from answers import hollow
from board_scenes import (
    CARD,
    CARD_RADIUS,
    SKY,
    card,
    counted,
    floor,
    on_the_ground,
    paint,
    rays,
    row_of_mirrors,
    sheet,
)
from mirror_room import ball, balls, mirror_ball, mirror_room, scene, shaded, smooth, still, walls
from scipy.ndimage import binary_dilation, binary_erosion
from touching_ball import contact_gap_px, image, overlap, overlap_of_ends

from benchharness import check, plugins
from benchharness.frame import FrameRenderer
from benchharness.scene import Mesh, Object, merged
from methods.billboard_impostor import BillboardImpostor
from methods.environment_map import EnvironmentMap
from methods.ray_traced import RayTraced

SIZE = (96, 64)


def one(method, made, size=SIZE, index=0):
    return shaded(method, made, index, size=size)[0]


def rms(one_, other, where) -> float:
    return float(np.sqrt(((one_.L - other.L)[where] ** 2).mean()))


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
    assert counted(coarse, "pictures_taken") == 1


# A ball that touches


def test_i01_how_much_of_the_image_of_a_touching_ball_is_where_it_should_be():
    """I-01: on the arc between its ends 0.012 for an environment map and 0.683 for a billboard (F-29)."""
    exact, mapped, board = image(RayTraced()), image(EnvironmentMap()), image(BillboardImpostor())
    assert overlap(exact, exact) == 1
    assert overlap_of_ends(mapped, exact) == pytest.approx(0.012, abs=0.03)
    assert overlap_of_ends(board, exact) == pytest.approx(0.683, abs=0.03)
    assert overlap(mapped, exact) < 0.03
    assert overlap(board, exact) == pytest.approx(0.722, abs=0.03)


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
    assert (counted(answer, "quad_tests") == 0).all() and counted(answer, "pictures_taken") == 0
    np.testing.assert_allclose(answer.L[answer.active], mapped.L[answer.active], atol=1e-5)
    assert np.isfinite(answer.distance[answer.active]).mean() > 0.2


def test_i04_a_ring_around_a_mirror_that_its_box_does_not_hold_is_a_billboard_that_cuts_it():
    """I-04: the quad passes through the mirror; rays meet it in front of them only, at the ring and not in its hole."""
    made = scene((torus(0.9, 0.1),), (mirror_ball(),), still((0.1, -2.4, 1.6)), background=SKY)
    answer, exact = one(BillboardImpostor(), made), one(RayTraced(), made)
    assert (counted(answer, "quad_tests")[answer.active] == 1).all()
    seen, there = (np.isfinite(a.distance) & a.active for a in (answer, exact))
    assert (answer.distance[answer.active] > 0).all() and np.isfinite(answer.L).all()
    o, d = rays(answer)
    at = (o + answer.distance[..., None] * d)[seen]
    r = np.hypot(at[:, 0], at[:, 1])
    assert r.min() > 0.78 and r.max() < 1.02  # of the quad only the ring is opaque
    assert np.abs(at[:, 2]).max() < 0.01  # and it stands where the ring's middle is
    assert (seen & there).sum() > 0.2 * (seen | there).sum()  # rays that run along the plane pass above what is thick


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


# Mirrors in mirrors


@pytest.mark.parametrize(("objects", "mirrors", "once", "twice"), [(2, 2, 3, 5), (1, 4, 4, 5), (1, 9, 9, 10), (3, 2, 4, 7)])
def test_i07_a_pixel_meets_d_plus_r_minus_1_quads_and_d_more_for_a_second_reflection(objects, mirrors, once, twice):
    """I-07: D objects and R mirrors: D + R - 1, and 2 D + R - 1."""
    made = row_of_mirrors(objects, mirrors)
    answer = one(BillboardImpostor(), made)
    second, tests = counted(answer, "second_order") == 1, counted(answer, "quad_tests")
    assert 10 < second.sum() < answer.active.sum() / 2
    assert set(tests[second]) == {twice} and set(tests[answer.active & ~second]) == {once}
    assert (tests[~answer.active] == 0).all()
    black = one(BillboardImpostor(others="black"), made)
    np.testing.assert_array_equal(counted(black, "second_order") == 1, second)
    assert set(counted(black, "quad_tests")[answer.active]) == {once}
    assert (black.L[second] == 0).all() and (answer.L[second].max(axis=1) > 0).all()
    np.testing.assert_array_equal(black.L[~second], answer.L[~second])
    omitted = one(BillboardImpostor(others="omitted"), made)
    assert set(counted(omitted, "quad_tests")[answer.active]) == {objects}
    assert not counted(omitted, "second_order").any()
    np.testing.assert_array_equal(omitted.L[~second], answer.L[~second])


def far_mirrors(gap: float, second=None):
    ground = floor(6.0)
    ground = replace(ground, mesh=replace(ground.mesh, radiance=smooth(ground.mesh.vertices, 1.0)))
    mirrors = (mirror_ball("one", (-gap / 2, 0, 0), 0.35), mirror_ball("two", (gap / 2, 0, 0), 0.35, **(second or {})))
    eye, one_, two = np.array([0.0, -4.5, 0.6]), np.array([-gap / 2, 0, 0]), np.array([gap / 2, 0, 0])
    halfway = (eye - one_) / np.linalg.norm(eye - one_) + (two - one_) / gap
    seen_in = one_ + 0.35 * halfway / np.linalg.norm(halfway)
    camera = still(eye, seen_in, 5.0 / gap)
    return scene((ground,), mirrors, camera, background=SKY)


def test_i07_a_second_reflection_is_nearer_to_the_truth_than_black_or_none_and_more_so_far_away():
    """I-07: the billboard's normals are right, where they stand is not: the error falls with the distance of the mirrors."""
    errors = []
    for gap in (1.0, 2.0, 4.0):
        made = far_mirrors(gap)
        exact = one(RayTraced(bounces=2), made)
        answers = [one(BillboardImpostor(others=o), made) for o in ("reflective", "black", "omitted")]
        second = counted(answers[0], "second_order") == 1
        assert second.sum() > 100
        errors.append([rms(a, exact, second) for a in answers])
    assert errors[0][0] < 0.7 * errors[0][1]
    for near in errors[1:]:
        assert near[0] < 0.6 * min(near[1:])
    assert errors[2][0] < 0.7 * errors[1][0] < 0.7**2 * errors[0][0]


GOLD = {"eta": (0.143, 0.375, 1.442), "k": (3.983, 2.386, 1.603)}


def conductor(cosine, eta, k):
    """Unpolarised reflectance, by complex amplitudes."""
    m = eta + 1j * k
    inner = np.sqrt(m * m - (1 - cosine**2))
    s, p = (cosine - inner) / (cosine + inner), (m * m * cosine - inner) / (m * m * cosine + inner)
    return 0.5 * (np.abs(s) ** 2 + np.abs(p) ** 2)


def test_a_second_mirror_of_gold_dims_by_its_reflectance_at_the_angle_of_its_billboard():
    ideal, gold = (one(BillboardImpostor(), far_mirrors(1.0, s)) for s in (None, GOLD))
    seen_in_first = np.array(gold.frame.reflector).reshape(gold.active.shape) == 0
    second = (counted(gold, "second_order") == 1) & seen_in_first
    assert second.sum() > 100
    ratio = gold.L[second] / ideal.L[second]
    assert (ratio[:, 0] > ratio[:, 1]).all() and (ratio[:, 1] > ratio[:, 2]).all()
    # One angle explains all three colours.
    table = conductor(np.linspace(0, 1, 4001)[:, None], *(np.array(GOLD[x]) for x in ("eta", "k")))
    nearest = np.abs(table[None] - ratio[:, None]).max(axis=2).min(axis=1)
    assert nearest.max() < 2e-3
    assert ratio[:, 2].max() - ratio[:, 2].min() > 0.01
    np.testing.assert_array_equal(gold.L[gold.active & ~(counted(gold, "second_order") == 1)],
                                  ideal.L[ideal.active & ~(counted(ideal, "second_order") == 1)])  # fmt: skip


def test_light_is_lost_along_the_ray_exponentially():
    made = row_of_mirrors(3, 2)
    plain, dimmed = (one(BillboardImpostor(attenuation=a), made) for a in (0.0, 0.7))
    np.testing.assert_array_equal(plain.distance, dimmed.distance)
    share = np.exp(-0.7 * plain.distance.astype(float))[..., None]
    np.testing.assert_allclose(dimmed.L, plain.L * share, rtol=2e-6, atol=1e-9)
    far = plain.active & np.isinf(plain.distance)
    assert far.any() and (dimmed.L[far] == 0).all() and (dimmed.L[plain.active & ~far].max(axis=1) > 0).all()


def test_i27_no_mirror_is_in_its_own_pictures():
    """I-27: neither among the quads of a mirror nor in its environment map."""
    alone = scene((), (mirror_ball(),), background=SKY)
    answer = one(BillboardImpostor(), alone)
    np.testing.assert_allclose(answer.L[answer.active], np.tile(SKY, (answer.active.sum(), 1)), atol=1e-6)
    assert np.isinf(answer.distance[answer.active]).all() and not counted(answer, "quad_tests").any()
    inside = scene((walls(),), (mirror_ball(),))
    answer, exact = one(BillboardImpostor(), inside), one(RayTraced(), inside)
    assert (answer.distance[answer.active] > 1.5).all()  # the walls, not the mirror's own inside
    assert answer.L[answer.active].min() > 0.2 and rms(answer, exact, answer.active) < 0.1
    plan = BillboardImpostor().prepare(row_of_mirrors(2, 4)).stage.plan
    for mirror, shown in enumerate(plan.quads):
        assert sorted(plan.slots[s].part - 2 for s in shown[1]) == [m for m in range(4) if m != mirror]
        assert all(plan.slots[s].mirror == mirror for s in (*shown[0], *shown[1]))


# The ground that goes on


def ground_probe(wall_height: float):
    """(colour just inside, just outside of the ground's border [N, 3]) along rays from the mirror, by the method's own cast."""
    import mitsuba as mi

    from benchharness.kernels import backdrop, billboard

    made = on_the_ground()
    method = BillboardImpostor(walls=wall_height, mip=False, planes=1024, environment=512)
    cast = one(method, made).state.cast
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
        spread = billboard.Spread(none, none)
        met = billboard.none()
        if cast.planes.columns:
            met = billboard.nearest(
                cast.planes,
                cast.plane_pictures,
                cast.planes.columns,
                mi.UInt32(0),
                start,
                d,
                mi.Float(0),
                spread,
                mi.Bool(True),
            )
        direction, _ = backdrop.behind(cast.backdrop, start, d)
        L, _ = backdrop.look_up(cast.backdrop, mi.UInt32(0), direction, mi.Bool(True))
        hit = np.isfinite(np.array(met.t))[:, None]
        sides.append(np.where(hit, np.array(met.value).T[:, :3], np.array(L).T))
    return sides


def test_i08_the_ground_goes_on_over_its_border_with_walls_and_jumps_without():
    """I-08: colours differ by less than 1/255 across the border at h = 0."""
    inside, outside = ground_probe(1.0)
    assert np.abs(inside - outside).max() < 1 / 255
    inside, outside = ground_probe(0.0)
    assert np.abs(inside - outside).max(axis=1).mean() > 20 / 255


def test_i08_the_picture_is_the_ground_below_and_the_environment_above_the_walls():
    """I-08: above h = H the environment alone, on the ground what is there, seen with the map's parallax."""
    made = on_the_ground()
    height = 1.0
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


def test_walls_of_a_scene_whose_panorama_goes_on_from_nothing_change_nothing():
    made = card_scene()
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
        renewed = list(state.taken.renewed)
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
    assert counted(later, "pictures_taken") == 0


def test_a_card_that_moved_is_shown_where_it_is_without_a_new_picture():
    made = moving(card=shift(0.3, -0.1, 0.2))
    before, answer = shaded(BillboardImpostor(others="black"), made, 0, 1, size=(192, 128))
    exact = one(RayTraced(), made, (192, 128), 1)
    yellow = [(np.abs(a.L - (0.9, 0.8, 0.1)).max(axis=2) < 0.01) & a.active for a in (before, answer, exact)]
    assert yellow[2].sum() > 100
    assert (yellow[1] & yellow[2]).sum() > 0.97 * (yellow[1] | yellow[2]).sum()
    assert (yellow[0] & yellow[2]).sum() < 0.8 * (yellow[0] | yellow[2]).sum()


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


def test_in_a_room_balls_are_billboards_and_the_room_is_the_environment():
    made = mirror_room()
    answer, mapped, exact = (one(m, made) for m in (BillboardImpostor(), EnvironmentMap(), RayTraced()))
    assert (counted(answer, "quad_tests")[answer.active] == 3).all()
    assert rms(answer, exact, answer.active) < 0.7 * rms(mapped, exact, answer.active)


@pytest.mark.parametrize("name", ["resolution", "planes"])
def test_a_resolution_that_is_no_power_of_two_is_refused(name):
    with pytest.raises(ValueError, match=f"billboard_impostor: {name} is 100; accepted: a power of two"):
        BillboardImpostor(**{name: 100})


@pytest.mark.parametrize("name", ["billboard_impostor", "depth_impostor"])
def test_the_contract_is_kept(name):
    found = list(check.findings(plugins.discover("method")[name], FrameRenderer))
    assert [f for f in found if f.level == "fail"] == []
    assert len(found) >= 12
