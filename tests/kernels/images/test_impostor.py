"""Cameras that take pictures of a scene's parts: where they camera, and what is in the pictures, against rays in float64."""

from __future__ import annotations

from dataclasses import replace

import mitsuba as mi
import numpy as np
import pytest
from support.mirror_room import ball, plain
from support.small_room import box, quad, sphere

from benchharness.kernels import geometry
from benchharness.kernels.images import atlas, impostor
from benchharness.kernels.images.depthmap import BACKGROUND
from benchharness.scene import Mesh, merged, subdivided

SIZE, HALF_ANGLE = 64, np.radians(5.0)
TOWARDS = [(0.0, 0.0, 1.0), (0.3, -0.8, 0.2), (0.0, 0.02, -1.0), (-5.0, 0.1, 0.0)]
CENTRE, RADIUS = np.array([0.4, -0.2, 0.7]), 0.3


def rigid(axis=(0.3, 0.5, -0.8), angle=1.1, shift=(0.5, -1.0, 2.0)) -> np.ndarray:
    """Rodrigues' rotation and a translation, [3, 4]."""
    x, y, z = np.asarray(axis) / np.linalg.norm(axis)
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.column_stack([np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K, shift])


def of(mesh: Mesh) -> impostor.Shape:
    return impostor.shape_of(mesh.vertices, mesh.faces)


def points_of(camera: impostor.ImpostorCamera, size: int = SIZE) -> np.ndarray:
    """Where the middles of the texels lie on the billboard, [size, size, 3]."""
    x = (np.arange(size) + 0.5) / size * 2 - 1
    across, down = x[None, :, None] * camera.half[0] * camera.a, x[:, None, None] * camera.half[1] * camera.b
    return camera.centre + across + down


def to_ball(camera: impostor.ImpostorCamera, centre=CENTRE, radius=RADIUS, size: int = SIZE):
    """What the texels' rays meet of a ball: [size, size, 3] points, NaN where nothing."""
    d = points_of(camera, size) - camera.eye
    d /= np.linalg.norm(d, axis=-1, keepdims=True)
    from_centre = camera.eye - centre
    b = d @ from_centre
    root = b * b - (from_centre @ from_centre - radius**2)
    with np.errstate(invalid="ignore"):
        return camera.eye + (-b - np.sqrt(root))[..., None] * d


def taken(mesh: Mesh, camera: impostor.ImpostorCamera, size: int = SIZE, mirror: bool = False, pose=None):
    """The picture [size, size, 4] and its depth map [size, size] of the second of two parts that stands at `pose`."""
    aside = ball(5.0, camera.centre, (9.0, 9.0, 9.0), 1)  # around everything: to be left out
    value = mesh.normals if mirror else mesh.radiance
    triangles = geometry.upload([(m.vertices, np.asarray(v), m.faces) for m, v in ((aside, aside.radiance), (mesh, value))])
    poses = np.stack([np.eye(3, 4), np.eye(3, 4) if pose is None else pose]).astype(np.float32)
    world = geometry.placed_seen(triangles, mi.Float(poses.ravel()), 1 if mirror else 2)
    runs = atlas.runs_of(triangles, 2)
    assert runs.faces[1] == len(mesh.faces)
    many = impostor.many(1)
    many.put(np.array([0]), camera)
    shots = atlas.Shots(np.array([1]), np.array([mirror]), many, np.array([size]), camera.eye[None])
    sheet, columns, rows = atlas.taken(triangles, runs, world.shine, world.points, shots, mip=False)
    assert (sheet.width, sheet.height, columns[0], rows[0]) == (size, size, 0, 0)
    return np.array(sheet.texels).reshape(size, size, 4), np.array(sheet.depth).reshape(size, size)


# Shapes


def test_a_shape_is_measured_by_its_surface():
    # A square of many triangles beside one as large of two: its vertices are not its area. One vertex is not used.
    fine = subdivided(quad((0, 0, 0), (1, 0, 0), (0, 1, 0)), 0.1)
    coarse = quad((3, 0, 0), (1, 0, 0), (0, 1, 0))
    both = merged(fine, coarse)
    loose = Mesh(np.concatenate([both.vertices, [[100.0, 0, 0]]]), both.faces)
    shape = of(loose)
    np.testing.assert_allclose(shape.centroid, (2.0, 0.5, 0.0), atol=1e-9)
    assert shape.radius == pytest.approx(np.hypot(2.0, 0.5))
    np.testing.assert_allclose([shape.low, shape.high], [(0, 0, 0), (4, 1, 0)])
    assert shape.plane is not None and of(sphere()).plane is None


