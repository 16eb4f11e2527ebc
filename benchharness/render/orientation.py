"""Turns a scene's triangles so that fronts are where they are seen from.

Surfaces are two-sided in effect, but much rests on which side is the front: what is culled, where light is baked, which way a
mirror's normals point. So what the winding of a file says is not believed where it can be known better:

* faces of one piece (`benchharness.modelling.winding`) are wound alike, as most of its area is
* a closed piece faces outwards, and inwards if every eye of the animation is inside it: a room
* an open piece of an object that turns nothing but its back to the eye and to the mirrors is turned

Normals that follow from the faces are computed anew; others are turned where they point away from all faces around.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from benchharness.modelling import winding
from benchharness.scene import Mesh, Object, Reflector, Scene, vertex_normals

EYES = 32  # of an animation at most, and
POINTS = 8  # of a mirror, from which it is asked what is seen
REMARKABLE = 0.1  # of a part's faces
TIMES = 3  # of the animation, at which mirrors are where they are


@dataclass(frozen=True)
class Turned:
    """What was changed of a part: `faces` of `of` turned, `normals` turned; `one_sided` faces of an object that have no two
    sides, and stay as they are."""

    part: str
    faces: int
    of: int
    normals: int
    one_sided: int

    @property
    def remarkable(self) -> bool:
        """Whether it is worth a word: the walls behind all others, which nobody sees, are not."""
        return self.faces > REMARKABLE * self.of or self.normals > 3 * REMARKABLE * self.of or self.one_sided > 0

    def __str__(self) -> str:
        said = []
        if self.faces:
            said.append(f"{self.faces} of {self.of} triangles were wound with their backs to who sees them, and are turned")
        if self.normals:
            said.append(f"{self.normals} normals pointed away from the triangles around them, and are turned")
        if self.one_sided:
            said.append(f"{self.one_sided} of {self.of} triangles are of a surface with one side, and stay as they are")
        return f"{self.part}: " + "; ".join(said)


@lru_cache(maxsize=8)
def oriented(scene: Scene) -> tuple[Scene, list[Turned]]:
    """The scene with its triangles turned as above, and what was changed; the scene itself where nothing was.

    Raises ValueError for a mirror of which a piece cannot be wound consistently.
    """
    notes: list[Turned] = []

    def mended(name: str, mesh: Mesh, sign: np.ndarray, one_sided: int = 0) -> Mesh:
        faces = winding.turned(mesh.faces, sign)
        normals, count = _normals(mesh, faces, changed=bool((sign < 0).any()))
        if count or one_sided or (sign < 0).any():
            notes.append(Turned(name, int((sign < 0).sum()), len(sign), count, one_sided))
        return mesh if count == 0 and (sign > 0).all() else replace(mesh, faces=faces, normals=normals)

    objects = []
    for part in scene.objects:
        found = winding.pieces(part.mesh)
        sign = _seen_from_front(scene, part, found)
        objects.append(
            replace(part, mesh=mended(f"object {part.name}", part.mesh, sign, int((~found.two_sided)[found.piece].sum())))
        )
    mirrors = []
    for part in scene.reflectors:
        mesh = mended(f"mirror {part.name}", part.mesh, _outward(part.name, part.mesh))
        closed = part.closed
        if closed is part.mesh:
            closed = mesh
        elif closed is not None:
            closed = mended(f"mirror {part.name}, closed", closed, _outward(part.name, closed))
        mirrors.append(part if mesh is part.mesh and closed is part.closed else replace(part, mesh=mesh, closed=closed))
    return (replace(scene, objects=tuple(objects), reflectors=tuple(mirrors)) if notes else scene), notes


def _outward(name: str, mesh: Mesh) -> np.ndarray:
    """Signs of a mirror's faces, int [F]: closed pieces face outwards."""
    found = winding.pieces(mesh)
    if not found.two_sided.all():
        bad = int((~found.two_sided)[found.piece].sum())
        raise ValueError(
            f"mirror {name}: {bad} of {len(mesh.faces)} triangles are of a surface that has one side; "
            "accepted: triangles that can be wound consistently"
        )
    return found.sign * _by_piece(found, found.closed & (_volumes(mesh, found) < 0))


