"""What the author of a regime reads: one way to fail, as small as it can be shown, with a severity that grows.

A regime is a module of `scenes.stress` with a function of its own name that takes a severity and returns a `Scene` whose
objects have their radiance already (nothing is baked), and a `REGIME`:

    REGIME = Regime(entry="F-14", title="Long thin triangles", severity="segments of the bar", severities=(32, 8, 2, 1), ...)

    def long_triangles(severity: float) -> Scene: ...

Severities go from mild to severe. Methods are not named: whatever is installed runs.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from benchharness.scene import Scene

MISSING = "missing reflections"
"""A symptom: the share of the reflections that an eye can see of a sample of vertices, and a method has not found."""


@dataclass(frozen=True, eq=False)
class Seen:
    """What a method showed, beside the reference; [H, W] with row 0 on top.

    image, truth       [H, W, 3] radiance
    mask               pixels of mirrors, bool
    reflector          which mirror, -1 for none, of the reference
    found              where the method had an answer, bool
    doubt              where it had one and knows that it may be wrong, bool
    distance, length   metres along the reflected ray: the method's, and the reference's (inf: surroundings)
    error              FLIP map
    vertices           fields of `benchharness.api.Vertices` as NumPy arrays [N] or [N, 3], `further` a list of such; None for
                       other methods
    record             the columns of results.csv that were measured
    scene, time        as drawn; seconds
    """

    image: np.ndarray
    truth: np.ndarray
    mask: np.ndarray
    reflector: np.ndarray
    found: np.ndarray
    doubt: np.ndarray
    distance: np.ndarray
    length: np.ndarray
    error: np.ndarray
    vertices: dict[str, Any] | None
    record: dict
    scene: Scene
    time: float

    def like(self, colour: tuple[float, float, float], tolerance: float = 0.15) -> tuple[np.ndarray, np.ndarray]:
        """Where the method, and the reference, show about this colour inside the mirrors, bool [H, W] each."""
        return tuple(self.mask & (np.abs(x - np.asarray(colour)).max(axis=2) <= tolerance) for x in (self.image, self.truth))

    def trusted(self) -> Seen:
        """The same with the truth wherever the method has no answer or doubts it: what is wrong here, it does not know."""
        known = self.mask & (self.doubt | ~self.found)
        image = np.where(known[..., None], self.truth, self.image)
        distance, error = np.where(known, self.length, self.distance), np.where(known, 0, self.error)
        record = self.record | {"flip": float(error[self.mask].mean()) if self.mask.any() else None}
        return replace(self, image=image, distance=distance, error=error, found=self.found | known, record=record)


def miss(one: np.ndarray, other: np.ndarray) -> float | None:
    """One less intersection over union of two masks: 0 where they agree, 1 where they share nothing; None if both are empty."""
    union = (one | other).sum()
    return None if union == 0 else 1.0 - float((one & other).sum() / union)


@dataclass(frozen=True, eq=False)
class Regime:
    """
    entry       of the catalogue of failures: F-.. (vertex searches), I-.. (images), P-.. (planes)
    title       what goes wrong, in a few words
    severity    what is swept, with its unit
    severities  from mild to severe
    symptom     the error that is measured, with its unit; 0 is right
    bound       of it, up to which a method holds
    why         why that much
    measure     the symptom: a column of results.csv, MISSING, or a function of what was seen; where it is None, FLIP takes its
                place
    frame       of the scene's animation
    size        width and height of the picture
    max_depth   of the reference: 2 shows one mirror bounce
    """

    entry: str
    title: str
    severity: str
    severities: tuple[float, ...]
    symptom: str
    bound: float
    why: str
    measure: str | Callable[[Seen], float | None] = "flip"
    frame: int = 0
    size: tuple[int, int] = (160, 120)
    max_depth: int = 2
    name: str = field(default="", compare=False)
