"""Work in processes of their own, so that what ends one costs its own unit only.

A *study* is a module of this package with

    work(units, folder)    generator of one record per unit, a dict that JSON holds, in order; pictures go into `folder`

and a unit is a dict that JSON holds. Units of one group follow each other in one process, so that they share what is dear to
make; several groups may share one, as starting costs as much as a dozen units of the atlas. A process that ends too early,
or says nothing for too long, costs the unit that it was at; another one goes on.
"""

from __future__ import annotations

import importlib
import json
import os
import queue
import sys
import tempfile
import threading
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from benchharness import platform, processes
from benchharness.execution import folder
from benchharness.render import making
from benchharness.render.making import Share

VARIANT = "llvm_ad_rgb"
TIMEOUT_S = 600.0  # that a unit may take, its share of what comes before the first included; and each part of light

Place = tuple[str, str, int]
"""Of a unit in a run: study, group, number in the group."""


@dataclass(frozen=True)
class Work:
    """What a study has to do: its name, its units by group, and how many groups share a process."""

    study: str
    groups: Mapping[str, Sequence[dict[str, Any]]]
    apiece: int = 1


@dataclass(frozen=True)
class Done:
    """What came of a unit; `pictures`: their checksums by name."""

    place: Place
    unit: dict[str, Any]
    record: dict[str, Any]
    pictures: dict[str, str] = field(default_factory=dict)


Tell = Callable[[Done | Share], None]
"""Hears what came of units, and how far light and references are."""


@dataclass
class _Brood:
    """The processes that run, so that whoever stops listening can end them, and have no further ones started."""

    lock: threading.Lock = field(default_factory=threading.Lock)
    alive: set[processes.Child] = field(default_factory=set)
    ended: bool = False

    def add(self, child: processes.Child) -> None:
        with self.lock:
            self.alive.add(child)
            if self.ended:
                child.kill()

    def remove(self, child: processes.Child) -> None:
        with self.lock:
            self.alive.discard(child)

    def end(self) -> None:
        with self.lock:
            self.ended = True
            for child in self.alive:
                child.kill()


def run(
    works: Sequence[Work],
    images: Path,
    workers: int | None = None,
    timeout_s: float = TIMEOUT_S,
    done: Collection[Place] = (),
    hears: Callable[[Share], None] = lambda share: None,
) -> Iterator[Done]:
    """What comes of all units but those that are done, as it comes; `workers` processes at a time, as many as there are cores
    if None. `hears` is told how far light and references are. Whoever stops listening ends them.

    A record that a unit could not give is {"status": "crashed" or "timeout", "reason": ...}.
    """
    cores = os.cpu_count() or 1
    workers = workers or cores
    threads = max(1, cores // workers)  # more of them only wait for each other: a quarter longer
    heard: queue.SimpleQueue[Done | Share | Future] = queue.SimpleQueue()
    brood = _Brood()
    with ThreadPoolExecutor(workers) as pool:
        lots = [lot for work in works for lot in _lots(work, done)]
        for lot in lots:
            pool.submit(_lot, lot, images, threads, timeout_s, heard.put, brood).add_done_callback(heard.put)
        try:
            left = len(lots)
            while left:
                said = heard.get()
                if isinstance(said, Done):
                    yield said
                elif isinstance(said, Share):
                    hears(said)
                else:
                    said.result()  # raises what went wrong there
                    left -= 1
        finally:
            brood.end()
            pool.shutdown(cancel_futures=True)


def _lots(work: Work, done: Collection[Place]) -> Iterator[list[tuple[Place, dict]]]:
    """What is left to do, by process."""
    names = list(work.groups)
    for some in (names[i : i + work.apiece] for i in range(0, len(names), work.apiece)):
        lot = [((work.study, name, number), unit) for name in some for number, unit in enumerate(work.groups[name])]
        lot = [(place, unit) for place, unit in lot if place not in done]
        if lot:
            yield lot


def _lot(lot: list[tuple[Place, dict]], images: Path, threads: int, timeout_s: float, tell: Tell, brood: _Brood) -> None:
    left = list(lot)
    while left and not brood.ended:
        lost = _child(left, images, threads, timeout_s, tell, brood)
        if lost is not None and left and not brood.ended:
            tell(Done(*left.pop(0), lost))


def _child(
    left: list[tuple[Place, dict]], images: Path, threads: int, timeout_s: float, tell: Tell, brood: _Brood
) -> dict | None:
    """Takes the units that one process did from those that are left. Returns what to say of the next one, None if none is."""
    study = left[0][0][0]
    units = [unit for _, unit in left]
    job = {"study": study, "units": units, "images": str(images), "threads": threads, "parent": os.getpid()}
    with tempfile.TemporaryDirectory() as own:
        file, log = Path(own) / "job.json", Path(own) / "log"
        file.write_text(json.dumps(job), encoding="utf-8")
        child = processes.Child("benchharness.stability.children", str(file), log=log, OMP_NUM_THREADS=str(threads))
        brood.add(child)
        try:
            while (said := child.next(timeout_s)) is not None:
                if "makes" in said:
                    tell(making.share_of(said["makes"]))
                else:
                    tell(Done(*left.pop(0), said["record"], said["pictures"]))
            if not left:
                return None
            return {"status": "crashed", "reason": f"the process ended with {child.cause()}: {child.words()}"}
        except TimeoutError:
            return {"status": "timeout", "reason": f"no answer for {timeout_s:g} s"}
        except ValueError as error:
            return {"status": "crashed", "reason": str(error)}
        finally:
            brood.remove(child)
            child.end()


def _work(file: str) -> None:
    say = processes.channel()
    job = json.loads(Path(file).read_text(encoding="utf-8"))
    processes.end_with_parent(job["parent"])
    platform.use_variant(VARIANT)
    import drjit as dr

    dr.set_thread_count(job["threads"])
    study = importlib.import_module(f"benchharness.stability.{job['study']}")
    makes = making.told(lambda share: say({"makes": asdict(share)}))
    with makes, folder.pictures(Path(job["images"])) as pictures:
        for record in study.work(job["units"], pictures.folder):
            say({"record": record, "pictures": pictures.keep()})


if __name__ == "__main__":
    _work(sys.argv[1])
