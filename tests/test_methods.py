"""What every method owes the harness, and what each of ours is right and wrong about, on small scenes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from mirror_room import (
    CENTRE,
    EYE,
    SIZE,
    balls,
    error,
    mirror_ball,
    mirror_room,
    orbit,
    scene,
    shaded,
    still,
    walls,
)  # fmt: skip
from scipy.ndimage import binary_erosion
from small_room import quad

from benchharness import plugins, reference, truth
from benchharness.frame import FrameRenderer
from benchharness.scene import Camera, Reflector
from methods.environment_map import EnvironmentMap
from methods.image_space_search import ImageSpaceSearch
from methods.ray_traced import RayTraced
from scenes import bowls

METHODS = {name: plugin.target for name, plugin in plugins.discover("method").items() if plugin.error is None}
OWN = ("environment_map", "image_space_search", "ray_traced")
NEAR_BALL = (-0.45, 0.0, 0.0)


@pytest.fixture(scope="module", autouse=True)
def own_cache(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("BENCHHARNESS_CACHE", str(tmp_path_factory.mktemp("cache")))
        yield


@pytest.fixture(scope="module")
def room():
    return mirror_room(camera=orbit(0.4))


@pytest.fixture(scope="module")
def renderer(room):
    return FrameRenderer(room, *SIZE)


@pytest.fixture(scope="module")
def truth_of_room(room):
    return reference.render(room, 0.0, SIZE)


def picture(made):
    return reference.render(made, 0.0, SIZE)


def reflector_of(answer):
    return np.array(answer.frame.reflector).reshape(answer.active.shape)


def lanes(array):
    """A point array on the host, float64 [N, 3]."""
    return np.array(array, np.float64).T


# The contract


def test_all_methods_of_the_package_are_found_and_load():
    found = plugins.discover("method")
    assert set(OWN) <= set(found)
    assert [p.error for p in found.values() if p.error] == []


@pytest.mark.parametrize("name", METHODS)
def test_answers_are_sound_and_the_same_whoever_asks_and_whatever_ran_before(name, room, renderer):
    method = METHODS[name]()
    before = dict(vars(method))
    first, later = shaded(method, room, 0, 1, renderer=renderer)
    for answer in (first, later):
        mirror = answer.active
        assert np.isfinite(answer.L[mirror]).all() and (answer.L[mirror] >= 0).all()
        assert answer.found[mirror].mean() > 0.999  # the outline's last pixel may be left open, and then says so
        assert (answer.distance[mirror & answer.found] > 0).all()
        if answer.reflection.vertices is not None:
            for field, value in vars(answer.reflection.vertices).items():
                assert np.isfinite(np.array(value)).all(), field
                assert np.array(value).shape[-1] == len(room.reflectors) * room.vertices, field
    assert not first.same(later)

    other = METHODS["ray_traced" if name != "ray_traced" else "environment_map"]()
    shaded(other, room, 1, 0, renderer=renderer)
    again = shaded(METHODS[name](), room, 0, 1, renderer=renderer)
    assert first.same(again[0]) and later.same(again[1])
    assert vars(method) == before and method == METHODS[name]()


@pytest.mark.parametrize("name", METHODS)
@pytest.mark.parametrize("target", [(3.0, 0.0, 0.0), (-3.0, 0.0, 0.0), (0.0, -9.0, 0.0)])
def test_a_mirror_out_of_view_is_no_error(name, target):
    made = mirror_room(camera=still(target=target))
    answer = shaded(METHODS[name](), made, 0, size=(48, 32))[0]
    assert not answer.active.any()
    assert np.isfinite(answer.L).all()


@pytest.mark.parametrize("name", METHODS)
def test_what_moves_changes_the_picture_as_if_it_had_been_there_from_the_start(name):
    def shift(time):
        pose = np.eye(4)
        pose[:3, 3] = [0.3 * time, 0.1 * time, 0.4 * time]
        return pose

    red, *rest = balls()
    made = scene(
        (walls(), replace(red, motion=shift), *rest), (replace(mirror_ball(), motion=lambda t: shift(-0.2 * t)),), fps=1.0
    )
    method = METHODS[name]()
    if "warm" in vars(method):  # what it carries from frame to frame is not the subject
        method = replace(method, warm="off")
    still_there, moved = shaded(method, made, 0, 1)
    fresh = shaded(method, made, 1)[0]
    assert moved.same(fresh)
    both = still_there.active & moved.active
    # The same places, built in instead of moved to: but for rounding, and what it does at edges.
    built = replace(
        made,
        objects=tuple(replace(o, mesh=o.mesh.transformed(o.pose(1.0)), motion=None) for o in made.objects),
        reflectors=tuple(replace(r, mesh=r.mesh.transformed(r.pose(1.0)), motion=None) for r in made.reflectors),
    )
    there = shaded(method, built, 1)[0]
    assert (there.active != moved.active).sum() <= 2
    off = np.abs(there.L - moved.L)[there.active & moved.active].max(axis=1)
    assert (off > 0.01).mean() < 0.02
    assert (np.abs(still_there.L - moved.L)[both].max(axis=1) > 0.1).mean() > 0.02


@pytest.mark.parametrize("name", METHODS)
def test_where_the_scene_ends_its_surroundings_are_shown_at_infinity(name):
    sky = scene(balls(), (mirror_ball(),), background=(0.1, 0.2, 0.4))
    answer, expected = shaded(METHODS[name](), sky, 0)[0], picture(sky)
    far = expected.mask & answer.active & np.isinf(expected.distance)
    assert answer.found[answer.active].all()
    assert not np.isnan(answer.distance[answer.active]).any()
    # The environment map shows the balls elsewhere; the sky is the most of the picture in any case.
    sky_seen = np.isinf(answer.distance) & far
    assert sky_seen.sum() > 0.9 * far.sum()
    np.testing.assert_allclose(answer.L[sky_seen], np.tile((0.1, 0.2, 0.4), (sky_seen.sum(), 1)), atol=0.05)
    assert (answer.L[answer.active].max(axis=1) > 0.7).sum() > 50  # and the balls are there


# Ray tracing


def test_ray_traced_is_what_mitsuba_shows(room, renderer, truth_of_room):
    answer = shaded(RayTraced(), room, 0, renderer=renderer)[0]
    both = answer.active & truth_of_room.mask
    assert both.sum() > 0.98 * answer.active.sum()
    # Float32, in two orders of computing; at a few pixels of an outline or an edge the ray falls on the other side.
    wrong = np.abs(answer.L - truth_of_room.image)[both].max(axis=1) > 1e-4
    assert wrong.mean() < 0.002
    off = np.abs(answer.distance - truth_of_room.distance)[both]
    assert (off > 1e-3).mean() < 0.002


# Environment maps


def test_an_environment_map_is_right_where_everything_is_far_and_wrong_near(room, renderer, truth_of_room):
    near = error(shaded(EnvironmentMap(), room, 0, renderer=renderer)[0], truth_of_room)
    assert near > 0.05
    # What is left with walls at 4 km, a ball of 0.5 m: bilinear texels. Their number tells, at second order.
    errors = []
    far = scene((walls(4000.0),), (mirror_ball(),))
    expected = picture(far)
    inner = binary_erosion(expected.mask, iterations=3)
    for resolution in (16, 32, 64):
        answer = shaded(EnvironmentMap(resolution=resolution, mip=False), far, 0)[0]
        errors.append(np.sqrt(((answer.L - expected.image)[inner] ** 2).mean()))
    assert errors[-1] < 2e-3
    assert errors[0] > 2.5 * errors[1] > 2.5**2 * errors[2]
    # And the distance is that from the middle of the ball instead of its surface: half a metre of thousands.
    np.testing.assert_allclose(answer.distance[inner], expected.distance[inner], rtol=0.01)


def test_mip_levels_are_chosen_alike_all_over_the_picture():
    # The ball fills the picture and turns little from pixel to pixel: mip and bilinear lookup are the same, to the border.
    made = scene((walls(),), (mirror_ball(),), still(fov_deg=12.0))
    with_mip, without = (shaded(EnvironmentMap(mip=mip), made, 0)[0] for mip in (True, False))
    assert with_mip.active.all()
    assert np.abs(with_mip.L - without.L).max() < 2e-3


def test_mip_levels_smooth_what_a_strongly_curved_mirror_shows():
    # A small ball turns the direction by a radian within a few pixels: texels of a fine map would be skipped.
    stripes = replace(walls(), mesh=replace(walls(h=0.1).mesh))
    checks = np.where(np.floor(stripes.mesh.vertices / 0.2).sum(axis=1) % 2 == 0, 1.0, 0.0)[:, None] * np.ones(3)
    stripes = replace(stripes, mesh=replace(stripes.mesh, radiance=checks))
    made = scene((stripes,), (mirror_ball(radius=0.08),))
    spread = [shaded(EnvironmentMap(mip=mip), made, 0)[0] for mip in (True, False)]
    inner = binary_erosion(spread[0].active, iterations=1)
    assert spread[0].L[inner].std() < 0.8 * spread[1].L[inner].std()


def test_a_resolution_that_is_no_power_of_two_is_refused():
    with pytest.raises(ValueError, match="environment_map: resolution is 100; accepted: a power of two"):
        EnvironmentMap(resolution=100)


# Image-space search


def truths(answer, made):
    """Of every tenth converged vertex of a scene that stands still: its lane, and V and its true R (NaN: none known)."""
    vertices, mirror = answer.reflection.vertices, made.reflectors[0]
    lane = np.flatnonzero(np.array(vertices.converged))[::10]
    mesh = mirror.closed or mirror.mesh
    V = np.concatenate([part.mesh.vertices for part in made.parts])[lane]
    R = lanes(vertices.R)[lane]
    points, valid = truth.reflection_points(mesh.vertices, mesh.normals, mesh.faces, np.asarray(made.camera(0.0).eye), V, R)
    return lane, V, truth.nearest(points, valid, R)


def apart_px(one, other, made):
    camera = made.camera(0.0)
    return np.linalg.norm(truth.on_screen(one, camera, *SIZE) - truth.on_screen(other, camera, *SIZE), axis=1)


def off_px(answer, made):
    """Pixels between the found and the true reflection points of converged vertices."""
    lane, _, true = truths(answer, made)
    return apart_px(lanes(answer.reflection.vertices.R)[lane], true, made)


def image_off_px(answer, made):
    """The same of the virtual vertices."""
    lane, V, true = truths(answer, made)
    image = truth.image_of(V, true, np.asarray(made.camera(0.0).eye))
    return apart_px(lanes(answer.reflection.vertices.virtual)[lane], image, made)


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
    own = region[: len(V)]
    along, eye = V - EYE, np.asarray(EYE)
    t = np.clip(-(along @ eye) / (along**2).sum(1), 0, 1)
    clearance = np.linalg.norm(eye + t[:, None] * along, axis=1) - 0.5
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
    assert (np.linalg.norm(image - eye, axis=1) < np.linalg.norm(V[clearance < -0.02] - eye, axis=1)).all()


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

    made = mirror_room(camera=cut)
    after, cold = shaded(ImageSpaceSearch(), made, 0, 1, 2)[2], shaded(ImageSpaceSearch(), made, 2)[0]
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


def tilted_sheet(size: float = 1.0) -> Reflector:
    """A plane mirror of two triangles, none of whose corners lies on a covered texel."""
    return Reflector("sheet", quad((-0.52 * size, 0, -0.47 * size), (1.01 * size, 0.2 * size, 0.03 * size),
                                   (0.02 * size, 0.1 * size, 0.93 * size)))  # fmt: skip


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


# Several mirrors


@pytest.fixture(scope="module")
def two_mirrors():
    mirrors = (mirror_ball("one", NEAR_BALL, 0.35), mirror_ball("two", (0.45, 0.1, 0.0), 0.35))
    return scene((walls(), *balls()), mirrors)


@pytest.mark.parametrize("name", OWN)
def test_of_two_mirrors_each_shows_the_other_black_and_the_rest_as_it_is(name, two_mirrors):
    answer, expected = shaded(METHODS[name](), two_mirrors, 0)[0], picture(two_mirrors)
    seen = reflector_of(answer)
    for number in (0, 1):
        black = (answer.L.max(axis=2) == 0) & (seen == number)
        assert 0.005 < black.sum() / (seen == number).sum() < 0.2
        if name != "environment_map":
            truly = (expected.image.max(axis=2) == 0) & (expected.reflector == number)
            assert (black & truly).sum() > 0.7 * (black | truly).sum()
    if name == "image_space_search":
        assert error(answer, expected) < 0.03
        vertices = answer.reflection.vertices
        assert np.array(vertices.R).shape == (3, 2 * two_mirrors.vertices)
        region = np.array(vertices.region).reshape(2, -1)
        objects = sum(len(o.mesh.vertices) for o in two_mirrors.objects)
        one = len(two_mirrors.reflectors[0].mesh.vertices)
        assert (region[0, objects : objects + one] == 0).all() and (region[1, objects : objects + one] != 0).all()
        assert (region[1, objects + one :] == 0).all() and (region[0, objects + one :] != 0).all()


def test_a_mirror_is_the_same_beside_another_one_that_shows_nothing_new(two_mirrors):
    """The second mirror's own pixels do not depend on being the second."""
    swapped = replace(two_mirrors, reflectors=two_mirrors.reflectors[::-1])
    for name in OWN:
        one, two = (shaded(METHODS[name](), made, 0)[0] for made in (two_mirrors, swapped))
        np.testing.assert_array_equal(one.active, two.active)
        assert np.abs(one.L - two.L)[one.active].max(axis=1).mean() < 2e-4, name


# Mirrors that have more than one reflection point


def hollow(name):
    made = {"concave": bowls.concave_bowl((0, 0, -0.26), EYE), "torus": bowls.torus_bowl((0, 0, 0))}[name]
    return replace(made, eta=None, k=None)


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


@pytest.mark.parametrize("name", ["concave", "torus"])
@pytest.mark.parametrize("method", ["environment_map", "ray_traced"])
def test_other_methods_take_any_mirror(method, name):
    made = scene((walls(), *balls()), (hollow(name),), still((0.2, -1.0, 0.5)))
    answer = shaded(METHODS[method](), made, 0)[0]
    assert np.isfinite(answer.L).all() and answer.found[answer.active].all()
    if method == "ray_traced":
        expected = picture(made)
        both = binary_erosion(expected.mask & answer.active, iterations=1)
        assert (np.abs(answer.L - expected.image)[both].max(axis=1) > 1e-3).mean() < 0.01
