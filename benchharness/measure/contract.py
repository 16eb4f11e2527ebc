"""The harness's side of the contract: what a method is lent, and whether what it gives back is an answer.

A method's code may raise anything, return anything, and write into all that it is given. Whatever asks one asks through here,
inside of what takes an exception for that method's own.
"""

from __future__ import annotations

import contextlib
import traceback
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields, is_dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from benchharness.api import Frame, Method, Reflection, Vertices
from benchharness.measure import timing
from benchharness.scene import Scene
from benchharness.study import plugins

NAME_LENGTH = 64  # of a counter
COUNTERS = 64  # of an answer
SENTENCE = 1000  # characters of a reason that are kept


def lent(frame: Frame) -> Frame:
    """The frame for one method: what is written into it, nobody else sees. Copies no array until one is written to."""
    return dr.copy(frame)


def fingerprint(frame: Frame) -> dict[str, int]:
    """A number for each field, which changes with its content; waits for the device.

    Finds what was written into memory itself, as through `frame.p.x.numpy()`, which copies on writing do not keep apart.
    """
    leaves = {field.name: list(_leaves(getattr(frame, field.name))) for field in fields(frame)}
    dr.eval(leaves)
    return {name: hash(tuple(leaf if isinstance(leaf, int) else int(leaf[0]) for leaf in own)) for name, own in leaves.items()}


def _leaves(value: Any) -> Iterator[mi.UInt32 | int]:
    """The width of each array in a tree of them, and the sum of its bits with weights that differ by place; else a hash."""
    if dr.is_array_v(value) and dr.depth_v(value) == 1:
        bits = mi.UInt32(value if dr.is_mask_v(value) else dr.reinterpret_array(mi.UInt32, value))
        lanes = dr.width(bits)
        yield lanes
        if lanes > 0:
            yield dr.sum(bits * (2 * dr.arange(mi.UInt32, lanes) + 1))
        return
    if is_dataclass(value):
        value = [getattr(value, field.name) for field in fields(value)]
    if dr.is_array_v(value) or isinstance(value, list | tuple):
        yield len(value)
        for one in value:
            yield from _leaves(one)
    else:
        yield hash(value)


def written(before: dict[str, int], frame: Frame) -> str:
    """The fields that changed since the fingerprint `before`, "" for none."""
    return ", ".join(name for name, number in fingerprint(frame).items() if number != before[name])


def updated(method: Method, state: Any, frame: Frame) -> tuple[Any, float]:
    """The state that `method.update` returns, evaluated, and the ms that it took."""
    own = lent(frame)
    return timing.timed(lambda: method.update(state, own))


def shaded(method: Method, state: Any, frame: Frame, scene: Scene) -> tuple[Reflection, Any, float]:
    """What `method.shade` returns, evaluated, and the ms that it took. Raises as `answer` does."""
    own = lent(frame)
    result, ms = timing.timed(lambda: method.shade(state, own))
    return *answer(result, frame, scene), ms


@dataclass(frozen=True)
class Out:
    """Why a method shows nothing of a scene; `status`: "refused" or "crashed"."""

    status: str
    reason: str


def made(build: Callable[[], Method], scene: Scene) -> Method | Out:
    """The method that `build` makes, if it takes the scene; whatever is raised on the way is that method's own."""
    doing = "it cannot be made"
    try:
        method = build()
        doing = "refuses"
        refused = refusal(method, scene)
    except BaseException as error:  # a plugin may raise what is no Exception
        with contextlib.suppress(Exception):
            traceback.print_exc()
        return Out("crashed", f"{doing}: {account(error)}")
    return method if refused is None else Out("refused", refused)


def refusal(method: Method, scene: Scene) -> str | None:
    """What `method.refuses` says, in one line. Raises TypeError for what is neither a sentence nor None."""
    said = method.refuses(scene)
    if said is None:
        return None
    if not isinstance(said, str) or not said.strip():
        raise TypeError(f"refuses returns {_kind(said)}; accepted: a sentence, or None")
    return _short(said)


def account(error: BaseException) -> str:
    """What was raised, in one line, also where it cannot say that itself."""
    return _short(plugins.said(error))


def _short(text: str) -> str:
    line = " ".join(text[: 2 * SENTENCE].split())
    return line if len(line) <= SENTENCE else f"{line[:SENTENCE]} ..."


