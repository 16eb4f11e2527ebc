"""Drawing several reflections per vertex: a triangle is drawn once for each three of its vertices' that belong together.

Over a smooth piece of the mirror's answer, a *branch*, the reflection point of V moves smoothly with V, and what kind of path
it makes does not change (`newton.kind`): that changes where two branches meet and end, on a caustic. So the reflections of two
vertices of a triangle belong together if they are of one kind and each is the other's nearest. Three of which
every two belong together make a virtual triangle; what has no match is not drawn.

One more place per vertex, the last, is for those that the mirror hides from the eye. Where an edge
goes behind the mirror's outline, its reflection is grazing and its image comes together with itself: of the end that is
not hidden, the image nearest to itself belongs to it, and `virtual` cuts the triangle there.

Which pixels of a virtual triangle are images is decided per pixel. What belongs to a part of the mirror that is behind
another is left out by depth (`virtual.Drawing.behind`); and where the mirror meets itself in its reflection (`own`), it is
black, as other mirrors are.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import drjit as dr
import mitsuba as mi

from benchharness.kernels import depths, geometry, optics, placement, raster
from benchharness.kernels.frozen import frozen
from benchharness.kernels.vertices import newton, several, vertexwise, virtual

SEEN = 4  # added to the kind of a reflection that is seen
GRAZING = 2.0  # times the edge: an image is at most this far from its vertex if the other end is hidden. Where the edge is at d
# from the outline, seen from the mirror, its image is on the other side of the outline at d
SHORTER = 0.98  # a mirror that meets itself at this share of the distance to what is drawn is before it: edges are straight


@dataclass
class Arranged:
    """One mirror's images with several places per vertex, and what there is to report; see `solved`.

    images     (multi + 1) * count packets, place by place
    triangles  the scene's, as often as there are places
    reports    per place but the last, the fields of `benchharness.api.Vertices`
    """

    images: virtual.Images
    triangles: geometry.Geometry
    reports: list[dict]
    counters: dict[str, mi.UInt32]


def arranged(
    found: several.Found, mirror: newton.Mesh, pose: list, world: geometry.Geometry, part, shown_parts, view, multi: int,
    doubted=None, mirrored: bool = False,
) -> Arranged:  # fmt: skip
    """`mirrored`: images are V mirrored in the plane at R, else V on the eye's ray through R. `doubted`: parts from this number
    on are mirrors, None where no doubt is asked for."""
    count = world.vertex_count
    places = multi + 1
    lane = dr.arange(mi.UInt32, places * count)
    vertex, last = lane % count, lane >= multi * count
    V = dr.gather(mi.Vector4f, world.points, vertex)
    active = (mi.UInt32(V.w) != part) & (mi.UInt32(V.w) < shown_parts)
    V = mi.Point3f(V.xyz)

    # What the mirror hides: V itself, and the mirror's point in front of it.
    shadow, surface = newton.Shadow(mirror, pose).hides(V, view, active & last)
    shadow &= active & last
    own = dr.dot(view.w, mi.Vector4f(V.x, V.y, V.z, 1))
    before = V + (V - view.eye) * dr.select(shadow, (surface - depths.offset(view, V)) / own, 0)

    def of(array):
        return dr.gather(type(array), array, lane, ~last)

    filled, n = of(found.filled), of(found.n)
    R = dr.select(filled, of(found.R), before)
    image = optics.mirrored(V, R, n) if mirrored else optics.on_ray(V, R, view.eye)
    image = dr.select(filled, image, V)
    kind, region = vertexwise.kinds(filled, shadow)
    code = dr.select(filled, mi.Float(of(found.kind) + dr.select(of(found.seen), mi.UInt32(SEEN), 0)), 0)
    images = virtual.Images(
        vertexwise.packets(image, kind, lane, places * count), vertexwise.packets(R, code, lane, places * count)
    )
    if doubted is not None:
        images.sure = vertexwise.sureness(n, filled & ~of(found.converged), world.points, lane, doubted, places * count)
    image, R, region = mi.Point3f(image), mi.Point3f(R), mi.UInt32(region)
    dr.eval(images, image, R, region)

    # The first place says where a vertex is hidden, and that it has more reflections than there is room for.
    reports = []
    for k in range(multi):
        at = dr.arange(mi.UInt32, count) + k * count
        of_place = {
            name: dr.gather(type(array), array, at)
            for name, array in {
                "R": R, "n": found.n, "virtual": image, "converged": found.converged, "valid": found.converged & found.seen,
                "region": region, "iterations": found.iterations, "residual": found.residual,
            }.items()
        }  # fmt: skip
        if k == 0:
            hidden = dr.gather(mi.UInt32, region, dr.arange(mi.UInt32, count) + multi * count)
            of_place["region"] = dr.select(of_place["region"] == vertexwise.UNKNOWN, hidden, of_place["region"])
            of_place["converged"] &= found.reflections <= multi
        reports.append({**of_place, "border": dr.zeros(mi.Bool, count)})
    counters = {"iterations": found.work, "reflections": found.reflections}
    return Arranged(images, _repeated(images, world, places), reports, counters)


def solved(
    made: Arranged, mirror: newton.Mesh, seeds: several.Seeds, pose: list, frame, i: int, part, hidden: str,
    own: Own | None, counters: dict[str, mi.UInt32] | None = None,
) -> vertexwise.Solved:  # fmt: skip
    """What `vertexwise.shown` draws of mirror number i of a `benchharness.api.Frame`.

    hidden    as `virtual.Drawing` has it
    own       what is asked where the mirror meets itself, or None
    counters  further work
    """
    back = virtual.nearest_back(frame.proxies[i], frame.poses, part, frame.view) if seeds.closed else None
    return vertexwise.Solved(
        made.images, None, made.reports[0], virtual.Drawing(hidden, behind=seeds.closed), newton.Shadow(mirror, pose), back,
        counters={**made.counters, **(counters or {})}, further=made.reports[1:], triangles=made.triangles, own=own,
    )  # fmt: skip


def meeting(sheet: newton.Mesh, pose: list, own: str, doubts: bool) -> Own | None:
    """What `vertexwise.Solved.own` is for a mirror that is "black" in itself, or "omitted"; `sheet` is what is seen of it. One
    that is convex meets itself where its normals are smoother than its facets, which is only doubted."""
    black = own == "black" and not sheet.convex
    return Own(sheet, pose, black) if black or doubts else None


def _repeated(images: virtual.Images, world: geometry.Geometry, places: int) -> geometry.Geometry:
    """The scene's vertices once per place, and its triangles once per place of their first vertex."""
    shine = world.shine
    if shine is not None:
        shine = replace(shine, normals=dr.tile(shine.normals, places), visibility=dr.tile(shine.visibility, places))
    faces = _faces(images, world, places)
    return geometry.Geometry(
        dr.tile(world.points, places), dr.tile(world.attributes, places), faces, places * world.vertex_count,
        places * world.face_count, shine,
    )  # fmt: skip


