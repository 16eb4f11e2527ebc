"""The commands of docs/own-files.md, in their order, do what it says, with a file that is no file of ours."""

from __future__ import annotations

import re
import shutil
import tomllib
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pandas as pd
import trimesh
from PIL import Image
from support.tiers import exhaustive
from typer.testing import CliRunner

import benchharness
from benchharness import cli
from benchharness.study import run, scenes

PAGE = Path(benchharness.__file__).parents[1] / "docs" / "own-files.md"


def commands() -> list[list[str]]:
    return [line.split()[1:] for line in re.findall(r"^    (benchharness .*)$", PAGE.read_text(), re.MULTILINE)]


def blocks() -> list[str]:
    """The page's study, and further scenes."""
    return re.findall(r"```toml\n(.*?)```", PAGE.read_text(), re.DOTALL)


def files(folder: Path) -> None:
    """A textured box as GLB, a floor as OBJ, a ball as PLY, the gallery's files, and the page's own study."""
    shutil.copytree(PAGE.parents[1] / "configs" / "gallery", folder / "gallery")
    box = trimesh.creation.box(extents=(0.4, 0.6, 1.0))
    corners = box.vertices[box.faces].reshape(-1, 3)
    picture = Image.fromarray(np.kron([[0, 1], [1, 0]], np.full((8, 8), 255)).astype(np.uint8)).convert("RGB")
    material = trimesh.visual.material.PBRMaterial(baseColorTexture=picture, baseColorFactor=[255, 200, 150, 255])
    look = trimesh.visual.TextureVisuals(uv=corners[:, :2] + 0.5, material=material)
    trimesh.Trimesh(corners, np.arange(36).reshape(-1, 3), visual=look, process=False).export(folder / "chair.glb")
    trimesh.creation.icosphere(subdivisions=4).export(folder / "ball.ply")
    (folder / "floor.obj").write_text("v -3 -3 0\nv 3 -3 0\nv 3 3 0\nv -3 3 0\nf 1 2 3 4\n")
    (folder / "mine.toml").write_text(blocks()[0])


def test_the_page_has_the_commands_that_are_run_here():
    assert [command[0] for command in commands()] == ["inspect", "inspect", "run", "inspect"]


def test_further_scenes_of_the_page_can_be_rendered(tmp_path):
    files(tmp_path)
    found = {name: table for block in blocks()[1:] for name, table in tomllib.loads(block)["scenes"].items()}
    assert list(found) == ["room", "rolling", "ride"]
    for name, table in found.items():
        spec = scenes.SceneSpec(name, name, None, True, table, str(tmp_path), f"mine.toml: [scenes.{name}]")
        said = scenes.examined(asdict(spec), asdict(run.Run()), "mine.toml")
        assert said["frames"] and not any("left out" in note or "see `frames`" in note for note in said["notes"]), said["notes"]


@exhaustive
def test_a_file_becomes_a_row_of_every_method(tmp_path, monkeypatch):
    files(tmp_path)
    monkeypatch.chdir(tmp_path)
    said = []
    for command in commands():
        done = CliRunner().invoke(cli.app, command)
        assert done.exit_code == 0, done.output
        said.append(done.stdout)
    assert "12 triangles" in said[0] and "closed, fronts outwards" in said[0] and "as a mirror" in said[0]
    assert "mirror ball" in said[1] and "object chair" in said[1]
    assert "object ride/carousel/red" in said[3] and "mirror ball" in said[3]
    report = Path(said[2].splitlines()[-1])
    assert report.name == "report.html"
    rows = pd.read_csv(report.parent / "results.csv")
    assert (rows["status"] == "ok").all() and len(rows) == 4
    by = rows.set_index(rows["method"] + rows["params"].str.contains("resolve=ray").map({True: " ray", False: ""}))["flip"]
    assert by["ray_traced"] < 0.005 and by["newton ray"] < 0.02 and by["environment_map"] > by["newton ray"]
