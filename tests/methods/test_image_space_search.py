"""Image-space search: what each of its parameters does, on small scenes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.answers import apart_px, clearances, hollow, image_off_px, lanes, off_px, picture, tilted_sheet
from support.mirror_room import CENTRE, EYE, SIZE, balls, error, mirror_ball, mirror_room, scene, shaded, still, walls

from benchharness.render.frame import FrameRenderer
from benchharness.scene import Camera
from methods.environment_map import EnvironmentMap
from methods.image_space_search import ImageSpaceSearch


def test_the_search_is_far_better_than_the_map(room, renderer, truth_of_room):
    search, map_ = (shaded(m, room, 0, renderer=renderer)[0] for m in (ImageSpaceSearch(), EnvironmentMap()))
    assert error(search, truth_of_room) < 0.2 * error(map_, truth_of_room)
    both = search.active & truth_of_room.mask
    relative = np.abs(search.distance - truth_of_room.distance)[both] / truth_of_room.distance[both]
    assert np.median(relative) < 0.02


def test_on_the_eyes_ray_is_better_than_mirrored_at_a_texel(room, renderer, truth_of_room):
    """0.2 of algorithms: mirrored at a wrong R, an image is off by the texel's error times the mirror's curvature."""
    answers = {
        placement: shaded(ImageSpaceSearch(placement=placement, subtexel=False), room, 0, renderer=renderer)[0]
        for placement in ("on_ray", "mirror")
    }
    assert error(answers["on_ray"], truth_of_room) < error(answers["mirror"], truth_of_room)
    off = {p: image_off_px(answer, room) for p, answer in answers.items()}
    assert np.nanmax(off["on_ray"]) < 1.0  # the texel's own error, at most half its diagonal and the curvature's part
    assert np.nanpercentile(off["on_ray"], 95) < 0.4 * np.nanpercentile(off["mirror"], 95)


def test_both_placements_agree_once_the_point_is_refined(room, renderer):
    one, two = (shaded(ImageSpaceSearch(placement=p), room, 0, renderer=renderer)[0] for p in ("on_ray", "mirror"))
    converged = np.array(one.reflection.vertices.converged)
    a, b = lanes(one.reflection.vertices.virtual)[converged], lanes(two.reflection.vertices.virtual)[converged]
    assert np.median(apart_px(a, b, room)) < 0.1


def test_refining_between_texels_brings_the_points_within_a_tenth_of_a_pixel(room, renderer):
    off = {s: off_px(shaded(ImageSpaceSearch(subtexel=s), room, 0, renderer=renderer)[0], room) for s in (True, False)}
    assert np.isfinite(off[True]).mean() > 0.9
    assert np.nanmedian(off[True]) < 0.1
    assert np.nanmedian(off[False]) > 0.25  # half a texel per axis, evenly spread, has a median of 0.4
    assert np.nanmax(off[True]) < 2.0


@pytest.mark.parametrize("kind", ["cut", "lookup", "simple", "full"])
def test_hidden_vertices_are_flagged_and_imaged_in_front(kind, room, renderer, truth_of_room):
    answer = shaded(ImageSpaceSearch(hidden=kind), room, 0, renderer=renderer)[0]
    assert answer.found[answer.active].all()
    assert error(answer, truth_of_room) < 0.025
    vertices = answer.reflection.vertices
    region = np.array(vertices.region)
    assert (region == 3).sum() > 50
    assert not (np.array(vertices.converged) | np.array(vertices.valid))[region == 3].any()
    # The truth of hiding: the segment to the eye runs through the ball.
    V = np.concatenate([part.mesh.vertices for part in room.objects])
    own, clearance = region[: len(V)], clearances(V)
    assert (own[clearance < -0.02] == 3).all()
    # A ray turned by the angle a leaves the ball a² / 8 of its radius inside the outline: where it passes at 0.2 m, on its
    # way of 2 m, at 0.05 px. Closer ones reflect in the last texel, whose own normal may hide them.
    assert (own[clearance > 0.2] == 1).all()
    assert (own[clearance > 0.0] == 1).mean() > 0.98
    assert (region[len(V) :] == 0).all()  # the mirror does not show itself
    image = lanes(vertices.virtual)[: len(V)][clearance < -0.02]
    # Mirrored in a plane of the ball that the vertex is behind, it comes to lie on the eye's side of that plane.
    R, n = lanes(vertices.R)[: len(V)][clearance < -0.02], lanes(vertices.n)[: len(V)][clearance < -0.02]
    if kind in ("cut", "simple"):
        assert (((image - R) * n).sum(1) > 0).all()
    assert (np.linalg.norm(image - EYE, axis=1) < np.linalg.norm(V[clearance < -0.02] - EYE, axis=1)).all()


@pytest.mark.parametrize("start", ["pyramid", "centre"])
def test_a_warm_search_takes_a_step_or_two_and_finds_the_same(start, room, renderer):
    method = ImageSpaceSearch(start=start)
    cold, warm = shaded(method, room, 0, 1, renderer=renderer)
    fresh = shaded(method, room, 1, renderer=renderer)[0]
    iterations = [np.array(a.reflection.vertices.iterations) for a in (cold, warm)]
    means = [i[i > 0].mean() for i in iterations]
    assert means[0] > 8
    assert means[1] <= 2  # 0.4 degrees of orbit
    assert np.abs(warm.L - fresh.L).max(axis=-1)[warm.active].mean() < 1e-3
    always_cold = shaded(replace(method, warm="off"), room, 0, 1, renderer=renderer)[1]
    assert always_cold.same(fresh)


def test_after_a_cut_of_the_camera_everything_is_as_from_a_cold_start():
    def cut(time):
        return Camera(EYE, CENTRE, 45.0) if time < 0.06 else Camera((1.7, 0.2, 0.25), CENTRE, 45.0)

    made, method = mirror_room(camera=cut), ImageSpaceSearch(split_px=0)
    after, cold = shaded(method, made, 0, 1, 2)[2], shaded(method, made, 2)[0]
    assert after.same(cold)


def test_after_a_jump_of_the_eye_alone_a_convex_mirror_shows_what_it_does_from_a_cold_start():
    def jump(time):
        return still()(time) if time < 0.06 else Camera((0.7, -2.2, 0.3), (0.5, -0.5, 0.05), 45.0)

    made = mirror_room(camera=jump)
    after, cold = shaded(ImageSpaceSearch(), made, 0, 1, 2)[2], shaded(ImageSpaceSearch(), made, 2)[0]
    assert np.abs(after.L - cold.L).max(axis=-1)[after.active].mean() < 1e-3


@pytest.mark.parametrize("side", [-1, 1])
def test_a_mirror_cut_by_the_picture_is_searched_as_far_as_the_widening_goes(side):
    made = scene((walls(), *balls()), (mirror_ball(),), still(target=(0.62 * side, 0.0, 0.0), fov_deg=40.0))
    expected, renderer = picture(made), FrameRenderer(made, *SIZE)
    answers = {k: shaded(ImageSpaceSearch(widening=k), made, 0, renderer=renderer)[0] for k in (1.0, 1.25, 2.0)}
    border = {k: int(np.array(a.reflection.vertices.border).sum()) for k, a in answers.items()}
    converged = {k: int(np.array(a.reflection.vertices.converged).sum()) for k, a in answers.items()}
    assert border[1.0] > 200 and border[1.0] > border[1.25] > border[2.0] == 0
    assert converged[1.0] < converged[1.25] < converged[2.0]
    flagged = np.array(answers[1.0].reflection.vertices.border)
    assert not np.array(answers[1.0].reflection.vertices.converged)[flagged].any()
    # In a band along the picture's border, where triangles reach out of it.
    band = np.zeros(expected.mask.shape, bool)
    band[:, :16] = band[:, -16:] = True
    band &= expected.mask
    errors = {k: np.sqrt(((a.L - expected.image)[band & a.active] ** 2).mean()) for k, a in answers.items()}
    assert errors[1.0] > 1.05 * errors[2.0]


@pytest.mark.parametrize("start", ["pyramid", "centre"])
@pytest.mark.parametrize("size", [1.0, 0.12])
@pytest.mark.parametrize("turned", [False, True])
def test_a_plane_mirror_of_two_triangles_is_exact_from_either_side(start, size, turned):
    mirror = tilted_sheet(size)
    if turned:  # seen from behind
        mirror = replace(mirror, mesh=replace(mirror.mesh, faces=mirror.mesh.faces[:, ::-1], normals=-mirror.mesh.normals))
    made = scene((walls(), *balls()), (mirror,))
    answer, expected = shaded(ImageSpaceSearch(placement="mirror", start=start), made, 0)[0], picture(made)
    assert answer.active.sum() > 40
    assert answer.found[answer.active].all()
    # The image in a plane is exact whatever texel it is mirrored at; radiance is linear on triangles and images of
    # triangles are triangles.
    assert error(answer, expected) < 1e-4


def test_the_last_iteration_that_is_allowed_may_be_the_one_that_ends(room, renderer):
    # A warm start on the answer examines one neighbourhood; with no more allowed, it has still ended by itself.
    same = replace(room, camera=still())
    free, bound = (shaded(ImageSpaceSearch(warm="texel", max_iter=n), same, 0, 0)[1] for n in (4096, 64))
    most = int(np.array(free.reflection.vertices.iterations).max())
    cold = int(np.array(shaded(ImageSpaceSearch(), same, 0)[0].reflection.vertices.iterations).max())
    assert most == 1 < cold
    assert bound.same(free)
    exact = shaded(ImageSpaceSearch(max_iter=cold), same, 0)[0].reflection.vertices
    assert (np.array(exact.converged) == np.array(shaded(ImageSpaceSearch(), same, 0)[0].reflection.vertices.converged)).all()
    short = shaded(ImageSpaceSearch(max_iter=3), same, 0)[0].reflection.vertices
    gave_up = np.array(short.iterations) == 3
    assert gave_up.any() and not np.array(short.converged)[gave_up].any()


def test_what_converged_obeys_the_law_of_reflection(room, renderer):
    """|B - N| within what a texel changes, and the eye and the vertex on the mirror's front."""
    vertices = shaded(ImageSpaceSearch(), room, 0, renderer=renderer)[0].reflection.vertices
    converged = np.array(vertices.converged)
    R, n = lanes(vertices.R)[converged], lanes(vertices.n)[converged]
    V = np.concatenate([part.mesh.vertices for part in room.parts])[converged]
    w_e, w_v = np.asarray(EYE) - R, V - R
    w_e, w_v = (w / np.linalg.norm(w, axis=1, keepdims=True) for w in (w_e, w_v))
    h = w_e + w_v
    h /= np.linalg.norm(h, axis=1, keepdims=True)
    assert converged.sum() > 3000
    np.testing.assert_allclose(np.linalg.norm(n, axis=1), 1, atol=1e-5)
    off = np.linalg.norm(h - n, axis=1)
    assert np.median(off) < 1e-3 and off.max() < 0.1
    np.testing.assert_allclose(np.array(vertices.residual)[converged], off, atol=1e-4)
    assert ((w_e * n).sum(1) > 0).all() and ((w_v * n).sum(1) > 0).all()


@pytest.mark.parametrize("name", ["concave", "torus"])
@pytest.mark.parametrize("start", ["pyramid", "centre"])
def test_with_several_reflection_points_the_search_ends_and_its_flags_are_honest(name, start):
    made = scene((walls(), *balls()), (hollow(name),), still((0.2, -1.0, 0.5)))
    answer = shaded(ImageSpaceSearch(start=start), made, 0)[0]
    vertices = answer.reflection.vertices
    assert answer.active.sum() > 1000
    assert np.isfinite(answer.L).all() and np.isfinite(answer.distance).all()
    for field, value in vars(vertices).items():
        assert np.isfinite(np.array(value)).all(), field
    assert np.array(vertices.iterations).max() < 400
    # It may be another reflection point than one would like, but it is one.
    # A texel turns normals by some 0.05, at folds by more.
    assert np.array(vertices.residual)[np.array(vertices.converged)].max() < 0.04
    off = off_px(answer, made)
    assert len(off) > 200
    known = off[np.isfinite(off)]
    assert len(known) > 0.9 * len(off)
    assert (known > 2).mean() < 0.003  # where the mirror folds behind itself, neighbouring texels are not neighbours
