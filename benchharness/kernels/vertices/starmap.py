"""Star-shaped mirrors as one function of direction (Roger and Holzschuch 2006, section 3.3.1).

Every ray from a centre O meets the mirror at most once: P(u) = O + r(u) u for unit u. A cube map holds r and its gradient, so
that one lookup tells where the mirror is in a direction and how it stands there:

    grad r   the gradient at the surface of r extended to space as a function of direction alone; orthogonal to u
    n        unit(u - grad r), times `side`: -1 where the mirror is looked at from O's side

The gradient is made from the mesh's interpolated normals, so the map reflects as the mesh does, and not as its facets.
Layout as in `kernels.cubemap`, 4 floats per texel: grad r, r. As a 3D vector the gradient has no poles; the partial
derivatives of r in spherical coordinates, interpolated near one, turn the normal by up to 83 degrees.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np
from scipy.ndimage import binary_erosion
from scipy.spatial import KDTree

from benchharness.kernels import cubemap, mitsuba_mesh

TOLERATED = 1e-3  # share of the directions that may meet nothing, or the surface again, by the rounding of a ray at an edge
STEP = 1e-4  # a second hit is looked for this much further, relative to the first
FLAT = 0.02  # cosine of the angle between a ray from the centre and the normal below which r changes too fast to be stored


@dataclass
class StarMap:
    """A mirror's map.

    texels  4 floats per texel: grad r, r; object space
    covered  1 per texel where the mirror is; beyond its rim, the texels go on as at the rim
    centre  O, object space
    side    1 for a mirror seen from outside, -1 from O's side
    n       texels per edge of a face
    """

    texels: mi.Float
    covered: mi.Bool
    centre: mi.Point3f
    side: mi.Float
    n: int


class NotStarShapedError(ValueError):
    """No centre was found from which every ray meets the surface at most once. The message is a sentence for users."""


def directions(n: int) -> np.ndarray:
    """Unit directions of the texels, border included, float64 [6 (n + 2)^2, 3]."""
    t = (2 * np.arange(-1, n + 1) + 1) / n - 1
    v, u = np.meshgrid(t, t, indexing="ij")
    out = np.empty((6, n + 2, n + 2, 3))
    for face in range(6):
        axis = face // 2
        out[face, ..., axis] = 1 - 2 * (face % 2)
        out[face, ..., (axis + 1) % 3], out[face, ..., (axis + 2) % 3] = u, v
    return (out / np.linalg.norm(out, axis=-1, keepdims=True)).reshape(-1, 3)


def packed(r: np.ndarray, gradient: np.ndarray, covered: np.ndarray, centre: np.ndarray, side: float, n: int) -> StarMap:
    """The map of r [T], grad r [T, 3] and covered [T] at the T directions of `directions(n)`."""
    d = directions(n)
    if not covered.all():
        rim = _rim(covered, n)
        source = rim[KDTree(d[rim]).query(d[~covered])[1]]
        r, gradient = r.copy(), gradient.copy()
        r[~covered] = r[source]
        gradient[~covered] = gradient[source] - d[~covered] * (gradient[source] * d[~covered]).sum(axis=1, keepdims=True)
    texels = np.column_stack([gradient, r]).astype(np.float32)
    star = StarMap(
        mi.Float(texels.ravel()), mi.Bool(covered), mi.Point3f(np.asarray(centre, np.float64).tolist()), mi.Float(side), n
    )
    dr.make_opaque(star.centre, star.side)
    return star


def _rim(covered: np.ndarray, n: int) -> np.ndarray:
    """The covered texels beside one that is not, within a face, [R]; all covered ones if there are none such.

    The covered texel nearest to one that is not covered is always on the rim, and trees are slow far from all their points.
    """
    faces = covered.reshape(6, n + 2, n + 2)
    inner = binary_erosion(faces, np.array([[[0, 1, 0], [1, 1, 1], [0, 1, 0]]]), border_value=1)
    rim = np.flatnonzero(faces & ~inner)
    return rim if len(rim) else np.flatnonzero(covered)


def build(vertices: np.ndarray, normals: np.ndarray, faces: np.ndarray, n: int) -> StarMap:
    """The map of a mesh [V, 3], [V, 3], [F, 3], about the centre of its bounding box.

    Raises NotStarShapedError.
    """
    centre, d, r, normal, hit, steep, side = _checked(vertices, normals, faces, n)
    cosine = (d * normal).sum(axis=1)
    covered = hit & ~steep
    if (~hit).mean() <= TOLERATED:  # a closed surface: rays that slip through at edges are no holes
        side_by = np.flatnonzero(covered)[KDTree(d[covered]).query(d[~covered])[1]] if not covered.all() else []
        r[~covered], normal[~covered], covered = r[side_by], normal[side_by], np.ones_like(covered)
        cosine = (d * normal).sum(axis=1)
    gradient = np.where(covered[:, None], d - normal / np.where(covered, cosine, 1)[:, None], 0)
    return packed(np.where(covered, r, 1), gradient, covered, centre, side, n)


def check(vertices: np.ndarray, normals: np.ndarray, faces: np.ndarray, n: int) -> float:
    """The map's `side`; raises NotStarShapedError exactly where `build` does, at less cost."""
    return _checked(vertices, normals, faces, n)[-1]


