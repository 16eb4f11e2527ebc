"""What the mirror's own complexity costs, in time and in error: a scene whose mirrors are replaced by one of many triangles.

Popescu et al. 2006 say that their method is "independent of reflector complexity". Two ways to be complex: a ball of more and
more triangles, which looks the same; and a body with ever deeper hollows of always as many triangles, on which most things
have several reflections, and parts of which it shows in itself. Both fill about as many pixels throughout.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import trimesh

from benchharness.measure import contract, timing
from benchharness.render import reference
from benchharness.scene import Mesh, Reflector, Scene, refined, vertex_normals
from benchharness.speed.stage import Stage, interleaved, method
from benchharness.speed.tessellation import case
from benchharness.study import plugins

SUBDIVISIONS = (2, 3, 4, 5, 6)  # of an icosahedron: 20 * 4^s triangles
HOLLOWS = (0.0, 0.05, 0.1, 0.2, 0.3)  # depth of the dents, relative to the radius
DENTED = 5  # subdivisions of the dented ball
WAVES = 3  # of the dents along each axis

COLUMNS = "shape dents triangles method shade_ms shade_ms_lo shade_ms_hi prepare_ms update_ms flip coverage refused".split()
SAMPLE_COLUMNS = "dents triangles method round ms".split()


def ball(subdivisions: int, dents: float, centre: np.ndarray, radius: float) -> Mesh:
    """A ball r(u) = radius (1 + dents sin(a x) sin(a y) sin(a z)), a = WAVES pi / 2, u = (x, y, z) of unit length."""
    sphere = trimesh.creation.icosphere(subdivisions=subdivisions)
    u = np.asarray(sphere.vertices) / np.linalg.norm(sphere.vertices, axis=1, keepdims=True)
    r = radius * (1 + dents * np.sin(0.5 * np.pi * WAVES * u).prod(axis=1, keepdims=True))
    points, faces = centre + r * u, np.asarray(sphere.faces)
    return Mesh(points, faces, vertex_normals(points, faces) if dents else u)


def scenes(base: Scene) -> list[tuple[str, float, Scene]]:
    """(shape, depth of the dents, scene): `base`, baked, with one mirror in the place of the first one and of its size."""
    first = base.reflectors[0]
    points = first.mesh.transformed(first.pose(0.0)).vertices
    low, high = points.min(axis=0), points.max(axis=0)
    centre, radius = 0.5 * (low + high), 0.5 * float((high - low).max())

    def with_ball(subdivisions: int, dents: float) -> Scene:
        mesh = ball(subdivisions, dents, centre, radius)
        return refined(replace(base, reflectors=(Reflector("ball", mesh, mesh, first.eta, first.k),)))

    smooth = [("triangles", 0.0, with_ball(s, 0.0)) for s in SUBDIVISIONS]
    return smooth + [("dents", dents, with_ball(DENTED, dents)) for dents in HOLLOWS]


def study(base: Scene, size: tuple[int, int], index: int, rounds: int, say: Callable[[str], None]) -> tuple[list, list]:
    """Rows and samples: every installed method on every mirror, in frame `index`. `base`: baked, not refined."""
    methods = [name for name, plugin in plugins.discover("method").items() if plugin.error is None]
    rows: list[dict[str, Any]] = []
    works = {}
    for shape, dents, scene in scenes(base):
        truth = reference.render(scene, scene.time(index), size)
        stage = Stage(scene, size, index)
        triangles = len(scene.reflectors[0].mesh.faces)
        for name in methods:
            say(f"{name}: {triangles} triangles, dents {dents:g}")
            row = {"shape": shape, "dents": dents, "triangles": triangles, "method": name}
            row["refused"] = contract.refusal(method(name), scene)
            rows.append(row)
            if row["refused"] is None:
                kind = method(name)
                errors, works[shape, dents, triangles, name] = case(kind, stage, truth)
                state, row["prepare_ms"] = timing.timed(lambda kind=kind, scene=scene: kind.prepare(scene))
                timing.warm_up(lambda kind=kind, state=state, stage=stage: kind.update(state, stage.frame))
                row["update_ms"] = timing.timed(lambda kind=kind, state=state, stage=stage: kind.update(state, stage.frame))[1]
                row |= errors
    times, _ = interleaved(works, rounds, lambda done: say(f"round {done} of {rounds}"))
    for row in rows:
        if (key := (row["shape"], row["dents"], row["triangles"], row["method"])) in times:
            row["shade_ms"], row["shade_ms_lo"], row["shade_ms_hi"] = timing.median_interval(times[key])
    samples = [
        dict(zip(SAMPLE_COLUMNS, (*key[1:], i, ms), strict=True)) for key, all_ in times.items() for i, ms in enumerate(all_)
    ]
    return rows, samples
