"""What is turned: the knobs of methods, which they declare themselves, and those of a scene, which all methods share."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from benchharness.api import Method
from benchharness.render.bake import bake
from benchharness.scene import Scene, refined
from benchharness.study import plugins
from benchharness.study.methods import Entry

SPLIT = 1 / 25  # of the diagonal of a scene: longest edges for a method that splits none
SHARES = (10, 20, 40, 80)  # of the diagonal of a scene: longest edges
MOST_VERTICES = 120_000  # that a scene is split into
PATHS = (32, 128, 512)  # per vertex, of the light
EDGES, LIGHT = "longest edge", "bake_spp"


@dataclass(frozen=True, eq=False)
class Turn:
    """A knob of one method in one scene.

    knob    its name
    given   what else is set, as text
    values  from the smallest model to the largest, as texts,
    cases   and what is rendered for each: the scene and the method
    truth   fields of `reference.ReferenceOptions` that it is judged by
    """

    method: str
    knob: str
    given: str
    values: list[str]
    cases: list[tuple[Callable[[], Scene], Method]]
    truth: dict[str, Any]


def of_method(entry: Entry, scene: Scene, split: Scene) -> Iterator[Turn]:
    """The knobs that a method declares, in a scene whose edges are not split; `split`: with short ones. What the config sets
    holds meanwhile. Raises ValueError for values that it refuses."""
    name = entry.method
    kind: Any = plugins.given("method", name, entry.source, name).target
    for knob in kind.knobs:
        drawn = split if knob.split else scene
        given_too = {**entry.set_by_hand, **knob.given}
        cases = [(lambda drawn=drawn: drawn, _built(name, kind, {**given_too, knob.parameter: v})) for v in knob.values]
        given = _text({**knob.given, **({"h_max": "split"} if knob.split else {})})
        yield Turn(name, knob.parameter, given, [_said(value) for value in knob.values], cases, dict(knob.reference))


def _built(name: str, kind: Callable[..., Method], params: dict[str, Any]) -> Method:
    try:
        return kind(**params)
    except (TypeError, ValueError) as error:
        raise ValueError(
            f"{name}: a knob is {_text(params)}: {error}; accepted: fields of the method, with their values"
        ) from None


def short_edged(scene: Scene) -> Scene:
    """The scene with edges as short as it wants them, or as SPLIT of its diagonal where it does not say."""
    return refined(scene if scene.h_max is not None else replace(scene, h_max=SPLIT * _diagonal(scene)))


def _diagonal(scene: Scene) -> float:
    corners = np.concatenate([part.mesh.transformed(part.pose(0.0)).vertices for part in scene.objects])
    return float(np.linalg.norm(np.ptp(corners, axis=0)))


def of_edges(entry: Entry, scene: Scene) -> Turn:
    """The scene as it is, and with ever shorter edges, for one method, which splits none itself."""
    split, kind = _split(scene), plugins.given("method", entry.method, entry.source, entry.method).target
    alike = {"split_px": 0.0} if "split_px" in entry.params else {}
    method = _built(entry.method, kind, {**entry.set_by_hand, **alike})
    return Turn(entry.method, EDGES, _text(alike), list(split), [(lambda one=one: one, method) for one in split.values()], {})


def _split(scene: Scene) -> dict[str, Scene]:
    """By longest edge; those that have as many vertices come once, and none comes that has too many."""
    diagonal = _diagonal(scene)
    found, last = {"as built": scene}, scene.vertices
    for share in SHARES:
        one = refined(replace(scene, h_max=diagonal / share))
        if one.vertices > MOST_VERTICES:
            break
        if one.vertices > last:
            found[f"diagonal/{share}"] = one
        last = one.vertices
    return found


def of_light(name: str, method: Method, scene: Scene, seed: int) -> Turn:
    """Ever more paths per vertex, for one method."""
    bare = replace(scene, objects=tuple(replace(o, mesh=replace(o.mesh, radiance=None, light=None)) for o in scene.objects))
    cases: list[tuple[Callable[[], Scene], Method]] = [(lambda n=n: bake(bare, spp=n, seed=seed), method) for n in PATHS]
    return Turn(name, LIGHT, "", [str(n) for n in PATHS], cases, {})


def _text(params: dict[str, Any]) -> str:
    return "; ".join(f"{name}={_said(value)}" for name, value in sorted(params.items()))


def _said(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)
