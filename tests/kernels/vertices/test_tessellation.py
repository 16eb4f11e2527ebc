"""Edges whose images bend are split, all triangles beside them alike, and no others."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import pytest
from support.mirror_room import CENTRE, EYE, balls, mirror_ball, orbit, scene, shaded, smooth, still
from support.small_room import box, quad

from benchharness.kernels.vertices import scenery, tessellation, vertexwise
from benchharness.measure import truth
from benchharness.scene import Gloss, Mesh, Object, PointLight, Reflector, subdivided
from methods.image_space_search import ImageSpaceSearch
from methods.newton import Newton
from methods.ray_traced import RayTraced
from methods.secant_triangle import SecantTriangle

SIZE = (160, 120)
METHODS = {"newton": Newton, "secant_triangle": SecantTriangle, "image_space_search": ImageSpaceSearch}
every_method = pytest.mark.parametrize("name", METHODS)


def coarse_walls(half: float = 2.0) -> Object:
    """Six walls of two triangles each, all in one piece."""
    mesh = box((-half,) * 3, (half,) * 3, inside=True)
    return Object("walls", replace(mesh, radiance=smooth(mesh.vertices)), "triangles whose images bend by many pixels")


@dataclass
class Pieces:
    """What a frame was drawn with, on the host: vertices [V, 3] in the world, triangles [F, 3], the listed triangle that each
    is a piece of [F], kinds of virtual vertices [V] and the pixels at which those are seen [V, 2]; and of how many
    triangles."""

    vertices: np.ndarray
    faces: np.ndarray
    piece_of: np.ndarray
    kind: np.ndarray
    pixel: np.ndarray
    listed: int

    @property
    def edges(self) -> np.ndarray:
        """The two ends of each edge, in space, flat [E, 6]: whatever the vertices are numbered."""
        ends = self.vertices[np.stack([self.faces, np.roll(self.faces, -1, axis=1)], axis=2).reshape(-1, 2)]
        ends = np.round(ends, 5) + 0.0
        swapped = [(tuple(b), tuple(a)) if tuple(b) < tuple(a) else (tuple(a), tuple(b)) for a, b in ends]
        return np.array(swapped).reshape(-1, 6)


@pytest.fixture
def spied(monkeypatch):
    """What frames are drawn with, in their order."""
    seen, solved = [], vertexwise._solved

    def told(seen_, problem, *args):
        one, made = solved(seen_, problem, *args)
        if made is None:
            return one, made
        faces = np.array(made.world.faces).reshape(-1, 4)
        real = faces[:, 0] != faces[:, 1]
        moved = np.array(made.made.known.images.moved, np.float64).reshape(-1, 4)
        at = np.array(made.made.known.images.at, np.float64).reshape(-1, 4)
        rows = [np.array(getattr(problem.view, k), np.float64).ravel() for k in "xyw"]
        x, y, w = (np.column_stack([at[:, :3], np.ones(len(at))]) @ row for row in rows)
        with np.errstate(divide="ignore", invalid="ignore"):
            pixel = np.stack([x / w, y / w], axis=1)
        points = np.array(made.world.points, np.float64).reshape(-1, 4)[:, :3]
        listed = int((np.array(problem.world.faces).reshape(-1, 4)[:, 0] != 0).sum())
        seen.append(Pieces(points, faces[real][:, :3].astype(int), np.array(made.piece_of)[real], moved[:, 3], pixel, listed))
        return one, made

    monkeypatch.setattr(vertexwise, "_solved", told)
    return seen


def areas(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)


@every_method
@pytest.mark.parametrize("resolve", ["interpolate", "ray"])
def test_pieces_fill_their_triangles_and_leave_no_cracks(name, resolve, spied):
    made = scene((coarse_walls(), *balls()), (mirror_ball(),))
    shaded(METHODS[name](split_px=0.5, resolve=resolve), made, 0, size=SIZE)
    [pieces] = spied
    inside = np.abs(np.abs(pieces.vertices[pieces.faces]).max(axis=2) - 2).max(axis=1) < 1e-6
    assert inside.sum() > 300  # of twelve
    # No edge without a triangle on its other side: a vertex in the middle of another's edge would leave three.
    uses = Counter(map(tuple, replace(pieces, faces=pieces.faces[inside]).edges))
    assert set(uses.values()) == {2}
    per_wall = np.bincount(pieces.piece_of[inside], areas(pieces.vertices, pieces.faces)[inside])
    assert per_wall[per_wall > 0] == pytest.approx(np.full(12, 8.0), rel=1e-5)


@pytest.mark.parametrize("pixels", [2.0, 0.5])
def test_what_is_left_is_off_by_no_more_than_was_asked_for(pixels, spied):
    """Against the true reflection points of edges' middles, in float64."""
    made = scene((coarse_walls(),), (mirror_ball(fine=192),))
    shaded(Newton(split_px=pixels), made, 0, size=SIZE)
    [pieces] = spied
    ends = np.unique(np.sort(np.stack([pieces.faces, np.roll(pieces.faces, -1, axis=1)], axis=2).reshape(-1, 2)), axis=0)
    wall = np.abs(np.abs(pieces.vertices).max(axis=1) - 2) < 1e-6
    ends = ends[(wall[ends] & (pieces.kind[ends] == 1)).all(axis=1)]
    rng = np.random.default_rng(1)
    ends = ends[rng.choice(len(ends), 120, replace=False)]
    off = []
    for a, b in ends:
        images = [virtual(made, pieces.vertices[i]) for i in (a, b)]
        middle = virtual(made, 0.5 * (pieces.vertices[a] + pieces.vertices[b]))
        off.append(np.linalg.norm(on_screen(made, 0.5 * (images[0] + images[1])) - on_screen(made, middle)))
    assert np.quantile(off, 0.9) < pixels
    assert max(off) < 2.5 * pixels
    assert max(off) > 0.2 * pixels  # and no more was split than that takes


