"""The picture itself as a scene: depths of the main view, and rays that march across it.

A pixel keeps the nearness ν = 1 / depth of what it shows, 0 for nothing. Depth is along the view axis; so ν is linear on the
screen, along every ray and across the picture of every plane. A ray is a straight line in (x, y, ν). It is told by τ, pixels
along the axis of the screen on which it is longer: at τ it is at (x + τ ax, y + τ ay) with ν + τ dν. It ends where it is
infinitely far, comes to the near plane, or leaves the picture.

In front of what all pixels show there is nothing: so far as a ray has not been behind anything, what it meets first is what
the scene holds there. It meets a pixel where it was in front before and comes to be behind: across an edge, by no more than a
thickness. A pixel's own mirror is none of what it can meet.

The hierarchical march skips what it is in front of in squares of 2, 4, 8, ... pixels, by the greatest ν of each (Uludag 2014).
Sizes are padded to powers of two with what is nowhere. Depths are never averaged to find a hit: between two things there is
nothing to meet. Only where all four pixels around are one surface, that is met between them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import drjit as dr
import mitsuba as mi

from benchharness.kernels import depths, geometry, raster
from benchharness.kernels.frozen import frozen
from benchharness.kernels.types import View

March = Literal["linear", "hierarchical"]
JUMP = 0.1  # of depth, between neighbouring pixels: more is an edge
CLOSE = 0.01  # of depth: so near to what is seen a ray has met it
SIDEWAYS = 1e-4  # of a ray's length: what goes away from the eye by less is taken to end at FAR
FAR = 1e4  # of the depth of its start
POINT = 1e-6  # pixels: what is no longer on the screen than that is a point
NUDGE = 1e-3  # pixels past the border of a square


@dataclass
class Screen:
    """What the picture shows.

    nearness      ν, level after level, each [down, across] in squares of 2 to the level's power; the nearest of each
    starts        first texel of each level
    across, down  of the finest level: powers of two, at least the picture's size
    levels        how many there are
    radiance, reflector  as `benchharness.api.Frame` has them
    """

    nearness: mi.Float
    starts: mi.UInt32
    across: int
    down: int
    levels: int
    radiance: mi.Color3f
    reflector: mi.Int32
    width: int
    height: int


@dataclass
class Line:
    """A ray on the screen, as above.

    end     τ where it ends
    far     it ends infinitely far away, within the picture
    dt      its length at τ is τ dt / (ν + τ dν)
    mirror  number of the mirror that it leaves
    """

    x: mi.Float
    y: mi.Float
    ax: mi.Float
    ay: mi.Float
    nearness: mi.Float
    slope: mi.Float
    end: mi.Float
    far: mi.Bool
    dt: mi.Float
    mirror: mi.Int32

    def at(self, tau: mi.Float) -> tuple[mi.Float, mi.Float]:
        """Column and row, in pixels."""
        return dr.fma(tau, self.ax, self.x), dr.fma(tau, self.ay, self.y)

    def nu(self, tau: mi.Float) -> mi.Float:
        """ν, never below 0."""
        return dr.maximum(dr.fma(tau, self.slope, self.nearness), 0)

    def length(self, tau: mi.Float) -> mi.Float:
        """The ray's length, inf where ν is 0."""
        nu = self.nu(tau)
        return dr.select(nu > 0, tau * self.dt / dr.select(nu > 0, nu, 1), dr.inf)


@dataclass
class Met:
    """Where a march has ended.

    hit        it meets what a pixel shows, between `low` and `high`
    behind     it was behind something before that
    completed  it came to its end and met nothing
    """

    low: mi.Float
    high: mi.Float
    hit: mi.Bool
    behind: mi.Bool
    completed: mi.Bool
    steps: mi.UInt32


def padded(size: int) -> int:
    """The power of two that is at least `size`."""
    return 1 << max(size - 1, 0).bit_length()


