"""The paper's tables stand beside ours: each number at its setting, ours finite and as the paper's laws say."""

from __future__ import annotations

import csv
import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from support.ink import ink, pixels, shown
from support.mirror_room import lit, mirror_ball
from support.mirror_room import scene as scene_of
from support.small_room import quad
from support.study import machine
from typer.testing import CliRunner

from benchharness import cli
from benchharness.scene import Camera, Environment, Mesh, Object, Scene
from benchharness.speed import depthmaps, edges, impostors, popescu, rivals, stage
from benchharness.speed import sitting as speed

SIZE = (120, 90)
SETTINGS = popescu.Settings(
    texels=64,
    construction=((60, 8), (18, 8), (9, 4)),
    errors=(8, 16),
    shade=(6, 16),
    rotations=(2, 60),
    walk=(8, 16),
    reflectors=(1, 2),
    sizes=((64, 48), (96, 72)),
)


@pytest.fixture(scope="module")
def room(variant) -> Scene:
    """A mirror ball outdoors and a tilted bar before it, whose borders no row follows that is turned away from it."""
    bar = trimesh.creation.box((0.9, 0.12, 0.12))
    bar.apply_transform(trimesh.transformations.rotation_matrix(0.6, (0.3, 1.0, 0.5), (0, 0, 0)))
    bar.apply_translation((0.1, -0.85, 0.0))
    fine = lit(Mesh(bar.vertices, bar.faces), 0.05, 0.1)
    return scene_of(
        (Object("bar", fine, shows="a long border"),),
        (mirror_ball(),),
        environment=Environment.painted(lambda d: 0.5 + 0.4 * d, 32),
    )


@pytest.fixture(scope="module")
def found(room) -> impostors.Found:
    return impostors.study(impostors.Scenes(room, {1: room, 2: room}, room), SIZE, 2, lambda text: None, SETTINGS)


def table(found: impostors.Found, name: str) -> dict[tuple[str, str], dict]:
    return {(r["setting"], r["quantity"]): r for r in found.rows if r["table"] == name}


@pytest.mark.exhaustive
def test_every_table_has_finite_numbers_with_their_intervals(found):
    assert {r["table"] for r in found.rows} == {
        *(depthmaps.CONSTRUCTION, depthmaps.Z_ERROR, depthmaps.MEMORY, depthmaps.WALK, edges.EDGES),
        *(impostors.POINTS, impostors.RAYS, impostors.REFLECTORS, impostors.SIZE),
    }
    assert len(list(itertools.groupby(found.rows, lambda r: r["table"]))) == 9  # each in one piece
    keys = [(r["table"], r["setting"], r["quantity"]) for r in found.rows]
    assert len(set(keys)) == len(keys)
    for r in found.rows:
        assert math.isfinite(r["ours"]) and r["ours"] >= 0, r
        assert set(r) <= set(popescu.COLUMNS)
        times = [
            s["ms"]
            for s in found.samples
            if (s["table"], s["setting"], s["quantity"]) == (r["table"], r["setting"], r["quantity"])
        ]
        assert len(times) == (2 if "ours_lo" in r else 0)
        if times:
            assert r["ours_lo"] <= r["ours"] <= r["ours_hi"]
        if times and r["unit"] == "ms":
            assert r["ours"] == np.median(times)
        if times and r["unit"] == "fps":
            assert r["ours"] == pytest.approx(np.mean([1e3 / ms for ms in times]))


@pytest.mark.exhaustive
def test_the_papers_numbers_stand_at_their_settings(found):
    papers = {(r["table"], r["setting"], r["quantity"]): r["paper"] for r in found.rows if "paper" in r}
    assert papers == {
        ("construction", "n = 60, m = 8", "time"): 210,
        ("construction", "n = 18, m = 8", "time"): 70,
        ("z error", "m = 8", "mean |dz| / z"): 1.43,
        ("z error", "m = 8", "mean |dz| / (far - near)"): 1.43,
        ("z error", "m = 16", "mean |dz| / z"): 0.4,
        ("z error", "m = 16", "mean |dz| / (far - near)"): 0.4,
        ("walk", "every texel", "texels of the image, of rays that hit"): 91,
        ("walk", "every texel", "texels read, of rays that hit"): 63,
        ("walk", "m = 8", "segments tested, of rays that hit"): 7,
        ("walk", "m = 16", "segments tested, of rays that hit"): 15,
        ("points", "m = 6", "shade"): 40.0,
        ("points", "m = 16", "shade"): 62.5,
        ("rays", "depth_impostor, m = 16", "frame"): 1.4,
        ("reflectors", "1", "frame"): 166,
        ("reflectors", "2", "frame"): 125,
    }


