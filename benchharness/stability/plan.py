"""What a run of the suite does: a TOML file, or everything there is.

    [methods.NAME]   further settings of a method, as in a study; every installed method runs with its defaults anyway

Nothing has to be listed: a method, a regime or a scene that is there is run.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from benchharness import config, params, plugins
from benchharness.config import Entry

SECTIONS = ("methods",)


@dataclass(frozen=True)
class Plan:
    """
    entries   methods with their parameters
    regimes   names
    """

    entries: list[Entry]
    regimes: list[str]


def setting(entry: Entry) -> str:
    """The parameters of an entry that are not the defaults: `multi=3`; empty for none."""
    declared = params.of_method(entry.cls())
    return params.canonical({k: v for k, v in entry.params.items() if v != declared[k].default})


def label(entry: Entry) -> str:
    """What an entry is called on the command line and on the page: its name and its setting."""
    return f"{entry.method} {setting(entry)}".strip()


def load(path: Path | None, extra: Sequence[str], only: Sequence[str], regimes: Sequence[str]) -> Plan:
    """The plan of a TOML file, or of everything there is.

    extra    methods to add: `file.py` or `file.py:Name`, relative to the working folder
    only     names or labels of the methods to keep; all if empty
    regimes  names of the regimes to keep; all if empty

    Raises ValueError for what is wrong in the file or in a name.
    """
    from benchharness.stability import atlas

    document = {} if path is None else config.read(path, SECTIONS)
    further = config.entries(document.get("methods", {}), path or Path())
    entries = config.distinct([*config.installed(), *(config.plugged_in(spec) for spec in extra), *further])
    labels = {label(entry): entry for entry in entries}
    for name in only:
        if name not in labels and name not in {entry.method for entry in entries}:
            raise ValueError(f"--only: method {plugins.unknown(name, list(labels))}")
    kept = [e for text, e in labels.items() if not only or text in only or e.method in only]
    available = list(atlas.regimes())
    for name in regimes:
        if name not in available:
            raise ValueError(f"--regime: regime {plugins.unknown(name, available)}")
    return Plan(kept, [name for name in available if not regimes or name in regimes])