@pytest.mark.parametrize(("thick", "flat"), [(0.0, True), (0.049, True), (0.052, False), (1.0, False)])
def test_what_is_thinner_than_a_twentieth_of_its_length_is_flat(thick, flat):
    mesh = box((0, 0, 0), (1, 0.6, thick)) if thick else quad((0, 0, 0), (1, 0, 0), (0, 0.6, 0))
    pose = rigid()
    turned = replace(mesh, vertices=mesh.vertices @ pose[:, :3].T + pose[:, 3])
    assert (of(turned).plane is not None) == flat


@pytest.mark.parametrize(("wide", "flat"), [(0.04, False), (0.07, False), (0.09, True)])
def test_a_rod_has_no_plane_of_its_own(wide, flat):
    """It is thin for its length, but as thick as wide: seen along such a plane it would vanish."""
    assert (of(box((0, 0, 0), (wide, 0.04, 1))).plane is not None) == flat


@pytest.mark.parametrize(
    "corners", [[(0, -1, 0), (0, -1, 1), (0, -1, 0.5)], [(0, -1, 0.5)] * 3, [(0, 0, 0), (1, 2, 3), (3, 6, 9)]]
)
def test_what_has_no_area_has_no_plane_and_a_camera_all_the_same(corners):
    shape = of(Mesh(np.array(corners, float), [[0, 1, 2]]))
    assert shape.plane is None and shape.radius > 0
    camera = impostor.facing(shape, np.array([0.3, 1.0, 0.1]))
    assert np.isfinite([*camera.eye, *camera.half, camera.near, camera.far]).all() and min(camera.half) > 0


def test_the_rectangle_of_a_flat_shape_is_its_smallest_and_lies_in_its_middle():
    pose = rigid()
    for corners in ([(0, 0), (2, 0), (2, 1), (0, 1)], [(0, 0), (2, 0), (2, 0.4), (0.3, 1)]):
        points = np.pad(np.array(corners, float), ((0, 0), (0, 1)))
        a, b, k, middle, half = of(Mesh(points @ pose[:, :3].T + pose[:, 3], [[0, 1, 2], [0, 2, 3]])).plane
        np.testing.assert_allclose(np.stack([a, b, k]) @ np.stack([a, b, k]).T, np.eye(3), atol=1e-9)
        np.testing.assert_allclose(np.cross(a, b), k, atol=1e-9)
        assert abs(k @ pose[:, 2]) == pytest.approx(1, abs=1e-9)
        # All rectangles around the corners, by a sweep of their angle.
        angles = np.linspace(0, np.pi / 2, 20001)
        turns = np.stack([[np.cos(angles), np.sin(angles)], [-np.sin(angles), np.cos(angles)]])
        sides = np.ptp(np.einsum("ija,pj->aip", turns, points[:, :2]), axis=2)
        assert 4 * half[0] * half[1] == pytest.approx(sides.prod(axis=1).min(), rel=1e-6)
        local = (points @ pose[:, :3].T + pose[:, 3] - middle) @ np.stack([a, b, k]).T
        np.testing.assert_allclose(local.max(axis=0), [half[0], half[1], 0], atol=1e-9)
        np.testing.assert_allclose(local.min(axis=0), [-half[0], -half[1], 0], atol=1e-9)


# Cameras