def test_unless_told_otherwise_all_the_papers_settings_are_measured():
    settings = popescu.Settings()
    assert settings.construction == ((60, 8), (60, 16), (60, 32), (60, 64), (18, 8))
    assert settings.errors == (8, 10, 12, 14, 16)
    assert settings.shade == (6, 8, 12, 16)
    assert [180 / n for n in settings.rotations] == [20, 10, 3, 2]
    assert settings.reflectors == tuple(range(1, 10))
    assert settings.sizes == ((640, 480), (800, 600), (960, 720), (1120, 840), (1280, 960))
    n, m = settings.memory
    assert popescu.ROWS_BYTES[n, settings.texels, m] == 60 * 256 * 8 * 2 * 4


@pytest.mark.exhaustive
def test_rows_take_the_room_of_their_points(found):
    (memory,) = table(found, depthmaps.MEMORY).values()
    assert memory["ours"] == 60 * 64 * 8 * 2 * 4 and "paper" not in memory  # the paper's is of 256 texels


@pytest.mark.exhaustive
def test_more_points_lose_less_and_more_rotations_miss_less(found):
    errors, borders = table(found, depthmaps.Z_ERROR), table(found, edges.EDGES)
    for quantity in ("mean |dz| / z", "mean |dz| / (far - near)"):
        assert 0 < errors["m = 16", quantity]["ours"] < 0.7 * errors["m = 8", quantity]["ours"]
    coarse, fine = "90 degrees (n = 2)", "3 degrees (n = 60)"
    for quantity in ("pixels that hit or miss by mistake", "silhouettes apart"):
        assert borders[fine, quantity]["ours"] < 0.7 * borders[coarse, quantity]["ours"]
    # What no map sees is missing at any angle: FLIP to the reference need not fall, but every setting has one.
    flips = [borders[setting, "FLIP to the reference"]["ours"] for setting in (coarse, fine, "every texel")]
    assert all(0 < flip < 0.3 for flip in flips) and len(set(flips)) == 3


@pytest.mark.exhaustive
def test_segments_are_fewer_than_points_and_texels_read_than_the_image_has(found):
    walk = table(found, depthmaps.WALK)
    length, read = (walk["every texel", f"{what}, of rays that hit"]["ours"] for what in ("texels of the image", "texels read"))
    assert 0 < read < length < 64 * math.sqrt(2)
    for m in SETTINGS.walk:
        tests = [walk[f"m = {m}", f"segments tested, of rays {which}"]["ours"] for which in ("that hit", "that the map sees")]
        assert all(0 < number <= m - 1 for number in tests)


@pytest.mark.exhaustive
def test_rates_are_reflector_pixels_over_time(found, room):
    seen = stage.Stage(room, SIZE, popescu.largest(room, SIZE))
    count = int(np.array(seen.frame.active).sum())
    for (setting, quantity), r in table(found, impostors.RAYS).items():
        times = [s["ms"] for s in found.samples if (s["table"], s["setting"], s["quantity"]) == ("rays", setting, quantity)]
        if times:
            assert r["ours"] == pytest.approx(np.mean([count / ms for ms in times]) * 1e3 / 1e6)
        else:
            assert quantity == "shade, kernels alone" and r["ours"] == pytest.approx(
                count / float(r["note"].split()[0]) / 1e3, rel=0.05
            )


def test_the_largest_mirror_is_the_nearest(room):
    def nearing(time: float) -> Camera:
        camera = room.camera(0.0)
        eye, target = np.asarray(camera.eye), np.asarray(camera.target)
        return replace(camera, eye=tuple(eye + (target - eye) * (0.3 if time > 0.03 and time < 0.05 else 0.0)))

    assert popescu.largest(replace(room, camera=nearing), SIZE) == 1


