"""Where light is sampled finer than at a mesh's vertices: where it asks for it.

Triangles are cut until no side is longer than LONGEST of the scene and of the object: so much is looked at, of any mesh.
Where light then differs in the middle of a side from the mean of the side's ends, by more than a share TOLERANCE of the mean
of what is there and what is typical of the scene, the triangles around are cut again, until sides become as short as
`Limits.shortest`. So contact shadows, and what falls through windows, are cut finely, and the floor around them is not.

Light at a vertex is a mean over its neighbourhood (`bake`), which grows smaller with every cut: what was sampled before is
sampled anew where triangles were cut. By how much it differs then is asked, too: a shadow that lies between the vertices is in
their neighbourhoods. Triangles that were not cut yet, and so have no middles, are asked whether their corners differ by much
more.

All vertices are looked from with the same random numbers, and these come in some batches. What differs by no more than batches
do among themselves is chance, and nothing to be cut for: the caustics of mirrors, of which few paths tell, are not.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from benchharness.modelling import lightmap
from benchharness.modelling.lightmesh import DEEPEST, LightMesh, cut, filled, settled

LONGEST = 1 / 25, 1 / 4  # of the diagonal of all objects, and of that of the object itself
SHORTEST = 1 / 250, 1 / 1000  # of the diagonal of all objects: at most, however large mirrors are, and at least, however small
BESIDE = 1 / 20  # of the smallest mirror's half diagonal: what is seen beside it, and in it
TOLERANCE = 0.03
BATCHES, SURE = 8, 3.0  # of paths, and standard errors of their mean
ROUNDS = 8  # of cuts for light: more than there are halves between the longest sides and the shortest
JUMP = 8.0  # times that, between the corners of a triangle that was not cut yet
MOST = 20_000  # vertices beside those of the meshes
MOST_SAMPLES = 1 << 22  # of all maps, 16 bytes each

Arriving = Callable[[LightMesh, np.ndarray], tuple[np.ndarray, np.ndarray, np.ndarray]]
"""A mesh and numbers of its vertices -> radiance that arrives at these, float64 [V, 3]; how many paths it is the mean of, int
[V]; and what each batch of them says, float64 [V, B, 3]. Of no meaning for others."""


@dataclass(frozen=True)
class Limits:
    """Longest sides of the pieces of every triangle [F], and shortest ones; how many vertices there may be."""

    longest: np.ndarray
    shortest: float
    vertices: int


def limits(mesh: LightMesh, own: np.ndarray, size: float) -> Limits:
    """Of all objects as one mesh, not cut. `own`: the diagonal of the object of every triangle [F]; `size`: `Scene.size`."""
    diagonal = float(np.linalg.norm(np.ptp(mesh.places, axis=0)))
    most, least = (share * diagonal for share in SHORTEST)
    shortest = min(max(BESIDE * size, least), most)
    longest = np.maximum(np.minimum(LONGEST[0] * diagonal, LONGEST[1] * own), np.finfo(float).tiny)
    return Limits(longest, shortest, len(mesh.columns) + MOST)


def found(mesh: LightMesh, within: Limits, arriving: Arriving) -> tuple[LightMesh, np.ndarray]:
    """The mesh, cut, and the radiance that leaves its vertices, float64 [V, 3], `settled`."""
    while (chosen := _afforded(mesh, mesh.lengths.max(axis=1) / within.longest[mesh.whole], 1.0, within)).any():
        mesh = cut(mesh, chosen)
    arrived = _Arrived(*arriving(mesh, np.arange(len(mesh.columns))))
    sent, batches = arrived.sent(mesh)
    typical, changed, new = _typical(mesh, sent), np.zeros(len(sent)), 0
    for _ in range(ROUNDS):
        level = np.maximum(0.5 * (typical + sent[mesh.faces].mean(axis=(1, 2))), np.finfo(float).tiny)
        off = _off(mesh, batches, arrived.counted, changed, new, within) / level
        chosen = _afforded(mesh, off, TOLERANCE, within)
        if not chosen.any():
            break
        mesh, new = cut(mesh, chosen), 4 * int(chosen.sum())
        again = np.unique(mesh.faces[-new:])
        arrived = arrived.with_more(_Arrived(*arriving(mesh, again)), again)
        before = batches
        sent, batches = arrived.sent(mesh)
        changed = np.zeros(len(sent))
        changed[: len(before)] = _surely(batches[: len(before)] - before)
    return mesh, settled(mesh, mesh.emission + sent)


@dataclass(frozen=True, eq=False)
class _Arrived:
    """What `Arriving` says."""

    incoming: np.ndarray
    counted: np.ndarray
    batches: np.ndarray

    def with_more(self, more: _Arrived, again: np.ndarray) -> _Arrived:
        """With what was found of more vertices than these, `again` of them anew."""
        stays = np.setdiff1d(np.arange(len(self.incoming)), again)
        for mine, other in ((self.incoming, more.incoming), (self.counted, more.counted), (self.batches, more.batches)):
            other[stays] = mine[stays]
        return more

    def sent(self, mesh: LightMesh) -> tuple[np.ndarray, np.ndarray]:
        """Diffuse light that vertices send back, float64 [V, 3], and by batches, [V, B, 3]."""
        arrives = filled(self.incoming, self.counted, mesh.faces)
        batches = np.where((self.counted > 0)[:, None, None], self.batches, arrives[:, None])
        return mesh.albedo * arrives, mesh.albedo[:, None] * batches


def _surely(differences: np.ndarray) -> np.ndarray:
    """How large the means of batches of differences [N, B, 3] are in any colour, float64 [N]; 0 where that may be chance."""
    mean = np.abs(differences.mean(axis=1))
    error = differences.std(axis=1) / np.sqrt(max(differences.shape[1] - 1, 1))
    return np.where(mean > SURE * error, mean, 0.0).max(axis=1)


def _typical(mesh: LightMesh, sent: np.ndarray) -> float:
    """The mean over all surfaces and colours of what vertices send back [V, 3]."""
    a, b, c = np.moveaxis(mesh.places[mesh.faces], 1, 0)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    return float(np.average(sent[mesh.faces].mean(axis=(1, 2)), weights=area)) if area.any() else 0.0


def _off(
    mesh: LightMesh, batches: np.ndarray, counted: np.ndarray, changed: np.ndarray, new: int, within: Limits
) -> np.ndarray:
    """By how much light on triangles may be off, float64 [T].

    batches  diffuse light of vertices [V, B, 3]
    counted  how many paths found it [V]; what none found says nothing
    changed  by how much the last round changed it [V], in which the last `new` triangles were made
    """
    made, off = np.flatnonzero(mesh.born), np.zeros(len(batches))
    off[made] = _surely(batches[made] - batches[mesh.ends[made]].mean(axis=1))
    off, changed = (np.where(counted > 0, values, 0.0) for values in (off, changed))
    recent = np.arange(len(mesh.faces)) >= len(mesh.faces) - new
    out = np.where(mesh.fresh, off[mesh.faces], np.where(recent[:, None], changed[mesh.faces], 0.0)).max(axis=1)

    # Middles of sides that are whole here, and cut on their other side.
    sides, middles = mesh.middles
    if len(sides):
        place = np.minimum(np.searchsorted(sides, mesh.sides), len(sides) - 1)
        out = np.maximum(out, np.where(sides[place] == mesh.sides, off[middles[place]], 0.0).max(axis=1))
    first = np.flatnonzero((mesh.depth == 0) & (mesh.lengths.max(axis=1) >= 2 * within.shortest))
    for a, b in ((0, 1), (1, 2), (2, 0)):
        jump = _surely(batches[mesh.faces[first, a]] - batches[mesh.faces[first, b]]) / JUMP
        out[first] = np.maximum(out[first], jump)
    return out


def _afforded(mesh: LightMesh, off: np.ndarray, limit: float, within: Limits) -> np.ndarray:
    """Which triangles are cut, bool [T]: of those that are off by more than a limit the worst, as many as there is room for."""
    chosen = (off > limit) & (mesh.lengths.max(axis=1) >= 2 * within.shortest) & (mesh.depth < DEEPEST)
    order = np.flatnonzero(chosen)[np.argsort(-off[chosen], kind="stable")]
    chosen[order[max(within.vertices - len(mesh.columns), 0) // 2 :]] = False  # a triangle's middles are two triangles' each

    # Those that make a finer grid of their whole, if the maps have room for it.
    deepest, worst = (np.zeros(int(mesh.whole.max()) + 1, kind) for kind in (np.int64, np.float64))
    np.maximum.at(deepest, mesh.whole, mesh.depth)
    deeper = chosen & (mesh.depth == deepest[mesh.whole])
    np.maximum.at(worst, mesh.whole[deeper], off[deeper])
    wholes = np.flatnonzero(worst)[np.argsort(-worst[worst > 0], kind="stable")]
    more = lightmap.cost(deepest[wholes] + 1) - lightmap.cost(deepest[wholes])
    fits = np.zeros(len(deepest), bool)
    fits[wholes[np.cumsum(more) <= MOST_SAMPLES - lightmap.cost(deepest).sum()]] = True
    return chosen & (~deeper | fits[mesh.whole])
