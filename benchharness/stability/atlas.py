"""The failure atlas: every method in every regime, from mild to severe; what holds, what fails, and whether it says so.

A regime is a module of `scenes.stress` (`benchharness.regime`). A row of stability.csv is one regime at one severity with one
method and its parameters.
"""

from __future__ import annotations

import importlib
import itertools
import pkgutil
import shlex
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchharness.regime import MISSING, Regime, Seen
from benchharness.scene import Scene
from benchharness.stability import plan
from benchharness.study import shipped
from benchharness.study.methods import Entry
from benchharness.tables import naming

FILE = "stability.csv"
APIECE = 4  # groups that share a process
UNIT_S = 0.25  # about, on two cores
COLUMNS = (
    "regime title entry severity severity_name method setting params verdict why limit symptom symptom_name bound "
    "trusted doubted flip flip_p95 coverage converged_ratio wrong_ratio nonfinite_px iterations_max residual_px_max "
    "reflector_px status reason command"
).split()
CERTAIN = 0.999  # share of pixels trusted, or of vertices converged, below which a method has said that something is wrong

MARGIN = 4  # pixels around the mirrors in the pictures

Regimes = dict[str, tuple[Regime, Callable[[float], Scene]]]


def verdict(record: Mapping[str, Any], bound: float) -> tuple[str, str]:
    """The verdict on one row, and what it rests on.

    holds     the error is under the bound
    degrades  it is over it, and the method says so: it is under it where the method has an answer that it does not doubt; or
              vertices did not converge
    fails     it is over it and the method is silent; or it ended, or answered what is no number, or wrong roots as right
    refuses   the method said beforehand that it cannot
    """
    if record["status"] == "refused":
        return "refuses", record.get("reason") or ""
    if record["status"] != "ok":
        return "fails", record.get("reason") or record["status"]
    if (record.get("wrong_ratio") or 0) > 0:
        return "fails", f"{100 * record['wrong_ratio']:.2g} % of the points called converged are wrong"
    measured = record.get("symptom") is not None
    error, name = (record["symptom"], "symptom") if measured else (record["flip"], "FLIP")
    if error is None:
        return "holds", "no mirror in view"
    if error <= bound:
        return "holds", f"{name} {error:.3g}"
    trusted = record.get("trusted")
    if trusted is not None and trusted <= bound and record["coverage"] - record["doubted"] < CERTAIN:
        return "degrades", f"{name} {error:.3g}, {trusted:.3g} where trusted: {record['coverage'] - record['doubted']:.2f}"
    if record.get("converged_ratio") is not None and record["converged_ratio"] < CERTAIN:
        return "degrades", f"{name} {error:.3g}, converged {record['converged_ratio']:.3f}"
    return "fails", f"{name} {error:.3g}, and silent"


def regimes() -> Regimes:
    """All regimes and their builders by name: the modules of `scenes.stress` that have a REGIME and a function of their name.

    Raises ValueError for one that has only one of the two.
    """
    stress = f"{shipped.package('scenes')}.stress"
    try:
        home = importlib.import_module(stress)
    except ModuleNotFoundError:
        return {}
    found: Regimes = {}
    for name in sorted(m.name for m in pkgutil.iter_modules(home.__path__)):
        module = importlib.import_module(f"{stress}.{name}")
        regime, builder = getattr(module, "REGIME", None), getattr(module, name, None)
        if (regime is None) != (not callable(builder)):
            raise ValueError(f"{stress}.{name} has {'no REGIME' if regime is None else f'no function {name}'}; accepted: both")
        if isinstance(regime, Regime) and builder is not None:
            found[name] = replace(regime, name=name), builder
    return found


def units(entries: Sequence[Entry], names: Sequence[str], severity: float | None) -> dict[str, list[dict[str, Any]]]:
    """What is to be measured, by regime. Raises ValueError for a severity that a regime does not have."""
    found = regimes()
    groups = {}
    for name in names:
        severities = found[name][0].severities
        if severity is not None and severity not in severities:
            given = ", ".join(f"{s:g}" for s in severities)
            raise ValueError(f"--severity is {severity:g}; accepted for {name}: {given}")
        groups[name] = [
            {"regime": name, "severity": s, "entry": asdict(entry)}
            for s in (severities if severity is None else [severity])
            for entry in entries
        ]
    return groups


