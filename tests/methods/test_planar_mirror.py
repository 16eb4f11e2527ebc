"""Planar mirrors against brute force in float64: cuts, outlines, sides, highlights, mirrors in mirrors, what is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from oracles import planar_oracle
from scipy.ndimage import label
from support.flat_rooms import (
    BLUE,
    GREEN,
    RED,
    SIZE,
    SKY,
    asked,
    doubted,
    facing,
    off,
    pose,
    renders,
    room,
    sheet,
    thing,
    tilted,
)
from support.mirror_room import mirror_ball, scene, shaded, still
from support.small_room import box, quad

from benchharness.kernels import planes
from benchharness.scene import Environment, Gloss, Mesh, PointLight, Reflector, merged, subdivided
from methods.planar_mirror import PlanarMirror
from methods.ray_traced import RayTraced

DISCARD, OBLIQUE = PlanarMirror(), PlanarMirror(clip="oblique")
FARTHEST, NEAREST = (PlanarMirror(clip="near_plane", near_at=at) for at in ("farthest", "nearest"))
SCALED = PlanarMirror(clip="vertex_scale")
GOLD = (0.14, 0.37, 1.44), (3.98, 2.38, 1.6)
STRAY = 2  # pixels on edges, which rounding decides


def agrees(answer, truth, rays=None):
    """In all pixels but strays on edges; the distance without a bias."""
    assert (answer.active == (truth.reflector >= 0)).all()
    assert not (off(answer, truth.L) & truth.clear).any()
    assert off(answer, truth.L).sum() <= STRAY
    far = np.isinf(truth.distance) & answer.active & truth.clear
    assert np.isinf(answer.distance[far]).all() and answer.found[answer.active].all()
    near = np.isfinite(truth.distance) & answer.active & truth.clear & ~off(answer, truth.L)
    error = answer.distance[near] - truth.distance[near]
    # Float32 in a room of 4 m: some 1e-6. Rays that start 1e-4 above the mirror are off by as much, and one-sidedly so.
    assert np.abs(error).max() < 2e-5 and abs(error.mean()) < 2e-6
    if rays is not None:
        assert off(answer, rays.L).sum() <= STRAY


# Ways to cut


@pytest.fixture(scope="module")
def leaning():
    """What every way shows as the mirror leans back, nothing behind it, and the truth: degrees -> (truth, clip -> answer)."""
    found = {}
    for degrees in (0, 20, 45, 60):
        made = tilted(degrees, behind=degrees == 45)
        methods = (RayTraced(), DISCARD, OBLIQUE, FARTHEST, NEAREST, SCALED)
        found[degrees] = planar_oracle.followed(made, SIZE), *asked(made, *methods)
    return found


def test_discard_and_oblique_are_exact_to_the_pixel_and_in_distance(leaning):
    for truth, rays, discard, oblique, *_ in leaning.values():
        assert truth.clear[discard.active].mean() > 0.95
        agrees(discard, truth, rays)
        agrees(oblique, truth, rays)
        assert off(discard, oblique.L, 0.0).sum() <= STRAY and not doubted(discard).any()


def test_a_near_plane_loses_more_the_more_the_mirror_leans(leaning):
    """P-01: through the farthest point all that is wrong is what was lost; through the nearest, nothing is lost."""
    lost = []
    for truth, _, _, _, farthest, nearest, _ in leaning.values():
        wrong = off(farthest, truth.L)
        lost.append(wrong.sum() / farthest.active.sum())
        assert (farthest.distance[wrong & truth.clear] > truth.distance[wrong & truth.clear]).all()
        assert (doubted(farthest) | ~wrong).all() and (doubted(nearest) | ~off(nearest, truth.L)).all()
    assert lost[0] < 0.01 < lost[1] < 0.5 * lost[2] and lost[2] < 0.75 * lost[3] and lost[3] > 0.15, lost
    assert not any(off(leaning[degrees][5], leaning[degrees][0].L).any() for degrees in (0, 20, 60))


def test_within_walls_nothing_is_found_where_nothing_is_shown(leaning):
    lost = 0
    for _, _, discard, *_, scaled in leaning.values():
        assert discard.found[discard.active].all()
        assert (scaled.found == np.isfinite(scaled.distance))[scaled.active].all()
        lost += (scaled.active & ~scaled.found).sum()
    assert lost > 0


def test_a_near_plane_at_the_nearest_point_shows_what_is_behind_the_mirror(leaning):
    truth, _, discard, _, farthest, nearest, _ = leaning[45]
    wrong = off(nearest, truth.L)
    assert wrong.sum() > 0.03 * nearest.active.sum()
    assert (np.abs(nearest.L[wrong] - BLUE).max(axis=1) < 1e-3).all()
    for answer in (discard, farthest):
        assert not (np.abs(answer.L - BLUE).max(axis=-1) < 0.05)[answer.active].any()


def rescaled(away: float) -> tuple[float, float]:
    """Of an eye so far from the mirror's plane: the longest way of a vertex from it, in near planes; share of wrong pixels."""
    floor = thing("floor", subdivided(quad((-1, -2, -0.5), (2, 0, 0), (0, 2, 0)), 0.15))
    made = scene([floor], [sheet((1.0, 0.6))], still((-0.7 * away, -away, 0.1), (0.0, 0.0, -0.1), 50.0), 1, background=SKY)
    exact, scaled = asked(made, DISCARD, SCALED)
    view, plane = scaled.frame.view, scaled.state.planes[0]
    shows = scaled.frame.reflector == scaled.state.numbers[0]
    cut = planes.cut(planes.reflected(view, plane), plane, scaled.state.world, shows, "vertex_scale", "farthest")
    assert cut.points is not None
    points = np.array(cut.points).reshape(-1, 4)[:, :3] - np.array(cut.view.eye).ravel()
    assert np.isfinite(points).all() and np.isfinite(scaled.L).all()
    wrong = off(scaled, exact.L, 0.02)
    assert (wrong & ~doubted(scaled)).sum() <= STRAY
    return float(np.linalg.norm(points, axis=1).max() / np.array(view.near)[0]), float(wrong.sum() / scaled.active.sum())


