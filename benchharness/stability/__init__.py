"""The stability suite: where methods fail, whether they say so, and whether they come back.

    benchharness stability [CONFIG] [--study NAME] [--only METHOD] [--regime NAME] [--severity X] [--scene NAME] ...

Three studies, each with its tables in the run's folder, in processes of their own (`children`):

    atlas          stability.csv: every method in every regime of `scenes.stress`, from mild to severe
    motion         motion.csv, motion-frames.csv: animations at a fine step, cuts and jumps
    perturbation   perturbation.csv: scenes that change as good as not at all

and all of it on one page, stability.html, with what was seen in images/.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchharness import platform, results


@dataclass(frozen=True)
class Wanted:
    """What the command line leaves of a plan; empty for all.

    extra     methods to add, `file.py` or `file.py:Name`
    only      methods, by name or label
    studies   names
    regimes   of the atlas; with any, or a severity, there is no other study
    scenes    of the studies of motion and perturbation; with any, there is no atlas
    """

    extra: Sequence[str] = ()
    only: Sequence[str] = ()
    studies: Sequence[str] = ()
    regimes: Sequence[str] = ()
    severity: float | None = None
    scenes: Sequence[str] = ()


def run(
    out: Path, config: Path | None = None, wanted: Wanted = Wanted(), tell: Callable[[str], None] = print
) -> tuple[int, Path]:
    """Runs the suite. Returns how many rows of the atlas fail silently, and the page.

    Raises ValueError for an unknown method, study, regime, severity or scene, and for a folder that is in use.
    """
    from benchharness.stability import children, plan

    platform.use_variant(children.VARIANT)
    studies = list(wanted.studies)
    if not studies and (wanted.regimes or wanted.severity is not None):
        studies = ["atlas"]
    elif not studies and wanted.scenes:
        studies = ["motion", "perturbation"]
    planned = plan.load(config, wanted.extra, wanted.only, studies)
    groups = {name: _units(name, planned, wanted) for name in planned.studies}
    if out.exists() and any(out.glob("*.csv")):
        raise ValueError(f"{out} holds a run already; accepted: a new folder")
    images = out / "images"
    images.mkdir(parents=True, exist_ok=True)
    made = {name: _Study(name, out) for name in planned.studies}
    works = [children.Work(name, groups[name], made[name].module.APIECE) for name in planned.studies]
    for name, group, done in children.run(works, images):
        tell(f"{name}: {group}: {made[name].add(done)}")
    silent = sum(row.get("verdict") == "fails" for study in made.values() for row in study.rows)
    from benchharness.report import matrix

    return silent, matrix.write(out)


def _units(study: str, planned: Any, wanted: Wanted) -> dict[str, list[dict[str, Any]]]:
    """What a study has to do, in groups."""
    from benchharness.stability import atlas, motion, perturbation, plan

    if study == "atlas":
        names = plan.chosen(planned.atlas.regimes, list(atlas.regimes()), "[atlas].regimes: regime")
        return atlas.units(planned.entries, plan.chosen(wanted.regimes, names, "--regime: regime"), wanted.severity)
    if study == "motion":
        asked = planned.motion
        scenes = wanted.scenes or asked.scenes
        return motion.units(
            planned.entries, scenes, asked.kinds, asked.frames, asked.substeps, asked.start, asked.size, asked.followed,
            asked.places,
        )  # fmt: skip
    return perturbation.units(planned.entries, wanted.scenes or planned.perturbation.scenes)


class _Study:
    """Rows of a study, and its tables, which are written as it goes."""

    def __init__(self, name: str, out: Path) -> None:
        import importlib

        self.module, self.out = importlib.import_module(f"benchharness.stability.{name}"), out
        self.rows: list[dict[str, Any]] = []
        self.frames: list[dict[str, Any]] = []

    def add(self, done: list[tuple[dict[str, Any], dict[str, Any]]]) -> str:
        """Takes the (unit, record) of a group. Returns what became of it: "3 holds, 1 fails"."""
        from benchharness.stability import tables

        study = self.module
        fresh = [study.row(unit, record) for unit, record in done]
        self.rows += fresh
        tables.write(self.out / study.FILE, self.rows, study.COLUMNS)
        if hasattr(study, "frame_rows"):
            self.frames += [row for unit, record in done for row in study.frame_rows(unit, record)]
            tables.write(self.out / study.FRAMES_FILE, self.frames, study.FRAME_COLUMNS)
        what = "verdict" if "verdict" in study.COLUMNS else "status"
        seen = Counter(row[what] for row in fresh)
        order = results.VERDICTS if what == "verdict" else results.STATUSES
        return ", ".join(f"{seen[v]} {v}" for v in order if v in seen)
