"""A library that is called like LLVM and is none, where Dr.Jit looks first: no command of ours loads it."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
from pathlib import Path

import pytest

from benchharness import platform
from benchharness.study import template

pytestmark = pytest.mark.skipif(platform.bundled_llvm() is None, reason="this environment has no LLVM of its own")

ROOM = """
from benchharness.execution import tiny
from benchharness.scene import Scene

def room() -> Scene:
    return tiny.scene()
"""
LOADED = """
import {module}
import mitsuba as mi
mi.set_variant("llvm_ad_rgb")
mi.Float(1.0)
print([line.split()[-1] for line in open("/proc/self/maps") if "libLLVM" in line][0])
"""


@pytest.fixture(scope="module")
def surroundings(tmp_path_factory):
    """The environment of a user who has the decoy, and has not named an LLVM."""
    folder = tmp_path_factory.mktemp("decoy")
    (folder / "lib").mkdir()
    spec = importlib.util.find_spec("drjit")
    assert spec is not None and spec.origin is not None
    (folder / "lib" / "libLLVM.so").symlink_to(Path(spec.origin).parent / "libnanothread.so")
    env = {k: v for k, v in os.environ.items() if k != "DRJIT_LIBLLVM_PATH"}
    path = os.pathsep.join([str(Path(__file__).parents[2]), *sys.path])
    return env | {
        "LD_LIBRARY_PATH": str(folder / "lib"), "PYTHONPATH": path, "BENCHHARNESS_CACHE": str(folder / "cache")
    }  # fmt: skip


def python(surroundings: dict[str, str], *arguments: object) -> subprocess.CompletedProcess:
    command = [sys.executable, *(str(argument) for argument in arguments)]
    return subprocess.run(command, capture_output=True, text=True, env=surroundings)


def command(surroundings: dict[str, str], *arguments: object) -> str:
    done = python(surroundings, "-m", "benchharness", *arguments)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_the_decoy_is_what_dr_jit_takes_where_nobody_says_otherwise(surroundings):
    done = python(surroundings, "-c", LOADED.format(module="drjit"))
    assert done.returncode != 0


@pytest.mark.parametrize(
    "module",
    [
        "benchharness.api",
        "methods.newton",
        *(pytest.param(name, marks=pytest.mark.claims) for name in ("scenes.kitchen", "benchharness.speed.stage")),
    ],
)
def test_whichever_module_is_first_the_wheels_llvm_is_loaded(surroundings, module):
    done = python(surroundings, "-c", LOADED.format(module=module))
    assert done.returncode == 0, done.stderr
    loaded = platform.bundled_llvm()
    assert loaded is not None and Path(done.stdout.strip()).samefile(loaded)


def test_importing_the_package_is_quick(surroundings):
    code = "import sys; before = set(sys.modules); import benchharness; print(*sorted(set(sys.modules) - before))"
    seen = python(surroundings, "-c", code).stdout.split()
    assert not {name for name in seen if name.partition(".")[0] in ("drjit", "mitsuba", "numpy", "pydantic", "scipy")}


@pytest.mark.claims
def test_check_method_works_beside_a_decoy(surroundings, tmp_path):
    path = template.new_method("sky", tmp_path)
    done = python(surroundings, "-m", "benchharness", "check-method", path)
    levels = {line.partition("  ")[0] for line in done.stdout.splitlines()}
    assert "signal" not in done.stdout
    assert "fail" not in levels and done.returncode == 0, done.stdout + done.stderr


@pytest.mark.claims
def test_doctor_works_beside_a_decoy_and_tries_all_that_a_study_needs(surroundings):
    said = command(surroundings, "doctor")
    assert "llvm_ad_rgb: works: a kernel and a picture came out right (mitsuba" in said
    assert f"LLVM at {platform.bundled_llvm()})" in said
    assert "cuda_ad_rgb: " in said
    for part in ("scalar_rgb", "method", "cache", "lock"):
        assert f"{part}: works: " in said


@pytest.mark.claims
def test_list_works_beside_a_decoy(surroundings):
    said = command(surroundings, "list")
    assert "BROKEN" not in said
    assert "ray_traced" in said and "kitchen" in said


@pytest.mark.claims
def test_a_run_works_beside_a_decoy(surroundings, tmp_path):
    (tmp_path / "room.py").write_text(ROOM)
    template.new_method("sky", tmp_path)
    config = tmp_path / "small.toml"
    config.write_text(
        "[run]\nframes = 1\nsize = [48, 32]\nmin_rounds = 1\nmax_rounds = 1\n"
        '[reference]\nspp = 2\nbake_spp = 1\n[scenes.room]\nsource = "room.py"\n[methods.sky]\nsource = "sky.py"\n'
    )
    said = command(surroundings, "run", config, "--out", tmp_path / "out")
    assert "frame 0: 1 ok" in said


@pytest.mark.claims
def test_the_stability_suite_works_beside_a_decoy(surroundings, tmp_path):
    arguments = ["--only", "ray_traced", "--regime", "contact", "--severity", "1", "--out", tmp_path / "out"]
    assert "contact: 1" in command(surroundings, "stability", *arguments)
