"""`list`: what there is to run, with which parameters, and what is measured."""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import partial
from itertools import takewhile

from benchharness.study import plugins, shipped
from benchharness.study.apart import Apart
from benchharness.tables import columns


def installed(kind: str) -> Iterator[str]:
    """Every "method" or "scene": name and paper, or first line of docstring, and its parameters; or why it is broken."""
    with Apart() as apart:
        for name, site in plugins.sites(kind).items():
            try:
                said = apart.call("benchharness.study.loading:describe", name, kind=kind, name=name)
            except ValueError as error:
                yield f"{name}  BROKEN ({site.origin}): {str(error).removeprefix(f'{name}: ')}"
                continue
            if said is None:
                continue
            yield f"{name}  ({said['says']})" if kind == "method" else f"{name}  {said['says']}".rstrip()
            for parameter, default, accepted in said["parameters"]:
                yield f"  {parameter} {default}  ({accepted})"


def configs() -> Iterator[str]:
    """The names of the configs that there are, each with the first sentence of the comment that it begins with."""
    for name, path in shipped.configs().items():
        lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
        comment = " ".join(line.lstrip("# ") for line in takewhile(lambda line: line.startswith("#"), lines))
        sentence, *_ = re.split(r"(?<=\.)\s", comment, maxsplit=1)
        yield f"{name}  {sentence}".rstrip()


def metrics() -> Iterator[str]:
    """What the report shows: name, unit, which way is better, within what `compare` holds it for the same, and what it says."""
    for column in columns.metrics():
        about = [column.unit] * bool(column.unit) + [f"{column.better} is better"] * bool(column.better)
        about += [f"the same within {column.gate}"] * bool(column.gate)
        yield f"{column.name}  ({'; '.join(about)})  {column.says}" if about else f"{column.name}  {column.says}"


KINDS = {
    "methods": partial(installed, "method"),
    "scenes": partial(installed, "scene"),
    "configs": configs,
    "metrics": metrics,
}
