"""What the harness asks of the machine: LLVM for Dr.Jit, a variant for Mitsuba, and to be alone while it times.

Importing this module imports neither Dr.Jit nor Mitsuba, so that `use_llvm` can speak before they look for LLVM: the package
calls it, whichever of its modules is imported first.
"""

from __future__ import annotations

import errno
import os
import platform as machine
import stat
import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext
from pathlib import Path

import platformdirs

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


def machine_lock() -> Path:
    """The file whose lock says that this user is timing on this machine. Homes may be shared by machines, hence its name."""
    return Path(platformdirs.user_state_dir("benchharness")) / f"timing-{machine.node() or 'here'}.lock"


@contextmanager
def alone(say: Callable[[str], None]) -> Iterator[None]:
    """Holds this machine's timing lock: one process of a user is timed on a machine at a time, whoever starts it.

    `say` hears about it when another process holds the lock and this one waits. The lock goes with the process. Raises
    EnvironmentBroken where there can be no lock.
    """
    path = see_machine_lock()
    with locked(path, lambda: say("another run is timing on this machine; waiting for it to end")):
        yield


def see_machine_lock() -> Path:
    """The file of the timing lock, made where there is none. Raises EnvironmentBroken where it cannot be locked."""
    path = machine_lock()
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        os.close(_lock_file(path))
    except OSError as error:
        raise EnvironmentBroken(
            f"the lock for timing, {path}, cannot be held: {error.strerror}\n"
            "mend: let it be a plain file of yours, or name a folder that can be written in XDG_STATE_HOME"
        ) from error
    return path


def locked(path: Path, busy: Callable[[], None]) -> AbstractContextManager[object]:
    """Locks a file, until the context that is returned, or the process, ends. The file is made where there is none; it is
    never written to, and a link in its place is not followed.

    `busy` is called where another process holds the lock; if it returns, this one waits. Raises OSError for what cannot
    be locked.
    """
    try:
        import fcntl
    except ImportError:  # not a Unix: two runs at once are the user's to avoid
        return nullcontext()
    with ExitStack() as held:
        file = _lock_file(path)
        held.callback(os.close, file)
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            busy()
            fcntl.flock(file, fcntl.LOCK_EX)
        return held.pop_all()


def _lock_file(path: Path) -> int:
    """The descriptor of a plain file to lock. Raises OSError for a link, a folder, a device."""
    no_link = getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)
    file = os.open(path, os.O_RDWR | os.O_CREAT | no_link, 0o600)
    if not stat.S_ISREG(os.fstat(file).st_mode):
        os.close(file)
        raise OSError(errno.EINVAL, "it is no plain file", str(path))
    return file
