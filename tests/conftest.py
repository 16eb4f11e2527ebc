"""LLVM is chosen before any test module can import Dr.Jit; the variant is set once, for the tests that need one."""

from __future__ import annotations

import pytest

from benchharness import platform

platform.use_llvm()


@pytest.fixture(scope="session", autouse=True)
def variant(request: pytest.FixtureRequest) -> str | None:
    """Sets llvm_ad_rgb if any collected test module uses Mitsuba or Dr.Jit; NumPy-only tests stay quick."""
    modules = {item.module for item in request.session.items if isinstance(item, pytest.Function)}
    if not any(name in vars(module) for module in modules for name in ("mi", "dr", "mitsuba", "drjit")):
        return None
    platform.use_variant("llvm_ad_rgb")
    return "llvm_ad_rgb"