def work(units: Sequence[dict[str, Any]], folder: Path) -> Iterator[dict[str, Any]]:
    """Measures units of one regime; see `benchharness.stability.children`. Pictures go to `folder`."""
    from benchharness.measure import contract
    from benchharness.measure.bench import Bench
    from benchharness.render.reference import ReferenceOptions

    found = regimes()
    for (name, severity), group in itertools.groupby(units, lambda unit: (unit["regime"], unit["severity"])):
        regime, build = found[name]
        scene = replace(build(severity), name=f"{name}[{severity:g}]")
        bench = Bench(scene, regime.size, ReferenceOptions(max_depth=regime.max_depth, spp=2), None, 0, (1, 1))
        for entry in (Entry(**unit["entry"]) for unit in group):
            method = contract.made(entry.build, bench.scene)
            if isinstance(method, contract.Out):
                yield asdict(method)
                continue
            record, seen = bench.show(regime.frame, entry.key, method)
            if seen is not None:
                trusted = seen.trusted()
                record["symptom"], record["trusted"] = _symptom(regime, seen), _symptom(regime, trusted)
                if record["symptom"] is None:  # then FLIP takes its place
                    record["trusted"] = trusted.record["flip"]
                record["doubted"] = float((seen.doubt & seen.found)[seen.mask].mean()) if seen.mask.any() else 0.0
                _keep_picture(folder, regime, severity, plan.label(entry), seen, scene.exposure)
            record["limit"] = type(method).limits.get(regime.entry)
            yield record


def row(unit: Mapping[str, Any], record: Mapping[str, Any]) -> dict[str, Any]:
    """The row of `FILE`."""
    regime, entry = regimes()[unit["regime"]][0], Entry(**unit["entry"])
    judged, why = verdict(record, regime.bound)
    command = (
        f"benchharness stability --regime {regime.name} --severity {unit['severity']:g} --only {shlex.quote(plan.label(entry))}"
    )
    return {
        **{column: record.get(column) for column in COLUMNS},
        "regime": regime.name,
        "title": regime.title,
        "entry": regime.entry,
        "severity": unit["severity"],
        "severity_name": regime.severity,
        "method": entry.method,
        "setting": plan.setting(entry),
        "params": entry.params_text,
        "verdict": judged,
        "why": why,
        "limit": record.get("limit") if judged == "fails" else None,
        "symptom_name": regime.symptom,
        "bound": regime.bound,
        "command": command,
    }


def _keep_picture(folder: Path, regime: Regime, severity: float, label: str, seen: Seen, exposure: float) -> None:
    """The method's picture, the reference and the error, side by side: the mirrors and a little around, which is darker."""
    from benchharness.measure import metrics

    rows, columns = np.nonzero(seen.mask)
    top, left = (max(int(axis.min(initial=0)) - MARGIN, 0) for axis in (rows, columns))
    bottom, right = (int(axis.max(initial=2 * MARGIN)) + MARGIN + 1 for axis in (rows, columns))
    pictures = [metrics.tonemap(image, exposure) for image in (seen.image, seen.truth)]
    pictures = [np.where(seen.mask[..., None], picture, picture // 2) for picture in pictures]
    whole = [picture[top:bottom, left:right] for picture in (*pictures, metrics.error_picture(seen.error))]
    file = folder / naming.picture_name(regime.name, severity, label)
    metrics.save_png(file, np.concatenate(whole, axis=1))


def _symptom(regime: Regime, seen: Seen) -> float | None:
    from benchharness.measure import completeness

    if isinstance(regime.measure, str) and regime.measure != MISSING:
        return seen.record.get(regime.measure)
    value = completeness.missing(seen) if isinstance(regime.measure, str) else regime.measure(seen)
    return None if value is None or not np.isfinite(value) else float(value)
