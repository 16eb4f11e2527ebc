"""A method on a scene while it is measured: what it has, what it showed, why it stopped."""

from __future__ import annotations

import contextlib
import traceback
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from benchharness.api import Method, Reflection
from benchharness.measure import contract


@dataclass
class Entry:
    """
    state     what `prepare` returned
    broken    why it stopped; None for what goes on
    outdated  state before the last update of the run-up: what updates are timed from
    before    state after the run-up and, if something moved, the update: what the measured frame is shaded from
    shown     the run-up's pictures [H, W, 3] and answers, the measured frame's last
    samples   clock -> ms
    varies    whether a camera beside the frame's was shown another picture
    error     FLIP map of the last frame
    """

    method: Method
    state: Any = None
    prepare_ms: float | None = None
    first_ms: float | None = None
    broken: str | None = None
    outdated: Any = None
    before: Any = None
    shown: list[tuple[np.ndarray, Reflection]] = field(default_factory=list)
    samples: dict[str, list[float]] = field(default_factory=dict)
    varies: bool = False
    error: np.ndarray | None = None

    def begin(self) -> None:
        """Forgets the frame that was measured before."""
        self.shown, self.samples, self.varies, self.error = [], {"update": [], "shade": []}, False, None


@contextlib.contextmanager
def guarded(name: str, entry: Entry, watch: Callable[[str], None]) -> Iterator[None]:
    """Whatever is raised inside ends that method on this scene and nothing else; but for Ctrl-C."""
    watch(name)
    try:
        yield
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # a plugin may raise what is no Exception
        with contextlib.suppress(Exception):
            traceback.print_exc()
        entry.broken = contract.account(error)
    watch("")
