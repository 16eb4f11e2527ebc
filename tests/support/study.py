"""A study for tests of the harness itself: a scene, methods that misbehave, and a bench that measures nothing."""

from __future__ import annotations

import zlib
from pathlib import Path

from benchharness import platform
from benchharness.render import making

SCENE = """
import numpy as np
from benchharness.scene import Camera, Mesh, Object, Reflector, Scene

CORNERS = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]], float)
FACES = np.array([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]])

def place(detail: str = "lean", size: float = 1.0, frames: int = 5, height: float = 0.0) -> Scene:
    thing = Object("thing", Mesh(0.1 * CORNERS + 3, FACES), "something to see")
    mirror = Reflector("mirror", Mesh(size * CORNERS, FACES))
    camera = lambda time: Camera((0.0, -9.0, height + time), (0.0, 0.0, 0.0), 40.0)
    return Scene("place", (thing,), (mirror,), camera, frames, background=(1.0, 1.0, 1.0), detail=detail)
"""

METHOD = '''
"""`behaviour`, a word and a frame: what this method does there. `size` does nothing."""
import os, sys, time
from dataclasses import dataclass
from typing import ClassVar
from benchharness.api import Method

@dataclass(frozen=True)
class Actor(Method):
    paper: ClassVar[str] = "none"
    behaviour: str = "returns"
    size: int = 1

    def refuses(self, scene):
        if self.behaviour == "refuses": return "there is no room for it"
        if self.behaviour == "chokes": raise KeyError("refusing")
        return None

    def prepare(self, scene): return None

    def shade(self, state, frame):
        word, _, at = self.behaviour.partition(" ")
        if at in ("", str(frame)):
            if word == "aborts":
                print("LLVM ERROR: out of luck", file=sys.stderr, flush=True)
                os.abort()
            if word == "sleeps": time.sleep(600)
            if word == "leaves": os._exit(0)
            if word == "raises": raise RuntimeError("no such root")
        return None, state
'''


class Bench:
    """Numbers that follow from entry and frame alone; calls `shade` where the real one would."""

    def __init__(self, scene, size, reference, out, seed, rounds):
        self.out = out
        (out.parent / "benches").open("a").write("x")

    def prepare(self, index):
        pass

    def run_frame(self, index, methods, watch):
        records, samples = [], [{"entry": "", "clock": "gbuffer", "round": 0, "ms": 1.0}]
        for entry, method in methods.items():
            number = zlib.crc32(f"{entry} {index}".encode()) / 2**32
            record = {"entry": entry, "status": "ok", "reason": None, "shade_ms": 1.0, "flip": number}
            watch(entry)
            try:
                method.shade(None, index)
            except Exception as error:
                record = {"entry": entry, "status": "crashed", "reason": f"{type(error).__name__}: {error}"}
            watch("")
            records.append(record)
            samples.append({"entry": entry, "clock": "shade", "round": 0, "ms": 1.0})
        if self.out is not None:
            self.out.joinpath(f"{index}.png").touch()
        return records, samples


def machine() -> str:
    """Whether the machine's lock is "held" or "free"."""

    def busy():
        raise BlockingIOError

    try:
        with platform.locked(platform.see_machine_lock(), busy):
            return "free"
    except BlockingIOError:
        return "held"


class Telling(Bench):
    """Says how far it is with light and references."""

    def __init__(self, *arguments):
        super().__init__(*arguments)
        for done in range(4):
            making.tell(making.Share("light", done, 3, "[reference] bake_spp = 512"))

    def prepare(self, index):
        for done in (0, 2):
            making.tell(making.Share(f"reference {index}", done, 2))


class Watchful(Bench):
    """Notes when the machine's lock is held."""

    def __init__(self, scene, size, reference, out, *rest):
        super().__init__(scene, size, reference, out, *rest)
        self.file = out.parent / "held"
        self.note("begins")

    def note(self, what):
        with self.file.open("a") as file:
            file.write(f"{what} {machine()}\n")

    def prepare(self, index):
        self.note("prepares")

    def run_frame(self, *arguments):
        self.note("times")
        return super().run_frame(*arguments)


class Nothing(Bench):
    """Sees that no pixel is a number."""

    def run_frame(self, index, methods, watch):
        records, samples = super().run_frame(index, methods, watch)
        return [record | {"status": "invalid", "reason": "all pixels are NaN"} for record in records], samples


class Failing(Bench):
    """Cannot even prepare its scene."""

    def __init__(self, *arguments):
        raise RuntimeError("no light")


def write(folder: Path, behaviours: str, run: str = "") -> Path:
    """A config with one scene of 5 frames and the method `actor` with these behaviours, a TOML list."""
    (folder / "place.py").write_text(SCENE)
    (folder / "actor.py").write_text(METHOD)
    config = folder / "study.toml"
    config.write_text(
        f"[run]\nframes = 3\nsize = [32, 16]\n{run}\n"
        '[scenes.place]\nsource = "place.py"\n'
        f'[methods.actor]\nsource = "actor.py"\nbehaviour = {behaviours}\n'
    )
    return config
