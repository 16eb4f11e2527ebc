"""What a run of the suite does: a TOML file, or everything there is.

    [atlas]          see `Atlas`
    [motion]         see `Motion`
    [perturbation]   see `Perturbation`
    [methods.NAME]   further settings of a method, as in a study; every installed method runs with its defaults anyway

Nothing has to be listed: a method or a regime that is there is run.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from benchharness.study import document, methods, params, plugins, run
from benchharness.study.apart import Apart
from benchharness.study.methods import Entry

STUDIES = ("atlas", "motion", "perturbation")
SECTIONS = (*STUDIES, "methods")
KINDS = ("steady", "cut", "teleport")

Pixels = Annotated[int, Field(ge=1, le=4096)]
Frames = Annotated[int, Field(ge=3, le=run.MOST_FRAMES)]


@dataclass(frozen=True)
class Atlas:
    """[atlas]. `regimes`: their names; all if empty."""

    regimes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Motion:
    """[motion].

    scenes    names of scenes, or `file.py:Name`; all if empty
    kinds     "steady", "cut", "teleport"
    frames    of a steady run
    substeps  frames per frame of the scene's own animation
    start     frame of that animation at which runs begin; where most moves if not given
    size      width, height in pixels
    followed  frames, from the first on, in which the images of objects are followed
    places    per pixel along each axis, at which their edges are sampled: odd
    """

    scenes: tuple[str, ...] = ()
    kinds: tuple[Literal["steady", "cut", "teleport"], ...] = KINDS
    frames: Frames = 12
    substeps: Annotated[int, Field(ge=1, le=1000)] = 4
    start: run.Index | None = None
    size: tuple[Pixels, Pixels] = (320, 228)
    followed: Frames = 8
    places: Literal[1, 3, 5, 7, 9] = 3


@dataclass(frozen=True)
class Perturbation:
    """[perturbation]. `scenes`: their names; all if empty."""

    scenes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Plan:
    """`entries`: methods with their parameters. `studies`: which of STUDIES are done."""

    entries: list[Entry]
    studies: list[str]
    atlas: Atlas
    motion: Motion
    perturbation: Perturbation


def setting(entry: Entry) -> str:
    """The parameters of an entry that are not the defaults: `multi=3`; empty for none."""
    return params.canonical(entry.set_by_hand)


def label(entry: Entry) -> str:
    """What an entry is called on the command line and on the page: its name and its setting."""
    return f"{entry.method} {setting(entry)}".strip()


def load(path: Path | None, extra: Sequence[str] = (), only: Sequence[str] = (), studies: Sequence[str] = ()) -> Plan:
    """The plan of a TOML file, or of everything there is.

    extra    methods to add: `file.py` or `file.py:Name`, relative to the working folder
    only     names or labels of the methods to keep; all if empty
    studies  those of STUDIES to keep; all if empty

    Raises ValueError for what is wrong in the file or in a name.
    """
    tables = {} if path is None else document.read(path, SECTIONS)
    kinds = {"atlas": Atlas, "motion": Motion, "perturbation": Perturbation}
    options = {name: params.options(kind, tables.get(name, {}), f"{path}: [{name}]") for name, kind in kinds.items()}
    with Apart() as apart:
        further = methods.entries(tables.get("methods", {}), path or Path(), apart)
        plugged_in = (methods.plugged_in(spec, apart) for spec in extra)
        entries = methods.distinct([*methods.installed(apart), *plugged_in, *further])
    labels = {label(entry): entry for entry in entries}
    for name in only:
        if name not in labels and name not in {entry.method for entry in entries}:
            raise ValueError(f"--only: method {plugins.unknown(name, list(labels))}")
    for name in studies:
        if name not in STUDIES:
            raise ValueError(f"--study: study {plugins.unknown(name, STUDIES)}")
    kept = [e for text, e in labels.items() if not only or text in only or e.method in only]
    return Plan(kept, [name for name in STUDIES if not studies or name in studies], **options)


def chosen(asked: Sequence[str], available: Sequence[str], what: str) -> list[str]:
    """Those that were asked for, all if none. Raises ValueError for one that there is not."""
    for name in asked:
        if name not in available:
            raise ValueError(f"{what} {plugins.unknown(name, available)}")
    return [name for name in available if not asked or name in asked]
