"""What methods and scenes say about themselves, as plain data: called through `study.apart`, in a process of its own,
since it imports and builds them.

`where` is the place in the user's input, 'file: section'; `named` the one that names the plugin. Both are for messages.
"""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from benchharness import processes
from benchharness.study import identity, params, plugins

LONGEST = 2_000
"""Characters of the column `params` at most."""


def reference(table: Mapping[str, Any], where: str) -> dict[str, Any]:
    """The fields of `reference.ReferenceOptions`, out of a table. Raises ValueError for what is wrong in it."""
    from benchharness.render.reference import ReferenceOptions

    return asdict(params.options(ReferenceOptions, table, where))


def method(name: str, source: str | None, fields: Mapping[str, Any], where: str, named: str) -> dict[str, Any]:
    """Every combination of a table's values, tried: {"points": [{"params", "changed"}], "hash", "family"}; see `methods.Entry`.

    Raises ValueError for what is wrong with the method or in the table, and where the method refuses its parameters.
    """
    cls = plugins.given("method", name, source, named).target
    declared = _declared(params.of_method, cls, named)
    points = []
    for point in params.sweep(fields, declared, where):
        _check_text(point, where)
        try:
            cls(**{key: declared[key].value(value, f"{where}.{key}") for key, value in point.items()})
        except BaseException as error:  # plugins raise what they like
            raise ValueError(f"{where} {params.canonical(point)}: {_reason(error)}") from error
        changed = [key for key, value in point.items() if value != declared[key].default]
        points.append({"params": point, "changed": changed})
    try:
        return {"points": points, "hash": identity.of_method(cls), "family": str(cls.family)}
    except ValueError as error:
        raise ValueError(f"{named}: {error}") from None


def scene(name: str, source: str | None, fields: Mapping[str, Any], where: str, named: str) -> dict[str, Any]:
    """Every combination of a table's values, not built: {"points": [keywords], "labels": [name in the table]}."""
    declared = _declared(params.of_builder, plugins.given("scene", name, source, named).target, named)
    points = params.sweep(fields, declared, where)
    swept = [key for key in fields if key != "detail" and len({params.text(p[key]) for p in points}) > 1]
    labels = []
    for point in points:
        _check_text(point, where)
        labels.append(name + (f"[{params.canonical({key: point[key] for key in swept})}]" if swept else ""))
    return {"points": points, "labels": labels}


def describe(kind: str, name: str) -> dict[str, Any] | None:
    """What `list` shows of an installed plugin: {"says", "parameters": [[name, default, accepted]]}; None for a helper.

    Raises ValueError for one that does not load, or whose parameters cannot be read.
    """
    plugin = plugins.load(plugins.site(kind, name, kind))
    if plugin is None:
        return None
    if plugin.error is not None:
        raise ValueError(plugin.error)
    read = params.of_method if kind == "method" else params.of_builder
    rows = [[p.name, _default(p), p.accepted()] for p in read(plugin.target).values()]
    if kind == "method":
        return {"says": str(getattr(plugin.target, "paper", "no paper")), "parameters": rows}
    said = inspect.getdoc(plugin.target) or inspect.getdoc(inspect.getmodule(plugin.target)) or ""
    return {"says": said.partition("\n")[0], "parameters": rows}


def _default(parameter: params.Parameter) -> str:
    return "required" if parameter.default is params.Parameter.required else f"= {params.text(parameter.default)}"


def _declared(read: Any, target: Any, named: str) -> dict[str, params.Parameter]:
    try:
        return read(target)
    except ValueError as error:
        raise ValueError(f"{named}: {error}") from None


def _check_text(point: Mapping[str, Any], where: str) -> None:
    """Raises ValueError for parameters that no table takes: the text that names a row would not be what was asked for."""
    text = params.canonical(point)
    if len(text) > LONGEST:
        raise ValueError(f"{where}: the parameters are {len(text):,} characters long; accepted: at most {LONGEST:,}")
    if processes.clean(text) != text:
        raise ValueError(f"{where}: {text!r} holds control characters; accepted: plain text")


def _reason(error: BaseException) -> str:
    return str(error) if type(error) is ValueError else plugins.said(error)
