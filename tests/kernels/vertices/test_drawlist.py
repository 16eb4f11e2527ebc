"""Which vertices are searched and which triangles drawn in which mirror, and that mirrors solved together show what each shows
alone."""

from __future__ import annotations

from dataclasses import dataclass, replace

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from oracles import ray_oracle
from support.mirror_room import CENTRE, EYE, RADIUS, ball, balls, mirror_ball, scene, shaded, still, walls
from support.small_room import quad

from benchharness.kernels.vertices import drawlist, patches
from benchharness.measure import truth
from benchharness.render.frame import FrameRenderer
from benchharness.scene import Object, Reflector, Scene
from methods.newton import Newton

SIZE = (160, 120)


def drawn(made: Scene, pixels: float, index: int = 0, before=None, group=None, stock=None):
    """The choice of a frame."""
    searched = [r.closed or r.mesh for r in made.reflectors]
    stock = stock or drawlist.stock(made, searched, "simplified")
    frame = FrameRenderer(made, *SIZE).render(index)
    group = list(range(len(made.reflectors))) if group is None else group
    return drawlist.chosen(stock, group, frame, len(made.objects), 10**6, pixels, before), stock


def sight_of(mirror: Reflector, made: Scene, centre, radius: float) -> patches.Sight:
    camera = made.camera(0)
    focal = 0.5 * SIZE[1] / np.tan(0.5 * np.radians(camera.fov_deg))
    poses = np.eye(4)[:3]
    return patches.looked_at(patches.of_mesh(mirror.mesh), poses, np.array(camera.eye), focal, np.array([[*centre, radius]]))


# What bounds the error of a level


def test_no_pair_of_points_is_seen_longer_in_a_ball_than_its_bound_says():
    """Reflection points in float64. The bound is paraxial: the points are in front of the ball, as the eye is."""
    made, rng = scene((walls(),), (mirror_ball(),)), np.random.default_rng(3)
    mirror = truth.Mirror(made, 0.0, SIZE, 0)
    ratios = []
    for away in (0.7, 1.0, 1.5):
        centre = np.array(CENTRE) + away * np.array([0.25, -0.9, 0.3])
        for _ in range(20):
            one, other = centre + rng.uniform(-0.05, 0.05, (2, 3))
            seen = [_pixel_of(made, _reflection(p)) for p in (one, other)]
            scale = sight_of(made.reflectors[0], made, centre, 0.09).scale.max()
            ratios.append(np.linalg.norm(seen[0] - seen[1]) / (scale * np.linalg.norm(one - other)))
    assert mirror is not None and max(ratios) < 1.05
    assert max(ratios) > 0.3  # and the bound is not idle


def _reflection(V: np.ndarray) -> np.ndarray:
    """Where a ball reflects V to EYE: a search over the plane of both, by halving."""
    E, O = np.array(EYE), np.array(CENTRE)
    e, v = E - O, V - O
    x = e / np.linalg.norm(e)
    y = v - (v @ x) * x
    y /= np.linalg.norm(y)
    low, high = 0.0, np.arctan2(v @ y, v @ x)
    for _ in range(60):
        a = 0.5 * (low + high)
        n = np.cos(a) * x + np.sin(a) * y
        R = O + RADIUS * n
        to_e, to_v = (E - R) / np.linalg.norm(E - R), (V - R) / np.linalg.norm(V - R)
        low, high = (a, high) if to_e @ n > to_v @ n else (low, a)
    return R


def _pixel_of(made: Scene, p: np.ndarray) -> np.ndarray:
    q = made.camera(0).world_to_screen(*SIZE) @ np.append(p, 1)
    return q[:2] / q[2]


def test_in_a_flat_mirror_the_bound_is_that_of_a_picture_as_far_away():
    sheet = Reflector("sheet", quad((-0.6, 0, -0.5), (1.2, 0, 0), (0, 0, 1.0)))
    made = scene((walls(),), (sheet,))
    at, radius = np.array([0.3, -1.2, 0.1]), 0.1
    camera = made.camera(0)
    focal = 0.5 * SIZE[1] / np.tan(0.5 * np.radians(camera.fov_deg))
    image = at * [1, -1, 1]
    nearest = np.linalg.norm(image - EYE) - radius
    scale = sight_of(sheet, made, at, radius).scale.max()
    assert focal / nearest <= scale * 1.001  # patches are balls: the bound is nearer than the image
    assert sight_of(sheet, made, at, radius).sagitta.max() == 0


def test_a_mirror_that_focuses_has_no_bound_and_shows_the_finest_level():
    hollow = mirror_ball().mesh
    hollow = replace(hollow, faces=hollow.faces[:, ::-1], normals=-hollow.normals)
    made = scene((walls(), *balls()), (Reflector("bowl", hollow),), still(eye=(0.0, -1.2, 0.0), target=(0, 0.4, 0)))
    assert sight_of(made.reflectors[0], made, (0, -0.1, 0), 0.05).scale.max() > 1e29
    level = drawn(made, 4.0)[0].level[0]
    assert (level[: len(made.objects)] == 0).all()


