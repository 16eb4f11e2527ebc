"""Calls of ours that import and build plugins, made in a child process, so that the one that keeps results survives them.

    with Apart("llvm_ad_rgb") as apart:
        apart.call("benchharness.study.loading:describe", "list", kind="method", name="newton")

A plugin may abort, leave, loop for ever or raise what it likes: each is a ValueError that says so, and the next call
finds a new child. `python -m benchharness.study.apart` is the child; requests and answers are lines of JSON:

    {"call": "module:function", "arguments": {...}}   ->   {"value": ...} or {"error": "..."}

Before the first answer it says {"ready": true}, or {"broken": "..."} where the variant cannot be used.
"""

from __future__ import annotations

import faulthandler
import importlib
import json
import os
import queue
import sys
import tempfile
import traceback
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchharness import platform, processes
from benchharness.study import plugins

LOAD_S = 60.0
"""How long a plugin may take to be imported, described and built with all parameters of a config."""
START_S = 180.0
"""How long Dr.Jit and Mitsuba may take to come up."""
ANY = "any"
"""In place of a variant: the first that works."""


class Apart:
    """A child that is started when it is needed, and again when it ended. `variant`: None for the first that works."""

    def __init__(self, variant: str | None = None) -> None:
        self._variant = variant
        self._child: _Child | None = None

    def __enter__(self) -> Apart:
        return self

    def __exit__(self, *error: object) -> None:
        self._end()

    def call(self, function: str, what: str, /, *, timeout_s: float | None = None, **arguments: Any) -> Any:
        """What `function`, "module:name", returns for `arguments`; all of it is plain data.

        what       names the place in the user's input, for messages
        timeout_s  LOAD_S if None

        Raises ValueError for whatever goes wrong, platform.EnvironmentBroken where the variant cannot be used.
        """
        limit = LOAD_S if timeout_s is None else timeout_s
        fresh = self._child is None
        said = self._asked(function, arguments, limit)
        if isinstance(said, _End) and not said.late and not fresh:  # perhaps of what an earlier call left behind
            said = self._asked(function, arguments, limit)
        if isinstance(said, _End):
            raise ValueError(f"{what}: cannot be used: {said.reason}")
        if "error" in said:
            raise ValueError(said["error"] if said.get("placed") else f"{what}: {said['error']}")
        return said["value"]

    def _asked(self, function: str, arguments: dict[str, Any], timeout_s: float) -> dict[str, Any] | _End:
        """The answer, or how the child ended in place of it."""
        try:
            if self._child is None:
                self._child = _Child(self._variant)
            answer = self._child.answer({"call": function, "arguments": arguments}, timeout_s)
        except BaseException:
            self._end()
            raise
        if isinstance(answer, _End):
            self._end()
        return answer

    def _end(self) -> None:
        if self._child is not None:
            self._child.end()
            self._child = None


@dataclass(frozen=True)
class _End:
    """Why there was no answer; late: for lack of time."""

    reason: str
    late: bool = False


class _Child:
    def __init__(self, variant: str | None) -> None:
        self._folder = tempfile.TemporaryDirectory(prefix="benchharness-")
        log = Path(self._folder.name) / "log"
        self._process = processes.Child("benchharness.study.apart", variant or ANY, str(os.getpid()), log=log)
        try:
            self._wait_for_start()
        except BaseException:
            self.end()
            raise

    def _wait_for_start(self) -> None:
        said = self._next(START_S)
        if isinstance(said, _End):
            raise platform.EnvironmentBroken(f"{said.reason}\nmend: run `benchharness doctor`; it probes every variant")
        if "broken" in said:
            raise platform.EnvironmentBroken(said["broken"])

    def answer(self, request: dict[str, Any], timeout_s: float) -> dict[str, Any] | _End:
        try:
            self._process.tell(request)
        except BrokenPipeError:
            return self._ended()
        said = self._next(timeout_s)
        known = isinstance(said, _End) or "value" in said or isinstance(said.get("error"), str)
        return said if known else _End("it said what nobody understands")

    def _next(self, timeout_s: float) -> dict[str, Any] | _End:
        try:
            said = self._process.next(timeout_s)
        except TimeoutError:
            return _End(f"the process that imports it did not end within {timeout_s:g} s{self._last_words()}", late=True)
        except ValueError as error:
            return _End(str(error))
        return self._ended() if said is None else said

    def _ended(self) -> _End:
        return _End(f"the process that imports it ended with {self._process.cause()}, without an answer{self._last_words()}")

    def _last_words(self) -> str:
        words = self._process.words()
        return f": {words}" if words else ""

    def end(self) -> None:
        self._process.end()
        self._folder.cleanup()


def main(variant: str, parent: int) -> None:
    say = processes.channel()
    faulthandler.enable()
    requests: queue.SimpleQueue[bytes] = queue.SimpleQueue()
    processes.end_with_parent(parent, requests.put)
    try:
        platform.use_any_variant() if variant == ANY else platform.use_variant(variant)
    except platform.EnvironmentBroken as error:
        say({"broken": str(error)})
        return
    say({"ready": True})
    while True:
        request = json.loads(requests.get())
        module, _, name = request["call"].partition(":")
        try:
            say({"value": getattr(importlib.import_module(module), name)(**request["arguments"])})
        except BaseException as error:  # plugins raise what they like
            traceback.print_exc()
            placed = type(error) is ValueError  # ours: it names the place
            say({"error": str(error) if placed else plugins.said(error), "placed": placed})


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
