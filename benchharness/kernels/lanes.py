"""Trees of arrays, lane by lane: dataclasses of arrays, in which an array may hold several numbers for every lane."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import fields, is_dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

NONE = 0xFFFF_FFFF  # no lane


@functools.cache
def _names(kind: type) -> tuple[str, ...]:
    """The fields of a dataclass; none of another type."""
    return tuple(field.name for field in fields(kind)) if is_dataclass(kind) else ()


def joined(values: Sequence[Any]) -> Any:
    """The lanes of several trees of one type, one after the other; None stays."""
    first = values[0]
    if first is None:
        return None
    if names := _names(type(first)):
        return type(first)(**{name: joined([getattr(value, name) for value in values]) for name in names})
    kind = type(first)
    if dr.depth_v(kind) == 1:
        return dr.concat(list(values))
    return kind(*(dr.concat([value[k] for value in values]) for k in range(len(first))))


def gathered(values: Any, others: Any, index: mi.UInt32, count: int) -> Any:
    """Of a tree of `count` lanes, those with the numbers `index`; where it is NONE, the lane of `others`, which has as many as
    `index`. What is one number for all lanes stays."""
    if names := _names(type(values)):
        return type(values)(**{n: gathered(getattr(values, n), getattr(others, n), index, count) for n in names})
    kind, known, each = type(values), index != NONE, _each(values, count)
    if each == 0:
        return values
    if each == 1:
        return dr.select(known, dr.gather(kind, values, index, known), others)
    # As many lanes as there are numbers, and not `each` times as many: a recording would not know how many that are.
    wanted = dr.width(index)
    out, lane = dr.empty(kind, each * wanted), dr.arange(mi.UInt32, wanted)
    for k in range(each):
        own = dr.gather(kind, values, each * index + k, known)
        dr.scatter(out, dr.select(known, own, dr.gather(kind, others, each * lane + k)), each * lane + k)
    return out


def _each(values: Any, count: int) -> int:
    """How many numbers an array has for every one of `count` lanes; 0 for one that has the same for all."""
    return 0 if dr.width(values) == 1 and count > 1 else dr.width(values) // count


def roomy(values: Any, count: int, room: int) -> Any:
    """A tree of `count` lanes in buffers of `room` lanes, zeros after the last; None stays."""
    if values is None or room == count:
        return values
    if names := _names(type(values)):
        return type(values)(**{name: roomy(getattr(values, name), count, room) for name in names})
    kind = type(values)
    if dr.depth_v(kind) > 1:
        return kind(*(roomy(values[k], count, room) for k in range(len(values))))
    each = _each(values, count)
    return values if each == 0 else dr.concat([values, dr.zeros(kind, each * (room - count))])


def put(buffers: Any, values: Any, first: mi.UInt32, lane: mi.UInt32) -> None:
    """Puts a tree of values into one of buffers, from lane `first` on. `lane`: 0, 1, 2 .., as many as there are values."""
    if buffers is None:
        return
    if names := _names(type(buffers)):
        for name in names:
            put(getattr(buffers, name), getattr(values, name), first, lane)
        return
    kind = type(buffers)
    if dr.depth_v(kind) > 1:
        for k in range(len(buffers)):
            put(buffers[k], values[k], first, lane)
        return
    each = _each(values, dr.width(lane))
    packets = {mi.Float: mi.Vector4f, mi.UInt32: mi.Vector4u}.get(kind) if each == 4 else None
    if packets is not None:
        dr.scatter(buffers, dr.gather(packets, values, lane), first + lane)
        return
    for k in range(each):
        dr.scatter(buffers, values if each == 1 else dr.gather(kind, values, each * lane + k), each * (first + lane) + k)


def first(values: Any, count: int, wanted: int) -> Any:
    """The first `wanted` lanes of a tree of `count`; None stays."""
    if values is None:
        return None
    if names := _names(type(values)):
        return type(values)(**{name: first(getattr(values, name), count, wanted) for name in names})
    each = _each(values, count)
    return values if each == 0 else dr.gather(type(values), values, dr.arange(mi.UInt32, each * wanted))
