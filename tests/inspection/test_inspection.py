"""`inspect`: what it says of scenes and files whose faults are known."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image
from rich.console import Console
from support.gltf_files import Gltf
from support.mesh_cases import CUBE, TRIANGLES
from typer.testing import CliRunner

from benchharness import cli, inspection
from benchharness.inspection import mirrors, report, trial
from benchharness.scene import Camera, Mesh, Object, Reflector, Scene

SIZE = (96, 64)


def ball(radius: float, at=(0.0, 0.0, 0.0), **look) -> Mesh:
    shape = trimesh.creation.icosphere(subdivisions=3, radius=radius)
    return Mesh(shape.vertices + np.array(at), shape.faces, shape.vertices / radius, **look)


def scene(**changed) -> Scene:
    """A mirror ball between a lamp and the eye, in the dark."""
    camera = Camera((0.0, -5.0, 0.0), (0.0, 0.0, 0.0), 40.0)
    lamp = Object("lamp", ball(0.4, (0, -6, 3), emission=(4, 4, 4)), "light")
    given = {"objects": (lamp,), "reflectors": (Reflector("ball", ball(1.0)),), "camera": lambda time: camera, "frames": 1}
    return Scene(name="dark", **{**given, **changed})


def notes(made: Scene, tmp_path: Path) -> list[str]:
    return [str(note) for note in report.of_scene(made, [], [], SIZE, tmp_path / "picture.png", 16)]


def test_a_mirror_that_sees_nothing_but_a_lamp_is_said_to_be_black(tmp_path):
    seen = mirrors.first_frame(scene(), SIZE, 16)
    (mirror,) = seen.mirrors
    assert mirror.pixels == (seen.number == 0).sum() > 500
    assert mirror.nothing > 0.9 and mirror.black == pytest.approx(mirror.nothing, abs=0.01)
    said = notes(scene(), tmp_path)
    assert any(text.startswith("! mirror ball") and "show nothing at all" in text for text in said)


def test_bright_surroundings_are_something_to_see(tmp_path):
    (mirror,) = mirrors.first_frame(scene(background=(0.5, 0.5, 0.5)), SIZE, 16).mirrors
    assert mirror.nothing == 0.0 and mirror.black < 0.01  # it sees itself at its outline
    assert not any(text.startswith("! mirror") for text in notes(scene(background=(0.5, 0.5, 0.5)), tmp_path))


def test_the_picture_is_the_frame_with_the_mirrors_outlined(tmp_path):
    seen = mirrors.first_frame(scene(background=(0.5, 0.5, 0.5)), SIZE, 16)
    mirrors.save(tmp_path / "picture.png", seen)
    picture = np.asarray(Image.open(tmp_path / "picture.png"))
    outline = (picture == mirrors.OUTLINE).all(axis=2)
    assert outline.any() and not (outline & (seen.number < 0)).any()
    padded = np.pad(seen.number, 1, constant_values=-1)
    around = [padded[1 + i : 65 + i, 1 + j : 97 + j] for i in (-1, 0, 1) for j in (-1, 0, 1)]
    assert np.array_equal(outline, (seen.number == 0) & (np.min(around, axis=0) < 0))
    assert (picture[~outline] == seen.image[~outline]).all()
    assert seen.image.shape == (64, 96, 3)


def test_the_longest_edge_of_a_square_before_the_eye_is_as_long_as_it_is_drawn():
    square = Mesh([[-1, 0, -1], [1, 0, -1], [1, 0, 1], [-1, 0, 1]], [[0, 1, 2], [0, 2, 3]])
    part = Object("square", square, "size")
    focal = 0.5 * SIZE[1] / np.tan(np.radians(20))
    assert report.longest_edge_px(part, scene(), SIZE) == pytest.approx(2 * np.sqrt(2) * focal / 5)
    behind = Object("behind", replace(square, vertices=square.vertices - (0, 20, 0)), "nothing")
    assert report.longest_edge_px(behind, scene(), SIZE) == 0.0


def test_a_floor_of_two_triangles_is_said_to_have_light_at_its_corners_alone(tmp_path):
    floor = Mesh([[-3, -3, -1], [3, -3, -1], [3, 3, -1], [-3, 3, -1]], [[0, 1, 2], [0, 2, 3]])
    made = scene(objects=(*scene().objects, Object("floor", floor, "ground")))
    assert any(text.startswith("! floor: edges of up to") for text in notes(made, tmp_path))
    assert not any(text.startswith("! floor") for text in notes(replace(made, h_max=0.5), tmp_path))


def test_a_scene_far_from_its_origin_and_a_mirror_that_is_tiny_in_it_are_said(tmp_path):
    far = np.array([2e4, 0, 0])
    parts = {
        "objects": tuple(replace(o, mesh=replace(o.mesh, vertices=o.mesh.vertices + far)) for o in scene().objects),
        "reflectors": tuple(replace(r, mesh=replace(r.mesh, vertices=r.mesh.vertices + far)) for r in scene().reflectors),
        "camera": lambda time: Camera((2e4, -5.0, 0.0), (2e4, 0.0, 0.0), 40.0),
    }
    assert any("m from the origin" in text for text in notes(scene(**parts), tmp_path))
    small = replace(scene().reflectors[0], mesh=ball(1e-3))
    said = notes(scene(reflectors=(small,)), tmp_path)
    assert any("are the units those of one file" in text for text in said)
    assert any("of 6,144 pixels" in text or "no mirror is seen" in text for text in said)


def test_where_a_mirror_is_that_is_not_seen():
    made = scene(objects=(Object("floor", ball(4.0), "round"),))

    def said(radius, at):
        return str(report._unseen(Reflector("ball", ball(radius, at)), made, SIZE))

    assert said(1.0, (0, 0, 0)) == "! mirror ball is in the picture, behind something else"
    assert said(0.5, (3.5, 0, 0)) == "! mirror ball is beside the picture"
    assert said(0.5, (0, -9, 0)) == "! mirror ball is behind the eye, outside of the box around all objects"
    assert "100 m long, and all objects together 8: are the units" in said(50.0, (0, 60, 0))


def test_a_mirror_that_is_open_and_bent_is_said_to_be():
    def warned(mirror):
        return any("is open and bent" in str(note) for note in report._part(mirror, scene(), SIZE))

    whole = ball(1.0)
    bowl = replace(whole, faces=whole.faces[whole.vertices[whole.faces].mean(axis=1)[:, 2] < 0])
    sheet = Mesh([[0, 0, 0], [1, 0, 0], [0, 0, 1]], [[0, 1, 2]], [[0, -1, 0]] * 3)
    assert [warned(Reflector("m", mesh)) for mesh in (whole, bowl, sheet)] == [False, True, False]
    assert not warned(Reflector("m", bowl, closed=whole))


@pytest.fixture(scope="module")
def cube(tmp_path_factory) -> Path:
    """A cube of eight shared vertices, without normals, of 1,000 units."""
    path = tmp_path_factory.mktemp("files") / "cube.obj"
    path.write_text(trimesh.exchange.obj.export_obj(trimesh.creation.box(extents=(1000,) * 3), include_normals=False))
    return path


def test_a_file_is_shown_and_mirrored_and_every_method_is_asked(cube, tmp_path):
    out = tmp_path / "out"
    done = CliRunner().invoke(cli.app, ["inspect", str(cube), "--out", str(out), "--size", "96", "64"])
    assert done.exit_code == 0, done.output
    assert "scene cube seen" in done.stdout and "scene cube as a mirror" in done.stdout
    assert "12 triangles" in done.stdout and "closed, fronts outwards" in done.stdout
    assert done.stdout.startswith("  file cube.obj: 12 triangles, 1000 x 1000 x 1000 m large, taken for metres with z up")
    assert "it is 1000 x 1000 x 1000 m large: `unit`, `scale` or `fit` change that" in done.stdout
    assert "ray_traced" in done.stdout.partition("methods that take it")[2]
    assert len(list(out.glob("*.png"))) == 2


def test_a_file_says_how_large_it_is_and_what_its_parts_are_called(tmp_path):
    document = Gltf()
    look = document.material((1, 0.5, 0.25), name="wood", emissiveFactor=[1, 0, 0])
    for name, x in (("left", 0), ("right", 5)):
        mesh = document.mesh({**document.primitive(CUBE, TRIANGLES), "material": look})
        document.node(mesh, name=name, translation=[x, 0, 0], scale=[1, 2, 1])
    said = list(trial.described(trial.read(document.write(tmp_path))))
    # Cubes 2 wide and twice as high, 5 apart.
    assert said[0].startswith("file a.glb: 24 triangles, 7 x 2 x 4 m large, turned from y up to z up")
    assert said[1:] == ["materials: 'wood' (1 0.5 0.25, shines)", "nodes: 'left', 'right'"]


def test_what_cannot_be_run_is_said_with_exit_code_two(tmp_path):
    for text, word in [("v 0 0 0\n", "face"), ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", "9")]:
        path = tmp_path / "bad.obj"
        path.write_text(text)
        done = CliRunner().invoke(cli.app, ["inspect", str(path)])
        assert (done.exit_code, word in done.stderr) == (2, True), done.stderr
    with pytest.raises(ValueError, match="--size"):
        next(inspection.examined(path, tmp_path, (8, 8), Console()))
