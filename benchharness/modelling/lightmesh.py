"""Meshes that light is found on: triangles cut in four, again and again, where light asks for it. Plain arrays.

A cut joins the middles of a triangle's three sides, so all that a triangle becomes lies on one regular grid of it. What lies
beside a triangle that is cut may stay whole. The middle of the side between the two then *hangs*: it is a corner on one side of
it and none on the other, and has to have the mean of what the side's ends have, or else light jumps there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

DEEPEST = 9
"""A triangle's side is cut into at most 2 to the power of this."""


@dataclass(frozen=True, eq=False)
class LightMesh:
    """
    columns  float64 [V, 12] of every vertex: place, unit normal, albedo, emission
    faces    int64 [T, 3]
    whole    int64 [T], the triangle that each is a piece of, as there were before anything was cut
    at       int64 [T, 3, 2], where in that its corners are: the weights of its second and its third corner, times 2^DEEPEST
    depth    int64 [T], how often that was cut
    fresh    bool [T, 3], which corners the last of these cuts made
    ends     int64 [V, 2], of the side that a vertex is the middle of, the lower number first; -1 for all others
    born     int64 [V], the round of cuts that made it; 0 for all others
    """

    columns: np.ndarray
    faces: np.ndarray
    whole: np.ndarray
    at: np.ndarray
    depth: np.ndarray
    fresh: np.ndarray
    ends: np.ndarray
    born: np.ndarray

    @property
    def places(self) -> np.ndarray:
        return self.columns[:, :3]

    @property
    def normals(self) -> np.ndarray:
        return self.columns[:, 3:6]

    @property
    def albedo(self) -> np.ndarray:
        return self.columns[:, 6:9]

    @property
    def emission(self) -> np.ndarray:
        return self.columns[:, 9:]

    @property
    def sides(self) -> np.ndarray:
        """One number per side of each triangle, from each corner to the next, int64 [T, 3]; the same whichever way it runs."""
        return _sides(self.faces, np.roll(self.faces, -1, axis=1))

    @property
    def lengths(self) -> np.ndarray:
        """Of these sides, float64 [T, 3]."""
        corners = self.places[self.faces]
        return np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)

    @property
    def middles(self) -> tuple[np.ndarray, np.ndarray]:
        """The sides that have a middle, ascending, and which vertex that is, int64 [M] each."""
        made = np.flatnonzero(self.born)
        sides = _sides(self.ends[made, 0], self.ends[made, 1])
        order = np.argsort(sides)
        return sides[order], made[order]


def uncut(columns: np.ndarray, faces: np.ndarray) -> LightMesh:
    """A mesh of which nothing is cut yet."""
    count, corners = len(faces), np.array([[0, 0], [1, 0], [0, 1]]) << DEEPEST
    return LightMesh(
        columns=columns,
        faces=np.asarray(faces, np.int64),
        whole=np.arange(count),
        at=np.tile(corners, (count, 1, 1)),
        depth=np.zeros(count, np.int64),
        fresh=np.zeros((count, 3), bool),
        ends=np.full((len(columns), 2), -1, np.int64),
        born=np.zeros(len(columns), np.int64),
    )


