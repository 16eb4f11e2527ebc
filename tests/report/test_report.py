"""The frontier by hand, the charts by their data, the page by its structure; all from records made here."""

from __future__ import annotations

import base64
import io
import itertools
import json
import re
from html.parser import HTMLParser

import numpy as np
import pytest
from PIL import Image

from benchharness import report
from benchharness.report import chart, images, interactive, page
from benchharness.report.frontier import DOMINATED, ON, PARTIAL, UNDECIDED, Place, classify, staircase
from benchharness.report.points import COLOURS, MARKERS, curves, looks, views
from benchharness.tables import columns, naming, origin, results

# The frontier


def exact(times, errors):
    return classify(times, times, errors, errors)


def test_points_without_intervals_are_on_the_frontier_or_dominated_by_all_that_beat_them():
    # 0 fast and bad, 1 slow and good, 2 slower than 0 and worse, 3 worse than 0 and 2 and (in error) 1.
    places = exact([1, 5, 2, 6], [0.4, 0.1, 0.5, 0.6])
    assert places == [Place(ON), Place(ON), Place(DOMINATED, (0,)), Place(DOMINATED, (0, 2, 1))]


def test_equal_points_do_not_dominate_each_other_but_an_equal_error_at_less_time_does():
    assert exact([1, 1], [0.2, 0.2]) == [Place(ON), Place(ON)]
    assert exact([1, 2], [0.2, 0.2]) == [Place(ON), Place(DOMINATED, (0,))]


def test_overlapping_intervals_leave_a_point_undecided_against_its_rivals():
    # 1 is more accurate for certain; whether it is faster than 0 is open. 2 is beaten by 1 for certain.
    places = classify([1.0, 1.1, 3.0], [1.3, 1.5, 3.1], [0.4, 0.2, 0.5], [0.4, 0.2, 0.5])
    assert places == [Place(UNDECIDED, (1,)), Place(ON), Place(DOMINATED, (0, 1))]


def test_touching_intervals_are_decided():
    # The worst of 0 is the best of 1 in time, and better in error.
    assert classify([1, 2], [2, 3], [0.1, 0.2], [0.1, 0.2]) == [Place(ON), Place(DOMINATED, (0,))]


def test_verdicts_hold_for_every_draw_from_the_intervals():
    """Sampled oracle: `dominated` in every draw, `on the frontier` in every draw, `undecided` free."""
    rng = np.random.default_rng(3)
    seen = set()
    for _ in range(30):
        t, e = rng.uniform(1, 4, 5), rng.uniform(0, 1, 5)
        dt, de = rng.uniform(0, 0.5, 5), rng.uniform(0, 0.1, 5)
        places = classify(t - dt, t + dt, e - de, e + de)
        for _ in range(40):
            ti, ei = t + dt * rng.uniform(-1, 1, 5), e + de * rng.uniform(-1, 1, 5)
            drawn = exact(ti, ei)
            for place, one in zip(places, drawn, strict=True):
                assert place.verdict == UNDECIDED or place.verdict == one.verdict
                seen.add(place.verdict)
    assert seen == {ON, DOMINATED, UNDECIDED}


def test_no_points_and_wrong_points():
    assert classify([], [], [], []) == []
    for bad in (([1], [1], [1], [1, 2]), ([2], [1], [0], [0]), ([1], [1], [np.nan], [1])):
        with pytest.raises(ValueError, match="accepted"):
            classify(*bad)


def test_the_staircase_goes_down_and_leaves_out_what_it_passes():
    assert staircase([3, 1, 2, 2, 5], [0.1, 0.5, 0.3, 0.2, 0.4]) == [1, 3, 0]
    assert staircase([], []) == []


# Records to points


def record(method="box", params="", frame: int | None = 0, time=8.0, flip: float | None = 0.1, **values) -> dict:
    base = dict.fromkeys(results.COLUMNS)
    base.update(run="r", config="quick", scene="kitchen", detail="lean", frame=frame, method=method, params=params)
    base.update(status="ok", reflector_px=500, gbuffer_ms=1.0, update_ms=0.5, shade_ms=time - 2, frame_ms=time)
    base.update(flip=flip, shade_ms_lo=time - 2.1, shade_ms_hi=time - 1.7, prepare_ms=30.0, rmse=0.02)
    base.update(reference_noise=0.0, config_hash="c1", method_hash=f"h-{method}", scene_hash="s1", calibration_ms=9.0)
    return base | values


def swept(method, name, values, times, flips, frames=(0, 5)):
    return [
        record(method, f"{name}={v}", f, t, e * (1 + 0.2 * i))
        for v, t, e in zip(values, times, flips, strict=True)
        for i, f in enumerate(frames)
    ]


