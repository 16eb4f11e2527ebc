"""Drawing several reflections per vertex: a triangle is drawn once for each three of its vertices' that belong together.

Over a smooth piece of the mirror's answer, a *branch*, the reflection point of V moves smoothly with V, and what kind of path
it makes does not change (`newton.kind`): that changes where two branches meet and end, on a caustic. So the reflections of two
vertices of a triangle belong together if they are of one kind and each is the other's nearest. Three of which
every two belong together make a virtual triangle; what has no match is not drawn.

One more place per vertex, the last, is for those that the mirror hides from the eye. Where an edge
goes behind the mirror's outline, its reflection is grazing and its image comes together with itself: of the end that is
not hidden, the image nearest to itself belongs to it, and `virtual` cuts the triangle there.

Which pixels of a virtual triangle are images is decided per pixel. What belongs to a part of the mirror that is behind
another is left out by depth (`virtual.Target.back`); and where the mirror meets itself in its reflection (`own`), it is
black, as other mirrors are.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import mitsuba as mi

from benchharness.kernels import depths, geometry, optics, packets, placement, raster
from benchharness.kernels.frozen import frozen
from benchharness.kernels.types import Frame, Vertices, View
from benchharness.kernels.vertices import flatsheet, newton, problems, several, sight, vertexwise, virtual
from benchharness.kernels.vertices.mirrormesh import MirrorMesh
from benchharness.kernels.vertices.problems import Found, Problem

SEEN = 4  # added to the kind of a reflection that is seen
# Times the edge: an image is at most this far from its vertex if the other end is hidden. Where the edge is at d from the
# outline, seen from the mirror, its image is on the other side of the outline at d.
GRAZING = 2.0
SHORTER = 0.98  # a mirror that meets itself at this share of the distance to what is drawn is before it: edges are straight


@dataclass
class Arranged:
    """One mirror's images with several places per vertex, and what there is to report; see `solved`.

    images     (multi + 1) * count packets, place by place
    triangles  the scene's, as often as there are places
    vertices   what was found, the places after the first as `further`
    """

    images: virtual.Images
    triangles: geometry.Geometry
    vertices: Vertices
    counters: dict[str, mi.UInt32]


def arranged(found: several.Found, mesh: MirrorMesh, problem: Problem, multi: int, *, mirrored: bool = False) -> Arranged:
    """The images of all reflections. `mirrored`: they are V mirrored in the plane at R, else V on the eye's ray through R."""
    count, view, world = problem.count, problem.view, problem.world
    places = multi + 1
    lane = dr.arange(mi.UInt32, places * count)
    vertex, last = lane % count, lane >= multi * count
    V = dr.gather(mi.Vector4f, world.points, vertex)
    active = (mi.UInt32(V.w) != problem.part) & (mi.UInt32(V.w) < problem.shown_parts)
    V = mi.Point3f(V.xyz)

    # What the mirror hides: V itself, and the mirror's point in front of it.
    shadow, surface = sight.Shadow(mesh, problem.pose).hides(V, view, active & last)
    shadow &= active & last
    own = dr.dot(view.w, mi.Vector4f(V.x, V.y, V.z, 1))
    before = V + (V - view.eye) * dr.select(shadow, (surface - depths.offset(view, V)) / own, 0)
    known, beyond = None, mi.Bool(False)
    if problem.plane is not None:
        known = flatsheet.mirrored(problem.plane, V, view.eye)
        shadow, before = active & last & ~known.before, V

    def of(array: Any) -> Any:
        return dr.gather(type(array), array, lane, ~last)

    filled, n = of(found.filled), of(found.n)
    R = dr.select(filled, of(found.R), before)
    if known is not None:  # beyond the edge of a flat sheet there is one image, too
        beyond = (lane < count) & active & known.before & ~filled
        filled |= beyond
        R, n = dr.select(beyond, known.R, R), mi.Normal3f(dr.select(beyond, known.n, n))
    image = optics.mirrored(V, R, n) if mirrored else optics.on_ray(V, R, view.eye)
    image = dr.select(filled, image, V)
    kind, region = problems.kinds(filled, shadow)
    code = dr.select(filled, mi.Float(of(found.kind) + dr.select(of(found.seen), mi.UInt32(SEEN), 0)), 0)
    code = dr.select(beyond, mi.Float(newton.MINIMUM + SEEN), code)
    images = virtual.Images(
        moved=packets.joined(image, kind, places * count),
        at=packets.joined(R, code, places * count),
        unsure=problem.unsure(n, filled & ~of(found.converged) & ~beyond, lane, places * count),
    )
    image, R, region = mi.Point3f(image), mi.Point3f(R), mi.UInt32(region)
    dr.eval(images, image, R, region)

    shown = Vertices(
        R=R,
        n=found.n,
        virtual=image,
        converged=found.converged,
        valid=found.converged & found.seen,
        region=region,
        iterations=found.iterations,
        residual=found.residual,
        border=dr.zeros(mi.Bool, count),
    )
    vertices = [_at_place(shown, k, count) for k in range(multi)]
    # The first place says where a vertex is hidden, and that it has more reflections than there is room for.
    first = vertices[0]
    hidden = dr.gather(mi.UInt32, region, dr.arange(mi.UInt32, count) + multi * count)
    first.region = dr.select(first.region == problems.UNKNOWN, hidden, first.region)
    first.converged &= found.reflections <= multi
    first.further = vertices[1:]
    counters = {"iterations": found.work, "reflections": found.reflections}
    return Arranged(images, _repeated(images, world, places), first, counters)


