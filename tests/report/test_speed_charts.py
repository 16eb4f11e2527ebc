"""The charts of times show what the tables say, from the files alone."""

from __future__ import annotations

import numpy as np
import pytest
from support.ink import ink, pixels

from benchharness.report import speed as charts
from benchharness.tables import files, speed


def vertices(folder) -> None:
    rows = [
        {"detail": detail, "method": method, "vertices": n, "frame_ms": slope * n + 5.0, "flip": flip}
        for detail, n_all in (("lean", (1000, 4000)), ("paper", (2000,)))
        for method, slope, flip in ((speed.UNREFLECTED, 0.001, None), ("nan", 0.002, 0.1), ("search", 0.003, 0.2))
        for n in n_all
    ]
    files.write(folder / speed.VERTICES, rows, "detail method vertices frame_ms flip".split())
    fits = [{"detail": "lean", "method": "nan", "ms_per_1000_vertices": -2.0}, {"detail": "paper", "method": "nan"}]
    files.write(folder / speed.FITS, fits, "detail method ms_per_1000_vertices".split())


def test_a_line_per_method_and_a_panel_per_detail(tmp_path):
    vertices(tmp_path)
    figure = charts.vertices(tmp_path)
    time, error, other, _ = figure.axes
    assert [line.get_label() for line in time.lines] == [speed.UNREFLECTED, "nan (-2.00 ms per 1000)", "search"]
    assert [line.get_label() for line in error.lines] == ["nan", "search"]
    np.testing.assert_array_equal(time.lines[2].get_xydata(), [[1.0, 8.0], [4.0, 17.0]])
    np.testing.assert_array_equal(error.lines[1].get_ydata(), [0.2, 0.2])
    assert [line.get_label() for line in other.lines] == [speed.UNREFLECTED, "nan", "search"]


def test_steps_are_shares_of_vertices_and_the_longest_are_one_bar(tmp_path):
    cases = [{"case": name, "mean": 7.0, "max": 30} for name in ("one", "two")]
    files.write(tmp_path / speed.ITERATIONS, cases, ["case", "mean", "max"])
    counts = [("one", 2, 6), ("one", 19, 1), ("one", 25, 2), ("one", 30, 1), ("two", 1, 5)]
    steps = [dict(zip(("case", "iterations", "vertices"), row, strict=True)) for row in counts]
    files.write(tmp_path / speed.STEPS, steps, ["case", "iterations", "vertices"])
    pictures = np.full((2, 6, 8), np.nan, np.float32)
    pictures[:, 2:5, 1:4] = 3.0
    np.savez_compressed(tmp_path / speed.PICTURES, pictures=pictures)
    figure = charts.iterations(tmp_path)
    above, below = figure.axes[0], figure.axes[1]
    assert above.get_title() == "one" and above.images[0].get_array().shape == (3, 3)
    heights = [bar.get_height() for bar in below.patches]
    # Bars are for 1, 2, ... 19, and 20 or more.
    assert heights == pytest.approx([0, 0.6, *[0] * 16, 0.1, 0.3])
    assert below.get_title() == "mean 7.0, most 30"


def test_frames_per_second_stand_beside_the_papers(tmp_path):
    rows = [
        dict(table=table, setting=setting, quantity=quantity, ours=ours, ours_lo=ours - 1, ours_hi=ours + 1, paper=paper)
        for table, setting, quantity, ours, paper in (
            (speed.REFLECTORS, "1", speed.FRAME, 50.0, 166),
            (speed.REFLECTORS, "1", speed.SHADE, 4.0, None),
            (speed.REFLECTORS, "2", speed.FRAME, 40.0, None),
            (speed.SIZE, "1000x500", speed.FRAME, 30.0, 46),
            (speed.SIZE, "1000x500", speed.SHADE, 8.0, None),
            ("memory", "n = 60", "bytes", 7.0, None),
        )
    ]
    files.write(tmp_path / speed.IMPOSTORS, rows, "table setting quantity ours ours_lo ours_hi paper".split())
    mirrors, pixels = charts.impostors(tmp_path).axes
    frames, shades, paper = (line.get_xydata().tolist() for line in mirrors.lines)
    assert (frames, shades, paper) == ([[1, 50], [2, 40]], [[1, 250]], [[1, 166]])
    assert pixels.lines[0].get_xydata().tolist() == [[0.5, 30.0]]


def test_only_what_has_tables_is_drawn(tmp_path):
    assert charts.write(tmp_path) == []
    vertices(tmp_path)
    assert charts.write(tmp_path) == [tmp_path / speed.VERTICES_CHART]
    colours = {line.get_color() for axes in charts.vertices(tmp_path).axes for line in axes.lines}
    picture = pixels(tmp_path / speed.VERTICES_CHART)
    assert len(colours) == 3 and all(ink(picture, colour) > 50 for colour in colours)


def test_a_damaged_table_says_where(tmp_path):
    vertices(tmp_path)
    table = tmp_path / speed.VERTICES
    table.write_text(table.read_text().replace("4000", "many", 1))
    with pytest.raises(ValueError, match=r"vertices\.csv: line 3, column 'vertices' is 'many'"):
        charts.write(tmp_path)
