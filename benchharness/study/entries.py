"""Entries of a scene's table as they are written: mesh files and what is taken of them, where they are, what they look like."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

from benchharness.assets.asset import Asked

METRES = {"mm": 0.001, "cm": 0.01, "m": 1.0, "in": 0.0254, "ft": 0.3048}


def _metres(given: Any) -> Any:
    """A unit's metres, if it is given by its name."""
    if isinstance(given, str) and given not in METRES:
        raise ValueError(f"{', '.join(METRES)}, or a number of metres")
    return METRES[given] if isinstance(given, str) else given


def _listed(given: Any) -> Any:
    """One as a list of one."""
    return [given] if isinstance(given, str | dict) else given


Coordinate = Annotated[float, Field(ge=-1e9, le=1e9)]
Vector = tuple[Coordinate, Coordinate, Coordinate]
Share = Annotated[float, Field(ge=0, le=1)]
Positive = Annotated[float, Field(gt=0, le=1e9)]
Radiance = Annotated[float, Field(ge=0, le=1e9)]
Unit = Annotated[Positive, BeforeValidator(_metres)]
Names = Annotated[list[str], BeforeValidator(_listed), Field(min_length=1)]


class Table(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)


class Fit(Table):
    """centre of the box around a file, and the length of this box's longest side, in metres"""

    centre: Vector = (0.0, 0.0, 0.0)
    size: Positive


class Taken(Table):
    """Parts of a file: those at or below nodes of these names, of materials of these names, or both where both are said."""

    node: Names | None = None
    material: Names | None = None


class Place(Table):
    """Where a file is, after its format has said what is up in it: `fit`, or all but `rotate_deg` of the rest."""

    unit: Unit = 1.0
    scale: Positive = 1.0
    rotate_deg: Vector = (0.0, 0.0, 0.0)
    translate: Vector = (0.0, 0.0, 0.0)
    fit: Fit | None = None


class Key(Table):
    """Where a part is at a time: `translate` and `rotate_deg` as its entry has them, which holds for what a key does not say.
    Beside a `fit` it is `centre`, about which the part is turned, too."""

    time: Coordinate
    translate: Vector | None = None
    centre: Vector | None = None
    rotate_deg: Vector | None = None


class Placed(Place, Taken):
    """A file, what is taken of it, where that is, and how it moves.

    up         the axis that is up in it: None is y for glTF, and z for all others
    animation  of glTF, a name or number: it moves the file's nodes, within what keys move
    """

    name: str
    mesh: str
    up: Literal["y", "z"] | None = None
    without: Annotated[list[Taken], BeforeValidator(_listed)] = Field(default_factory=list)
    keys: Annotated[list[Key], Field(min_length=1)] | None = None
    animation: str | int | None = None

    def asked(self) -> Asked:
        """What its file is asked for."""
        return Asked(any(taken.node is not None for taken in (self, *self.without)), self.animation)


class ObjectTable(Placed):
    """albedo, emission: None is what the file has"""

    shows: str = ""
    albedo: tuple[Share, Share, Share] | None = None
    emission: tuple[Radiance, Radiance, Radiance] | None = None


class ReflectorTable(Placed):
    closed: str | None = None
    eta: tuple[Positive, Positive, Positive] | None = None
    k: tuple[Radiance, Radiance, Radiance] | None = None
    normal_map: str | None = None
