"""Runs of two installations in turns, as times have to be compared: A B, B A, A B ...

Both sides run the same command, each in its own folder: the new side here, with this installation; the base where it is
told to. What a machine does slowly (warm up, serve somebody else) hits both alike.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from benchharness import processes
from benchharness.exits import Exit
from benchharness.tables import results

BASE, NEW, WARM_UP = "base", "new", "warm-up"
USEFUL = (Exit.FINE, Exit.INCOMPLETE)
"""Exit codes of a run that has a table: a method that crashed is the comparison's to tell."""
CLI = ("-m", "benchharness")


class RunFailed(RuntimeError):
    """A run left no table; `code` is its exit code."""

    def __init__(self, code: int, text: str) -> None:
        super().__init__(text)
        self.code = code


@dataclass(frozen=True)
class Installation:
    """A way to run the harness: an interpreter, the folders that it imports from first, and the working folder."""

    python: str
    path: tuple[str, ...]
    folder: Path

    def environment(self) -> dict[str, str]:
        return processes.surroundings(self.path)

    def home(self) -> str:
        """The folder that its harness is imported from. Raises ValueError where there is none."""
        code = "import benchharness; print(benchharness.__path__[0])"
        done = subprocess.run(
            [self.python, "-P", "-c", code],
            cwd=self.folder,
            env=self.environment(),
            capture_output=True,
            text=True,
            check=False,
        )
        if done.returncode:
            said = (done.stderr.strip().splitlines() or ["no word"])[-1]
            raise ValueError(f"{self.python} cannot import benchharness ({said}); accepted: an environment that can")
        return done.stdout.strip()


def here() -> Installation:
    """This one."""
    return Installation(sys.executable, processes.search_path(), Path.cwd())


def installation(against: Path | None) -> Installation:
    """What `--against` names: a folder in which the command is run, a Python interpreter, or, if None, this installation.

    A folder with a checkout of the harness is imported from, by its own .venv if it has one. Raises ValueError for others.
    """
    this = here()
    if against is None:
        return this
    if against.is_dir():
        folder = against.resolve()
        if not (folder / "benchharness" / "cli.py").exists():
            return Installation(this.python, this.path, folder)
        own = folder / ".venv" / "bin" / "python"
        return Installation(str(own) if own.exists() else this.python, (str(folder),), folder)
    if against.is_file() and os.access(against, os.X_OK):
        return Installation(str(against.absolute()), (), Path.cwd())
    raise ValueError(f"--against {against} is neither a folder nor a Python interpreter; accepted: a checkout or a python")


def rerun(
    arguments: Sequence[str], times: int, against: Path | None, out: Path, say: Callable[[str], None], *, resume: bool = False
) -> tuple[Path, Path]:
    """Makes `times` runs of each side below `out`; returns the folders of the base's and of the new side's runs.

    arguments  of `benchharness run`: the config and options, but for --out
    resume     whether finished runs below `out` are kept, and an unfinished one is taken up

    A run before them on each side fills the caches, and is not compared. Raises ValueError for a folder in use, RunFailed where
    a run leaves no table.
    """
    if times < 1:
        raise ValueError(f"--times is {times}; accepted: at least 1")
    if out.exists() and not resume and any(out.iterdir()):
        raise ValueError(f"--out {out} is not empty; accepted: a new folder, or --resume")
    sides = {BASE: installation(against), NEW: here()}
    for name, side in sides.items():
        say(f"{name}: {side.home()}")
    for name, side in sides.items():
        run_once(side, arguments, out / WARM_UP / name, say)
    for number in range(times):
        for name in (BASE, NEW) if number % 2 == 0 else (NEW, BASE):
            run_once(sides[name], arguments, out / name / f"{number + 1:02d}", say)
    return out / BASE, out / NEW


def run_once(side: Installation, arguments: Sequence[str], out: Path, say: Callable[[str], None]) -> None:
    """One run, unless it is there already. Its output goes to a file beside the folder."""
    if (out / "results.csv").exists():
        return
    say(f"run {out}")
    out.parent.mkdir(parents=True, exist_ok=True)
    log = out.with_suffix(".log")
    command = [side.python, "-P", *CLI, "run", *arguments, "--out", str(out.absolute())]
    if (out / "run.json").exists():
        command.append("--resume")
    with open(log, "ab") as stream:
        done = subprocess.run(
            command, cwd=side.folder, env=side.environment(), stdout=stream, stderr=subprocess.STDOUT, check=False
        )
    if done.returncode not in USEFUL or not (out / "results.csv").exists():
        said = " | ".join(log.read_text(errors="replace").strip().splitlines()[-3:])
        raise RunFailed(done.returncode, f"{out}: the run ended with exit code {done.returncode}: {said} (see {log})")
    records = results.read_results(out)
    if not any(record["status"] == "ok" for record in records):
        said = records[0]["reason"] if records else "it has no rows"
        raise RunFailed(Exit.INCOMPLETE, f"{out}: nothing was measured: {said} (see {log})")
