"""`benchharness needs` as a user has it: own scenes, own methods with knobs, what is wrong in them, and the page."""

from __future__ import annotations

import re

import pytest
from support.study import machine
from typer.testing import CliRunner

from benchharness import cli
from benchharness.api import Knob
from benchharness.needs import cases, measuring
from benchharness.needs import study as needs
from benchharness.report import needs as page
from benchharness.study import plugins
from benchharness.tables import files
from benchharness.tables.needs import KNEE_KINDS, NEEDS, NEEDS_OBJECTS, NEEDS_SAMPLES, OBJECT_KINDS, SAMPLE_KINDS

SCENE = """
import numpy as np
from benchharness.scene import Camera, Mesh, Object, Reflector, Scene

V = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
F = np.array([[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4],
              [1, 5, 7], [1, 7, 3]])

def room() -> Scene:
    ball = lambda n: (np.array([[np.sin(a) * np.cos(b), np.sin(a) * np.sin(b), np.cos(a)]
                                for a in np.linspace(0, np.pi, n) for b in np.linspace(0, 2 * np.pi, 2 * n, endpoint=False)]))
    n = 24
    quads = [(i * 2 * n + j, (i + 1) * 2 * n + j, (i + 1) * 2 * n + (j + 1) % (2 * n), i * 2 * n + (j + 1) % (2 * n))
             for i in range(n - 1) for j in range(2 * n)]
    faces = np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])
    v = ball(n)
    walls = Mesh(3 * V, F[:, ::-1], radiance=0.5 + 0.4 * np.sin(2 * V + [0, 1, 2]))
    camera = Camera((0.2, -2.6, 0.4), (0.0, 0.0, 0.0), 40.0)
    return Scene("room", (Object("walls", walls, "light all around"),), (Reflector("ball", Mesh(0.8 * v, faces, v)),),
                 lambda time: camera, 2)
"""
METHOD = """
from dataclasses import dataclass
from typing import ClassVar
import drjit as dr
import mitsuba as mi
from benchharness.api import Knob, Method, Reflection

@dataclass(frozen=True)
class Grey(Method):
    paper: ClassVar[str] = "none"
    knobs: ClassVar[tuple[Knob, ...]] = (Knob(KNOB, VALUES),)
    level: float = 0.0

    def __post_init__(self):
        if self.level > 9: raise ValueError("level is too high; accepted: up to 9")

    def refuses(self, scene):
        return "level 3 is not for rooms" if self.level == 3 else None

    def prepare(self, scene):
        if self.level == 4: raise SystemExit("level 4 goes home")
        return dr.opaque(mi.Float, self.level)

    def shade(self, state, frame):
        L = mi.Color3f(dr.full(mi.Float, 0, dr.width(frame.active))) + state
        return Reflection(L, dr.full(mi.Float, 1.0, dr.width(frame.active)), mi.Bool(frame.active)), state
"""
CONFIG = """
[run]
size = [96, 72]
frames = 1

[scenes.room]
source = "room.py"

[methods.grey]
source = "grey.py"
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "room.py").write_text(SCENE)
    (tmp_path / "study.toml").write_text(CONFIG)
    return tmp_path


def knob(folder, name: str = '"level"', values: str = "(0.0, 0.5, 1.0)") -> None:
    (folder / "grey.py").write_text(METHOD.replace("KNOB", name).replace("VALUES", values))


def asked(*words: str):
    return CliRunner().invoke(cli.app, ["needs", "--config", "study.toml", "--out", "out", *words])


def few_models(monkeypatch, *knobs: Knob) -> None:
    """Newton's method with these knobs, and fewer lengths of edges: each model is recorded and compiled for itself."""
    monkeypatch.setattr(plugins.discover("method")["newton"].target, "knobs", knobs)
    monkeypatch.setattr(cases, "SHARES", (10, 80))


