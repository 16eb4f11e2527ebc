"""The folder of a run: who may fill it, what of it is on the disk while it is filled, and how it is taken up again.

run.json        the plan: what the rows depend on; a run is taken up only with the same
lock            locked by the process that fills the folder
journal.jsonl   a line per piece of work, on the disk before the next one is done
images/         pictures; the line of the work that made them has their names and checksums
"""

from __future__ import annotations

import errno
import hashlib
import json
import os
import re
import shutil
import tempfile
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any, NoReturn

from benchharness import platform
from benchharness.tables import files

RUNS = Path("results") / "runs"
PLAN, LOCK, JOURNAL, IMAGES = "run.json", "lock", "journal.jsonl", "images"

SEAL = re.compile(rb', "sum": "([0-9a-f]{8})"}$')
"""The end of a journal's line: the CRC-32 of this and all lines before it, without their ends."""


class Incomparable(Exception):
    """A run cannot be taken up, since something changed that its rows depend on. Exit code 4."""


def stamped(name: str) -> Path:
    """A new folder's path for a run of that name."""
    return RUNS / f"{name}-{datetime.now():%Y%m%d-%H%M%S}"


@contextmanager
def opened(name: str, out: Path | None, plan: dict[str, Any], *, resume: bool) -> Iterator[Path]:
    """A run's folder, which no other process fills in the meantime.

    name    of the study
    out     the folder; if None a new one under RUNS or, to resume, the newest one of that name there
    plan    what the rows depend on, for JSON

    Raises ValueError for a folder that cannot be used, Incomparable to resume what was another run.
    """
    folder = out or (_newest(name) if resume else stamped(name))
    try:
        if resume:
            _see_plan(folder)
        else:
            _see_unused(folder)
            folder.mkdir(parents=True, exist_ok=True)
        lock = platform.locked(folder / LOCK, lambda: _in_use(folder))
    except OSError as error:
        raise ValueError(f"--out {folder} cannot be written: {error.strerror}; accepted: a folder that can") from None
    with lock:
        if resume:
            _compare(folder, _see_plan(folder), plan)
            (folder / IMAGES).mkdir(exist_ok=True)
        else:
            _see_unused(folder)
            (folder / IMAGES).mkdir()
            files.write_atomic(folder / PLAN, json.dumps(plan, indent=2) + "\n")
        _clear(folder)
        try:
            yield folder
        finally:
            _clear(folder)


def _clear(folder: Path) -> None:
    """Removes pictures of work that a process had not done when it was killed."""
    for left in (folder / IMAGES).glob(".*"):
        shutil.rmtree(left, ignore_errors=True)


def _in_use(folder: Path) -> NoReturn:
    raise ValueError(f"--out {folder} is being filled by another process; accepted: another folder, or to wait for its end")


def _see_unused(folder: Path) -> None:
    """Raises ValueError for a folder that holds anything."""
    if not folder.exists():
        return
    if not folder.is_dir():
        raise OSError(errno.ENOTDIR, os.strerror(errno.ENOTDIR), str(folder))
    if (folder / PLAN).exists():
        raise ValueError(f"--out {folder} holds a run; accepted: an empty folder, or --resume to take that run up")
    if any(path.name != LOCK for path in folder.iterdir()):
        raise ValueError(f"--out {folder} is not empty and holds no run; accepted: an empty or a new folder")


def _newest(name: str) -> Path:
    earlier = sorted(path.parent for path in RUNS.glob(f"*-{'[0-9]' * 8}-{'[0-9]' * 6}/{PLAN}"))
    own = [path for path in earlier if path.name[: -len("-YYYYMMDD-HHMMSS")] == name]
    if not own:
        raise ValueError(f"--resume: there is no run of {name} in {RUNS}; accepted: --out with its folder")
    return own[-1]


def _see_plan(folder: Path) -> dict[str, Any]:
    """The plan of the run in a folder. Raises ValueError where there is none."""
    try:
        plan = json.loads((folder / PLAN).read_text(encoding="utf-8"))
        if not isinstance(plan, dict):
            raise ValueError(f"{PLAN} holds a {type(plan).__name__}")
    except (OSError, ValueError, RecursionError) as error:
        raise ValueError(f"--resume: {folder} holds no run ({error}); accepted: a run folder") from None
    return plan