def _at_place(shown: Vertices, k: int, count: int) -> Vertices:
    """The lanes of place k."""
    at = dr.arange(mi.UInt32, count) + k * count
    lanes = {name: dr.gather(type(a), a, at) for name, a in vars(shown).items() if name not in ("border", "further")}
    return Vertices(**lanes, border=dr.zeros(mi.Bool, count))


def solved(
    made: Arranged,
    hider: sight.Shadow,
    back: mi.Float | None,
    drawing: virtual.Drawing,
    own: dict[int, Own],
    counters: dict[str, mi.UInt32] | None = None,
) -> vertexwise.Solved:
    """What `vertexwise.shown` draws of a mirror.

    back      `virtual.nearest_back` of a mirror whose back is never seen, else None
    drawing   how to draw it
    own       as `vertexwise.Solved` has it
    counters  further work
    """
    return vertexwise.Solved(
        Found(made.images, made.vertices, None, {**made.counters, **(counters or {})}),
        drawing=drawing,
        hider=hider,
        back=back,
        triangles=made.triangles,
        own=own,
    )


def meeting(i: int, sheet: MirrorMesh, pose: list[mi.Vector4f], own: str, doubts: bool) -> dict[int, Own]:
    """What `vertexwise.Solved.own` is for mirror number i that is "black" in itself, or "omitted"; `sheet` is what is seen of
    it. One that is convex meets itself where its normals are smoother than its facets, which is only doubted."""
    black = own == "black" and not sheet.convex
    return {i: Own(sheet, pose, black)} if black or doubts else {}


def _repeated(images: virtual.Images, world: geometry.Geometry, places: int) -> geometry.Geometry:
    """The scene's vertices once per place, and its triangles once per place of their first vertex."""
    shine = world.shine
    if shine is not None:
        shine = replace(shine, normals=dr.tile(shine.normals, places), visibility=dr.tile(shine.visibility, places))
    paint = None if world.paint is None else replace(world.paint, uv=dr.tile(world.paint.uv, places))
    return geometry.Geometry(
        points=dr.tile(world.points, places),
        attributes=None if world.attributes is None else dr.tile(world.attributes, places),
        faces=_faces(images, world, places),
        vertex_count=places * world.vertex_count,
        face_count=places * world.face_count,
        shine=shine,
        paint=paint,
    )


