"""LLVM is chosen before any test module can import Dr.Jit, by importing us; the variant is set once, where a test needs one.

`BENCHHARNESS_TEST_VARIANT=cuda_ad_rgb pytest tests/kernels/test_hierarchy.py` tests kernels on a graphics card.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest

from benchharness import platform

LONG = (
    "methods/test_guarantees.py",
    "methods/test_fuzz.py",
    "kernels/vertices/test_roots.py",
    "execution/test_planted.py",
    "execution/test_check.py",
    "test_wheel.py",
    "test_own_files_docs.py",
    "needs/test_lean_scenes.py",
    "tables/test_damaged_tables.py",
)
"""What takes longest comes first: no worker is left with it when the others have done."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    places = {Path(__file__).parent / name: k for k, name in enumerate(LONG)}
    items.sort(key=lambda item: places.get(item.path, len(LONG)))


@pytest.fixture(scope="session", autouse=True)
def variant() -> str | None:
    """Sets the variant if a collected test module has imported Mitsuba; NumPy-only tests stay quick.

    Threads are left as they are: with a single one Mitsuba never returns from writing an EXR file.
    """
    if "mitsuba" not in sys.modules:
        return None
    chosen = os.environ.get("BENCHHARNESS_TEST_VARIANT", "llvm_ad_rgb")
    platform.use_variant(chosen)
    return chosen


@pytest.fixture
def plugins_here(monkeypatch):
    """Plugins are imported in this process, which is quicker; for tests whose plugins do no harm."""
    from support.here import Here

    import benchharness.stability.plan
    import benchharness.study.config

    monkeypatch.setattr(benchharness.study.config, "Apart", Here)
    monkeypatch.setattr(benchharness.stability.plan, "Apart", Here)


@pytest.fixture(scope="session", autouse=True)
def cache(tmp_path_factory):
    """What tests bake and render is made once for all of them; what the user has cached is neither taken nor added to.

    Each process that tests has the machine to itself, as far as locks say: no test waits for what another one times.
    """
    base = tmp_path_factory.getbasetemp()
    folder = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "cache"
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("BENCHHARNESS_CACHE", str(folder))
        patch.setenv("XDG_STATE_HOME", str(base / "state"))
        yield


@pytest.fixture(scope="session")
def room():
    """A mirror ball in a room; the camera goes round it."""
    from support.mirror_room import mirror_room, orbit

    return mirror_room(camera=orbit(0.4))


@pytest.fixture(scope="session")
def renderer(room):
    from support.mirror_room import SIZE

    from benchharness.render.frame import FrameRenderer

    return FrameRenderer(room, *SIZE)


@pytest.fixture(scope="session")
def truth_of_room(room):
    from support.answers import picture

    return picture(room)
