"""Newton's method for reflection points on a triangle mesh with interpolated normals: a manifold walk.

On a triangle with corners p_k and normals n_k, P(b) = sum b_k p_k and N(b) = unit(sum b_k n_k). P reflects the vertex V to the
eye E where the half vector h of the directions to both is N. The derivatives of h - N in two barycentric coordinates give
a step within the triangle's plane; a step that leaves the triangle comes back to the mesh along the normal, by a ray, and
goes on from the triangle that it meets. A step that does not bring h nearer to N is halved and tried again; a step that
does doubles the next, up to a whole one.

This finds roots, not minima of the path's length: on concave mirrors a reflection point may be a saddle or a maximum.
After Jakob and Marschner 2012, "Manifold exploration"; the damping is that of Zeltner, Georgiev and Jakob 2020, "Specular
manifold sampling". They return to the surface by rays from the eye, which near outlines land far away or miss.

Positions are in the mirror's own space (`kernels.placement`), so that its ray hierarchy is built once.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
import trimesh

from benchharness.kernels import depths, geometry, mitsuba_mesh, raster
from benchharness.kernels.placement import Place, place, unit

CANDIDATES = 192  # points of the mesh that a cold search chooses its start from
TIED = 1e-3  # share by which one distance is larger than another and counts as equal
SKEW = (0.519, 0.288, 0.805)  # a direction that no symmetry of a mesh is likely to share
BRIEFLY = 48  # of the candidates, farthest apart: enough for vertices that are hidden in all likelihood
PROMISING = 0.5  # cosine of half vector and normal; candidates lie closer than this angle, and hidden vertices reach 0.3
LONGEST = 0.25  # of the mirror's size; a step that would be longer is cut
LEAST_DAMPING, LEAST_BRIEFLY = 1 / 64, 1 / 8
TOLERANCE = 0.004  # pixels; a search whose next step would be shorter has arrived
TRUSTED = 0.25  # pixels; longest next step of an answer that calls itself converged
ROUNDING = 1e-6  # of a mesh's size; mean depth of hollows in a mesh that counts as convex
NEAREST = 1e-5  # of the mirror's size; a vertex nearer to the mirror than this touches it
SHADOWED = 1e-4  # of the mirror's size; a vertex is in the mirror's shadow if it is this much behind where its ray meets it
ROUNDED = 1e-6  # of a ray's length; float32 does not know better where it ends
CLOSE = 1e-2  # of the mirror's size; a vertex this much in front of where its ray meets the mirror is reflected near there


@dataclass
class Mesh:
    """A mirror ready for walks.

    scene       its triangles alone, for rays; object space
    vertices    8 floats per vertex: position, 0, normal, 0
    faces       4 integers per triangle: three vertices, and `kernels.raster.CLOSED` where its back is never seen
    candidates  triangles spread over the mesh, at whose middles a search may start
    middles     8 floats per candidate: its middle, 1 if it is a mirror on both sides, unit normal there, 0
    centre      the middle of its bounding box
    size        of its bounding box's diagonal
    convex      whether E sees no reflection of V exactly where the mirror stands between them
    closed      whether no back of it is ever seen
    """

    scene: Any
    vertices: mi.Float
    faces: mi.UInt32
    candidates: mi.UInt32
    middles: mi.Float
    centre: mi.Point3f
    size: mi.Float
    convex: bool
    closed: bool


@dataclass
class Where:
    """Points of the mesh: triangle, and weights of its second and third corner."""

    triangle: mi.UInt32
    b: mi.Point2f


@dataclass
class Solution:
    """One lane per vertex; mirror's space.

    on          where on the mesh the walk ended
    R, n        that point and its unit normal
    converged   it is a reflection point: within a quarter pixel, with E and V in front
    residual    |half vector - normal|; 0 where V touches the mirror, and there is no half vector
    iterations  points at which normal and half vector were compared; 0 for inactive lanes
    """

    on: Where
    R: mi.Point3f
    n: mi.Normal3f
    converged: mi.Bool
    residual: mi.Float
    iterations: mi.UInt32


@dataclass
class Point:
    """A point of the mesh as Newton's method sees it.

    P, N      position and unit normal
    f         half vector - normal
    step      Newton's step, in barycentric coordinates and in space
    pixels    length of the step on the screen
    lands     whether the step ends in the same triangle
    front     whether E and V are in front
    """

    P: mi.Point3f
    N: mi.Normal3f
    f: mi.Float
    step_b: mi.Vector2f
    step: mi.Vector3f
    pixels: mi.Float
    lands: mi.Bool
    front: mi.Bool

    def proven(self) -> mi.Bool:
        """Whether there is a reflection point here: no further than TOLERANCE, or than TRUSTED in the same triangle. What the
        triangle's normals promise beyond its edges is not kept where normals jump, where two roots have met and gone, and where
        the mesh ends."""
        return self.front & ((self.pixels < TOLERANCE) | (self.lands & (self.pixels < TRUSTED)))


def mesh(vertices: np.ndarray, normals: np.ndarray, faces: np.ndarray, backs: bool = True) -> Mesh:
    """From host arrays [V, 3], [V, 3], [F, 3] in object space. `backs`: whether an open mesh is a mirror on its back too."""
    zero = np.zeros((len(vertices), 1))
    packed = np.hstack([vertices, zero, normals, zero]).astype(np.float32)
    tags = np.where(geometry.oriented_closed_faces(vertices, faces) | (not backs), raster.CLOSED, 0)
    quads = np.hstack([faces, tags[:, None]]).astype(np.uint32)
    size = mi.Float(float(np.linalg.norm(np.ptp(vertices, axis=0))))
    centre = mi.Point3f(*(0.5 * (vertices.min(axis=0) + vertices.max(axis=0))).tolist())
    chosen = spread(vertices, faces, CANDIDATES)
    middle_n = normals[faces[chosen]].sum(axis=1)
    middle_n /= np.maximum(np.linalg.norm(middle_n, axis=1, keepdims=True), 1e-30)
    both = (tags[chosen] == 0)[:, None]
    middles = np.hstack([vertices[faces[chosen]].mean(axis=1), both, middle_n, 0 * both]).astype(np.float32)
    candidates = mi.UInt32(chosen.astype(np.uint32))
    dr.make_opaque(size, centre, candidates)
    return Mesh(
        mitsuba_mesh.scene(vertices, faces), mi.Float(packed.ravel()), mi.UInt32(quads.ravel()), candidates,
        mi.Float(middles.ravel()), centre, size, is_convex(vertices, faces), bool((tags == raster.CLOSED).all()),
    )  # fmt: skip


def spread(vertices: np.ndarray, faces: np.ndarray, count: int) -> np.ndarray:
    """`count` triangles, or all, whose middles lie far from each other: each the farthest from those before it.

    Symmetric meshes have many that are as far. Of these it is the one farthest along SKEW, and not the first, nor the one that
    rounding favours: the choice stays when triangles are numbered otherwise, or vertices move by their rounding.
    """
    middles = vertices[faces].mean(axis=1)
    along = middles @ SKEW
    chosen, distance = [], np.full(len(faces), np.inf)
    for _ in range(min(count, len(faces))):
        as_far = distance >= (1 - TIED) * distance.max()
        chosen.append(int(np.where(as_far, along, -np.inf).argmax()))
        away = middles - middles[chosen[-1]]
        distance = np.minimum(distance, np.sqrt(np.einsum("ij,ij->i", away, away)))
    return np.array(chosen)


def is_convex(vertices: np.ndarray, faces: np.ndarray) -> bool:
    """Whether the mesh is closed, in one piece, wound outwards, and convex but for rounding.

    Convex: no edge is hollow; and, as a hollow may be too wide to show at single edges of a fine mesh, its convex hull
    holds no more than it does itself.
    """
    solid = trimesh.Trimesh(vertices, faces)
    if not (solid.is_convex and solid.is_winding_consistent):
        return False
    return bool(solid.convex_hull.volume - solid.volume < ROUNDING * solid.scale * solid.area)


def _corners(mirror: Mesh, triangle: mi.UInt32, eye: mi.Point3f, active) -> tuple[list, list]:
    """Positions and normals of a triangle's corners. A sheet is a mirror on both sides: its normals are turned to the eye's."""
    face = dr.gather(mi.Vector4u, mirror.faces, triangle, active)
    index = (face.x, face.y, face.z)
    p = [dr.gather(mi.Vector4f, mirror.vertices, 2 * i, active).xyz for i in index]
    n = [dr.gather(mi.Vector4f, mirror.vertices, 2 * i + 1, active).xyz for i in index]
    away = ((face.w & raster.CLOSED) == 0) & (dr.dot(dr.cross(p[1] - p[0], p[2] - p[0]), eye - p[0]) < 0)
    return p, [dr.select(away, -v, v) for v in n]


@dataclass
class _Change:
    """h - N at a point of the mesh and how it changes along the edges e1 and e2 of its triangle: (a b; c d) has the parts along
    e1 and e2, in rows, of what changes along either, in columns."""

    P: mi.Point3f
    N: mi.Vector3f
    w_E: mi.Vector3f
    w_V: mi.Vector3f
    f: mi.Vector3f
    e1: mi.Vector3f
    e2: mi.Vector3f
    a: mi.Float
    b: mi.Float
    c: mi.Float
    d: mi.Float


def _change(mirror: Mesh, where: Place, on: Where, active) -> _Change:
    p, n = _corners(mirror, on.triangle, where.eye, active)
    e1, e2, n1, n2 = p[1] - p[0], p[2] - p[0], n[1] - n[0], n[2] - n[0]
    P = p[0] + on.b.x * e1 + on.b.y * e2
    raw = n[0] + on.b.x * n1 + on.b.y * n2
    per_raw = dr.rcp(dr.maximum(dr.norm(raw), 1e-20))
    N = raw * per_raw
    to_E, to_V = where.eye - P, where.V - P
    per_E, per_V = (dr.rcp(dr.maximum(dr.norm(d), NEAREST * mirror.size)) for d in (to_E, to_V))
    w_E, w_V = to_E * per_E, to_V * per_V
    s = w_E + w_V
    per_s = dr.rcp(dr.maximum(dr.norm(s), 1e-6))
    h = s * per_s
    f = h - N

    def rate(e, dn) -> mi.Vector3f:
        """Change of h - N along the edge e, over which the normal changes by dn."""
        ds = -per_E * (e - dr.dot(e, w_E) * w_E) - per_V * (e - dr.dot(e, w_V) * w_V)
        turn = dn * per_raw
        return per_s * (ds - dr.dot(ds, h) * h) - (turn - dr.dot(turn, N) * N)

    d1, d2 = rate(e1, n1), rate(e2, n2)
    a, b, c, d = dr.dot(e1, d1), dr.dot(e1, d2), dr.dot(e2, d1), dr.dot(e2, d2)
    return _Change(P, N, w_E, w_V, f, e1, e2, a, b, c, d)


def look(mirror: Mesh, where: Place, on: Where, active) -> Point:
    """Everything that a step needs, at a point of the mesh."""
    m = _change(mirror, where, on, active)

    # Two equations: what changes along either edge.
    y1, y2 = -dr.dot(m.e1, m.f), -dr.dot(m.e2, m.f)
    det = m.a * m.d - m.b * m.c
    usable = dr.abs(det) > 1e-9 * (dr.abs(m.a * m.d) + dr.abs(m.b * m.c))
    per_det = dr.select(usable, dr.rcp(dr.select(usable, det, 1)), 0)
    step_b = mi.Vector2f(y1 * m.d - y2 * m.b, y2 * m.a - y1 * m.c) * per_det
    step = step_b.x * m.e1 + step_b.y * m.e2
    length = dr.norm(step)
    cut = dr.minimum(1, LONGEST * mirror.size * dr.rcp(dr.maximum(length, 1e-20)))
    pixels = dr.select(usable, where.step(m.P, step), dr.inf)
    front = (dr.dot(m.N, m.w_E) > 0) & (dr.dot(m.N, m.w_V) > 0)
    lands = _inside(on.b + step_b)
    return Point(mi.Point3f(m.P), mi.Normal3f(m.N), dr.norm(m.f), step_b * cut, mi.Vector3f(step * cut), pixels, lands, front)


def arrived(mirror: Mesh, where: Place, on: Where, active) -> mi.Bool:
    """Whether a point of the mesh is a reflection point, as near to it as an answer of `walk` that calls itself converged."""
    return active & look(mirror, where, on, active).proven()


MINIMUM, SADDLE, MAXIMUM = 1, 2, 3


def kind(mirror: Mesh, where: Place, on: Where, active) -> mi.UInt32:
    """What the light's path by way of a reflection point is, of those by way of its neighbours: the shortest (MINIMUM), the
    longest (MAXIMUM), or either, depending on the direction (SADDLE).

    There, h - N changes as the gradient of the path's length does, with the opposite sign and times 1 / |w_E + w_V|.
    """
    m = _change(mirror, where, on, active)
    return dr.select(m.a * m.d < m.b * m.c, mi.UInt32(SADDLE), dr.select(m.a < 0, mi.UInt32(MINIMUM), mi.UInt32(MAXIMUM)))


def position(mirror: Mesh, on: Where, active) -> mi.Point3f:
    """The point of the mesh; mirror's space."""
    face = dr.gather(mi.Vector4u, mirror.faces, on.triangle, active)
    p = [dr.gather(mi.Vector4f, mirror.vertices, 2 * i, active).xyz for i in (face.x, face.y, face.z)]
    return mi.Point3f(p[0] + on.b.x * (p[1] - p[0]) + on.b.y * (p[2] - p[0]))