# What is left out


def test_what_is_behind_a_flat_mirror_is_left_out():
    sheet = Reflector("sheet", quad((-0.6, 0, -0.5), (1.2, 0, 0), (0, 0, 1.0)))
    made = scene((*balls(), Object("behind", ball(0.1, (0.1, 0.7, 0.1), (1, 1, 1), 1), "behind")), (sheet,))
    choice, _ = drawn(made, 1.0)
    assert (choice.level[0, :3] >= 0).all() and choice.level[0, 3] == drawlist.LEFT_OUT


def test_nothing_is_left_out_that_a_ray_meets():
    made = scene((walls(), *balls()), (mirror_ball(),))
    choice, _ = drawn(made, 1.0)
    answer = shaded(Newton(), made, 0)[0]
    active = np.array(answer.frame.active)
    p, n, v = (np.array(a, np.float64).T[active] for a in (answer.frame.p, answer.frame.n, answer.frame.v))
    which = ray_oracle.reflected_hits(made, 0.0, p, 2 * (v * n).sum(1, keepdims=True) * n - v, 0)[0]
    faces = np.cumsum([len(part.mesh.faces) for part in made.parts])
    met = np.unique(np.searchsorted(faces, which[which >= 0], side="right"))
    assert {1, 2, 3} <= set(met) and (choice.level[0, met] >= 0).all()


def test_a_mirror_out_of_the_picture_searches_nothing():
    made = scene((walls(), *balls()), (mirror_ball(), mirror_ball("aside", (1.6, -0.4, 0.0), 0.1, 32)))
    choice, _ = drawn(made, 1.0)
    assert (choice.level[1] == drawlist.LEFT_OUT).all() and (choice.level[0, :4] >= 0).all()
    answer = shaded(Newton(resolve="ray", lod_px=1.0), made, 0)[0]
    assert answer.found[answer.active].all()


def test_mirrors_show_themselves_in_no_list_and_each_other_in_all():
    made = scene((walls(),), (mirror_ball(), mirror_ball("other", (0.55, -0.6, 0.2), 0.1)))
    choice, _ = drawn(made, 0.0)
    assert (choice.level[[0, 1], [1, 2]] == drawlist.LEFT_OUT).all() and (choice.level[[0, 1], [2, 1]] == 0).all()


# Levels


def fine_balls() -> tuple[Object, ...]:
    return tuple(
        replace(o, mesh=ball(0.15, o.mesh.vertices.mean(axis=0), c, 4)) for o, c in zip(balls(), np.eye(3), strict=True)
    )


def test_levels_are_coarser_for_more_pixels_and_stay_while_the_error_is_between_half_and_all():
    made = scene((walls(), *fine_balls()), (mirror_ball(),))
    stock = drawn(made, 1.0)[1]
    few, some, many = (drawn(made, pixels, stock=stock)[0] for pixels in (0.1, 0.8, 3.0))
    mine = [c.level[0, 1:4] for c in (few, some, many)]
    assert (mine[0] < mine[1]).all() and (mine[1] < mine[2]).all()
    assert few.made.vertex_count > some.made.vertex_count > many.made.vertex_count
    # What was chosen for 1 pixel stays for 1.3 and .8 in its stead if it is allowed, and nothing is made anew.
    kept = drawn(made, 0.8 * 1.6, before=some, stock=stock)[0]
    assert kept is some
    finer = drawn(made, 0.1, before=many, stock=stock)[0]
    assert (finer.level == few.level).all()


def test_what_levels_stand_for_is_shown_as_it_is():
    made = scene((walls(), *fine_balls()), (mirror_ball(),))
    answers = [shaded(Newton(resolve="ray", lod_px=pixels), made, 0)[0] for pixels in (0.0, 1.0)]
    frame, active = answers[0].frame, answers[0].active.ravel()
    p, n, v = (np.array(a, np.float64).T[active] for a in (frame.p, frame.n, frame.v))
    _, distance, L, clear = ray_oracle.reflected_hits(made, 0.0, p, 2 * (v * n).sum(1, keepdims=True) * n - v, 0)
    assert clear.mean() > 0.9
    for answer in answers:
        off = (np.abs(answer.L[answer.active] - L).max(axis=1) > 1e-3) & clear
        assert off.mean() < 2e-3
        right = clear & ~off
        np.testing.assert_allclose(answer.distance[answer.active][right], distance[right], rtol=1e-4, atol=1e-5)


@dataclass
class Ends:
    """As methods keep them: a number per vertex, three in a row, and a point."""

    one: mi.UInt32
    three: mi.Float
    point: mi.Point2f


