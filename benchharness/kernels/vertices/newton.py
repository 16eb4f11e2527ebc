"""Newton's method for reflection points on a triangle mesh with interpolated normals: a manifold walk.

On a triangle with corners p_k and normals n_k, P(b) = sum b_k p_k and N(b) = unit(sum b_k n_k). P reflects the vertex V to the
eye E where the half vector h of the directions to both is N. The derivatives of h - N in two barycentric coordinates give
a step within the triangle's plane; a step that leaves the triangle comes back to the mesh along the normal, by a ray, and
goes on from the triangle that it meets. A step that does not bring h nearer to N is halved and tried again; a step that
does doubles the next, up to a whole one.

This finds roots, not minima of the path's length: on concave mirrors a reflection point may be a saddle or a maximum.
After Jakob and Marschner 2012, "Manifold exploration"; the damping is that of Zeltner, Georgiev and Jakob 2020, "Specular
manifold sampling". They return to the surface by rays from the eye, which near outlines land far away or miss.

Positions are in the mirror's own frame (`kernels.placement`).
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from benchharness.kernels.placement import MirrorFrame
from benchharness.kernels.vertices import mirrormesh
from benchharness.kernels.vertices.mirrormesh import NEAREST, MirrorMesh, SurfacePoint

BRIEFLY = 48  # of the candidates, farthest apart: enough for vertices that are hidden in all likelihood
PROMISING = 0.5  # cosine of half vector and normal; candidates lie closer than this angle, and hidden vertices reach 0.3
LONGEST = 0.25  # of the mirror's size; a step that would be longer is cut
LEAST_DAMPING, LEAST_BRIEFLY = 1 / 64, 1 / 8
TOLERANCE = 0.004  # pixels; a search whose next step would be shorter has arrived
TRUSTED = 0.25  # pixels; longest next step of an answer that calls itself converged


@dataclass
class Solution:
    """What a walk ended with, one lane per vertex.

    on          where on the mesh the walk ended
    R, n        that point and its unit normal
    converged   it is a reflection point: within a quarter pixel, with E and V in front
    residual    |half vector - normal|; 0 where V touches the mirror, and there is no half vector
    iterations  points at which normal and half vector were compared; 0 for inactive lanes
    """

    on: SurfacePoint
    R: mi.Point3f
    n: mi.Normal3f
    converged: mi.Bool
    residual: mi.Float
    iterations: mi.UInt32


@dataclass
class NewtonStep:
    """Newton's step at a point of the mesh.

    P, N    the point and its unit normal
    f       |half vector - normal|
    step_b  the step in barycentric coordinates,
    step    and in space
    pixels  its length on the screen
    lands   whether it ends in the same triangle
    front   whether E and V are in front
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


@dataclass
class _Constraint:
    """The constraint h - N = 0 at a point of the mesh, and its Jacobian.

    P, N        the point and its unit normal
    w_E, w_V    unit directions to E and V
    f           h - N
    e1, e2      edges of the triangle
    a, b, c, d  the Jacobian (a b; c d): parts along e1 and e2, in rows, of the change of h - N along either, in columns
    """

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


