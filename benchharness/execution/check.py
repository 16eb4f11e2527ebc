"""`check-method`: does a method keep the contract of `benchharness.api`? A list of pass, warn and fail.

The method runs on a tiny scene (a mirror ball in a box, one ball that moves) in a child process, since a kernel that is
wrong may abort: `python -m benchharness.execution.check FILE[:Name] PARENT` says one finding per line as JSON. Nothing
here is timed; what is checked is that a time would mean what it says: the answer depends on the frame, is not kept between
frames, calls or instances, is all there when `shade` returns, and nothing is evaluated inside `shade`.
"""

from __future__ import annotations

import contextlib
import dataclasses
import inspect
import os
import re
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from benchharness import platform, processes
from benchharness.scene import Camera, Mesh, Object, Reflector, Scene, subdivided
from benchharness.study import params, plugins

if TYPE_CHECKING:
    from benchharness.api import Frame, Method, Reflection
    from benchharness.render.frame import FrameRenderer

SIZE = (96, 64)
TIMEOUT_S = 300.0
PAUSE_S = 0.25  # after a call, in which nothing should be working
BUSY = 0.2  # of one core in that time, above what Dr.Jit's own threads need to fall asleep
KEPT = 0.5  # share of the first call's work, in kernels, below which a second one uses what the first left

Renderer = Callable[[Scene, int, int], "FrameRenderer"]


@dataclass(frozen=True)
class Finding:
    """`level` is "pass", "warn" or "fail"."""

    level: str
    text: str


def check(spec: str) -> list[Finding]:
    """Checks the method of `file.py` or `file.py:Name` in a child process. Raises ValueError for no file."""
    path = Path(plugins.absolute(spec, Path.cwd()).rpartition(".py")[0] + ".py")
    if not path.is_file():
        raise ValueError(f"check-method: there is no file {path}; accepted: file.py or file.py:Name")
    found: list[Finding] = []
    with tempfile.TemporaryDirectory(prefix="benchharness-") as folder:
        log = Path(folder) / "log"
        with open(log, "wb") as stream:
            arguments = plugins.absolute(spec, Path.cwd()), str(os.getpid())
            child = processes.start("benchharness.execution.check", *arguments, log=stream)
        try:
            ending = _heard(child, found)
        finally:
            processes.end(child)
        words = processes.tail(log)
    if ending is not None:
        found.append(Finding("fail", f"{ending}: {words or 'no word'}"))
    return found


def _heard(child: subprocess.Popen[bytes], found: list[Finding]) -> str | None:
    """Adds what a child finds; returns how it ended, None if it said that this was all."""
    assert child.stdout is not None
    lines, deadline = processes.Lines(child.stdout), time.monotonic() + TIMEOUT_S
    try:
        while (said := lines.next(deadline - time.monotonic())) is not None:
            if "all" in said:
                return None
            found.append(Finding(str(said.get("level")), str(said.get("text"))))
        return f"the process ended with {processes.cause(child.wait(timeout=10.0))} before it was done"
    except TimeoutError:
        return f"no end within {TIMEOUT_S:g} s"
    except subprocess.TimeoutExpired:
        return "the process closed its channel"
    except ValueError as error:
        return str(error)


