"""What is near a mirror and what is far, and which environment maps of what is far no longer hold. NumPy, on the host.

Around every mirror's map there is a ball, whose radius is called its reach, and the whole mirror lies within. A reflected ray
starts in the ball and leaves it once: all that it meets within comes before all beyond, whatever the mirror's shape. So what is
within may be drawn over what is beyond, and which of both a pixel shows needs no depths.

Parallax. An environment map that is taken from c shows along a ray, from x along r, what lies along r from c. The rays that
show a thing at a distance D from c in its place, and in the map's, differ by the angle |x⊥| / D, x⊥ = (x - c) - ((x - c)·r) r.
Where the direction turns by J u as one goes by u along the mirror, and what is seen moves by K u pixels, that is

    |K J⁺ x⊥| / D pixels

to the first order in |x⊥| / D, for a mirror of any curvature: a flat one shows a radian as large as the eye does, a small ball
as little of it as r f / (2 d + r), with its radius r, the eye's distance d and f pixels per radian.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from benchharness.kernels import geometry
from benchharness.kernels.types import ReflectorLike, SceneLike
from benchharness.kernels.vertices import mirrormesh
from benchharness.kernels.vertices.nearlist import Near

SAMPLES = 256  # triangles of a mirror at whose middles its parallax is asked for
QUANTILE = 0.9  # of those that the eye may see: what few pixels show, such as a sharp edge, does not decide for all
STEP = 1e-3  # of a triangle, for differences
SLACK = 0.7  # a reach is kept while so much of it, or more, is needed; a new one lies between, so that neither end is near
MARGIN = 0.1  # of the reach: triangles that come nearer than by so much more are searched too, so that lists stay
IDLE = 0.25  # of the triangles in a list, that may lie beyond twice that margin


@dataclass(frozen=True, eq=False)
class Mirror:
    """A mirror in its own space, float64.

    centre       where its map is taken, [3]: the middle of its box
    extent       how far it reaches from there
    corners      triangles spread over what is seen of it, [S, 3, 3]
    normals      of their corners, [S, 3, 3]
    both         whether each is a mirror on its back too, [S]
    """

    centre: np.ndarray
    extent: float
    corners: np.ndarray
    normals: np.ndarray
    both: np.ndarray

    @staticmethod
    def of(reflector: ReflectorLike) -> Mirror:
        mesh, solid = reflector.mesh, reflector.closed or reflector.mesh
        vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
        centre = 0.5 * (solid.vertices.min(axis=0) + solid.vertices.max(axis=0))
        extent = max(float(np.linalg.norm(v - centre, axis=1).max()) for v in (vertices, solid.vertices))
        chosen = mirrormesh.spread(vertices, faces, SAMPLES)
        both = ~geometry.oriented_closed_faces(vertices, faces)[chosen] & (reflector.closed is None)
        own = faces[chosen]
        return Mirror(centre, extent, vertices[own], np.asarray(mesh.normals)[own], both)


def parallax(mirror: Mirror, pose: np.ndarray, eye: np.ndarray, focal: float) -> np.ndarray:
    """By how many pixels its environment map shows something at a distance of one unit in the wrong place, to the first order:
    float64 per sample of the mirror that faces the eye.

    pose   [3, 4]
    focal  of the camera, pixels per radian
    """
    turn = pose[:, :3]
    local = turn.T @ (eye - pose[:, 3])
    (p, v, _), n = _seen(mirror, local, (0.0, 0.0)), mirror.normals.mean(axis=1)
    facing = mirror.both | ((v * n).sum(axis=1) > 0)
    x = p - mirror.centre
    steps = []
    for by in ((STEP, 0.0), (0.0, STEP)):
        ahead, back = _seen(mirror, local, by), _seen(mirror, local, (-by[0], -by[1]))
        steps.append([(one - other) / (2 * STEP) for one, other in zip(ahead[1:], back[1:], strict=True)])
    (dv, dr), (ev, er) = steps
    # Least squares of x = s dr + t er, of which both lie across r.
    rr, re, ee, rx, ex = ((a * b).sum(axis=1) for a, b in ((dr, dr), (dr, er), (er, er), (dr, x), (er, x)))
    determinant = rr * ee - re * re
    sound = facing & (determinant > 1e-12 * rr * ee)
    scale = 1 / np.where(sound, determinant, 1)
    s, t = ((ee * rx - re * ex) * scale)[:, None], ((rr * ex - re * rx) * scale)[:, None]
    pixels = focal * np.linalg.norm(s * dv + t * ev, axis=1)
    # Where it focuses there is no bound; but nothing is off by more than the mirror is seen wide, at its own distance.
    most = mirror.extent * focal * 2 * mirror.extent / max(float(np.linalg.norm(local - mirror.centre)), mirror.extent)
    return np.minimum(np.where(sound, pixels, most), most)[facing]


def _seen(mirror: Mirror, eye: np.ndarray, by: tuple[float, float]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A point of each sample, the direction to the eye and the mirror direction there. by: how far from its middle, in the
    triangle's own coordinates."""
    weights = np.array([1 / 3 - by[0] - by[1], 1 / 3 + by[0], 1 / 3 + by[1]])
    p, n = (np.einsum("k,skj->sj", weights, a) for a in (mirror.corners, mirror.normals))
    n = n / np.maximum(np.linalg.norm(n, axis=1, keepdims=True), 1e-30)
    v = eye - p
    v = v / np.maximum(np.linalg.norm(v, axis=1, keepdims=True), 1e-30)
    return p, v, 2 * (v * n).sum(axis=1, keepdims=True) * n - v


