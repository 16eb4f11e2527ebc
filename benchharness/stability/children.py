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
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

from benchharness import platform, processes

VARIANT = "llvm_ad_rgb"
TIMEOUT_S = 600.0  # that a unit may take, its share of what comes before the first included

Done = tuple[dict[str, Any], dict[str, Any]]


@dataclass(frozen=True)
class Work:
    """Of one study: its name, its units by group, and how many groups share a process."""

    study: str
    groups: Mapping[str, Sequence[dict[str, Any]]]
    apiece: int = 1


def run(
    works: Sequence[Work], folder: Path, workers: int | None = None, timeout_s: float = TIMEOUT_S
) -> Iterator[tuple[str, str, list[Done]]]:
    """(study, name of the group, [(unit, record)]), in order, as groups are done; `workers` processes at a time, as many as
    there are cores if None.

    A record that a unit could not give is {"status": "crashed" or "timeout", "reason": ...}.
    """
    cores = os.cpu_count() or 1
    workers = workers or cores
    threads = max(1, cores // workers)  # more of them only wait for each other: a quarter longer
    with ThreadPoolExecutor(workers) as pool:
        jobs = []
        for work in works:
            names = list(work.groups)
            for lot in (names[i : i + work.apiece] for i in range(0, len(names), work.apiece)):
                units = [unit for name in lot for unit in work.groups[name]]
                jobs.append((work, lot, pool.submit(_lot, work.study, units, folder, threads, timeout_s)))
        try:
            for work, lot, job in jobs:
                done = iter(job.result())
                for name in lot:
                    yield work.study, name, [next(done) for _ in work.groups[name]]
        finally:
            pool.shutdown(cancel_futures=True)  # whoever stops listening waits for what is running only


def _lot(study: str, units: list[dict[str, Any]], folder: Path, threads: int, timeout_s: float) -> list[Done]:
    done: list[Done] = []
    while len(done) < len(units):
        left = units[len(done) :]
        records, lost = _child(study, left, folder, threads, timeout_s)
        done += zip(left, records, strict=False)
        if lost is not None and len(done) < len(units):
            done.append((units[len(done)], lost))
    return done


def _child(study: str, units: list[dict], folder: Path, threads: int, timeout_s: float) -> tuple[list[dict], dict | None]:
    """The records of the first units, and what to say of the next one where the child did not do all."""
    job = {"study": study, "units": units, "folder": str(folder), "threads": threads, "parent": os.getpid()}
    with tempfile.TemporaryDirectory() as own:
        file, log = Path(own) / "job.json", Path(own) / "log"
        file.write_text(json.dumps(job), encoding="utf-8")
        with open(log, "wb") as stream:
            env = processes.surroundings() | {"OMP_NUM_THREADS": str(threads)}
            child = subprocess.Popen(
                [sys.executable, "-P", "-m", "benchharness.stability.children", str(file)], env=env,
                stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=stream, start_new_session=True,
            )  # fmt: skip
        assert child.stdin and child.stdout
        try:
            records, ended = _records(child.stdout, timeout_s)
            if len(records) == len(units):
                return records, None
            if not ended:
                return records, {"status": "timeout", "reason": f"no answer for {timeout_s:g} s"}
            reason = f"the process ended with {processes.cause(child.wait())}: {log.read_text(errors='replace').strip()[-200:]}"
            return records, {"status": "crashed", "reason": reason}
        finally:
            child.kill()
            child.wait()
            child.stdin.close()
            child.stdout.close()


def _records(stream: IO[bytes], timeout_s: float) -> tuple[list[dict], bool]:
    """The lines of a child, and whether it ended; False where it said nothing for too long."""
    lines: queue.SimpleQueue[bytes] = queue.SimpleQueue()

    def read() -> None:
        for line in stream:
            lines.put(line)
        lines.put(b"")

    reader = threading.Thread(target=read, daemon=True)
    reader.start()
    records = []
    while True:
        try:
            line = lines.get(timeout=timeout_s)
        except queue.Empty:
            return records, False
        if not line.endswith(b"\n"):  # the end, or half a line of a child that was killed
            reader.join()
            return records, True
        records.append(processes.clean(json.loads(line)))


def _work(file: str) -> None:
    say = processes.channel()
    job = json.loads(Path(file).read_text(encoding="utf-8"))
    processes.end_with_parent(job["parent"])
    platform.use_variant(VARIANT)
    import drjit as dr

    dr.set_thread_count(job["threads"])
    study = importlib.import_module(f"benchharness.stability.{job['study']}")
    for record in study.work(job["units"], Path(job["folder"])):
        say(record)


if __name__ == "__main__":
    _work(sys.argv[1])
