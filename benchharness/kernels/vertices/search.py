"""Image-space search for reflection points (Estalella, Martin, Drettakis, Tost 2006, section 4).

A reflector is rendered from the eye into a texture of first points and normals (`textures`). The point R that shows a
vertex V to the eye E is where the half vector B of the directions to E and V is the normal N; the search climbs the
agreement of B and N from texel to neighbouring texel until no neighbour agrees better.

Where we differ from the paper: the eight neighbours may be taken at a stride that halves from level to level, which is
the same as climbing a pyramid of every second, fourth, ... texel, and takes a cold search from hundreds of steps to tens.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from benchharness.kernels import depths, optics
from benchharness.kernels.types import View
from benchharness.kernels.vertices.textures import Texture

CROSS = ((0, 1), (0, -1), (1, 0), (-1, 0))
DIAGONALS = ((1, 1), (1, -1), (-1, 1), (-1, -1))
CERTAIN = 1.0  # texels; a search that ended on the best texel leaves at most half a texel per axis, plus the curvature's part
BEND = 0.25  # square of the largest second difference, relative to the first over both sides, of a smooth texture
STRAY = 0.3  # |half vector - normal| of an end that is no reflection; at outlines one texel turns the normal by up to this
KEPT = 0.1  # texels; how far from where the rates put it the reflection point may still be
UNKNOWN_PX = 0.25  # texels that a converged search may be off for what its texture does not tell
OUTSIDE = -8.0  # below every score: "sq" lies in [-4, 0], "dot" in [-1, 1]


def mismatch(p: mi.Point3f, n: mi.Normal3f, eye: mi.Point3f, vertex: mi.Point3f) -> tuple[mi.Vector3f, mi.Bool]:
    """B - N at a point of the reflector, and whether B is defined."""
    B, defined = optics.half_vector(p, eye, vertex)
    return B - mi.Vector3f(n), defined


@dataclass
class Options:
    """What the kernels are compiled for.

    score          how well a texel reflects a vertex: "sq", "dot" or "inverse" (`score`)
    neighbourhood  which texels are tried: "cross_then_diag", "full8" or "cross_only"
    subtexel       whether the reflection point is refined between texels
    """

    score: str
    neighbourhood: str
    subtexel: bool = True


@dataclass
class Start:
    """Where searches start: a texel, and how many texels away its neighbours are at first."""

    column: mi.Int32
    row: mi.Int32
    stride: mi.Int32


@dataclass
class Climbed:
    """Where climbing ended.

    column, row  the best texel
    score        how well it reflects the vertex
    iterations   neighbourhoods examined, the last one that changed nothing included
    reads        texels evaluated
    settled      it ended by itself rather than at `max_iter`
    """

    column: mi.Int32
    row: mi.Int32
    score: mi.Float
    iterations: mi.UInt32
    reads: mi.UInt32
    settled: mi.Bool


def score(kind: str, texture: Texture, column: mi.Int32, row: mi.Int32, vertex: mi.Point3f, active: mi.Bool | bool) -> mi.Float:
    """How well the texel reflects the vertex: "dot" is B.N as in the paper, "sq" is -|B - N|^2.

    Both have the same maximum; B.N in float32 is flat within 3.5e-4 rad of it, -|B - N|^2 is not. "inverse" is "sq" with
    the roles swapped: the vertex is the image, and what it is the image of is its mirror image at each texel.
    """
    covered, p, n = texture.at(column, row, active)
    if kind == "inverse":
        vertex = optics.mirrored(vertex, p, n)
    difference, defined = mismatch(p, n, texture.view.eye, vertex)
    if kind == "dot":
        value = dr.select(defined, dr.dot(difference, n) + 1, -1)
    else:
        value = dr.select(defined, -dr.squared_norm(difference), -4)
    return dr.select(covered, value, OUTSIDE)


@dr.syntax
def climb(
    options: Options, texture: Texture, vertex: mi.Point3f, start: Start, active: mi.Bool, max_iter: mi.UInt32
) -> Climbed:
    """The best texel that climbing from `start` comes to; the stride halves down to 1 where no neighbour is better.

    Strict improvement at each step, so it ends; neighbours that tie do not move it.
    """
    kind, neighbourhood = options.score, options.neighbourhood
    offsets = CROSS + DIAGONALS if neighbourhood == "full8" else CROSS
    column, row = start.column, start.row  # the best texel so far,
    best = score(kind, texture, column, row, vertex, active)  # and its score
    stride = start.stride  # texels to the neighbours
    iterations = mi.UInt32(0)  # neighbourhoods examined
    reads = mi.UInt32(dr.select(active, 1, 0))  # texels evaluated
    corners = mi.Bool(False)  # whether the diagonals are next, after the cross
    running = mi.Bool(active)
    ended = ~running  # by itself
    while dr.hint(running, label="climb the agreement of half vector and normal"):
        next_column, next_row, next_best = mi.Int32(column), mi.Int32(row), mi.Float(best)
        for k in range(len(offsets)):
            dx, dy = offsets[k]
            if dr.hint(neighbourhood == "cross_then_diag", mode="scalar"):
                dx, dy = dr.select(corners, DIAGONALS[k][0], dx), dr.select(corners, DIAGONALS[k][1], dy)
            c, r = column + dx * stride, row + dy * stride
            s = score(kind, texture, c, r, vertex, running)
            better = s > next_best
            next_column, next_row = dr.select(better, c, next_column), dr.select(better, r, next_row)
            next_best = dr.select(better, s, next_best)
        reads += len(offsets)

        improved = next_best > best
        column, row, best = next_column, next_row, next_best
        examined = mi.Bool(improved)
        if dr.hint(neighbourhood == "cross_then_diag", mode="scalar"):
            examined |= corners
            settled = corners & ~improved
            corners = ~corners & ~improved
        else:
            examined |= True
            settled = ~improved
        iterations += dr.select(examined, 1, 0)
        done = settled & (stride <= 1)
        stride = dr.select(settled, dr.maximum(stride >> 1, 1), stride)
        ended |= done
        running &= ~done & (iterations < max_iter)
    return Climbed(column, row, best, iterations, reads, ended)


@dataclass
class Differential:
    """The reflector at a texel, and how it changes from one texel to the next: a ray differential of the texel's own ray.

    column, row  the texel
    f, p, n      B - N, the point and its normal there; with `_column` and `_row` their changes per column and per row, by
                 central differences
    complete     all five texels are covered, and B is defined at each
    smooth       complete, and the differences to both sides agree
    second       sum of the squares of second differences of B - N, along columns and along rows
    """

    column: mi.Int32
    row: mi.Int32
    f: mi.Vector3f
    f_column: mi.Vector3f
    f_row: mi.Vector3f
    p: mi.Point3f
    p_column: mi.Vector3f
    p_row: mi.Vector3f
    n: mi.Normal3f
    n_column: mi.Vector3f
    n_row: mi.Vector3f
    complete: mi.Bool
    smooth: mi.Bool
    second: mi.Float

    def at(self, view: View, x: mi.Float, y: mi.Float) -> tuple[mi.Point3f, mi.Normal3f]:
        """The point on the eye's ray through (column + x, row + y), and its unit normal."""
        q = self.p + x * self.p_column + y * self.p_row
        column, row = mi.Float(self.column) + x + 0.5, mi.Float(self.row) + y + 0.5
        n = dr.normalize(mi.Vector3f(self.n) + x * self.n_column + y * self.n_row)
        return depths.on_ray(view, column, row, depths.offset(view, q)), mi.Normal3f(n)

    def least_change(self) -> mi.Float:
        """Square of the change of B - N per texel, in the direction in which it changes least."""
        aa, ab, bb = dr.squared_norm(self.f_column), dr.dot(self.f_column, self.f_row), dr.squared_norm(self.f_row)
        return 0.5 * (aa + bb - dr.sqrt(dr.square(aa - bb) + 4 * ab * ab))


