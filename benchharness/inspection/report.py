"""What a scene holds: its parts, what its mirrors show in the first frame, and which methods refuse it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchharness.inspection import mirrors
from benchharness.measure import contract
from benchharness.modelling import surfacefacts
from benchharness.scene import Object, Reflector, Scene
from benchharness.study.methods import Entry

FAR = 1000.0  # sizes of the smallest mirror: a scene that far from its origin, or so much larger than that, is worth a word
WIDE = 0.25  # of the picture's height: triangles with longer edges, in pixels of the first frame
BENT_DEG = 0.1  # normals turn by more across some triangle of a mirror that is not flat
SMALL_PX = 100  # mirrors that are less of the picture are hardly seen


@dataclass(frozen=True)
class Note:
    """One sentence; `wrong`: something that its author should know before trusting a result."""

    text: str
    wrong: bool = False

    def __str__(self) -> str:
        return f"! {self.text}" if self.wrong else f"  {self.text}"


def of_scene(
    scene: Scene,
    said: Sequence[str],
    entries: Sequence[Entry],
    size: tuple[int, int],
    picture: Path,
    bake_spp: int,
    say: Callable[[str], None] = lambda text: None,
) -> Iterator[Note]:
    """Notes on a scene as its author gave it, and its first frame as a file.

    said     what reading it had to mend
    entries  methods that are asked whether they take it
    size     pixels of the picture, which is written to `picture`, mirrors outlined
    say      hears what takes long, before it is done
    """
    yield Note(f"scene {scene.name}: {len(scene.objects)} objects, {len(scene.reflectors)} mirrors, {scene.frames} frames")
    yield from (Note(text, wrong=True) for text in said)
    yield from _place(scene)
    for part in scene.parts:
        yield from _part(part, scene, size)
    say("lighting and tracing the first frame")
    yield from _shown(scene, size, picture, bake_spp)
    yield from _refusals(scene, entries, say)


def _place(scene: Scene) -> Iterator[Note]:
    """Whether the scene had to be brought near."""
    corners = np.concatenate([part.mesh.vertices for part in scene.reflectors or scene.objects])
    away = float(np.linalg.norm(0.5 * (corners.min(axis=0) + corners.max(axis=0))))
    if away > FAR * scene.size:
        text = f"the mirrors stand {away:.4g} m from the origin, {away / scene.size:,.0f} times their size"
        yield Note(f"{text}: drawn around it", wrong=True)
    everything = np.concatenate([part.mesh.vertices for part in scene.parts])
    extent = float(np.linalg.norm(np.ptp(everything, axis=0)))
    if extent > FAR * scene.size:
        text = f"the scene is {extent:.4g} m across and its smallest mirror {2 * scene.size:.4g}"
        yield Note(f"{text}: are the units those of one file?", wrong=True)


def _part(part: Object | Reflector, scene: Scene, size: tuple[int, int]) -> Iterator[Note]:
    mirror = isinstance(part, Reflector)
    facts = surfacefacts.facts(part.mesh)
    yield Note(f"{'mirror' if mirror else 'object'} {part.name}: {surfacefacts.described(facts)}")
    for text in surfacefacts.faults(facts, mirror=mirror):
        yield Note(f"{part.name}: {text}", wrong=True)
    if isinstance(part, Reflector) and part.closed is None and facts.closed < facts.pieces and facts.turn_deg > BENT_DEG:
        text = f"{part.name} is open and bent: methods that move vertices search beyond its edges, and find what is not there"
        yield Note(f"{text}; a closed mesh around it can be named as `closed`", wrong=True)
    longest = longest_edge_px(part, scene, size)
    coarse = longest > WIDE * size[1] and part.mesh.radiance is None and scene.h_max is None
    if coarse and not mirror and not scene.lightmaps:
        text = f"{part.name}: edges of up to {longest:.0f} px, the picture being {size[1]} high, and light at their ends alone"
        yield Note(f"{text}: shadows on it are as coarse as that (h_max splits it)", wrong=True)


def longest_edge_px(part: Object | Reflector, scene: Scene, size: tuple[int, int]) -> float:
    """The longest edge of a part in the first frame, in pixels, of those that lie before the eye and are in the picture."""
    q = _projected(_standing(part, scene), scene, size)
    faces = part.mesh.faces[(q[part.mesh.faces][..., 2] > scene.near_plane).all(axis=1)]
    if len(faces) == 0:
        return 0.0
    corners = q[faces][..., :2] / q[faces][..., 2:]
    seen = ((corners.max(axis=1) > 0) & (corners.min(axis=1) < size)).all(axis=1)
    return float(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)[seen].max(initial=0.0))


def _standing(part: Object | Reflector, scene: Scene) -> np.ndarray:
    """A part's vertices in the first frame, [V, 3]."""
    return part.mesh.transformed(part.pose(scene.time(0))).vertices