def findings(plugin: plugins.Plugin, renderer: Renderer) -> Iterator[Finding]:
    """Checks in this process, one after the other, until one makes the rest meaningless."""
    from benchharness.measure import contract

    cls = plugin.target
    yield from _documented(cls)
    try:
        method = cls()
    except Exception as error:  # whatever a plugin may raise
        yield Finding("fail", f"it cannot be made with its default parameters: {contract.account(error)}")
        return
    scene = tiny_scene()
    try:
        refusal = contract.refusal(method, scene)
    except Exception as error:  # whatever a plugin may raise
        yield Finding("fail", f"refuses: {contract.account(error)}")
        return
    if refusal is not None:
        yield Finding("warn", f"it refuses the test scene, so that nothing else can be checked: {refusal}")
        return
    before = dict(vars(method))
    drawer = renderer(scene, *SIZE)
    frames = [drawer.render(index) for index in range(2)]
    usual, threads = _busy(), threading.active_count()
    first = _Answer(method, scene, frames[0])
    busy, more = _busy() - usual, threading.active_count() - threads
    yield from _well_formed(first, frames[0])
    if first.broken or not first.found.any():
        return
    yield _judged(not first.wrote, "frame unchanged", f"it writes into the frame: {first.wrote}")
    yield from _done(busy, more)
    beyond = int(np.isinf(first.distance[first.found]).sum())
    yield _judged(
        beyond == 0,
        "within walls, nothing is found at infinity",
        f"{beyond} pixels are found at infinity, and walls enclose the mirror (Scene.enclosed): no answer, found is False",
    )
    yield _judged(first.launched == 0, "nothing is evaluated inside shade", f"shade launches {first.launched} kernels", "warn")
    yield from _fresh(cls, scene, drawer, frames, first)
    again = _Answer(cls(), scene, frames[0])
    yield _judged(first.same(again), "the same frame gives the same answer, bit for bit", "two runs of a frame differ")
    moved = _Answer(cls(), scene, frames[1])
    yield _judged(
        not first.same(moved),
        "another camera gives another answer",
        "another camera gives the same answer: it is cached",
    )
    after = _Answer(method, scene, frames[0])
    yield _judged(
        first.same(after), "the answer does not depend on who ran before", "after another frame, a fresh state differs"
    )
    yield _judged(_unchanged(method, before), "self is unchanged", "self changed while it ran: state is passed, not kept")
    large = renderer(scene, 2 * SIZE[0], 2 * SIZE[1]).render(0)
    larger = _Answer(method, scene, large)
    yield from (f for f in _well_formed(larger, large) if f.level == "fail")
    if not larger.broken and larger.found.any():
        one, other = first.mean(), larger.mean()
        alike = bool(np.allclose(one, other, rtol=0.1))
        yield _judged(
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


def _fresh(cls: type[Method], scene: Scene, drawer: FrameRenderer, frames: list[Frame], first: _Answer) -> Iterator[Finding]:
    """That every call of a verb does its work: for another camera, for other poses, for the same frame once more."""
    import drjit as dr

    camera, now = scene.camera(frames[1].time), frames[0].time
    beside = dataclasses.replace(drawer.draw(0, drawer.view(1)), boxes=drawer.boxes(camera, now))
    dr.eval(beside)
    second, carried, other = first.again(frames[0], cold=True), first.again(beside), _Answer(cls(), scene, beside)
    if broken := second.broken or carried.broken or other.broken:
        yield Finding("fail", f"asked once more, it fails: {broken}")
        return
    share = second.work / first.work if first.work else 1.0
    yield _judged(
        share >= KEPT,
        "a second call of shade works as much as the first",
        f"a second call of shade launches kernels for {share:.0%} of the first one's work: it lives on what that one left",
    )
    yield _judged(
        not (first.shows(other) or first.shows(carried)),
        "another camera gives another picture, the number of the frame being the same",
        "another camera gives the same picture where the number of the frame is the same: it is kept by number",
    )
    stale = _Answer(cls(), scene, beside, updated_to=frames[0])
    yield _judged(
        stale.same(other),
        "what update makes serves every camera",
        "without a new update another camera gives a wrong answer: update does what depends on the eye",
    )
    renumbered = _Answer(cls(), scene, dataclasses.replace(frames[1], index=0))
    yield _judged(
        not (first.updated > 0 and renumbered.updated == 0),
        "update works again when things have moved, the number of the frame being the same",
        "update launches nothing when things have moved and the number of the frame is the same: it is kept by number",
    )


def _busy() -> float:
    """Cores that this process keeps busy, though nothing was asked of it and the device is done."""
    import drjit as dr

    dr.sync_thread()
    wall, cpu = time.perf_counter(), time.process_time()
    time.sleep(PAUSE_S)
    return (time.process_time() - cpu) / (time.perf_counter() - wall)


def _done(busy: float, threads: int) -> Iterator[Finding]:
    """That nothing goes on once the verbs have returned: `busy` cores more than before, and so many threads more."""
    yield _judged(
        busy <= BUSY,
        "nothing works on after shade has returned",
        f"after shade has returned, {busy:.1f} cores work on: the clock is stopped before the work is done",
    )
    if threads > 0:
        yield Finding("warn", f"{threads} threads of its own are there after shade has returned")


def tiny_scene() -> Scene:
    """A mirror ball in a coloured box, radiance given: smooth and different in every direction. Two frames."""
    import trimesh

    def lit(mesh: Any, inward: bool = False) -> Mesh:
        faces = mesh.faces[:, ::-1] if inward else mesh.faces
        made = subdivided(Mesh(mesh.vertices, faces), 0.8)
        return dataclasses.replace(made, radiance=0.5 + 0.2 * np.sin(1.3 * made.vertices + [0.0, 1.0, 2.0]))

    def shift(time: float) -> np.ndarray:
        pose = np.eye(4)
        pose[:3, 3] = [1.2, -0.8 + 5.0 * time, 0.3]
        return pose

    ball = trimesh.creation.icosphere(subdivisions=3, radius=0.6)
    mirror = Mesh(ball.vertices, ball.faces, ball.vertices / 0.6)
    return Scene(
        name="tiny",
        objects=(
            Object("box", lit(trimesh.creation.box((4, 4, 4)), inward=True), "surroundings on every side"),
            Object("ball", lit(trimesh.creation.icosphere(subdivisions=1, radius=0.25)), "something that moves", shift),
        ),
        reflectors=(Reflector("mirror", mirror, closed=mirror),),
        camera=lambda time: Camera((0.4 + 5.0 * time, -1.8, 0.3), (0.0, 0.0, 0.0), 50.0),
        frames=2,
    )


class _Answer:
    """One frame from a fresh state, updated to that frame or to another one.

    broken    why it cannot be looked at, or None
    wrote     the fields of the frame that changed while it was shaded, or updated to
    launched  kernels inside shade
    work      of shade and its answer, see `_watched`; `updated`: of update
    """

    def __init__(self, method: Method, scene: Scene, frame: Frame, updated_to: Frame | None = None) -> None:
        self._begin(method, scene)
        with self._guarded():
            prepared = method.prepare(scene)
            state, _, self.updated = self._watched(lambda own: method.update(prepared, own), updated_to or frame)
            self._shade(state, frame)

    def _begin(self, method: Method, scene: Scene) -> None:
        self.method, self.scene = method, scene
        self.broken: str | None = None
        self.wrote, self.launched, self.work, self.updated = "", 0, 0, 0

    def again(self, frame: Frame, cold: bool = False) -> _Answer:
        """The answer to a frame that follows, from the state that this one left; `cold`: from the state that it had."""
        other = object.__new__(_Answer)
        other._begin(self.method, self.scene)
        with other._guarded():
            other._shade(self.start if cold else self.state, frame)
        return other

    @contextlib.contextmanager
    def _guarded(self) -> Iterator[None]:
        from benchharness.measure import contract

        try:
            yield
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # a plugin may raise what is no Exception
            self.broken = contract.account(error)

    def _shade(self, state: Any, frame: Frame) -> None:
        from benchharness.measure import contract

        shaded, self.launched, self.work = self._watched(
            lambda own: self.method.shade(state, own), dataclasses.replace(frame, doubts=True)
        )
        reflection, self.state = contract.answer(shaded, frame, self.scene)
        self.start = state
        self._read(reflection, frame)

    def _watched(self, verb: Callable[[Frame], Any], frame: Frame) -> tuple[Any, int, int]:
        """What a verb makes of a frame that it is lent, evaluated; the kernels that it launched itself; and the work of all,
        lanes times operations. Notes what it wrote into the frame."""
        import drjit as dr

        from benchharness.measure import contract

        own, before = contract.lent(frame), contract.fingerprint(frame)
        dr.sync_thread()
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
            dr.kernel_history_clear()
            result = verb(own)
            inside = dr.kernel_history([dr.KernelType.JIT])
            dr.eval(result)
            dr.sync_thread()
            kernels = inside + dr.kernel_history([dr.KernelType.JIT])
        self.wrote = self.wrote or contract.written(before, own) or contract.written(before, frame)
        return result, len(inside), sum(kernel["size"] * kernel["operation_count"] for kernel in kernels)

    def _read(self, reflection: Reflection, frame: Frame) -> None:
        lanes = frame.view.width * frame.view.height
        self.active = np.array(frame.active)
        self.L = np.broadcast_to(np.array(reflection.L).T, (lanes, 3))
        self.distance = np.broadcast_to(np.array(reflection.distance), lanes)
        self.found = np.broadcast_to(np.array(reflection.found), lanes) & self.active

    def same(self, other: _Answer) -> bool:
        """Bit for bit, in the pixels where both see a reflector."""
        if self.broken or other.broken:
            return False
        both = self.active & other.active
        return all(
            getattr(self, name)[both].tobytes() == getattr(other, name)[both].tobytes() for name in ("L", "distance", "found")
        )

    def shows(self, other: _Answer) -> bool:
        """Whether the other's picture is this one, bit for bit, in the pixels where both see a reflector."""
        both = self.active & other.active if not (self.broken or other.broken) else np.zeros(1, bool)
        return bool(both.any()) and self.L[both].tobytes() == other.L[both].tobytes()

    def mean(self) -> np.ndarray:
        return self.L[self.found].mean(axis=0)


def _documented(cls: type) -> Iterator[Finding]:
    """The paper, the module's account, and every parameter by name."""
    module = inspect.getmodule(cls)
    said = f"{module.__doc__ or ''}\n{cls.__doc__ if '__doc__' in vars(cls) else ''}"
    paper = getattr(cls, "paper", "")
    yield _judged(bool(paper), f"paper: {paper}", 'it names no paper; accepted: paper: ClassVar[str] = "..."')
    yield _judged(bool(module.__doc__), "the module says what it does", "the module has no docstring", "warn")
    silent = [name for name in params.of_method(cls) if not re.search(rf"\b{re.escape(name)}\b", said)]
    yield _judged(
        not silent, "every parameter is documented", f"no docstring tells of the parameters {', '.join(silent)}", "warn"
    )


def _well_formed(answer: _Answer, frame: Frame) -> Iterator[Finding]:
    """Lanes, types, finite numbers and the found mask."""
    size = f"{frame.view.width} x {frame.view.height}"
    yield _judged(answer.broken is None, f"it answers {size}, in the right lanes", f"{size}: {answer.broken}")
    if answer.broken:
        return
    L, found = answer.L[answer.active], answer.found[answer.active]
    bad = int((~np.isfinite(L) | (L < 0)).any(axis=1).sum())
    yield _judged(bad == 0, "radiance is finite", f"radiance is negative or not finite in {bad} of {len(L)} pixels")
    distance = answer.distance[answer.found]
    bad = int((np.isnan(distance) | (distance <= 0)).sum())
    yield _judged(bad == 0, "distance is positive", f"distance is NaN or not positive in {bad} pixels that are found")
    share = float(found.mean())
    level = "fail" if share == 0 else "warn"
    yield _judged(share > 0.9, f"found: {share:.0%} of the pixels", f"found: {share:.0%} of the pixels", level)


def _judged(holds: bool, good: str, bad: str, level: str = "fail") -> Finding:
    return Finding("pass", good) if holds else Finding(level, bad)


def main(spec: str, parent: int) -> None:
    """In the child: one line of JSON per finding, and a last word."""
    say = processes.channel()
    processes.end_with_parent(parent)
    platform.use_variant("llvm_ad_rgb")
    try:
        plugin = plugins.from_path("method", spec, Path.cwd(), "check-method")
    except ValueError as error:
        say({"level": "fail", "text": str(error)})
    else:
        from benchharness.render.frame import FrameRenderer

        for finding in findings(plugin, FrameRenderer):
            say(dataclasses.asdict(finding))
    say({"all": True})


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
