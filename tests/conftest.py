"""LLVM is chosen before any test module can import Dr.Jit; the variant is set once, where a test needs one."""

from __future__ import annotations

import sys

import pytest

from benchharness import platform

platform.use_llvm()


@pytest.fixture(scope="session", autouse=True)
def variant() -> str | None:
    """Sets llvm_ad_rgb if a collected test module has imported Mitsuba; NumPy-only tests stay quick."""
    if "mitsuba" not in sys.modules:
        return None
    platform.use_variant("llvm_ad_rgb")
    return "llvm_ad_rgb"
