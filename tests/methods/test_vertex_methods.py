"""What image-space search, secant triangle and Newton's method share: the images of vertices, on small scenes.

The parameters of the search alone are in test_image_space_search.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from scipy.ndimage import binary_dilation
from scipy.spatial.transform import Rotation
from support.answers import clearances, hollow, lanes, off_px, picture, reflector_of, tilted_sheet
from support.mirror_room import (
    CENTRE,
    EYE,
    SIZE,
    ball,
    balls,
    error,
    lit,
    mirror_ball,
    mirror_room,
    scene,
    shaded,
    still,
    walls,
)
from support.small_room import box, quad
from support.star_shapes import Ellipsoid

from benchharness.measure import truth
from benchharness.scene import Camera, Mesh, Object, Reflector
from methods.image_space_search import ImageSpaceSearch
from methods.newton import Newton
from methods.secant_triangle import SecantTriangle
from scenes.stress.basin import basin

SECANT = SecantTriangle(resolution=64, newton="always")  # of what Newton's method begins with; made in a tenth of the time
PAPER = replace(SECANT, stop="area", tau=0.5, start="paper", newton="off", hidden="drop", depth="screen_linear")
EXACT = {
    "newton": Newton(),
    "secant": SECANT,
    "secant, paper's search": replace(SECANT, stop="area", tau=0.5, start="paper"),
}
ALL = {"image_space_search": ImageSpaceSearch(), "newton": EXACT["newton"], "secant_triangle": EXACT["secant"]}
every_method = pytest.mark.parametrize("name", ALL)
exact_methods = pytest.mark.parametrize("name", ["newton", "secant_triangle"])


def cold(method):
    return replace(method, warm="off" if isinstance(method, ImageSpaceSearch) else False)


def vertices_of(made):
    return np.concatenate([part.mesh.vertices for part in made.parts])


def vertex(answer, field):
    return np.array(getattr(answer.reflection.vertices, field))


# Reflection points.


@pytest.mark.parametrize("name", EXACT)
def test_all_points_are_within_a_hundredth_of_a_pixel_and_none_is_wrong(name, room, renderer):
    answer = shaded(EXACT[name], room, 0, renderer=renderer)[0]
    off = off_px(answer, room, step=3)
    assert len(off) > 1000
    assert np.isfinite(off).mean() > 0.99  # the oracle may fail on the slivers at the ball's poles
    assert np.nanmax(off) < 0.01
    # Each is reflected and converged, or hidden by the ball; a chord of the ball of 96 slices is 5e-4 short of its radius.
    own = np.concatenate([o.mesh.vertices for o in room.objects])
    region, converged = vertex(answer, "region")[: len(own)], vertex(answer, "converged")[: len(own)]
    clearance = clearances(own)
    assert ((region == 1) == converged).all()
    assert (region[clearance > 0] == 1).all() and (region[clearance < -1e-3] == 3).all()
    assert (region == 3).sum() > 50
    assert (vertex(answer, "region")[len(own) :] == 0).all()  # the mirror does not show itself
    assert (vertex(answer, "iterations")[len(own) :] == 0).all()


@pytest.mark.parametrize(
    ("method", "least", "most_px"),
    [
        (SecantTriangle(newton="restart"), 1.0, 0.1),
        (SecantTriangle(newton="restart", stop="area", tau=0.5, start="paper"), 1.0, 1.0),
        (SecantTriangle(newton="off"), 0.99, 0.1),
        (SecantTriangle(newton="off", start="paper"), 0.75, 0.5),
        (PAPER, 0.4, 1.0),  # at a radius of 67 px, half a square pixel is large
    ],
)
def test_without_newton_the_points_are_as_good_as_the_last_triangle_and_flagged(method, least, most_px, room, renderer):
    answer = shaded(method, room, 0, renderer=renderer)[0]
    own = np.concatenate([o.mesh.vertices for o in room.objects])
    converged, clearance = vertex(answer, "converged")[: len(own)], clearances(own)
    assert converged[clearance > 0].mean() >= least
    assert not converged[clearance < -1e-3].any()
    assert np.nanmax(off_px(answer, room)) < most_px
    for field in vars(answer.reflection.vertices):
        assert np.isfinite(vertex(answer, field)).all(), field


@every_method
def test_what_converged_obeys_the_law_of_reflection(name, room, renderer):
    """Half vector and normal agree within what the method stops at, with the eye and the vertex on the mirror's front."""
    answer = shaded(ALL[name], room, 0, renderer=renderer)[0]
    converged = vertex(answer, "converged")
    R, n = lanes(answer.reflection.vertices.R)[converged], lanes(answer.reflection.vertices.n)[converged]
    w_e, w_v = np.asarray(EYE) - R, vertices_of(room)[converged] - R
    w_e, w_v = (w / np.linalg.norm(w, axis=1, keepdims=True) for w in (w_e, w_v))
    h = w_e + w_v
    h /= np.linalg.norm(h, axis=1, keepdims=True)
    assert converged.sum() > 3000
    np.testing.assert_allclose(np.linalg.norm(n, axis=1), 1, atol=1e-5)
    off = np.linalg.norm(h - n, axis=1)
    assert np.median(off) < 1e-3 and off.max() < 0.1
    np.testing.assert_allclose(vertex(answer, "residual")[converged], off, atol=1e-4)
    assert ((w_e * n).sum(1) > 0).all() and ((w_v * n).sum(1) > 0).all()
    # And the image is behind the point, on the eye's ray, as far as the vertex is from it.
    image = lanes(answer.reflection.vertices.virtual)[converged] - R
    np.testing.assert_allclose(image, -w_e * np.linalg.norm(image, axis=1, keepdims=True), atol=2e-5)
    np.testing.assert_allclose(
        np.linalg.norm(image, axis=1), np.linalg.norm(vertices_of(room)[converged] - R, axis=1), atol=2e-5
    )


