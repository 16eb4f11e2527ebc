"""A bench that dies when it is told to, outside any method, and a disk that is full.

Beside the run's folder: `deaths` has one line `moment signal` per death, each of which happens once; while `poison` is
there, workers die of a method of that name; while `full` is there, pictures cannot be written.
"""

from __future__ import annotations

import os
import signal
import time
from contextlib import contextmanager
from pathlib import Path

from support import study

MOMENTS = ["prepare", "ready", "before 0", "method 0", "after 0", "pictures 2", "after 2", "method 4", "pictures 4", "after 4"]


class Bench(study.Bench):
    """`study.Bench`, mortal."""

    def __init__(self, scene, size, reference, out, seed, rounds):
        self.folder = out.parent.parent
        super().__init__(scene, size, reference, out, seed, rounds)
        self._reach("prepare")
        self.first = True

    def run_frame(self, index, methods, watch):
        if self.first:
            self._reach("ready")
        self.first = False
        self._reach(f"before {index}")
        if (self.folder / "poison").exists() and any("poison" in key for key in methods):
            os.kill(os.getpid(), signal.SIGSEGV)
        out, self.out = self.out, None
        with self._watched(index, next(iter(methods)), watch):
            records, samples = super().run_frame(index, methods, watch)
        self.out = out
        if out is not None:
            with open("/dev/full" if (self.folder / "full").exists() else out / f"{index}.png", "wb") as picture:
                picture.write(b"half")
                picture.flush()
                self._reach(f"pictures {index}")
                picture.write(b" and half")
        self._reach(f"after {index}")
        return records, samples

    @contextmanager
    def _watched(self, index, entry, watch):
        watch(entry)
        self._reach(f"method {index}")
        watch("")
        yield

    def _reach(self, moment: str) -> None:
        deaths = self.folder / "deaths"
        lines = deaths.read_text().splitlines() if deaths.exists() else []
        for line in lines:
            if line.rpartition(" ")[0] == moment:
                deaths.write_text("\n".join(other for other in lines if other != line))
                signal.signal(
                    signal.SIGINT, signal.default_int_handler
                )  # whoever starts us in the background may let it be ignored
                os.kill(os.getpid(), signal.Signals[line.rpartition(" ")[2]])
                time.sleep(60)


class Slow(Bench):
    """Takes a little while for everything, so that whoever kills meets it at work."""

    def __init__(self, *arguments):
        time.sleep(0.1)
        super().__init__(*arguments)

    def run_frame(self, index, methods, watch):
        for name in methods:
            watch(name)
            time.sleep(0.05)
            watch("")
        time.sleep(0.05)
        return super().run_frame(index, methods, watch)


def told(folder: Path) -> tuple[list[dict], dict[str, bytes]]:
    """What of a run's rows and pictures has to be the same however the run went."""
    from benchharness.tables import results

    rows = [{k: v for k, v in row.items() if k != "run"} for row in results.read_results(folder)]
    return rows, {path.name: path.read_bytes() for path in sorted((folder / "images").iterdir())}