def of_view(world: geometry.Geometry, view: View, radiance: mi.Color3f, reflector: mi.Int32) -> Screen:
    """What a view shows of triangles in world space. Waits for the device, as `raster.rasterize` does."""
    visibility = raster.rasterize(world.points, world.faces, world.face_count, view, cull="back")
    across, down = padded(view.width), padded(view.height)
    levels = max(across, down).bit_length()
    starts, total = [], 0
    for level in range(levels):
        starts.append(total)
        total += max(across >> level, 1) * max(down >> level, 1)
    nearness = _pyramid(world.points, world.faces, visibility, view, across, down, levels)
    return Screen(nearness, mi.UInt32(starts), across, down, levels, radiance, reflector, view.width, view.height)


@frozen
def _pyramid(
    points: mi.Float, faces: mi.UInt32, visibility: mi.UInt32, view: View, across: int, down: int, levels: int
) -> mi.Float:
    """`Screen.nearness`."""
    lane = dr.arange(mi.UInt32, view.width * view.height)
    hit, _, _, p = raster.seen(points, faces, visibility, view, lane)
    nearness = dr.select(hit, dr.rcp(dr.maximum(view.depth + depths.offset(view, p), view.near)), 0)
    texels = [dr.zeros(mi.Float, across * down)]
    row = lane // view.width
    dr.scatter(texels[0], nearness, row * across + lane - row * view.width)
    for level in range(1, levels):
        fine, w, h = max(across >> (level - 1), 1), max(across >> level, 1), max(down >> level, 1)
        own = dr.arange(mi.UInt32, w * h)
        y = own // w
        x = own - y * w
        dx, dy = int(across >> level > 0), int(down >> level > 0)
        first = (y << dy) * fine + (x << dx)
        value = dr.gather(mi.Float, texels[-1], first)
        for step in (dx, dy * fine, dy * fine + dx):
            value = dr.maximum(value, dr.gather(mi.Float, texels[-1], first + step))
        texels.append(value)
    return dr.concat(texels)


def line(view: View, p: mi.Point3f, r: mi.Vector3f, mirror: mi.Int32, pixel: mi.UInt32) -> Line:
    """The ray from p, which `pixel` shows, in the unit direction r."""
    row = pixel // view.width
    x, y = mi.Float(pixel - row * view.width) + 0.5, mi.Float(row) + 0.5
    depth = dr.maximum(view.depth + depths.offset(view, p), view.near)
    xr, yr, wr = (dr.dot(v.xyz, r) for v in (view.x, view.y, view.w))
    away = wr > SIDEWAYS
    clipped = dr.minimum((depth - view.near) / dr.maximum(-wr, 1e-12), FAR * depth)
    t = dr.select(away, 1, clipped)
    w = dr.maximum(dr.select(away, wr, depth + clipped * wr), 1e-30)
    dx = dr.select(away, xr, x * depth + clipped * xr) / w - x
    dy = dr.select(away, yr, y * depth + clipped * yr) / w - y
    extent = dr.maximum(dr.maximum(dr.abs(dx), dr.abs(dy)), POINT)
    per = dr.rcp(extent)
    ax, ay = dx * per, dy * per
    end = extent
    for position, step, size in ((x, ax, view.width), (y, ay, view.height)):
        leave = dr.select(step > 0, size - position, position) / dr.maximum(dr.abs(step), 1e-12)
        end = dr.minimum(end, leave)
    nearness = dr.rcp(depth)
    slope = (dr.select(away, 0, dr.rcp(w)) - nearness) * per
    return Line(x, y, ax, ay, nearness, slope, end, away & (end >= extent), t * per / w, mirror)


def pixel_at(screen: Screen, x: mi.Float, y: mi.Float) -> tuple[mi.UInt32, mi.UInt32]:
    """Column and row of the pixel at (x, y), the nearest of the picture."""
    return (
        mi.UInt32(dr.clip(mi.Int32(dr.floor(x)), 0, screen.width - 1)),
        mi.UInt32(dr.clip(mi.Int32(dr.floor(y)), 0, screen.height - 1)),
    )


def shown(screen: Screen, of: Line, column: mi.UInt32, row: mi.UInt32, active: mi.Bool) -> mi.Float:
    """ν of a pixel, 0 where it shows the mirror that the ray leaves."""
    own = dr.gather(mi.Int32, screen.reflector, row * screen.width + column, active) == of.mirror
    return dr.select(own, 0, dr.gather(mi.Float, screen.nearness, row * screen.across + column, active))


