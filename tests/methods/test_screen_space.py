"""Screen-space reflections: what the picture holds is right, what it does not hold is not claimed, and both marches agree."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from oracles import screen_oracle
from scipy.ndimage import binary_erosion
from support.mirror_room import Answer, ball, lit, mirror_room, plain, scene, shaded, still, walls
from support.small_room import box, quad

from benchharness.kernels.images import screen
from benchharness.render.frame import FrameRenderer
from benchharness.scene import Object, Reflector, Scene
from methods.ray_traced import RayTraced
from methods.screen_space import ScreenSpace

SIZE = (150, 110)
SKY = (0.1, 0.2, 0.4)
RED, GREEN = (0.9, 0.1, 0.1), (0.1, 0.8, 0.1)
BOTH = ("linear", "hierarchical")


def floor() -> Reflector:
    return Reflector("floor", quad((-1, -1, 0), (2, 0, 0), (0, 2, 0)))


def standing(*more: Object, camera=None, **others) -> Scene:
    """A box on a mirror."""
    block = Object("box", lit(box((-0.3, -0.2, 0), (0.3, 0.4, 0.8)), 0.4), "stands on it")
    return scene((block, *more), (floor(),), camera or still((0.6, -3, 1.2), (0, 0, 0.3)), background=SKY, **others)


def doubted(answer: Answer) -> np.ndarray:
    return np.broadcast_to(np.array(answer.reflection.doubt), answer.active.size).reshape(answer.active.shape)


def sure(answer: Answer) -> np.ndarray:
    return answer.active & answer.found & ~doubted(answer)


def asked(made: Scene, *methods, size=SIZE) -> list[Answer]:
    renderer = FrameRenderer(made, *size)
    return [shaded(method, made, 0, renderer=renderer)[0] for method in methods]


def places(answer: Answer, made: Scene) -> np.ndarray:
    """Where on the screen the shown points are, [H, W, 2]; a distance of inf is no point."""
    frame, shape = answer.frame, answer.active.shape
    p, n, v = (np.array(a, np.float64).T.reshape(*shape, 3) for a in (frame.p, frame.n, frame.v))
    r = 2 * (v * n).sum(axis=2, keepdims=True) * n - v
    q = p + np.where(np.isfinite(answer.distance), answer.distance, 0)[..., None] * r
    rows = made.camera(0.0).world_to_screen(shape[1], shape[0])
    h = q @ rows[:, :3].T + rows[:, 3]
    return h[..., :2] / np.where(h[..., 2:] == 0, 1, h[..., 2:])


# What it knows


@pytest.mark.parametrize("march", BOTH)
def test_of_a_box_on_a_mirror_all_that_the_eye_sees_is_answered_and_right(march):
    """Planes are exact between pixels: the distance to float32's precision of 1 / depth, but where the box has an edge within a
    pixel. Radiance is bilinear between pixels."""
    made = standing()
    known = screen_oracle.known(made, *SIZE)
    (answer,) = asked(made, ScreenSpace(march=march, fallback="none"))
    mirror, seen = (a.reshape(answer.active.shape) for a in (known.mirror, known.seen))
    assert seen.sum() > 250 and mirror[answer.active].mean() > 0.97
    right = sure(answer) & mirror
    assert not (right & ~seen).any()
    # The rest shows what is within two pixels of the box's outline, or of the mirror.
    drawn = np.abs(np.array(answer.frame.radiance).T.reshape(*right.shape, 3) - SKY).max(axis=2) > 0.05
    inside = np.asarray(binary_erosion(drawn & ~answer.active, iterations=2), bool)
    column, row = np.where(seen[..., None], known.place.reshape(*right.shape, 2), 0).astype(int).transpose(2, 0, 1)
    within = seen & mirror & inside[row, column]
    assert right.sum() > 0.85 * (seen & mirror).sum() and within.sum() > 250
    assert (within & ~right).sum() <= 2
    off = np.abs(answer.distance[right] / known.distance.reshape(right.shape)[right] - 1)
    assert np.median(off) < 1e-5 and (off > 2e-4).mean() < 0.06 and off.max() < 0.06
    assert np.abs(answer.L[right] - known.radiance.reshape(*right.shape, 3)[right]).max() < 0.01
    counted = np.array(answer.reflection.counters["on_screen"])
    assert counted.sum() == (answer.active & answer.found).sum()


@pytest.mark.parametrize("size", [(150, 110), (91, 127)])
def test_both_marches_meet_the_same_within_a_pixel(size):
    for made in (standing(walls(2.5), camera=still((0.6, -2.4, 1.2), (0, 0, 0.3))), mirror_room())[: 2 if size == SIZE else 1]:
        one, two = asked(made, *(ScreenSpace(march=march, fallback="none") for march in BOTH), size=size)
        both = one.active & one.found & two.found
        assert both.sum() > 100 and (one.found ^ two.found).sum() < 0.03 * both.sum()
        apart = np.abs(places(one, made) - places(two, made)).max(axis=2)[both & np.isfinite(one.distance + two.distance)]
        assert (apart > 1).mean() < 0.02 and np.median(apart) < 1e-2
        steps = [np.array(a.reflection.counters["screen_steps"]).sum() for a in (one, two)]
        assert steps[1] < 0.6 * steps[0]


def test_a_ray_that_ends_in_the_sky_of_the_picture_shows_it():
    """Low over the mirror: the ray's vanishing point is in the picture. Where it is not, the sky is not known."""
    made = standing(camera=still((0.6, -3, 0.5), (0, 0, 0.5)))
    (answer,) = asked(made, ScreenSpace(fallback="none"))
    sky = sure(answer) & np.isinf(answer.distance)
    known = screen_oracle.known(made, *SIZE)
    assert sky.sum() > 0.25 * answer.active.sum()
    assert np.isinf(known.distance.reshape(sky.shape)[sky & known.mirror.reshape(sky.shape)]).all()
    np.testing.assert_allclose(answer.L[sky], np.tile(SKY, (sky.sum(), 1)), atol=1e-6)
    (steep,) = asked(standing(), ScreenSpace(fallback="none"))
    assert not (steep.found & np.isinf(steep.distance)).any()