def test_a_users_method_and_scene_get_their_knee_and_their_sentence(folder):
    knob(folder, values="(1.0, 0.7, 0.5, 0.505, 0.5)")
    result = asked()
    assert result.exit_code == 0, result.output
    samples = files.read(folder / "out" / NEEDS_SAMPLES, SAMPLE_KINDS, required=["value"])
    assert [row["value"] for row in samples] == ["1", "0.7", "0.5", "0.505", "0.5"]
    assert all(row["status"] == "ok" and row["flip_lo"] <= row["flip"] <= row["flip_hi"] for row in samples)
    assert samples[0]["flip"] > samples[1]["flip"] > samples[2]["flip"] == samples[4]["flip"]
    [row] = files.read(folder / "out" / NEEDS, KNEE_KINDS, required=["knee"])
    assert (row["least"], row["knee"], row["most"]) == ("1", "0.5", "0.5")
    assert row["knee_searched"] is None
    told = (folder / "out" / "needs.html").read_text()
    assert re.search(r"grey: level: 0\.5 is enough, FLIP 0\.\d{4} in \d+\.\d ms", told)
    assert len(list((folder / "out").glob("grey*level*.png"))) == 1


def test_vertex_methods_search_more_the_smaller_the_error_asked_for_and_split_edges_are_a_knob_of_the_scene(
    folder, monkeypatch
):
    few_models(monkeypatch, Knob("split_px", (16.0, 1.0, 0.25)))
    (folder / "study.toml").write_text(CONFIG.replace('[methods.grey]\nsource = "grey.py"', "[methods.newton]"))
    result = asked()
    assert result.exit_code == 0, result.output
    samples = files.read(folder / "out" / NEEDS_SAMPLES, SAMPLE_KINDS, required=["value"])
    split = [row for row in samples if row["knob"] == "split_px" and not row["given"]]
    assert [row["searched"] for row in split] == sorted(row["searched"] for row in split)
    assert split[-1]["flip"] < 0.2 * split[0]["flip"]
    edges = [row for row in samples if row["knob"] == "longest edge"]
    assert edges[0]["value"] == "as built" and [r["vertices"] for r in edges] == sorted(r["vertices"] for r in edges)
    assert split[-1]["searched"] < edges[1]["searched"] and split[-1]["flip"] < 0.05 * edges[0]["flip"]


OBJECTS = """
    box = lambda half, at, colour: Mesh(half * V + np.array(at), F, radiance=np.array(colour, float))
    things = (Object("walls", walls, "light all around"), Object("screen", box(0.7, (-0.4, -2.2, 1.6), (3, 0, 0)), "red"),
              Object("core", box(0.2, (0, 0, 0), (0, 3, 0)), "within the mirror"))
    return Scene("room", things, (Reflector("ball", Mesh(0.8 * v, faces, v)),), lambda time: camera, 2)
"""


def test_objects_that_mirrors_show_judge_and_those_that_none_shows_are_needed_for_nothing(folder, monkeypatch):
    few_models(monkeypatch)
    (folder / "room.py").write_text(SCENE[: SCENE.index("    return Scene")] + OBJECTS)
    knob(folder)
    (folder / "study.toml").write_text(CONFIG + "\n[methods.newton]\n")
    result = asked("--only", "grey", "--only", "newton")
    assert result.exit_code == 0, result.output
    rows = files.read(folder / "out" / NEEDS_OBJECTS, OBJECT_KINDS, required=["verdict"])
    told = {row["object"]: row for row in rows}
    assert list(told) == ["walls", "screen", "core"]
    assert told["walls"]["verdict"] == "judges" and told["walls"]["change"] > 1
    assert told["screen"]["verdict"] in ("judges", "seen") and told["screen"]["lost"] > 0.01
    assert (told["core"]["verdict"], told["core"]["lost"], told["core"]["enough_vertices"]) == ("nothing", 0.0, 0)
    assert told["walls"]["judge"] == "newton" and told["walls"]["enough"] == "1"  # of twelve triangles there are no fewer
    page_text = (folder / "out" / "needs.html").read_text()
    assert "1 of 3 are needed for nothing that mirrors show: core." in page_text
    assert "Of 24 vertices of objects 16 are enough" in page_text


