"""How long a run will take, before it begins."""

from __future__ import annotations

import pytest

from benchharness.execution import estimate


@pytest.mark.parametrize(
    ("seconds", "words"),
    [(0.2, "1 s"), (42.4, "42 s"), (100, "2 min"), (3600, "60 min"), (9000, "2.5 h"), (90_000, "25 h"), (1e6, "12 days")],
)
def test_times_are_said_in_a_unit_that_fits(seconds, words):
    assert estimate.in_words(seconds) == words


def test_more_than_an_hour_is_to_be_asked_for():
    told = []
    estimate.agreed("9 rows", 3600.0, told.append, yes=False)
    estimate.agreed("9 rows", 3601.0, told.append, yes=True)
    assert told == ["9 rows: about 60 min", "9 rows: about 60 min"]
    with pytest.raises(ValueError, match=r"9 rows take about 2\.8 h; accepted: fewer of them, or --yes"):
        estimate.agreed("9 rows", 1e4, told.append, yes=False)
