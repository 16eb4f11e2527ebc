"""Rows of the table of the catalogue of failures: what was measured once elsewhere, and what is measured here."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from scipy.stats import betabinom


@dataclass(frozen=True)
class Row:
    """
    entry      of the catalogue of failures, or the section of the description of algorithms or of a paper, such as "RH06 3.1"
    what       the figure, its unit and its scene
    catalogue  what a prototype in float64 NumPy measured, as text; of a paper's section, what the paper says
    measure    what this project's kernels measure; of what it has no kernel for, an experiment in float64
    low, high  what is accepted, both included
    why        why that much; where the figures differ by design, why
    """

    entry: str
    what: str
    catalogue: str
    measure: Callable[[], float]
    low: float
    high: float
    why: str


@dataclass(frozen=True)
class Elsewhere:
    """A figure that another test pins: `tested` is its file and function; `why` as above."""

    entry: str
    what: str
    catalogue: str
    ours: str
    tested: str
    why: str = ""


def drawn_again(count: int, of: int) -> tuple[int, int]:
    """Between which two numbers a second draw of `of` lies in 99 cases of 100 if the first had `count`."""
    low, high = betabinom(of, count + 0.5, of - count + 0.5).interval(0.99)
    return int(low), int(high)


def within(value: float, share: float) -> tuple[float, float]:
    return value * (1 - share), value * (1 + share)
