"""Parts with holes where their alpha is below a cutoff, once and for all: what draws triangles need not know of alpha.

What blends with what is behind it has holes too, where it covers less than half. Where it does so nowhere, or everywhere, it
is drawn opaque, and that is said: glass stays there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from benchharness.assets.asset import Findings, Material, Part
from benchharness.modelling import cutout, winding
from benchharness.modelling.contour import ALPHA, NORMAL, PLACE, UV, Holes

MOST = 200_000
"""Triangles that may be added to a file: as many as the larger scenes have."""
CLEAR = 1e-3  # of alpha: what covers all but that covers all
CUT = 1e-9  # of a part's area: what is less is nothing

HOLED = "surfaces with holes where their alpha is below its cutoff"
BLENT = "surfaces that let light through, shown as cut-outs: there where their alpha is at least a half"
GONE = "surfaces whose alpha is below its cutoff everywhere, left out"
OPAQUE = "surfaces that let light through, drawn opaque"


def cut(parts: Sequence[Part], findings: Findings) -> list[Part]:
    """The parts with their holes, without those of which nothing is left."""
    holes = _holes(parts, findings)
    if not any(holes):
        return list(parts)
    finer, sheets = 1, [cutout.Sheet(_columns(part), part.faces, one) for part, one in zip(parts, holes, strict=True)]
    while True:
        try:
            found = cutout.cut(sheets, MOST)
            break
        except cutout.TooMany:
            coarser = {one: one.coarser() for one in {sheet.holes for sheet in sheets} if one is not None}
            sheets = [sheet if sheet.holes is None else replace(sheet, holes=coarser[sheet.holes]) for sheet in sheets]
            finer *= 2
    if finer > 1:
        findings.say(f"holes would be over {MOST:,} triangles: pictures of alpha are taken {finer} times coarser")
    out = []
    for part, before, after in zip(parts, sheets, found, strict=True):
        new = part if after is before else _part(part, after)
        if before.holes is not None:
            blends, left = part.material.blends, bool(len(new.faces))
            if _area(new) >= (1 - CUT) * _area(part):
                findings.count(OPAQUE, blends)
            elif blends and not left:
                findings.count(OPAQUE)
                new = part
            else:
                findings.count(BLENT if blends else HOLED if left else GONE)
        out.append(new)
    return [part for part in out if len(part.faces)]


def _holes(parts: Sequence[Part], findings: Findings) -> list[Holes | None]:
    """What each part has to be cut by, the same thing for all of a material; None for what is whole."""
    alphas: dict[Material, list[np.ndarray]] = {}
    for part in parts:
        if part.material.holes is not None:
            alphas.setdefault(part.material, []).append(np.ones(1) if part.alpha is None else part.alpha)
    found: dict[Material, Holes | None] = {}
    for material, own in alphas.items():
        holes, share = material.holes, np.concatenate(own)
        assert holes is not None
        pixels = np.ones(1) if holes.picture is None else holes.picture.pixels
        least, most = float(pixels.min() * share.min()), float(pixels.max() * share.max())
        whole = holes.factor * least >= holes.cutoff
        if material.blends:  # what is as clear everywhere is no hole
            whole = least >= holes.cutoff or most < holes.cutoff
            findings.count(OPAQUE, len(own) if whole and holes.factor * least < 1 - CLEAR else 0)
            holes = replace(holes, factor=1.0)
        found[material] = None if whole else holes
    return [found.get(part.material) for part in parts]


def _columns(part: Part) -> np.ndarray:
    """A part's vertices as a sheet has them, colours last."""
    columns = np.ones((len(part.vertices), 12))
    columns[:, PLACE], columns[:, NORMAL] = part.vertices, part.normals
    columns[:, UV] = 0.0 if part.uv is None else part.uv
    if part.alpha is not None:
        columns[:, ALPHA] = part.alpha
    if part.colours is not None:
        columns[:, ALPHA + 1 :] = part.colours
    return columns


def _part(part: Part, sheet: cutout.Sheet) -> Part:
    """The part with the triangles of a sheet."""
    columns = sheet.columns
    return replace(
        part,
        vertices=columns[:, PLACE],
        faces=sheet.faces.astype(np.int32),
        normals=columns[:, NORMAL],
        uv=None if part.uv is None else columns[:, UV],
        colours=None if part.colours is None else np.clip(columns[:, ALPHA + 1 :], 0.0, 1.0),
        alpha=None if part.alpha is None else columns[:, ALPHA],
    )


def _area(part: Part) -> float:
    return 0.5 * float(np.linalg.norm(winding.crossed(part.vertices, part.faces), axis=1).sum())