# What it does not know


def test_what_is_behind_the_eye_or_turned_away_is_not_claimed():
    """A mirror ball in a room: most of what it shows is beside or behind the eye; balls before it show the eye their backs."""
    made = mirror_room()
    none, environment, truth = asked(made, ScreenSpace(fallback="none"), ScreenSpace(), RayTraced())
    assert sure(none).sum() == sure(environment).sum() < 0.06 * none.active.sum()
    wrong = np.abs(none.L - truth.L).max(axis=2) > 0.02
    assert not (wrong & sure(none)).any() and sure(none).sum() > 100
    assert not (none.L[none.active & ~none.found]).any() and np.isinf(none.distance[none.active & ~none.found]).all()
    plain_answer = shaded(ScreenSpace(), made, 0, renderer=FrameRenderer(made, *SIZE), doubts=False)[0]
    assert plain_answer.reflection.doubt is None and plain_answer.same(environment)
    # With the other answer, all is found, and what it has from there is doubted.
    assert environment.found[environment.active].all()
    assert doubted(environment)[environment.active & ~none.found].all()
    assert (environment.L[environment.active].max(axis=1) > 0.1).all()


def test_a_card_between_eye_and_mirror_is_not_met_from_behind():
    """Rays towards the eye come from behind the card, which the mirror shows from its other side."""
    wall = Reflector("wall", quad((-1, 0, -1), (2, 0, 0), (0, 0, 2)))
    card = Object("card", plain(quad((-0.2, -1, -0.2), (0.4, 0, 0), (0, 0, 0.4)), RED), "stands before it")
    made = scene((card,), (wall,), still((0.5, -3, 0.4)), background=SKY)
    for march in BOTH:
        for thickness in (0.05, 1e3):
            answer, truth = asked(made, ScreenSpace(march=march, thickness=thickness, fallback="none"), RayTraced())
            assert (np.abs(truth.L - RED).max(axis=2)[answer.active] < 1e-3).sum() > 50
            assert not sure(answer).any()


def behind_a_bar() -> Scene:
    """Rays from the floor to the far wall pass behind a bar near the eye, which the mirror does not show there."""
    post = Object("bar", plain(box((-2.0, -1.9, 0.75), (0.0, -1.8, 0.85)), RED), "is in the way")
    wall = Object("wall", plain(quad((-3, 1.2, 0), (6, 0, 0), (0, 0, 3)), GREEN), "is what is seen")
    return scene((post, wall), (floor(),), still((0.0, -3, 1.0), (0, 0, 0.6)), background=SKY)


