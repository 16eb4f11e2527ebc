"""What comes with the harness has one name in a checkout and another in a wheel, and neither is seen in a result."""

from __future__ import annotations

import subprocess
import sys
import sysconfig
from pathlib import Path

import mitsuba as mi  # noqa: F401  (so that the variant is set)
import pytest

from benchharness.study import identity, plugins, shipped

ROOT = Path(__file__).resolve().parents[2]
METHOD = """
from dataclasses import dataclass
from typing import ClassVar
from benchharness.api import Method
from . import helper

@dataclass(frozen=True)
class Flat(Method):
    paper: ClassVar[str] = "none"
    def prepare(self, scene): return None
    def shade(self, state, frame): return None, state
"""


def clear() -> None:
    for name in [m for m in sys.modules if m.partition(".")[0] in ("methods", "benchharness_methods")]:
        del sys.modules[name]


@pytest.fixture
def installation(tmp_path, monkeypatch):
    """Makes an installation of one method, whose package is called as it is told."""

    def made(package: str) -> Path:
        folder = tmp_path / package / package
        folder.mkdir(parents=True)
        (folder / "__init__.py").touch()
        (folder / "flat.py").write_text(METHOD)
        (folder / "helper.py").write_text("x = 1\n")
        monkeypatch.syspath_prepend(folder.parent)
        monkeypatch.setattr(shipped, "HOME", folder.parent)
        return folder

    kept = {name: module for name, module in sys.modules.items() if name.partition(".")[0] == "methods"}
    clear()
    yield made
    clear()
    sys.modules.update(kept)


@pytest.mark.parametrize("package", ["methods", "benchharness_methods"])
def test_methods_are_found_by_one_name_alone(installation, package):
    folder = installation(package)
    found = plugins.discover("method")
    assert (found["flat"].error, found["flat"].origin) == (None, f"package {package}")
    assert [site.file for site in plugins.sites("method").values() if site.name == "flat"] == [str(folder / "flat.py")]


def test_a_methods_hash_is_the_same_by_either_name(installation):
    hashes = []
    for package in ("methods", "benchharness_methods"):
        folder = installation(package)
        hashes.append(identity.of_method(plugins.discover("method")["flat"].target))
    assert hashes[0] == hashes[1]
    (folder / "helper.py").write_text("x = 2\n")
    assert identity.of_method(plugins.discover("method")["flat"].target) != hashes[0]


@pytest.mark.parametrize("beside", ["", "methods"])
def test_a_checkout_that_is_imported_from_elsewhere_reaches_its_own_packages(tmp_path, beside):
    """As an editable install does, whose finder knows `benchharness`; a folder `methods` of somebody else is no package."""
    (tmp_path / beside).mkdir(exist_ok=True)
    code = f"""if True:
        import importlib.util, sys
        sys.path += [{str(tmp_path)!r}, {sysconfig.get_path("purelib")!r}]
        found = importlib.util.spec_from_file_location("benchharness", {str(ROOT / "benchharness" / "__init__.py")!r})
        sys.modules["benchharness"] = module = importlib.util.module_from_spec(found)
        found.loader.exec_module(module)
        from benchharness.study import plugins
        print(sys.path.count({str(ROOT)!r}), plugins.sites("method")["newton"].file, plugins.sites("scene")["kitchen"].file)
    """
    done = subprocess.run([sys.executable, "-I", "-S", "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ["1", str(ROOT / "methods" / "newton.py"), str(ROOT / "scenes" / "kitchen.py")]