# Hidden vertices.


@pytest.mark.parametrize(
    ("method", "covered", "rms"),
    [
        (Newton(), 0.998, 0.03),
        (Newton(hidden="drop"), 0.99, 0.05),
        (SECANT, 0.998, 0.03),
        (replace(SECANT, hidden="drop"), 0.99, 0.05),
        (replace(SECANT, hidden="emdt_mirror"), 1.0, 0.012),
        (replace(SECANT, hidden="clamp"), 0.995, 0.04),
        (replace(SECANT, hidden="clamp", depth="screen_linear"), 0.995, 0.04),
        (replace(SECANT, hidden="drop", depth="screen_linear"), 0.99, 0.05),
    ],
    ids=lambda value: (
        f"{type(value).__name__} {value.hidden} {getattr(value, 'depth', '')}" if hasattr(value, "hidden") else None
    ),
)
def test_what_a_policy_for_hidden_vertices_leaves_open_lies_along_the_outline(
    method, covered, rms, room, renderer, truth_of_room
):
    answer = shaded(method, room, 0, renderer=renderer)[0]
    mirror = answer.active
    assert answer.found[mirror].mean() >= covered
    assert error(answer, truth_of_room) < rms
    outline = mirror & binary_dilation(~mirror, np.ones((3, 3)), iterations=4)
    assert not (mirror & ~answer.found & ~outline).any()
    # Away from it, policies differ in nothing: what is wrong there is what straight edges are off by, and edges of balls.
    wrong = np.abs(answer.L - truth_of_room.image).max(axis=2) > 0.02
    inner = mirror & truth_of_room.mask & ~outline
    assert wrong[inner].mean() < 0.02


