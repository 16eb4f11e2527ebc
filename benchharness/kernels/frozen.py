"""Recorded functions: traced once per set of array types and sizes in Python, then replayed without tracing."""

from __future__ import annotations

import functools
import gc

import drjit as dr

RECORDINGS = 1000
"""More than this in a process are a mistake. Every size of picture, window, list and scene is one; Dr.Jit warns at 10."""


def frozen(function):
    """`dr.freeze` without garbage collection: a Mitsuba scene that is freed while a function is recorded ends the process."""
    recorded = dr.freeze(function, warn_after=RECORDINGS)

    @functools.wraps(function)
    def call(*args, **kwargs):
        collects = gc.isenabled()
        gc.disable()
        try:
            return recorded(*args, **kwargs)
        finally:
            if collects:
                gc.enable()

    return call