def _faces(images: virtual.Images, world: geometry.Geometry, places: int) -> mi.UInt32:
    """Number k * face_count + f joins place k of the first vertex of triangle f to what belongs to it; three times the same
    vertex where nothing does."""
    count, lanes = world.face_count, places * world.face_count
    lane = dr.arange(mi.UInt32, lanes)
    face = dr.gather(mi.Vector4u, world.faces, lane % count)
    corner = [face.x, face.y, face.z]
    at = [[dr.gather(mi.Vector4f, images.at, k * world.vertex_count + v) for k in range(places - 1)] for v in corner]
    V = [dr.gather(mi.Vector4f, world.points, v).xyz for v in corner]
    is_hidden = [
        dr.gather(mi.Float, images.moved, 4 * ((places - 1) * world.vertex_count + v) + 3) == virtual.HIDDEN for v in corner
    ]
    last, none = mi.UInt32(places - 1), mi.UInt32(places)

    def nearest(i: int, R, kind) -> mi.UInt32:
        """Which reflection of corner i is nearest to R, of those of one kind."""
        best, least = mi.UInt32(none), mi.Float(dr.inf)
        for k in range(places - 1):
            distance = dr.squared_norm(at[i][k].xyz - R)
            better = (mi.UInt32(at[i][k].w) & (SEEN - 1) == kind) & (distance < least)
            best, least = dr.select(better, k, best), dr.select(better, distance, least)
        return best

    def grazing(i: int) -> tuple[mi.UInt32, mi.Float]:
        """Which image of corner i is nearest to itself, and how near."""
        best, least = mi.UInt32(none), mi.Float(dr.inf)
        for k in range(places - 1):
            distance = dr.norm(dr.gather(mi.Vector4f, images.moved, k * world.vertex_count + corner[i]).xyz - V[i])
            better = (at[i][k].w > 0) & (distance < least)
            best, least = dr.select(better, k, best), dr.select(better, distance, least)
        return best, least

    beside = [grazing(i) for i in range(3)]

    def point(i: int, place) -> mi.Vector4f:
        value = mi.Vector4f(0)
        for k in range(places - 1):
            value = dr.select(place == k, at[i][k], value)
        return value

    def kind_of(p: mi.Vector4f) -> mi.UInt32:
        return mi.UInt32(p.w) & (SEEN - 1)

    def goes_behind(i: int, place, j: int) -> mi.Bool:
        """Whether the image at a place of corner i is of an edge that goes behind the mirror before it comes to corner j."""
        return is_hidden[j] & ~is_hidden[i] & (place == beside[i][0]) & (beside[i][1] < GRAZING * dr.norm(V[j] - V[i]))

    def partner(i: int, place, j: int) -> mi.UInt32:
        """The place of corner j that belongs to one of corner i."""
        p = point(i, place)
        k = nearest(j, p.xyz, kind_of(p))
        q = point(j, k)
        mutual = (k < none) & (nearest(i, q.xyz, kind_of(q)) == place)
        of_reflected = dr.select(mutual, k, dr.select(goes_behind(i, place, j), last, none))
        of_hidden = dr.select(is_hidden[j], last, dr.select(goes_behind(j, beside[j][0], i), beside[j][0], none))
        return dr.select(place < last, of_reflected, of_hidden)

    a = lane // count
    exists = dr.select(a < last, mi.UInt32(point(0, a).w) != 0, is_hidden[0])
    b, c = partner(0, a, 1), partner(0, a, 2)
    both = exists & (b != none) & (c != none)
    agree = (partner(1, b, 2) == c) | ((b == last) & (c < last)) | ((c == last) & (b < last))
    seen = mi.Bool(False)
    for i, place in enumerate((a, b, c)):
        seen |= (place < last) & (mi.UInt32(point(i, place).w) >= SEEN)
    drawn = both & agree & seen

    # Near a focus, a triangle's corners may see different sides of it.
    normal, towards = dr.cross(V[1] - V[0], V[2] - V[0]), mi.Vector3f(0)
    for i, place in enumerate((a, b, c)):
        towards += dr.select(place < last, point(i, place).xyz - V[i], 0)
    drawn &= ((face.w & raster.CLOSED) == 0) | (dr.dot(towards, normal) > 0)
    index = [dr.select(drawn, place, 0) * world.vertex_count + v for place, v in zip((a, b, c), corner, strict=True)]
    index = [dr.select(drawn, i, corner[0]) for i in index]
    faces = dr.empty(mi.UInt32, 4 * lanes)
    dr.scatter(faces, mi.Vector4u(*index, face.w), lane)
    return faces