def _inside(b: mi.Point2f) -> mi.Bool:
    return (b.x >= 0) & (b.y >= 0) & (b.x + b.y <= 1)


def _moved(mirror: Mesh, on: Where, at: Point, damping, active) -> tuple[Where, mi.Bool]:
    """A step along the mesh, and whether it stays on it."""
    b = mi.Point2f(on.b + damping * at.step_b)
    stays = _inside(b)
    leaves = active & ~stays
    reach = damping * dr.norm(at.step) + 1e-5 * mirror.size
    ray = mi.Ray3f(at.P + damping * at.step + reach * at.N, -mi.Vector3f(at.N))
    ray.maxt = 3 * reach
    hit = mirror.scene.ray_intersect_preliminary(ray, coherent=False, active=leaves)
    met = leaves & hit.is_valid()
    there = Where(
        dr.select(met, hit.prim_index, on.triangle),
        mi.Point2f(dr.select(met, hit.prim_uv.x, dr.select(stays, b.x, on.b.x)),
                   dr.select(met, hit.prim_uv.y, dr.select(stays, b.y, on.b.y))),
    )  # fmt: skip
    return there, stays | met


@dr.syntax
def walk(mirror: Mesh, where: Place, first: Where, active, max_iter, touches=False, briefly=False) -> Solution:
    """Newton's steps from `first` until the next one would be shorter than TOLERANCE. What `touches` the mirror there is
    reflected there. `briefly` gives up sooner."""
    on = Where(mi.UInt32(first.triangle), mi.Point2f(first.b))
    at = look(mirror, where, on, active)
    damping, least = mi.Float(1), dr.select(briefly, mi.Float(LEAST_BRIEFLY), LEAST_DAMPING)
    iterations = mi.UInt32(1)
    running = active & ~mi.Bool(touches) & (at.pixels > TOLERANCE) & (iterations < max_iter)
    while dr.hint(running, label="walk along the mirror"):
        there, stayed = _moved(mirror, on, at, damping, running)
        new = look(mirror, where, there, running & stayed)
        better = stayed & (new.f < at.f)
        iterations += 1
        on, at = dr.select(better, there, on), dr.select(better, new, at)
        damping = dr.select(better, dr.minimum(1, 2 * damping), 0.5 * damping)
        running &= (at.pixels > TOLERANCE) & (damping >= least) & (iterations < max_iter)
    converged = active & dr.select(touches, dr.dot(at.N, where.eye - at.P) > 0, at.proven())
    return Solution(on, at.P, at.N, converged, dr.select(touches, 0, at.f), dr.select(active, iterations, 0))