@dataclass
class Surface:
    """What the screen shows between pixels.

    nearness  ν: between the four pixels around where they are one surface, else of the nearest pixel
    edge      they are not: depth jumps, or only some show a mirror
    """

    nearness: mi.Float
    radiance: mi.Color3f
    edge: mi.Bool


def surface(screen: Screen, of: Line, x: mi.Float, y: mi.Float, active: mi.Bool) -> Surface:
    """What is shown at (x, y)."""
    left, top = dr.floor(x - 0.5), dr.floor(y - 0.5)
    fx, fy = x - 0.5 - left, y - 0.5 - top
    nu, L, mirrors = [], [], []
    for j in (0, 1):
        for i in (0, 1):
            column, row = pixel_at(screen, left + i + 0.5, top + j + 0.5)
            nu.append(shown(screen, of, column, row, active))
            L.append(dr.gather(mi.Color3f, screen.radiance, row * screen.width + column, active))
            mirrors.append(dr.gather(mi.Int32, screen.reflector, row * screen.width + column, active))
    nearest, farthest = dr.maximum(*nu[:2]), dr.minimum(*nu[:2])
    edge = mi.Bool(False)
    for k in range(1, 4):
        nearest, farthest = dr.maximum(nearest, nu[k]), dr.minimum(farthest, nu[k])
        edge |= mirrors[k] != mirrors[0]
    edge |= nearest - farthest > JUMP * nearest
    column, row = pixel_at(screen, x, y)
    here = dr.gather(mi.Color3f, screen.radiance, row * screen.width + column, active)
    between = [dr.lerp(dr.lerp(v[0], v[1], fx), dr.lerp(v[2], v[3], fx), fy) for v in (nu, L)]
    return Surface(dr.select(edge, shown(screen, of, column, row, active), between[0]), dr.select(edge, here, between[1]), edge)


def _is_behind(of: Line, a: mi.Float, b: mi.Float, nu: mi.Float, thickness: mi.Float) -> tuple[mi.Bool, mi.Bool]:
    """Whether the ray is behind a pixel with `nu` anywhere between a and b, and whether by no more than the thickness."""
    one, two = of.nu(a), of.nu(b)
    nearest = dr.rcp(dr.maximum(dr.maximum(one, two), 1e-30))
    return dr.minimum(one, two) < nu, nearest - dr.rcp(dr.maximum(nu, 1e-30)) < thickness


@dr.syntax
def _met(screen: Screen, of: Line, a: mi.Float, b: mi.Float, thin: mi.Bool, comes: mi.Bool) -> tuple[mi.Bool, mi.Bool]:
    """Of rays that come to be behind a pixel between a and b: which meet it, and which are still in front at b.

    A surface that goes on from the pixel before is met, however far behind it the ray is soon; across an edge it has to be by
    no more than the thickness. In front at b are those that the surface between pixels does not hold up before.
    """
    hit, front = mi.Bool(False), mi.Bool(False)
    if comes:
        x, y = of.at(b)
        after = surface(screen, of, x, y, comes)
        front = ~after.edge & (after.nearness < of.nu(b))
        x, y = of.at(a)
        hit = ~front & (thin | ~surface(screen, of, x, y, comes).edge)
    return hit, front


@dr.syntax
def linear(screen: Screen, of: Line, thickness: mi.Float, max_steps: mi.UInt32, active: mi.Bool) -> Met:
    """Pixel by pixel along the axis on which the ray is longer.

    thickness  of what pixels show, along the view axis
    """
    k, hit, lost = mi.UInt32(0), mi.Bool(False), mi.Bool(False)
    front = mi.Bool(True)
    low, high = mi.Float(0), mi.Float(0)
    while dr.hint(active & ~hit & (k < max_steps) & (mi.Float(k) < of.end), label="march across the screen"):
        k += 1
        tau = dr.minimum(mi.Float(k), of.end)
        low, high = dr.maximum(tau - 0.5, 0), dr.minimum(tau + 0.5, of.end)
        x, y = of.at(tau)
        column, row = pixel_at(screen, x, y)
        nu = shown(screen, of, column, row, active)
        behind, thin = _is_behind(of, low, high, nu, thickness)
        hit, passes = _met(screen, of, low, high, thin, behind & front)
        front = ~behind | passes
        lost |= behind & ~hit & ~passes
    return Met(low, high, hit, lost, ~hit & (mi.Float(k) >= of.end), k)