def wanted(mirror: Mirror, pose: np.ndarray, eye: np.ndarray, focal: float, pixels: float, before: float) -> float:
    """The reach beyond which nothing is shown more than `pixels` from its place, but in few pixels; `before`, while that holds
    and is not much more than needed. 0 for none before."""
    off = parallax(mirror, pose, eye, focal)
    least = max(float(np.quantile(off, QUANTILE)) / pixels if len(off) else 0.0, mirror.extent)
    return before if SLACK * before <= least <= before else least / np.sqrt(SLACK)


def distances(corners: np.ndarray, point: np.ndarray) -> np.ndarray:
    """How far triangles [F, 3, 3] are from a point, [F]."""
    a, b, c = np.moveaxis(corners - point, 1, 0)
    normal = np.cross(b - a, c - a)
    area = np.linalg.norm(normal, axis=1)
    sound = area > 0
    within, nearest = sound.copy(), np.full(len(a), np.inf)
    for one, other in ((a, b), (b, c), (c, a)):
        edge = other - one
        length = (edge**2).sum(axis=1)
        at = np.clip(-(one * edge).sum(axis=1) / np.where(length > 0, length, 1), 0, 1)
        nearest = np.minimum(nearest, np.linalg.norm(one + at[:, None] * edge, axis=1))
        within &= (np.cross(edge, -one) * normal).sum(axis=1) >= 0
    height = np.abs((a * normal).sum(axis=1)) / np.where(sound, area, 1)
    return np.where(within, height, nearest)


@dataclass(frozen=True, eq=False)
class Taken:
    """How things were when a map was taken: the radius `beyond` which it shows them, poses of all parts, which of them it
    showed; `centre`, [3]."""

    beyond: float
    poses: np.ndarray
    shown: np.ndarray
    centre: np.ndarray