def test_a_point_has_the_median_time_the_mean_error_and_their_intervals():
    (view,) = views([record(frame=0, time=8.0, flip=0.1), record(frame=1, time=10.0, flip=0.3, reference_noise=0.02)])
    (point,) = view.points
    assert (point.time, point.error, point.spread) == (9.0, pytest.approx(0.2), (0.1, 0.3))
    assert (point.time_lo, point.time_hi) == (pytest.approx(8.9), pytest.approx(9.3))
    assert view.noise == pytest.approx(0.01)


def test_errors_within_the_references_noise_are_undecided():
    (clean,) = views([record("a", time=5.0, flip=0.010), record("b", time=9.0, flip=0.025)])
    assert [place.verdict for place in clean.places] == [ON, DOMINATED]
    # Within 0.01 each: a is up to 0.020, b from 0.015 on.
    noise = {"reference_noise": 0.01}
    (noisy,) = views([record("a", time=5.0, flip=0.010, **noise), record("b", time=9.0, flip=0.025, **noise)])
    assert [place.verdict for place in noisy.places] == [ON, UNDECIDED]


def test_a_method_that_failed_in_some_frames_is_drawn_but_not_ranked():
    rows = [record("a", frame=f, time=9.0, flip=0.2) for f in (0, 1)]
    rows += [record("b", frame=0, time=3.0, flip=0.01), record("b", frame=1, status="crashed", flip=None)]
    (view,) = views(rows)
    assert [place.verdict for place in view.places] == [ON, PARTIAL]
    assert view.within(100.0).method == "a" and [p.method for p in view.frontier] == ["a"]


def test_rows_that_cannot_be_drawn_say_why():
    rows = [
        record("a", status="refused", reason="curved", flip=None),
        record("b", reflector_px=0, flip=None),
        record("c", frame_ms=None),
    ]
    (view,) = views(rows)
    assert view.points == [] and view.within(100.0) is None and view.best == {}
    reasons = {row["method"]: why for row, why in view.undrawn}
    assert reasons["a"] == "refused: curved" and reasons["c"] == "has no frame_ms"
    assert "no mirror in view" in reasons["b"]


def test_the_answer_within_a_budget_is_the_least_error_whose_interval_fits():
    # b takes 16.65 ms, but up to 16.95: beyond 16.7.
    rows = [record("a", time=8.0, flip=0.1), record("b", time=16.65, flip=0.01), record("c", time=9.0, flip=0.3)]
    (view,) = views(rows)
    assert view.within(16.7).method == "a" and view.within(17.0).method == "b" and view.within(5.0) is None


def test_curves_run_along_the_numeric_parameter_of_most_values_one_per_rest():
    rows = [record("m", f"rule={rule}; steps={n}", time=4.0 + n) for rule, n in itertools.product(["near", "far"], [16, 2, 8])]
    (view,) = views(rows)
    found = [[point.params for point in curve] for curve in curves(view.points)]
    assert found == [[f"rule={rule}; steps={n}" for n in (2, 8, 16)] for rule in ("near", "far")]


def test_points_that_differ_by_name_alone_are_not_joined():
    (view,) = views([record("m", "rule=near"), record("m", "rule=far")])
    assert [len(curve) for curve in curves(view.points)] == [1, 1]


def test_looks_are_the_same_for_the_same_methods_and_tell_many_apart():
    names = [f"m{i:02}" for i in range(25)]
    one, other = looks([record(name) for name in names]), looks([record(name) for name in reversed(names)])
    assert one == other
    assert len({(look.colour, look.marker, look.dash) for look in one.values()}) == 25
    assert len({look.colour for look in list(one.values())[: len(COLOURS)]}) == len(COLOURS) >= len(MARKERS)


# Charts


@pytest.fixture(scope="module")
def records():
    rows = swept("search", "h_max", [0.2, 0.1, 0.05], [7.0, 12.0, 24.0], [0.05, 0.02, 0.008])
    rows += swept("impostor", "steps", [4, 8], [4.4, 5.2], [0.12, 0.08])
    rows += [record("environment_map", "", f, 3.0, 0.5) for f in (0, 5)]
    rows += [record("exact", "", f, 30.0, 0.0) for f in (0, 5)]
    rows += [record("planar", status="refused", reason="the mirror is <curved> & closed", flip=None, frame_ms=None)]
    rows += [record("crasher", frame=5, status="crashed", reason="LLVM ERROR", flip=None, frame_ms=None)]
    rows += [record("search", "h_max=0.1", f, scene="out[of=view]", reflector_px=0, flip=None) for f in (0, 5)]
    return rows


