"""The stability suite: where methods fail, whether they say so, and whether they come back.

    benchharness stability [CONFIG] [--study NAME] [--only METHOD] [--regime NAME] [--severity X] [--scene NAME] ...

Three studies, each with its tables in the run's folder, in processes of their own (`children`):

    atlas          stability.csv: every method in every regime of `scenes.stress`, from mild to severe
    motion         motion.csv, motion-frames.csv: animations at a fine step, cuts and jumps
    perturbation   perturbation.csv: scenes that change as good as not at all

and what was seen in images/; `report.matrix` makes one page of it. The folder is one as `execution.folder` has it: a
suite that was interrupted can be taken up.
"""

from __future__ import annotations

import importlib
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import BaseModel, TypeAdapter, ValidationError

from benchharness import cache, platform
from benchharness.execution import folder
from benchharness.exits import Exit
from benchharness.render import making
from benchharness.study import shipped
from benchharness.tables import columns, files, naming, origin

if TYPE_CHECKING:
    from benchharness.stability.children import Done, Place
    from benchharness.stability.plan import Plan

Groups = dict[str, dict[str, list[dict[str, Any]]]]
"""Units by study and group."""


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


@dataclass(frozen=True)
class Outcome:
    """`code`: the exit code, as `runner.exit_code` has it. `silent`: how many rows fail silently."""

    code: Exit
    silent: int
    folder: Path


