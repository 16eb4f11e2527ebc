"""The exit codes of every command: each has one meaning."""

from __future__ import annotations

from enum import IntEnum


class Exit(IntEnum):
    """An exit code; `says` is its meaning in words."""

    says: str

    FINE = 0, "fine"
    REGRESSION = 1, "a regression was found"
    WRONG_INPUT = 2, "the user's input is wrong"
    INCOMPLETE = 3, "incomplete"  # something crashed, or nothing ran
    INCOMPARABLE = 4, "the two sides cannot be compared"
    BROKEN_ENVIRONMENT = 5, "the environment is broken"

    def __new__(cls, code: int, says: str) -> Exit:
        member = int.__new__(cls, code)
        member._value_ = code
        member.says = says
        return member
