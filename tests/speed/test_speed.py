"""The rivals see what we see, rounds are interleaved, ratios are of rounds, and the command writes what it says."""

from __future__ import annotations

import csv
import json
import sys
from dataclasses import replace

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from support.mirror_room import balls, mirror_ball, shaded
from support.mirror_room import scene as scene_of
from support.small_room import small_room
from support.textured_rooms import SHEET, noise
from support.textured_rooms import room as papered
from typer.testing import CliRunner

from benchharness import cli
from benchharness.render import reference
from benchharness.render.bake import bake
from benchharness.render.frame import FrameRenderer
from benchharness.scene import Environment, Scene, refined
from benchharness.speed import embree, iterations, llvmpipe, rivals, stage, tessellation
from benchharness.speed import sitting as speed
from methods.ray_traced import RayTraced

SIZE = (48, 32)
FRAME = 2


def sliding(time: float) -> np.ndarray:
    pose = np.eye(4)
    pose[0, 3] = 5.0 * time  # 0.2 m per frame
    return pose


@pytest.fixture(scope="module")
def room(variant) -> Scene:
    return replace(bake(small_room(0.7), spp=16), frames=3)


@pytest.fixture(scope="module")
def moving_room(room) -> Scene:
    objects = [replace(o, motion=sliding) if o.name == "red" else o for o in room.objects]
    return replace(room, objects=tuple(objects))


@pytest.fixture(scope="module")
def seen(room) -> stage.Stage:
    return stage.Stage(room, SIZE, FRAME)


@pytest.fixture(scope="module")
def world(seen) -> embree.World:
    return embree.build(seen.scene, seen.frame.time)


# Embree


def test_embree_finds_the_first_hits_that_the_rasterizer_finds(seen, world):
    frame = seen.frame
    traced = embree.gbuffer(world, frame.view, frame)
    assert np.mean(np.array(frame.active)) > 0.1
    same = np.array(traced.reflector) == np.array(frame.reflector)
    assert same.mean() > 0.999  # but for a ray along an edge
    for name, tolerance in (("p", 1e-4), ("n", 1e-3), ("v", 1e-4), ("radiance", 1e-3)):
        off = np.abs(np.array(getattr(traced, name)) - np.array(getattr(frame, name))).max(axis=0)[same]
        # v is asked for where a mirror is seen; directly seen edges may go to either triangle.
        assert np.mean(off[np.array(frame.active)[same]] < tolerance) == 1, name
        if name == "radiance":
            assert np.mean(off < tolerance) > 0.99
    np.testing.assert_array_equal(np.array(traced.pixels), np.flatnonzero(np.array(traced.active)))


def test_all_ways_to_ask_embree_meet_the_same_points(seen, world):
    frame = seen.frame
    active = np.array(frame.active)
    for p in (embree.interactions(world, frame.view).p, embree.essentials(world, frame.view)[1]):
        np.testing.assert_allclose(np.array(p)[:, active], np.array(frame.p)[:, active], atol=1e-4)


@pytest.mark.parametrize("coherent", [True, False])
def test_reflections_and_whole_pictures_are_those_of_ray_traced(seen, world, coherent):
    method = stage.method("ray_traced")
    frame = seen.frame
    expected = method.shade(seen.warmed(method), frame)[0]
    L, distance = embree.reflection(world, frame, coherent=coherent)
    active = np.array(frame.active)
    np.testing.assert_allclose(np.array(L)[:, active], np.array(expected.L)[:, active], atol=1e-3)
    np.testing.assert_allclose(np.array(distance)[active], np.array(expected.distance)[active], rtol=1e-4)
    image, whole = (
        np.array(seen.renderer.compose(frame, expected.L)),
        np.array(embree.picture(world, frame.view, coherent=coherent)),
    )
    close = np.abs(image - whole).max(axis=0) < 1e-2
    assert close.mean() > 0.99  # but for rays along edges
    assert close[active].mean() > 0.98


def test_moving_the_world_moves_what_its_mirrors_show(moving_room):
    moved = stage.Stage(moving_room, SIZE, FRAME)
    method = stage.method("ray_traced")
    active = np.array(moved.frame.active)
    expected = np.array(method.shade(moved.warmed(method), moved.frame)[0].L)[:, active]
    world = embree.build(moving_room, 0.0)
    before = np.array(embree.reflection(world, moved.frame, coherent=True)[0])[:, active]
    assert np.abs(before - expected).max() > 0.1
    world = embree.move(world, moved.frame.poses)
    np.testing.assert_allclose(
        np.array(embree.reflection(world, moved.frame, coherent=True)[0])[:, active], expected, atol=1e-3
    )