def _projected(vertices: np.ndarray, scene: Scene, size: tuple[int, int]) -> np.ndarray:
    """Where the first frame's camera has vertices, homogeneous, [V, 3]: pixels times depth, and depth."""
    rows = scene.camera(scene.time(0)).world_to_screen(*size)
    return vertices @ rows[:, :3].T + rows[:, 3]


def _shown(scene: Scene, size: tuple[int, int], picture: Path, bake_spp: int) -> Iterator[Note]:
    seen = mirrors.first_frame(scene, size, bake_spp)
    mirrors.save(picture, seen)
    for mirror in seen.mirrors:
        if mirror.pixels < SMALL_PX:
            yield Note(f"mirror {mirror.name}: {mirror.pixels} of {size[0] * size[1]:,} pixels of the first frame", wrong=True)
            continue
        what = {
            "are black": mirror.black,
            "show backs of objects, which have no light of their own": mirror.backs,
            "show nothing at all": mirror.nothing,
            "show a mirror": mirror.second,
        }
        shares = [f"{share:.0%} {text}" for text, share in what.items() if share >= 0.005]
        worst = max(mirror.black, mirror.backs, mirror.nothing)
        text = f"mirror {mirror.name}: {mirror.pixels:,} pixels of the first frame"
        yield Note(f"{text}, of which {'; '.join(shares)}" if shares else text, wrong=worst > mirrors.MUCH)
    if not seen.mirrors:
        yield Note("no mirror is seen in the first frame", wrong=True)
        yield from (_unseen(part, scene, size) for part in scene.reflectors)
    yield Note(f"picture: {picture}")


def _unseen(part: Reflector, scene: Scene, size: tuple[int, int]) -> Note:
    """Where a mirror is that the first frame does not show."""
    vertices = _standing(part, scene)
    q = _projected(vertices, scene, size)
    q = q[q[:, 2] > scene.near_plane]
    at = q[:, :2] / q[:, 2:]
    if not len(q):
        said = ["behind the eye"]
    elif not ((at >= 0) & (at <= size)).all(axis=1).any():
        said = ["beside the picture"]
    else:
        said = ["in the picture, behind something else"]
    if scene.objects:
        others = np.concatenate([_standing(thing, scene) for thing in scene.objects])
        if (vertices.min(axis=0) > others.max(axis=0)).any() or (vertices.max(axis=0) < others.min(axis=0)).any():
            said.append("outside of the box around all objects")
        own, all_ = (float(np.ptp(points, axis=0).max()) for points in (vertices, others))
        if own > all_:
            said.append(f"{own:.4g} m long, and all objects together {all_:.4g}: are the units those of one file?")
    return Note(f"mirror {part.name} is {', '.join(said)}", wrong=True)


def _refusals(scene: Scene, entries: Sequence[Entry], say: Callable[[str], None]) -> Iterator[Note]:
    taken = []
    for entry in entries:
        say(f"asking {entry.method}")
        method = contract.made(entry.build, scene)
        if isinstance(method, contract.Out):
            yield Note(f"{entry.method}: {method.status}: {method.reason}", wrong=method.status != "refused")
        else:
            taken.append(entry.method)
    yield Note(f"methods that take it: {', '.join(dict.fromkeys(taken)) or 'none'}", wrong=not taken)