def test_where_hidden_vertices_go_by_policy(room, renderer):
    own = np.concatenate([o.mesh.vertices for o in room.objects])
    deep = clearances(own) < -1e-3
    images, points = {}, {}
    for policy in ("cut", "emdt_mirror", "clamp"):
        answer = shaded(replace(SECANT, hidden=policy), room, 0, renderer=renderer)[0].reflection.vertices
        images[policy], points[policy] = lanes(answer.virtual)[: len(own)][deep], lanes(answer.R)[: len(own)][deep]
    eye, V = np.asarray(EYE), own[deep]
    np.testing.assert_allclose(images["cut"], V, atol=1e-6)  # edges are cut before they come there
    # Mirrored in the plane of what the eye sees of the ball in their direction, images come to lie before the ball.
    d = (V - eye) / np.linalg.norm(V - eye, axis=1, keepdims=True)
    b = d @ eye
    t = -b - np.sqrt(b**2 - eye @ eye + 0.25)
    P = eye + t[:, None] * d
    n = P / 0.5
    expected = V - 2 * ((V - P) * n).sum(1, keepdims=True) * n
    close = np.abs((d * n).sum(1)) > 0.3  # a texel more or less turns a plane near the outline much
    assert close.sum() > 30
    assert np.median(np.linalg.norm(images["emdt_mirror"] - expected, axis=1)[close]) < 0.1
    assert (((images["emdt_mirror"] - P) * n).sum(1)[close] > 0).all()
    # On the outline, the eye's ray is at right angles to the normal; 14 halvings, and texels of 256.
    R = points["clamp"]
    w = (eye - R) / np.linalg.norm(eye - R, axis=1, keepdims=True)
    np.testing.assert_allclose((w * R).sum(1) / 0.5, 0, atol=5e-3)
    np.testing.assert_allclose(np.cross(images["clamp"] - eye, R - eye), 0, atol=1e-4)


@pytest.mark.parametrize("hidden", ["cut", "emdt_mirror"])
def test_linear_depth_knows_no_images_in_front_of_the_mirror(hidden):
    with pytest.raises(ValueError, match=f'depth "screen_linear" with hidden "{hidden}"; accepted: "drop" or "clamp"'):
        SecantTriangle(depth="screen_linear", hidden=hidden)


def test_either_depth_shows_nearly_the_same(room, renderer):
    """What differs is interpolation: straight between images, or between reflection points."""
    one, two = (
        shaded(replace(SECANT, hidden="drop", depth=d), room, 0, renderer=renderer)[0] for d in ("perspective", "screen_linear")
    )
    both = one.found & two.found & one.active
    assert (one.found != two.found)[one.active].mean() < 2e-3
    difference = np.abs(one.L - two.L).max(axis=2)[both]
    assert 0 < np.median(difference) < 2e-3
    assert np.median(np.abs(one.distance - two.distance)[both] / one.distance[both]) < 0.01
    np.testing.assert_array_equal(vertex(one, "R"), vertex(two, "R"))


# From frame to frame.


@every_method
def test_a_warm_search_takes_a_step_or_two_and_finds_the_same(name, room, renderer):
    method = ALL[name]
    first, warm = shaded(method, room, 0, 1, renderer=renderer)
    fresh = shaded(method, room, 1, renderer=renderer)[0]
    means = [i[i > 0].mean() for i in (vertex(a, "iterations") for a in (first, warm))]
    assert means[1] < 0.75 * means[0]
    assert means[1] < 2.2  # 0.4 degrees of orbit
    both = vertex(warm, "converged") & vertex(fresh, "converged")
    assert (vertex(warm, "converged") != vertex(fresh, "converged")).mean() < 1e-3
    # The same points, to what a search stops at: 0.004 px, but for a tenth of a texel.
    camera = room.camera(room.time(1))
    off = truth.on_screen(lanes(warm.reflection.vertices.R), camera, *SIZE) - truth.on_screen(
        lanes(fresh.reflection.vertices.R), camera, *SIZE
    )
    assert np.linalg.norm(off, axis=1)[both].max() < (0.01 if name != "image_space_search" else 0.2)
    assert np.abs(warm.L - fresh.L).max(axis=-1)[warm.active].mean() < 1e-3
    assert shaded(cold(method), room, 0, 1, renderer=renderer)[1].same(fresh)


