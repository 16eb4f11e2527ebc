"""[run]: how a study is run, and which frames of an animation that means."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from benchharness.study import params

MOST_FRAMES = 100_000
"""Of an animation: over an hour at 25 per second. All of it is hashed."""
MOST_PIXELS = 1 << 25
"""Of a picture: 8K. A frame keeps some hundred bytes per pixel."""

Frames = Annotated[int, Field(ge=1, le=MOST_FRAMES)]
Rounds = Annotated[int, Field(ge=1, le=10_000)]
Index = Annotated[int, Field(ge=0, lt=MOST_FRAMES)]
Seed = Annotated[int, Field(ge=0, lt=1 << 32)]
Pixels = Annotated[int, Field(ge=1, le=16384)]
Timeout = Annotated[float, Field(gt=0, le=86400)]


@dataclass(frozen=True)
class Run:
    """[run].

    size        width, height in pixels
    frames      that many, evenly over the animation with its first and last; or a list of frames; 3 or all if fewer
    min_rounds  timed rounds at least, by default no more than `max_rounds`, and
    max_rounds  at most, until the median is known well enough
    images      frames whose pictures are kept; all if not given
    timeout_s   seconds that a frame may take with all its methods, and the scene's preparation; counted anew from every part of
                light and references that is done
    """

    variant: Literal["llvm_ad_rgb", "cuda_ad_rgb"] = "llvm_ad_rgb"
    size: tuple[Pixels, Pixels] = (720, 512)
    frames: Frames | Annotated[list[Index], Field(min_length=1)] | None = None
    min_rounds: Rounds = 5
    max_rounds: Rounds = 40
    images: list[Index] | None = None
    seed: Seed = 0
    timeout_s: Timeout = 600.0


def run_of(table: Mapping[str, Any], where: str) -> Run:
    """The section, out of its table. Raises ValueError for what is wrong in it."""
    run = params.options(Run, table, where)
    if "min_rounds" not in table:
        run = replace(run, min_rounds=min(run.min_rounds, run.max_rounds))
    if run.min_rounds > run.max_rounds:
        raise ValueError(f"{where}.min_rounds is {run.min_rounds}; accepted: at most max_rounds, {run.max_rounds}")
    if math.prod(run.size) > MOST_PIXELS:
        raise ValueError(f"{where}.size is {list(run.size)}; accepted: at most {MOST_PIXELS:,} pixels, as 7680 x 4320")
    return run


def pick_frames(asked: int | list[int] | None, available: int, where: str) -> list[int]:
    """The frames to render, ascending, out of an animation of `available` frames. Raises ValueError."""
    if asked is None:
        asked = min(3, available)
    if isinstance(asked, int):
        if asked > available:
            raise ValueError(f"{where} is {asked}; accepted: 1 to {available}, the animation's length")
        return [round(float(f)) for f in np.linspace(0, available - 1, asked)]
    if max(asked) >= available:
        raise ValueError(f"{where} asks for frame {max(asked)}; accepted: 0 to {available - 1}")
    twice = [frame for frame, count in Counter(asked).items() if count > 1]
    if twice:
        raise ValueError(f"{where} asks for frame {twice[0]} more than once; accepted: every frame once")
    return sorted(asked)
