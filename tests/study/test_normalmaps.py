"""Normal maps of mirrors in tables of files."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from PIL import Image

from benchharness.scene import Scene
from benchharness.study import tablescene

WALL = "v 0 0 0\nv 1 0 0\nv 1 0 1\nv 0 0 1\nvt 0 0\nvt 2 0\nvt 2 1\nvt 0 1\nf 1/1 2/2 3/3 4/4\n"


def built(folder, mesh: str, file: str) -> tuple[Scene, list[str]]:
    trimesh.creation.box().export(folder / "box.obj")
    trimesh.creation.icosphere(subdivisions=1).export(folder / "ball.ply")
    (folder / "wall.obj").write_text(WALL)
    table = {
        "objects": [{"name": "box", "mesh": "box.obj"}],
        "reflectors": [{"name": "wall", "mesh": mesh, "normal_map": file}],
        "camera": {"path": [[0, -4, 0]], "target": [0, 0, 0], "fov_deg": 40},
    }
    return tablescene.built("mine", tablescene.SceneTable.model_validate(table, strict=False), folder, "f.toml: mine")


def test_a_mirror_takes_the_numbers_of_a_picture_for_its_normals(tmp_path):
    numbers = np.array([[[128, 128, 255], [200, 90, 230]], [[10, 128, 127], [0, 255, 128]]], np.uint8)
    Image.fromarray(numbers).save(tmp_path / "waves.png")
    made, notes = built(tmp_path, "wall.obj", "waves.png")
    [mirror] = made.reflectors
    assert mirror.mesh.uv is not None and mirror.normal_map is not None and mirror.normal_map.along == ("repeat", "repeat")
    assert {tuple(uv) for uv in mirror.mesh.uv} == {(0, 0), (2, 0), (2, 1), (0, 1)}
    # As they are, not decoded as colours; what points into the surface is flat, and that is said.
    expected = numbers / 255
    expected[1, 0] = 0.5, 0.5, 1.0
    assert mirror.normal_map.pixels == pytest.approx(expected, abs=1e-6)
    assert any("mirror wall" in note and "1 pixels of waves.png point into the surface" in note for note in notes)


@pytest.mark.parametrize(
    ("mesh", "file", "reason"),
    [
        ("ball.ply", "torn.png", r"reflectors\[0\]\.normal_map is torn\.png, and the mirror's file has no uv.*accepted: "),
        ("wall.obj", "none.png", r"reflectors\[0\]\.normal_map: there is no file .*none\.png; accepted: "),
        ("wall.obj", "torn.png", r"reflectors\[0\]\.normal_map: .*torn\.png cannot be read"),
    ],
)
def test_a_normal_map_without_uv_or_without_a_picture_is_refused_with_its_key(tmp_path, mesh, file, reason):
    (tmp_path / "torn.png").write_bytes(b"no picture")
    with pytest.raises(ValueError, match=reason):
        built(tmp_path, mesh, file)
