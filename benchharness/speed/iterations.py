"""How many steps a reflection point takes, and where on the mirror the long searches are.

A histogram over vertices and a picture per case, as figure 3 (c) of Roger and Holzschuch 2006 has one: every pixel of the
mirror shows the iterations of the vertices around what it reflects. Their text claims 5 to 10 in most cases and up to 20
near the mirror's outline, for searches that begin anew in every frame.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from benchharness.api import Reflection
from benchharness.kernels import packets
from benchharness.kernels.vertices import problems, scenery, virtual
from benchharness.scene import Scene
from benchharness.speed.stage import Stage
from benchharness.study import plugins

CASES: tuple[tuple[str, str, dict[str, Any]], ...] = (
    (
        "Roger and Holzschuch, cold",
        "secant_triangle",
        {"start": "paper", "stop": "area", "tau": 0.5, "newton": "off", "warm": False, "hidden": "drop"},
    ),
    (
        "the same until the longest edge is a pixel",
        "secant_triangle",
        {"start": "paper", "newton": "off", "warm": False, "hidden": "drop"},
    ),
    ("secant_triangle, cold", "secant_triangle", {"warm": False}),
    ("secant_triangle, warm", "secant_triangle", {}),
    ("newton, cold", "newton", {"warm": False}),
    ("newton, warm", "newton", {}),
    ("Estalella et al., cold", "image_space_search", {"start": "centre", "warm": "off"}),
    ("image_space_search, warm", "image_space_search", {}),
)
"""Name, method, its parameters."""

COLUMNS = "case method vertices mean median p95 max at_most_5 at_most_10 at_most_20".split()
STEP_COLUMNS = "case iterations vertices".split()
"""How many vertices took how many iterations."""


@dataclass
class Case:
    """`iterations` of the vertices that were searched [N]; `picture` [H, W], NaN where no mirror shows anything."""

    name: str
    method: str
    iterations: np.ndarray
    picture: np.ndarray

    def row(self) -> dict[str, Any]:
        """The row of COLUMNS."""
        n = self.iterations
        shares = {f"at_most_{k}": float((n <= k).mean()) for k in (5, 10, 20)}
        quantiles = {"median": float(np.median(n)), "p95": float(np.quantile(n, 0.95)), "max": int(n.max())}
        return {"case": self.name, "method": self.method, "vertices": len(n), "mean": float(n.mean()), **quantiles, **shares}

    def steps(self) -> list[dict[str, Any]]:
        """Rows of STEP_COLUMNS."""
        counts = zip(*np.unique(self.iterations, return_counts=True), strict=True)
        return [{"case": self.name, "iterations": steps, "vertices": count} for steps, count in counts]


def study(scene: Scene, size: tuple[int, int], index: int, say: Callable[[str], None]) -> list[Case]:
    """All cases on frame `index` of a baked and refined scene."""
    stage, found = Stage(scene, size, index), []
    for name, method, params in CASES:
        say(name)
        kind = plugins.find("method", method, "speed").target(**params)
        reflection, _ = kind.shade(stage.warmed(kind), stage.frame)
        assert reflection.vertices is not None
        iterations = np.array(reflection.vertices.iterations)
        found.append(Case(name, method, iterations[iterations > 0], _picture(stage, reflection)))
    return found


def _picture(stage: Stage, reflection: Reflection) -> np.ndarray:
    """The iterations of the reflected vertices, drawn where the mirrors show them; float [H, W]."""
    scene, frame, vertices = stage.scene, stage.frame, reflection.vertices
    assert vertices is not None
    seen = scenery.posed(scenery.of_scene(scene, []), frame)
    count = seen.triangles.vertex_count
    total, covered = mi.Float(0), mi.Bool(False)
    for i in range(len(scene.reflectors)):
        lane = dr.arange(mi.UInt32, count)
        there = lane + i * count
        kind, _ = problems.kinds(dr.gather(mi.UInt32, vertices.region, there) == problems.REFLECTED, mi.Bool(False))
        images = virtual.Images(
            packets.joined(dr.gather(mi.Point3f, vertices.virtual, there), kind, count),
            packets.joined(dr.gather(mi.Point3f, vertices.R, there), mi.Float(0), count),
        )
        steps = mi.Float(dr.gather(mi.UInt32, vertices.iterations, there))
        light = packets.joined(mi.Point3f(steps), mi.Float(0), count)
        part = dr.opaque(mi.UInt32, seen.objects + i)
        world = replace(seen.world, attributes=light, shine=None, paint=None)
        target = virtual.Target(frame.view, frame.p, frame.reflector == i)
        drawing = virtual.Drawing("drop")
        drawn = virtual.interpolated(virtual.nearest(images, world, part, target, drawing), target, drawing.depth)
        total, covered = total + drawn.L.x, covered | drawn.covered
    return np.where(np.array(covered), np.array(total), np.nan).reshape(stage.size[1], stage.size[0])