def _checked(vertices: np.ndarray, normals: np.ndarray, faces: np.ndarray, n: int):
    """Centre, directions d [T, 3], what `_met` tells of them but for second hits, whether they graze [T], and the side."""
    centre = 0.5 * (vertices.min(axis=0) + vertices.max(axis=0))
    d = directions(n)
    r, normal, hit, again = _met(vertices, normals, faces, centre, d)
    place = f"({', '.join(f'{c:.3g}' for c in centre)})"
    if not hit.any() or (hit & (r < STEP * np.linalg.norm(np.ptp(vertices, axis=0)))).mean() > TOLERATED:
        raise NotStarShapedError(f"it is not star-shaped: it runs through its own centre {place} or is not seen from there")
    if again.mean() > TOLERATED:
        raise NotStarShapedError(
            f"it is not star-shaped: {100 * again.mean():.1f} % of the rays from its centre {place} meet it more than once"
        )
    cosine = (d * normal).sum(axis=1)
    side = 1.0 if np.median(cosine[hit]) > 0 else -1.0
    steep = hit & (side * cosine < FLAT)
    if steep.mean() > TOLERATED:
        raise NotStarShapedError(
            f"it is not star-shaped: {100 * steep.mean():.1f} % of the rays from its centre {place} "
            "graze it or meet it from the other side"
        )
    return centre, d, r, normal, hit, steep, side


def _met(
    vertices: np.ndarray, normals: np.ndarray, faces: np.ndarray, centre: np.ndarray, d: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Where rays from `centre` along d [T, 3] meet the mesh: distance [T], unit normal [T, 3], hit [T], hit again [T]."""
    # Texels and vertices often lie on the same meridians.
    scene = mitsuba_mesh.scene(vertices - centre, faces)
    ray = mi.Vector3f(np.asarray(d, np.float32).T)
    first = scene.ray_intersect_preliminary(mi.Ray3f(mi.Point3f(0), ray))
    hit = first.is_valid()
    again = scene.ray_test(mi.Ray3f(ray * (first.t * (1 + STEP)), ray), hit)

    # The hit once more in float64: the rays only tell which triangle.
    corner = [dr.gather(mi.UInt32, mi.UInt32(np.uint32(faces).ravel()), 3 * first.prim_index + k, hit) for k in range(3)]
    places, fields = (mi.Float64(np.float64(x).ravel()) for x in (vertices - centre, normals))
    a, b, c = (dr.gather(mi.Vector3d, places, i, hit) for i in corner)
    u = mi.Vector3d(np.float64(d).T)
    weights = [dr.dot(u, dr.cross(b, c)), dr.dot(u, dr.cross(c, a)), dr.dot(u, dr.cross(a, b))]
    scale = dr.rcp(dr.select(hit, sum(weights), 1))
    point = scale * sum(w * p for w, p in zip(weights, (a, b, c), strict=True))
    normal = scale * sum(w * dr.gather(mi.Vector3d, fields, i, hit) for w, i in zip(weights, corner, strict=True))
    normal /= dr.maximum(dr.norm(normal), 1e-300)
    distance = dr.dot(point, u)
    dr.eval(distance, normal, hit, again)
    return np.array(distance), np.array(normal).T, np.array(hit), np.array(again & hit)


def sample(star: StarMap, u: mi.Vector3f, active: mi.Bool | bool = True) -> tuple[mi.Float, mi.Vector3f]:
    """r and grad r in the unit direction u."""
    value = cubemap.lookup(star.texels, star.n, u, active)
    gradient = mi.Vector3f(value.x, value.y, value.z)
    return value.w, gradient - dr.dot(gradient, u) * u


def is_covered(star: StarMap, u: mi.Vector3f, active: mi.Bool | bool = True) -> mi.Bool:
    """Whether the mirror is there in direction u, to the nearest texel."""
    face, x, y = cubemap.face_of(u)
    column = dr.clip(mi.Int32((x + 1) * (0.5 * star.n)), 0, star.n - 1) + 1
    row = dr.clip(mi.Int32((y + 1) * (0.5 * star.n)), 0, star.n - 1) + 1
    return dr.gather(mi.Bool, star.covered, (face * (star.n + 2) + mi.UInt32(row)) * (star.n + 2) + mi.UInt32(column), active)