def virtual(made, V: np.ndarray) -> np.ndarray:
    """The image of a point in the mirror ball, float64: the least path, found on the great circle through eye and point."""
    eye, radius = np.asarray(EYE), 0.5
    a, b = eye - CENTRE, V - CENTRE
    u = a / np.linalg.norm(a)
    w = b - (b @ u) * u
    w /= np.linalg.norm(w)
    low, high = 0.0, np.arctan2(b @ w, b @ u)

    def slope(t: float) -> float:
        P, along = radius * (np.cos(t) * u + np.sin(t) * w), -np.sin(t) * u + np.cos(t) * w
        return sum(float((P - end) @ along) / np.linalg.norm(P - end) for end in (a, b))

    for _ in range(80):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if slope(middle) < 0 else (low, middle)
    P = radius * (np.cos(low) * u + np.sin(low) * w)
    ray = P - a
    ray /= np.linalg.norm(ray)
    return CENTRE + P + np.linalg.norm(b - P) * ray


def on_screen(made, P: np.ndarray) -> np.ndarray:
    return truth.on_screen(P[None], made.camera(0), *SIZE)[0]


def test_a_flat_mirror_splits_nothing(spied):
    mirror = Reflector("mirror", quad((-0.5, 0, -0.5), (0, 0, 1), (1, 0, 0)))
    made = scene((coarse_walls(),), (mirror,))
    [whole, split] = [shaded(Newton(split_px=px), made, 0, size=SIZE)[0] for px in (0, 0.25)]
    [pieces] = spied
    assert len(np.unique(pieces.piece_of)) == len(pieces.piece_of)
    assert np.array_equal(whole.L, split.L)


