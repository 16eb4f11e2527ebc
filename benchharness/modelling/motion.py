"""Motion between keys, and turns as quaternions. NumPy, float64; times in seconds.

A quaternion is x, y, z, w, as in glTF: a turn by the angle a about the unit axis u is (u sin(a/2), cos(a/2)), and q and -q are
the same turn. Between two keys a value goes straight on, and a turn the shorter way round at even pace (Shoemake 1985, slerp).
What is said by the first key holds before it, and by the last one after it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

Between = Literal["linear", "step", "cubic"]
SAME = 1e-6  # of a time, or seconds: files keep times in single precision, and a step is not to be a frame late for that


@dataclass(frozen=True, eq=False)
class Track:
    """Values over time.

    times     float64 [K], ascending
    values    float64 [K, N]
    turns     whether values are quaternions, [K, 4], of length 1
    between   step: what the earlier key says; cubic: Hermite's splines of values and tangents, turns made as long as 1 again
    tangents  float64 [K, 2, N], per second, into a key and out of it; for `cubic` alone
    """

    times: np.ndarray
    values: np.ndarray
    turns: bool = False
    between: Between = "linear"
    tangents: np.ndarray | None = None

    def at(self, time: float) -> np.ndarray:
        """The value at a time, float64 [N]."""
        early = time + SAME * max(1.0, abs(time)) if self.between == "step" else time
        k = int(np.searchsorted(self.times, early, side="right")) - 1
        if k < 0 or k >= len(self.times) - 1 or self.between == "step":
            return self.values[min(max(k, 0), len(self.times) - 1)]
        (before, after), span = self.values[k : k + 2], self.times[k + 1] - self.times[k]
        u = (time - self.times[k]) / span
        if self.between == "linear":
            return slerp(before, after, u) if self.turns else before + u * (after - before)
        assert self.tangents is not None
        out, into = span * self.tangents[k, 1], span * self.tangents[k + 1, 0]
        value = before + u * u * (3 - 2 * u) * (after - before) + u * (1 - u) ** 2 * out + u * u * (u - 1) * into
        return value / np.linalg.norm(value) if self.turns else value

    @property
    def still(self) -> bool:
        """Whether it says the same at all times."""
        moving = self.tangents is not None and len(self.times) > 1 and bool(self.tangents.any())
        return not moving and bool((self.values == self.values[0]).all())


def slerp(a: np.ndarray, b: np.ndarray, u: float) -> np.ndarray:
    """The turn that is the share u of the shorter way from a to b, float64 [4]."""
    b = -b if a @ b < 0 else b
    angle = 2 * np.arctan2(np.linalg.norm(a - b), np.linalg.norm(a + b))
    if angle < 1e-9:  # as good as the same, and sines of nothing
        return a
    return (np.sin((1 - u) * angle) * a + np.sin(u * angle) * b) / np.sin(angle)


def product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The turn by b, and then by a, float64 [4]."""
    (ax, ay, az, aw), (bx, by, bz, bw) = a, b
    return np.array(
        [
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by + ay * bw + az * bx - ax * bz,
            aw * bz + az * bw + ax * by - ay * bx,
            aw * bw - ax * bx - ay * by - az * bz,
        ]
    )


def about_axes(degrees: tuple[float, float, float]) -> np.ndarray:
    """Turns about x, then y, then z, as one quaternion."""
    out = np.array([0.0, 0.0, 0.0, 1.0])
    for axis, half in enumerate(np.radians(degrees) / 2):
        step = np.zeros(4)
        step[axis], step[3] = np.sin(half), np.cos(half)
        out = product(step, out)
    return out


def turned(q: np.ndarray) -> np.ndarray:
    """A quaternion of length 1 as a matrix, float64 [3, 3]."""
    x, y, z, w = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
