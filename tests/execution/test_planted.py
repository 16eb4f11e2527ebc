"""Changes planted in a method or a scene, run for real and compared with the run before: the verdict has the right code."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from benchharness import cli

STUDY = """
[run]
size = [96, 72]
frames = [1]
min_rounds = 2
max_rounds = 2
images = []

[reference]
spp = 4

[scenes.place]
source = "place.py"

[methods.environment_map]
resolution = 32

[methods.mine]
source = "mine.py"
"""

SCENE = """
import numpy as np
from benchharness.scene import Camera, Mesh, Object, Reflector, Scene, subdivided
import trimesh

def ball(radius, centre, steps):
    sphere = trimesh.creation.icosphere(steps, radius)
    return np.asarray(sphere.vertices) + centre, np.asarray(sphere.faces), np.asarray(sphere.vertices) / radius

def place(detail: str = "lean", height: float = 0.0) -> Scene:
    v, f, n = ball(0.4, (1.2, -1.2, 0.3 + height), 3)
    thing = Object("thing", Mesh(v, f, n, radiance=np.abs(n) + 0.1), "something to see")
    v, f, n = ball(0.7, (0.0, 0.0, 0.0), 4)
    mirror = Reflector("mirror", Mesh(v, f, n))
    camera = lambda time: Camera((0.3, -4.0, 0.5 + time), (0.0, 0.0, 0.0), 32.0)
    return Scene("place", (thing,), (mirror,), camera, frames=3, background=(0.3, 0.4, 0.6), detail=detail)
"""

METHOD = '''
"""Rays, and whatever is planted."""
from dataclasses import dataclass, replace

import drjit as dr
import mitsuba as mi

from methods.ray_traced import RayTraced


@dataclass(frozen=True)
class Mine(RayTraced):
    bend: float = 1.0

    def refuses(self, scene):
        return None

    def shade(self, state, frame):
        shown, state = super().shade(state, frame)
        lane = dr.arange(mi.UInt32, dr.width(frame.active))
        L, steps = shown.L * self.bend, dr.select(frame.active, mi.UInt32(30), 0)
        # planted here
        return replace(shown, L=L, counters={**shown.counters, "steps": steps}), state
'''
HERE = "        # planted here\n"

PLANTED = {
    "nothing": ("mine.py", HERE, HERE, 0),
    "one NaN pixel": (
        "mine.py", HERE, "        L.x = dr.select(lane == dr.gather(mi.UInt32, frame.pixels, 99), dr.nan, L.x)\n", 1,
    ),
    "0.5 % wrong pixels": ("mine.py", HERE, "        L = dr.select(lane % 200 == 7, mi.Color3f(1, 0, 1), L)\n", 1),
    "FLIP 3 % of itself larger": ("mine.py", HERE, "        L = L * 1.02\n", 1),
    "one more iteration": ("mine.py", HERE, "        steps += dr.select(frame.active, mi.UInt32(1), 0)\n", 1),
    "changed default": ("mine.py", "bend: float = 1.0", "bend: float = 1.001", 4),
    "renamed": ("study.toml", "[methods.mine]", "[methods.yours]", 3),
    "refuses now": ("mine.py", "        return None\n", "        return 'it is Friday'\n", 1),
    "crashes now": ("mine.py", HERE, "        raise RuntimeError('no such root')\n", 3),
    "aborts now": ("mine.py", HERE, "        import os; os.abort()\n", 3),
    "changed scene": ("place.py", "height: float = 0.0", "height: float = 0.01", 4),
}  # fmt: skip


def command(folder: Path, *arguments: object) -> subprocess.CompletedProcess:
    env = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), "BENCHHARNESS_CACHE": str(folder.parent / "cache")}
    line = [sys.executable, "-P", "-m", "benchharness", *map(str, arguments)]
    return subprocess.run(line, cwd=folder, env=env, capture_output=True, text=True, check=False)


@pytest.fixture(scope="module")
def before(tmp_path_factory):
    folder = tmp_path_factory.mktemp("planted") / "before"
    folder.mkdir()
    for name, text in {"study.toml": STUDY, "place.py": SCENE, "mine.py": METHOD}.items():
        (folder / name).write_text(text)
    done = command(folder, "run", "study.toml", "--out", "run")
    assert done.returncode == 0, done.stderr
    return folder


@pytest.mark.exhaustive
@pytest.mark.parametrize("change", PLANTED)
def test_a_planted_change_has_its_exit_code(before, tmp_path, change):
    file, old, new, code = PLANTED[change]
    folder = before.parent / change.replace(" ", "-").replace("%", "percent")
    folder.mkdir()
    for name in ("study.toml", "place.py", "mine.py"):
        text = (before / name).read_text()
        assert name != file or text.count(old) == 1
        (folder / name).write_text(text.replace(old, new) if name == file else text)
    ran = command(folder, "run", "study.toml", "--out", "run")
    assert (ran.returncode == 0) == (change not in ("one NaN pixel", "crashes now", "aborts now")), ran.stderr
    found = CliRunner().invoke(cli.app, ["compare", str(before / "run"), str(folder / "run")])
    assert found.exit_code == code, found.output