def answer(shaded: Any, frame: Frame, scene: Scene) -> tuple[Reflection, Any]:
    """What `shade` returned for `frame`, the `Reflection` as a copy, which does not change when the method's own does.

    Raises TypeError or ValueError, with what would be accepted, for anything but one of the right types and lanes, and the
    next state."""
    if not isinstance(shaded, tuple) or len(shaded) != 2 or not isinstance(shaded[0], Reflection):
        raise TypeError(f"shade returns {_kind(shaded)}; accepted: a Reflection and the next state")
    reflection = shaded[0]
    pixels = frame.view.width * frame.view.height
    for name, kind in (("L", mi.Color3f), ("distance", mi.Float), ("found", mi.Bool), ("doubt", mi.Bool)):
        value = getattr(reflection, name)
        if name == "doubt" and value is None:
            continue
        if not isinstance(value, kind):
            raise TypeError(f"{name} is {_kind(value)}; accepted: {kind.__name__}{', or None' if name == 'doubt' else ''}")
        if dr.width(value) not in (1, pixels):
            raise ValueError(f"{name} has {dr.width(value)} lanes; accepted: {pixels}, one per pixel")
    if reflection.vertices is not None:
        _check_vertices(reflection.vertices, "vertices", len(scene.reflectors) * scene.vertices)
    _check_counters(reflection.counters)
    return dr.copy(reflection), shaded[1]


def _check_vertices(vertices: Any, where: str, lanes: int) -> None:
    """Types, lanes, finite numbers where a search converged, and so of what it found beyond the first."""
    if not isinstance(vertices, Vertices):
        raise TypeError(f"{where} is {_kind(vertices)}; accepted: Vertices, or None")
    triples = (mi.Point3f, mi.Normal3f, mi.Vector3f)
    kinds = {"R": triples, "n": triples, "virtual": triples, "residual": (mi.Float,)}
    kinds |= dict.fromkeys(("converged", "valid", "border"), (mi.Bool,)) | dict.fromkeys(("region", "iterations"), (mi.UInt32,))
    for name, accepted in kinds.items():
        value = getattr(vertices, name)
        if not isinstance(value, accepted):
            raise TypeError(f"{where}.{name} is {_kind(value)}; accepted: {accepted[0].__name__}")
        if dr.width(value) != lanes:
            raise ValueError(f"{where}.{name} has {dr.width(value)} lanes; accepted: {lanes}, one per reflector and vertex")
    lost = vertices.converged & ~(dr.all(dr.isfinite(vertices.R)) & dr.all(dr.isfinite(vertices.virtual)))
    if (count := np.count_nonzero(np.array(lost))) > 0:
        raise ValueError(f"{where}: {count} that converged have no place; accepted: finite R and virtual")
    if not isinstance(vertices.further, list):
        raise TypeError(f"{where}.further is {_kind(vertices.further)}; accepted: a list of Vertices")
    for number, more in enumerate(vertices.further):
        if getattr(more, "further", []) != []:
            raise ValueError(f"{where}.further[{number}].further is not empty; accepted: one list, of the first")
        _check_vertices(more, f"{where}.further[{number}]", lanes)


def _check_counters(counters: Any) -> None:
    if not isinstance(counters, dict):
        raise TypeError(f"counters is {_kind(counters)}; accepted: a dict, name -> UInt32")
    if len(counters) > COUNTERS:
        raise ValueError(f"there are {len(counters)} counters; accepted: at most {COUNTERS}")
    for name, value in counters.items():
        if not isinstance(name, str) or not name.isidentifier() or len(name) > NAME_LENGTH:
            shown = _short(repr(name)[:NAME_LENGTH])
            raise ValueError(f"a counter is called {shown}; accepted: an identifier of at most {NAME_LENGTH} characters")
        if not isinstance(value, mi.UInt32):
            raise TypeError(f"counter {name} is {_kind(value)}; accepted: UInt32")


def counted(reflection: Reflection) -> dict[str, int]:
    """Counter -> its sum over all lanes, of an answer that was checked."""
    return {name: int(np.array(count, np.int64).sum()) for name, count in reflection.counters.items()}


def _kind(value: Any) -> str:
    """What a value is, as short as that can be said."""
    if isinstance(value, tuple):
        return f"a tuple of {len(value)}"
    return "None" if value is None else type(value).__name__