@dr.syntax
def hierarchical(screen: Screen, of: Line, thickness: mi.Float, max_steps: mi.UInt32, active: mi.Bool) -> Met:
    """Square by square of a pyramid: up a level where the ray is in front of all of it, down where it may not be.

    max_steps  squares that are looked at
    """
    k, hit, lost, done = mi.UInt32(0), mi.Bool(False), mi.Bool(False), mi.Bool(False)
    front = mi.Bool(True)
    level, tau = mi.UInt32(0), mi.Float(0)
    low, high = mi.Float(0), mi.Float(0)
    while dr.hint(active & ~hit & ~done & (k < max_steps), label="march across the pyramid"):
        k += 1
        x, y = of.at(tau)
        column, row = pixel_at(screen, x, y)
        size = mi.Float(mi.UInt32(1) << level)
        # Where the ray leaves the square.
        high = of.end
        for start, step, cell in ((of.x, of.ax, column), (of.y, of.ay, row)):
            border = (mi.Float(cell >> level) + dr.select(step > 0, mi.Float(1), mi.Float(0))) * size
            leaves = (border - start) / dr.select(dr.abs(step) < 1e-12, 1e-12, step)
            high = dr.minimum(high, dr.select(dr.abs(step) < 1e-12, dr.inf, leaves))
        high = dr.maximum(high, tau)
        first = dr.gather(mi.UInt32, screen.starts, level, active)
        stride = dr.maximum(mi.UInt32(screen.across) >> level, 1)
        nu = dr.gather(mi.Float, screen.nearness, first + (row >> level) * stride + (column >> level), active)
        finest = level == 0
        nu = dr.select(finest, shown(screen, of, column, row, active & finest), nu)
        behind, thin = _is_behind(of, tau, high, nu, thickness)
        hit, passes = _met(screen, of, tau, high, thin, behind & front & finest)
        low = tau
        down = behind & ~finest
        front = dr.select(down, front, ~behind | passes)
        lost |= behind & finest & ~hit & ~passes
        tau = dr.select(down | hit, tau, high + NUDGE)
        done = ~down & ~hit & (tau >= of.end)
        level = dr.select(down, level - 1, dr.select(behind, level, dr.minimum(level + 1, screen.levels - 1)))
    return Met(low, high, hit, lost, done, k)


@dr.syntax
def refined(screen: Screen, of: Line, met: Met, bisections: int) -> tuple[mi.Float, mi.Bool]:
    """τ where the ray meets the surface between pixels, and whether that is closed in. A pixel before `low` it was in front."""
    low, high = dr.maximum(met.low - 1, 0), mi.Float(met.high)
    k = mi.UInt32(0)
    while dr.hint(met.hit & (k < bisections), label="bisection"):
        k += 1
        middle = 0.5 * (low + high)
        x, y = of.at(middle)
        behind = of.nu(middle) < surface(screen, of, x, y, met.hit).nearness
        low, high = dr.select(behind, low, middle), dr.select(behind, middle, high)
    # Both are linear on a plane.
    f = []
    for tau in (low, high):
        x, y = of.at(tau)
        f.append(surface(screen, of, x, y, met.hit).nearness - of.nu(tau))
    rise = f[1] - f[0]
    tau = dr.select(rise > 0, low + (high - low) * dr.clip(-f[0] / dr.select(rise > 0, rise, 1), 0, 1), high)
    x, y = of.at(tau)
    there = surface(screen, of, x, y, met.hit)
    closed = met.hit & ~there.edge & (dr.abs(there.nearness - of.nu(tau)) < CLOSE * there.nearness)
    return dr.select(closed, tau, high), closed  # beyond an edge, what the ray is behind of
