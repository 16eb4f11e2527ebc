"""The teapots: closed mirrors with true normals, that never touch each other, one of which glides."""

from __future__ import annotations

from functools import cache
from itertools import combinations, pairwise

import numpy as np
import pytest
from scipy.spatial import cKDTree
from support import courtyard_claims as claims

from benchharness.scene import Scene, subdivided
from scenes.props import pottery
from scenes.teapots import DETAILS, GLIDER, HALF, PLACES, POTS, SUNK, TURN_DEG, WAY, Glide, teapots


@cache
def built(detail="lean", pots=POTS, moving=True) -> Scene:
    return teapots(detail, pots, moving=moving)


# What is asked for


@pytest.mark.parametrize(("detail", "triangles"), [("lean", 4100), ("paper", 16000)])
def test_a_pot_has_as_many_triangles_as_its_detail_says(detail, triangles):
    for r in built(detail).reflectors:
        assert 0.9 * triangles < len(r.mesh.faces) <= triangles


def test_the_scene_says_what_was_asked_for():
    scene = built("paper", 2, False)
    assert (scene.name, scene.detail, scene.frames, scene.fps) == ("teapots", "paper", 100, 25)
    assert scene.source == {"detail": "paper", "pots": 2, "moving": False, "base_vertices": scene.vertices}
    assert [r.name for r in scene.reflectors] == ["pot-silver", "pot-gold"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"detail": "rich"}, "detail is 'rich'; accepted: lean, paper"),
        ({"pots": 0}, "pots is 0; accepted: whole numbers from 1 to 4"),
        ({"pots": 5}, "pots is 5; accepted"),
        ({"pots": True}, "pots is True; accepted"),
        ({"pots": 2.0}, "pots is 2.0; accepted"),
        ({"moving": 1}, "moving is 1; accepted: true or false"),
    ],
)
def test_anything_else_is_refused_by_name(arguments, message):
    with pytest.raises(ValueError, match=message):
        teapots(**arguments)


def test_more_pots_leave_the_others_where_they_are():
    for pots in range(1, POTS):
        claims.more_mirrors_leave_the_others_where_they_are(built(pots=pots), built())


def test_it_stands_in_the_courtyard():
    claims.stands_in_the_courtyard(built())


def test_it_can_be_sent_to_another_process():
    claims.can_be_sent_to_another_process(built())


# The pots


@pytest.mark.parametrize("detail", ["lean", "paper"])
def test_pots_are_closed_and_their_normals_unit_and_outward(detail):
    claims.mirrors_are_closed_and_their_normals_unit_and_outward(built(detail), pieces=3)


def test_normals_of_the_body_are_across_its_profile():
    # Neighbours on one ring and on one meridian of a fine pot: chords are across the normal halfway, to second order.
    pot = pottery.teapot(1.0, pottery.Fineness(256, 64, 8, 5, 8, 5))
    piece = pot.faces[(np.hypot(pot.vertices[:, 0], pot.vertices[:, 1]) <= 1.0 + 1e-9)[pot.faces].all(axis=1)]
    body = piece[piece.max(axis=1) < len(pot.vertices) - 2 * (5 * 8 + 9 + 9) - 40]
    v, n = pot.vertices[body], pot.normals[body]
    for k in range(3):
        chord, middle = v[:, (k + 1) % 3] - v[:, k], n[:, (k + 1) % 3] + n[:, k]
        sine = abs((chord * middle).sum(axis=1)) / np.linalg.norm(chord, axis=1) / np.linalg.norm(middle, axis=1)
        assert np.degrees(np.arcsin(np.quantile(sine, 0.999))) < 0.3


@pytest.mark.parametrize(("detail", "degrees"), [("lean", 0.7), ("paper", 0.25)])
def test_normals_interpolated_on_the_belly_are_those_of_its_profile(detail, degrees):
    # Halfway along each edge between rings, against the profile at that height. Edges around are symmetric: no error there.
    p, n = (np.concatenate(a) for a in zip(*(pottery._stretch([c], [2000]) for c in pottery.BODY[:2]), strict=True))
    pot = pottery.teapot(1.0, DETAILS[detail])
    edges = np.unique(np.sort(pot.faces[:, 1:], axis=1), axis=0)
    a, b = pot.vertices[edges].swapaxes(0, 1)
    away = np.hypot(a[:, 0], a[:, 1])
    same = (abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) < 1e-9) & (a[:, 2] != b[:, 2])
    belly = same & (np.minimum(a[:, 2], b[:, 2]) > 0.1) & (np.maximum(a[:, 2], b[:, 2]) < 1.13)
    on = abs(np.interp(a[:, 2], p[:, 1], p[:, 0]) - away) < 1e-4
    on &= abs(np.interp(b[:, 2], p[:, 1], p[:, 0]) - np.hypot(b[:, 0], b[:, 1])) < 1e-4
    chosen = edges[belly & on]
    assert len(chosen) > 200
    middle, normal = pot.vertices[chosen].mean(axis=1), pot.normals[chosen].sum(axis=1)
    # The point of the profile that the middle's normal leads to.
    r, z = np.hypot(middle[:, 0], middle[:, 1]), middle[:, 2]
    nearest = np.argmin((p[None, :, 0] - r[:, None]) ** 2 + (p[None, :, 1] - z[:, None]) ** 2, axis=1)
    radial = (normal[:, :2] * middle[:, :2]).sum(axis=1) / r
    angle = np.arctan2(normal[:, 2], radial) - np.arctan2(n[nearest, 1], n[nearest, 0])
    assert np.degrees(abs(angle).max()) < degrees