def test_a_mirror_that_moved_is_seen_where_it_stands_with_its_normals_turned(room):
    def turning(time: float) -> np.ndarray:
        c, s = np.cos(10 * time), np.sin(10 * time)
        return np.array([[c, -s, 0, 0.2 * s], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])

    ball = room.reflectors[0]
    oblong = replace(ball, mesh=replace(ball.mesh, vertices=ball.mesh.vertices * [1, 0.7, 1], normals=None), motion=turning)
    frame = stage.Stage(replace(room, reflectors=(oblong,)), SIZE, FRAME).frame
    found = embree.gbuffer(embree.move(embree.build(replace(room, reflectors=(oblong,)), 0.0), frame.poses), frame.view, frame)
    both = np.array(frame.active) & np.array(found.active)
    assert (np.array(frame.active) != np.array(found.active)).mean() < 0.002 and both.mean() > 0.05
    for name, tolerance in (("p", 1e-4), ("n", 1e-3)):
        np.testing.assert_allclose(
            np.array(getattr(found, name))[:, both], np.array(getattr(frame, name))[:, both], atol=tolerance
        )


# llvmpipe


def test_llvmpipe_draws_what_the_rasterizer_draws(room, seen):
    try:
        gl = llvmpipe.Llvmpipe(room, seen.frame.time, SIZE)
    except llvmpipe.Unavailable as error:
        pytest.skip(str(error))
    frame = seen.frame
    gl.draw(3)
    part, p, n, radiance = gl.read(3)
    mirror = part >= len(room.objects)
    assert np.mean(mirror == np.array(frame.active)) > 0.999
    both = mirror & np.array(frame.active)
    np.testing.assert_allclose(p[both], np.array(frame.p).T[both], atol=1e-4)
    np.testing.assert_allclose(n[both], np.array(frame.n).T[both], atol=1e-3)
    assert np.mean(np.abs(radiance - np.array(frame.radiance).T).max(axis=1) < 1e-2) > 0.99
    gl.draw(2)
    np.testing.assert_allclose(gl.read(2)[2], n + radiance, atol=1e-6)
    gl.close()


def test_without_moderngl_llvmpipe_says_how_to_get_it(room, monkeypatch):
    monkeypatch.setitem(sys.modules, "moderngl", None)
    with pytest.raises(llvmpipe.Unavailable, match=r"benchharness\[speed\]"):
        llvmpipe.Llvmpipe(room, 0.0, SIZE)


def test_embree_shows_pictures_and_llvmpipe_says_that_it_does_not(variant):
    made = papered(noise(), noise(seed=1), SHEET)
    [answer] = shaded(RayTraced(), made, 0, size=SIZE)
    view, shape = answer.frame.view, answer.L.shape
    expected = np.where(answer.active[..., None], answer.L, np.array(answer.frame.radiance).T.reshape(shape))
    whole = np.array(embree.picture(embree.build(made, 0.0), view, coherent=True)).T.reshape(shape)
    assert np.mean(np.abs(whole - expected).max(axis=2) < 2e-3) > 0.99
    with pytest.raises(llvmpipe.Unavailable, match="scene mirror_room has textures"):
        llvmpipe.Llvmpipe(made, 0.0, SIZE)


# Rounds and ratios


def test_rounds_time_every_work_in_turn(variant):
    called, told = [], []

    def work(name: str):
        def call() -> mi.Float:
            called.append(name)
            return dr.opaque(mi.Float, 1.0, 8)

        return call

    times, cold = stage.interleaved({name: work(name) for name in "abc"}, 4, told.append)
    assert called[-12:] == list("abcabcabcabc")
    assert {name: len(values) for name, values in times.items()} == {"a": 4, "b": 4, "c": 4}
    assert not cold
    assert told[-1] == 4


def test_a_work_that_compiles_in_every_call_is_named(variant):
    new = np.random.default_rng()  # a literal that no kernel in the cache on this disk has
    _, cold = stage.interleaved({"new": lambda: dr.arange(mi.Float, 8) * float(new.random())}, 2, lambda done: None)
    assert cold == {"new"}


