"""Parameters of methods and scenes: what a plugin declares, what a user gives, and every combination of a sweep.

A method's parameters are its dataclass fields, a scene's the keywords of its builder. Both are validated against their
annotations (pydantic, strict: `64` is an int and a float, `"64"` is neither, `1` is no bool). A list sweeps, unless the
annotation is itself a sequence and the list is one value of it.
"""

from __future__ import annotations

import dataclasses
import inspect
import itertools
import json
import math
import types
import typing
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any, Literal

from pydantic import PydanticUserError, TypeAdapter, ValidationError

from benchharness.study import plugins

MOST_POINTS = 4096
"""Combinations of one sweep: rows of an hour and more at every frame."""
SHOWN = 200
"""Characters of a wrong value that a message quotes at most."""
PLAIN = "a number, text, true, false, none, or a list of such"
"""What a parameter may be: what TOML and JSON can say."""


@dataclass(frozen=True)
class Parameter:
    """One declared parameter. `default` is `Parameter.required` where the user has to give a value."""

    name: str
    annotation: Any
    default: Any

    required: typing.ClassVar[Any] = inspect.Parameter.empty

    def accepted(self) -> str:
        """What a value may be, in words."""
        return describe(self.annotation)

    @cached_property
    def _adapter(self) -> TypeAdapter:
        return TypeAdapter(self.annotation)

    def value(self, given: Any, where: str) -> Any:
        """The validated value. Raises ValueError; `where` is 'file: key'."""
        try:
            return self._adapter.validate_json(_json(given, where), strict=True)
        except PydanticUserError as error:
            raise ValueError(f"{where}: {self.accepted()} is no type of a parameter ({error}); accepted: {PLAIN}") from None
        except ValidationError as error:
            raise ValueError(f"{where} is {_shown(given)}; accepted: {self.accepted()} ({error.errors()[0]['msg']})") from None

    def choices(self, given: Any, where: str) -> list[Any]:
        """The values that a table's entry sweeps over, in the order given, each once."""
        if not isinstance(given, list):
            return [self.value(given, where)]
        if _takes_sequence(self.annotation) and not (given and all(isinstance(item, list) for item in given)):
            return [self.value(given, where)]
        if not given:
            raise ValueError(f"{where} is an empty list; accepted: {self.accepted()}, or a list of such to sweep over")
        if len(given) > MOST_POINTS:
            raise ValueError(f"{where} has {len(given):,} values; accepted: at most {MOST_POINTS:,}")
        found: dict[str, Any] = {}
        for number, item in enumerate(given):
            value = self.value(item, f"{where}[{number}]")
            found.setdefault(text(value), value)
        return list(found.values())


def of_method(method: type) -> dict[str, Parameter]:
    """Name -> parameter of a method class, in the order of its fields. Raises ValueError as `of_builder` does."""
    hints = _hints(method)
    return {
        field.name: _declared(method, field.name, hints[field.name], _field_default(field))
        for field in dataclasses.fields(method)
        if field.init
    }


def of_builder(builder: Callable) -> dict[str, Parameter]:
    """Name -> parameter of a scene's builder, in its order.

    Raises ValueError for *args, **kwargs and bare names, for annotations that cannot be resolved, and for defaults that no
    config could hold.
    """
    hints = _hints(builder)
    found = {}
    for name, parameter in inspect.signature(builder).parameters.items():
        if parameter.kind not in (parameter.POSITIONAL_OR_KEYWORD, parameter.KEYWORD_ONLY) or name not in hints:
            raise ValueError(
                f"builder {builder.__name__}: parameter {name!r} has no annotation or no name of its own; "
                "accepted: annotated keywords"
            )
        found[name] = _declared(builder, name, hints[name], parameter.default)
    return found


def _hints(owner: Any) -> dict[str, Any]:
    try:
        return typing.get_type_hints(owner, include_extras=True)
    except Exception as error:  # annotations are code, which may raise anything
        raise ValueError(
            f"the annotations of {owner.__name__} cannot be read: {plugins.said(error)}; accepted: names that its module has"
        ) from None


def _declared(owner: Any, name: str, annotation: Any, default: Any) -> Parameter:
    if default is not Parameter.required:
        try:
            json.dumps(default)
        except (TypeError, ValueError, RecursionError) as error:
            given = f"{plugins.shown(default)} ({plugins.said(error)})"
            raise ValueError(f"{owner.__name__}: the default of {name!r} is {given}; accepted: {PLAIN}") from None
    return Parameter(name, annotation, default)


