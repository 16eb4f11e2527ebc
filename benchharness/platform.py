"""What the harness asks of the machine: LLVM for Dr.Jit, a variant for Mitsuba, and to be alone while it times.

Importing this module imports neither Dr.Jit nor Mitsuba, so that `use_llvm` can speak before they look for LLVM: the package
calls it, whichever of its modules is imported first.
"""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

VARIANTS = ("llvm_ad_rgb", "cuda_ad_rgb")
"""Variants that can time a method. `scalar_rgb` runs without LLVM or CUDA, but compiles no kernels."""


class EnvironmentBroken(RuntimeError):
    """Something outside the user's input is missing; the message says how to mend it. Exit code 5."""


def bundled_llvm(prefix: str | Path = sys.prefix) -> Path | None:
    """The libLLVM.so that karellen-llvm-core puts into the environment's lib/, or None."""
    library = Path(prefix) / "lib" / "libLLVM.so"
    return library if library.exists() else None


def use_llvm() -> str | None:
    """Points Dr.Jit at the environment's own LLVM, unless the user named one in DRJIT_LIBLLVM_PATH.

    Returns the path in force, or None where Dr.Jit has to search the system. Has to run before `import drjit`.
    """
    library = bundled_llvm()
    if "DRJIT_LIBLLVM_PATH" not in os.environ and library is not None:
        os.environ["DRJIT_LIBLLVM_PATH"] = str(library)
    return os.environ.get("DRJIT_LIBLLVM_PATH")


def use_variant(variant: str) -> None:
    """Sets Mitsuba's variant once for this process. Raises EnvironmentBroken where it cannot be set."""
    try:
        import mitsuba as mi

        if mi.variant() != variant:
            mi.set_variant(variant)
    except ImportError as error:
        raise EnvironmentBroken(
            f"variant {variant} cannot be used: {error}\nmend: run `benchharness doctor`; it probes every variant"
        ) from error


def use_any_variant() -> None:
    """Sets the first variant that can be set, so that plugins can be imported to be looked at."""
    for variant in VARIANTS:
        try:
            return use_variant(variant)
        except EnvironmentBroken:
            continue
    return use_variant("scalar_rgb")


@contextmanager
def alone(say: Callable[[str], None]) -> Iterator[None]:
    """Holds this machine's timing lock: one job at a time is timed on a machine, whoever starts it.

    `say` hears about it when another run holds the lock and this one waits. The lock goes with the process.
    """
    try:
        import fcntl
    except ImportError:  # not a Unix: two runs at once are the user's to avoid
        yield
        return
    with open(Path(tempfile.gettempdir()) / f"benchharness-{os.getuid()}.lock", "w") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            say("another run is timing on this machine; waiting for it to end")
            fcntl.flock(lock, fcntl.LOCK_EX)
        yield
