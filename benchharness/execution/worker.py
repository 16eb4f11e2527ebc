"""The process in which methods run: `python -m benchharness.execution.worker JOBFILE`, started by `supervisor`.

Dr.Jit and LLVM abort the process, they do not raise; so the process that keeps the results is another one. What this
one has to say are lines of JSON on the stdout it was given; its own stdout and stderr, native code's included, go to
the log. It ends when its parent does, however that ended.

Lines: {"event": "out", "entry", "status", "reason"}        the entry does not run in this job, and why
       {"event": "ready"}                                   the scene is prepared
       {"event": "start", "frame"}                          the clock of a frame starts
       {"event": "makes", "what", "done", "total", "cheaper"} how far light or a reference is, see `making.Share`
       {"event": "watch", "entry"}                          native code of this entry starts; "" when it ends
       {"event": "waits", "text"}                           another process is timing; the clock begins anew with "start"
       {"event": "frame", "frame", "records", "samples",    a frame is done; checksums of its pictures by name
        "pictures"}
       {"event": "failed", "reason", "machine"}             an exception that ends the work; machine: of files or devices
       {"event": "done"}                                    the last word; an end without it is none
"""

from __future__ import annotations

import faulthandler
import importlib
import json
import sys
import traceback
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, nullcontext
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from benchharness import platform, processes
from benchharness.execution import folder
from benchharness.render import making
from benchharness.study import plugins

if TYPE_CHECKING:
    from benchharness.api import Method


class Bench(Protocol):
    """What measures: `Bench(scene, size, reference, out, seed, rounds)`, one scene in one process.

    out        folder for the pictures of the next frame; None where none are kept. Set before every frame
    prepare    does what has to be done for a frame before anything is timed. Called before `run_frame`, of which there is only
               one at a time on a machine
    run_frame  (frame, entry -> method, watch) -> records with the measured columns and "entry", and samples with
               "entry" ("" for what belongs to no method), "clock", "round", "ms". Calls `watch(entry)` just before
               native code of an entry runs and `watch("")` after it. A method's exception is a record with status
               "crashed", after which the entry is out of this job. The numbers do not depend on which frames and
               entries ran before in this process, so that a run that was interrupted, or that lost a method, has the
               numbers of one that was not.
    """

    out: Path | None

    def prepare(self, index: int) -> None: ...

    def run_frame(
        self, index: int, methods: Mapping[str, Method], watch: Callable[[str], None]
    ) -> tuple[list[dict], list[dict]]: ...


def main(job_file: str) -> None:
    say = processes.channel()
    job = json.loads(Path(job_file).read_text(encoding="utf-8"))
    processes.end_with_parent(job["parent"])
    faulthandler.enable()
    try:
        _work(job, say)
    except BaseException as error:  # plugins raise what they like
        traceback.print_exc()
        say({"event": "failed", "reason": plugins.said(error), "machine": isinstance(error, OSError)})
    else:
        say({"event": "done"})


def _work(job: dict[str, Any], say: Callable[[dict], None]) -> None:
    platform.use_variant(job["variant"])
    from benchharness.measure import contract
    from benchharness.render.reference import ReferenceOptions
    from benchharness.study.methods import Entry
    from benchharness.study.scenes import SceneSpec

    def watch(entry: str) -> None:
        say({"event": "watch", "entry": entry})

    scene = SceneSpec(**job["scene"]).build()
    methods = {}
    for entry in (Entry(**values) for values in job["entries"]):
        watch(entry.key)
        method = contract.made(entry.build, scene)
        watch("")
        if isinstance(method, contract.Out):
            say({"event": "out", "entry": entry.key, **asdict(method)})
        else:
            methods[entry.key] = method
    if not methods:
        return

    module, _, name = job["bench"].partition(":")
    out = None if job["out"] is None else Path(job["out"])
    measures, options = getattr(importlib.import_module(module), name), ReferenceOptions(**job["reference"])
    with making.told(lambda share: say({"event": "makes", **asdict(share)})):
        bench: Bench = measures(scene, tuple(job["size"]), options, out, job["seed"], tuple(job["rounds"]))
        say({"event": "ready"})
        for frame in job["frames"]:
            say({"event": "start", "frame": frame})
            bench.prepare(frame)
            with nullcontext() if out is None or frame not in job["images"] else folder.pictures(out) as pictures:
                bench.out = None if pictures is None else pictures.folder
                with _alone(frame, say):
                    records, samples = bench.run_frame(frame, methods, watch)
                kept = {} if pictures is None else pictures.keep()
            assert [r["entry"] for r in records] == list(methods), "one record per entry, in their order"
            say({"event": "frame", "frame": frame, "records": records, "samples": samples, "pictures": kept})


@contextmanager
def _alone(frame: int, say: Callable[[dict], None]) -> Iterator[None]:
    """The machine's timing lock. The time that this process waits for it is not the frame's."""
    waited = False

    def wait(text: str) -> None:
        nonlocal waited
        waited = True
        say({"event": "waits", "text": text})

    with platform.alone(wait):
        if waited:
            say({"event": "start", "frame": frame})
        yield


if __name__ == "__main__":
    main(sys.argv[1])
