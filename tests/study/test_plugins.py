"""Discovery: what counts as a method or a scene, what is told about a broken one, and parameters and their sweeps."""

from __future__ import annotations

import sys
from importlib.metadata import EntryPoint
from typing import Annotated, Literal

import annotated_types
import pytest
from pydantic import Field

from benchharness.study import params, plugins

METHOD = """
from dataclasses import dataclass
from typing import ClassVar
from benchharness.api import Method

@dataclass(frozen=True)
class {name}(Method):
    paper: ClassVar[str] = "none"
    size: int = 3

    def prepare(self, scene): return None
    def shade(self, state, frame): return None, state
"""


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A package `methods` and a package `scenes` of our own, in front of the real ones."""
    for name in [m for m in sys.modules if m.partition(".")[0] in ("methods", "scenes")]:
        monkeypatch.delitem(sys.modules, name)
    for name in ("methods", "scenes"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").touch()
    monkeypatch.syspath_prepend(tmp_path)
    yield tmp_path
    for name in [m for m in sys.modules if m.partition(".")[0] in ("methods", "scenes")]:
        del sys.modules[name]


def test_every_module_of_the_package_is_a_method_named_like_its_file(package):
    (package / "methods" / "flat_mirror.py").write_text(METHOD.format(name="AnyName"))
    found = plugins.discover("method")
    assert list(found) == ["flat_mirror"]
    assert found["flat_mirror"].error is None
    assert found["flat_mirror"].target.__name__ == "AnyName"
    assert found["flat_mirror"].file == package / "methods" / "flat_mirror.py"


def test_of_several_classes_the_namesake_of_the_file_is_the_method(package):
    text = METHOD.format(name="Helper") + METHOD.format(name="FlatMirror")
    (package / "methods" / "flat_mirror.py").write_text(text)
    assert plugins.discover("method")["flat_mirror"].target.__name__ == "FlatMirror"


def test_an_imported_class_is_not_the_modules_own_method(package):
    (package / "methods" / "one.py").write_text(METHOD.format(name="One"))
    (package / "methods" / "two.py").write_text("from methods.one import One\n" + METHOD.format(name="Other"))
    assert plugins.discover("method")["two"].target.__name__ == "Other"


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("def (", "SyntaxError"),
        ("import nothing_of_that_name", "nothing_of_that_name"),
        ("raise SystemExit(3)", "SystemExit"),
        ("x = 1", "no method class"),
        (METHOD.format(name="A") + METHOD.format(name="B"), "'Broken'"),
        (METHOD.format(name="A").replace("frozen=True", "frozen=False"), "frozen dataclass"),
    ],
)
def test_a_broken_method_says_why_and_stops_no_other(package, text, reason):
    (package / "methods" / "broken.py").write_text(text)
    (package / "methods" / "whole.py").write_text(METHOD.format(name="Whole"))
    found = plugins.discover("method")
    assert reason in found["broken"].error
    assert found["whole"].error is None
    with pytest.raises(ValueError, match=r"here: broken.*does not load"):
        plugins.find("method", "broken", "here")
    assert plugins.find("method", "whole", "here").target.__name__ == "Whole"


def test_a_scene_module_without_a_builder_of_its_name_is_a_helper(package):
    (package / "scenes" / "shapes.py").write_text("def sphere(): ...")
    (package / "scenes" / "room.py").write_text("def room(): ...")
    assert list(plugins.discover("scene")) == ["room"]
    assert [name for name, site in plugins.sites("scene").items() if site.offers] == ["room"]
    with pytest.raises(ValueError, match=r"here: 'rom' is unknown, did you mean 'room'\?; accepted: room"):
        plugins.find("scene", "rom", "here")
    with pytest.raises(ValueError, match=r"here: scenes.shapes has no builder 'shapes'"):
        plugins.find("scene", "shapes", "here")


def test_entry_points_add_to_the_package_and_a_taken_name_stays_taken(package, monkeypatch):
    (package / "methods" / "one.py").write_text(METHOD.format(name="One"))
    (package / "elsewhere.py").write_text(METHOD.format(name="Far") + METHOD.format(name="Away"))
    entries = [
        EntryPoint("far", "elsewhere:Far", "benchharness.methods"),
        EntryPoint("away", "elsewhere", "benchharness.methods"),
        EntryPoint("one", "elsewhere:Far", "benchharness.methods"),
        EntryPoint("gone", "no_such_module", "benchharness.methods"),
    ]
    monkeypatch.setattr(plugins, "entry_points", lambda group: [e for e in entries if e.group == group])
    found = plugins.discover("method")
    assert found["far"].target.__name__ == "Far"
    assert found["away"].target.__name__ == "Away"
    assert found["one"].target.__name__ == "One"
    assert "taken by package methods" in found["one (entry point elsewhere:Far)"].error
    assert "no_such_module" in found["gone"].error
    sys.modules.pop("elsewhere")


def test_a_path_names_a_file_and_if_need_be_a_class_in_it(tmp_path):
    (tmp_path / "mine.py").write_text(METHOD.format(name="A") + METHOD.format(name="B"))
    plugin = plugins.from_path("method", "mine.py:B", tmp_path, "--plugin")
    assert (plugin.name, plugin.target.__name__) == ("mine", "B")
    with pytest.raises(ValueError, match=r"--plugin: .*mine.py cannot be used.*'Mine'.*A, B"):
        plugins.from_path("method", "mine.py", tmp_path, "--plugin")
    with pytest.raises(ValueError, match=r"there is no file .*mime.py, did you mean 'mine.py'\?"):
        plugins.from_path("method", "mime.py", tmp_path, "--plugin")


def test_a_scene_path_without_its_builder_is_refused(tmp_path):
    (tmp_path / "room.py").write_text("def other(): ...")
    assert plugins.from_path("scene", "room.py:other", tmp_path, "source").target.__name__ == "other"
    with pytest.raises(ValueError, match="no function 'room'"):
        plugins.from_path("scene", "room.py", tmp_path, "source")


def test_the_methods_and_scenes_that_come_with_it_all_load():
    broken = {p.name: p.error for kind in ("method", "scene") for p in plugins.discover(kind).values() if p.error}
    assert broken == {}


def declared(**annotations) -> dict[str, params.Parameter]:
    return {name: params.Parameter(name, kind, params.Parameter.required) for name, kind in annotations.items()}


def test_a_sweep_is_the_product_of_its_lists_with_the_first_key_slowest():
    points = params.sweep({"b": [1, 2], "a": [True, False]}, declared(a=bool, b=int), "f.toml: [methods.m]")
    assert points == [{"a": a, "b": b} for b in (1, 2) for a in (True, False)]


def test_a_list_is_one_value_where_the_annotation_is_a_sequence_and_a_list_of_lists_sweeps():
    kind = declared(a=tuple[float, float])["a"]
    assert kind.choices([1, 2], "k") == [(1.0, 2.0)]
    assert kind.choices([[1, 2], [3, 4]], "k") == [(1.0, 2.0), (3.0, 4.0)]
    with pytest.raises(ValueError, match=r"accepted: \[float, float\]"):
        kind.choices([1, 2, 3], "k")


@pytest.mark.parametrize(
    ("annotation", "given", "accepted"),
    [
        (int, "64", "int"),
        (int, 1.5, "int"),
        (bool, 1, "true or false"),
        (float, "wide", "float"),
        (str, 3, "str"),
        (Literal["sq", "dot"], "dott", '"sq" or "dot"'),
        (Annotated[float, Field(ge=1)], 0.5, "float, at least 1"),
        (Annotated[int, annotated_types.Gt(0)], 0, "int, more than 0"),
        (int | None, "x", "int"),
    ],
)
def test_a_wrong_value_is_refused_with_what_would_be_accepted(annotation, given, accepted):
    with pytest.raises(ValueError, match=r"f\.toml: a") as error:
        declared(a=annotation)["a"].value(given, "f.toml: a")
    assert f"accepted: {accepted} (" in str(error.value)


def test_an_int_is_a_float_and_a_float_stays_one_in_the_canonical_text():
    value = declared(a=float)["a"].value(2, "k")
    assert params.canonical({"b": "sq", "a": value, "c": True}) == "a=2.0; b=sq; c=True"