@pytest.mark.parametrize("towards", TOWARDS)
def test_the_sphere_around_a_part_touches_the_sides_of_what_the_camera_sees(towards):
    shape = of(ball(RADIUS, CENTRE, (1, 1, 1)))
    camera = impostor.facing(shape, np.array(towards))
    np.testing.assert_allclose(camera.k, np.array(towards) / np.linalg.norm(towards))
    axes = np.stack([camera.a, camera.b, -camera.k])
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(np.cross(camera.a, camera.b), -camera.k, atol=1e-12)
    np.testing.assert_allclose(camera.centre, shape.centroid)
    assert camera.distance == pytest.approx(shape.radius / np.sin(HALF_ANGLE))
    assert camera.half == pytest.approx((shape.radius / np.cos(HALF_ANGLE),) * 2)
    np.testing.assert_allclose(camera.eye, shape.centroid + camera.distance * camera.k)
    for side in (camera.half[0] * camera.a, camera.half[1] * camera.b):
        # The distance of the middle from the line through the eye and the middle of a side.
        along = camera.centre + side - camera.eye
        off = camera.centre - camera.eye - along * ((camera.centre - camera.eye) @ along) / (along @ along)
        assert np.linalg.norm(off) == pytest.approx(shape.radius)
    depth = (shape.vertices - camera.eye) @ -camera.k
    assert 0 < depth.min() - camera.near < 1e-3 * shape.radius and 0 < camera.far - depth.max() < 1e-3 * shape.radius


def test_a_mirror_at_the_middle_of_a_part_looks_at_it_from_above():
    camera = impostor.facing(of(ball(RADIUS, CENTRE, (1, 1, 1))), np.zeros(3))
    np.testing.assert_allclose(camera.k, (0, 0, 1))
    assert np.isfinite([*camera.a, *camera.b, *camera.eye]).all()


# Pictures


@pytest.mark.parametrize("towards", TOWARDS)
@pytest.mark.parametrize("wider", [1.0, 2.5])
def test_a_ball_is_a_disc_of_the_right_size_with_the_right_depth(towards, wider):
    mesh = ball(RADIUS, CENTRE, (0.2, 0.7, 0.4), 4)
    shape = of(mesh)
    camera = impostor.facing(replace(shape, radius=wider * shape.radius), np.array(towards))
    texels, depth = taken(mesh, camera)
    seen = texels[..., 3] == 1
    assert set(np.unique(texels[..., 3])) <= {0.0, 1.0}
    disc = 0.5 * SIZE * np.tan(np.arcsin(RADIUS / camera.distance)) / np.tan(HALF_ANGLE)  # radius, texels
    assert seen.sum() == pytest.approx(np.pi * disc**2, rel=0.04)
    x = np.arange(SIZE) + 0.5 - SIZE / 2
    r = np.hypot(x[None], x[:, None])
    assert seen[r < disc - 0.5].all() and not seen[r > disc + 0.1].any()
    np.testing.assert_allclose(texels[seen], np.tile((0.2, 0.7, 0.4, 1.0), (seen.sum(), 1)), atol=1e-6)
    assert (texels[~seen] == 0).all() and (depth[~seen] == BACKGROUND).all()
    z = (to_ball(camera)[seen & (r < disc - 1)] - camera.eye) @ -camera.k
    zgl = (1 / camera.near - 1 / z) / (1 / camera.near - 1 / camera.far)
    np.testing.assert_allclose(depth[seen & (r < disc - 1)], zgl, atol=3e-3)  # facets
    assert depth[seen].min() >= 0 and depth[seen].max() <= 1


