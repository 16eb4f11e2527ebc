"""`check-method`: does a method keep the contract of `benchharness.api`? A list of pass, warn and fail (`findings`).

The method runs in a child process, since a kernel that is wrong may abort: `python -m benchharness.execution.check FILE[:Name]
PARENT` says one finding per line as JSON.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from dataclasses import asdict
from pathlib import Path

from benchharness import platform, processes
from benchharness.execution.finding import Finding
from benchharness.study import plugins

TIMEOUT_S = 300.0
LEVELS = ("pass", "warn", "fail")


def check(spec: str) -> list[Finding]:
    """Checks the method of `file.py` or `file.py:Name` in a child process. Raises ValueError for no file."""
    path = Path(plugins.absolute(spec, Path.cwd()).rpartition(".py")[0] + ".py")
    if not path.is_file():
        raise ValueError(f"check-method: there is no file {path}; accepted: file.py or file.py:Name")
    found: list[Finding] = []
    with tempfile.TemporaryDirectory(prefix="benchharness-") as folder:
        arguments = plugins.absolute(spec, Path.cwd()), str(os.getpid())
        child = processes.Child("benchharness.execution.check", *arguments, log=Path(folder) / "log")
        try:
            ending = _heard(child, found)
        finally:
            child.end()
        words = child.words()
    if ending is not None:
        found.append(Finding("fail", f"{ending}: {words or 'no word'}"))
    return found


def _heard(child: processes.Child, found: list[Finding]) -> str | None:
    """Adds what a child finds; returns how it ended, None if it said that this was all."""
    deadline = time.monotonic() + TIMEOUT_S
    try:
        while (said := child.next(deadline - time.monotonic())) is not None:
            if "all" in said:
                return None
            level = said.get("level")
            found.append(Finding(level if level in LEVELS else "fail", str(said.get("text"))))
        return f"the process ended with {child.cause()} before it was done"
    except TimeoutError:
        return f"no end within {TIMEOUT_S:g} s"
    except ValueError as error:
        return str(error)


def main(spec: str, parent: int) -> None:
    """In the child: one line of JSON per finding, and a last word."""
    say = processes.channel()
    processes.end_with_parent(parent)
    platform.use_variant("llvm_ad_rgb")
    try:
        plugin = plugins.from_path("method", spec, Path.cwd(), "check-method")
    except ValueError as error:
        say({"level": "fail", "text": str(error)})
    else:
        from benchharness.execution.findings import findings

        for finding in findings(plugin):
            say(asdict(finding))
    say({"all": True})


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