def test_rescaled_vertices_go_without_bound_as_the_eye_comes_to_the_plane():
    """P-02. Far away the plane has about one depth all over the picture; near to it that is 0 amid the picture."""
    far, near, nearest = (rescaled(away) for away in (3.0, 0.7, 0.15))
    assert far[0] < 5 and min(near[0], nearest[0]) > 300, (far, near, nearest)
    assert far[1] < 0.01 and 0.3 < near[1] < nearest[1], (far, near, nearest)


@pytest.mark.parametrize("away", [60.0, 4000.0])
def test_from_far_away_depths_are_told_from_the_mirror_and_cut_it_there(away):
    eye = away * np.array([0.15, -0.95, 0.2])
    made = replace(tilted(30, behind=True, sky=True), camera=still(eye, (0.0, 0.0, 0.0), float(np.degrees(1.6 / away))))
    truth = planar_oracle.followed(made, SIZE)
    for answer in asked(made, DISCARD, OBLIQUE):
        assert (
            answer.active.sum() > 1000
            and not (off(answer, truth.L) & truth.clear).any()
            and off(answer, truth.L).sum() <= STRAY
        )


# Winding, highlights, the oblique plane's other side


def test_of_a_thin_box_the_side_that_faces_the_mirror_is_shown():
    """P-03: red in front of the mirror, green on the side that the eye sees."""
    plate = box((-0.3, -0.6, -0.3), (0.3, -0.597, 0.3))
    colours = np.where((plate.normals[:, 1] > 0.5)[:, None], RED, GREEN)
    painted = replace(thing("plate", plate), mesh=replace(plate, radiance=colours))
    made = scene([painted], [sheet()], still((1.0, -1.9, 0.4)), 1, background=SKY)
    truth = planar_oracle.followed(made, SIZE)
    for answer in asked(made, DISCARD, OBLIQUE):
        agrees(answer, truth)
        assert (np.abs(answer.L - RED).max(axis=-1) < 1e-3)[answer.active].sum() > 100