def differential(texture: Texture, column: mi.Int32, row: mi.Int32, vertex: mi.Point3f, active: mi.Bool) -> Differential:
    """The differential of a texel and its four neighbours."""
    eye = texture.view.eye
    covered, p, n = texture.at(column, row, active)
    f, complete = mismatch(p, n, eye, vertex)
    complete &= covered
    rates, smooth, second = [], mi.Bool(True), mi.Float(0)
    for dx, dy in ((1, 0), (0, 1)):
        ends = []
        for side in (1, -1):
            covered, q, m = texture.at(column + side * dx, row + side * dy, active)
            difference, defined = mismatch(q, m, eye, vertex)
            complete &= covered & defined
            ends.append((difference, q, mi.Vector3f(m)))
        # Where the two sides change at different rates, a step or an outline lies between.
        bend, turn = ends[0][0] + ends[1][0] - 2 * f, ends[0][0] - ends[1][0]
        smooth &= dr.squared_norm(bend) <= BEND * dr.squared_norm(turn)
        second += dr.squared_norm(bend)
        rates.append([0.5 * (a - b) for a, b in zip(*ends, strict=True)])
    (f_column, p_column, n_column), (f_row, p_row, n_row) = rates
    return Differential(
        column=column,
        row=row,
        f=f,
        f_column=f_column,
        f_row=f_row,
        p=p,
        p_column=p_column,
        p_row=p_row,
        n=n,
        n_column=n_column,
        n_row=n_row,
        complete=complete,
        smooth=complete & smooth,
        second=second,
    )


