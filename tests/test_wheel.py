"""A wheel, installed where no checkout is in reach: what it adds to an environment, and that it is enough for a run."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import sysconfig
import venv
import zipfile
from dataclasses import replace
from pathlib import Path

import mitsuba as mi  # noqa: F401  (so that the variant is set)
import pytest

from benchharness import platform
from benchharness.execution import rerun
from benchharness.study import config, plugins
from benchharness.tables import results

ROOT = Path(__file__).resolve().parents[1]
FOLDERS = {"benchharness": "", "methods": "benchharness_", "scenes": "benchharness_", "configs": "benchharness_"}
"""Of the checkout, and what goes before their names in a wheel."""


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """Built from a copy, which has nothing in it that an earlier build left behind."""
    copy = tmp_path_factory.mktemp("source")
    for folder in FOLDERS:
        shutil.copytree(ROOT / folder, copy / folder, ignore=shutil.ignore_patterns("__pycache__"))
    for file in ("pyproject.toml", "setup.py", "README.md", "LICENSE"):
        shutil.copy(ROOT / file, copy)
    command = [sys.executable, "-m", "pip", "wheel", ".", "--no-deps", "--wheel-dir", "dist"]
    done = subprocess.run(command, cwd=copy, capture_output=True, text=True)
    if "No matching distribution found for setuptools" in done.stderr:
        pytest.skip("no package index is in reach, from which the build takes its setuptools")
    assert done.returncode == 0, done.stdout + done.stderr
    (built,) = (copy / "dist").glob("*.whl")
    return built


@pytest.fixture(scope="module")
def installed(wheel, tmp_path_factory):
    """The command in an environment of its own, which has this one's packages but not what is installed in development mode."""
    home = tmp_path_factory.mktemp("environment")
    venv.create(home, symlinks=True)
    python = home / "bin" / "python"
    pip = [sys.executable, "-m", "pip", "--python", str(python), "install", "--quiet", "--no-deps", "--no-index", str(wheel)]
    subprocess.run(pip, check=True)
    (packages,) = (home / "lib").glob("python*/site-packages")
    # A folder that a .pth names is on the path of imports, but its own .pth files, an editable install's, are not read.
    (packages / "packages.pth").write_text("\n".join({sysconfig.get_path("purelib"), sysconfig.get_path("platlib")}))
    return home / "bin" / "benchharness"


@pytest.fixture
def call(installed, tmp_path):
    """Runs a command in an empty folder; returns what it says."""

    def run(*arguments: str) -> str:
        env = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
        llvm = platform.use_llvm()
        env |= {"BENCHHARNESS_CACHE": str(tmp_path / "cache")} | ({"DRJIT_LIBLLVM_PATH": llvm} if llvm else {})
        (tmp_path / "empty").mkdir(exist_ok=True)
        done = subprocess.run(
            [installed, *arguments], cwd=tmp_path / "empty", env=env, capture_output=True, text=True, timeout=600
        )
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    return run


def test_it_leaves_no_name_in_an_environment_that_is_not_ours(wheel):
    names = {name.partition("/")[0] for name in zipfile.ZipFile(wheel).namelist()}
    packages = {name for name in names if not name.endswith(".dist-info")}
    assert packages == {"benchharness", "benchharness_methods", "benchharness_scenes", "benchharness_configs"}
    assert len(names - packages) == 1


def test_it_has_every_module_config_and_template(wheel):
    files = {
        f"{prefix}{path.relative_to(ROOT).as_posix()}"
        for folder, prefix in FOLDERS.items()
        for path in (ROOT / folder).rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }
    packed = {name for name in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in name}
    assert packed == files


def test_what_is_there_is_listed_once_and_whole(call):
    for kind in ("method", "scene"):
        ours = [name for name, plugin in plugins.discover(kind).items() if plugin.error is None]
        said = call("list", f"{kind}s").splitlines()
        assert [line.partition("  ")[0] for line in said if not line.startswith("  ")] == ours
    names = [line.partition("  ")[0] for line in call("list", "configs").splitlines()]
    assert names == sorted(path.stem for path in (ROOT / "configs").glob("*.toml"))


def test_a_checkout_that_is_named_is_imported_from_whatever_is_installed(installed):
    """As `rerun --against CHECKOUT` does."""
    side = replace(rerun.installation(ROOT), python=str(installed.parent / "python"))
    code = "from benchharness.study import plugins; print(plugins.sites('method')['newton'].file)"
    done = subprocess.run([side.python, "-P", "-c", code], env=side.environment(), capture_output=True, text=True, check=True)
    assert Path(done.stdout.strip()) == ROOT / "methods" / "newton.py"


@pytest.mark.exhaustive
def test_a_study_that_comes_with_it_runs_anywhere_under_the_hashes_of_the_checkout(call, tmp_path):
    call("run", "kitchen-quick", "--only", "environment_map", "--out", "out")
    rows = results.read_results(tmp_path / "empty" / "out")
    assert rows and {row["status"] for row in rows} == {"ok"}
    study = config.load(ROOT / "configs" / "kitchen-quick.toml", only=["environment_map"])
    columns = ("config", "config_hash", "method_hash", "scene_hash")
    hashes = [(entry.method_hash, job.facts["scene_hash"]) for entry in study.entries for job in study.jobs]
    expected = {("kitchen-quick", study.config_hash, *pair) for pair in hashes}
    assert {tuple(row[column] for column in columns) for row in rows} == expected
    assert sorted(path.name for path in (tmp_path / "empty").iterdir()) == ["out"]