def _seen_from_front(scene: Scene, part: Object, found: winding.Pieces) -> np.ndarray:
    """Signs of an object's faces, int [F]."""
    outward = found.closed & (_volumes(part.mesh, found) < 0)
    sign = found.sign * _by_piece(found, outward & found.two_sided)
    turn = np.zeros(len(found.closed), bool)
    eyes = np.array([_local(part, t, [scene.camera(t).eye])[0] for t in _times(scene, EYES)])
    low, high = _boxes(part.mesh, found)
    around = ((eyes.min(axis=0) > low) & (eyes.max(axis=0) < high)).all(axis=1)
    for piece in np.flatnonzero(found.closed & found.two_sided & around):
        faces = winding.turned(part.mesh.faces, sign)[found.piece == piece]
        solid = winding.Surface(part.mesh.vertices, faces)
        turn[piece] = all(winding.winding_number(solid, eye) > 0.5 for eye in eyes)
    open_ = found.two_sided & ~found.closed
    if open_.any():
        viewers = np.concatenate([eyes, *_mirrors(scene, part)])
        n = winding.crossed(part.mesh.vertices, part.mesh.faces) * sign[:, None]
        facing = n @ viewers.T > np.einsum("fi,fi->f", n, part.mesh.vertices[part.mesh.faces[:, 0]])[:, None]
        shown = np.bincount(found.piece, np.linalg.norm(n, axis=1) * facing.any(axis=1), len(turn))
        turn |= open_ & (shown <= 0)
    return sign * _by_piece(found, turn)


def _by_piece(found: winding.Pieces, turn: np.ndarray) -> np.ndarray:
    return np.where(turn[found.piece], -1, 1)


def _volumes(mesh: Mesh, found: winding.Pieces) -> np.ndarray:
    """Signed volumes of the pieces, float64 [P], of meaning for those that are closed; positive where they face outwards."""
    return np.bincount(found.piece, winding.volumes(mesh) * found.sign, len(found.closed))


def _boxes(mesh: Mesh, found: winding.Pieces) -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest corner of every piece's box, float64 [P, 3]."""
    low, high = np.full((len(found.closed), 3), np.inf), np.full((len(found.closed), 3), -np.inf)
    which, corners = np.repeat(found.piece, 3), mesh.vertices[mesh.faces].reshape(-1, 3)
    np.minimum.at(low, which, corners)
    np.maximum.at(high, which, corners)
    return low, high


def _mirrors(scene: Scene, part: Object) -> Iterator[np.ndarray]:
    """Points of the mirrors, over the animation, in the space of a part: [N, 3] each."""
    for time in _times(scene, TIMES):
        for mirror in scene.reflectors:
            v = mirror.mesh.vertices
            v = v[:: max(1, len(v) // POINTS)][:POINTS]
            pose = mirror.pose(time)
            yield _local(part, time, v @ pose[:3, :3].T + pose[:3, 3])


def _local(part: Object | Reflector, time: float, points) -> np.ndarray:
    """World-space points [N, 3] in the space of a part."""
    pose = part.pose(time)
    return np.linalg.solve(pose[:3, :3], (np.asarray(points, np.float64) - pose[:3, 3]).T).T


def _times(scene: Scene, most: int) -> list[float]:
    frames = np.unique(np.linspace(0, max(scene.frames - 1, 0), min(most, max(scene.frames, 1))).astype(int))
    return [scene.time(int(frame)) for frame in frames]


def _normals(mesh: Mesh, faces: np.ndarray, *, changed: bool) -> tuple[np.ndarray, int]:
    """Normals for these faces of a mesh, float64 [V, 3], and how many of its author's were turned."""
    around = vertex_normals(mesh.vertices, faces)
    if changed and np.allclose(mesh.normals, vertex_normals(mesh.vertices, mesh.faces), atol=1e-6):
        return around, 0
    away = np.einsum("vi,vi->v", mesh.normals, around) < 0
    away &= np.isin(np.arange(len(away)), faces)
    return np.where(away[:, None], -mesh.normals, mesh.normals), int(away.sum())