def run(
    out: Path | None,
    config: Path | None = None,
    wanted: Wanted = Wanted(),
    tell: Callable[[str], None] = print,
    *,
    resume: bool = False,
    yes: bool = False,
) -> Outcome:
    """Runs the suite, or the rest of it.

    out  the run's folder; a new one under results/runs/ if None, or, to resume, the newest one there
    yes  begin, however long it may take

    Raises ValueError for an unknown method, study, regime, severity or scene, for a folder that cannot be used and, unless
    `yes`, for what takes too long; folder.Incomparable where the folder's run was another.
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
    depends = _depends(planned, groups)
    if not resume:
        _agree(groups, {}, tell, yes=yes)
    with folder.opened("stability", out, depends, resume=resume) as place:
        journal, images = folder.Journal(place / folder.JOURNAL), place / folder.IMAGES
        done = _taken_up(groups, journal, images, tell)
        if resume:
            _agree(groups, done, tell, yes=yes)
        made = [_Study(name, place, groups[name]) for name in planned.studies]
        _add(made, done.values(), tell)
        works = [children.Work(study.name, study.groups, study.module.APIECE) for study in made]
        for each in children.run(works, images, done=done, hears=making.Teller(tell, making.SELDOM_S, keys=())):
            study, group, number = each.place
            line = {"study": study, "group": group, "unit": number, "record": each.record, "pictures": each.pictures}
            journal.append(line)
            _add(made, [each], tell)
        return _ended(made, place)


def _ended(made: Sequence[_Study], place: Path) -> Outcome:
    from benchharness.execution import runner

    rows = [row for study in made for row in study.rows]
    asked = sum(len(units) for study in made for units in study.groups.values())
    silent = sum(row.get("verdict") == "fails" for row in rows)
    return Outcome(runner.exit_code([row["status"] for row in rows], asked), silent, place)


def _depends(planned: Plan, groups: Groups) -> dict[str, Any]:
    """What the rows depend on: the work, the methods, the sources of the scenes, and the machine."""
    from benchharness.stability import children

    environment = origin.environment(children.VARIANT)
    scenes = importlib.import_module(shipped.package("scenes"))
    files = [file for root in scenes.__path__ for file in sorted(Path(root).rglob("*.py"))]
    files += [file for name in groups.get("motion", {}) if (file := Path(name.partition(":")[0])).suffix == ".py"]
    return {
        "work": {f"{study} {group}": naming.short_hash(units) for study in groups for group, units in groups[study].items()},
        "methods": {entry.key: entry.method_hash for entry in planned.entries},
        "scenes": cache.source_hash(*map(str, files)),
        "environment": origin.environment_hash(environment),
    }


def _agree(groups: Groups, done: Mapping[Place, Done], tell: Callable[[str], None], *, yes: bool) -> None:
    """Says what is left to do, and about how long it takes; see `estimate.agreed`."""
    from benchharness.execution import estimate

    left = {study: sum(len(units) for units in groups[study].values()) for study in groups}
    for study, _, _ in done:
        left[study] -= 1
    seconds = estimate.SCENE_S + sum(count * _module(study).UNIT_S for study, count in left.items())
    what = ", ".join(f"{count} of {study}" for study, count in left.items())
    estimate.agreed(f"{sum(left.values())} rows ({what})", seconds, tell, yes=yes)


class _Line(BaseModel):
    """A line of the journal: what came of a unit."""

    study: str
    group: str
    unit: int
    record: dict[str, Any]
    pictures: dict[str, str]


_LINE = TypeAdapter(_Line)


def _taken_up(groups: Groups, journal: folder.Journal, images: Path, tell: Callable[[str], None]) -> dict[Place, Done]:
    """What the journal has, but for units whose pictures are not what they were. Raises ValueError for a damaged line."""
    from benchharness.stability.children import Done

    found: dict[Place, Done] = {}
    for number, line in enumerate(journal.lines(), 1):
        try:
            said = _LINE.validate_python(line, strict=True)
        except ValidationError as error:
            journal.refuse(number, f"{'.'.join(map(str, error.errors()[0]['loc']))}: {error.errors()[0]['msg']}")
        units = groups.get(said.study, {}).get(said.group, [])
        if not 0 <= said.unit < len(units) or said.record.get("status") not in columns.STATUSES:
            journal.refuse(number, "it is of no unit of this run")
        place = (said.study, said.group, said.unit)
        found[place] = Done(place, units[said.unit], said.record, said.pictures)
    lost = {place: folder.lost(images, done.pictures) for place, done in found.items()}
    for (study, group, _), names in lost.items():
        if names:
            tell(f"{study}: {group}: a row is made again, since pictures are gone or changed: {', '.join(names)}")
    return {place: done for place, done in found.items() if not lost[place]}


def _add(made: Sequence[_Study], done: Iterable[Done], tell: Callable[[str], None]) -> None:
    """Hands on what is done, and tells of every group that is complete by it."""
    studies = {study.name: study for study in made}
    for each in done:
        name, group, _ = each.place
        said = studies[name].add(each)
        if said is not None:
            tell(f"{name}: {group}: {said}")


def _module(study: str) -> Any:
    return importlib.import_module(f"benchharness.stability.{study}")


def _units(study: str, planned: Plan, wanted: Wanted) -> dict[str, list[dict[str, Any]]]:
    """What a study has to do, in groups."""
    from benchharness.stability import atlas, motion, perturbation, plan

    if study == "atlas":
        names = plan.chosen(planned.atlas.regimes, list(atlas.regimes()), "[atlas].regimes: regime")
        return atlas.units(planned.entries, plan.chosen(wanted.regimes, names, "--regime: regime"), wanted.severity)
    if study == "motion":
        return motion.units(planned.entries, replace(planned.motion, scenes=tuple(wanted.scenes) or planned.motion.scenes))
    return perturbation.units(planned.entries, wanted.scenes or planned.perturbation.scenes)


class _Study:
    """Rows of a study by the places of their units, and its tables, which are written whenever a group is complete."""

    def __init__(self, name: str, place: Path, groups: Mapping[str, list[dict[str, Any]]]) -> None:
        self.name, self.place, self.groups, self.module = name, place, groups, _module(name)
        self.made: dict[Place, dict[str, Any]] = {}
        self.frames: dict[Place, list[dict[str, Any]]] = {}

    def add(self, done: Done) -> str | None:
        """Takes what came of a unit. Returns what became of its group, "3 holds, 1 fails", when that is complete."""
        self.made[done.place] = self.module.row(done.unit, done.record)
        if hasattr(self.module, "frame_rows"):
            self.frames[done.place] = self.module.frame_rows(done.unit, done.record)
        group = [(self.name, done.place[1], number) for number in range(len(self.groups[done.place[1]]))]
        if not all(place in self.made for place in group):
            return None
        self.write()
        what = "verdict" if "verdict" in self.module.COLUMNS else "status"
        seen = Counter(self.made[place][what] for place in group)
        order = columns.VERDICTS if what == "verdict" else columns.STATUSES
        return ", ".join(f"{seen[v]} {v}" for v in order if v in seen)

    @property
    def rows(self) -> list[dict[str, Any]]:
        """The rows of the units that are done, in the order of the plan."""
        return [self.made[place] for place in self._places()]

    def _places(self) -> list[Place]:
        places = [(self.name, group, number) for group, units in self.groups.items() for number in range(len(units))]
        return [place for place in places if place in self.made]

    def write(self) -> None:
        files.write(self.place / self.module.FILE, self.rows, self.module.COLUMNS)
        if self.frames:
            rows = [row for place in self._places() for row in self.frames[place]]
            files.write(self.place / self.module.FRAMES_FILE, rows, self.module.FRAME_COLUMNS)
