"""The charts by their data, the page by its structure; all from records made here."""

from __future__ import annotations

import base64
import io
import json
import re
from html.parser import HTMLParser

import numpy as np
import pytest
from PIL import Image
from support.drawn_records import families, record, swept

from benchharness import report
from benchharness.report import chart, images, interactive, labels, page
from benchharness.report.points import looks, views
from benchharness.tables import columns, naming, origin, results

# Charts


def test_legends_have_a_heading_for_each_family_and_a_method_is_one_trace():
    records = families()
    view = views(records)[0]
    figure = chart.frontier_chart(view, looks(records))
    (legend,) = figure.legends
    words = [text.get_text() for text in legend.get_texts()]
    assert words == ["frontier", "maps", "box", "sweep", "vertices", "newton", "search", "mine"]
    assert {text.get_text() for text in legend.get_texts() if text.get_fontweight() == "bold"} == {"maps", "vertices"}
    drawn = json.loads(interactive.frontier_figure(view, looks(records)).to_json())
    assert drawn["layout"]["legend"]["groupclick"] == "toggleitem"
    traces = {trace["name"]: trace for trace in drawn["data"]}
    assert len(traces) == len(drawn["data"]) == 6
    assert [traces[name]["legendgroup"] for name in ("box", "newton", "mine")] == ["maps", "vertices", "mine"]
    assert traces["box"]["legendgrouptitle"]["text"] == "maps" and "text" not in traces["mine"].get("legendgrouptitle", {})
    sweep = traces["sweep"]
    assert sweep["x"] == [4.0, 9.0, None, 4.0, 9.0] and sweep["text"][2] == ""
    assert sweep["text"][0].replace("<br>", "; ") == "rule=a; n=4"


def test_labels_of_points_at_one_place_are_beside_one_another_or_left_out():
    crowd = [record("m", f"n={n}; rule=x{n}", time=8.0, flip=0.1) for n in range(7)]
    records = [
        *crowd,
        record("far", "k=1", time=20.0, flip=0.3),
        record("far", "k=2", time=20.0, flip=0.01),
        record("lone", "z=1"),
    ]
    figure = chart.frontier_chart(views(records)[0], looks(records))
    figure.draw_without_rendering()
    texts = [text for text in figure.axes[0].texts if "=" in text.get_text()]
    assert sorted(text.get_text() for text in texts) == ["k=1", "k=2", "n=0 ...", "n=1 ...", "n=2 ...", "n=3 ..."]
    boxes = [text.get_window_extent() for text in texts]
    assert not any(a.overlaps(b) for i, a in enumerate(boxes) for b in boxes[:i])


def test_a_label_says_what_tells_a_point_from_the_others_of_its_method():
    every = ["px=2; split=2", "px=2; split=8", "px=2; split=None", "px=4; split=None"]
    told = [labels.shortened(label, every[:k] + every[k + 1 :]) for k, label in enumerate(every)]
    assert told == ["split=2 ...", "split=8 ...", "px=2; split=None", "px=4 ..."]
    assert labels.shortened("alone=1", []) == "alone=1"


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
    assert traces["search"]["text"] == ["h_max=0.05", "h_max=0.1", "h_max=0.2"]
    assert "h_max=0.2" in traces["search"]["hovertext"][2] and traces["exact"]["text"] == [""]
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