def test_a_highlight_is_the_one_that_the_mirrored_eye_sees():
    """P-04: by the formula of Blinn and Phong in float64, from the mirrored eye; and elsewhere than the eye's own."""
    floor = subdivided(quad((-2, -2, -0.7), (4, 0, 0), (0, 4, 0)), 0.25)
    floor = replace(floor, radiance=np.full_like(floor.vertices, 0.05), visibility=np.ones((len(floor.vertices), 1)))
    lamp, gloss = np.array([0.3, -1.0, 1.5]), Gloss((0.6, 0.6, 0.6), 60.0)
    made = scene(
        [replace(thing("floor", floor, None), mesh=floor, gloss=gloss)], [sheet((1.2, 0.9), pose("x", 10.0))],
        still((0.2, -1.9, 0.3)), 1, lights=(PointLight(tuple(lamp), (8.0, 8.0, 8.0)),),
    )  # fmt: skip
    (answer,) = asked(made, DISCARD)
    lane = answer.active & np.isfinite(answer.distance)
    mirror = made.reflectors[0].mesh
    eye = np.asarray(made.camera(0.0).eye)
    seen_from = planar_oracle.image(eye[None], mirror.vertices[0], mirror.normals[0])[0]
    p = np.array(answer.frame.p, np.float64).T.reshape(*lane.shape, 3)[lane]
    d = (p - seen_from) / np.linalg.norm(p - seen_from, axis=1, keepdims=True)
    X = p + answer.distance[lane][:, None] * d

    def bright(viewer):
        wi, wo = lamp - X, viewer - X
        away2 = (wi**2).sum(1)
        h = wi / np.sqrt(away2)[:, None] + wo / np.linalg.norm(wo, axis=1, keepdims=True)
        h /= np.linalg.norm(h, axis=1, keepdims=True)
        lobe = 0.6 * (60 + 8) / (8 * np.pi) * np.maximum(h[:, 2], 0) ** 60
        return 0.05 + lobe * wi[:, 2] / np.sqrt(away2) / away2 * 8.0

    shown = answer.L[lane][:, 0]
    assert np.abs(X[:, 2] + 0.7).max() < 1e-5 and shown.max() > 0.5
    np.testing.assert_allclose(shown, bright(seen_from), atol=2e-3)
    assert np.abs(shown - bright(eye)).max() > 0.3


def test_the_sky_and_what_is_far_are_behind_an_oblique_plane_too():
    """P-05: the far plane tilts, and cuts nothing; what is drawn nowhere is the sky of its own direction."""
    sky = Environment.painted(lambda d: 0.5 + 0.4 * d, 64)
    far = thing("far", box((-400.0, -3000.0, -300.0), (500.0, -2900.0, 300.0)), RED)
    made = scene([far], [sheet(turn=pose("x", -8.0) @ pose("z", 12.0))], still((0.5, -1.9, 0.1)), 1, environment=sky)
    rays, discard, oblique = asked(made, RayTraced(), DISCARD, OBLIQUE)
    for answer in (discard, oblique):
        assert off(answer, rays.L, 1e-3).sum() <= STRAY and (np.isinf(answer.distance) == np.isinf(rays.distance)).all()
    assert 200 < np.isfinite(oblique.distance[oblique.active]).sum() < oblique.active.sum() - 500


# Outlines and sides


