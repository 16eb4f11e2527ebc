"""The gallery: scenes of files that a script writes, which run, and move as the files say."""

from __future__ import annotations

import importlib.util
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
from support.tiers import complete, exhaustive

from benchharness.measure.bench import Bench
from benchharness.render.reference import ReferenceOptions
from benchharness.scene import Scene
from benchharness.study import plugins, scenes

CONFIGS = Path(__file__).parents[2] / "configs"
GALLERY = {path.stem: tomllib.loads(path.read_text()) for path in sorted(CONFIGS.glob("gallery-*.toml"))}
SIZE = (96, 68)


def built(name: str) -> tuple[Scene, list[str]]:
    """The scene of a config of the gallery, and what is said of it."""
    ((scene, table),) = GALLERY[name]["scenes"].items()
    return scenes.SceneSpec(scene, scene, None, True, table, str(CONFIGS), f"{name}.toml: [scenes.{scene}]").built()


def test_the_script_writes_its_files_to_the_last_byte_and_they_are_small(monkeypatch):
    spec = importlib.util.spec_from_file_location("gallery_make", CONFIGS / "gallery" / "make.py")
    assert spec is not None and spec.loader is not None
    make = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, "gallery_make", make)  # where dataclasses look for it
    spec.loader.exec_module(make)
    files = make.files()
    there = {p.name: p.read_bytes() for p in (CONFIGS / "gallery").iterdir() if p.is_file() and p.name != "make.py"}
    assert set(files) == set(there)
    assert [name for name in files if files[name] != there[name]] == []
    assert sum(map(len, files.values())) < 300_000


def test_there_are_three_and_nothing_in_them_had_to_be_mended():
    assert list(GALLERY) == ["gallery-carousel", "gallery-room", "gallery-yard"]
    for name in GALLERY:
        assert built(name)[1] == [], name


@pytest.mark.parametrize("name", GALLERY)
@pytest.mark.parametrize("methods", [("ray_traced", "environment_map"), pytest.param(None, marks=(exhaustive, complete))])
def test_a_scene_of_the_gallery_runs(name, methods):
    scene, _ = built(name)
    chosen = methods or tuple(GALLERY[name]["methods"])
    assert set(chosen) <= set(GALLERY[name]["methods"])
    bench = Bench(scene, SIZE, ReferenceOptions(spp=2, bake_spp=8), None, 0, (1, 1))
    made = {method: plugins.discover("method")[method].target() for method in chosen}
    for frame in (scene.frames // 2,) if methods else (0, scene.frames - 1):
        records = {r["entry"]: r for r in bench.run_frame(frame, made, lambda entry: None)[0]}
        assert {r["status"] for r in records.values()} == {"ok"}
        exact = records["ray_traced"]
        assert exact["flip"] < 0.02 and exact["reference_px"] > 0.02 * SIZE[0] * SIZE[1]
        assert exact["dark_px"] < 0.02 * exact["reference_px"]
        assert records["environment_map"]["flip"] > exact["flip"]


def test_the_mirror_of_the_room_is_the_glass_in_its_frame():
    scene, _ = built("gallery-room")
    (mirror,) = scene.reflectors
    # A disc of .6 around (.3, 2.47, 1.5), z up, which bulges by 1.2 (1 - cos 30) towards the room, -y.
    low, high = mirror.mesh.vertices.min(axis=0), mirror.mesh.vertices.max(axis=0)
    deep = 1.2 * (1 - np.cos(np.pi / 6))
    assert (low, high) == (pytest.approx((-0.3, 2.47 - deep, 0.9), abs=1e-4), pytest.approx((0.9, 2.47, 2.1), abs=1e-4))
    names = {thing.name for thing in scene.objects}
    assert "room/bricks" in names and not any("mirror" in name for name in names)
    assert {thing.name for thing in scene.objects if thing.mesh.texture is not None} == {"room/bricks", "room/planks"}


def test_the_carousel_turns_its_riders_rise_and_the_camera_swings():
    scene, _ = built("gallery-carousel")
    assert scene.time(100) == 4.0 and [light.intensity for light in scene.lights] == [pytest.approx((30, 27, 21))]
    horse, floor, sign = (part(scene, name) for name in ("ride/horse 0/coat 0", "ride/carousel/red", "ride/sign/gold"))
    for time, turned, risen in ((0.0, 0, 0), (1.0, 75, 0.2), (2.0, 150, 0.4), (3.0, 225, 0.2), (4.0, 300, 0)):
        assert horse.pose(time)[:3, :3] == pytest.approx(about_z(turned), abs=2e-5)
        assert horse.pose(time)[2, 3] == pytest.approx(risen, abs=2e-5)
        assert floor.pose(time)[:3, :3] == pytest.approx(about_z(turned), abs=2e-5)
    # The sign turns by steps: 20 degrees, from 1.5 s on -50, from 3 s on 70.
    for time, degrees in ((1.48, 0), (1.52, -70), (2.96, -70), (3.0, 50)):
        assert sign.pose(time)[:3, :3] == pytest.approx(about_z(degrees), abs=2e-5)
    # The camera is 6.4 from the axis and 2.1 high, on a boom that swings from -15 degrees to 15.
    for time, degrees in ((0.0, -15), (2.0, 0), (3.0, 7.5), (4.0, 15)):
        eye = about_z(degrees) @ [0, -6.4, 2.1]
        assert scene.camera(time).eye == pytest.approx(eye, abs=2e-5)
        ahead = about_z(degrees) @ [0, np.cos(np.radians(10)), -np.sin(np.radians(10))]
        assert scene.camera(time).axes()[2] == pytest.approx(ahead, abs=2e-5)
    assert scene.camera(0.0).fov_deg == pytest.approx(np.degrees(0.6))


def test_the_ball_of_the_yard_is_where_its_keys_have_it_and_the_yard_in_metres():
    scene, _ = built("gallery-yard")
    (ball,) = scene.reflectors
    for time, centre in ((0.0, (-1.2, 0.2, 0.5)), (0.5, (-0.5, -0.2, 0.5)), (2.0, (1.2, 0.4, 0.5))):
        there = ball.mesh.vertices + ball.pose(time)[:3, 3]
        assert np.linalg.norm(there - centre, axis=1) == pytest.approx(0.48, abs=1e-3)
    ground = part(scene, "yard/paving").mesh
    assert np.ptp(ground.vertices, axis=0) == pytest.approx((8, 8, 0), abs=1e-9) and ground.texture is not None


def part(scene: Scene, name: str):
    (found,) = (thing for thing in scene.objects if thing.name == name)
    return found


def about_z(degrees: float) -> np.ndarray:
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