def test_what_passes_behind_a_bar_is_no_hit_and_whatever_the_thickness_nothing_wrong_is_sure():
    red = {}
    for thickness in (1e-4, 0.2, 1e4):
        answer, truth = asked(behind_a_bar(), ScreenSpace(thickness=thickness, fallback="none"), RayTraced())
        assert not (sure(answer) & (np.abs(answer.L - truth.L).max(axis=2) > 0.02)).any()
        red[thickness] = (answer.active & answer.found & (answer.L[..., 0] > 0.5) & (truth.L[..., 0] < 0.5)).sum()
        assert sure(answer).sum() > 0.3 * answer.active.sum()
    assert red[1e4] > 30 and red[0.2] < 0.1 * red[1e4]


@pytest.mark.parametrize("march", BOTH)
def test_things_without_thickness_have_no_gaps(march):
    """A ray that comes to be behind within a pixel has met it, however far it goes on within that pixel."""
    thin, thick = asked(standing(), *(ScreenSpace(march=march, thickness=t, fallback="none") for t in (0.0, 0.5)))
    assert sure(thin).sum() >= sure(thick).sum() - 5 > 250


# Steps


def test_steps_end_and_reach_as_far_as_they_are_many():
    made = standing()
    for march in BOTH:
        shares = []
        for most in (1, 4, 16, 64, 4096):
            (answer,) = asked(made, ScreenSpace(march=march, max_steps=most, fallback="none"))
            steps = np.array(answer.reflection.counters["screen_steps"])
            assert steps.max() <= most
            shares.append(sure(answer).sum())
        assert shares == sorted(shares) and shares[0] < 0.2 * shares[-1] and steps.max() < 2 * sum(SIZE)
        assert shares[2] > 2 * shares[0]


def test_the_same_picture_from_farther_is_answered_as_well():
    """Steps are pixels: what they reach does not depend on the distance, for the same picture."""
    near, far = (
        asked(
            standing(camera=still(0.3 * np.array([0, 0, 1]) + k * np.array([0.6, -3, 0.9]), (0, 0, 0.3), fov)), ScreenSpace()
        )[0]
        for k, fov in ((1.0, 45.0), (40.0, float(np.degrees(2 * np.arctan(np.tan(np.radians(22.5)) / 40)))))
    )
    shares = [sure(a).sum() / a.active.sum() for a in (near, far)]
    assert shares[1] == pytest.approx(shares[0], rel=0.25) and shares[0] > 0.1