@dataclass(frozen=True, eq=False)
class Division:
    """Of a scene into what is near its mirrors and what is far.

    mirrors   of the scene
    parts     corners of the triangles of each part, in its own space, [F, 3, 3]
    owner     the part of every triangle, [F]
    poses     of all parts, [P, 3, 4]; None before the first
    seen_at   where each mirror's centre is in the space of each part, [mirrors, P, 3]
    nearest   how far each triangle is from each mirror's centre, [mirrors, F]
    farthest  how far the farthest of each part is, [mirrors, P]
    reach     of each mirror, [mirrors]; 0 where nothing is decided
    near      what is within reach
    taken     of each mirror's map, None where there is none
    """

    mirrors: list[Mirror]
    parts: list[np.ndarray]
    owner: np.ndarray
    poses: np.ndarray | None
    seen_at: np.ndarray
    nearest: np.ndarray
    farthest: np.ndarray
    reach: np.ndarray
    near: Near
    taken: list[Taken | None]

    @staticmethod
    def begun(scene: SceneLike) -> Division:
        """Of a scene of which nothing is known yet."""
        parts = [np.asarray(part.mesh.vertices, np.float64)[np.asarray(part.mesh.faces)] for part in scene.parts]
        mirrors = [Mirror.of(reflector) for reflector in scene.reflectors]
        count, faces = len(mirrors), sum(map(len, parts))
        return Division(
            mirrors=mirrors,
            parts=parts,
            owner=np.repeat(np.arange(len(parts)), [len(part) for part in parts]),
            poses=None,
            seen_at=np.full((count, len(parts), 3), np.nan),
            nearest=np.full((count, faces), np.inf),
            farthest=np.full((count, len(parts)), np.inf),
            reach=np.zeros(count),
            near=Near(np.zeros((count, faces), bool)),
            taken=[None] * count,
        )

    @property
    def first(self) -> int:
        """The part of the first mirror."""
        return len(self.parts) - len(self.mirrors)

    def centre(self, i: int) -> np.ndarray:
        """Where mirror number i has its map, in the world."""
        assert self.poses is not None
        pose = self.poses[self.first + i]
        return pose[:, :3] @ self.mirrors[i].centre + pose[:, 3]

    def moved(self, poses: np.ndarray) -> Division:
        """With every part where `poses` [P, 3, 4] puts it. Only parts are looked at that a mirror sees from elsewhere."""
        now = replace(
            self, poses=poses, seen_at=self.seen_at.copy(), nearest=self.nearest.copy(), farthest=self.farthest.copy()
        )
        starts = np.cumsum([0, *map(len, self.parts)])
        for i in range(len(self.mirrors)):
            there = np.einsum("pji,pj->pi", poses[:, :, :3], now.centre(i) - poses[:, :, 3])
            for p in np.flatnonzero((there != self.seen_at[i]).any(axis=1)):
                now.nearest[i, starts[p] : starts[p + 1]] = distances(self.parts[p], there[p])
                now.farthest[i, p] = np.sqrt(((self.parts[p] - there[p]) ** 2).sum(axis=2).max())
            now.seen_at[i] = there
            now.nearest[i, self.owner == self.first + i] = np.inf  # a mirror does not show itself
        return now

    def reaching(self, wanted: Sequence[float], *, keeps: bool) -> Division:
        """With other reaches. keeps: what is near stays as it was chosen while that serves, so that lists stay."""
        reach = np.asarray(wanted, float)
        if self.near.faces.any() and keeps and (self.nearest < reach[:, None])[~self.near.faces].sum() == 0:
            beyond = self.near.faces & (self.nearest > (1 + 2 * MARGIN) * reach[:, None])
            if beyond.sum() <= IDLE * self.near.faces.sum():
                return replace(self, reach=reach)
        faces = self.nearest < (1 + MARGIN) * reach[:, None]
        faces[(self.nearest >= reach[:, None]).all(axis=1)] = False
        near = self.near if np.array_equal(faces, self.near.faces) else Near(faces)
        return replace(self, reach=reach, near=near)

    def stale(self, overlap: float) -> list[bool]:
        """Which maps no longer hold that show what is beyond the share `overlap` of their reach: another one; the mirror has
        moved; or a part that they show or showed."""
        return [not self._holds(i, overlap) for i in range(len(self.mirrors))]

    def _holds(self, i: int, overlap: float) -> bool:
        last = self.taken[i]
        if last is None or last.beyond != overlap * self.reach[i] or (last.centre != self.centre(i)).any():
            return False
        assert self.poses is not None
        moved = (last.poses != self.poses).any(axis=(1, 2))
        return not (moved & (last.shown | self._shown(i, last.beyond))).any()

    def _shown(self, i: int, beyond: float) -> np.ndarray:
        """Which parts the map of mirror i shows."""
        return (self.farthest[i] > beyond) & (np.arange(len(self.parts)) != self.first + i)

    def taking(self, again: Sequence[bool], overlap: float) -> Division:
        """With the maps of some mirrors taken as things are now."""
        assert self.poses is not None
        taken = list(self.taken)
        for i in np.flatnonzero(again):
            beyond = overlap * self.reach[i]
            taken[i] = Taken(beyond, self.poses, self._shown(i, beyond), self.centre(i))
        return replace(self, taken=taken)
