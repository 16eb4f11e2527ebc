"""The perturbation study: does a picture change more than the truth does, when the scene changes as good as not at all?

    camera    moved aside by a tenth of a pixel at its target
    rounding  every vertex moved by at most one float32, the mirror's too
    order     vertices and triangles numbered otherwise
    size      a picture with one more column on either side: the pixels that were there see along the same rays

*Change* is the mean |difference| of radiance in the mirrors' common pixels, in units of display white and cut off there. The
*amplification* is a method's change by the reference's. Where the reference does not change, as for `order` and `size`, a
method's change must be 0 but for rounding: a pixel whose centre lies on an edge may show either side. FLOOR is what that
is worth, and the least that the reference's change counts as.

A row of perturbation.csv is one scene, one kind of change, one method with its parameters.
"""

from __future__ import annotations

import itertools
import shlex
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchharness.scene import Scene
from benchharness.stability import altered, atlas, plan
from benchharness.study import plugins
from benchharness.study.methods import Entry
from benchharness.tables import naming

FILE = "perturbation.csv"
APIECE = 2  # groups that share a process
UNIT_S = 0.5  # about, on two cores
COLUMNS = (
    "scene severity kind size method setting params verdict why change reference_change amplification changed_px coverage "
    "converged_ratio reflector_px status reason command"
).split()
FLOOR = 5e-4  # of display white: one pixel in a thousand shows the other side of an edge, at half of full contrast
BOUND = 2.0  # a method that shows the truth up to sampling may add as much change of its own as the truth has
JND = 2.3  # CIELAB: a difference that is just noticed (Mahy, Van Eycken and Oosterlinck 1994)
SIZE = (160, 120)
ASIDE = 0.1  # pixels

SCENES: dict[str, float | None] = {
    "hidden": 0.25,
    "contact": 0.1,
    "concave": 0.35,
    "torus": 0.3,
    "layers": 0.05,
    "two_mirrors": 0.3,
    "comb": 12,
    "kitchen": None,
}
"""What is changed: regimes, one for each sort of mirror and of thing, with a severity; and a real scene, with None."""

KINDS: dict[str, tuple[str, Callable[[Scene], Scene], int]] = {
    "camera": (f"{ASIDE:g} px", lambda scene: altered.aside(scene, ASIDE, SIZE[1]), 0),
    "rounding": ("1 float", altered.rounded, 0),
    "order": ("all", lambda scene: altered.renumbered(scene)[0], 0),
    "size": ("1 column", lambda scene: scene, 1),
}
"""By name: how much, what is done to the scene, and how many columns the picture has more on either side."""


@dataclass(frozen=True)
class Subject:
    """A scene that is seen twice.

    frame      of its animation
    max_depth  of the reference
    """

    scene: Scene
    frame: int
    max_depth: int


def units(entries: Sequence[Entry], names: Sequence[str] = ()) -> dict[str, list[dict[str, Any]]]:
    """What is to be measured, by scene: those in `names`, all of SCENES if empty.

    Raises ValueError for a name that is not in SCENES.
    """
    for name in names:
        if name not in SCENES:
            raise ValueError(f"perturbation: scene {plugins.unknown(name, SCENES)}")
    return {
        name: [{"scene": name, "kind": kind, "entry": asdict(entry)} for kind in KINDS for entry in entries]
        for name in SCENES
        if not names or name in names
    }


def subject(name: str) -> Subject:
    """A scene of SCENES, lit. Raises ValueError where it is not installed."""
    severity = SCENES[name]
    if severity is not None:
        regime, build = atlas.regimes()[name]
        return Subject(replace(build(severity), name=f"{name}[{severity:g}]"), regime.frame, regime.max_depth)
    made = plugins.find("scene", name, "perturbation").target()
    from benchharness.render.bake import bake

    return Subject(bake(made), 0, 2)


def work(units: Sequence[dict[str, Any]], folder: Path) -> Iterator[dict[str, Any]]:
    """Measures units of one scene; see `benchharness.stability.children`. Pictures of what does not hold go to `folder`."""
    for name, of_scene in itertools.groupby(units, lambda unit: unit["scene"]):
        seen = subject(name)
        before, shown = _bench(seen, seen.scene, SIZE), {}
        for kind, group in itertools.groupby(of_scene, lambda unit: unit["kind"]):
            _, change, columns = KINDS[kind]
            after = _bench(seen, change(seen.scene), (SIZE[0] + 2 * columns, SIZE[1]))
            for entry in (Entry(**unit["entry"]) for unit in group):
                if entry.key not in shown:
                    shown[entry.key] = _shown(before, seen.frame, entry)
                record = _record(shown[entry.key], _shown(after, seen.frame, entry), columns, seen.scene.exposure)
                pictures = record.pop("pictures", None)
                if pictures is not None and verdict(record)[0] != "holds":
                    _keep_pictures(folder, name, kind, plan.label(entry), pictures, seen.scene.exposure)
                yield record