def test_more_pieces_the_less_is_asked_for_and_an_image_that_converges(spied):
    fine = subdivided(coarse_walls().mesh, 0.063)
    made = scene((coarse_walls(),), (mirror_ball(),))
    exact = scene((replace(coarse_walls(), mesh=fine),), (mirror_ball(),))
    [target] = shaded(Newton(), exact, 0, size=SIZE)
    errors, counts = [], []
    for pixels in (2.0, 0.5, 0.125):
        [answer] = shaded(Newton(split_px=pixels), made, 0, size=SIZE)
        both = answer.active & target.found
        assert answer.found[both].mean() > 1 - 0.01 * pixels
        errors.append(np.abs(answer.L - target.L)[both & answer.found].mean())
        counts.append(len(spied[-1].faces))
    assert counts == sorted(counts) and counts[-1] < len(fine.faces) / 3
    assert all(b < 0.5 * a for a, b in pairwise(errors)), errors


def test_edges_at_one_place_are_split_alike_in_two_meshes_and_across_seams(spied):
    """A floor of two objects that meet along a line, one of them with vertices of its own in every triangle."""
    left, right = quad((-2, -2, -1), (2, 0, 0), (0, 4, 0)), quad((0, -2, -1), (2, 0, 0), (0, 4, 0))
    torn = Mesh(right.vertices[right.faces].reshape(-1, 3), np.arange(6).reshape(-1, 3))
    objects = [Object(n, replace(m, radiance=smooth(m.vertices)), "half a floor") for n, m in (("left", left), ("right", torn))]
    made = scene(objects, (mirror_ball(),))
    shaded(Newton(split_px=0.5), made, 0, size=SIZE)
    [pieces] = spied
    floor = np.abs(pieces.vertices[pieces.faces][:, :, 2] + 1).max(axis=1) < 1e-6
    edges = replace(pieces, faces=pieces.faces[floor]).edges
    on_rim = ((np.abs(edges[:, [0, 3]]) == 2).all(axis=1) & (edges[:, 0] == edges[:, 3])) | (
        (np.abs(edges[:, [1, 4]]) == 2).all(axis=1) & (edges[:, 1] == edges[:, 4])
    )
    assert floor.sum() > 60
    assert set(Counter(map(tuple, edges[~on_rim])).values()) == {2}
    assert set(Counter(map(tuple, edges[on_rim])).values()) == {1}


def test_several_mirrors_solved_together_are_split_as_each_alone(spied):
    far = mirror_ball("far", (1.2, 0.6, 0.4), 0.3)
    both = scene((coarse_walls(),), (mirror_ball(), far))
    alone = [scene((coarse_walls(),), (m,)) for m in (mirror_ball(), far)]
    [answer] = shaded(Newton(split_px=0.5, other_mirrors="omitted"), both, 0, size=SIZE)
    for k, made in enumerate(alone):
        [one] = shaded(Newton(split_px=0.5), made, 0, size=SIZE)
        mine = (np.array(answer.frame.reflector).reshape(answer.active.shape) == k) & one.active
        assert mine.sum() > 300
        assert np.abs(answer.L - one.L)[mine].max() < 0.02


@pytest.mark.parametrize("degrees", [0.3, 1.0])
def test_what_was_split_stays_split_while_less_than_half_of_it_is_gone(degrees, spied):
    """A camera that goes to and fro."""
    made = scene((coarse_walls(),), (mirror_ball(),), orbit(degrees), frames=3)
    shaded(Newton(split_px=0.5), made, 0, 1, 0, 1, 0, 1, size=SIZE)
    for index in (0, 1):
        shaded(Newton(split_px=0.5), made, index, size=SIZE)
    edges = [set(map(tuple, one.edges)) for one in spied]
    assert edges[2] == edges[4] and edges[3] == edges[5]
    assert edges[4] == edges[5]
    assert edges[6] != edges[7]  # of cameras that were never there before


def test_the_work_is_counted(spied):
    made = scene((coarse_walls(),), (mirror_ball(),))
    [whole], [split] = (shaded(Newton(split_px=px), made, 0, size=SIZE) for px in (0, 0.5))
    searched = [np.array(one.reflection.counters["iterations"]) for one in (whole, split)]
    assert (searched[1] > 0).sum() > 10 * (searched[0] > 0).sum()
    assert len(np.array(split.reflection.vertices.region)) == made.vertices  # what is reported is of the scene's own