@dataclass
class Own:
    """A mirror's mesh and pose, asked where the mirror meets itself; whether it is black there, or only doubted."""

    mesh: newton.Mesh
    pose: list[mi.Vector4f]
    black: bool = True

    def meets(self, frame, distance: mi.Float, found: mi.Bool, here: mi.Bool) -> tuple[mi.Bool, mi.Float]:
        """Whether the ray that a pixel reflects meets the mirror before what is drawn there, and how far away; one lane per
        pixel of a `benchharness.api.Frame`, of which `here` are this mirror's."""
        return _own(self.mesh, self.pose, frame.view, frame.p, frame.n, frame.v, distance, found, here)


@frozen
def _own(mirror: newton.Mesh, pose: list, view, p: mi.Point3f, n: mi.Normal3f, v: mi.Vector3f, distance, found, here):
    where, w = placement.place(pose, p, view), optics.reflect(v, n)
    lifted = placement.place(pose, p + several.LIFT * mirror.size * mi.Vector3f(n), view).V
    along = placement.place(pose, p + w, view).V - where.V
    hit = mirror.scene.ray_intersect_preliminary(mi.Ray3f(lifted, mi.Vector3f(along)), coherent=False, active=here)
    met = here & hit.is_valid() & (~found | (hit.t < SHORTER * distance))
    return met, hit.t
