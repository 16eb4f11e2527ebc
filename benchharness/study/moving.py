"""Motions of a scene's table: keys that say where a file is, and how it is turned, at which times.

Places go straight from key to key and turns the shorter way round, about the file's origin or the middle of its `fit`; before
the first key and after the last it stands as they say. Poses are rigid.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from benchharness.modelling.motion import Track, about_axes, product, turned
from benchharness.study.entries import Placed

MOST_DEG = 180.0  # from key to key, about an axis: which way is the shorter is open from there on


@dataclass(frozen=True, eq=False)
class Keyed:
    """Time in seconds -> rigid pose, float64 [4, 4], from where an entry puts its file to where its keys do.

    places  of what the file turns about
    turns   of the file
    place   [3], where the entry puts what the file turns about
    back    the turn that undoes the entry's own
    """

    places: Track
    turns: Track
    place: np.ndarray
    back: np.ndarray

    @property
    def end(self) -> float:
        """The time of the last key."""
        return float(self.places.times[-1])

    def __call__(self, time: float) -> np.ndarray:
        pose = np.eye(4)
        pose[:3, :3] = turned(product(self.turns.at(time), self.back))
        pose[:3, 3] = self.places.at(time) - pose[:3, :3] @ self.place
        return pose


def keyed(entry: Placed, where: str) -> Keyed | None:
    """The motion of an entry's keys, None without any. Raises ValueError for keys that go back in time, for a place that is
    none of the entry's, and for turns of which it is open which way round they go."""
    if entry.keys is None:
        return None
    name, other = ("translate", "centre") if entry.fit is None else ("centre", "translate")
    place = entry.translate if entry.fit is None else entry.fit.centre
    times = ascending([key.time for key in entry.keys], where)
    for number, key in enumerate(entry.keys):
        if getattr(key, other) is not None:
            beside = "with a `fit`" if entry.fit is not None else "without a `fit`"
            raise ValueError(f"{where}.keys[{number}] has {other} {beside}; accepted: {name}")
    places = [getattr(key, name) or place for key in entry.keys]
    degrees = [key.rotate_deg or entry.rotate_deg for key in entry.keys]
    for number, change in enumerate(np.abs(np.diff(degrees, axis=0)).max(axis=1, initial=0.0), 1):
        if change >= MOST_DEG:
            raise ValueError(
                f"{where}.keys[{number}].rotate_deg turns by {change:g} degrees about an axis, from where the key before is; "
                f"accepted: less than {MOST_DEG:g}, and keys in between for more"
            )
    x, y, z, w = about_axes(entry.rotate_deg)
    turns = Track(times, np.array([about_axes(each) for each in degrees]), turns=True)
    return Keyed(Track(times, np.array(places)), turns, np.array(place), np.array([-x, -y, -z, w]))


def ascending(times: Sequence[float], where: str) -> np.ndarray:
    """The times of keys, float64 [K]. Raises ValueError for one that does not come after the one before."""
    for number, (before, time) in enumerate(pairwise(times), 1):
        if time <= before:
            said = f"{where}.keys[{number}].time is {time:g}"
            raise ValueError(f"{said}; accepted: more than {before:g}, the time of the key before")
    return np.array(times, np.float64)