@every_method
def test_several_reflections_per_vertex_are_refused(name):
    with pytest.raises(ValueError, match=r"split_px 0\.5 with multi 2; accepted: 0, or multi 1"):
        METHODS[name](split_px=0.5, multi=2)


def test_still_frames_are_the_same_bit_for_bit(spied):
    made = scene((coarse_walls(), *balls()), (mirror_ball(),), still())
    one, two, three = shaded(Newton(split_px=0.5), made, 0, 0, 0, size=SIZE)
    assert two.same(three)
    assert np.abs(one.L - three.L).max() < 0.05


def glossy_floor(motion=None) -> tuple[Object, PointLight]:
    mesh = quad((-2, -2, -1), (4, 0, 0), (0, 4, 0))
    mesh = replace(mesh, radiance=smooth(mesh.vertices), visibility=np.ones((4, 1)))
    floor = Object("floor", mesh, "its highlight", motion, Gloss((0.9, 0.9, 0.9), 40.0))
    return floor, PointLight((0.5, -1.5, 2.0), (4.0, 4.0, 4.0))


def test_highlights_of_pieces_are_those_of_rays(spied):
    floor, light = glossy_floor()
    made = scene((floor,), (mirror_ball(),), lights=(light,))
    [traced] = shaded(RayTraced(), made, 0, size=SIZE)
    off = []
    for pixels in (0.0, 0.25):
        [answer] = shaded(Newton(split_px=pixels), made, 0, size=SIZE)
        both = answer.active & answer.found & traced.found & (traced.distance < 50)
        off.append(np.abs(answer.L - traced.L)[both].mean())
    assert off[1] < 0.2 * off[0], off


@pytest.mark.parametrize("resolve", ["interpolate", "ray"])
def test_pieces_of_what_moves_are_kept_and_go_with_it(resolve, spied, monkeypatch):
    """What is kept from frame to frame draws what a fresh start would, but for edges that are off by a little more or less."""
    built, make = [], tessellation.tessellated
    monkeypatch.setattr(tessellation, "tessellated", lambda *args: built.append(args) or make(*args))

    def slides(time: float) -> np.ndarray:
        pose = np.eye(4)
        pose[0, 3] = 0.5 * time
        return pose

    floor, light = glossy_floor(slides)
    made = scene((floor, *balls()), (mirror_ball(),), orbit(0.3), frames=8, lights=(light,))
    method = Newton(split_px=0.5, resolve=resolve)
    answers = shaded(method, made, *range(8), size=SIZE)
    assert len(built) < 4
    [fresh] = shaded(method, made, 7, size=SIZE)
    both = answers[-1].active & fresh.found & answers[-1].found
    assert (fresh.found == answers[-1].found)[fresh.active].mean() > 0.99
    assert np.abs(answers[-1].L - fresh.L)[both].mean() < 0.003
    moved = np.abs(answers[-1].L - answers[0].L)[both].mean()
    assert moved > 0.02  # and there is something to keep up with


def test_a_cut_of_the_camera_makes_them_anew(spied, monkeypatch):
    built, make = [], tessellation.tessellated
    monkeypatch.setattr(tessellation, "tessellated", lambda *args: built.append(args) or make(*args))
    made = scene((coarse_walls(),), (mirror_ball(),), orbit(90.0), frames=3)
    first, turned = shaded(Newton(split_px=0.5), made, 0, 1, size=SIZE)
    assert len(built) == 2
    [fresh] = shaded(Newton(split_px=0.5), made, 1, size=SIZE)
    assert np.abs(turned.L - fresh.L)[turned.active & turned.found & fresh.found].mean() < 1e-3
    assert set(map(tuple, spied[-2].edges)) == set(map(tuple, spied[-1].edges))  # nothing is remembered
    assert not np.array_equal(first.L, turned.L)


# Mirrors in which a vertex has several images