def _constraint(mesh: MirrorMesh, local: MirrorFrame, on: SurfacePoint, active: mi.Bool | bool) -> _Constraint:
    p, n = mirrormesh.corners(mesh, on.triangle, local.eye, active)
    e1, e2, n1, n2 = p[1] - p[0], p[2] - p[0], n[1] - n[0], n[2] - n[0]
    P = p[0] + on.b.x * e1 + on.b.y * e2
    raw = n[0] + on.b.x * n1 + on.b.y * n2
    per_raw = dr.rcp(dr.maximum(dr.norm(raw), 1e-20))
    N = raw * per_raw
    to_E, to_V = local.eye - P, local.V - P
    per_E, per_V = (dr.rcp(dr.maximum(dr.norm(d), NEAREST * mesh.size)) for d in (to_E, to_V))
    w_E, w_V = to_E * per_E, to_V * per_V
    s = w_E + w_V
    per_s = dr.rcp(dr.maximum(dr.norm(s), 1e-6))
    h = s * per_s
    f = h - N

    def rate(e: mi.Vector3f, dn: mi.Vector3f) -> mi.Vector3f:
        """Change of h - N along the edge e, over which the normal changes by dn."""
        ds = -per_E * (e - dr.dot(e, w_E) * w_E) - per_V * (e - dr.dot(e, w_V) * w_V)
        turn = dn * per_raw
        return per_s * (ds - dr.dot(ds, h) * h) - (turn - dr.dot(turn, N) * N)

    d1, d2 = rate(e1, n1), rate(e2, n2)
    a, b, c, d = dr.dot(e1, d1), dr.dot(e1, d2), dr.dot(e2, d1), dr.dot(e2, d2)
    return _Constraint(P=P, N=N, w_E=w_E, w_V=w_V, f=f, e1=e1, e2=e2, a=a, b=b, c=c, d=d)


def newton_step(mesh: MirrorMesh, local: MirrorFrame, on: SurfacePoint, active: mi.Bool | bool) -> NewtonStep:
    """Newton's step towards half vector = normal at a point of the mesh."""
    m = _constraint(mesh, local, on, active)

    # Two equations: what changes along either edge.
    y1, y2 = -dr.dot(m.e1, m.f), -dr.dot(m.e2, m.f)
    det = m.a * m.d - m.b * m.c
    usable = dr.abs(det) > 1e-9 * (dr.abs(m.a * m.d) + dr.abs(m.b * m.c))
    per_det = dr.select(usable, dr.rcp(dr.select(usable, det, 1)), 0)
    step_b = mi.Vector2f(y1 * m.d - y2 * m.b, y2 * m.a - y1 * m.c) * per_det
    step = step_b.x * m.e1 + step_b.y * m.e2
    length = dr.norm(step)
    cut = dr.minimum(1, LONGEST * mesh.size * dr.rcp(dr.maximum(length, 1e-20)))
    pixels = dr.select(usable, local.step(m.P, step), dr.inf)
    front = (dr.dot(m.N, m.w_E) > 0) & (dr.dot(m.N, m.w_V) > 0)
    lands = _inside(on.b + step_b)
    f, cut_b, cut_step = dr.norm(m.f), step_b * cut, mi.Vector3f(step * cut)
    return NewtonStep(mi.Point3f(m.P), mi.Normal3f(m.N), f, cut_b, cut_step, pixels, lands, front)


def arrived(mesh: MirrorMesh, local: MirrorFrame, on: SurfacePoint, active: mi.Bool) -> mi.Bool:
    """Whether a point of the mesh is a reflection point, as near to it as an answer of `walk` that calls itself converged."""
    return active & newton_step(mesh, local, on, active).proven()


MINIMUM, SADDLE, MAXIMUM = 1, 2, 3


def kind(mesh: MirrorMesh, local: MirrorFrame, on: SurfacePoint, active: mi.Bool) -> mi.UInt32:
    """What the light's path by way of a reflection point is, of those by way of its neighbours: the shortest (MINIMUM), the
    longest (MAXIMUM), or either, depending on the direction (SADDLE).

    There, h - N changes as the gradient of the path's length does, with the opposite sign and times 1 / |w_E + w_V|.
    """
    m = _constraint(mesh, local, on, active)
    return dr.select(m.a * m.d < m.b * m.c, mi.UInt32(SADDLE), dr.select(m.a < 0, mi.UInt32(MINIMUM), mi.UInt32(MAXIMUM)))


def _inside(b: mi.Point2f) -> mi.Bool:
    return (b.x >= 0) & (b.y >= 0) & (b.x + b.y <= 1)


