"""The checks of `check-method`, in this process, on a tiny scene: a mirror ball in a box, and one ball that moves. A method
that refuses that is checked with a flat mirror.

Nothing here is timed; what is checked is that a time would mean what it says: the answer depends on the frame, is not kept
between frames, calls or instances, is all there when `shade` returns, and nothing is evaluated inside `shade`.
"""

from __future__ import annotations

import inspect
import re
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import drjit as dr
import numpy as np

from benchharness.api import Frame, Method
from benchharness.execution import tiny
from benchharness.execution.finding import Finding, judged
from benchharness.execution.watched import Watched
from benchharness.measure import contract
from benchharness.render.frame import FrameRenderer
from benchharness.scene import Scene
from benchharness.study import params, plugins

SIZE = (96, 64)
PAUSE_S = 0.25  # after a call, in which nothing should be working
BUSY = 0.2  # of one core in that time, above what Dr.Jit's own threads need to fall asleep
KEPT = 0.5  # share of the first call's work, in kernels, below which a second one uses what the first left


def findings(plugin: plugins.Plugin) -> Iterator[Finding]:
    """Checks one after the other, until one makes the rest meaningless."""
    cls = plugin.target
    yield from _documented(cls)
    try:
        method = cls()
    except Exception as error:  # whatever a plugin may raise
        yield Finding("fail", f"it cannot be made with its default parameters: {contract.account(error)}")
        return
    scene = tiny.scene()
    try:
        refusal = contract.refusal(method, scene)
        if refusal is not None and contract.refusal(method, tiny.flat()) is None:
            scene, refusal = tiny.flat(), None
    except Exception as error:  # whatever a plugin may raise
        yield Finding("fail", f"refuses: {contract.account(error)}")
        return
    if refusal is not None:
        yield Finding("warn", f"it refuses the test scene, so that nothing else can be checked: {refusal}")
        return
    before = dict(vars(method))
    drawer = FrameRenderer(scene, *SIZE)
    frames = [drawer.render(index) for index in range(2)]
    usual, there = _busy(), set(threading.enumerate())
    first = Watched(method, scene, frames[0])
    busy, more = _busy() - usual, len(set(threading.enumerate()) - there)
    yield from _well_formed(first, frames[0])
    if first.broken or not first.found.any():
        return
    yield judged(not first.wrote, "frame unchanged", f"it writes into the frame: {first.wrote}")
    yield from _done(busy, more)
    beyond = int(np.isinf(first.distance[first.found]).sum())
    yield judged(
        beyond == 0,
        "within walls, nothing is found at infinity",
        f"{beyond} pixels are found at infinity, and walls enclose the mirror (Scene.enclosed): no answer, found is False",
    )
    yield judged(first.launched == 0, "nothing is evaluated inside shade", f"shade launches {first.launched} kernels", "warn")
    yield from _fresh(cls, scene, drawer, frames, first)
    again = Watched(cls(), scene, frames[0])
    yield judged(first.same(again), "the same frame gives the same answer, bit for bit", "two runs of a frame differ")
    moved = Watched(cls(), scene, frames[1])
    yield judged(
        not first.same(moved),
        "another camera gives another answer",
        "another camera gives the same answer: it is cached",
    )
    after = Watched(method, scene, frames[0])
    yield judged(
        first.same(after), "the answer does not depend on who ran before", "after another frame, a fresh state differs"
    )
    yield judged(_unchanged(method, before), "self is unchanged", "self changed while it ran: state is passed, not kept")
    yield from _larger(method, scene, first)


def _larger(method: Method, scene: Scene, first: Watched) -> Iterator[Finding]:
    """That a picture of twice the size shows the same."""
    large = FrameRenderer(scene, 2 * SIZE[0], 2 * SIZE[1]).render(0)
    larger = Watched(method, scene, large)
    yield from (f for f in _well_formed(larger, large) if f.level == "fail")
    if not larger.broken and larger.found.any():
        one, other = first.mean(), larger.mean()
        alike = bool(np.allclose(one, other, rtol=0.1))
        yield judged(
            alike,
            "twice the resolution shows the same",
            f"twice the resolution changes the mean radiance from {one} to {other}",
            "warn",
        )


def _unchanged(method: Method, before: dict[str, Any]) -> bool:
    try:
        return bool(vars(method) == before and method == type(method)())
    except Exception:  # fields that cannot be compared are none of a dataclass of parameters
        return False


