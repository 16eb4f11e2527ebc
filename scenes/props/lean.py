"""What lean scenes leave out: objects that `benchharness needs` finds to be needed for nothing."""

from __future__ import annotations

from collections.abc import Collection, Iterable

from benchharness.scene import Object


def without(objects: Iterable[Object], names: Collection[str]) -> tuple[Object, ...]:
    """The objects but those of these names. Raises ValueError for a name that none has."""
    objects = list(objects)
    if unknown := set(names) - {thing.name for thing in objects}:
        raise ValueError(f"{', '.join(sorted(unknown))}: no object; accepted: {', '.join(thing.name for thing in objects)}")
    return tuple(thing for thing in objects if thing.name not in names)