def test_one_object_has_nothing_to_be_left_out_of(folder):
    knob(folder)
    assert asked().exit_code == 0
    [row] = files.read(folder / "out" / NEEDS_OBJECTS, OBJECT_KINDS, required=["verdict"])
    assert row["verdict"] == "alone" and row["change"] is None


def test_what_a_method_refuses_or_fails_in_is_told_and_left_out_of_the_knee(folder):
    knob(folder, values="(1.0, 3.0, 4.0, 0.5)")
    assert asked().exit_code == 0
    samples = files.read(folder / "out" / NEEDS_SAMPLES, SAMPLE_KINDS, required=["value"])
    assert [row["status"] for row in samples] == ["ok", "refused", "crashed", "ok"]
    assert samples[1]["reason"] == "level 3 is not for rooms" and "level 4 goes home" in samples[2]["reason"]
    assert "level 3 is not for rooms" in (folder / "out" / "needs.html").read_text()


@pytest.mark.parametrize(
    ("name", "values", "words", "message"),
    [
        ('"level"', "(0.0, 10.0)", (), "grey: a knob is level=10: level is too high; accepted: up to 9"),
        ('"lever"', "(0.0, 1.0)", (), "grey: a knob is lever=0"),
        ('"level"', "(0.0, 1.0)", ("hall",), "needs: scene 'hall'"),
    ],
)
def test_bad_input_is_named(folder, name, values, words, message):
    knob(folder, name, values)
    result = asked(*words)
    assert result.exit_code == 2
    assert message in " ".join(result.output.split())


def test_a_folder_in_use_is_left_alone(folder):
    knob(folder)
    (folder / "out").mkdir()
    (folder / "out" / "mine.txt").write_text("mine")
    result = asked()
    assert result.exit_code == 2 and "in use" in result.output
    assert [f.name for f in (folder / "out").iterdir()] == ["mine.txt"]


def test_the_machine_is_held_while_frames_are_timed_and_free_while_light_and_references_are_made(folder, monkeypatch):
    seen = set()

    def noted(module, name):
        function = getattr(module, name)
        monkeypatch.setattr(module, name, lambda *args: seen.add((name, machine())) or function(*args))

    noted(needs, "lit")
    noted(measuring.reference, "render")
    noted(measuring, "_frame_ms")
    knob(folder)
    result = asked()
    assert result.exit_code == 0, result.output
    assert seen == {("lit", "free"), ("render", "free"), ("_frame_ms", "held")}


# What the page says


def row(**more):
    base = {"method": "box", "knob": "texels", "given": "", "least": "8", "least_flip": 0.5, "knee": "32", "knee_flip": 0.1}
    return {**base, "knee_frame_ms": 4.0, "most": "128", "most_flip": 0.099, "most_frame_ms": 9.0, **more}


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({}, "box: texels: 32 is enough, FLIP 0.1000 in 4.0 ms; up to 128 nothing is gained; 8 would leave 0.5000."),
        ({"given": "mip=1", "most_flip": 0.05},
         "box: texels (with mip=1): 32 is enough, FLIP 0.1000 in 4.0 ms; 128 leaves 0.0500 in 9.0 ms; 8 would leave 0.5000."),
        ({"knee": "128"}, "it is the largest that was tried, and there may be more to gain; 8 would leave 0.5000."),
        ({"knee": "8"}, "8 is enough, FLIP 0.1000 in 4.0 ms, the smallest that was tried; up to 128 nothing is gained."),
    ],
)  # fmt: skip
def test_sentences(more, said):
    assert page.sentence(row(**more)).endswith(said)


def test_tables_without_rows_have_no_page(tmp_path):
    files.write(tmp_path / NEEDS, [], ["scene", *KNEE_KINDS])
    with pytest.raises(ValueError):
        page.write(tmp_path)