def test_a_method_comes_warm(seen):
    method = stage.method("image_space_search")
    steps = [
        int(np.array(method.shade(state, seen.frame)[0].counters["iterations"], np.int64).sum())
        for state in (method.update(method.prepare(seen.scene), seen.frame), seen.warmed(method))
    ]
    assert steps[1] < steps[0]


def test_ratios_are_taken_over_rounds():
    # A machine that slows both sides down alike, from round to round by up to 5: the ratio of medians is 2 in every draw.
    ours = np.random.default_rng(3).uniform(1, 5, 31)
    assert stage.ratio_interval(2 * ours, ours) == pytest.approx((2.0, 2.0, 2.0))


def test_the_interval_of_a_ratio_holds_the_ratio_and_narrows_with_rounds():
    random = np.random.default_rng(5)
    widths = []
    for rounds in (10, 1000):
        ratio, low, high = stage.ratio_interval(random.normal(6, 0.5, rounds), random.normal(2, 0.2, rounds))
        assert low < ratio < high
        assert low < 3 < high
        widths.append(high - low)
    assert widths[1] < 0.3 * widths[0]


# Tessellation


def test_subdivision_changes_no_reference(room):
    time = room.time(FRAME)
    options = reference.ReferenceOptions(spp=2)
    fine = refined(replace(room, h_max=0.2))
    assert fine.vertices > 2 * room.vertices
    images = [reference.render(scene, time, SIZE, options).image for scene in (room, fine)]
    assert np.mean(np.abs(images[0] - images[1]).max(axis=2) < 1e-3) > 0.99  # but for rays along new edges


def test_tessellations_have_about_the_vertices_that_were_asked_for(room):
    found = tessellation.tessellations(room, (100, room.vertices - 1, 5_000, 8_000))
    assert [s.source["split_at"] is None for s in found] == [True, False, False]
    assert found[0].vertices == room.vertices
    for scene, target in zip(found[1:], (5_000, 8_000), strict=True):
        assert scene.vertices == pytest.approx(target, rel=0.2)


def test_the_fit_finds_a_line():
    rows = [{"vertices": n, "frame_ms": 3.0 + 0.25e-3 * n, "shade_ms": 0.1 * n**0.6} for n in (1_000, 4_000, 20_000)]
    found = tessellation.fit(rows)
    line = {"ms_per_1000_vertices": 0.25, "intercept_ms": 3.0, "r2": 1.0, "exponent": 0.6, "points": 3}
    assert found == pytest.approx(line)
    assert tessellation.fit(rows[:1]) == {"points": 1}


@pytest.mark.exhaustive
def test_the_study_sees_the_error_fall_with_the_vertices(room):
    found = tessellation.study({"lean": room}, (96, 64), FRAME, 2, lambda text: None, targets=(100, 6_000))
    names = {row["method"] for row in found.rows}
    assert {
        tessellation.UNREFLECTED,
        "environment_map",
        "ray_traced",
        "image_space_search",
        "secant_triangle",
        "newton",
        *tessellation.WAYS,
    } <= names
    coarse, fine = (
        {r["method"]: r for r in found.rows if r["vertices"] == n} for n in sorted({r["vertices"] for r in found.rows})
    )
    for name in ("image_space_search", "secant_triangle", "newton"):
        assert fine[name]["vertices"] > 2 * coarse[name]["vertices"]
        assert fine[name]["flip"] < 0.7 * coarse[name]["flip"]
        assert fine["ray_traced"]["flip"] < fine[name]["flip"] < fine["environment_map"]["flip"]
        assert fine[name]["frame_ms"] == fine[tessellation.UNREFLECTED]["frame_ms"] + fine[name]["shade_ms"]
    for name in tessellation.WAYS:
        assert coarse[name]["flip"] < 0.3 * coarse["newton"]["flip"]
    assert all(fit["points"] == 2 for fit in found.fits) and {fit["method"] for fit in found.fits} == names
    assert len(found.samples) == 2 * len(found.rows)


# Iterations


