"""Many pictures at once: side by side on one sheet, rasterized as one.

Every picture is a square whose side is a power of two. Squares that are put along a Morton curve, the largest first, leave
no gaps, and each lies at a multiple of its own size, so that the sheet's mip levels are those of its pictures.

A camera is a linear map of homogeneous coordinates, and so is the way from its picture to a place on the sheet. Each picture
gets vertices of its own, which are carried by both: what one camera sees of all of them is the sheet. A point of them is
(column, row, 1) times its depth, told in distances of its camera, so that all depths are near 1.

On the sheet, texel (column, row) of a level is packet row * (width of the level) + column; levels lie one after the other,
the finest first. A packet holds 4 floats, premultiplied with coverage: radiance of an object, or unit normal of a mirror (with
its normal map) in the axes of the camera, then coverage.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from benchharness.kernels import geometry, lighting, normalmap, packets, painting, raster
from benchharness.kernels.frozen import frozen, roomy
from benchharness.kernels.images import depthmap, impostor
from benchharness.kernels.types import View

COARSEST = 4  # texels across a picture's last mip level
NEAR = 0.25  # depth before which nothing is drawn; all that cameras see is near 1
INTEGERS, FLOATS = 8, 28  # of a picture, in the tables that kernels read


@dataclass(frozen=True, eq=False)
class Shots:
    """K pictures to be taken.

    parts    what each shows, int [K]
    mirrors  whether that is a mirror, bool [K]
    cameras  from where, in the space of its part
    sizes    texels across, powers of two, int [K]
    viewers  from where highlights are seen, in world space [K, 3]
    """

    parts: np.ndarray
    mirrors: np.ndarray
    cameras: impostor.ImpostorCamera
    sizes: np.ndarray
    viewers: np.ndarray


@dataclass
class Sheet:
    """Pictures side by side.

    texels  packets of all levels
    depth   of the finest level, as `kernels.images.depthmap` has it
    width, height  of the finest level
    """

    texels: mi.Float
    depth: mi.Float
    width: int
    height: int


@dataclass(frozen=True)
class Runs:
    """Where a part's vertices and triangles lie in the scene's: the first of them, and how many, int [parts]."""

    vertex: np.ndarray
    vertices: np.ndarray
    face: np.ndarray
    faces: np.ndarray


def runs_of(triangles: geometry.Geometry, parts: int) -> Runs:
    """Of all parts, which lie one after the other. Waits for the device."""
    owners = np.array(triangles.points).reshape(-1, 4)[:, 3].astype(int)
    tags = np.array(triangles.faces).reshape(-1, 4)[:, 3].astype(np.int64) & (raster.CLOSED - 1)
    vertices, faces = (np.bincount(own, minlength=parts) for own in (owners, tags))
    return Runs(np.cumsum(vertices) - vertices, vertices, np.cumsum(faces) - faces, faces)


def levels_of(size: int, mip: bool) -> int:
    """How many mip levels a picture of `size` texels has."""
    return max((size // COARSEST).bit_length(), 1) if mip else 1


def placed(sizes: np.ndarray) -> tuple[np.ndarray, np.ndarray, int, int]:
    """Where squares of these sizes lie on a sheet: the column and the row of each one's first texel, int [K], then the
    sheet's width and height.

    The curve fills one block after the other, each as wide as the sheet; a wider sheet would leave more of it empty.
    """
    order, most = np.argsort(-sizes, kind="stable"), int(sizes.max())
    areas = sizes[order].astype(np.int64) ** 2
    along = np.empty_like(areas)
    along[order] = np.cumsum(areas) - areas
    total = int(areas.sum())
    width = max(most, 1 << (total.bit_length() - 3) // 2)
    block, within = np.divmod(along, width * width)
    columns, rows = _even_bits(within), _even_bits(within >> 1) + width * block
    return columns, rows, width, most * _rounded(-(-int((rows + sizes).max()) // most))


def _even_bits(code: np.ndarray) -> np.ndarray:
    """Every other bit of a Morton code, from the last on."""
    code = code & 0x5555_5555_5555_5555
    for shift, mask in ((1, 0x3333_3333_3333_3333), (2, 0x0F0F_0F0F_0F0F_0F0F), (4, 0x00FF_00FF_00FF_00FF),
                        (8, 0x0000_FFFF_0000_FFFF), (16, 0x0000_0000_FFFF_FFFF)):  # fmt: skip
        code = (code | (code >> shift)) & mask
    return code


def taken(
    triangles: geometry.Geometry, runs: Runs, shine: lighting.Shine | None, world: mi.Float, shots: Shots, mip: bool
) -> tuple[Sheet, np.ndarray, np.ndarray]:
    """Takes pictures. Returns them, and the column and row of each one's first texel. Waits for the device.

    triangles  as `geometry.of_scene_seen` has them, in the space of their parts
    shine      what highlights need, with normals in world space; None for a scene without
    world      packets of the vertices in world space
    mip        with mip levels
    """
    columns, rows, width, height = placed(shots.sizes)
    tables, vertices, faces = _tables(triangles, runs, shots, columns, rows)
    view = view_of(width, height)
    points, own = _copied(triangles, tables, vertices, faces)
    visibility = raster.rasterize(points, own, faces, view, cull="back")
    texels, depth = _resolved(Scene(triangles, shine, world), Copies(points, own), visibility, tables, view)
    levels = levels_of(int(shots.sizes.max()), mip)
    return Sheet(with_levels(texels, width, height, levels), depth, width, height), columns, rows


@dataclass
class Tables:
    """What kernels read of each picture.

    integers  where its vertices and triangles begin among the copies; where in the scene; how many triangles; its part
    floats    3 rows onto the sheet; axes a, b, k of the camera, and beside each nearest and farthest depth in distances, and 1
              for a mirror; its viewer
    count     rows of both
    """

    integers: mi.UInt32
    floats: mi.Float
    count: int


@dataclass
class Scene:
    """The first three arguments of `taken` that the device reads."""

    triangles: geometry.Geometry
    shine: lighting.Shine | None
    world: mi.Float


@dataclass
class Copies:
    """Vertices on the sheet, and triangles of them, whose part is the number of their picture."""

    points: mi.Float
    faces: mi.UInt32


def _tables(
    triangles: geometry.Geometry, runs: Runs, shots: Shots, columns: np.ndarray, rows: np.ndarray
) -> tuple[Tables, int, int]:
    """The tables of pictures, and for how many vertices and triangles there is to be room.

    Both, and the tables' length, are rounded up, so that few sizes are recorded.
    """
    parts, count = shots.parts, len(shots.parts)
    vertices, faces = roomy(int(runs.vertices[parts].sum())), roomy(int(runs.faces[parts].sum()))
    integers = np.full((roomy(count), INTEGERS), max(vertices, faces), np.uint32)
    for k, (many, first) in enumerate(((runs.vertices, runs.vertex), (runs.faces, runs.face))):
        integers[:count, k] = np.cumsum(many[parts]) - many[parts]
        integers[:count, 2 + k] = first[parts]
    integers[:count, 4], integers[:count, 5] = runs.faces[parts], parts

    camera = shots.cameras
    floats = np.zeros((roomy(count), FLOATS // 4, 4), np.float32)
    floats[:count, :3] = impostor.onto(camera, shots.sizes, columns, rows)
    floats[:count, 3:6, :3] = np.stack([camera.a, camera.b, camera.k], axis=1)
    floats[:count, 3:6, 3] = np.stack([camera.near / camera.distance, camera.far / camera.distance, shots.mirrors], axis=1)
    floats[:count, 6, :3] = shots.viewers
    return Tables(mi.UInt32(integers.ravel()), mi.Float(floats.ravel()), len(integers)), vertices, faces


def _rounded(count: int) -> int:
    """`count` rounded up to three significant bits; at least 1."""
    step = 1 << max(count.bit_length() - 3, 0)
    return max(-(-count // step), 1) * step


def view_of(width: int, height: int) -> View:
    """The camera whose picture is the sheet; rays are told from where they cross depth 1."""
    view = View(
        eye=mi.Point3f(0, 0, 0),
        x=mi.Vector4f(1, 0, 0, 0),
        y=mi.Vector4f(0, 1, 0, 0),
        w=mi.Vector4f(0, 0, 1, 0),
        right=mi.Vector3f(1, 0, 0),
        down=mi.Vector3f(0, 1, 0),
        axis=mi.Vector3f(0, 0, 1),
        depth=mi.Float(1),
        origin=mi.Point3f(0, 0, 1),
        near=mi.Float(NEAR),
        width=width,
        height=height,
    )
    dr.make_opaque(view)
    return view


def owners(starts: mi.UInt32, count: int, lanes: int) -> mi.UInt32:
    """Whose a lane is, for `count` runs of lanes that begin at `starts`, ascending; starts beyond all lanes have none.

    `count` is a number, and no width, for recordings are replayed for other widths.
    """
    number = dr.arange(mi.UInt32, count)
    owner = dr.zeros(mi.UInt32, lanes)
    dr.scatter(owner, number, starts, starts < lanes)
    return dr.prefix_reduce(dr.ReduceOp.Max, owner, exclusive=False)


@frozen
def _copied(triangles: geometry.Geometry, tables: Tables, vertices: int, count: int) -> tuple[mi.Float, mi.UInt32]:
    """The vertices and triangles of all pictures: `Copies`. Lanes without any hold a point, and triangles without area."""
    number = dr.arange(mi.UInt32, tables.count)
    starts = dr.gather(mi.Vector4u, tables.integers, 2 * number)

    lane = dr.arange(mi.UInt32, vertices)
    own = owners(starts.x, tables.count, vertices)
    run = dr.gather(mi.Vector4u, tables.integers, 2 * own)
    source = dr.minimum(run.z + lane - run.x, triangles.vertex_count - 1)
    p = dr.gather(mi.Vector4f, triangles.points, source)
    p.w = 1.0
    rows = [dr.gather(mi.Vector4f, tables.floats, (FLOATS // 4) * own + k) for k in range(3)]
    on_sheet = packets.stored(mi.Vector4f(*(dr.dot(row, p) for row in rows), 0), vertices)

    lane = dr.arange(mi.UInt32, count)
    own = owners(starts.y, tables.count, count)
    run, more = (dr.gather(mi.Vector4u, tables.integers, 2 * own + k) for k in range(2))
    local = lane - run.y
    face = dr.gather(mi.Vector4u, triangles.faces, run.w + local, local < more.x)
    shift, tag = run.x - run.z, (face.w & raster.CLOSED) | own
    shifted = mi.Vector4u(face.x + shift, face.y + shift, face.z + shift, tag)
    return on_sheet, packets.stored(dr.select(local < more.x, shifted, mi.Vector4u(0, 0, 0, 0)), count)


@frozen
def _resolved(scene: Scene, copies: Copies, visibility: mi.UInt32, tables: Tables, view: View) -> tuple[mi.Float, mi.Float]:
    """The finest level and its depths, from the nearest triangle of every texel."""
    count = view.width * view.height
    hit, face, weights, p = raster.seen(copies.points, copies.faces, visibility, view, dr.arange(mi.UInt32, count))
    own = geometry.part_of(face)
    run, more = (dr.gather(mi.Vector4u, tables.integers, 2 * own + k, hit) for k in range(2))
    back = run.z - run.x
    face = mi.Vector4u(face.x + back, face.y + back, face.z + back, face.w)
    value = raster.interpolate(scene.triangles.attributes, face, weights, hit).xyz
    if scene.triangles.paint is not None:
        value = mi.Vector3f(painting.seen(scene.triangles.paint, mi.Color3f(value), more.y, face, weights, hit))
    a, b, k, viewer = (dr.gather(mi.Vector4f, tables.floats, (FLOATS // 4) * own + row, hit) for row in range(3, 7))
    mirror = k.w > 0
    n = dr.normalize(value)
    if scene.triangles.normal_maps is not None:
        spot = lighting.Spot(scene.triangles.points, face, more.y, weights)
        n, _ = normalmap.tilted(scene.triangles.normal_maps, spot, n, hit & mirror)
    value = dr.select(mirror, mi.Vector3f(dr.dot(n, a.xyz), dr.dot(n, b.xyz), dr.dot(n, k.xyz)), value)
    if scene.shine is not None:
        spot = lighting.Spot(scene.world, face, more.y, weights)
        value += mi.Vector3f(lighting.seen_from(mi.Point3f(viewer.xyz), scene.shine, spot, hit & ~mirror))
    near, far = a.w, b.w
    zgl = (p.z - near) * far * dr.rcp(p.z * (far - near))
    texels = packets.stored(dr.select(hit, mi.Vector4f(value.x, value.y, value.z, 1), 0), count)
    return texels, dr.select(hit, dr.clip(zgl, 0, 1), depthmap.BACKGROUND)


@frozen
def with_levels(texels: mi.Float, width: int, height: int, levels: int) -> mi.Float:
    """A sheet with mip levels: each texel of a level is the mean of four of the one before."""
    made = [texels]
    for _ in range(levels - 1):
        width, height = width // 2, height // 2
        lane = dr.arange(mi.UInt32, width * height)
        first = 4 * width * (lane // width) + 2 * (lane % width)
        total = sum(dr.gather(mi.Vector4f, made[-1], first + k) for k in (0, 1, 2 * width, 2 * width + 1))
        made.append(packets.stored(0.25 * total, width * height))
    return dr.concat(made)
