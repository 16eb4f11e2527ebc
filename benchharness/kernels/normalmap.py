"""Normal maps on the device: mirrors' normals, turned point by point, in the plane of their uv.

`benchharness.modelling.normalmap` says what the numbers of a map stand for, and what becomes of rays below a triangle. Maps
are kept as the textures of objects are (`kernels.painting`). A scene without has None, and nothing of this is compiled.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import drjit as dr
import mitsuba as mi

from benchharness.kernels import lighting, optics, painting
from benchharness.kernels.types import SceneLike

NO_AREA = 1e-6  # of the product of two sides' lengths in uv: less is the rounding of a line


def maps_of(scene: SceneLike) -> painting.Paint | None:
    """The normal maps of a scene's mirrors; None where there are none."""
    smooth = [(o.mesh, None, None) for o in scene.objects]
    return painting.of_parts([*smooth, *((r.mesh, r.normal_map, None) for r in scene.reflectors)])


def refusal(reflectors: Sequence[Any]) -> str | None:
    """A sentence about the first of named reflectors that has a normal map, for methods that only know the smooth surface; None
    if none has."""
    for reflector in reflectors:
        if reflector.normal_map is not None:
            return (
                f"reflector {reflector.name}: it has a normal map, and images are looked for on the smooth surface; accepted: "
                "mirrors without, or a method that follows the reflected ray of each pixel"
            )
    return None


def tilted(maps: painting.Paint, spot: lighting.Spot, n: mi.Vector3f, active: mi.Bool | bool) -> tuple[mi.Vector3f, mi.Bool]:
    """The mapped unit normals at points of mirrors, and where there is one; elsewhere n.

    n  the smooth ones, unit, outward, in the space of `spot.points`
    """
    window = dr.gather(mi.Vector4u, maps.windows, spot.part, active)
    mapped = active & (window.y > 0)
    c = painting.colour(maps, spot.part, spot.face, spot.weights, mapped)
    corners = (spot.face.x, spot.face.y, spot.face.z)
    p, q = ([dr.gather(mi.Vector4f, values, i, mapped) for i in corners] for values in (spot.points, maps.uv))
    along, across = (p[1] - p[0]).xyz, (p[2] - p[0]).xyz
    a, b = (q[1] - q[0]).xy, (q[2] - q[0]).xy
    area = a.x * b.y - a.y * b.x
    mapped &= dr.abs(area) > NO_AREA * dr.norm(a) * dr.norm(b)

    # Both derivatives times |area|.
    side = dr.sign(area)
    du, dv = side * (b.y * along - a.y * across), side * (a.x * across - b.x * along)
    s = du - dr.dot(n, du) * n
    mapped &= dr.squared_norm(s) > 0
    s = dr.normalize(s)
    t = dr.cross(n, s)
    t = dr.select(dr.dot(t, dv) < 0, -t, t)
    x, y, z = (2 * c[k] - 1 for k in range(3))
    return dr.select(mapped, dr.normalize(x * s + y * t + z * n), n), mapped


def turned(maps: painting.Paint, spot: lighting.Spot, n: mi.Vector3f, v: mi.Vector3f, active: mi.Bool | bool) -> mi.Vector3f:
    """The unit normals that mirrors reflect about, turned to v; the smooth ones where there is no map.

    n  the smooth ones, unit, outward
    v  unit directions to whoever looks, in the space of `spot.points` too
    """
    N, mapped = tilted(maps, spot, n, active)
    a, b, c = (dr.gather(mi.Vector4f, spot.points, i, mapped).xyz for i in (spot.face.x, spot.face.y, spot.face.z))
    N, facet = (dr.select(dr.dot(m, v) < 0, -m, m) for m in (N, dr.normalize(dr.cross(b - a, c - a))))
    r = optics.reflect(v, mi.Normal3f(N))
    height = dr.dot(r, facet)
    halfway = dr.normalize(v + r - 2 * height * facet)
    return dr.select(mapped & (height < 0), halfway, N)
