"""How far what takes long is: light that is baked, references that are rendered.

Who makes something tells of `Share`s of it, and whoever called has chosen who hears them (`told`), in this process or, as a
line of JSON, in another one. `Pace` sees from when it hears them how long the rest takes. Neither Mitsuba nor Dr.Jit is
imported: the process that listens needs none.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.console import Console
    from rich.status import Status

SLOW_S = 60.0
"""What is expected to take longer than that is said to be cheaper with less of some key of a config."""
SELDOM_S = 30.0
"""Between lines that stay, where nothing can be drawn over."""


@dataclass(frozen=True)
class Share:
    """So much is done of something.

    what         such as "light of kitchen"; the same for all shares of it, and only of it
    done, total  in any unit; parts that were in the cache are done before the first share is told
    cheaper      a key of a config and its value, of which less is quicker: "[reference] spp = 64"; "" if there is none
    """

    what: str
    done: int
    total: int
    cheaper: str = ""


_hears: ContextVar[Callable[[Share], None]] = ContextVar("hears", default=lambda share: None)


@contextmanager
def told(hears: Callable[[Share], None]) -> Iterator[None]:
    """`hears` is told of what is made within."""
    before = _hears.set(hears)
    try:
        yield
    finally:
        _hears.reset(before)


def tell(share: Share) -> None:
    """Says how far something is: before each of its parts is made, and when all are."""
    if share.total > 0:
        _hears.get()(share)


def share_of(said: Mapping[str, Any]) -> Share:
    """A share that another process tells of, by its fields. Raises ValueError for what is none."""
    names = {field.name for field in fields(Share)}
    share = Share(**{name: said[name] for name in names}) if names <= set(said) else None
    known = share is not None and isinstance(share.what, str) and isinstance(share.cheaper, str)
    if share is None or not known or {type(share.done), type(share.total)} != {int} or not 0 <= share.done <= share.total > 0:
        raise ValueError(f"{dict(said)} is no share of anything")
    return share


@dataclass(frozen=True)
class Going:
    """A share, when it was heard: seconds since the first of its work, and until the last, None where nothing tells yet."""

    share: Share
    took_s: float
    left_s: float | None

    @property
    def ends(self) -> bool:
        return self.share.done == self.share.total

    @property
    def text(self) -> str:
        """`light of kitchen: 12 %, about 4 min left`."""
        percent = f"{self.share.what}: {100 * self.share.done // self.share.total} %"
        return percent if self.ends or self.left_s is None else f"{percent}, about {in_words(self.left_s)} left"

    @property
    def advice(self) -> str:
        """What to set to have it quicker; "" where it is quick, or nothing helps."""
        slow = not self.ends and self.left_s is not None and self.took_s + self.left_s > SLOW_S
        return f"less than {self.share.cheaper} is quicker" if slow and self.share.cheaper else ""


class Pace:
    """Says of shares, of several works at once if need be, how long the rest takes."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._begun: dict[str, tuple[float, int]] = {}

    def hear(self, share: Share) -> Going:
        now = self._clock()
        begun, before = self._begun.setdefault(share.what, (now, share.done))
        if share.done < before:  # it is made anew
            begun, before = self._begun[share.what] = now, share.done
        if share.done == share.total:
            del self._begun[share.what]
            return Going(share, now - begun, 0.0)
        made = share.done - before
        return Going(share, now - begun, (now - begun) * (share.total - share.done) / made if made else None)


class Teller:
    """Hears shares and says lines of them: one of each, for a line that is renewed in place; or seldom ones, that stay.

    say      is given the lines
    every_s  seconds at least that something is made, and without a line, before there is one; the end of what had one is said
    keys     of the config that is in force, as in `Share.cheaper`: no others are named; None: all are in force
    """

    def __init__(
        self,
        say: Callable[[str], None],
        every_s: float = 0.0,
        keys: Collection[str] | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._say, self._every_s, self._keys, self._clock = say, every_s, keys, clock
        self._pace, self._last = Pace(clock), -float("inf")
        self._had: set[str] = set()

    def __call__(self, share: Share) -> None:
        going, now = self._pace.hear(share), self._clock()
        due = min(now - self._last, going.took_s) >= self._every_s
        if share.what in self._had if going.ends else due:
            advice = going.advice if self._keys is None or share.cheaper in self._keys else ""
            self._say("; ".join(filter(None, (going.text, advice))))
            self._last = now
            self._had.add(share.what)
        if going.ends:
            self._had.discard(share.what)


def teller(console: Console, status: Status, keys: Collection[str] = ()) -> Teller:
    """What says it in a status line of a terminal; elsewhere in lines, seldom. `keys`: as of `Teller`."""
    from rich.markup import escape

    if console.is_terminal:
        return Teller(lambda text: status.update(escape(text)), keys=keys)
    return Teller(lambda text: console.print(text, markup=False, highlight=False, soft_wrap=True), SELDOM_S, keys)


def in_words(seconds: float) -> str:
    """`40 s`, `12 min`, `3.5 h`, `6 days`."""
    for least, unit, name in ((172_800, 86_400, "days"), (5_400, 3_600, "h"), (90, 60, "min")):
        if seconds >= least:
            value = seconds / unit
            return f"{value:.1f} {name}" if value < 10 and name != "min" else f"{value:.0f} {name}"
    return f"{max(1, round(seconds))} s"