def test_a_mirror_of_any_outline_ends_where_it_ends():
    """P-07: an L and a triangle of one mesh, a millimetre before a wall."""
    parts = [quad((-0.8, 0, -0.6), (0.4, 0, 0), (0, 0, 1.1)), quad((-0.4, 0, -0.6), (1.0, 0, 0), (0, 0, 0.35)),
             Mesh(np.array([[0.2, 0, 0.1], [0.7, 0, 0.1], [0.7, 0, 0.7]]), np.array([[0, 1, 2]]))]  # fmt: skip
    mirror = Reflector("mirror", merged(*parts).transformed(pose("z", 20.0)))
    wall = thing("wall", quad((-1.2, 0.001, -1.0), (2.4, 0, 0), (0, 0, 2.0)).transformed(pose("z", 20.0)), BLUE)
    made = scene(
        [room(), wall, thing("box", box((-0.5, -1.1, -0.4), (0.1, -0.7, 0.3)), GREEN)], [mirror], still((0.25, -1.9, 0.15)), 1
    )
    truth = planar_oracle.followed(made, SIZE)
    for answer in asked(made, DISCARD, OBLIQUE):
        agrees(answer, truth)
        assert not (np.abs(answer.L - BLUE).max(axis=-1) < 0.05)[answer.active].any()


def test_from_behind_a_sheet_shows_what_is_behind_it_and_on_edge_nothing():
    """P-08, P-09. Mirrors are mirrors on both sides here; nothing of what is before it is seen from behind."""
    front, back = (
        thing("front", box((-0.2, -0.8, -0.2), (0.2, -0.6, 0.2)), RED),
        thing("back", box((-0.4, 0.6, -0.2), (0.1, 0.8, 0.2)), BLUE),
    )
    for eye, seen, unseen in (((0.9, -1.9, 0.3), RED, BLUE), ((0.9, 1.9, 0.3), BLUE, RED)):
        made = scene([front, back], [sheet()], still(eye), 1, background=SKY)
        truth = planar_oracle.followed(made, SIZE)
        for answer in asked(made, DISCARD, OBLIQUE):
            agrees(answer, truth)
            shown = answer.L[answer.active]
            assert (np.abs(shown - seen).max(axis=1) < 1e-3).any() and not (np.abs(shown - unseen).max(axis=1) < 1e-3).any()
    for eye in ((1.9, 0.0, 0.3), (1.9, 1e-9, 0.0), (1.9, 1e-4, 0.2)):
        made = scene([front, back], [sheet()], still(eye), 1, background=SKY)
        for answer in asked(made, DISCARD, OBLIQUE, FARTHEST, SCALED):
            assert answer.active.sum() <= 30 and np.isfinite(answer.L).all()
            assert not np.isnan(answer.distance[answer.active]).any()


# Mirrors in mirrors


@pytest.fixture(scope="module")
def hall():
    made = facing()
    return made, asked(made, *(PlanarMirror(depth=k) for k in (1, 4)), RayTraced(bounces=4))


def test_images_between_two_mirrors_are_at_every_second_distance(hall):
    """T11: the image over k mirrors is at V + 2 m L n, or at that of the image of V."""
    made, (_, deep, rays) = hall
    n, gap = np.array([0.0, 1.0, 0.0]), 2.0
    V = made.objects[0].mesh.vertices.mean(axis=0)
    first = planar_oracle.image(V[None], 0.5 * gap * n, n)[0]
    images = [first, V + 2 * gap * n, first + 2 * gap * n, V + 4 * gap * n]  # over 1, 2, 3 and 4 mirrors
    px = planar_oracle.on_screen(np.stack(images), made.camera(0.0), *SIZE)
    blobs = np.zeros(deep.active.shape, np.int32)
    label((np.abs(deep.L - RED).max(axis=-1) < 1e-3) & deep.active, output=blobs)
    centres = np.array([np.argwhere(blobs == k).mean(axis=0)[::-1] + 0.5 for k in range(1, blobs.max() + 1)])
    for order, place in enumerate(px):
        assert np.linalg.norm(centres - place, axis=1).min() < 0.5, (order, centres, px)
    assert off(deep, rays.L).sum() <= STRAY


