"""Shapes to build scenes from: boxes, sheets, tiles, surfaces of revolution, tubes.

Every shape is a `Mesh`, in metres, z up. Faces are counter-clockwise seen from outside. Vertices are shared where a
surface is smooth and doubled where it has an edge or changes colour, so that interpolated normals and baked light do
not leak across. `spacing` is the longest distance between neighbouring base vertices: it says how finely the surface
carries baked light, not how finely it is drawn.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations, pairwise

import numpy as np
import trimesh
from scipy.interpolate import CubicSpline
from scipy.spatial import Delaunay

from benchharness.scene import Mesh, merged

Colour = tuple[float, float, float]
FACES = ("-x", "+x", "-y", "+y", "-z", "+z")


def from_trimesh(mesh: trimesh.Trimesh, albedo: Colour, emission: Colour = (0.0, 0.0, 0.0)) -> Mesh:
    """A trimesh mesh as it stands: shared vertices are smooth."""
    return Mesh(mesh.vertices, mesh.faces, albedo=albedo, emission=emission)


def placed(mesh: Mesh, at=(0.0, 0.0, 0.0), turn_deg: float = 0.0, tilt_deg: float = 0.0, scale: float = 1.0) -> Mesh:
    """Scaled, tilted about x, turned about z, then moved to `at`."""
    return mesh.transformed(pose(at, turn_deg, tilt_deg, scale))


def pose(at=(0.0, 0.0, 0.0), turn_deg: float = 0.0, tilt_deg: float = 0.0, scale: float = 1.0) -> np.ndarray:
    """Float64 [4, 4]: scaled, tilted about x, turned about z, then moved to `at`."""
    rotation = trimesh.transformations.rotation_matrix
    matrix = rotation(np.radians(turn_deg), [0, 0, 1]) @ rotation(np.radians(tilt_deg), [1, 0, 0])
    matrix[:3, :3] *= scale
    matrix[:3, 3] = at
    return matrix


def steps(lo: float, hi: float, spacing: float) -> np.ndarray:
    """Evenly spaced numbers from `lo` to `hi`, no further apart than `spacing`."""
    return np.linspace(lo, hi, max(1, int(np.ceil((hi - lo) / spacing - 1e-9))) + 1)


def _cells(rows: int, columns: int, keep: np.ndarray) -> np.ndarray:
    """Faces [2 K, 3] of a rows x columns lattice of vertices (row major), of the K cells that `keep` names."""
    i, j = np.nonzero(keep)
    a = i * columns + j
    b, c, d = a + 1, a + columns + 1, a + columns
    return np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])


def sheet(origin, u, v, us, vs, albedo: Colour, emission: Colour = (0.0, 0.0, 0.0), hole=None) -> Mesh:
    """A flat lattice at origin + s u + t v for s in `us`, t in `vs` (ascending); it faces u x v.

    hole   (s0, s1, t0, t1) without cells; its borders have to be among `us` and `vs`
    """
    us, vs = np.asarray(us, np.float64), np.asarray(vs, np.float64)
    s, t = np.meshgrid(us, vs)
    origin, u, v = (np.asarray(value, np.float64) for value in (origin, u, v))
    vertices = origin + s.reshape(-1, 1) * u + t.reshape(-1, 1) * v
    keep = np.ones((len(vs) - 1, len(us) - 1), bool)
    if hole is not None:
        s_mid, t_mid = 0.5 * (us[1:] + us[:-1]), 0.5 * (vs[1:] + vs[:-1])
        inside_s, inside_t = (s_mid > hole[0]) & (s_mid < hole[1]), (t_mid > hole[2]) & (t_mid < hole[3])
        keep &= ~(inside_t[:, None] & inside_s[None, :])
    faces = _cells(len(vs), len(us), keep)
    used, faces = np.unique(faces, return_inverse=True)
    normal = np.cross(u, v) / np.linalg.norm(np.cross(u, v))
    return Mesh(vertices[used], faces.reshape(-1, 3), np.tile(normal, (len(used), 1)), albedo, emission)


def with_breaks(lo: float, hi: float, spacing: float, breaks: Sequence[float]) -> np.ndarray:
    """Like `steps`, with every number of `breaks` that lies between among them."""
    stops = [lo, *sorted(b for b in breaks if lo < b < hi), hi]
    pieces = [steps(a, b, spacing)[:-1] for a, b in pairwise(stops)]
    return np.concatenate([*pieces, [hi]])


def tiles(origin, u, v, counts: tuple[int, int], albedo: np.ndarray) -> Mesh:
    """counts[0] x counts[1] tiles that fill the parallelogram u, v, each a quad of its own; faces u x v.

    albedo   [counts[1], counts[0], 3], a colour per tile
    """
    n, m = counts
    s, t = np.meshgrid(np.arange(n), np.arange(m))
    corner = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    where = np.stack([s.reshape(-1, 1) + corner[:, 0], t.reshape(-1, 1) + corner[:, 1]], axis=2) / [n, m]
    origin, u, v = (np.asarray(value, np.float64) for value in (origin, u, v))
    vertices = origin + where.reshape(-1, 2) @ np.stack([u, v])
    first = 4 * np.arange(n * m)[:, None]
    faces = np.concatenate([np.add(first, [0, 1, 2]), np.add(first, [0, 2, 3])])
    normal = np.cross(u, v) / np.linalg.norm(np.cross(u, v))
    return Mesh(vertices, faces, np.tile(normal, (4 * n * m, 1)), np.repeat(albedo.reshape(-1, 3), 4, axis=0))


def box(lo, hi, albedo: Colour, omit: str = "", spacing: float = np.inf, bevel: float = 0.0) -> Mesh:
    """An axis-aligned box; flat faces.

    omit    faces that nobody sees, such as "-z +y"
    bevel   width of the cut along every edge between two faces that are there. The faces keep their normals, so that
            the cut is shaded as a rounding
    """
    lo, hi = np.asarray(lo, np.float64), np.asarray(hi, np.float64)
    if unknown := set(omit.split()) - set(FACES):
        raise ValueError(f"box: omits {sorted(unknown)}; accepted: {', '.join(FACES)}")
    present = {(axis, side) for axis in range(3) for side in range(2) if FACES[2 * axis + side] not in omit.split()}
    inner = [
        [value[k] + (bevel if side == 0 else -bevel) * ((k, side) in present) for k in range(3)]
        for side, value in enumerate((lo, hi))
    ]
    if not np.less(inner[0], inner[1]).all():
        raise ValueError(f"box: from {lo} to {hi} with a bevel of {bevel}; accepted: sides longer than their bevels")
    # Where lattice lines run on each axis, the same on all faces.
    lines = [steps(inner[0][k], inner[1][k], spacing) for k in range(3)]

    vertices, normals, faces, start, lattice = [], [], [], 0, {}
    for axis, side in sorted(present):
        a, b = [(1, 2), (2, 0), (0, 1)][axis]
        first, second = (a, b) if side else (b, a)  # first x second points outward
        s, t = np.meshgrid(lines[first], lines[second])
        p = np.empty((*s.shape, 3))
        p[..., first], p[..., second], p[..., axis] = s, t, (lo, hi)[side][axis]
        index = start + np.arange(s.size).reshape(s.shape)
        lattice[axis, side] = index if first == a else index.T  # [b, a]
        vertices.append(p.reshape(-1, 3))
        normals.append(np.tile(np.eye(3)[axis] * (2 * side - 1), (s.size, 1)))
        faces.append(start + _cells(*s.shape, np.ones((s.shape[0] - 1, s.shape[1] - 1), bool)))
        start += s.size
    if bevel > 0:
        faces.append(_bevel(lattice))
    v, n, f = np.concatenate(vertices), np.concatenate(normals), np.concatenate(faces)
    # The bevel's triangles are wound by the normals that they join.
    turned = np.cross(v[f[:, 1]] - v[f[:, 0]], v[f[:, 2]] - v[f[:, 0]])
    inward = (turned * n[f].sum(axis=1)).sum(axis=1) < 0
    f[inward] = f[inward][:, ::-1]
    return Mesh(v, f, n, albedo)


def bar(lo, hi, albedo: Colour) -> Mesh:
    """A thin axis-aligned bar: a box of eight vertices whose edges are shaded round."""
    return from_trimesh(trimesh.creation.box(bounds=[lo, hi]), albedo)


def _bevel(lattice: dict[tuple[int, int], np.ndarray]) -> np.ndarray:
    """Faces that join neighbouring faces of a box; `lattice`: (axis, side) -> vertices [b, a], a the axis after."""

    def border(face: tuple[int, int], towards: tuple[int, int]) -> np.ndarray:
        axis, end = face[0], -1 if towards[1] else 0
        return lattice[face][:, end] if towards[0] == (axis + 1) % 3 else lattice[face][end, :]

    def corner(face: tuple[int, int], one: tuple[int, int], other: tuple[int, int]) -> int:
        edge = border(face, one)
        return int(edge[-1 if other[1] else 0])

    out = []
    for one, other in combinations(sorted(lattice), 2):
        if one[0] != other[0]:
            p, q = border(one, other), border(other, one)
            out += [np.stack([p[:-1], p[1:], q[1:]], axis=1), np.stack([p[:-1], q[1:], q[:-1]], axis=1)]
    for x, y, z in combinations(sorted(lattice), 3):
        if len({x[0], y[0], z[0]}) == 3:
            out.append(np.array([[corner(x, y, z), corner(y, z, x), corner(z, x, y)]]))
    return np.concatenate(out)


def lathe(profile, segments: int, albedo: Colour | Sequence[Colour], sharp_deg: float = 32.0) -> Mesh:
    """A surface of revolution about z.

    profile   [N, 2] of (radius, z); outside is to the right of the way, so that upward is outward
    albedo    one colour, or one for each of the N - 1 stretches
    sharp_deg the profile has an edge where it turns by more
    """
    profile = np.asarray(profile, np.float64)
    count = len(profile) - 1
    colours: list[Colour] = [albedo] * count if np.ndim(albedo) == 1 else list(albedo)  # type: ignore[list-item,arg-type]
    if len(colours) != count:
        raise ValueError(f"lathe: {len(colours)} colours; accepted: 1, or {count} for a profile of {count + 1} points")
    way = np.diff(profile, axis=0)
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    edge = [
        (way[k - 1] * way[k]).sum() < np.cos(np.radians(sharp_deg)) or colours[k - 1] != colours[k] for k in range(1, count)
    ]
    cuts = [0, *(np.flatnonzero(edge) + 1), count]
    return merged(
        *(from_trimesh(trimesh.creation.revolve(profile[a : b + 1], sections=segments), colours[a]) for a, b in pairwise(cuts))
    )


def ball(radius: float, segments: int, rings: int, albedo: Colour, emission: Colour = (0.0, 0.0, 0.0)) -> Mesh:
    """A sphere about the origin with exact normals; `rings` vertices from pole to pole."""
    angle = np.linspace(-0.5 * np.pi, 0.5 * np.pi, rings)
    profile = radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    mesh = from_trimesh(trimesh.creation.revolve(profile, sections=segments), albedo, emission)
    return replace(mesh, normals=mesh.vertices / np.linalg.norm(mesh.vertices, axis=1, keepdims=True))


def unit_sphere(segments: int, rings: int) -> trimesh.Trimesh:
    """The unit sphere with poles on z and `rings` vertices from pole to pole; an odd number has an equator."""
    angle = np.linspace(-0.5 * np.pi, 0.5 * np.pi, rings)
    profile = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    profile[[0, -1], 0] = 0.0
    profile[abs(profile) < 1e-15] = 0.0
    return trimesh.creation.revolve(profile, sections=segments)


def tube(path, radius: float | Sequence[float] | np.ndarray, segments: int, albedo: Colour) -> Mesh:
    """A round tube along `path` [N, 3], closed at both ends; one radius or one for each point."""
    path = np.asarray(path, np.float64)
    radii = np.broadcast_to(np.asarray(radius, np.float64), len(path))
    tangent = np.gradient(path, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)

    # A frame carried along the path without turning about it.
    side = np.cross(tangent[0], np.eye(3)[np.argmin(abs(tangent[0]))])
    angle = np.linspace(0, 2 * np.pi, segments, endpoint=False)
    rings = []
    for p, t, r in zip(path, tangent, radii, strict=True):
        side = side - t * (side @ t)
        side /= np.linalg.norm(side)
        rings.append(p + r * (np.cos(angle)[:, None] * side + np.sin(angle)[:, None] * np.cross(t, side)))
    vertices = np.concatenate([*rings, path[:1], path[-1:]])

    k = np.arange(segments)
    low = (np.arange(len(path) - 1)[:, None] * segments + k).reshape(-1)
    low_next = (np.arange(len(path) - 1)[:, None] * segments + (k + 1) % segments).reshape(-1)
    high, high_next = low + segments, low_next + segments
    last = (len(path) - 1) * segments
    faces = np.concatenate(
        [
            np.stack([low, low_next, high_next], axis=1),
            np.stack([low, high_next, high], axis=1),
            np.stack([(k + 1) % segments, k, np.full(segments, len(vertices) - 2)], axis=1),
            np.stack([last + k, last + (k + 1) % segments, np.full(segments, len(vertices) - 1)], axis=1),
        ]
    )
    return Mesh(vertices, faces, albedo=albedo)


def rounded_tube(points, radii, segments: int, albedo: Colour, count: int = 8, cap: int = 3) -> Mesh:
    """A smooth tube through `points` [N, 3] with `radii` [N], metres, and half spheres for ends that reach `points`' ends.

    count, cap   rings along the tube between its ends, and rings of each end

    Raises ValueError where the two half spheres do not fit between the ends.
    """
    points, radii = np.asarray(points, np.float64), np.asarray(radii, np.float64)
    way = np.r_[0.0, np.linalg.norm(np.diff(points, axis=0), axis=1).cumsum()]
    a = np.radians(np.linspace(78, 0, cap))
    first, last = radii[0], radii[-1]
    if way[-1] <= first + last:
        raise ValueError(f"rounded_tube: {way[-1]:.4g} m long; accepted: more than its end radii {first:.4g} + {last:.4g} m")
    ends = first * (1 - np.sin(a)), way[-1] - last * (1 - np.sin(a[::-1]))
    s = np.concatenate([ends[0], np.linspace(first, way[-1] - last, count + 2)[1:-1], ends[1]])
    r = np.interp(s, way, radii)
    r[:cap], r[-cap:] = r[cap - 1] * np.cos(a), r[-cap] * np.cos(a[::-1])
    return tube(CubicSpline(way, points)(s), r, segments, albedo)


def arc(centre, u, v, from_deg: float, to_deg: float, count: int) -> np.ndarray:
    """Points [count, 3] on the ellipse centre + cos(a) u + sin(a) v, a from `from_deg` to `to_deg`."""
    a = np.radians(np.linspace(from_deg, to_deg, count))[:, None]
    return np.asarray(centre) + np.cos(a) * np.asarray(u, np.float64) + np.sin(a) * np.asarray(v, np.float64)


def contact_sheet(lo, hi, z: float, spacing: float, feet: Sequence[tuple[float, float, float]], albedo: Colour) -> Mesh:
    """A horizontal rectangle from `lo` to `hi` (x, y) that faces up, finer where things stand on it.

    Around each foot (x, y, radius) run rings of vertices that catch its contact shadow; none (but a corner of the
    rectangle) lies underneath, where no light would reach it and from where darkness would spread to what is seen.
    """
    s, t = np.meshgrid(steps(lo[0], hi[0], spacing), steps(lo[1], hi[1], spacing))
    rings = [np.stack([s.ravel(), t.ravel()], axis=1)]
    border = (rings[0] == lo).any(axis=1) | (rings[0] == hi).any(axis=1)
    # Gap to the foot, and how far apart the ring's vertices are.
    offsets = ((0.002, 0.4), (0.03, 0.8))
    for x, y, radius in feet:
        for gap, share in offsets:
            r = radius + gap
            count = max(6, int(np.ceil(2 * np.pi * r / (share * spacing + 0.1 * r))))
            angle = np.linspace(0, 2 * np.pi, count, endpoint=False)
            rings.append(np.array([x, y]) + r * np.stack([np.cos(angle), np.sin(angle)], axis=1))
    owner = np.concatenate([np.full(len(ring), k) for k, ring in enumerate(rings)])
    points = np.concatenate(rings)

    # Nothing under a foot, nothing off the rectangle, and lattice points only beyond the outermost ring.
    keep = np.all((points > np.asarray(lo) + 0.004) & (points < np.asarray(hi) - 0.004), axis=1)
    keep[: len(rings[0])] |= border
    for k, (x, y, radius) in enumerate(feet):
        away = np.linalg.norm(points - [x, y], axis=1)
        own = (owner - 1) // len(offsets) == k
        keep &= own | (away > radius + 0.002)
        keep[: len(rings[0])] &= (away[: len(rings[0])] > radius + 0.06) | border
    keep[: len(rings[0])] |= (np.isin(rings[0][:, 0], [lo[0], hi[0]])) & (np.isin(rings[0][:, 1], [lo[1], hi[1]]))
    points = points[keep]
    faces = Delaunay(points).simplices
    corners = points[faces]
    one, other = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]
    faces[area < 0] = faces[area < 0][:, ::-1]
    faces = faces[abs(area) > 1e-9]
    vertices = np.column_stack([points, np.full(len(points), z)])
    return Mesh(vertices, faces, np.tile([0.0, 0.0, 1.0], (len(points), 1)), albedo)