def verdict(record: Mapping[str, Any]) -> tuple[str, str]:
    """The verdict on one row, and what it rests on; see `benchharness.stability.atlas.verdict`.

    holds     the picture changes at most BOUND times as much as the reference, or as FLOOR where that changes less
    degrades  it changes more, and the method says that something is wrong
    fails     it changes more and the method is silent; or it ended, or answered what is no number
    refuses   the method said beforehand that it cannot
    """
    if record["status"] == "refused":
        return "refuses", record.get("reason") or ""
    if record["status"] != "ok":
        return "fails", record.get("reason") or record["status"]
    if record["change"] is None:
        return "holds", "no mirror in view"
    still = record["reference_change"] < FLOOR
    said = f"change {record['change']:.2g}, of the reference " + ("none" if still else f"{record['reference_change']:.2g}")
    if record["amplification"] <= BOUND:
        return "holds", said
    flags = [
        f"{column.partition('_')[0]} {record[column]:.3f}"
        for column in ("coverage", "converged_ratio")
        if record.get(column) is not None and record[column] < atlas.CERTAIN
    ]
    return ("degrades", ", ".join(flags)) if flags else ("fails", f"{said}, and silent")


def row(unit: Mapping[str, Any], record: Mapping[str, Any]) -> dict[str, Any]:
    """The row of `FILE`."""
    entry = Entry(**unit["entry"])
    severity = SCENES[unit["scene"]]
    judged, why = verdict(record)
    where = f"--study perturbation --scene {unit['scene']} "
    return {
        **{column: record.get(column) for column in COLUMNS},
        "scene": unit["scene"],
        "severity": severity,
        "kind": unit["kind"],
        "size": KINDS[unit["kind"]][0],
        "method": entry.method,
        "setting": plan.setting(entry),
        "params": entry.params_text,
        "verdict": judged,
        "why": why,
        "command": f"benchharness stability {where}--only {shlex.quote(plan.label(entry))}",
    }


def compared(one: Any, other: Any, columns: int, exposure: float) -> dict[str, Any]:
    """Changes from one `benchharness.regime.Seen` to another that has `columns` more on either side."""
    inner = slice(columns, other.mask.shape[1] - columns)
    mask = one.mask & other.mask[:, inner]
    if not mask.any():
        return dict.fromkeys(("change", "reference_change", "amplification", "changed_px"))
    pictures = [_white(x, exposure)[mask] for x in (one.image, other.image[:, inner], one.truth, other.truth[:, inner])]
    change, reference = (float(np.abs(pictures[k] - pictures[k + 1]).mean()) for k in (0, 2))
    noticed = [_lab_distance(pictures[k], pictures[k + 1]) > JND for k in (0, 2)]
    return {
        "change": change,
        "reference_change": reference,
        "amplification": change / max(reference, FLOOR),
        "changed_px": float((noticed[0] & ~noticed[1]).mean()),
        "reflector_px": int(mask.sum()),
    }


def _bench(seen: Subject, scene: Scene, size: tuple[int, int]) -> Any:
    from benchharness.measure.bench import Bench
    from benchharness.render.reference import ReferenceOptions

    return Bench(scene, size, ReferenceOptions(max_depth=seen.max_depth, spp=2), None, 0, (1, 1))


def _shown(bench: Any, frame: int, entry: Entry) -> tuple[dict[str, Any], Any]:
    """What a method shows, as `benchharness.measure.bench.Bench.show` has it; a refusal as a record."""
    from benchharness.measure import contract

    method = contract.made(entry.build, bench.scene)
    return (asdict(method), None) if isinstance(method, contract.Out) else bench.show(frame, entry.key, method)


def _record(one: tuple[dict, Any], other: tuple[dict, Any], columns: int, exposure: float) -> dict[str, Any]:
    """The record of a unit: the first of two that is not right, or the changes and the lower of what both say of themselves."""
    for record, _ in (one, other):
        if record["status"] != "ok":
            return {"status": record["status"], "reason": record.get("reason")}
    said = {
        name: min((r[name] for r, _ in (one, other) if r.get(name) is not None), default=None)
        for name in ("coverage", "converged_ratio")
    }
    changes = compared(one[1], other[1], columns, exposure)
    return {"status": "ok", **said, **changes, "pictures": (one[1], other[1], columns)}


def _white(image: np.ndarray, exposure: float) -> np.ndarray:
    """Radiance in units of display white, cut off there, float64."""
    return np.clip(image.astype(np.float64) * 2.0**exposure, 0, 1)


def _lab_distance(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Distance in CIELAB, [N], of linear colours [N, 3] in [0, 1]."""
    from skimage.color import rgb2lab

    from benchharness.measure.metrics import display

    return np.linalg.norm(rgb2lab(display(one, 0.0)) - rgb2lab(display(other, 0.0)), axis=-1)


def _keep_pictures(folder: Path, scene: str, kind: str, label: str, seen: tuple[Any, Any, int], exposure: float) -> None:
    """Before, after, and where a pixel changed, side by side; the reference below."""
    from benchharness.measure import metrics

    one, other, columns = seen
    inner = slice(columns, other.mask.shape[1] - columns)
    rows = []
    for a, b in ((one.image, other.image[:, inner]), (one.truth, other.truth[:, inner])):
        change = np.abs(_white(a, exposure) - _white(b, exposure)).mean(axis=2)
        rows.append([metrics.tonemap(a, exposure), metrics.tonemap(b, exposure), metrics.error_picture(change)])
    whole = np.concatenate([np.concatenate(pictures, axis=1) for pictures in rows])
    name = naming.picture_name(f"{scene}-{kind}", SCENES[scene] or 0.0, label)
    metrics.save_png(folder / name, whole)