def test_mirrors_show_as_many_mirrors_as_are_asked_for_and_the_last_is_black():
    """Every side of the cube has a colour of its own: whichever way pictures are turned, fronts are shown."""
    made = facing(GOLD)
    cube = made.objects[0]
    made = replace(made, objects=(replace(cube, mesh=replace(cube.mesh, radiance=0.5 + 0.4 * cube.mesh.normals)),))
    methods = [PlanarMirror(depth=k) for k in (1, 2, 3)] + [PlanarMirror(clip="oblique", depth=3)]
    *answers, oblique = asked(made, *methods)
    for depth, answer in enumerate(answers, start=1):
        truth = planar_oracle.followed(made, SIZE, depth)
        assert not (off(answer, truth.L) & truth.clear).any() and off(answer, truth.L).sum() <= STRAY
        black = truth.L.max(axis=-1) == 0
        assert (doubted(answer) == black)[truth.clear & answer.active].all() and black[answer.active].any()
        np.testing.assert_array_equal(answer.distance, answers[0].distance)
    assert off(oblique, answers[2].L).sum() <= STRAY


def triangle(radius: float = 1.5):
    """Three mirrors that face each other around the eye."""
    mirrors = [sheet((0.9, 0.5), pose("z", a) @ pose(at=(0, radius, 0)), f"mirror {a}") for a in (0, 120, 240)]
    return scene(
        [thing("cube", box((0.2, 0.2, -0.1), (0.4, 0.4, 0.1)), RED)],
        mirrors,
        still((0.1, -2.2, 0.1), (0, 1, 0), 70.0),
        1,
        background=SKY,
    )


def test_there_are_as_many_pictures_as_sequences_of_mirrors():
    """P-06: n (1 + (n - 1) + ... + (n - 1)^(k - 1)); fewer where mirrors are not seen."""
    counts = {}
    for made, n in ((tilted(20), 1), (facing(), 2), (triangle(), 3)):
        methods = [PlanarMirror(depth=k, cull=cull) for k in (1, 3) for cull in (False, True)]
        answers = asked(made, *methods, size=(48, 36))
        counts[n] = [renders(answer) for answer in answers]
        for one, other in (answers[:2], answers[2:]):
            assert one.L.tobytes() == other.L.tobytes()
    assert [counts[n][0] for n in (1, 2, 3)] == [1, 2, 3]
    assert [counts[n][2] for n in (1, 2, 3)] == [1, 6, 21]
    # Of two that face each other one is before the eye: one sequence. A single mirror out of the picture costs nothing.
    assert counts[2][1::2] == [1, 3] and counts[3][1] == 3 and counts[3][3] < 21
    away = replace(tilted(20), camera=still((0, -1.9, 0), (0, -9, 0)))
    for made in (away, replace(away, reflectors=())):
        assert [renders(a) for a in asked(made, DISCARD, size=(48, 36))] == [0]
    # Nor does one that the mirrored camera sees beside the outline of its mirror.
    beside = sheet((0.2, 0.4), pose("z", 180, (1.0, -0.9, 0.0)), "beside")
    aside = scene([room()], [sheet((0.15, 0.15)), beside], still((0, -1.5, 0), (0, 0, 0)), 1)
    assert [renders(a) for a in asked(aside, PlanarMirror(depth=2), size=(48, 36))] == [1]


def test_an_outer_cut_is_not_handed_on():
    """What stands behind the first mirror is seen in it by way of a second one, where that one's picture reaches it."""
    small = sheet((0.3, 0.6), pose(at=(0, 0, 0)), "small")
    back = sheet((1.6, 1.2), pose("z", 180, (0, -1.5, 0)), "back")
    cube = thing("cube", box((0.5, 0.4, -0.2), (0.9, 0.8, 0.2)), RED)
    made = scene([cube], [small, back], still((-0.6, -1.2, 0.1), (0.0, 0.0, 0.0)), 1, background=SKY)
    truth = planar_oracle.followed(made, SIZE, 2)
    (answer,) = asked(made, PlanarMirror(depth=2))
    assert not (off(answer, truth.L) & truth.clear).any()
    assert (np.abs(answer.L - RED).max(axis=-1) < 1e-3)[answer.active].sum() > 20