def _compare(folder: Path, before: dict[str, Any], plan: dict[str, Any]) -> None:
    changed = [name for name in plan if json.dumps(before.get(name)) != json.dumps(plan[name])]
    if changed:
        details = "; ".join(f"{name}: {_difference(before.get(name), plan[name])}" for name in changed)
        raise Incomparable(f"--resume: the run in {folder} was another one ({details}); start a new run")


def _difference(before: Any, now: Any) -> str:
    """Which keys differ, or both values."""
    if isinstance(before, dict) and isinstance(now, dict):
        names = [name for name in {**before, **now} if before.get(name) != now.get(name)]
        return ", ".join(f"{name!r} changed, is new or is gone" for name in names) or "another order"
    return f"{before} -> {now}"


class Journal:
    """Lines of JSON, each on the disk when `append` returns. A last line that a crash cut short is cut away.

    Each line is sealed with a checksum of itself and all lines before it, so that none can change, go or come in between.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._known = 0, 0  # size of the file, and the checksum of all its lines
        if path.exists():
            os.truncate(path, path.read_bytes().rfind(b"\n") + 1)

    def lines(self) -> list[dict]:
        """All lines. Raises ValueError for one that is damaged."""
        found, checksum = [], 0
        data = self.path.read_bytes() if self.path.exists() else b""
        for number, line in enumerate(data.split(b"\n")[:-1], 1):
            text, seal = _unsealed(line)
            checksum = zlib.crc32(text, checksum)
            try:
                said = json.loads(text)
            except (ValueError, RecursionError) as error:
                self.refuse(number, str(error))
            if not isinstance(said, dict):
                self.refuse(number, f"it is a {type(said).__name__}")
            if seal is not None and seal != checksum:
                self.refuse(number, "it, or a line before it, is not what was written")
            found.append(said)
        self._known = len(data), checksum
        return found

    def refuse(self, number: int, reason: str) -> NoReturn:
        """Raises ValueError: a line, counted from 1, is not what a run writes."""
        raise ValueError(f"{self.path}: line {number} is damaged ({reason}); accepted: a new run") from None

    def append(self, line: Mapping[str, Any]) -> None:
        if self.path.exists() and self.path.stat().st_size != self._known[0]:
            self.lines()
        text = json.dumps(line).encode()
        checksum = zlib.crc32(text, self._known[1])
        data = text[:-1] + f', "sum": "{checksum:08x}"}}\n'.encode()
        with open(self.path, "ab") as stream:
            stream.write(data)
            stream.flush()
            os.fsync(stream.fileno())
        self._known = self._known[0] + len(data), checksum


def _unsealed(line: bytes) -> tuple[bytes, int | None]:
    """What was appended, and its checksum; None for a line that has none."""
    seal = SEAL.search(line)
    return (line, None) if seal is None else (line[: seal.start()] + b"}", int(seal[1], 16))


@dataclass(frozen=True)
class Pictures:
    """Pictures of one piece of work, in a folder of their own until it is done."""

    images: Path
    folder: Path

    def keep(self) -> dict[str, str]:
        """Moves them among the others. Returns checksums by name."""
        found = {path.name: checksum(path) for path in sorted(self.folder.iterdir())}
        for name in found:
            os.replace(self.folder / name, self.images / name)
        return found


@contextmanager
def pictures(images: Path) -> Iterator[Pictures]:
    """A folder for the pictures of one piece of work. What is not kept is gone at the end."""
    with tempfile.TemporaryDirectory(dir=images, prefix=".") as folder:
        yield Pictures(images, Path(folder))


def checksum(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()[:16]


def lost(images: Path, known: Mapping[str, str]) -> list[str]:
    """The pictures, of those with their checksums, that are gone or no longer what they were."""
    return [name for name, value in known.items() if not (images / name).is_file() or checksum(images / name) != value]