def joined(columns: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Columns and faces with vertices made one that have the same but for rounding, and which each has become, int64 [V]."""
    steps = np.repeat([max(float(np.ptp(columns[:, :3], axis=0).max()), 1e-30), 1.0, 1.0, 1.0], 3)
    rows = np.round(columns / (1e-6 * steps)).astype(np.int64)
    _, first, which = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    which = which.reshape(-1)
    return columns[first], which[faces], which


def cut(mesh: LightMesh, chosen: np.ndarray) -> LightMesh:
    """The mesh with the triangles chosen [T] in four, which come last: those at the first corners, at the second, at the third,
    and those between. New vertices come last, too. No triangle of depth DEEPEST may be chosen, and one has to be."""
    f, sides = mesh.faces[chosen], mesh.sides[chosen]
    known, number = mesh.middles
    new = np.setdiff1d(sides, known)
    ends = np.stack([new >> 32, new & 0xFFFF_FFFF], axis=1)
    columns = mesh.columns[ends].mean(axis=1)
    columns[:, 3:6] /= np.maximum(np.linalg.norm(columns[:, 3:6], axis=1, keepdims=True), 1e-300)
    count = len(mesh.columns)
    known, number = np.concatenate([known, new]), np.concatenate([number, count + np.arange(len(new))])
    order = np.argsort(known)
    m = number[order][np.searchsorted(known[order], sides)]

    at = mesh.at[chosen]
    half = (at + np.roll(at, -1, axis=1)) // 2
    corners = [np.stack([f[:, k], m[:, k], m[:, k - 1]], axis=1) for k in range(3)]
    there = [np.stack([at[:, k], half[:, k], half[:, k - 1]], axis=1) for k in range(3)]
    fresh = np.tile([False, True, True], (3 * len(f), 1))
    kept = ~chosen
    return LightMesh(
        columns=np.concatenate([mesh.columns, columns]),
        faces=np.concatenate([mesh.faces[kept], *corners, m]),
        whole=np.concatenate([mesh.whole[kept], np.tile(mesh.whole[chosen], 4)]),
        at=np.concatenate([mesh.at[kept], *there, half]),
        depth=np.concatenate([mesh.depth[kept], np.tile(mesh.depth[chosen] + 1, 4)]),
        fresh=np.concatenate([mesh.fresh[kept], fresh, np.ones((len(f), 3), bool)]),
        ends=np.concatenate([mesh.ends, ends]),
        born=np.concatenate([mesh.born, np.full(len(new), mesh.born.max(initial=0) + 1)]),
    )


def hanging(mesh: LightMesh) -> np.ndarray:
    """Which vertices lie on a side of a triangle and are no corner of it, bool [V]."""
    out, whole_sides = np.zeros(len(mesh.columns), bool), np.unique(mesh.sides)
    for number in range(1, int(mesh.born.max(initial=0)) + 1):
        mine = np.flatnonzero(mesh.born == number)
        a, b = mesh.ends[mine].T
        hangs = np.isin(_sides(a, b), whole_sides)
        for one, other in ((a, b), (b, a)):  # the middle of half a side whose own middle hangs
            hangs |= out[one] & (mesh.ends[one] == other[:, None]).any(axis=1)
        out[mine] = hangs
    return out


def settled(mesh: LightMesh, values: np.ndarray) -> np.ndarray:
    """Values of vertices [V, C], those that hang replaced by the mean of their side's ends."""
    out, hangs = values.copy(), hanging(mesh)
    for number in range(1, int(mesh.born.max(initial=0)) + 1):
        mine = np.flatnonzero(hangs & (mesh.born == number))
        out[mine] = out[mesh.ends[mine]].mean(axis=1)
    return out


def _sides(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    return (np.minimum(one, other) << 32) + np.maximum(one, other)


def filled(values: np.ndarray, counted: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Vertices that nothing was counted for take the mean of their neighbours, ring by ring; 0 where none has any."""
    values, known = values.copy(), counted > 0
    edges = np.concatenate([faces, np.roll(faces, 1, axis=1), np.roll(faces, -1, axis=1)])[:, :2]
    edges = np.unique(np.concatenate([edges, edges[:, ::-1]]), axis=0)
    while True:
        reach = edges[known[edges[:, 1]] & ~known[edges[:, 0]]]
        if len(reach) == 0:
            return np.where(known[:, None], values, 0.0)
        total, number = np.zeros_like(values), np.zeros(len(values))
        np.add.at(total, reach[:, 0], values[reach[:, 1]])
        np.add.at(number, reach[:, 0], 1)
        new = number > 0
        values[new] = total[new] / number[new, None]
        known |= new
