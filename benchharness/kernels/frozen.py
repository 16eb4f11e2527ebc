"""Recorded functions: traced once per set of array types and sizes in Python, then replayed without tracing."""

from __future__ import annotations

import functools
import gc
import re
from collections.abc import Callable, Iterator
from dataclasses import fields, is_dataclass
from itertools import chain
from typing import Any, ParamSpec, TypeVar

import drjit as dr

P = ParamSpec("P")
R = TypeVar("R")
RECORDINGS = 1000
"""More than this in a process are a mistake. Every size of picture, window, list and scene is one; Dr.Jit warns at 10."""


_ARRAYS = re.compile(r"(list\[)?(mi\.(Bool|Float|Int32|UInt32|UInt64|[A-Z][a-z]+[234][fiu])( \| None)?)\]?( \| None)?")


def frozen(function: Callable[P, R]) -> Callable[P, R]:
    """`dr.freeze` without garbage collection: a Mitsuba scene that is freed while a function is recorded ends the process.

    All plain numbers among the arguments are also told as one text. Dr.Jit 1.5.0 takes some that differ for equal, such as a
    picture of 64 x 64 for one of 64 x 8, and replays what it recorded for the other.

    A replayed kernel is as wide as its widest direct input, or as that times what it was when it was recorded. A function whose
    kernels have no such input, because numbers say how wide they are, is `frozen_by_width`.
    """
    return _recorded(function, _numbers)


def frozen_by_width(function: Callable[P, R]) -> Callable[P, R]:
    """The same, recorded anew for every width of its arrays, too: for kernels that gather from arrays of any width, and are as
    wide as numbers say."""
    return _recorded(function, lambda arguments: chain(_numbers(arguments), _widths(arguments)))


def _recorded(function: Callable[P, R], tell: Callable[[Any], Iterator[int | float]]) -> Callable[P, R]:
    """The function, recorded; `tell` says which numbers of its arguments make another recording."""

    def told(numbers: str, *args: P.args, **kwargs: P.kwargs) -> R:
        return function(*args, **kwargs)

    recorded = dr.freeze(told, warn_after=RECORDINGS)

    @functools.wraps(function)
    def call(*args: P.args, **kwargs: P.kwargs) -> R:
        numbers = " ".join(map(repr, tell((args, kwargs))))
        collects = gc.isenabled()
        gc.disable()
        try:
            return recorded(numbers, *args, **kwargs)
        finally:
            if collects:
                gc.enable()

    return call


def roomy(count: int) -> int:
    """`count` rounded up to three significant bits and a multiple of 16, not 0: a few sizes, so that few are recorded."""
    step = 1 << max(count.bit_length() - 3, 4)
    return max(-(-count // step), 1) * step


def _numbers(value: Any) -> Iterator[int | float]:
    """All Python numbers in a tree of arguments, in order."""
    if isinstance(value, int | float):
        yield value
    elif isinstance(value, tuple | list):
        for one in value:
            yield from _numbers(one)
    elif isinstance(value, dict):
        yield from _numbers(list(value.values()))
    else:
        for name in _names(type(value)):
            yield from _numbers(getattr(value, name))


def _widths(value: Any) -> Iterator[int]:
    """The widths of all arrays in a tree of tuples, in order."""
    if isinstance(value, tuple):
        for one in value:
            yield from _widths(one)
    elif isinstance(value, dict):
        yield from _widths(tuple(value.values()))
    elif dr.is_array_v(value):
        yield dr.width(value)


@functools.cache
def _names(kind: type) -> tuple[str, ...]:
    """The fields of a dataclass that may hold a number; none of another type. What is annotated as arrays alone is passed by:
    this is asked for every call."""
    if not is_dataclass(kind):
        return ()
    return tuple(field.name for field in fields(kind) if not _ARRAYS.fullmatch(str(field.type)))