def bumpy_ball() -> Reflector:
    mesh = mirror_ball().mesh
    v = np.asarray(mesh.vertices)
    r = np.linalg.norm(v, axis=1, keepdims=True)
    bumps = 1 + 0.08 * np.sin(9 * v[:, :1] / r) * np.sin(9 * v[:, 1:2] / r) * np.sin(9 * v[:, 2:] / r)
    return Reflector("mirror", Mesh(v * bumps, mesh.faces))


@pytest.mark.parametrize(
    ("mesh", "bulges"),
    [
        (mirror_ball().mesh, True),
        (subdivided(mirror_ball().mesh, 0.02), True),
        (bumpy_ball().mesh, False),
        (replace(mirror_ball().mesh, normals=-np.asarray(mirror_ball().mesh.normals)), False),
        (quad((0, 0, 0), (1, 0, 0), (0, 1, 0)), True),
    ],
)
def test_what_is_nowhere_hollow(mesh, bulges):
    assert scenery.of_scene(scene((coarse_walls(),), (Reflector("mirror", mesh),)), [mesh], split_px=1.0).bulges == (bulges,)


def test_where_images_jump_splitting_comes_to_an_end(spied):
    made = scene((coarse_walls(),), (bumpy_ball(),))
    for pixels in (1.0, 0.25):
        shaded(Newton(split_px=pixels), made, 0, size=SIZE)
    coarse, fine = (len(one.faces) for one in spied)
    assert coarse < 1500 and fine < 3000, (coarse, fine)


def worst(made, pieces: Pieces) -> tuple[int, float]:
    """How many edges there are along the lower side of a ribbon that lies along x, and by how many pixels the image of the
    worst one's middle is off the middle of its ends' images; float64."""
    ends = np.stack([pieces.faces, np.roll(pieces.faces, -1, axis=1)], axis=2).reshape(-1, 2)
    a, b = np.moveaxis(pieces.vertices[np.unique(np.sort(ends, axis=1), axis=0)], 1, 0)
    along = (np.abs(a - b)[:, 1:] < 1e-6).all(axis=1) & (a[:, 2] < pieces.vertices[pieces.faces][..., 2].min() + 0.01)
    off = []
    for p, q in zip(a[along], b[along], strict=True):
        chord = on_screen(made, 0.5 * (virtual(made, p) + virtual(made, q)))
        off.append(np.linalg.norm(chord - on_screen(made, virtual(made, 0.5 * (p + q)))))
    return len(off), max(off)


def ribbon(place: tuple[float, float], edge: float):
    """A scene with a ribbon three times as long as the room is wide, and of such edges."""
    mesh = subdivided(quad((-3, *place), (6, 0, 0), (0, 0, 0.02)), edge)
    return scene((Object("bar", replace(mesh, radiance=smooth(mesh.vertices)), "bends"),), (mirror_ball(),))


BARS = [(-0.9, 0.4), (-0.6, 0.5), (-1.3, 0.1)]


@pytest.mark.parametrize("place", BARS)
def test_the_error_of_a_long_bar_falls_with_the_square_of_its_pieces(place, spied):
    """F-14."""
    told = []
    for count in (8, 16, 32, 64):
        made = ribbon(place, 6.001 / count)
        shaded(Newton(split_px=1e3), made, 0, size=SIZE)
        told.append(worst(made, spied[-1]))
    n, off = np.log(told).T
    assert 1.7 < -np.polyfit(n, off, 1)[0] < 2.3, told


@pytest.mark.parametrize("place", BARS)
@pytest.mark.parametrize("pixels", [8.0, 4.0, 2.0, 1.0, 0.5, 0.25])
def test_a_long_bar_is_off_by_hardly_more_than_was_asked_for(pixels, place, spied):
    """F-14: seen from the side, so that the middle of the whole is hardly off at all and its halves are by pixels."""
    made = ribbon(place, 10.0)
    shaded(Newton(split_px=pixels), made, 0, size=SIZE)
    count, off = worst(made, spied[-1])
    assert off < 1.6 * pixels, (count, off)
