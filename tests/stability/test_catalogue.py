"""The figures of the catalogue of failures, measured here; `PYTHONPATH=tests python -m catalogue.catalogue` prints them."""

from __future__ import annotations

import pytest
from catalogue import catalogue
from catalogue.catalogue_row import Elsewhere, Row, drawn_again

TABLE = catalogue.table()
MEASURED = [row for row in TABLE if isinstance(row, Row)]
NAMED = [row for row in TABLE if isinstance(row, Elsewhere)]


@pytest.mark.exhaustive
@pytest.mark.parametrize("row", MEASURED, ids=lambda row: f"{row.entry}: {row.what}")
def test_a_figure_lies_where_the_catalogue_or_a_reason_puts_it(row):
    assert row.low <= row.measure() <= row.high, f"catalogue: {row.catalogue}; {row.why}"


@pytest.mark.parametrize("row", NAMED, ids=lambda row: f"{row.entry}: {row.what}")
def test_what_another_test_pins_is_there(row):
    assert catalogue.exists(row.tested), row.tested


def test_a_test_that_is_not_there_is_missed():
    assert not catalogue.exists("test_catalogue.py::test_nothing")
    assert not catalogue.exists("test_nothing.py::test_nothing")


def test_every_row_is_named_once():
    names = [(row.entry, row.what) for row in TABLE]
    assert len(set(names)) == len(names)


def test_a_second_draw_spreads_like_the_root_of_two_counts():
    # 50 of 1000: spread 6.9 each, 9.7 of their difference, 2.58 of which hold 99 of 100.
    low, high = drawn_again(50, 1000)
    assert (low + high) / 2 == pytest.approx(50, abs=3)
    assert (high - low) / 2 == pytest.approx(25, abs=3)
    assert drawn_again(0, 300)[0] == 0