@pytest.mark.parametrize("curves", [pottery.BODY, pottery.LID])
def test_curves_of_the_profile_go_over_into_each_other_with_one_tangent(curves):
    for one, other in pairwise(curves):
        assert one[-1] == other[0]
        a, b = np.subtract(one[-1], one[-2]), np.subtract(other[1], other[0])
        cosine = a @ b / np.linalg.norm(a) / np.linalg.norm(b)
        assert np.degrees(np.arccos(min(cosine, 1.0))) < 0.5


def test_the_profile_is_without_a_gap_and_as_wide_and_high_as_it_says():
    stretches = ([pottery.BOTTOM], [pottery.FOOT], pottery.BODY, pottery.LID)
    for one, other in pairwise(stretches):
        assert one[-1][-1] == other[0][0]
    pot = pottery.teapot(2.0, DETAILS["lean"])
    away = np.hypot(pot.vertices[:, 0], pot.vertices[:, 1])
    assert pot.vertices[:, 2].max() == pytest.approx(2 * pottery.HEIGHT, abs=1e-12)
    assert pot.vertices[:, 2].min() == 0
    assert 1.5 * 2 < away.max() < 2 * pottery.REACH


def test_ends_of_spout_and_handle_are_inside_the_body():
    fine = pottery.Fineness(64, 8, 16, 9, 16, 9)
    profile = np.concatenate([pottery._stretch([c], [50])[0] for c in (pottery.FOOT, *pottery.BODY)])
    for stations in (pottery.SPOUT[:1], pottery.HANDLE[:1], pottery.HANDLE[-1:]):
        x, z, a, b, turn = *stations[0][:4], np.radians(stations[0][4])
        angle = np.linspace(0, 2 * np.pi, 100)
        px, pz = x + a * np.cos(angle) * np.cos(turn), z + a * np.cos(angle) * np.sin(turn)
        radius = np.interp(pz, profile[:, 1], profile[:, 0])
        assert (np.hypot(px, b * np.sin(angle)) < radius - 0.005).all()
    assert len(pottery.teapot(1.0, fine).faces) > 0


# Where they are


def test_pots_stand_on_the_floor_in_all_frames():
    claims.mirrors_touch_the_floor_or_stay_above_it(built())
    for r in built().reflectors:
        assert r.mesh.vertices[:, 2].min() == -SUNK


def test_pots_never_touch_each_other():
    # Two triangles with edges up to h that meet have corners within h / sqrt(3) of where they do.
    h, scene = 0.015, built()
    fine = {r.name: subdivided(r.mesh, h).vertices for r in scene.reflectors}
    frames = {name: (range(50, 100) if r.motion else (0,)) for name, r in zip(fine, scene.reflectors, strict=True)}
    poses = {r.name: r.pose for r in scene.reflectors}
    trees = {name: cKDTree(v) for name, v in fine.items()}
    for one, other in combinations(fine, 2):
        still, mover = (one, other) if len(frames[one]) == 1 else (other, one)
        for frame in frames[mover]:
            pose = poses[mover](scene.time(frame))
            away = trees[still].query(fine[mover] @ pose[:3, :3].T + pose[:3, 3], distance_upper_bound=0.05)[0]
            assert away.min() > 2 * h / np.sqrt(3), (one, other, frame)
    # And none is within another.
    for one, other in combinations(PLACES, 2):
        assert np.hypot(*np.subtract(one.at, other.at)) > one.radius + other.radius


def test_one_pot_glides_and_only_in_the_second_half():
    claims.only_this_moves_and_only_in_the_second_half(built(), f"pot-{GLIDER}", built(moving=False))


def test_the_pot_glides_smoothly_to_where_it_is_said():
    scene = built()
    pot = scene.reflectors[1]
    way = np.array([moved[:2, 3] + moved[:2, :2] @ PLACES[1].at for moved in (pot.pose(scene.time(f)) for f in range(100))])
    assert np.allclose(way[0], PLACES[1].at, atol=1e-15)
    assert np.allclose(way[-1], np.add(PLACES[1].at, WAY), atol=1e-12)
    # At most 15 / 8 of the mean speed, and 10 / sqrt(3) of length / time² of acceleration (of the quintic).
    step = np.linalg.norm(np.diff(way, axis=0), axis=1)
    length = np.hypot(*WAY)
    assert step.max() < 15 / 8 * length / 49
    assert np.linalg.norm(np.diff(way, n=2, axis=0), axis=1).max() < 10 / np.sqrt(3) * length / 49**2
    turn = Glide((0, 0), (0, 0), TURN_DEG)(scene.time(99))
    assert np.degrees(np.arctan2(turn[1, 0], turn[0, 0])) == pytest.approx(TURN_DEG)
    assert scene.time(claims.HALF_WAY) == HALF


def test_the_camera_goes_around_then_rests_and_all_pots_are_in_the_picture():
    claims.camera_goes_around_then_rests_and_all_mirrors_are_in_the_picture(built())