def test_the_frontier_chart_has_every_method_budget_and_direction_and_keeps_the_legend_off_the_data(records):
    view = views(records)[0]
    figure = chart.frontier_chart(view, looks(records))
    figure.draw_without_rendering()
    (axes,) = figure.axes
    assert axes.get_xscale() == axes.get_yscale() == "log"
    assert "less is better" in axes.get_xlabel() and "less is better" in axes.get_ylabel()
    words = " ".join(text.get_text() for text in axes.texts)
    assert all(ms in words for ms in ("16.7 ms", "11.1 ms", "6.9 ms"))
    (legend,) = figure.legends
    assert {t.get_text() for t in legend.get_texts()} == {"frontier", "search", "impostor", "environment_map", "exact"}
    assert not legend.get_window_extent().overlaps(axes.get_window_extent())
    # The point with no error at all is drawn at the floor, inside the axes.
    assert axes.get_ylim()[0] < view.floor < axes.get_ylim()[1]


def test_the_noise_band_is_drawn_where_there_is_noise_only(records):
    quiet = chart.frontier_chart(views(records)[0], looks(records)).axes[0]
    loud = [row | {"reference_noise": 0.02} for row in records]
    noisy = chart.frontier_chart(views(loud)[0], looks(loud)).axes[0]
    assert not any("noise" in text.get_text() for text in quiet.texts) and not quiet.patches
    assert any("noise" in text.get_text() for text in noisy.texts)
    (band,) = noisy.patches
    assert band.get_y() + band.get_height() == pytest.approx(0.02)


def test_the_parts_of_a_frame_sum_to_the_frame(records):
    for point in views(records)[0].points:
        assert sum(chart.parts(point)) == pytest.approx(point.time)


def test_the_interactive_chart_shows_the_same_points(records):
    view = views(records)[0]
    figure = json.loads(interactive.frontier_figure(view, looks(records)).to_json())
    traces = {t["name"]: t for t in figure["data"]}
    assert set(traces) == {"frontier", "search", "impostor", "environment_map", "exact"}
    assert len(traces["search"]["text"]) == 3 and "h_max=0.2" in traces["search"]["text"][2]
    # On a log axis shapes are at values and annotations at their logarithm.
    assert {shape["x0"] for shape in figure["layout"]["shapes"]} == {16.7, 11.1, 6.9}
    assert {round(10 ** a["x"], 3) for a in figure["layout"]["annotations"]} == {16.7, 11.1, 6.9}


# The page


class Outline(HTMLParser):
    """Open tags that are closed, ids, links, and the addresses that a browser would load."""

    VOID = frozenset("meta link img br input hr".split())

    def __init__(self, text: str):
        super().__init__()
        self.open: list[str] = []
        self.ids: list[str] = []
        self.targets: list[str] = []
        self.loads: list[str] = []
        self.tags: list[str] = []
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        found = dict(attrs)
        self.tags.append(tag)
        self.ids += [found["id"]] if "id" in found else []
        self.loads += [found["src"]] if "src" in found else []
        self.loads += [found["href"]] if tag == "link" else []
        self.targets += [found["href"]] if tag == "a" else []
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


@pytest.fixture(scope="module")
def run(records, tmp_path_factory):
    """A run and its report, with pictures of frame 0 only, of which one is missing and one is no picture."""
    tmp_path = tmp_path_factory.mktemp("run")
    results.write_results(tmp_path, records)
    origin.write_environment(tmp_path, origin.environment("llvm_ad_rgb"))
    folder = tmp_path / "images"
    folder.mkdir()
    ramp = np.tile(np.arange(48, dtype=np.uint8) * 5, (32, 1))
    where = ("kitchen", "lean", 0)
    Image.fromarray(np.dstack([ramp] * 3)).save(folder / naming.image_name(*where, "reference"))
    for method, params in [("search", f"h_max={h}") for h in (0.2, 0.1, 0.05)] + [("impostor", "steps=8")]:
        Image.fromarray(np.dstack([ramp] * 3)).save(folder / naming.image_name(*where, "image", method, params))
        Image.fromarray(ramp).save(folder / naming.image_name(*where, "error", method, params))
    (folder / naming.image_name(*where, "error", "impostor", "steps=8")).unlink()
    (folder / naming.image_name(*where, "image", "environment_map", "")).write_bytes(b"not a picture")
    assert report.write(tmp_path) == tmp_path / "report.html"
    return tmp_path


@pytest.fixture(scope="module")
def text(run):
    return (run / "report.html").read_text(encoding="utf-8")


def without_plotly(text: str) -> str:
    start = text.index("<script>")
    return text[:start] + text[text.index("</script>", start) :]


