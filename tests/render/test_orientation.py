"""Fronts are where they are seen from, however a file winds its triangles."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from oracles.room_oracle import HALF, picture, room
from support.small_room import box, quad, sphere
from support.tiers import complete, exhaustive

from benchharness.measure import metrics
from benchharness.measure.bench import Bench
from benchharness.modelling import winding
from benchharness.render import reference
from benchharness.render.orientation import oriented
from benchharness.render.reference import ReferenceOptions
from benchharness.scene import Mesh, Object, merged
from benchharness.study import plugins

SIZE = (160, 120)
METHODS = [name for name, plugin in plugins.discover("method").items() if plugin.error is None]


def wound(mesh: Mesh, turn: np.ndarray, normals=None) -> Mesh:
    """Some faces wound the other way; normals that follow from that if none are given."""
    return Mesh(mesh.vertices, winding.turned(mesh.faces, np.where(turn, -1, 1)), normals, radiance=mesh.radiance)


def welded(mesh: Mesh) -> Mesh:
    """Without its seams."""
    solid = trimesh.Trimesh(mesh.vertices, mesh.faces, process=True)
    return Mesh(np.asarray(solid.vertices), np.asarray(solid.faces))


def volume(mesh: Mesh) -> float:
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces], 1, 0)
    return float(np.einsum("fi,fi->", a, np.cross(b, c)) / 6)


def with_ball(scene, mesh: Mesh):
    return replace(scene, reflectors=tuple(replace(r, mesh=mesh, closed=mesh) for r in scene.reflectors))


HALF_OF_IT = np.random.default_rng(3).random(10_000) < 0.5


def test_a_box_of_six_quads_is_one_closed_piece():
    found = winding.pieces(box((0, 0, 0), (1, 1, 1)))
    assert found.closed.tolist() == [True] and found.two_sided.all() and (found.sign == 1).all()


def test_two_boxes_that_share_an_edge_are_two_closed_pieces():
    found = winding.pieces(merged(box((0, 0, 0), (1, 1, 1)), box((1, 1, 0), (2, 2, 1))))
    assert found.closed.tolist() == [True, True]
    assert found.piece.tolist() == [0] * 12 + [1] * 12


def test_a_moebius_strip_has_one_side_and_a_band_has_two():
    def strip(turns: float) -> Mesh:
        a = np.linspace(0, 2 * np.pi, 24, endpoint=False)
        out = [
            np.stack(
                [(2 + s * np.cos(turns * a)) * np.cos(a), (2 + s * np.cos(turns * a)) * np.sin(a), s * np.sin(turns * a)], 1
            )
            for s in (-0.5, 0.5)
        ]
        i = np.arange(24)
        j = (i + 1) % 24
        crossed = (turns == 0.5) & (j == 0)
        low, high = np.where(crossed, j + 24, j), np.where(crossed, j, j + 24)
        return Mesh(np.concatenate(out), np.concatenate([np.stack([i, low, i + 24], 1), np.stack([low, high, i + 24], 1)]))

    assert winding.pieces(strip(0.0)).two_sided.tolist() == [True]
    assert winding.pieces(strip(0.5)).two_sided.tolist() == [False]


def test_faces_wound_at_random_are_wound_as_most_of_the_area_is():
    ball = welded(sphere(1.0, slices=24, stacks=12))
    turn = HALF_OF_IT[: len(ball.faces)] & (ball.vertices[ball.faces].mean(axis=1)[:, 2] > 0)
    found = winding.pieces(wound(ball, turn))
    assert (found.sign == np.where(turn, -1, 1)).all() and found.closed.all()


@pytest.mark.parametrize(
    "turn", [pytest.param(np.ones(10_000, bool), marks=pytest.mark.exhaustive), HALF_OF_IT], ids=["all", "half"]
)
def test_a_mirror_wound_wrongly_is_turned_outwards_with_its_normals(turn):
    ball = welded(sphere(0.5, slices=48, stacks=24))
    wrong = wound(ball, turn[: len(ball.faces)])
    made, notes = oriented(with_ball(room(), wrong))
    mesh = made.reflectors[0].mesh
    assert volume(mesh) == pytest.approx(volume(ball)) and volume(mesh) > 0
    assert (mesh.normals * mesh.vertices).sum(axis=1).min() > 0.99 * 0.5
    assert made.reflectors[0].closed is mesh and notes[0].faces == turn[: len(ball.faces)].sum()


@pytest.mark.parametrize(
    "turn", [pytest.param(np.ones(10_000, bool), marks=(exhaustive, complete)), HALF_OF_IT], ids=["all", "half"]
)
def test_every_method_shows_what_it_shows_of_a_mirror_wound_rightly(turn):
    # Turned as a whole, it is the same mesh that methods get, by the test before: left to all of the tests.
    ball = welded(sphere(0.5, slices=48, stacks=24))
    right, wrong = (with_ball(room(), mesh) for mesh in (ball, wound(ball, turn[: len(ball.faces)])))
    benches = [Bench(scene, SIZE, ReferenceOptions(spp=2), None, 0, (1, 1)) for scene in (right, wrong)]
    truth, mask = picture(SIZE)
    for name in METHODS:
        if plugins.discover("method")[name].target().refuses(right) is not None:
            continue  # as those of flat mirrors do
        (one, seen), (other, _) = (bench.show(0, name, plugins.discover("method")[name].target()) for bench in benches)
        assert other["flip"] == pytest.approx(one["flip"], abs=1e-6), name
        assert other["mask_diff_px"] <= 2
        if name == "ray_traced":  # against closed form, with 48 segments: facets up to 2e-3 radii below the ball
            both = mask & seen.mask
            assert metrics.flip_map(seen.image, truth.astype(np.float32), both, ppd=67.0, exposure=0.0)[both].mean() < 0.025


def test_a_room_wound_outwards_is_turned_to_the_eye_within():
    made, notes = oriented(room(inside=False))
    assert notes[0].faces == notes[0].of and notes[0].remarkable
    assert volume(made.objects[0].mesh) == pytest.approx(-((2 * HALF) ** 3))
    same, none = oriented(room())
    assert none == [] and (same.objects[0].mesh.faces == room().objects[0].mesh.faces).all()


def test_from_outside_a_room_wound_inwards_hides_what_is_in_it():
    scene = room()
    camera = replace(scene.camera(0.0), eye=(0.0, -6.0, 1.0))
    made = oriented(replace(scene, camera=lambda t: camera))[0]
    assert volume(made.objects[0].mesh) > 0
    bench = Bench(replace(scene, camera=lambda t: camera), SIZE, ReferenceOptions(spp=2), None, 0, (1, 1))
    record = bench.show(0, "ray_traced", plugins.discover("method")["ray_traced"].target())[0]
    assert (record["reflector_px"], record["reference_px"]) == (0, 0)


def test_a_floor_wound_downwards_is_turned_up_and_a_poster_between_eye_and_mirror_is_left():
    floor = quad((-2, -2, -1.9), (0, 4, 0), (4, 0, 0))
    poster = quad((-0.3, -1.0, -0.3), (0.6, 0, 0), (0, 0, 0.6))
    scene = room()
    things = tuple(Object(name, mesh, "a sheet") for name, mesh in (("floor", floor), ("poster", poster)))
    made, notes = oriented(replace(scene, objects=(*scene.objects, *things)))
    assert [note.part for note in notes] == ["object floor"]
    assert (made.objects[1].mesh.normals @ [0, 0, 1] > 0.99).all()
    assert made.objects[2].mesh is poster


def test_a_mirror_with_one_side_is_refused_by_name():
    a = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    edge = [
        np.stack([(0.3 + s * np.cos(a / 2)) * np.cos(a), (0.3 + s * np.cos(a / 2)) * np.sin(a), s * np.sin(a / 2)], 1)
        for s in (-0.1, 0.1)
    ]
    i = np.arange(24)
    j = (i + 1) % 24
    low, high = np.where(j == 0, 24, j), np.where(j == 0, 0, j + 24)
    strip = Mesh(np.concatenate(edge), np.concatenate([np.stack([i, low, i + 24], 1), np.stack([low, high, i + 24], 1)]))
    with pytest.raises(ValueError, match=r"mirror ball: 48 of 48 triangles are of a surface that has one side"):
        oriented(with_ball(room(), strip))


@pytest.mark.parametrize("flip", [False, True], ids=["front", "back"])
def test_a_sheet_shines_to_both_sides_in_reference_and_method_alike(flip):
    # A poster of one colour between eye and ball: the ball shows its other side, which is as bright.
    u, v = (0.9, 0.0, 0.0), (0.0, 0.0, 0.9)
    poster = quad((-0.45, -1.1, -1.6), *((v, u) if flip else (u, v)))
    scene = room()
    shown = replace(poster, radiance=np.array([0.9, 0.05, 0.05]))
    scene = replace(scene, objects=(*scene.objects, Object("poster", shown, "two sides")))
    truth = reference.render(scene, 0.0, SIZE, ReferenceOptions(spp=2))
    red = np.abs(truth.image - [0.9, 0.05, 0.05]).max(axis=2) < 1e-3
    assert (red & truth.mask).sum() > 100
    bench = Bench(scene, SIZE, ReferenceOptions(spp=2), None, 0, (1, 1))
    assert bench.show(0, "ray_traced", plugins.discover("method")["ray_traced"].target())[0]["flip"] < 0.002