@every_method
def test_after_a_cut_of_the_camera_everything_is_as_from_a_cold_start(name):
    """F-19."""

    def cut(time):
        return Camera(EYE, CENTRE, 45.0) if time < 0.06 else Camera((1.7, 0.2, 0.25), CENTRE, 45.0)

    made, method = mirror_room(camera=cut), replace(ALL[name], split_px=0)
    after, fresh = shaded(method, made, 0, 1, 2)[2], shaded(method, made, 2)[0]
    assert after.same(fresh)


@every_method
def test_after_a_jump_of_the_eye_alone_a_convex_mirror_shows_what_it_does_from_a_cold_start(name):
    def jump(time):
        return still()(time) if time < 0.06 else Camera((0.7, -2.2, 0.3), (0.5, -0.5, 0.05), 45.0)

    made = mirror_room(camera=jump)
    after, fresh = shaded(ALL[name], made, 0, 1, 2)[2], shaded(ALL[name], made, 2)[0]
    assert np.abs(after.L - fresh.L).max(axis=-1)[after.active].mean() < 1e-3


@pytest.mark.parametrize("name", ["newton", "secant_triangle"])
def test_a_search_that_starts_at_a_root_of_another_kind_and_gets_lost_begins_anew(name):
    """F-19: the ball was beyond the dish's focus, and is within it. Cold, its vertices are all found."""
    made = basin(0.6)
    before, after = shaded(ALL[name], made, 1, 2)
    fresh = shaded(ALL[name], made, 2)[0]
    assert vertex(before, "converged").sum() > 500 and vertex(fresh, "converged").sum() > 1000
    assert (vertex(after, "converged") >= vertex(fresh, "converged")).all()
    assert np.abs(after.L - fresh.L).max(axis=-1)[after.active].mean() < 1e-3


@exact_methods
def test_a_mirror_that_moves_is_the_same_mirror_built_there(name):
    """Rigidly, from a pose where it is not aligned with its map to another; nothing is built anew."""
    solid = Ellipsoid(half=(0.5, 0.3, 0.6)).mesh(4)

    def pose(time):
        made = np.eye(4)
        made[:3, :3] = Rotation.from_rotvec([0.5 - 0.9 * time, 0.3, 1.1 * time]).as_matrix()
        made[:3, 3] = [0.1, 0.2 * time, -0.1 * time]
        return made

    made = scene((walls(), *balls()), (Reflector("egg", solid, motion=pose),), fps=1.0)
    built = scene((walls(), *balls()), (Reflector("egg", solid.transformed(pose(1.0))),), fps=1.0)
    method = cold(ALL[name])
    start, moved = shaded(method, made, 0, 1)
    there = shaded(method, built, 1)[0]
    assert (start.active != moved.active).sum() > 300
    assert (there.active != moved.active).sum() <= 2
    one, two = vertex(moved, "converged"), vertex(there, "converged")
    assert (one != two).mean() < 1e-3 and one.sum() > 3000
    off = np.linalg.norm(lanes(moved.reflection.vertices.R) - lanes(there.reflection.vertices.R), axis=1)[one & two]
    # 0.004 px of a picture in which a metre is 85 px are 5e-5; where it is seen edge-on, a multiple.
    assert np.percentile(off, 99) < 2e-4 and off.max() < 2e-3
    assert off_px(there, built).max() < 0.01
    both = moved.active & there.active
    assert (np.abs(moved.L - there.L)[both].max(axis=1) > 0.01).mean() < 0.01
    assert all(a is b for a, b in zip(start.state.mirrors, moved.state.mirrors, strict=True))


# Which mirrors.