@dr.syntax
def best_candidate(mirror: Mesh, where: Place, active, briefly=False) -> tuple[Where, mi.Bool]:
    """The middle of the candidate triangle whose normal is nearest to the half vector, E and V in front if possible, and
    whether a walk is worth it: where `briefly` looked at few, only if any of them is near."""
    best, preference, agreement = mi.UInt32(0), mi.Float(-dr.inf), mi.Float(-1)
    k, count = mi.UInt32(0), dr.width(mirror.candidates)
    count = dr.select(briefly, mi.UInt32(min(BRIEFLY, count)), count)
    while dr.hint(active & (k < count), label="choose where to start"):
        point, normal = (dr.gather(mi.Vector4f, mirror.middles, 2 * k + i) for i in (0, 1))
        P, N = point.xyz, normal.xyz
        w_E, w_V = unit(where.eye - P), unit(where.V - P)
        N = dr.select((point.w > 0) & (dr.dot(N, w_E) < 0), -N, N)
        cosine = dr.dot(unit(w_E + w_V), N)
        value = cosine - dr.select((dr.dot(N, w_E) > 0) & (dr.dot(N, w_V) > 0), 0, 2)
        better = value > preference
        best, preference = dr.select(better, k, best), dr.select(better, value, preference)
        agreement = dr.maximum(agreement, cosine)
        k += 1
    on = Where(dr.gather(mi.UInt32, mirror.candidates, best, active), mi.Point2f(1 / 3))
    return on, active & (~mi.Bool(briefly) | (agreement > PROMISING))


