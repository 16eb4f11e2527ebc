"""What parent and child of ours have in common: a channel of lines of JSON, an end together, and words about an end.

What comes out of a child was written by plugins. It is data, never pickled, and is cleaned here, where it enters.
"""

from __future__ import annotations

import contextlib
import json
import os
import queue
import re
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

LONGEST = 4_000
"""Characters kept of a text that a child sends: what it says is read by people, in tables."""
TAIL = 400
"""Characters of a log that a reason quotes at most."""
LAST_WORDS_S = 10.0
"""How long a child may take to end after it closed its stdout."""

# Control characters but for tab and line feed, half surrogates, and what turns the direction of writing.
_UNFIT = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069\ud800-\udfff]")


def clean(value: Any) -> Any:
    """Plain data without what no file or terminal takes: texts of at most LONGEST characters, unfit ones replaced."""
    if isinstance(value, str):
        if len(value) > LONGEST:
            value = f"{value[: LONGEST - 100]} ... ({len(value):,} characters)"
        return _UNFIT.sub("\ufffd", value)
    if isinstance(value, dict):
        return {clean(key): clean(item) for key, item in value.items()}
    return [clean(item) for item in value] if isinstance(value, list) else value


class Child:
    """`python -m module`, in a session of its own and an environment of ours, that says lines of JSON, each an object.

    What it says is cleaned. Its stderr is added to the end of `log`. End it with `end`, in any case.
    """

    def __init__(self, module: str, *arguments: str, log: Path, **environment: str) -> None:
        self._log = log
        with open(log, "ab") as stream:
            self._start = stream.tell()
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-m", module, *arguments],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=stream,
                env=surroundings() | environment,
                start_new_session=True,
            )
        self._lines: queue.SimpleQueue[bytes] = queue.SimpleQueue()
        threading.Thread(target=self._read, daemon=True).start()  # so that waiting can have a limit

    def _read(self) -> None:
        assert self._process.stdout is not None
        with self._process.stdout as stream:
            for line in stream:
                self._lines.put(line)
        self._lines.put(b"")

    def next(self, timeout_s: float | None) -> dict[str, Any] | None:
        """The next line; None at the end, half a line of a child that was killed included. No `timeout_s`: waits for ever.

        Raises TimeoutError where none comes in time, ValueError for what is no JSON object.
        """
        try:
            line = self._lines.get(timeout=None if timeout_s is None else max(0.0, timeout_s))
        except queue.Empty:
            raise TimeoutError from None
        if not line.endswith(b"\n"):
            return None
        try:
            said = json.loads(line)
        except (ValueError, RecursionError):
            said = None
        if not isinstance(said, dict):
            raise ValueError(f"it said what nobody understands: {clean(line[:80].decode(errors='replace'))}")
        return clean(said)

    def tell(self, line: dict[str, Any]) -> None:
        """Sends a line of JSON to its stdin. Raises BrokenPipeError where nobody reads there any more."""
        assert self._process.stdin is not None
        self._process.stdin.write((json.dumps(line) + "\n").encode())
        self._process.stdin.flush()

    def cause(self) -> str:
        """What it ended with, once `next` was None: "SIGABRT", or "a closed channel" where it has not ended."""
        try:
            return cause(self._process.wait(timeout=LAST_WORDS_S))
        except subprocess.TimeoutExpired:
            return "a closed channel"

    def words(self) -> str:
        """The last lines that it left in the log, in one; Python's account of a native crash only if there are no others."""
        with open(self._log, "rb") as stream:
            size = stream.seek(0, os.SEEK_END)
            stream.seek(max(self._start, size - 64 * TAIL))
            text = stream.read().decode(errors="replace")
        said, _, stack = text.partition("Fatal Python error")
        lines = [line.strip() for line in (said.strip() or stack).splitlines() if line.strip()]
        return clean(" | ".join(lines[-3:])[-TAIL:])

    def kill(self) -> None:
        """From another thread than the one that listens, which hears of its end, and calls `end`."""
        self._process.kill()

    def end(self) -> None:
        """Kills it with whatever it started; the reading thread closes its stdout when nobody holds the other end any more."""
        if self._process.returncode is None:  # nobody waited for it yet, so that the number of its group is still its own
            if os.name == "posix":
                with contextlib.suppress(ProcessLookupError, PermissionError):
                    os.killpg(self._process.pid, signal.SIGKILL)
            self._process.kill()
        self._process.wait()
        assert self._process.stdin is not None
        with contextlib.suppress(BrokenPipeError):
            self._process.stdin.close()


def search_path() -> tuple[str, ...]:
    """The folders that we import from, whatever the working folder becomes."""
    return tuple(entry or os.getcwd() for entry in sys.path)


def surroundings(path: Sequence[str] | None = None) -> dict[str, str]:
    """The environment of a child that imports from the folders `path`; None: from those that we import from."""
    return {**os.environ, "PYTHONPATH": os.pathsep.join(search_path() if path is None else path)}


def cause(code: int) -> str:
    """SIGABRT, or an exit code."""
    if code >= 0:
        return f"exit code {code}"
    try:
        return signal.Signals(-code).name
    except ValueError:
        return f"signal {-code}"


def channel() -> Callable[[dict], None]:
    """In the child: what says our lines of JSON on the given stdout. Everybody else's go to stderr, which is the log."""
    channel = os.dup(1)
    os.dup2(2, 1)

    def say(line: dict) -> None:
        data = (json.dumps(line, default=_plain) + "\n").encode()
        while data:
            data = data[os.write(channel, data) :]

    return say


def _plain(value: Any) -> Any:
    """A NumPy scalar as a Python number."""
    return value.item()


def end_with_parent(parent: int, heard: Callable[[bytes], None] = lambda line: None) -> None:
    """In the child: the kernel kills us with our parent (Linux); elsewhere we see that stdin is closed. No core files.

    `heard` is given the lines that come on stdin, by the thread that watches it. Others find stdin empty.
    """
    if sys.platform == "linux":
        import ctypes

        PR_SET_PDEATHSIG = 1  # linux/prctl.h
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
        if os.getppid() != parent:  # it died before we asked
            os._exit(1)
    with contextlib.suppress(ImportError):
        import resource

        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    pipe = os.fdopen(os.dup(0), "rb")
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.close(nothing)

    def watch_stdin() -> None:
        with contextlib.suppress(OSError, ValueError):
            for line in pipe:
                heard(line)
        os._exit(1)

    threading.Thread(target=watch_stdin, daemon=True).start()