def _moved(
    mesh: MirrorMesh, on: SurfacePoint, at: NewtonStep, damping: mi.Float, active: mi.Bool
) -> tuple[SurfacePoint, mi.Bool]:
    """Where a damped step along the mesh ends, and whether it stays on it."""
    b = mi.Point2f(on.b + damping * at.step_b)
    stays = _inside(b)
    leaves = active & ~stays
    reach = damping * dr.norm(at.step) + 1e-5 * mesh.size
    ray = mi.Ray3f(at.P + damping * at.step + reach * at.N, -mi.Vector3f(at.N))
    ray.maxt = 3 * reach
    hit = mesh.scene.ray_intersect_preliminary(ray, coherent=False, active=leaves)
    met = leaves & hit.is_valid()
    x = dr.select(met, hit.prim_uv.x, dr.select(stays, b.x, on.b.x))
    y = dr.select(met, hit.prim_uv.y, dr.select(stays, b.y, on.b.y))
    return SurfacePoint(dr.select(met, hit.prim_index, on.triangle), mi.Point2f(x, y)), stays | met


@dr.syntax
def walk(
    mesh: MirrorMesh,
    local: MirrorFrame,
    first: SurfacePoint,
    active: mi.Bool,
    max_iter: mi.UInt32,
    touches: mi.Bool | bool = False,
    briefly: mi.Bool | bool = False,
) -> Solution:
    """Newton's steps from `first` until the next one would be shorter than TOLERANCE. What `touches` the mirror there is
    reflected there. `briefly` gives up sooner."""
    on = SurfacePoint(mi.UInt32(first.triangle), mi.Point2f(first.b))  # the point so far,
    at = newton_step(mesh, local, on, active)  # and the step from there
    damping = mi.Float(1)  # share of the step that is taken
    least = dr.select(briefly, mi.Float(LEAST_BRIEFLY), LEAST_DAMPING)  # share below which the walk gives up
    iterations = mi.UInt32(1)  # points looked at
    running = active & ~mi.Bool(touches) & (at.pixels > TOLERANCE) & (iterations < max_iter)
    while dr.hint(running, label="walk along the mirror"):
        there, stayed = _moved(mesh, on, at, damping, running)
        new = newton_step(mesh, local, there, running & stayed)
        better = stayed & (new.f < at.f)
        iterations += 1
        on, at = dr.select(better, there, on), dr.select(better, new, at)
        damping = dr.select(better, dr.minimum(1, 2 * damping), 0.5 * damping)
        running &= (at.pixels > TOLERANCE) & (damping >= least) & (iterations < max_iter)
    converged = active & dr.select(touches, dr.dot(at.N, local.eye - at.P) > 0, at.proven())
    return Solution(on, at.P, at.N, converged, dr.select(touches, 0, at.f), dr.select(active, iterations, 0))


@dr.syntax
def best_candidate(
    mesh: MirrorMesh, local: MirrorFrame, active: mi.Bool, briefly: mi.Bool | bool = False
) -> tuple[SurfacePoint, mi.Bool]:
    """The middle of the candidate triangle whose normal is nearest to the half vector, E and V in front if possible, and
    whether a walk is worth it: where `briefly` looked at few, only if any of them is near."""
    best = mi.UInt32(0)  # number of the best candidate so far,
    preference = mi.Float(-dr.inf)  # its cosine of half vector and normal, 2 less where E or V is behind,
    cosine_most = mi.Float(-1)  # and the largest cosine of any
    k, count = mi.UInt32(0), dr.select(briefly, mi.UInt32(min(BRIEFLY, mesh.tries)), mesh.tries)
    while dr.hint(active & (k < count), label="choose where to start"):
        cosine, front = mirrormesh.agreement(mesh.middles, mesh.first + k, local)
        value = cosine - dr.select(front, 0, 2)
        better = value > preference
        best, preference = dr.select(better, k, best), dr.select(better, value, preference)
        cosine_most = dr.maximum(cosine_most, cosine)
        k += 1
    on = SurfacePoint(dr.gather(mi.UInt32, mesh.candidates, mesh.first + best, active), mi.Point2f(1 / 3))
    return on, active & (~mi.Bool(briefly) | (cosine_most > PROMISING))
