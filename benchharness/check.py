"""`check-method`: does a method keep the contract of `benchharness.api`? A list of pass, warn and fail.

The method runs on a tiny scene (a mirror ball in a box, one ball that moves) in a child process, since a kernel that is
wrong may abort: `python -m benchharness.check FILE[:Name] PARENT` says one finding per line as JSON. Nothing here is timed;
what is checked is that a time would mean what it says: the answer depends on the frame, is not cached between frames or
instances, and nothing is evaluated inside `shade`.
"""

from __future__ import annotations

import dataclasses
import inspect
import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from benchharness import params, platform, plugins, processes
from benchharness.scene import Camera, Mesh, Object, Reflector, Scene, subdivided

if TYPE_CHECKING:
    from benchharness.api import Frame, Method, Reflection

SIZE = (96, 64)
TIMEOUT_S = 300.0

Renderer = Callable[[Scene, int, int], Any]
"""`frame.FrameRenderer` or its stand-in: (scene, width, height) -> something with render(index) -> api.Frame."""


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
            child = processes.start("benchharness.check", plugins.absolute(spec, Path.cwd()), str(os.getpid()), log=stream)
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
    cls = plugin.target
    yield from _documented(cls)
    try:
        method = cls()
    except Exception as error:
        yield Finding("fail", f"it cannot be made with its default parameters: {type(error).__name__}: {error}")
        return
    scene = tiny_scene()
    refusal = method.refuses(scene)
    if refusal is not None:
        yield Finding("warn", f"it refuses the test scene, so that nothing else can be checked: {refusal}")
        return
    before = dict(vars(method))
    frames = [renderer(scene, *SIZE).render(index) for index in range(2)]
    first = _Answer(method, scene, frames[0])
    yield from _well_formed(first, frames[0])
    if first.broken or not first.found.any():
        return
    beyond = int(np.isinf(first.distance[first.found]).sum())
    yield _judged(
        beyond == 0,
        "within walls, nothing is found at infinity",
        f"{beyond} pixels are found at infinity, and walls enclose the mirror (Scene.enclosed): no answer, found is False",
    )
    yield _judged(first.launched == 0, "nothing is evaluated inside shade", f"shade launches {first.launched} kernels", "warn")
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
    same = vars(method) == before and method == cls()
    yield _judged(same, "self is unchanged", "self changed while it ran: state is passed, not kept")
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
    """One frame from a fresh state. `broken` is why it cannot be looked at, or None."""

    def __init__(self, method: Method, scene: Scene, frame: Frame) -> None:
        import drjit as dr

        self.broken: str | None = None
        self.lanes = frame.view.width * frame.view.height
        frame = dataclasses.replace(frame, doubts=True)
        try:
            state = method.prepare(scene)
            state = method.update(state, frame)
            dr.eval(state)
            dr.sync_thread()
            dr.kernel_history_clear()
            with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
                reflection, state = method.shade(state, frame)
                self.launched = len(dr.kernel_history([dr.KernelType.JIT]))
            dr.eval(reflection.L, reflection.distance, reflection.found, reflection.doubt, reflection.counters, state)
            self._read(reflection, frame)
        except Exception as error:
            self.broken = f"{type(error).__name__}: {error}"

    def _read(self, reflection: Reflection, frame: Frame) -> None:
        import drjit as dr
        import mitsuba as mi

        for name, kind in (("L", mi.Color3f), ("distance", mi.Float), ("found", mi.Bool)):
            value = getattr(reflection, name)
            if not isinstance(value, kind):
                raise TypeError(f"{name} is {type(value).__name__}; accepted: {kind.__name__}")
            if dr.width(value) != self.lanes:
                raise TypeError(f"{name} has {dr.width(value)} lanes; accepted: {self.lanes}, one per pixel")
        if reflection.doubt is not None:
            if not isinstance(reflection.doubt, mi.Bool):
                raise TypeError(f"doubt is {type(reflection.doubt).__name__}; accepted: Bool, or None")
            if dr.width(reflection.doubt) not in (1, self.lanes):
                lanes = dr.width(reflection.doubt)
                raise TypeError(f"doubt has {lanes} lanes; accepted: {self.lanes}, one per pixel, or one for all")
        self.active = np.array(frame.active)
        self.L = np.array(reflection.L).T
        self.distance = np.array(reflection.distance)
        self.found = np.array(reflection.found) & self.active

    def same(self, other: _Answer) -> bool:
        """Bit for bit, in the pixels where both see a reflector."""
        if self.broken or other.broken:
            return False
        both = self.active & other.active
        return all(
            getattr(self, name)[both].tobytes() == getattr(other, name)[both].tobytes() for name in ("L", "distance", "found")
        )

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
        from benchharness.frame import FrameRenderer

        for finding in findings(plugin, FrameRenderer):
            say(dataclasses.asdict(finding))
    say({"all": True})


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
