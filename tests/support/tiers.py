"""Which parameters of a test are in the first tier, `make test`; the others are marked `exhaustive`, for `make test-rest`. Of
pairs, which are many, some of these are marked `complete`, too, and left to `make test-all`.

What is in the first tier depends on nothing but the order of the parameters: it is the same on every machine and in every run.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import pytest

exhaustive = pytest.mark.exhaustive
complete = pytest.mark.complete


def first(values: Iterable, chosen: Iterable) -> list:
    """The values as parameters; all but those chosen are exhaustive. A choice that is no value is refused."""
    values, chosen = list(values), list(chosen)
    assert all(value in values for value in chosen), f"{[c for c in chosen if c not in values]} are not among {values}"
    return [value if value in chosen else pytest.param(value, marks=exhaustive) for value in values]


def every(step: int, values: Iterable) -> list:
    """The values, tuples of parameters each, of which every so many-th is in the first tier, beginning with the first."""
    return [pytest.param(*value, marks=() if k % step == 0 else exhaustive) for k, value in enumerate(values)]


def in_turns(ones: Iterable[str], others: Sequence[str]) -> list[tuple[str, str]]:
    """Each of some names with one of others, which take turns: any len(others) pairs in a row hold each of them once."""
    return [(one, others[k % len(others)]) for k, one in enumerate(ones)]


def paired(ones: Iterable[str], others: Iterable[str], drawn: Iterable[tuple[str, str]], step: int = 4) -> list:
    """All pairs of two lists of names as parameters; all but those drawn are exhaustive, and of these all but every so many-th,
    in turns of the others for each name, complete."""
    others, drawn = list(others), set(drawn)
    made = []
    for i, one in enumerate(ones):
        for k, other in enumerate(others):
            marks = () if (one, other) in drawn else (exhaustive,) if (i + k) % step == 0 else (exhaustive, complete)
            made.append(pytest.param(one, other, id=f"{one}-{other}", marks=marks))
    return made


def up_to_the_rest(parameters: Iterable) -> list[tuple]:
    """The values of those parameters that are not left to `make test-all`."""
    return [p.values for p in parameters if complete.name not in {mark.name for mark in p.marks}]