def made_up(nearness: np.ndarray) -> screen.Screen:
    """A screen of given ν [H, W] without mirrors; its levels by NumPy."""
    height, width = nearness.shape
    level = np.zeros((screen.padded(height), screen.padded(width)), np.float32)
    level[:height, :width] = nearness
    levels = [level]
    while max(levels[-1].shape) > 1:
        h, w = levels[-1].shape
        tall, wide = levels[-1].reshape(max(h // 2, 1), min(h, 2), w).max(axis=1), None
        wide = tall.reshape(len(tall), max(w // 2, 1), min(w, 2)).max(axis=2)
        levels.append(wide)
    starts = np.cumsum([0] + [one.size for one in levels[:-1]])
    none = dr.full(mi.Int32, -1, width * height)
    return screen.Screen(
        mi.Float(np.concatenate([one.ravel() for one in levels])), mi.UInt32(starts.astype(np.uint32)),
        level.shape[1], level.shape[0], len(levels), mi.Color3f(mi.Float(nearness.ravel())), none, width, height,
    )  # fmt: skip


def lines(rng, count: int, width: int, height: int) -> screen.Line:
    """Rays from centres of pixels in any direction, some along axes, some that hardly move, far and near ends."""
    x, y = (rng.integers(0, size, count) + 0.5 for size in (width, height))
    ends = np.stack([x, y], 1) + rng.normal(size=(count, 2)) * np.exp(rng.uniform(-9, 6, (count, 1)))
    ends[::5, 0], ends[1::5, 1] = x[::5], y[1::5]
    extent = np.maximum(np.abs(ends - np.stack([x, y], 1)).max(axis=1), 1e-6)
    ax, ay = (ends - np.stack([x, y], 1)).T / extent
    with np.errstate(divide="ignore"):
        leave = [np.where(s > 0, size - c, c) / np.abs(s) for c, s, size in ((x, ax, width), (y, ay, height))]
    start, stop = rng.uniform(1.7, 2.0, count), rng.uniform(0.0, 0.6, count)
    start, stop = np.where(extent < 2, 3.0, start), np.where(extent < 2, 2.9, stop)  # in front within the first pixel
    end = np.minimum(extent, np.minimum(*leave))
    x, y, ax, ay, start, slope, end = (
        mi.Float(a.astype(np.float32)) for a in (x, y, ax, ay, start, (stop - start) / extent, end)
    )
    return screen.Line(x, y, ax, ay, start, slope, end, mi.Bool(False), mi.Float(1), mi.Int32(0))


@pytest.mark.parametrize("shape", [(48, 80), (37, 101), (64, 64)])
def test_both_marches_come_to_their_end_over_any_depths_and_meet_alike(shape):
    rng = np.random.default_rng(5)
    y, x = np.mgrid[: shape[0], : shape[1]]
    nearness = 0.4 + 0.3 * np.sin(0.11 * x + 0.07 * y)
    nearness[shape[0] // 3 : shape[0] // 2, 10:30] = 1.6
    nearness[-8:, -20:] = 0
    seen, of = made_up(nearness), lines(rng, 8000, shape[1], shape[0])
    every = dr.full(mi.Bool, True, 8000)
    one, two = (
        march(seen, of, mi.Float(0.3), mi.UInt32(4 * sum(shape)), every) for march in (screen.linear, screen.hierarchical)
    )
    for met in (one, two):
        assert dr.all(met.hit | met.completed)
    a, b = np.array(one.hit), np.array(two.hit)
    assert a.sum() > 400 and (a != b).mean() < 0.03
    ends = [np.array(screen.refined(seen, of, met, 8)[0]) for met in (one, two)]
    clean = a & b & ~np.array(one.behind | two.behind)
    assert (np.abs(ends[0] - ends[1])[clean] > 1.5).mean() < 0.03
    # Between pixels the ray is at the surface, to a thousandth.
    tau, closed = screen.refined(seen, of, two, 8)
    closed &= ~two.behind
    px, py = of.at(tau)
    off = np.abs(np.array(screen.surface(seen, of, px, py, every).nearness - of.nu(tau)))[np.array(closed)]
    assert len(off) > 200 and np.median(off) < 1e-3


def test_the_pyramid_is_of_the_nearest_and_of_any_size():
    made = standing()
    for size in ((37, 21), (5, 90)):
        renderer = FrameRenderer(made, *size)
        frame = renderer.render(0)
        method = ScreenSpace(fallback="none", resolution=4)
        world = method.update(method.prepare(made), frame).world
        assert world is not None
        seen = screen.of_view(world, frame.view, frame.radiance, frame.reflector)
        finest = np.array(seen.nearness)[: seen.across * seen.down].reshape(seen.down, seen.across)
        assert (finest.shape[0] >= size[1]) and not finest[size[1] :].any() and not finest[:, size[0] :].any()
        assert finest.max() > 0
        expected = made_up(finest[: size[1], : size[0]])
        np.testing.assert_array_equal(np.array(seen.nearness), np.array(expected.nearness))
        np.testing.assert_array_equal(np.array(seen.starts), np.array(expected.starts))


# Several mirrors, and what moves


def test_other_mirrors_are_black_and_doubted():
    upright = Reflector("upright", quad((-0.8, 0.9, 0), (1.6, 0, 0), (0, 0, 0.8)))
    made = scene((walls(2.5),), (floor(), upright), still((0.3, -2.2, 0.9), (0, 0.4, 0.2)))
    answer, truth = asked(made, ScreenSpace(fallback="none"), RayTraced())
    black = answer.active & answer.found & (answer.L.max(axis=2) == 0)
    assert black.sum() > 100 and doubted(answer)[black].all()
    assert not (sure(answer) & (np.abs(answer.L - truth.L).max(axis=2) > 0.03)).any() and sure(answer).any()


def test_what_moves_is_where_it_is_in_the_picture():
    def shift(time):
        pose = np.eye(4)
        pose[:3, 3] = [0.4 * time, 0, 0.2 * time]
        return pose

    thing = Object("ball", ball(0.25, (-0.4, 0.3, 0.3), RED), "moves", motion=shift)
    made = scene((thing,), (floor(),), still((0.6, -3, 1.2), (0, 0, 0.3)), background=SKY, fps=1.0)
    renderer = FrameRenderer(made, *SIZE)
    for answer, truth in zip(*(shaded(m, made, 0, 1, renderer=renderer) for m in (ScreenSpace(), RayTraced())), strict=True):
        assert sure(answer).sum() > 30
        assert np.abs(answer.L - truth.L)[sure(answer)].max() < 0.02


def test_a_resolution_that_is_no_power_of_two_is_refused():
    with pytest.raises(ValueError, match="screen_space: resolution is 100; accepted: a power of two"):
        ScreenSpace(resolution=100)