def located(mirror: Mesh, centre: mi.Point3f, u: mi.Vector3f, active) -> tuple[Where, mi.Bool]:
    """Where the ray from `centre` along u meets the mesh first, and whether it does."""
    hit = mirror.scene.ray_intersect_preliminary(mi.Ray3f(centre, u), coherent=False, active=active)
    met = active & hit.is_valid()
    return Where(dr.select(met, hit.prim_index, 0), mi.Point2f(dr.select(met, hit.prim_uv, 0))), met


@dataclass
class Sight:
    """What the ray from E through V meets.

    shadow   the mirror, before it comes to V; V on the mirror is not in its shadow
    near     the mirror, close behind V: there a walk should start, for V's reflection point is not far, and the half vector
             changes within as little as V is above the mirror
    touches  the mirror, in V
    on       where it does, defined for the last two
    """

    shadow: mi.Bool
    near: mi.Bool
    touches: mi.Bool
    on: Where


def sight_line(mirror: Mesh, eye: mi.Point3f, p: mi.Point3f) -> tuple[mi.Ray3f, mi.Float]:
    """The eye's ray towards p, and how far along it p is; mirror's space. It starts at the eye, or just before it can meet the
    mirror: from an eye far away, float32 holds no length well enough to say what is close to p."""
    d = p - eye
    length = dr.norm(d)
    d *= dr.rcp(dr.maximum(length, 1e-20))
    outside = dr.dot(mirror.centre - eye, d) > mirror.size
    length = dr.select(outside, dr.dot(p - mirror.centre, d) + mirror.size, length)
    return mi.Ray3f(dr.select(outside, p - length * d, eye), d), length