def test_where_searches_ended_goes_along_to_another_list():
    made = scene((walls(), *fine_balls()), (mirror_ball(),))
    old, stock = drawn(made, 0.8)
    new, _ = drawn(made, 3.0, stock=stock)
    n, m = old.made.vertex_count, new.made.vertex_count

    def ends(count: int, base: int) -> Ends:
        lane = dr.arange(mi.UInt32, count) + base
        flat = dr.arange(mi.Float, 3 * count) + 3 * base
        return Ends(lane, flat, mi.Point2f(mi.Float(lane), -mi.Float(lane)))

    made_of = drawlist.carried(ends(n, 1), ends(m, 10**6), old, new, stock)
    one, three, point = (np.array(a) for a in (made_of.one, made_of.three, made_of.point))
    same = (old.level == new.level) & (new.level != drawlist.LEFT_OUT)
    assert same[0, 0] and not same[0, 1:4].any()
    start, count = new.starts[0, 0], stock.parts[0][new.level[0, 0]].count
    was = old.starts[0, 0] + 1
    np.testing.assert_array_equal(one[start : start + count], was + np.arange(count))
    np.testing.assert_array_equal(three.reshape(-1, 3)[start + 2], 3 * (was + 2) + np.arange(3))
    np.testing.assert_array_equal(point[:, start + 3], [was + 3, -(was + 3)])
    other = new.starts[0, 2]
    assert one[other] == 10**6 + other


def test_levels_need_rays():
    with pytest.raises(ValueError, match='newton: lod_px 1 with resolve "interpolate"; accepted: 0, or "ray"'):
        Newton(lod_px=1.0)


# Mirrors that are solved together


def mirrors() -> tuple[Reflector, ...]:
    return (
        mirror_ball(),
        mirror_ball("second", (0.85, -0.2, 0.3), 0.25, 48),
        mirror_ball("third", (-0.8, 0.1, -0.4), 0.2, 64),
    )


@pytest.mark.parametrize("resolve", ["interpolate", "ray"])
def test_joined_mirrors_show_what_each_shows_alone(resolve):
    """The others are black things then, as mirrors are in other mirrors. Nothing is split: what was split is kept and given up
    for all mirrors together."""
    method, all_ = Newton(resolve=resolve, split_px=0), mirrors()[::2]
    together = shaded(method, scene((walls(), *balls()), all_), 0, 1)[-1]
    shown = np.array(together.frame.reflector).reshape(together.active.shape)
    assert together.state.joined[0] is not None
    for i, mirror in enumerate(all_):
        black = [Object(o.name, replace(o.mesh, radiance=np.zeros(3)), "black") for o in all_ if o is not mirror]
        alone = shaded(method, scene((walls(), *balls(), *black), (mirror,)), 0, 1)[-1]
        mine = (shown == i) & alone.active
        assert mine.sum() > 100 and (mine == (shown == i)).all()
        off = np.abs(together.L - alone.L).max(axis=-1)[mine]
        assert (off > 1e-3).mean() < 2e-3
        np.testing.assert_array_equal(together.found[mine], alone.found[mine])


def test_vertices_of_joined_mirrors_are_told_in_the_scenes_order():
    all_ = mirrors()
    made = scene((walls(), *balls()), all_)
    found = {way: shaded(Newton(resolve=way), made, 0)[0].reflection.vertices for way in ("interpolate", "ray")}
    count = made.vertices
    for vertices in found.values():
        assert dr.width(vertices.R) == len(all_) * count
    parts = np.repeat(np.arange(len(made.parts)), [len(part.mesh.vertices) for part in made.parts])
    for i in range(len(all_)):
        region = np.array(found["interpolate"].region)[i * count : (i + 1) * count]
        assert (region[parts == len(made.objects) + i] == 0).all()
        R = np.array(found["interpolate"].R).T[i * count : (i + 1) * count]
        on = np.linalg.norm(R - all_[i].mesh.vertices.mean(axis=0), axis=1)[region == 1]
        radius = np.linalg.norm(all_[i].mesh.vertices - all_[i].mesh.vertices.mean(axis=0), axis=1).max()
        assert len(on) > 100 and abs(on - radius).max() < 0.04 * radius
    R = [np.array(v.R) for v in found.values()]
    both = np.all([np.array(v.converged) for v in found.values()], axis=0)
    assert both.sum() > 1000
    np.testing.assert_allclose(R[0][:, both], R[1][:, both], atol=1e-3)


def test_a_mirror_far_from_the_origin_is_searched_as_one_near_it():
    """Joined mirrors stand in cells of a space of their own, whatever their places are."""
    shift = np.array([40.0, -30.0, 20.0])
    near = scene((walls(), *balls()), mirrors())

    def moved(part):
        return replace(part, mesh=replace(part.mesh, vertices=part.mesh.vertices + shift))

    camera = still(tuple(np.array(EYE) + shift), tuple(np.array(CENTRE) + shift))
    far = scene(map(moved, near.objects), map(moved, near.reflectors), camera)
    one, other = (shaded(Newton(), made, 0)[0] for made in (near, far))
    both = one.active & other.active
    assert both.sum() > 0.98 * one.active.sum()
    assert (np.abs(one.L - other.L).max(axis=-1)[both] > 0.02).mean() < 0.02
