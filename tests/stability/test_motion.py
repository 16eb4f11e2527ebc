"""What happens over time: measures on series whose answer is known, and methods that break as time goes on."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from support.here import Here
from support.motion_plugins import SHIFT

from benchharness.measure import metrics
from benchharness.report import motion as pictures
from benchharness.stability import film, markers, motion, strips, watch
from benchharness.stability.plan import Motion
from benchharness.study import plugins
from benchharness.study.methods import Entry, plugged_in
from benchharness.tables import files, stability

HERE = Path(__file__).parents[1] / "support"
TURNING, SIZE, COUNT = f"{HERE / 'motion_plugins.py'}:turning", (128, 96), 6
SEEN = {"ppd": 67.0, "exposure": 0.0}


def entry(name: str) -> Entry:
    if name[0].isupper():
        return Entry(name, f"{HERE / 'motion_plugins.py'}:{name}", {})
    return plugged_in(str(HERE.parents[1] / "methods" / f"{name}.py"), Here())


def grey(lightness: float) -> np.ndarray:
    """A uniform picture of that CIELAB lightness, above 8."""
    return np.full((48, 64, 3), ((lightness + 16) / 116) ** 3, np.float32)


# Measures


def test_a_just_noticeable_difference_of_lightness_is_the_flip_from_which_a_change_is_noticed():
    error = metrics.flip_map(grey(52.3), grey(50.0), np.ones((48, 64), bool), **SEEN)
    # FLIP is linear in that range after its power of 0.7; its grey axis is Hunt's, which greys do not change.
    assert float(error[24, 32]) == pytest.approx(metrics.POP, abs=0.005)


@pytest.mark.parametrize(("share", "step"), [(0.0, 10.0), (0.5, 10.0), (1.0, 10.0), (1.0, 1.0)])
def test_pops_are_the_pixels_that_change_noticeably_otherwise_than_the_reference(share, step):
    y0, y1, x0 = grey(50.0), grey(55.0), grey(50.0)
    x1 = y1.copy()
    x1[:, : round(64 * share)] = grey(55.0 + step)[:, : round(64 * share)]
    expected = share if step > 2.3 else 0.0
    # FLIP's filters carry an edge about a pixel to either side.
    assert metrics.pops(x0, x1, y0, y1, np.ones((48, 64), bool), **SEEN) == pytest.approx(expected, abs=0.05)


def test_what_is_wrong_and_changes_as_the_reference_does_does_not_pop():
    mask = np.ones((48, 64), bool)
    change = grey(55.0) - grey(50.0)
    assert metrics.pops(grey(80.0), grey(80.0) + change, grey(50.0), grey(55.0), mask, **SEEN) == 0
    assert metrics.pops(grey(80.0), grey(80.0), grey(50.0), grey(55.0), mask, **SEEN) == 1
    mask[:] = False
    assert metrics.pops(grey(80.0), grey(80.0), grey(50.0), grey(55.0), mask, **SEEN) is None


def disc(x: float, y: float, radius: float, size: int = 60) -> np.ndarray:
    """A disc about (x, y), pixels, at PLACES x PLACES places per pixel."""
    at = (np.arange(Motion.places * size) + 0.5) / Motion.places
    return ((at[None] - x) ** 2 + (at[:, None] - y) ** 2 < radius**2).astype(float)


def test_the_tremble_of_a_disc_is_found_to_what_sampling_allows():
    # To and fro by a, the second difference is 4 a; the way itself is straight.
    way = [(20.0 + 0.37 * k, 30.0 + 0.21 * k) for k in range(24)]
    shaken = [(x + 0.3 * (-1) ** k, y) for k, (x, y) in enumerate(way)]
    true, seen = (np.array([markers.centroid(disc(*p, 12.0), Motion.places) for p in path])[:, None] for path in (way, shaken))
    noise = markers.uncertainty(disc(20.0, 30.0, 12.0), Motion.places) * np.sqrt(2 * 6)
    assert noise < 0.1
    assert metrics.jitter_px(seen - true) == pytest.approx(1.2, abs=2 * noise)
    # A picture that is elsewhere all the time, by so much that nothing is sampled alike, does not tremble beyond the noise.
    away = np.array([markers.centroid(disc(x + 7.13, y + 3.41, 12.0), Motion.places) for x, y in way])[:, None]
    assert metrics.jitter_px(away - true) < 2 * noise


def test_the_uncertainty_of_a_centroid_is_what_discs_at_random_places_show():
    places = 30 + np.random.default_rng(1).uniform(0, 1, (300, 2))
    off = [markers.centroid(disc(x, y, 9.0), Motion.places) - (x, y) for x, y in places]
    found = float(np.sqrt((np.array(off) ** 2).sum(axis=1).mean()))
    # Places along an edge do not fall independently: a disc's own symmetry takes some of it away.
    assert 0.4 < found / markers.uncertainty(disc(30.2, 30.7, 9.0), Motion.places) < 1.2


def test_a_root_switches_where_a_point_leaves_the_root_that_it_was_at():
    went = np.array([[1.0, 0], [9.0, 0], [9.0, 0], [9.0, 0], [np.nan, 0], [1.0, 0]])
    path = np.array([[1.5, 0], [1.0, 0], [8.0, 0], [1.0, 0], [1.0, 0], [np.nan, 0]])
    off = np.array([[0.5, 0], [0.0, 0], [0.0, 0], [5.0, 0], [0.0, 0], [0.0, 0]])
    # Stays; leaves; goes along with its root; was at none; no point; no root.
    np.testing.assert_array_equal(watch.switches(went, path, off), [0, 1, 0, np.nan, np.nan, np.nan])


def test_roots_that_a_cold_start_has_elsewhere_are_counted():
    made = film.film(TURNING, "cut", 6, 2, None, SIZE)
    count = made.scene.vertices
    # Points of the mirror's size about its middle, which the camera looks at.
    R = np.random.default_rng(2).uniform(-0.3, 0.3, (count, 3)).astype(np.float32)
    warm = {"R": R, "converged": np.ones(count, bool)}
    elsewhere = R.copy()
    elsewhere[: count // 2, 2] += 0.5
    unsure = np.arange(count) % 2 == 0
    for other, expected in (
        ({"R": R, "converged": warm["converged"]}, 0.0),
        ({"R": elsewhere, "converged": warm["converged"]}, 0.5),
        ({"R": elsewhere, "converged": unsure}, 0.5),
        ({"R": elsewhere, "converged": ~warm["converged"]}, None),
    ):
        found = watch._other_roots(made, watch.Shown(vertices=[warm], cold={made.numbers[-1]: (None, other)}))
        assert found is None if expected is None else found == pytest.approx(expected, abs=0.1)


# Runs


@pytest.fixture(scope="module")
def steady(tmp_path_factory):
    folder = tmp_path_factory.mktemp("steady")
    names = ("ray_traced", "newton", "environment_map", "Shaky")
    asked = Motion((TURNING,), ("steady",), frames=COUNT, substeps=1, start=10, size=SIZE)
    groups = motion.units([entry(name) for name in names], asked)
    (group,) = groups.values()
    found = dict(zip(names, zip(group, motion.work(group, folder), strict=True), strict=True))
    return folder, found


@pytest.mark.exhaustive
def test_traced_rays_change_and_move_as_the_reference_does(steady):
    record = steady[1]["ray_traced"][1]
    assert record["status"] == "ok" and record["images"] >= 2 and record["images_lost"] == 0
    assert record["temporal_diff"] < 1e-3 and record["pops"] < 1e-3
    # Both sample the same places: what is left is the rounding of a ray at an edge, of a few places in hundreds.
    assert record["image_jitter_px"] < 0.02 < record["image_floor_px"] < 0.2
    assert "jitter_px" not in record


def test_a_search_keeps_its_roots_and_its_images_still(steady):
    record = steady[1]["newton"][1]
    assert record["jitter_px"] < 0.1 and record["root_switches"] == 0
    # Images are drawn with straight edges between exact vertices: they tremble by what sampling alone does.
    assert record["image_jitter_px"] < 2 * record["image_floor_px"]
    assert 0.8 < record["spike"] < 2.0
    assert [f["root_switches"] for f in record["per_frame"]] == [None] + [0.0] * (COUNT - 1)


def test_the_map_is_wrong_and_still(steady):
    record = steady[1]["environment_map"][1]
    assert record["flip"] > 0.05 and record["image_off_px"] > 1.0
    assert record["image_jitter_px"] < 0.5


def test_a_picture_that_shakes_is_caught_by_every_measure(steady):
    good, shaky = steady[1]["ray_traced"][1], steady[1]["Shaky"][1]
    assert shaky["pops"] > 0.05 and shaky["temporal_diff"] > 20 * max(good["temporal_diff"], 1e-4)
    # Off by 0 and SHIFT in turns: a second difference of twice that. What leaves the mirror at its edge takes part of it.
    assert shaky["image_jitter_px"] == pytest.approx(2 * SHIFT, rel=0.1)


def test_rows_have_the_columns_and_pictures_are_there(steady, tmp_path):
    folder, found = steady
    rows = [motion.row(*pair) for pair in found.values()]
    frames = [frame for pair in found.values() for frame in motion.frame_rows(*pair)]
    files.write(tmp_path / motion.FILE, rows, motion.COLUMNS)
    files.write(tmp_path / motion.FRAMES_FILE, frames, motion.FRAME_COLUMNS)
    read, per_frame = stability.read(tmp_path / motion.FILE), stability.read(tmp_path / motion.FRAMES_FILE)
    assert list(read[0]) == [*motion.COLUMNS, "label"] and len(per_frame) == COUNT * len(found)
    assert per_frame[0]["temporal_diff"] == "" and float(per_frame[1]["temporal_diff"]) >= 0
    for row in read:
        still, moving = pictures.files(folder, row)
        assert still is not None and moving is not None and moving.stat().st_size <= strips.MOST_BYTES
        with Image.open(moving) as animation, Image.open(still) as strip:
            assert animation.n_frames == COUNT and strip.height > strip.width / 4  # pyright: ignore
    figure = pictures.changes(per_frame)
    assert len(figure.axes) == 1 and len(figure.axes[0].lines) == len(found)


@pytest.fixture(scope="module")
def cut(tmp_path_factory):
    names = ("newton", "Lagging")
    groups = motion.units([entry(name) for name in names], Motion((TURNING,), ("cut",), substeps=1, size=SIZE))
    (group,) = groups.values()
    return dict(zip(names, motion.work(group, tmp_path_factory.mktemp("cut")), strict=True))


@pytest.mark.exhaustive
def test_a_search_is_after_a_cut_where_a_cold_start_is(cut):
    record = cut["newton"]
    assert record["recovery"] == 0 and record["other_roots"] == 0
    assert record["spike"] > 1.2
    jumped = record["per_frame"][film.BEFORE]
    assert jumped["frame"] == record["jump"] and jumped.get("temporal_diff") is None and jumped["cold_flip"] is not None


def test_what_answers_from_before_the_cut_is_caught_for_as_long_as_it_does(cut):
    record = cut["Lagging"]
    # It shows what was there two frames ago, and the camera goes on: it never is where a cold start is.
    assert record["recovery"] is None
    after = record["per_frame"][film.BEFORE :]
    assert all(f["flip"] > f["cold_flip"] + 0.05 for f in after[:2])


def test_films_jump_where_they_say():
    cut, there, still = (film.film(TURNING, kind, 6, 2, None, SIZE) for kind in ("cut", "teleport", "steady"))
    assert there.jump == film.BEFORE and still.jump is None and still.scene.fps == 50
    for made, camera_jumps, red_jumps in ((cut, True, False), (there, False, True)):
        assert made.jump is not None
        before, after = (made.scene.time(made.jump + k) for k in (-1, 0))
        eyes = np.array([made.scene.camera(t).eye for t in (before, after)])
        heights = [made.scene.objects[1].pose(t)[2, 3] for t in (before, after)]
        assert (np.linalg.norm(eyes[1] - eyes[0]) > 0.5) == camera_jumps
        assert (abs(heights[1] - heights[0]) > 0.05) == red_jumps
    # Nothing is out of the animation's own time.
    last = cut.scene.camera(cut.scene.time(cut.numbers[-1])).eye
    np.testing.assert_allclose(last, still.scene.camera(still.scene.time(still.scene.frames - 1)).eye, atol=1e-9)


def test_the_start_is_where_most_moves():
    from dataclasses import replace

    still = film.film(TURNING, "steady", 6, 2, None, SIZE).scene
    path = still.camera
    late = replace(still, camera=lambda time: path(max(time - 1.0, 0.0)), objects=still.objects[:1])
    assert film._liveliest(late, 6) / late.fps > 0.9


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"scenes": ("kitchn",)}, "did you mean 'kitchen'"),
        ({"kinds": ("stedy",)}, "accepted: steady, cut, teleport"),
    ],
)
def test_bad_input_is_refused_before_anything_runs(options, message):
    with pytest.raises(ValueError, match=message):
        motion.units([], Motion(**options))


def test_every_scene_runs_where_none_is_named():
    scenes = [name for name, plugin in plugins.discover("scene").items() if plugin.error is None]
    assert len(scenes) > 1 and list(motion.units([], Motion())) == scenes


@pytest.mark.parametrize(("start", "count", "message"), [(39, 6, "frames 0 to 34"), (None, 99, "3 to 40")])
def test_a_film_that_does_not_fit_is_refused(start, count, message):
    with pytest.raises(ValueError, match=message):
        film.film(TURNING, "steady", count, 1, start, SIZE)


# Pictures


def test_a_strip_is_three_rows_of_the_frames_and_the_crop_holds_the_mirrors():
    mask = np.zeros((40, 60), bool)
    mask[10:20, 15:40] = True
    box = strips.crop([mask, np.zeros_like(mask)])
    assert box == (15 - strips.MARGIN, 10 - strips.MARGIN, 40 + strips.MARGIN, 20 + strips.MARGIN)
    assert strips.crop([np.zeros_like(mask)]) == (0, 0, 60, 40)
    rows = [[np.full((40, 60, 3), 10 * r + k, np.uint8) for k in range(9)] for r in range(3)]
    made = strips.strip(rows[0], rows[1], rows[2], box, strips.chosen(9, None))
    height, width = box[3] - box[1], box[2] - box[0]
    assert made.shape == (3 * height + 2 * strips.GAP, 6 * width + 5 * strips.GAP, 3)
    assert made[0, 0, 0] == 0 and made[height + strips.GAP, -1, 0] == 18
    assert strips.chosen(8, 3) == [1, 2, 3, 4, 5, 6]


def test_an_animation_is_as_good_as_it_may_be_large(monkeypatch):
    frames = list(np.random.default_rng(0).integers(0, 255, (12, 60, 80, 3), np.uint8))
    sizes = []
    for most in (strips.MOST_BYTES, 60_000, 20_000):
        monkeypatch.setattr(strips, "MOST_BYTES", most)
        data = strips.animated(frames, frames, (0, 0, 80, 60))
        assert len(data) <= most
        with Image.open(io.BytesIO(data)) as animation:
            assert animation.n_frames == 12  # pyright: ignore
            sizes.append(animation.size)
    assert sizes[0] == (2 * 80 + strips.GAP, 60) and sizes[-1][0] < sizes[0][0]