def look_at(mirror: Mesh, where: Place, active) -> Sight:
    """What the eye sees in the direction of each vertex."""
    ray, length = sight_line(mirror, where.eye, where.V)
    ray.maxt = length + CLOSE * mirror.size
    hit = mirror.scene.ray_intersect_preliminary(ray, coherent=False, active=active)
    met = active & hit.is_valid()
    before = dr.select(met, length - hit.t, -dr.inf)
    shadow = before > SHADOWED * mirror.size
    near = met & ~shadow & (before > -CLOSE * mirror.size)
    on = Where(dr.select(near, hit.prim_index, 0), mi.Point2f(dr.select(near, hit.prim_uv, 0)))
    return Sight(shadow, near, near & (dr.abs(before) < NEAREST * mirror.size), on)


@dataclass
class Shadow:
    """A mirror's mesh and pose, asked whether the mirror hides a point."""

    mesh: Mesh
    pose: list[mi.Vector4f]

    def hides(self, x: mi.Point3f, view, active) -> tuple[mi.Bool, mi.Float]:
        """Whether the mirror stands between the eye and x (world space), and its depth there, from `view.depth`; x on it is not
        hidden."""
        where = place(self.pose, x, view)
        ray, length = sight_line(self.mesh, where.eye, where.V)
        ray.maxt = length - NEAREST * self.mesh.size - ROUNDED * length
        hit = self.mesh.scene.ray_intersect_preliminary(ray, coherent=True, active=active)
        return hit.is_valid(), depths.offset(view, x) - (length - hit.t) * dr.dot(where.w.xyz, ray.d)
