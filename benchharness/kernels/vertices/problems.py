"""What a solver is asked, the reflection points of all vertices in one mirror, and what its answer makes of them: images."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import drjit as dr
import mitsuba as mi

from benchharness.kernels import geometry, packets, placement, planes
from benchharness.kernels.types import Vertices, View
from benchharness.kernels.vertices import flatsheet, virtual

UNKNOWN, REFLECTED, UNREFLECTED, HIDDEN = range(4)  # types.Vertices.region
CUT_TURN = 0.05  # radians of turn from one frame to the next that make a cut


@dataclass
class Problem:
    """What a solver is asked: the reflection points of vertices in a mirror, or each in one of a group that is solved together.

    world        what is reflected, in world space
    part         number of the mirror's part, whose own vertices are not searched; one per vertex where mirrors are several
    shown_parts  parts from this number on are left out (`scenery.Scenery`)
    mirrors      parts from this number on are mirrors, and what shows them is doubted; None where no doubt is asked for
    poses        12 floats per part, as `types.Frame` has them
    view         the camera
    last_view    the camera that the last ends were found with; the same as `view` where there are none
    max_iter     steps after which a search gives up
    mirror       the mirror's number in its group, per vertex; None where there is one
    of_triangles  per triangle, part and number of its mirror; None where there is one
    plane        that the mirror is a sheet in, world space; None where it is not flat, or mirrors are several
    """

    world: geometry.Geometry
    part: mi.UInt32
    shown_parts: mi.UInt32
    mirrors: mi.UInt32 | None
    poses: mi.Float
    view: View
    last_view: View
    max_iter: mi.UInt32
    mirror: mi.UInt32 | None = None
    of_triangles: tuple[mi.UInt32, mi.UInt32] | None = None
    plane: planes.Plane | None = None

    @property
    def count(self) -> int:
        """Vertices."""
        return self.world.vertex_count

    @property
    def pose(self) -> list[mi.Vector4f]:
        """Rows of the mirror's 3 x 4 object-to-world matrix; of each vertex's mirror where there are several."""
        return placement.pose_of(self.poses, self.part)

    def vertices(self) -> tuple[mi.UInt32, mi.Point3f, mi.Bool]:
        """Lane, position and whether it is searched, of every vertex: those of the mirror's own part and of parts left out are
        not."""
        lane = dr.arange(mi.UInt32, self.count)
        V = dr.gather(mi.Vector4f, self.world.points, lane)
        return lane, mi.Point3f(V.x, V.y, V.z), (mi.UInt32(V.w) != self.part) & (mi.UInt32(V.w) < self.shown_parts)

    def unsure(self, n: mi.Normal3f, unsure: mi.Bool, lane: mi.UInt32, count: int) -> mi.Float | None:
        """`virtual.Images.unsure` of vertices lane % `self.count`, None where no doubt is asked for: so are also other mirrors,
        whose own light is not drawn."""
        if self.mirrors is None:
            return None
        part = mi.UInt32(dr.gather(mi.Float, self.world.points, 4 * (lane % self.count) + 3))
        return packets.joined(mi.Point3f(n), dr.select(unsure | (part >= self.mirrors), mi.Float(1), 0), count)


@dataclass
class Answer:
    """What one mirror's solver found, one lane per vertex; world space. `images_of` makes images of it.

    R, n        point of the mirror and its unit normal
    image       where the image is drawn
    reflected   there is an image
    hidden      no reflection shows the vertex
    converged   R is a reflection point that the eye sees
    unsure      what is drawn may be wrong
    residual    |half vector - normal| at R
    iterations  points looked at
    free        the mirror does not hide R from the eye; None if it cannot
    flush       the vertex lies flush with a mirror that is convex: it is its own image, before the mirror or in it, and only
                triangles that leave it have one; None where that does not matter
    border      the search ended at the edge of the mirror's picture; None where there is none
    """

    R: mi.Point3f
    n: mi.Normal3f
    image: mi.Point3f
    reflected: mi.Bool
    hidden: mi.Bool
    converged: mi.Bool
    unsure: mi.Bool
    residual: mi.Float
    iterations: mi.UInt32
    free: mi.Bool | None = None
    flush: mi.Bool | None = None
    border: mi.Bool | None = None


@dataclass
class Found:
    """What a solver found of vertices.

    images    virtual vertices
    vertices  what there is to report of them
    end       what a search of the same vertices, or of others beside them, starts from
    counters  further work, integers per vertex
    """

    images: virtual.Images
    vertices: Vertices
    end: Any
    counters: dict[str, mi.UInt32] = field(default_factory=dict)


def images_of(problem: Problem, found: Answer, *, by_plane: bool = True) -> tuple[virtual.Images, Vertices]:
    """The virtual vertices of an answer, and what there is to report of it; `valid` is `converged`.

    by_plane  what no point of a flat sheet was found to reflect has its image all the same: points that are found are exact
    """
    at, n = found.R, found.n
    if by_plane and problem.plane is not None:
        found, at, n = _by_plane(problem, problem.plane, found)
    count = problem.count
    lane = dr.arange(mi.UInt32, count)
    kind, region = kinds(found.reflected, found.hidden)
    if found.flush is not None:
        kind = dr.select(found.flush & found.reflected, mi.Float(virtual.HIDDEN), kind)
    if found.free is not None:
        region = dr.select(found.free, region, UNKNOWN)
    images = virtual.Images(
        moved=packets.joined(found.image, kind, count),
        at=packets.joined(at, mi.Float(0), count),
        seen=found.free,
        unsure=problem.unsure(n, found.unsure, lane, count),
    )
    vertices = Vertices(
        R=mi.Point3f(found.R),
        n=mi.Normal3f(found.n),
        virtual=mi.Point3f(found.image),
        converged=mi.Bool(found.converged),
        valid=mi.Bool(found.converged),
        region=region,
        iterations=found.iterations,
        residual=mi.Float(found.residual),
        border=dr.zeros(mi.Bool, count) if found.border is None else found.border,
    )
    return images, vertices


def _by_plane(problem: Problem, plane: planes.Plane, found: Answer) -> tuple[Answer, mi.Point3f, mi.Normal3f]:
    """An answer in which what is before a flat sheet has its image, and no doubt, though no point of the sheet was found to
    reflect it, and what is behind has none; and the points of the plane, and normals, that reflect."""
    _, V, active = problem.vertices()
    known = flatsheet.mirrored(plane, V, problem.view.eye)
    beyond = active & known.before & ~found.converged
    behind = found.reflected & ~known.before & ~found.converged
    answer = replace(
        found,
        image=dr.select(beyond | behind, known.image, found.image),
        reflected=(found.reflected & ~behind) | beyond,
        hidden=(found.hidden & ~beyond) | behind,
        unsure=found.unsure & ~beyond,
        free=None if found.free is None else found.free | beyond,
        flush=None if found.flush is None else found.flush & ~beyond,
    )
    return answer, dr.select(beyond, known.R, found.R), mi.Normal3f(dr.select(beyond, known.n, found.n))


def was_cut(view: View, last: View) -> mi.Bool:
    """Whether the camera turned too far since the last frame for its answers to be near, or its texels are others."""
    turned = dr.norm(dr.normalize(view.w.xyz) - dr.normalize(last.w.xyz)) > CUT_TURN
    zoomed = dr.abs(dr.norm(view.right) / dr.norm(last.right) - 1) > 1e-6
    return turned | zoomed | mi.Bool((view.width, view.height) != (last.width, last.height))


def kinds(reflected: mi.Bool, hidden: mi.Bool) -> tuple[mi.Float, mi.UInt32]:
    """The kind of a virtual vertex and its region."""
    kind = dr.select(reflected, mi.Float(virtual.REFLECTED), dr.select(hidden, mi.Float(virtual.HIDDEN), virtual.NONE))
    return kind, dr.select(reflected, mi.UInt32(REFLECTED), dr.select(hidden, mi.UInt32(HIDDEN), mi.UInt32(UNKNOWN)))