def least_squares(f: mi.Vector3f, a: mi.Vector3f, b: mi.Vector3f) -> tuple[mi.Float, mi.Float, mi.Bool]:
    """(x, y) that minimise |f + x a + y b|, within one texel each, and whether they explain f.

    The last is True where the solution lies within CERTAIN texels and leaves less of f than the step of one texel would
    change it: then R is where the texture says that it is, and not where the search merely stopped.
    """
    aa, ab, bb, af, bf = dr.dot(a, a), dr.dot(a, b), dr.dot(b, b), dr.dot(a, f), dr.dot(b, f)
    det = aa * bb - ab * ab
    usable = det > 1e-6 * aa * bb
    scale = dr.select(usable, dr.rcp(dr.select(usable, det, 1)), 0)
    x, y = (ab * bf - bb * af) * scale, (ab * af - aa * bf) * scale
    left = dr.squared_norm(f + x * a + y * b)
    explained = usable & (dr.abs(x) <= CERTAIN) & (dr.abs(y) <= CERTAIN) & (left <= 0.25 * dr.maximum(aa, bb))
    return dr.clip(x, -1, 1), dr.clip(y, -1, 1), explained


@dataclass
class Found:
    """What a search ended with, one lane per vertex.

    column, row  the best texel
    R, n         the reflection point and its unit normal, of that texel or refined between texels
    reflected    V lies in front of the plane at R: region A. Not so where the search ended far from any agreement, as it
                 may on a mirror that is not convex: such a vertex is neither reflected nor hidden
    hidden       it does not: region C, which no reflection point shows
    converged    reflected, and half vector and normal agree within what one texel changes
    valid        converged, and the normal is turned to the eye
    border       the search was stopped by the edge of the texture
    residual     |half vector - normal| at R
    iterations   neighbourhoods examined; 0 for inactive lanes
    reads        texels evaluated while climbing
    """

    column: mi.Int32
    row: mi.Int32
    R: mi.Point3f
    n: mi.Normal3f
    reflected: mi.Bool
    hidden: mi.Bool
    converged: mi.Bool
    valid: mi.Bool
    border: mi.Bool
    residual: mi.Float
    iterations: mi.UInt32
    reads: mi.UInt32


def find(options: Options, texture: Texture, vertex: mi.Point3f, start: Start, active: mi.Bool, max_iter: mi.UInt32) -> Found:
    """The reflection point of each vertex: climb from `start`, then look around the texel where that ended."""
    view, top = texture.view, climb(options, texture, vertex, start, active, max_iter)
    column, row = top.column, top.row
    here = differential(texture, column, row, vertex, active)
    covered, R, n = texture.at(column, row, active)[0], here.p, here.n
    x, y, explained = least_squares(here.f, here.f_column, here.f_row)
    # Across a fold of the mirror the rates mean nothing, and what they promise does not come true.
    refined = here.at(view, x, y)
    step = dr.minimum(dr.squared_norm(here.f_column), dr.squared_norm(here.f_row))
    kept = dr.squared_norm(mismatch(*refined, view.eye, vertex)[0]) <= dr.square(KEPT) * step
    certain = explained & here.smooth & top.settled & kept
    if options.subtexel:
        R, n = dr.select(here.complete, refined[0], R), dr.select(here.complete, refined[1], n)
    in_front = dr.dot(vertex - R, n) > 0
    residual = dr.norm(mismatch(R, n, view.eye, vertex)[0])
    stray = in_front & ~certain & (residual > STRAY)
    reflected = active & covered & in_front & ~stray
    edge = (column == 0) | (row == 0) | (column == view.width - 1) | (row == view.height - 1)
    # Between texels, second differences leave an eighth of them unknown. Where B - N hardly changes in some direction, as at a
    # focus, that moves the point by pixels.
    converged = reflected & certain & (here.second <= dr.square(8 * UNKNOWN_PX) * here.least_change())
    return Found(
        column=column,
        row=row,
        R=R,
        n=n,
        reflected=reflected,
        hidden=active & covered & ~in_front,
        converged=converged,
        valid=converged & (dr.dot(view.eye - R, n) > 0),
        border=active & edge & ~certain,
        residual=residual,
        iterations=dr.select(active, top.iterations, 0),
        reads=top.reads,
    )
