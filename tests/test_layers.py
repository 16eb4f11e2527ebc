"""Who may import whom. Arrows point from the end of the flow to its beginning (docs/architecture.md), late imports and imports
by name included, and no arrow has a way back."""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest
from support.rooms import MAY

ROOT = Path(__file__).resolve().parents[1]
FILES = sorted(p for room in ("benchharness", "methods", "scenes") for p in (ROOT / room).rglob("*.py"))


def module(path: Path) -> str:
    return ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")


MODULES = {module(path): path for path in FILES}


def imports(path: Path) -> Iterator[str]:
    """Every module of ours that a file imports, at any depth, or names in a string, as `import_module` and entries do."""
    package = module(path) if path.name == "__init__.py" else module(path).rpartition(".")[0]
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from (known(alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            up = package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
            home = ".".join([*up, *((node.module or "").split(".") if node.module else [])])
            yield from (known(f"{home}.{alias.name}") for alias in node.names)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and node.value.startswith("benchharness."):
            name = node.value.partition(":")[0]
            if name in MODULES:
                yield name


def known(name: str) -> str:
    """The module of ours that `name` is or lies in; empty for others'."""
    while name and name not in MODULES:
        name = name.rpartition(".")[0]
    return name


def room(name: str) -> str:
    """methods, scenes, scenes.stress, or what follows benchharness."""
    first, _, rest = name.partition(".")
    if first == "benchharness":
        return rest.partition(".")[0]
    return "scenes.stress" if rest.partition(".")[0] == "stress" and rest != "stress" else first


def arrows(path: Path) -> set[str]:
    return {name for name in imports(path) if name} - {"benchharness", module(path)}


@pytest.mark.parametrize("name", MODULES)
def test_imports_stay_within_the_layers(name):
    own = room(name)
    if own == "":
        return  # benchharness itself
    for target in sorted(arrows(MODULES[name])):
        allowed = {own, *MAY[own].split()}
        if own == "methods":
            allowed -= {own}  # never each other
        inside = target.partition(".")[2]
        assert target == own or room(target) in allowed or inside in allowed, f"{name} imports {target}"


def test_no_arrow_has_a_way_back():
    graph = {name: arrows(path) for name, path in MODULES.items()}
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        pytest.fail(" -> ".join(error.args[1]))


def test_no_room_is_left_out():
    assert {room(name) for name in MODULES} - {""} == set(MAY)


@pytest.mark.parametrize("room", ["modelling", "tables", "study"])
def test_what_needs_no_device_imports_none(room):
    """At the top of a module; a function that needs one may."""
    for name, path in MODULES.items():
        if name.startswith(f"benchharness.{room}"):
            top = [node for node in ast.parse(path.read_text()).body if isinstance(node, ast.Import | ast.ImportFrom)]
            names = {a.name for n in top if isinstance(n, ast.Import) for a in n.names} | {
                getattr(n, "module", "") for n in top
            }
            assert not {"mitsuba", "drjit"} & {str(n).partition(".")[0] for n in names}, name


def test_no_test_is_imported():
    """What tests share lies in `support`, `oracles` and `catalogue`."""
    for path in (ROOT / "tests").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            assert not [name for name in names if name.rpartition(".")[2].startswith("test_")], path


def test_the_report_never_renders():
    for name, path in MODULES.items():
        if name.startswith("benchharness.report"):
            assert "mitsuba" not in path.read_text().split() and "drjit" not in path.read_text().split(), name


def test_the_contract_is_short_enough_to_read():
    files = ROOT / "benchharness" / "api.py", ROOT / "benchharness" / "kernels" / "types.py"
    assert sum(len(file.read_text().splitlines()) for file in files) < 300


def test_a_circle_and_an_import_by_name_are_seen(tmp_path, monkeypatch):
    """This test's own eyes."""
    (tmp_path / "benchharness").mkdir()
    for name, text in {
        "a": "import benchharness.b",
        "b": "def f():\n    g('benchharness.a:run')",
        "c": "from . import b",
    }.items():
        (tmp_path / "benchharness" / f"{name}.py").write_text(text)
    this = sys.modules[__name__]
    monkeypatch.setattr(this, "ROOT", tmp_path)
    found = {module(path): path for path in (tmp_path / "benchharness").glob("*.py")}
    monkeypatch.setattr(this, "MODULES", found)
    assert {name: arrows(path) for name, path in found.items()} == {
        "benchharness.a": {"benchharness.b"},
        "benchharness.b": {"benchharness.a"},
        "benchharness.c": {"benchharness.b"},
    }
    with pytest.raises(pytest.fail.Exception, match=r"benchharness\.a -> benchharness\.b|benchharness\.b -> benchharness\.a"):
        test_no_arrow_has_a_way_back()
