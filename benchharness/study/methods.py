"""[methods.NAME]: fields of the method, optional `source`; [[methods.NAME]] are several sweeps of one method.

Methods are asked in a process of their own (`benchharness.study.loading`, through `benchharness.study.apart`): an `Entry` is
what they said, as plain data.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchharness.study import document, params, plugins
from benchharness.study.apart import Apart

if TYPE_CHECKING:
    from benchharness.api import Method


@dataclass(frozen=True)
class Entry:
    """One method with one set of parameters: what a row of the table is about.

    method       the name in the table
    source       absolute `file.py` or `file.py:Name`; None for a discovered method
    params       every field of the method -> value
    changed      those of them that are not the defaults
    method_hash  of its source, see `identity.of_method`
    family       of what kind it is, "" if it does not say
    """

    method: str
    source: str | None
    params: dict[str, Any]
    changed: list[str] = field(default_factory=list)
    method_hash: str = ""
    family: str = ""

    @property
    def params_text(self) -> str:
        """The column `params`."""
        return params.canonical(self.params)

    @property
    def set_by_hand(self) -> dict[str, Any]:
        """What is not the default."""
        return {name: self.params[name] for name in self.changed}

    @property
    def key(self) -> str:
        """Method and parameters in one line; unique within a run."""
        return f"{self.method} {self.params_text}".strip()

    def build(self) -> Method:
        """The method, imported and built in this process. Raises ValueError where it cannot be, and what its own
        `__post_init__` raises."""
        cls = plugins.given("method", self.method, self.source, self.method).target
        declared = params.of_method(cls)
        return cls(**{name: declared[name].value(given, f"{self.method}.{name}") for name, given in self.params.items()})


def entries(section: Mapping[str, Any], path: Path, apart: Apart) -> Iterator[Entry]:
    """The entries of the tables [methods.NAME]. Raises ValueError for what is wrong in them."""
    for name, content in section.items():
        several = isinstance(content, list)
        for number, table in enumerate(content if several else [content]):
            where = f"{path}: [methods.{name}]" + (f"[{number}]" if several else "")
            if not isinstance(table, dict):
                raise ValueError(f"{where} is {table!r}; accepted: a table of the method's fields")
            source = document.source("method", name, table, path, where)
            fields = {key: value for key, value in table.items() if key != "source"}
            yield from _entries(name, source, fields, where, apart, where if source is None else f"{where}.source")


def plugged_in(spec: str, apart: Apart) -> Entry:
    """An entry for `--plugin`: named like its file, with default parameters."""
    name, source = plugins.name_of(spec), plugins.absolute(spec, Path.cwd())
    plugins.check_free("method", name, source, "--plugin")
    return next(_entries(name, source, {}, f"--plugin {spec}", apart, "--plugin"))


def installed(apart: Apart, tell: Callable[[str], None] = print) -> list[Entry]:
    """Every installed method that loads, with default parameters; `tell` hears of those that do not."""
    found = []
    for name in plugins.sites("method"):
        try:
            found += _entries(name, None, {}, name, apart, name)
        except ValueError as error:
            tell(f"left out: {error}")
    return found


def distinct(entries: Iterable[Entry]) -> list[Entry]:
    """The entries without repetitions. Raises ValueError if one name stands for two different files."""
    kept: dict[str, Entry] = {}
    sources: dict[str, str | None] = {}
    for entry in entries:
        if sources.setdefault(entry.method, entry.source) != entry.source:
            first = sources[entry.method] or "the discovered method"
            raise ValueError(
                f"method {entry.method!r} is given twice, by {first} and by {entry.source or 'its name'}; "
                "accepted: a name of its own for each: [methods.NAME] with `source`"
            )
        kept.setdefault(entry.key, entry)
    return list(kept.values())


def _entries(name: str, source: str | None, fields: Mapping[str, Any], where: str, apart: Apart, named: str) -> Iterator[Entry]:
    """One per combination of a table's values. `named` is the place that names the method."""
    if source is None:
        plugins.site("method", name, named)
    params.check_plain(fields, where)
    asked = {"name": name, "source": source, "fields": fields, "where": where, "named": named}
    said = apart.call("benchharness.study.loading:method", where, **asked)
    for point in said["points"]:
        yield Entry(name, source, point["params"], point["changed"], said["hash"], said["family"])
