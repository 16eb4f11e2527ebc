"""Surfaces with holes where their alpha is below a cutoff, as triangles: whoever draws them need not know of alpha.

Triangles in which the contour of alpha runs are split at the midpoints of their edges until it is as good as straight in each
(`benchharness.modelling.contour`), and then cut along it. Whether an edge is split is asked of all triangles at its place, of
whatever surface; where it is cut follows from its two ends alone. So what was joined stays joined, and there are no
T-junctions, but for surfaces that share an edge and not their alpha along it. What is far from the contour stays large: with a
triangle's other edges its longest is split, or one nearly as long, so that none gets thin (after Rivara 1984).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from benchharness.modelling.contour import ALPHA, NORMAL, PLACE, Contour, Holes
from benchharness.modelling.rows import distinct
from benchharness.modelling.subdivision import split_faces

NEARLY = 0.8  # of a triangle's longest edge: as good as that
SNAP = 1e-3  # of an edge: what is cut so near its end is cut at its end
PAIR = 32  # bits of the greater number of a pair
AT_ONCE = 1 << 17  # faces


@dataclass(frozen=True, eq=False)
class Sheet:
    """Triangles of one look.

    columns  float64 [V, 9 or more]: places, unit normals, uv and alpha (`benchharness.modelling.contour`), and what else is
             linear on triangles
    faces    int [F, 3]
    holes    None for what has none
    """

    columns: np.ndarray
    faces: np.ndarray
    holes: Holes | None = None


@dataclass(frozen=True, eq=False)
class _Net:
    """Triangles of several sheets, as far as they have to do with each other.

    columns, faces  as of sheets, int64
    place           int64 [V], the same for what is at one place
    places          how many there are
    owner           int [F], whose sheet's
    """

    columns: np.ndarray
    faces: np.ndarray
    place: np.ndarray
    places: int
    owner: np.ndarray

    def of(self, faces: np.ndarray) -> _Net:
        return replace(self, faces=self.faces[faces], owner=self.owner[faces])


class TooMany(Exception):
    """More triangles than may be."""


def cut(sheets: Sequence[Sheet], most: int) -> list[Sheet]:
    """The sheets without what is below their cutoffs; of one of which all is, no face is left. One that is not touched is the
    same thing again. Raises TooMany for more than `most` new triangles, counting those on the way."""
    contours, group = _contours(sheets)
    starts = np.cumsum([0, *(len(sheet.columns) for sheet in sheets)])
    columns = np.concatenate([sheet.columns for sheet in sheets])
    first, place = distinct(columns[:, PLACE])
    faces = np.concatenate([sheet.faces + start for sheet, start in zip(sheets, starts, strict=False)]).astype(np.int64)
    owner = np.repeat(np.arange(len(sheets)), [len(sheet.faces) for sheet in sheets])
    whole = _Net(columns, faces, place, len(first), owner)

    # What is crossed by a contour, and its neighbours.
    there, edges = _judged(whole, contours, group, group[owner] >= 0)
    crossed = there & (edges.any(axis=1) | ~_above(whole, contours, group).all(axis=1))
    near = np.zeros(len(first), bool)
    near[place[faces[crossed]]] = True
    live = crossed | (there & (near[place[faces]].sum(axis=1) >= 2))
    other = there & ~live
    near[place[faces[live]]] = True
    beside = other & (near[place[faces]].sum(axis=1) >= 2)  # of whose edges none may be split
    used, corners = np.unique(faces[live], return_inverse=True)
    net = _Net(columns[used], corners.reshape(-1, 3), place[used], len(first), owner[live])
    net = _refined(net, contours, group, _along(place[faces[beside]]), most)
    net = _clipped(net, contours, group)

    out = []
    for number, sheet in enumerate(sheets):
        own, rest = net.faces[net.owner == number], faces[other & (owner == number)] - starts[number]
        added = np.unique(own[own >= len(used)])
        if not len(added) and len(own) + len(rest) == len(sheet.faces):
            out.append(sheet)
            continue
        within = np.concatenate([used - starts[number], np.zeros(len(net.columns) - len(used), np.int64)])
        within[added] = len(sheet.columns) + np.arange(len(added))
        kept, corners = np.unique(np.concatenate([rest, within[own]]), return_inverse=True)
        values = np.concatenate([sheet.columns, net.columns[added]])[kept]
        out.append(replace(sheet, columns=values, faces=corners.reshape(-1, 3)))
    return out


def _contours(sheets: Sequence[Sheet]) -> tuple[list[Contour], np.ndarray]:
    """A contour for all sheets of the same holes, and which each sheet has, int [S], -1 for none."""
    found: dict[Holes, list[int]] = {}
    for number, sheet in enumerate(sheets):
        if sheet.holes is not None:
            found.setdefault(sheet.holes, []).append(number)
    group, contours = np.full(len(sheets), -1), []
    for holes, numbers in found.items():
        group[numbers] = len(contours)
        contours.append(Contour(holes, np.concatenate([sheets[number].columns[:, ALPHA] for number in numbers])))
    return contours, group


def _grouped(net: _Net, group: np.ndarray, asked: np.ndarray) -> Iterator[tuple[int, np.ndarray]]:
    """The numbers of those of some faces, bool [F], that have a contour, by its number."""
    which = np.where(asked, group[net.owner], -1)
    for number in np.unique(which[which >= 0]):
        yield int(number), np.flatnonzero(which == number)


def _judged(net: _Net, contours: list[Contour], group: np.ndarray, asked: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Which faces are there, bool [F], and which of their edges have to be split, bool [F, 3]; as asked, bool [F]."""
    there, edges = np.ones(len(net.faces), bool), np.zeros((len(net.faces), 3), bool)
    for number, faces in _grouped(net, group, asked):
        for some in np.array_split(faces, len(faces) // AT_ONCE + 1):
            there[some], edges[some] = contours[number].judged(net.columns[net.faces[some]])
    return there, edges


def _above(net: _Net, contours: list[Contour], group: np.ndarray) -> np.ndarray:
    """Which corners of faces are there, bool [F, 3]."""
    above = np.ones(net.faces.shape, bool)
    for number, faces in _grouped(net, group, np.ones(len(net.faces), bool)):
        for some in np.array_split(faces, len(faces) // AT_ONCE + 1):
            above[some] = contours[number].value(net.columns[net.faces[some]]) >= 0
    return above


def _refined(net: _Net, contours: list[Contour], group: np.ndarray, kept: np.ndarray, most: int) -> _Net:
    """With faces split until each can be cut; `kept` are the pairs of places along which none is. Raises TooMany."""
    asked, allowed = np.ones(len(net.faces), bool), len(net.faces) + most
    while True:
        there, edges = _judged(net, contours, group, asked)
        net, edges = net.of(there), edges[there]
        if not edges.any():
            return net
        net, parent = _split(net, edges, kept)
        if len(net.faces) > allowed:
            raise TooMany
        wanted: np.ndarray = np.any(edges, axis=1)
        asked = wanted[parent]


def _split(net: _Net, edges: np.ndarray, kept: np.ndarray) -> tuple[_Net, np.ndarray]:
    """With some edges of faces split, bool [F, 3], and those that have to be with them; and which face each is of, int [F]."""
    at = net.columns[:, PLACE][net.faces]
    length = np.linalg.norm(np.roll(at, -1, axis=1) - at, axis=2)
    long = length >= NEARLY * length.max(axis=1, keepdims=True)
    pairs, which = np.unique(_along(net.place[net.faces]), return_inverse=True)
    which, free = which.reshape(-1, 3), ~np.isin(pairs, kept)
    marked = np.zeros(len(pairs), bool)
    marked[which[edges]] = True
    while True:
        marked &= free
        split = marked[which]
        thin = np.flatnonzero(split.any(axis=1) & ~(split & long).any(axis=1))
        further = which[thin, length[thin].argmax(axis=1)]
        if not free[further].any():
            break
        marked[further] = True
    ends, first, middle = np.unique(_along(net.faces)[split], return_index=True, return_inverse=True)
    a, b = _ends(ends)
    number = np.full(net.faces.shape, -1, np.int64)
    number[split] = len(net.columns) + middle.reshape(-1)
    columns = np.concatenate([net.columns, _directed(0.5 * (net.columns[a] + net.columns[b]), net.columns[a])])
    place = net.places + (np.cumsum(marked) - 1)[which[split][first]]
    faces, parent = split_faces(net.faces, number, columns[:, PLACE])
    new = _Net(columns, faces, np.concatenate([net.place, place]), net.places + int(marked.sum()), net.owner[parent])
    return new, parent


def _clipped(net: _Net, contours: list[Contour], group: np.ndarray) -> _Net:
    """Without what is below: faces of which some corners are, cut from edge to edge."""
    above = _above(net, contours, group)
    count = above.sum(axis=1)
    faces, owner, columns = [net.faces[count == 3]], [net.owner[count == 3]], [net.columns]
    start = len(net.columns)
    for number, mixed in _grouped(net, group, (count == 1) | (count == 2)):
        one = count[mixed] == 1
        odd = (above[mixed] == one[:, None]).argmax(axis=1)  # the corner that is alone on its side
        corners = np.take_along_axis(net.faces[mixed], (odd[:, None] + np.arange(3)) % 3, axis=1)
        a, b = np.moveaxis(corners[:, [[0, 1], [0, 2]]], -1, 0)
        a, b = np.where(net.place[a] < net.place[b], [a, b], [b, a])  # the same for all that meet there
        ends, which = np.unique((a << PAIR) | b, return_inverse=True)
        a, b = _ends(ends)
        low, high = net.columns[a], net.columns[b]
        t = contours[number].root(low, high)
        columns.append(_directed(low + t[:, None] * (high - low), low))
        on = np.where(t <= SNAP, a, np.where(t >= 1 - SNAP, b, start + np.arange(len(ends))))
        start += len(ends)
        x, y = on[which.reshape(-1, 2)].T
        faces.append(np.stack([corners[one, 0], x[one], y[one]], axis=1))

        # Of two corners above a quad is left, cut along its shorter diagonal.
        x, y, (_, i, j) = x[~one], y[~one], corners[~one].T
        at_x, at_y = np.moveaxis(columns[-1][which.reshape(-1, 2)[~one]][:, :, PLACE], 1, 0)
        at_i, at_j = net.columns[i, PLACE], net.columns[j, PLACE]
        across = np.linalg.norm(at_x - at_j, axis=1) <= np.linalg.norm(at_i - at_y, axis=1)
        faces.append(np.stack([x, i, np.where(across, j, y)], axis=1))
        faces.append(np.stack([np.where(across, x, i), j, y], axis=1))
        owner += [net.owner[mixed[one]], *[net.owner[mixed[~one]]] * 2]
    left, owners = np.concatenate(faces), np.concatenate(owner)
    real = (left != np.roll(left, 1, axis=1)).all(axis=1)
    return replace(net, columns=np.concatenate(columns), faces=left[real], owner=owners[real])


def _along(corners: np.ndarray) -> np.ndarray:
    """One number for each edge of faces, int64 [F, 3], by the numbers of its ends: the same in both directions."""
    ends = corners, np.roll(corners, -1, axis=1)
    return (np.minimum(*ends) << PAIR) | np.maximum(*ends)


def _ends(pairs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The two numbers of each pair: in its upper and in its lower bits."""
    return pairs >> PAIR, pairs & ((1 << PAIR) - 1)


def _directed(columns: np.ndarray, otherwise: np.ndarray) -> np.ndarray:
    """Columns with unit normals; those of `otherwise` where they cancel out."""
    length = np.linalg.norm(columns[:, NORMAL], axis=1, keepdims=True)
    columns[:, NORMAL] = np.where(length > 1e-9, columns[:, NORMAL] / np.maximum(length, 1e-9), otherwise[:, NORMAL])
    return columns
