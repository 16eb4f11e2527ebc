"""`benchharness.study.apart` without its process: quicker, for tests of what is said about harmless plugins."""

from __future__ import annotations

import importlib
import json
from typing import Any

import mitsuba as mi  # noqa: F401  (so that the variant is set)

from benchharness import processes
from benchharness.study import apart


class Here(apart.Apart):
    """Calls in this process; arguments and answers are what JSON makes of them."""

    def call(self, function: str, what: str, /, *, timeout_s: float | None = None, **arguments: Any) -> Any:
        module, _, name = function.partition(":")
        value = getattr(importlib.import_module(module), name)(**json.loads(json.dumps(arguments)))
        return processes.clean(json.loads(json.dumps(value)))