@dataclass
class _Corners:
    """The corners of the scene's triangles, and their reflections place by place.

    index      the vertex of each of the three corners
    V          its position
    at         its reflections, packets of reflection point and code, all places but the last
    is_hidden  whether the last place is filled: the mirror hides the vertex
    beside     the place of the image that is nearest to its own vertex, and how far away that is
    places     number of places, which also stands for no place
    """

    index: list[mi.UInt32]
    V: list[mi.Point3f]
    at: list[list[mi.Vector4f]]
    is_hidden: list[mi.Bool]
    beside: list[tuple[mi.UInt32, mi.Float]]
    places: int

    @property
    def last(self) -> mi.UInt32:
        return mi.UInt32(self.places - 1)

    @property
    def none(self) -> mi.UInt32:
        return mi.UInt32(self.places)

    @staticmethod
    def of(face: mi.Vector4u, images: virtual.Images, world: geometry.Geometry, places: int) -> _Corners:
        """The corners of triangles `face`."""
        count, index = world.vertex_count, [face.x, face.y, face.z]
        at = [[dr.gather(mi.Vector4f, images.at, k * count + v) for k in range(places - 1)] for v in index]
        V = [dr.gather(mi.Vector4f, world.points, v).xyz for v in index]
        kinds = [dr.gather(mi.Float, images.moved, 4 * ((places - 1) * count + v) + 3) for v in index]
        corners = _Corners(index, V, at, [kind == virtual.HIDDEN for kind in kinds], [], places)
        corners.beside = [corners._nearest_to_itself(i, images, count) for i in range(3)]
        return corners

    def _nearest_to_itself(self, i: int, images: virtual.Images, count: int) -> tuple[mi.UInt32, mi.Float]:
        """Which image of corner i is nearest to itself, and how near."""
        best, least = self.none, mi.Float(dr.inf)
        for k in range(self.places - 1):
            distance = dr.norm(dr.gather(mi.Vector4f, images.moved, k * count + self.index[i]).xyz - self.V[i])
            better = (self.at[i][k].w > 0) & (distance < least)
            best, least = dr.select(better, k, best), dr.select(better, distance, least)
        return best, least

    def nearest(self, i: int, q: mi.Vector4f) -> mi.UInt32:
        """Which reflection of corner i is nearest to reflection q, of those of one kind."""
        best, least = self.none, mi.Float(dr.inf)
        for k in range(self.places - 1):
            distance = dr.squared_norm(self.at[i][k].xyz - q.xyz)
            better = (_kind_of(self.at[i][k]) == _kind_of(q)) & (distance < least)
            best, least = dr.select(better, k, best), dr.select(better, distance, least)
        return best

    def point(self, i: int, place: mi.UInt32) -> mi.Vector4f:
        """The reflection at a place of corner i."""
        value = mi.Vector4f(0)
        for k in range(self.places - 1):
            value = dr.select(place == k, self.at[i][k], value)
        return value

    def goes_behind(self, i: int, place: mi.UInt32, j: int) -> mi.Bool:
        """Whether the image at a place of corner i is of an edge that goes behind the mirror before it comes to corner j."""
        grazing = self.beside[i][1] < GRAZING * dr.norm(self.V[j] - self.V[i])
        return self.is_hidden[j] & ~self.is_hidden[i] & (place == self.beside[i][0]) & grazing

    def partner(self, i: int, place: mi.UInt32, j: int) -> mi.UInt32:
        """The place of corner j that belongs to one of corner i."""
        k = self.nearest(j, self.point(i, place))
        mutual = (k < self.none) & (self.nearest(i, self.point(j, k)) == place)
        of_reflected = dr.select(mutual, k, dr.select(self.goes_behind(i, place, j), self.last, self.none))
        beside = self.beside[j][0]
        of_hidden = dr.select(self.is_hidden[j], self.last, dr.select(self.goes_behind(j, beside, i), beside, self.none))
        return dr.select(place < self.last, of_reflected, of_hidden)