def test_the_page_is_one_file_that_opens_without_a_network(text):
    assert text.count("plotly.js v") == 1
    outline = Outline(text)
    assert outline.loads and all(address.startswith("data:") for address in outline.loads)
    assert "http" not in re.sub(r"data:[^\"]+", "", without_plotly(text)).lower()
    assert len(outline.ids) == len(set(outline.ids))
    assert {target.removeprefix("#") for target in outline.targets} <= set(outline.ids)


def test_the_page_answers_shows_and_explains(text):
    text = without_plotly(text)
    answer = text[text.index('id="answer"') : text.index('id="scene-0"')]
    cells = re.findall(r"<td>(?:<b>(\w+)</b>|<span class=\"soft\">(none)</span>)", answer)
    # Budgets 6.9, 11.1, 16.7 ms and any: times are 3, 4.4, 5.2, 7, 12, 24, 30 ms; nothing is seen in the other scene.
    assert [a or b for a, b in cells] == ["impostor", "search", "search", "exact"] + ["none"] * 4
    assert "the mirror is &lt;curved&gt; &amp; closed" in text and "<curved>" not in text
    assert "LLVM ERROR" in text and "no mirror in view" in text
    assert all(f"<code>{column.name}</code>" in text for column in columns.metrics())
    assert "numpy " + np.__version__ in text and "h-search" in text and "c1" in text
    assert text.count('class="sortable"') == 2


def test_the_page_has_the_pictures_there_are_and_says_which_are_missing(text):
    text = without_plotly(text)
    assert text.count('class="reference"') == 1
    # The best of the search and the impostor are shown, two others are folded; the broken file has no picture.
    assert "2 with other parameters" in text and text.count('class="flips"') == 4
    assert text.count(">no error map<") == 2 and text.count(">no picture<") == 1
    assert "The run has no pictures of this scene." in text


def test_a_run_of_nothing_but_failures_has_a_page(tmp_path):
    results.write_results(tmp_path, [record("a", status="crashed", reason=None, frame=None, flip=None, frame_ms=None)])
    text = report.write(tmp_path).read_text(encoding="utf-8")
    Outline(text)
    assert "there is no chart" in text and "no reason given" in text and "no environment.json" in text


def test_a_scene_name_cannot_break_out_of_the_page(tmp_path):
    name = "</script><img src=x onerror=alert(1)>"
    results.write_results(tmp_path, [record(name, "a=<b>", scene=name, config=name, reason=name)])
    outline = Outline(report.write(tmp_path).read_text(encoding="utf-8"))
    assert "img" not in outline.tags


def test_a_run_without_results_is_the_users_mistake(tmp_path):
    with pytest.raises(ValueError, match=r"results\.csv"):
        report.write(tmp_path)
    results.write_results(tmp_path, [])
    with pytest.raises(ValueError, match="no rows"):
        report.write(tmp_path)


def test_the_same_data_give_the_same_page_and_charts_byte_for_byte(run):
    files = [run / "report.html", *sorted((run / "figures").iterdir())]
    before = [file.read_bytes() for file in files]
    assert len(files) == 1 + 4 and {file.suffix for file in files} == {".html", ".png", ".svg"}
    report.write(run)
    assert [file.read_bytes() for file in files] == before


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (None, ""),
        (3, "3"),
        (0.0, "0"),
        (12.345, "12.3"),
        (0.012345, "0.0123"),
        (123456.0, "123456"),
        (2e-7, "2.00e-07"),
        (float("inf"), "inf"),
    ],
)
def test_numbers_have_three_digits_that_matter(value, text):
    assert page.number(value) == text


def decoded(url: str) -> np.ndarray:
    with Image.open(io.BytesIO(base64.b64decode(url.partition(",")[2]))) as image:
        return np.asarray(image.convert("RGB"))


def test_pictures_are_reduced_and_error_maps_coloured(tmp_path):
    file = tmp_path / "map.png"
    Image.fromarray(np.full((100, 1000), 255, np.uint8)).save(file)
    plain, coloured = (decoded(images.data_url(file, 500, coloured=c) or "") for c in (False, True))
    assert plain.shape == (50, 500, 3) and plain.min() == 255
    # Magma ends in a pale yellow, (252, 253, 191).
    assert np.abs(coloured.reshape(-1, 3).mean(axis=0) - [252, 253, 191]).max() < 3
    assert images.data_url(tmp_path / "none.png", 500) is None


def test_the_report_needs_neither_mitsuba_nor_drjit():
    """A fresh process that may import neither still has the report, the comparison and the results."""
    import subprocess
    import sys

    code = "import sys; sys.modules['mitsuba'] = sys.modules['drjit'] = None\n"
    code += "import benchharness.report, benchharness.tables.compare, benchharness.tables.results"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
