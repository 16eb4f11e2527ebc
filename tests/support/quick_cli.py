"""The command line with runs that measure nothing and load no device: `run` writes the table of a study that never changes."""

from __future__ import annotations

import os
import sys
import types
from pathlib import Path

from benchharness.tables import results

RUNS = Path("results") / "runs"


def load(path: Path, extra: list[str], only: list[str], tell: object) -> Path:
    if not path.is_file():
        raise ValueError(f"{path}: there is no such config")
    return path


def run(study: Path, out: Path | None, listener: object, *, resume: bool, yes: bool, cluster: str | None) -> tuple[int, Path]:
    """Three frames of two methods, with the status that the environment asks for."""
    status = os.environ.get("QUICK_STATUS", "ok")
    folder = out or RUNS / study.stem
    about = {"run": folder.name, "config": study.stem, "scene": "place", "detail": "lean", "params": ""}
    about |= {"config_hash": "c", "scene_hash": "s", "environment": "e", "flip": 0.1, "shade_ms": 1.0}
    about |= {"status": status, "reason": None if status == "ok" else "out of luck"}
    rows = [{**about, "method": name, "method_hash": name, "frame": frame} for frame in range(3) for name in ("a", "b")]
    results.write_results(folder, rows)
    return 0, folder


def replaced(name: str, **content: object) -> None:
    """A module of the harness that has this content alone."""
    module = types.ModuleType(f"benchharness.{name}")
    vars(module).update(content)
    sys.modules[module.__name__] = module


def command(folder: Path) -> Path:
    """An executable of this in a folder, called as the real one is."""
    file = folder / "benchharness"
    tests = str(Path(__file__).parents[1])
    lines = (f"#!{sys.executable}", "import sys", f"sys.path.insert(0, {tests!r})", "from support import quick_cli")
    file.write_text("\n".join((*lines, "quick_cli.main(__file__)", "")))
    file.chmod(0o755)
    return file


def main(file: str) -> None:
    replaced("study.config", load=load, Job=object)
    replaced("study.plugins", absolute=lambda spec, base: str(base / spec))
    replaced("execution.runner", run=run)
    from benchharness import cli
    from benchharness.execution import rerun

    rerun.CLI = (file,)
    cli.main()
