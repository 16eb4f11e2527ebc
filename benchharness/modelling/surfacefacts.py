"""What a surface is like, as far as its triangles and normals tell: counts, extents, openings, seams. NumPy on arrays."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from benchharness.modelling import winding

COARSE_DEG = 45.0  # normals that turn by more within one triangle say less of a curve than they leave open
FLAT = 1e-10  # a triangle of less area than this, times the square of its longest side, has no direction
SEAM_DEG = 1.0  # normals at one place that differ by more are an edge that is meant to be seen


class Shaded(winding.Triangles, Protocol):
    """Triangles with a unit normal per vertex, float64 [V, 3]."""

    @property
    def normals(self) -> np.ndarray: ...


@dataclass(frozen=True)
class Facts:
    """vertices, faces  counts
    low, high        [3] corners of the box around it
    pieces, closed   how many pieces, and how many of them are closed
    one_sided        faces of pieces that cannot be wound consistently
    volume           of the closed pieces, as they are wound: negative where most of it faces inwards
    degenerate       faces without area
    seams, creases   places with several vertices, and those of them whose normals differ
    away             corners whose normal points away from their face's front
    turn_deg         largest angle between the normals of one face, over 99 of 100 faces
    """

    vertices: int
    faces: int
    low: np.ndarray
    high: np.ndarray
    pieces: int
    closed: int
    one_sided: int
    volume: float
    degenerate: int
    seams: int
    creases: int
    away: int
    turn_deg: float


def facts(mesh: Shaded) -> Facts:
    vertices, faces, normals = mesh.vertices, mesh.faces, np.asarray(mesh.normals)
    used = vertices[np.unique(faces)]
    found = winding.pieces(mesh)
    crossed = winding.crossed(vertices, faces)
    corners = vertices[faces]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    flat = np.linalg.norm(crossed, axis=1) <= FLAT * longest**2
    seams, creases = _seams(mesh)
    own = normals[faces]
    turns = np.einsum("fki,fki->fk", own, np.roll(own, 1, axis=1)).min(axis=1)[~flat]
    return Facts(
        vertices=len(vertices),
        faces=len(faces),
        low=used.min(axis=0),
        high=used.max(axis=0),
        pieces=len(found.closed),
        closed=int(found.closed.sum()),
        one_sided=int((~found.two_sided)[found.piece].sum()),
        volume=float(winding.volumes(mesh)[found.closed[found.piece]].sum()),
        degenerate=int(flat.sum()),
        seams=seams,
        creases=creases,
        away=int((np.einsum("fki,fi->fk", own, crossed)[~flat] < 0).sum()),
        turn_deg=float(np.degrees(np.arccos(np.clip(np.quantile(turns, 0.01), -1, 1)))) if len(turns) else 0.0,
    )


def _seams(mesh: Shaded) -> tuple[int, int]:
    """Places with several used vertices, and those where their normals differ by more than SEAM_DEG."""
    number, corner = np.unique(mesh.faces, return_index=True)
    place = winding.welded(mesh.vertices, mesh.faces).reshape(-1)[corner]
    _, which, count = np.unique(place, return_inverse=True, return_counts=True)
    normals = np.asarray(mesh.normals)[number]
    total = np.stack([np.bincount(which, normals[:, axis]) for axis in range(3)], axis=1)
    mean = total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-300)
    beside = np.einsum("vi,vi->v", normals, mean[which]) < np.cos(np.radians(0.5 * SEAM_DEG))
    differ = np.bincount(which, beside, len(count)) > 0
    return int((count > 1).sum()), int((differ & (count > 1)).sum())


def described(it: Facts) -> str:
    """One sentence: how much there is of it, where, and whether it is closed; lengths are metres."""
    size = " x ".join(f"{length:.4g}" for length in it.high - it.low)
    middle = ", ".join(f"{at:.4g}" for at in 0.5 * (it.low + it.high))
    said = [f"{it.faces:,} triangles, {it.vertices:,} vertices, {size} m around ({middle})"]
    if it.closed == it.pieces:
        said.append("closed" if it.pieces == 1 else f"{it.pieces:,} closed pieces")
    else:
        said.append("open" if it.pieces == 1 else f"{it.pieces:,} pieces, {it.pieces - it.closed:,} of them open")
    if it.closed:
        said.append("fronts inwards" if it.volume < 0 else "fronts outwards")
    if it.seams:
        said.append(f"{it.seams:,} places with several vertices, {it.creases:,} of them creased")
    return ", ".join(said)


def faults(it: Facts, *, mirror: bool) -> list[str]:
    """What is wrong with a surface, a sentence each; of a `mirror` more is asked, as it shows nothing but its normals."""
    said = []
    if it.degenerate:
        said.append(f"{it.degenerate:,} of {it.faces:,} triangles have no area")
    if it.one_sided:
        said.append(f"{it.one_sided:,} of {it.faces:,} triangles are of a surface with one side")
    if it.away:
        said.append(f"{it.away:,} of {3 * it.faces:,} normals at corners point away from their triangle's front")
    if mirror and it.turn_deg > COARSE_DEG:
        said.append(
            f"normals turn by up to {it.turn_deg:.0f} degrees across one triangle: what it mirrors is bent as its triangles "
            "are, not as the shape they stand for"
        )
    return said