def _kind_of(p: mi.Vector4f) -> mi.UInt32:
    """The kind of path of a reflection, 0 for none."""
    return mi.UInt32(p.w) & (SEEN - 1)


def _faces(images: virtual.Images, world: geometry.Geometry, places: int) -> mi.UInt32:
    """Number k * face_count + f joins place k of the first vertex of triangle f to what belongs to it; three times the same
    vertex where nothing does."""
    count, lanes = world.face_count, places * world.face_count
    lane = dr.arange(mi.UInt32, lanes)
    face = dr.gather(mi.Vector4u, world.faces, lane % count)
    corners = _Corners.of(face, images, world, places)
    last, none, V = corners.last, corners.none, corners.V

    # Three of which every two belong together.
    a = lane // count
    exists = dr.select(a < last, mi.UInt32(corners.point(0, a).w) != 0, corners.is_hidden[0])
    b, c = corners.partner(0, a, 1), corners.partner(0, a, 2)
    both = exists & (b != none) & (c != none)
    agree = (corners.partner(1, b, 2) == c) | ((b == last) & (c < last)) | ((c == last) & (b < last))
    seen, towards = mi.Bool(False), mi.Vector3f(0)
    for i, place in enumerate((a, b, c)):
        p = corners.point(i, place)
        seen |= (place < last) & (mi.UInt32(p.w) >= SEEN)
        towards += dr.select(place < last, p.xyz - V[i], 0)

    # Near a focus, a triangle's corners may see different sides of it.
    front = ((face.w & raster.CLOSED) == 0) | (dr.dot(towards, dr.cross(V[1] - V[0], V[2] - V[0])) > 0)
    drawn = both & agree & seen & front
    index = [dr.select(drawn, k, 0) * world.vertex_count + v for k, v in zip((a, b, c), corners.index, strict=True)]
    index = [dr.select(drawn, i, corners.index[0]) for i in index]
    faces = dr.empty(mi.UInt32, 4 * lanes)
    dr.scatter(faces, mi.Vector4u(*index, face.w), lane)
    return faces


@dataclass
class Own:
    """A mirror's mesh and pose, asked where the mirror meets itself; whether it is black there, or only doubted."""

    mesh: MirrorMesh
    pose: list[mi.Vector4f]
    black: bool = True

    def meets(self, frame: Frame, distance: mi.Float, found: mi.Bool, here: mi.Bool) -> tuple[mi.Bool, mi.Float]:
        """Whether the ray that a pixel reflects meets the mirror before what is drawn there, and how far away; one lane per
        pixel of a frame, of which `here` are this mirror's."""
        hit = _FirstHit(frame.p, frame.n, frame.v)
        return _met_again(self.mesh, self.pose, frame.view, hit, distance, found, here)


@dataclass
class _FirstHit:
    """Point, normal and direction to the eye at each pixel."""

    p: mi.Point3f
    n: mi.Normal3f
    v: mi.Vector3f


@frozen
def _met_again(
    mesh: MirrorMesh,
    pose: list[mi.Vector4f],
    view: View,
    first: _FirstHit,
    distance: mi.Float,
    found: mi.Bool,
    here: mi.Bool,
) -> tuple[mi.Bool, mi.Float]:
    p, w = first.p, optics.reflect(first.v, first.n)
    local = placement.mirror_frame(pose, p, view)
    lifted = placement.mirror_frame(pose, p + sight.LIFT * mesh.size * mi.Vector3f(first.n), view).V
    along = placement.mirror_frame(pose, p + w, view).V - local.V
    hit = mesh.scene.ray_intersect_preliminary(mi.Ray3f(lifted, mi.Vector3f(along)), coherent=False, active=here)
    met = here & hit.is_valid() & (~found | (hit.t < SHORTER * distance))
    return met, hit.t
