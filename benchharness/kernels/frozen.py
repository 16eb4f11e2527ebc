"""Recorded functions: traced once per set of array types and sizes in Python, then replayed without tracing."""

from __future__ import annotations

import drjit as dr

RECORDINGS = 1000
"""More than this in a process are a mistake. Every size of picture, window, list and scene is one; Dr.Jit warns at 10."""

frozen = dr.freeze(warn_after=RECORDINGS)
