"""Work that is killed in the midst, as far as whoever does it can see."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any


class Killed(BaseException):
    """What nobody catches."""


class Mortal:
    """A function that counts its calls and, once it was called `last` times, ends whatever calls it."""

    def __init__(self, function: Callable[..., Any], last: int | None = None) -> None:
        self.function, self.last, self.calls = function, last, 0

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        if self.calls == self.last:
            raise Killed
        self.calls += 1
        return self.function(*arguments, **named)