@pytest.mark.parametrize("towards", TOWARDS)
def test_the_picture_of_a_mirror_is_its_normals_in_the_axes_of_the_camera(towards):
    mesh = sphere(RADIUS, CENTRE, slices=128, stacks=64)
    camera = impostor.facing(of(mesh), np.array(towards))
    texels, _ = taken(mesh, camera, mirror=True)
    expected = (to_ball(camera) - CENTRE) / RADIUS @ np.stack([camera.a, camera.b, camera.k]).T
    seen = (texels[..., 3] == 1) & np.isfinite(expected).all(axis=-1)
    assert seen.sum() > 0.75 * SIZE**2
    np.testing.assert_allclose(np.linalg.norm(texels[seen][:, :3], axis=1), 1, atol=1e-5)
    inner = seen & (expected[..., 2] > 0.2)
    np.testing.assert_allclose(texels[inner][:, :3], expected[inner], atol=0.01)
    assert texels[SIZE // 2, -3, 0] > 0.85 and texels[-3, SIZE // 2, 1] > 0.85  # columns grow along a, rows along b


@pytest.mark.parametrize("mirror", [False, True])
def test_a_part_that_is_carried_with_its_camera_has_the_same_picture(mirror):
    mesh = merged(ball(RADIUS, CENTRE, (0.2, 0.7, 0.4)), ball(0.1, (0.0, 0.1, 0.5), (0.9, 0.1, 0.1)))
    camera = impostor.facing(of(mesh), np.array((0.3, -0.8, 0.2)))
    one, depth = taken(mesh, camera, mirror=mirror)
    other, depth_there = taken(mesh, camera, mirror=mirror, pose=rigid())
    assert ((one[..., 3] > 0) != (other[..., 3] > 0)).sum() <= 4
    both = (one[..., 3] > 0) & (other[..., 3] > 0)
    assert both.sum() > 300
    off = np.abs(one - other)[both].max(axis=1)
    assert np.quantile(off, 0.99) < 1e-3
    assert np.quantile(np.abs(depth - depth_there)[both], 0.99) < 1e-4


def gradient(points: np.ndarray) -> np.ndarray:
    """A colour that tells where a point is: linear, so that triangles have it exactly."""
    return 0.5 + points @ np.array([[0.2, -0.05, 0.1], [0.1, 0.2, -0.1], [0.05, -0.1, 0.2]])


@pytest.mark.parametrize("side", [(4.0, -3.0, 5.0), (-4.0, 3.0, -5.0)])
@pytest.mark.parametrize("angle", [0.0, 1.1, 3.0])
def test_the_picture_of_a_rectangle_is_upright_and_fills_itself(side, angle):
    pose = rigid(angle=angle, shift=(0.1, 0.2, -0.1))
    flat = quad((-1, -0.4, 0), (2, 0, 0), (0, 0.8, 0))
    points = flat.vertices @ pose[:, :3].T + pose[:, 3]
    mesh = Mesh(points, flat.faces, radiance=gradient(points))
    camera = impostor.on_plane(of(mesh), np.array(side))
    assert sorted(camera.half) == pytest.approx([0.4, 1.0])
    assert (np.array(side) - camera.centre) @ camera.k > 0
    np.testing.assert_allclose(np.cross(camera.a, camera.b), -camera.k, atol=1e-9)
    np.testing.assert_allclose(camera.centre, pose[:, 3], atol=1e-9)
    texels, _ = taken(mesh, camera)
    assert (texels[..., 3] == 1).all()
    np.testing.assert_allclose(texels[..., :3], gradient(points_of(camera)), atol=2e-4)


@pytest.mark.parametrize("up", [1, -1])
@pytest.mark.parametrize("thick", [0.009, 0.04])
def test_a_slab_is_shown_as_the_side_of_it_that_faces_the_mirrors(thick, up):
    slab = box((-0.5, -0.3, 0.0), (0.5, 0.3, thick))
    mesh = replace(slab, radiance=gradient(slab.vertices))
    camera = impostor.on_plane(of(mesh), np.array([0.2, 0.1, up * 3.0]))
    np.testing.assert_allclose(camera.centre, (0, 0, thick if up > 0 else 0), atol=1e-9)
    texels, _ = taken(mesh, camera)
    assert (texels[..., 3] == 1).all()
    np.testing.assert_allclose(texels[..., :3], gradient(points_of(camera)), atol=1e-3)


def test_the_back_of_a_closed_part_is_not_in_its_picture_and_that_of_a_sheet_is():
    sheet = quad((-0.5, -0.5, 0), (1, 0, 0), (0, 1, 0))
    camera = impostor.on_plane(of(sheet), np.array([0.0, 0.0, -3.0]))
    texels, _ = taken(plain(sheet, (1, 0, 0)), camera)
    assert (texels[..., 3] == 1).all()  # from behind
    room = plain(box((-1, -1, -1), (1, 1, 1), inside=True), (1, 0, 0))
    camera = impostor.facing(of(room), np.array([0.0, -1.0, 0.0]))
    texels, depth = taken(room, camera)
    seen = texels[..., 3] == 1
    z = 1 / (1 / camera.near - depth[seen] * (1 / camera.near - 1 / camera.far))
    assert np.abs(z - camera.distance - 1).min() < 1e-3 and z.min() > camera.distance - 0.999  # the front wall is not drawn