def test_a_secant_triangle_refuses_what_is_not_star_shaped_and_says_why():
    ring = trimesh.creation.torus(0.5, 0.15)
    torus = Reflector("ring", Mesh(np.add(ring.vertices, [0.0, 0.0, 0.1]), ring.faces))
    said = SecantTriangle().refuses(scene((walls(),), (mirror_ball(), torus)))
    assert said is not None
    assert said.startswith("reflector ring: it is not star-shaped: ")
    assert "% of the rays from its centre (0, 0, 0.1) meet it more than once" in said
    flat = SecantTriangle().refuses(scene((walls(),), (tilted_sheet(),)))
    assert flat is not None and flat.startswith("reflector sheet: it is not star-shaped: it runs through its own centre")
    for reflector in (mirror_ball(), hollow("concave"), hollow("torus")):
        assert SecantTriangle().refuses(scene((walls(),), (reflector,))) is None
    assert Newton().refuses(scene((walls(),), (torus,))) is None


@pytest.mark.parametrize("name", ["concave", "torus"])
@pytest.mark.parametrize("method", [Newton(), SECANT, replace(SECANT, newton="off")], ids=["newton", "secant", "off"])
def test_with_several_reflection_points_flags_are_honest(method, name):
    made = scene((walls(), *balls()), (hollow(name),), still((0.2, -1.0, 0.5)))
    answer = shaded(method, made, 0)[0]
    assert answer.active.sum() > 1000
    assert np.isfinite(answer.L).all() and np.isfinite(answer.distance).all()
    for field in vars(answer.reflection.vertices):
        assert np.isfinite(vertex(answer, field)).all(), field
    converged, region = vertex(answer, "converged"), vertex(answer, "region")
    assert not (converged & (region != 1)).any()
    assert vertex(answer, "residual")[converged].max() < 0.06
    assert vertex(answer, "iterations").max() <= 2 * method.max_iter
    # Walks end on the sheet that is seen; secants start across the opening, and the mirror hides some of their ends.
    others = sum(len(o.mesh.vertices) for o in made.objects)
    assert converged.sum() > (0.9 if getattr(method, "newton", "always") == "always" else 0.5) * others
    sheet = scene(made.objects, (replace(made.reflectors[0], closed=None),), made.camera)
    off = off_px(answer, sheet)
    known = off[np.isfinite(off)]
    assert len(known) > 0.98 * len(off)
    assert known.max() < (0.01 if getattr(method, "newton", "always") == "always" else 2.0)


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("hidden", ["cut", "drop"])
def test_newton_shows_a_plane_mirror_of_two_triangles_from_either_side(turned, hidden):
    mirror = tilted_sheet(3.0)
    if turned:  # seen from behind
        mirror = replace(mirror, mesh=replace(mirror.mesh, faces=mirror.mesh.faces[:, ::-1], normals=-mirror.mesh.normals))
    made = scene(balls(), (mirror,), background=(0.1, 0.2, 0.4))
    answer, expected = shaded(Newton(hidden=hidden), made, 0)[0], picture(made)
    assert answer.active.mean() > 0.9
    # Images in a plane are exact, of balls that all lie well within it.
    wrong = np.abs(answer.L - expected.image).max(axis=2)[answer.active & expected.mask] > 1e-3
    assert wrong.mean() < 1e-3
    assert (answer.L[answer.active].max(axis=1) > 0.7).sum() > 300


@every_method
def test_what_stands_on_a_mirror_meets_its_image(name):
    """F-29: a ball that touches the mirror ball, with a vertex at the very point."""
    towards = np.array([np.sin(np.radians(50)), -np.cos(np.radians(50)), 0.0])
    red = ball(0.15, (0, 0, 0), (0.9, 0.1, 0.1), 4)
    turn = Rotation.align_vectors([-towards], [red.vertices[0].copy()])[0].as_matrix()
    red = replace(red, vertices=red.vertices @ turn.T + 0.65 * towards, normals=red.normals @ turn.T)
    made = scene((walls(), Object("red", red, shows="contact")), (mirror_ball(fine=192),))
    answer, expected = shaded(ALL[name], made, 0)[0], picture(made)
    is_red, truly = (x[..., 0] - x[..., 1] > 0.5 for x in (answer.L, expected.image))
    both = answer.active & expected.mask
    assert (truly & both).sum() > 150
    gap = (is_red != truly) & both
    assert gap.sum() <= 4


