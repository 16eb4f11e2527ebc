"""Recorded functions: traced once per set of array types and sizes in Python, then replayed without tracing."""

from __future__ import annotations

import functools
import gc
from collections.abc import Callable
from typing import ParamSpec, TypeVar

import drjit as dr

P = ParamSpec("P")
R = TypeVar("R")
RECORDINGS = 1000
"""More than this in a process are a mistake. Every size of picture, window, list and scene is one; Dr.Jit warns at 10."""


def frozen(function: Callable[P, R]) -> Callable[P, R]:
    """`dr.freeze` without garbage collection: a Mitsuba scene that is freed while a function is recorded ends the process."""
    recorded = dr.freeze(function, warn_after=RECORDINGS)

    @functools.wraps(function)
    def call(*args: P.args, **kwargs: P.kwargs) -> R:
        collects = gc.isenabled()
        gc.disable()
        try:
            return recorded(*args, **kwargs)
        finally:
            if collects:
                gc.enable()

    return call