def options(kind: type, table: Mapping[str, Any], where: str) -> Any:
    """An instance of a dataclass of options out of a table's section. Raises ValueError as `sweep` does."""
    declared = of_method(kind)
    for key in table:
        if key not in declared:
            raise ValueError(f"{where}: key {plugins.unknown(key, declared)}")
    values = {key: declared[key].value(given, f"{where}.{key}") for key, given in table.items()}
    try:
        return kind(**values)
    except ValueError as error:
        raise ValueError(f"{where}: {error}") from None


def sweep(table: Mapping[str, Any], declared: Mapping[str, Parameter], where: str) -> list[dict[str, Any]]:
    """All combinations of a table's values, the first key slowest; each with every declared parameter in its order.

    Raises ValueError for unknown, missing and wrong values; `where` is 'file: section'.
    """
    for key in table:
        if key not in declared:
            raise ValueError(f"{where}: key {plugins.unknown(key, declared)}")
    for name, parameter in declared.items():
        if parameter.default is Parameter.required and name not in table:
            raise ValueError(f"{where}: key {name!r} is missing; accepted: {parameter.accepted()}")
    axes = [declared[key].choices(given, f"{where}.{key}") for key, given in table.items()]
    points = math.prod(len(axis) for axis in axes)
    if points > MOST_POINTS:
        raise ValueError(f"{where} sweeps over {points:,} combinations; accepted: at most {MOST_POINTS:,}")
    defaults = {name: parameter.default for name, parameter in declared.items()}
    return [
        {name: {**defaults, **dict(zip(table, point, strict=True))}[name] for name in declared}
        for point in itertools.product(*axes)
    ]


def check_plain(table: Mapping[str, Any], where: str) -> None:
    """Raises ValueError for a value that JSON cannot hold; `where` is 'file: section'."""
    for key, value in table.items():
        _json(value, f"{where}.{key}")


def canonical(params: Mapping[str, Any]) -> str:
    """The `name=value` list of the tables, in the order of the names: `mip=True; resolution=64`."""
    return "; ".join(f"{name}={text(params[name])}" for name in sorted(params))


def text(value: Any) -> str:
    """A value in the tables: Python's repr, text plain, tuples as lists, so that it survives a file of JSON."""
    return value if isinstance(value, str) else repr(json.loads(json.dumps(value)))


def describe(annotation: Any) -> str:
    """An annotation in words: `"sq" or "dot"`, `int, at least 1`, `true or false`."""
    origin, args = typing.get_origin(annotation), typing.get_args(annotation)
    if origin is Annotated:
        limits = [_limit(c) for meta in args[1:] for c in getattr(meta, "metadata", None) or [meta]]
        return ", ".join([describe(args[0]), *filter(None, limits)])
    if origin is Literal:
        return " or ".join(json.dumps(a) for a in args)
    if origin in (typing.Union, types.UnionType):
        return " or ".join(describe(a) for a in args if a is not type(None))
    if annotation is bool:
        return "true or false"
    if origin is tuple and ... not in args:
        return f"[{', '.join(describe(a) for a in args)}]"
    if origin is not None:
        return f"list of ({'), ('.join(describe(a) for a in args if a is not ...)})"
    return getattr(annotation, "__name__", str(annotation))


def _limit(constraint: Any) -> str:
    """An annotated-types constraint in words; empty for what says nothing about the value."""
    words = {"ge": "at least", "gt": "more than", "le": "at most", "lt": "less than", "multiple_of": "a multiple of"}
    return " and ".join(
        f"{word} {getattr(constraint, key)}" for key, word in words.items() if getattr(constraint, key, None) is not None
    )


def _takes_sequence(annotation: Any) -> bool:
    origin, args = typing.get_origin(annotation), typing.get_args(annotation)
    if origin is Annotated:
        return _takes_sequence(args[0])
    if origin in (typing.Union, types.UnionType):
        return any(_takes_sequence(a) for a in args)
    kind = origin or annotation
    return isinstance(kind, type) and issubclass(kind, Sequence | set | frozenset) and not issubclass(kind, str | bytes)


def _field_default(field: dataclasses.Field) -> Any:
    if field.default is not dataclasses.MISSING:
        return field.default
    return Parameter.required if field.default_factory is dataclasses.MISSING else field.default_factory()


def _json(given: Any, where: str) -> str:
    try:
        return json.dumps(given)
    except TypeError:
        raise ValueError(f"{where} is {given} (a TOML date or time); accepted: a number, text, true, false") from None
    except RecursionError:
        raise ValueError(f"{where} is nested too deeply; accepted: a number, text, true, false, or a list of such") from None


def _shown(given: Any) -> str:
    shown = json.dumps(given, default=str)
    return shown if len(shown) <= SHOWN else shown[:SHOWN] + " ..."