def _fresh(cls: type[Method], scene: Scene, drawer: FrameRenderer, frames: list[Frame], first: Watched) -> Iterator[Finding]:
    """That every call of a verb does its work: for another camera, for other poses, for the same frame once more."""
    camera, now = scene.camera(frames[1].time), frames[0].time
    beside = replace(drawer.draw(0, drawer.view(1)), boxes=drawer.boxes(camera, now))
    dr.eval(beside)
    second, carried, other = first.again(frames[0], cold=True), first.again(beside), Watched(cls(), scene, beside)
    if broken := second.broken or carried.broken or other.broken:
        yield Finding("fail", f"asked once more, it fails: {broken}")
        return
    share = second.work / first.work if first.work else 1.0
    yield judged(
        share >= KEPT,
        "a second call of shade works as much as the first",
        f"a second call of shade launches kernels for {share:.0%} of the first one's work: it lives on what that one left",
    )
    yield judged(
        not (first.shows(other) or first.shows(carried)),
        "another camera gives another picture, the number of the frame being the same",
        "another camera gives the same picture where the number of the frame is the same: it is kept by number",
    )
    stale = Watched(cls(), scene, beside, updated_to=frames[0])
    yield judged(
        stale.same(other),
        "what update makes serves every camera",
        "without a new update another camera gives a wrong answer: update does what depends on the eye",
    )
    renumbered = Watched(cls(), scene, replace(frames[1], index=0))
    yield judged(
        not (first.updated > 0 and renumbered.updated == 0),
        "update works again when things have moved, the number of the frame being the same",
        "update launches nothing when things have moved and the number of the frame is the same: it is kept by number",
    )


def _busy() -> float:
    """Cores that this process keeps busy, though nothing was asked of it and the device is done."""
    dr.sync_thread()
    wall, cpu = time.perf_counter(), time.process_time()
    time.sleep(PAUSE_S)
    return (time.process_time() - cpu) / (time.perf_counter() - wall)


def _done(busy: float, threads: int) -> Iterator[Finding]:
    """That nothing goes on once the verbs have returned: `busy` cores more than before, and so many threads more."""
    yield judged(
        busy <= BUSY,
        "nothing works on after shade has returned",
        f"after shade has returned, {busy:.1f} cores work on: the clock is stopped before the work is done",
    )
    if threads > 0:
        yield Finding("warn", f"{threads} threads of its own are there after shade has returned")


def _documented(cls: type) -> Iterator[Finding]:
    """The paper, the module's account, and every parameter by name."""
    module = inspect.getmodule(cls)
    said = f"{module.__doc__ or ''}\n{cls.__doc__ if '__doc__' in vars(cls) else ''}"
    paper = getattr(cls, "paper", "")
    yield judged(bool(paper), f"paper: {paper}", 'it names no paper; accepted: paper: ClassVar[str] = "..."')
    yield judged(bool(module.__doc__), "the module says what it does", "the module has no docstring", "warn")
    silent = [name for name in params.of_method(cls) if not re.search(rf"\b{re.escape(name)}\b", said)]
    yield judged(
        not silent, "every parameter is documented", f"no docstring tells of the parameters {', '.join(silent)}", "warn"
    )


def _well_formed(answer: Watched, frame: Frame) -> Iterator[Finding]:
    """Lanes, types, finite numbers and the found mask."""
    size = f"{frame.view.width} x {frame.view.height}"
    yield judged(answer.broken is None, f"it answers {size}, in the right lanes", f"{size}: {answer.broken}")
    if answer.broken:
        return
    L, found = answer.L[answer.active], answer.found[answer.active]
    bad = int((~np.isfinite(L) | (L < 0)).any(axis=1).sum())
    yield judged(bad == 0, "radiance is finite", f"radiance is negative or not finite in {bad} of {len(L)} pixels")
    distance = answer.distance[answer.found]
    bad = int((np.isnan(distance) | (distance <= 0)).sum())
    yield judged(bad == 0, "distance is positive", f"distance is NaN or not positive in {bad} pixels that are found")
    share = float(found.mean())
    level = "fail" if share == 0 else "warn"
    yield judged(share > 0.9, f"found: {share:.0%} of the pixels", f"found: {share:.0%} of the pixels", level)
