"""Who may import whom. Arrows point one way: see the README."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
FILES = sorted(p for room in ("benchharness", "methods", "scenes") for p in (ROOT / room).rglob("*.py"))


def imports(path: Path) -> set[str]:
    """Every module that a file imports, at any depth, full names; `from a import b` counts as a and a.b."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            names |= {node.module or ""} | {f"{node.module}.{alias.name}" for alias in node.names}
    return names


def ours(path: Path) -> set[str]:
    return {n for n in imports(path) if n.split(".")[0] in ("benchharness", "methods", "scenes")} - {"benchharness"}


def within(names: set[str], *allowed: str) -> bool:
    return all(any(n == a or n.startswith(a + ".") for a in allowed) for n in names)


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(ROOT)))
def test_imports_stay_within_the_layers(path):
    room = path.relative_to(ROOT).parts
    names = ours(path)
    if room[0] == "methods":
        assert within(names, "benchharness.api", "benchharness.scene", "benchharness.kernels")
    elif room[0] == "scenes":
        stress = ["benchharness.regime", "benchharness.completeness"] if room[1] == "stress" else []
        assert within(names, "benchharness.scene", "scenes", *stress)
    elif room[1] == "kernels":
        assert within(names, "benchharness.kernels")
    else:
        assert not any(n.split(".")[0] in ("methods", "scenes") for n in names)
    if room[:2] in (("benchharness", "api.py"), ("benchharness", "scene.py")):
        # The scene model asks `enclosure` late: who reads it without a device needs none.
        assert within(names, *(f"benchharness.{name}" for name in ("scene", "panorama", "subdivision", "enclosure")))
    if room[:2] in tuple(("benchharness", f"{name}.py") for name in ("panorama", "subdivision", "winding")):
        assert not names
    if room[:2] in (("benchharness", "normalisation.py"), ("benchharness", "orientation.py"), ("benchharness", "creases.py")):
        assert within(names, "benchharness.scene", "benchharness.winding")
    if room[:2] == ("benchharness", "regime.py"):
        assert within(names, "benchharness.scene")
    if room[:2] in (("benchharness", "frame.py"), ("benchharness", "bake.py"), ("benchharness", "reference.py")):
        allowed = ("api", "scene", "kernels", "cache", "mitsuba_scene", "bake", "normalisation")
        assert within(names, *(f"benchharness.{name}" for name in allowed))
    if room[:2] == ("benchharness", "report"):
        assert not any(n.split(".")[0] in ("mitsuba", "drjit") for n in imports(path))
        assert within(names, "benchharness.report", "benchharness.results", "benchharness.stability.tables")


def test_no_method_imports_another():
    for path in (ROOT / "methods").glob("*.py"):
        assert not any(n.startswith("methods") for n in ours(path)), path


def test_the_contract_is_short_enough_to_read():
    assert len((ROOT / "benchharness" / "api.py").read_text().splitlines()) < 170