@every_method
def test_a_box_whose_side_lies_on_a_plane_mirror_meets_its_image(name):
    """F-29; what needs a closed mirror says so."""
    sheet = Reflector("sheet", quad((-3, 0, -3), (6, 0, 0), (0, 0, 6)))
    stand = Object("box", lit(box((-0.3, -0.5, -0.3), (0.2, 0, 0.25)), 0.2), shows="contact")
    made = scene((stand,), (sheet,), still((1.4, -1.5, 0.8), (0, -0.1, 0)), background=(0.1, 0.2, 0.4))
    if name == "secant_triangle":
        assert ALL[name].refuses(made) is not None
        return
    answer, expected = shaded(ALL[name], made, 0)[0], picture(made)
    both = answer.active & expected.mask
    wrong = np.abs(answer.L - expected.image).max(axis=2)[both] > 0.02
    shown = np.isfinite(expected.distance)[both]
    assert shown.sum() > 300
    assert wrong.sum() < 0.01 * shown.sum() + 3
    touching = np.abs(stand.mesh.vertices[:, 1]) < 1e-9
    assert touching.sum() > 8
    if name == "newton":
        assert (vertex(answer, "region")[: len(touching)][touching] == 1).all()
        np.testing.assert_allclose(
            lanes(answer.reflection.vertices.R)[: len(touching)][touching], stand.mesh.vertices[touching], atol=1e-5
        )


def test_a_convex_mirror_is_not_asked_about_its_own_back(room, renderer):
    one, two = (shaded(replace(SECANT, self_occlusion=s), room, 0, renderer=renderer)[0] for s in (True, False))
    assert one.same(two)


# Several mirrors.


@pytest.fixture(scope="module")
def mirrors():
    return (mirror_ball("one", (-0.45, 0.0, 0.0), 0.35), mirror_ball("two", (0.45, 0.1, 0.0), 0.35))


@every_method
def test_other_mirrors_are_black_or_as_if_they_were_not_there(name, mirrors):
    made, alone = scene((walls(), *balls()), mirrors), scene((walls(), *balls()), mirrors[:1])
    black, omitted = (shaded(replace(ALL[name], other_mirrors=o), made, 0)[0] for o in ("black", "omitted"))
    single = shaded(ALL[name], alone, 0)[0]
    own = (reflector_of(black) == 0) & (reflector_of(single) == 0)
    dark = (black.L.max(axis=2) == 0) & black.found & own
    assert dark.sum() > 30
    lighted = omitted.L.max(axis=2) > 0
    assert lighted[dark].all()
    # Mirrors that are solved together stand elsewhere in their own space, which rounds otherwise.
    assert (np.abs(omitted.L - single.L).max(axis=2)[own] > 1e-4).mean() < 1e-3
    same = own & ~binary_dilation(dark, iterations=2)
    np.testing.assert_allclose(black.L[same], omitted.L[same], atol=1e-5)
    # The vertices of mirrors are not even searched.
    objects = sum(len(o.mesh.vertices) for o in made.objects)
    for answer, searched in ((black, True), (omitted, False)):
        iterations = vertex(answer, "iterations").reshape(2, -1)
        region = vertex(answer, "region").reshape(2, -1)
        assert (iterations[:, :objects] > 0).mean() > 0.9
        assert (iterations[:, objects:] > 0).any() == searched
        assert (region[:, objects:] > 0).any() == searched


@pytest.mark.parametrize("field", ["backtracks", "texel_reads"])
def test_counters_have_one_number_per_vertex_and_mirror(field, mirrors):
    made = scene((walls(), *balls()), mirrors)
    method = replace(SECANT, start="paper", newton="off") if field == "backtracks" else ImageSpaceSearch()
    method = replace(method, split_px=0)
    counters = shaded(method, made, 0)[0].reflection.counters
    assert set(counters) == {"iterations", field}
    assert all(np.array(value).shape == (2 * made.vertices,) for value in counters.values())