@pytest.mark.exhaustive
def test_iterations_are_counted_and_shown_where_the_mirror_shows_them(room):
    cases = iterations.study(room, (96, 64), FRAME, lambda text: None)
    rows = {case.name: case.row() for case in cases}
    assert list(rows) == [name for name, *_ in iterations.CASES]
    paper = rows["Roger and Holzschuch, cold"]
    assert 3 <= paper["mean"] <= 10 and paper["at_most_20"] > 0.9  # as the paper says; fewer where pixels are large
    for name in ("newton", "secant_triangle"):
        assert rows[f"{name}, warm"]["mean"] < rows[f"{name}, cold"]["mean"]
    mirror = np.array(stage.Stage(room, (96, 64), FRAME).frame.active).reshape(64, 96)
    for case in cases:
        shown = np.isfinite(case.picture)
        assert shown[mirror].mean() > 0.8 and not shown[~mirror].any()
        # What is drawn is interpolated between vertices: never more than the most, nor less than the least.
        assert case.iterations.min() - 1e-3 <= case.picture[shown].min()
        assert case.picture[shown].max() <= case.iterations.max() + 1e-3
        steps = case.steps()
        assert sum(row["vertices"] for row in steps) == len(case.iterations)
        assert sum(row["vertices"] * row["iterations"] for row in steps) == case.iterations.sum()


# The command


def rows_of(path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def test_the_command_writes_every_comparison_with_its_samples(room, moving_room, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "moderngl", None)
    monkeypatch.setattr(speed, "kitchen", lambda detail, moving=False: moving_room if moving else room)
    out = tmp_path / "run"
    arguments = ["--out", str(out), "--size", *map(str, SIZE), "--frame", str(FRAME), "--rounds", "3"]
    done = CliRunner().invoke(cli.app, ["speed", *arguments])
    assert done.exit_code == 0, done.output
    rows, samples = rows_of(out / "speed.csv"), rows_of(out / "samples.csv")
    assert list(rows[0]) == speed.COLUMNS
    assert list(samples[0]) == speed.SAMPLE_COLUMNS
    assert list(dict.fromkeys(row["name"] for row in rows)) == [
        *("gbuffer", "raster"),
        *(f"{stage} {name}" for stage in ("frame", "shade", "moving") for name in rivals.VERTEX_METHODS),
        "environment_map",
    ]
    for row in rows:
        sides = {
            side: [float(s["ms"]) for s in samples if (s["name"], s["side"]) == (row["name"], side)]
            for side in (rivals.OURS, row["rival"])
        }
        assert float(row["ours_ms"]) == np.median(sides[rivals.OURS])
        if row["name"] == "raster":
            assert "moderngl" in row["note"]
            assert row["rival_ms"] == row["ratio"] == row["ratio_lo"] == row["ratio_hi"] == ""
            continue
        assert len(sides[rivals.OURS]) == len(sides[row["rival"]]) == 3
        assert float(row["rival_ms"]) == np.median(sides[row["rival"]])
        assert float(row["ratio"]) == pytest.approx(float(row["rival_ms"]) / float(row["ours_ms"]))
        assert float(row["ratio_lo"]) <= float(row["ratio"]) <= float(row["ratio_hi"])
    environment = json.loads((out / "environment.json").read_text())
    assert environment["opengl"] is None
    assert environment["speed"]["size"] == list(SIZE)


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [(["--rounds", "1"], "rounds is 1"), (["--size", "0", "5"], "width is 0"), (["--frame", "7"], "accepted: 0 to 2")],
)
def test_what_makes_no_sense_is_refused(arguments, complaint, room, tmp_path, monkeypatch):
    monkeypatch.setattr(speed, "kitchen", lambda detail, moving=False: room)
    done = CliRunner().invoke(cli.app, ["speed", "--out", str(tmp_path / "run"), *arguments])
    assert done.exit_code == 2
    assert complaint in done.output
    assert not (tmp_path / "run").exists()


def test_a_folder_in_use_is_refused(tmp_path):
    (tmp_path / "kept.txt").write_text("mine")
    done = CliRunner().invoke(cli.app, ["speed", "--out", str(tmp_path)])
    assert done.exit_code == 2
    assert "in use" in done.output


def test_embree_shows_a_panorama_as_the_harness_does():
    made = scene_of(
        balls(),
        (mirror_ball(),),
        environment=Environment.painted(lambda d: 0.5 + 0.4 * d, 32),
        frames=1,
    )
    renderer = FrameRenderer(made, *SIZE)
    expected = shaded(RayTraced(), made, 0, renderer=renderer)[0]
    whole = np.array(embree.picture(embree.build(made, 0.0), expected.frame.view, coherent=True))
    image = np.array(renderer.compose(expected.frame, expected.reflection.L))
    assert (np.abs(image - whole).max(axis=0) > 1e-4).mean() < 0.003
    assert np.ptp(image) > 0.7
