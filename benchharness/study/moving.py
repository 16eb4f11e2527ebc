"""Motions of a scene's table: keys that say where a file is, and how it is turned, at which times.

Places go straight from key to key and turns the shorter way round, about the file's origin or the middle of its `fit`; before
the first key and after the last it stands as they say. Within that an animation moves the nodes of a glTF file. Poses are
rigid.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from benchharness.assets.asset import Asset, Motion, Part
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


@dataclass(frozen=True, eq=False)
class Carried:
    """Time in seconds -> rigid pose, float64 [4, 4]: how an animation of a file moves a part of it, where an entry puts it.

    motion  the part's, in its file's space
    place   what takes that to the scene's, float64 [4, 4]
    keys    how the entry's keys move all of it; None without any
    """

    motion: Motion
    place: np.ndarray
    keys: Keyed | None

    @property
    def end(self) -> float:
        return max(self.motion.end, 0.0 if self.keys is None else self.keys.end)

    def __call__(self, time: float) -> np.ndarray:
        pose = self.place @ self.motion.pose(time) @ np.linalg.inv(self.place)
        pose[3] = (0.0, 0.0, 0.0, 1.0)
        return pose if self.keys is None else self.keys(time) @ pose


class Motions:
    """The motions of an entry's parts: its keys', within which an animation moves parts of its file."""

    def __init__(self, asset: Asset, entry: Placed, at: np.ndarray, where: str) -> None:
        """`at` takes the asset's space to the scene's. Raises ValueError for motions that are not rigid; see `keyed`."""
        self._where = f"{where}.animation of {asset.path.name}"
        keys, made = keyed(entry, where), dict[Motion, Carried]()
        self._of: dict[Part, Keyed | Carried | None] = {}
        for part in asset.parts:
            motion = part.motion
            if motion is not None and motion.fault is not None:
                raise ValueError(f"{self._where}: {motion.fault}; accepted: nodes that are moved and turned, as they are")
            if motion is not None and motion not in made:
                made[motion] = Carried(motion, at @ asset.axes, keys)
            self._of[part] = keys if motion is None else made[motion]

    def of(self, part: Part) -> Keyed | Carried | None:
        """The motion of a part, the same for those that move as one; None for what stands still."""
        return self._of[part]

    def of_all(self) -> Keyed | Carried | None:
        """The motion of all parts. Raises ValueError where they do not move as one."""
        ways = {motion: part for part, motion in self._of.items()}
        if len(ways) > 1:
            names = ", ".join("what stands" if part.motion is None else repr(part.motion.name) for part in ways.values())
            raise ValueError(f"{self._where}: parts of one mirror move apart, {names}; accepted: a mirror for each, by `node`")
        return next(iter(ways))
