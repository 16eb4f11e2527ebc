"""The frontier by hand, points, labels and looks; all from records made here."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from support.drawn_records import families, record

from benchharness.report.frontier import DOMINATED, ON, PARTIAL, UNDECIDED, Place, classify, staircase
from benchharness.report.points import COLOURS, MARKERS, curves, looks, views

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


def test_a_label_is_what_differs_between_the_rows_of_a_method_whatever_it_is():
    texts = ["rule=near; steps=2", "rule=near; steps=4; late=True"]
    (view,) = views([*(record("m", text) for text in texts), record("lone", "rule=far"), record("odd", "no equals sign")])
    assert view.labels == {
        ("m", texts[0]): "steps=2",
        ("m", texts[1]): "steps=4; late=True",
        ("lone", "rule=far"): "",
        ("odd", "no equals sign"): "",
    }
    assert [point.name for point in view.points] == ["m (steps=2)", "m (steps=4; late=True)", "lone", "odd"]


def test_a_family_has_a_colour_of_its_own_and_its_members_differ_in_shade_and_marker():
    styles = looks(families())
    assert [styles[name].family for name in ("newton", "box", "mine")] == ["vertices", "maps", ""]
    first = [styles[name].colour for name in ("box", "newton", "mine")]
    assert len(set(first)) == 3 and set(first) <= set(COLOURS)
    assert styles["search"].marker != styles["newton"].marker and styles["search"].colour not in first
    many = looks([record(f"m{i:02}", family="one") for i in range(18)])
    assert len({(look.colour, look.marker, look.dash) for look in many.values()}) == 18