def test_a_scene_of_flat_things_is_refused(room):
    floor = replace(quad((-1, -1, -1), (2, 0, 0), (0, 2, 0)), radiance=np.ones(3))
    flat = replace(room, objects=(Object("floor", floor, shows="nothing"),))
    with pytest.raises(ValueError, match="no depth map"):
        popescu.reliefs(stage.Stage(flat, SIZE, 0), 64, 1, 0)


# Silhouettes


def test_a_silhouette_is_where_hits_border_on_misses_of_the_mirror():
    mirror, hits = np.zeros((7, 7), bool), np.zeros((7, 7), bool)
    mirror[:, :5] = True
    hits[2:5, 2:7] = True  # runs out of the mirror at column 5, where it has no edge
    expected = np.zeros((7, 7), bool)
    expected[2:5, 2] = expected[2, 2:5] = expected[4, 2:5] = True
    np.testing.assert_array_equal(edges.silhouette(hits, mirror), expected)
    np.testing.assert_array_equal(edges.silhouette(hits[:, ::-1], mirror[:, ::-1]), expected[:, ::-1])


def test_silhouettes_are_as_far_apart_as_lines_are():
    one, other = np.zeros((20, 20), bool), np.zeros((20, 20), bool)
    one[:, 4] = other[:, 7] = True
    assert edges.apart(one, other) == 3.0 and edges.apart(one, one) == 0.0
    assert edges.apart(one, np.zeros_like(one)) is None


@pytest.mark.exhaustive
def test_the_strip_shows_where_mistakes_are(found):
    titles = [panel.title for panel in found.panels]
    assert titles == ["90 degrees (n = 2)", "3 degrees (n = 60)", "every texel", "reference"]
    coarse, fine, exact, truth = (panel.pixels.astype(float) for panel in found.panels)
    assert coarse.shape == truth.shape == (int(edges.CROP * SIZE[0]), int(edges.CROP * SIZE[0]), 3)
    assert np.abs(coarse - exact).mean() > 1.3 * np.abs(fine - exact).mean()


# The command


@pytest.mark.exhaustive
def test_the_command_writes_tables_and_pictures(found, room, tmp_path, monkeypatch):
    asked, states = [], []

    def said(answer, *what):
        asked.append(what)
        states.append(machine())
        return answer

    monkeypatch.setattr(speed, "kitchen", lambda detail, moving=False: room)
    monkeypatch.setattr(rivals, "comparisons", lambda *args: [])
    monkeypatch.setattr(speed, "baked", lambda name, **keywords: said(name, name, keywords))
    monkeypatch.setattr(impostors, "study", lambda *args: said(found, *args))
    out = tmp_path / "run"
    arguments = ["--out", str(out), "--size", "48", "32", "--frame", "1", "--detail", "lean", "--rounds", "2", "--impostors"]
    done = CliRunner().invoke(cli.app, ["speed", *arguments])
    assert done.exit_code == 0, done.output
    assert states == [*11 * ["free"], "held"], "light is baked while others may time"
    scenes, size, rounds, _, settings = asked.pop()
    assert (scenes.maps, scenes.pots, size, rounds, settings) == ("bunnies", "teapots", (48, 32), 2, popescu.Settings())
    assert list(scenes.spheres) == list(range(1, 10))
    assert [keywords["count"] for name, keywords in asked if name == "spheres"] == list(range(1, 10))
    assert all(keywords["detail"] == "lean" for _, keywords in asked)
    for name, columns, rows in (
        ("impostors", popescu.COLUMNS, found.rows),
        ("impostors-samples", popescu.SAMPLE_COLUMNS, found.samples),
    ):
        with (out / f"{name}.csv").open(newline="") as file:
            written = list(csv.DictReader(file))
        assert list(written[0]) == columns and len(written) == len(rows)
        for one, other in zip(written, rows, strict=True):
            assert one == {column: str(other.get(column, "")) for column in columns}
    for half in np.array_split(pixels(out / "impostor-cost.png"), 2, axis=1):
        assert all(ink(half, colour) > 60 for colour in ("#0072B2", "#56B4E9", "#D55E00"))
    strip = np.array_split(pixels(out / "impostor-edges.png"), len(found.panels), axis=1)
    for picture, panel in zip(strip, found.panels, strict=True):
        assert shown(picture, panel.pixels) > 0.99, panel.title