# Where the plane is


def test_the_plane_is_that_of_the_triangles_wherever_they_come_from():
    """A tilted face that no transform tells of, and the same by a pose: one picture. Of a mirror that moves, every frame."""
    turn = pose("x", -30.0, (0.1, 0.05, -0.1)) @ pose("z", 15.0)
    things = [room(), thing("box", box((-0.5, -1.1, -0.4), (0.1, -0.7, 0.3)), GREEN)]
    face = scene(things, [sheet(turn=turn)], still((0.25, -1.9, 0.15)), 1)
    posed = replace(face, reflectors=(sheet(motion=lambda time: turn),))
    truth = planar_oracle.followed(face, SIZE)
    for made in (face, posed):
        agrees(asked(made, DISCARD)[0], truth)
    moving = replace(face, reflectors=(sheet(motion=lambda t: pose("x", -25.0 * t)),), frames=2, fps=1.0)
    _, moved = shaded(DISCARD, moving, 0, 1, size=SIZE)
    truth = planar_oracle.followed(moving, SIZE, time=1.0)
    assert not (off(moved, truth.L) & truth.clear).any() and off(moved, planar_oracle.followed(moving, SIZE).L).sum() > 500


# What is refused


def test_a_ball_is_refused_with_how_far_it_is_from_flat():
    """Radius 0.5: every plane through its middle is 0.5 off, of a box's diagonal of sqrt(3)."""
    made = scene((room(),), (sheet(), mirror_ball("ball", radius=0.5)))
    said = PlanarMirror().refuses(made)
    assert said is not None
    for part in (
        "reflector ball is not flat",
        "up to 0.5 m off",
        "0.29 of its extent of 1.73 m",
        "up to 90 degrees",
        "0.000173 m here",
    ):
        assert part in said, said
    with pytest.raises(ValueError, match="planar_mirror: reflector ball is not flat"):
        PlanarMirror().prepare(made)


def bent(sag: float = 0.0, lean: float = 0.0) -> str | None:
    """What is said of a sheet of 0.6 by 0.8 whose middle is `sag` off, in extents, and whose normals lean, radians."""
    flat = subdivided(quad((-0.3, 0, -0.4), (0.6, 0, 0), (0, 0, 0.8)), 0.41)
    middle = np.abs(flat.vertices).max(axis=1) < 1e-9
    v = flat.vertices - np.outer(middle, [0, sag, 0])
    normals = np.stack([np.sin(lean) * np.sign(v[:, 0]), -np.cos(lean) * np.ones(len(v)), np.zeros(len(v))], axis=1)
    assert middle.sum() == 1
    return PlanarMirror().refuses(scene((room(),), (Reflector("sheet", Mesh(v, flat.faces, normals)),)))


def test_what_is_flat_but_for_rounding_is_accepted_and_what_bends_or_whose_normals_do_is_not():
    assert bent() is None and bent(sag=0.9e-4) is None and bent(lean=0.9e-4) is None
    assert "0.00" in (bent(sag=4e-4) or "") and bent(lean=1.1e-4) is not None
    slab = box((-1, -0.05, -1), (1, 0.05, 1))
    assert PlanarMirror().refuses(scene((room(),), (Reflector("slab", slab, slab),))) is not None
    far = sheet(turn=pose("x", -30.0, (300.0, -200.0, 5.0))).mesh  # in a file of float32, 3e-5 m are lost there
    rounded = Mesh(far.vertices.astype(np.float32), far.faces)
    assert PlanarMirror().refuses(scene((room(),), (Reflector("far", rounded),))) is None
