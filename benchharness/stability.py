"""The stability suite: every method in every regime, from mild to severe; what holds, what fails, and whether it says so.

    benchharness stability [--only METHOD] [--regime NAME] [--severity X] [--out DIR]

Every regime runs in a process of its own, so that one that ends costs its own rows only. Into the folder go

    stability.csv   a row per regime, severity and method (COLUMNS)
    stability.html  the matrix of verdicts
    images/         what was seen, and the reference
"""

from __future__ import annotations

import csv
import io
import json
import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchharness import params, platform, plugins, results

VARIANT = "llvm_ad_rgb"
STRESS = "scenes.stress"
COLUMNS = (
    "regime entry severity method params verdict why symptom symptom_name flip bound flip_p95 coverage converged_ratio "
    "wrong_ratio nonfinite_px iterations_max residual_px_max reflector_px status reason command"
).split()
CERTAIN = 0.999  # share of pixels found, or of vertices converged, below which a method has said that something is wrong


def verdict(record: dict[str, Any], bound: float) -> tuple[str, str]:
    """The verdict on one row, and what it rests on.

    holds     the error is under the bound
    degrades  it is over it, and the method says so: pixels without an answer, or vertices that did not converge
    fails     it is over it and the method is silent; or it ended, or answered what is no number, or wrong roots as right
    refuses   the method said beforehand that it cannot
    """
    if record["status"] == "refused":
        return "refuses", record.get("reason") or ""
    if record["status"] != "ok":
        return "fails", record.get("reason") or record["status"]
    if (record.get("wrong_ratio") or 0) > 0:
        return "fails", f"{100 * record['wrong_ratio']:.2g} % of the points called converged are wrong"
    error, name = (record["flip"], "FLIP") if record.get("symptom") is None else (record["symptom"], "symptom")
    if error is None:
        return "holds", "no mirror in view"
    if error <= bound:
        return "holds", f"{name} {error:.3g}"
    said = [
        f"{column.partition('_')[0]} {record[column]:.3f}"
        for column in ("coverage", "converged_ratio")
        if record.get(column) is not None and record[column] < CERTAIN
    ]
    return ("degrades", ", ".join(said)) if said else ("fails", f"{name} {error:.3g}, and silent")


def regimes() -> dict[str, Any]:
    """All regimes by name: the modules of `scenes.stress` that have a REGIME and a builder of their own name.

    Raises ValueError for one that has only one of the two.
    """
    import importlib
    import pkgutil

    from benchharness.regime import Regime

    try:
        home = importlib.import_module(STRESS)
    except ModuleNotFoundError:
        return {}
    found = {}
    for name in sorted(m.name for m in pkgutil.iter_modules(home.__path__)):
        module = importlib.import_module(f"{STRESS}.{name}")
        regime, builder = getattr(module, "REGIME", None), getattr(module, name, None)
        if (regime is None) != (not callable(builder)):
            raise ValueError(f"{STRESS}.{name} has {'no REGIME' if regime is None else f'no function {name}'}; accepted: both")
        if isinstance(regime, Regime):
            found[name] = replace(regime, name=name), builder
    return found


def chosen(only: Sequence[str], what: str, available: Sequence[str]) -> list[str]:
    """`only`, or all that there is. Raises ValueError for a name that there is not."""
    for name in only:
        if name not in available:
            raise ValueError(f"{what} {plugins.unknown(name, available)}")
    return [name for name in available if not only or name in only]


def run(
    out: Path, only: Sequence[str] = (), regime: Sequence[str] = (), severity: float | None = None,
    tell: Callable[[str], None] = print,
) -> tuple[int, Path]:  # fmt: skip
    """Runs the suite. Returns how many rows fail silently, and the page.

    Raises ValueError for an unknown method, regime or severity, and for a folder that is in use.
    """
    platform.use_variant(VARIANT)
    found = regimes()
    methods = [name for name, plugin in plugins.discover("method").items() if plugin.error is None]
    methods, names = chosen(only, "--only: method", methods), chosen(regime, "--regime: regime", list(found))
    if severity is not None:
        for name in names:
            if severity not in found[name][0].severities:
                given = ", ".join(f"{s:g}" for s in found[name][0].severities)
                raise ValueError(f"--severity is {severity:g}; accepted for {name}: {given}")
    if (out / "stability.csv").exists():
        raise ValueError(f"{out} holds a run already; accepted: a new folder")
    out.mkdir(parents=True, exist_ok=True)
    rows = []
    for name in names:
        wanted = [severity] if severity is not None else list(found[name][0].severities)
        rows += _in_child(out, found[name][0], name, wanted, methods)
        seen = [row["verdict"] for row in rows if row["regime"] == name]
        tell(f"{name}: " + ", ".join(f"{seen.count(v)} {v}" for v in results.VERDICTS if v in seen))
        results.write_atomic(out / "stability.csv", _csv(rows))
    from benchharness.report import matrix

    return sum(row["verdict"] == "fails" for row in rows), matrix.write(out)


def _csv(rows: list[dict]) -> str:
    text = io.StringIO()
    writer = csv.DictWriter(text, COLUMNS, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def _in_child(out: Path, regime: Any, name: str, severities: list[float], methods: list[str]) -> list[dict]:
    """The rows of one regime. A child that ends is followed by another for what is left; the row in flight fails."""
    left = [(s, m) for s in severities for m in methods]
    rows = []
    while left:
        job = json.dumps({"regime": name, "left": left, "images": str(out / "images")})
        child = subprocess.run([sys.executable, "-m", "benchharness.stability", job], capture_output=True, text=True)
        done = [json.loads(line) for line in child.stdout.splitlines() if line.startswith('{"entry"')]
        for record in done:
            rows.append(_row(regime, record))
            left.remove((record["severity"], record["entry"]))
        if left and (child.returncode != 0 or not done):
            lost, reason = left.pop(0), f"the process ended with {child.returncode}: {child.stderr.strip()[-200:]}"
            rows.append(_row(regime, {"entry": lost[1], "severity": lost[0], "status": "crashed", "reason": reason}))
    return rows


def _row(regime: Any, record: dict[str, Any]) -> dict[str, Any]:
    judged, why = verdict(record, regime.bound)
    command = f"benchharness stability --regime {regime.name} --severity {record['severity']:g} --only {record['entry']}"
    return {
        **{column: record.get(column) for column in COLUMNS},
        "regime": regime.name, "entry": regime.entry, "severity": record["severity"], "method": record["entry"],
        "verdict": judged, "why": why, "symptom_name": regime.symptom, "bound": regime.bound, "command": command,
    }  # fmt: skip


def _work(job: dict[str, Any]) -> None:
    """What a child does: measures what is `left` of a regime, and prints a line of JSON for each row."""
    platform.use_variant(VARIANT)
    from benchharness.measure import Bench
    from benchharness.reference import ReferenceOptions

    regime, build = regimes()[job["regime"]]
    found = plugins.discover("method")
    for severity in dict.fromkeys(s for s, _ in job["left"]):
        scene = replace(build(severity), name=f"{regime.name}[{severity:g}]")
        bench = Bench(scene, regime.size, ReferenceOptions(max_depth=regime.max_depth, spp=2), None, 0, (1, 1))
        for name in [m for s, m in job["left"] if s == severity]:
            method = found[name].target()
            refusal = method.refuses(scene)
            if refusal is not None:
                record: dict[str, Any] = {"status": "refused", "reason": refusal}
            else:
                bench.entries.clear()
                record = bench.run_frame(regime.frame, {name: method}, lambda entry: None)[0][0]
                if record["status"] == "ok":
                    seen = bench.seen(name, regime.frame, record)
                    record["symptom"] = _symptom(regime, seen)
                    _keep_picture(Path(job["images"]), regime, severity, name, seen, scene.exposure)
            defaults = params.sweep({}, params.of_method(found[name].target), name)[0]
            record["params"] = params.canonical(defaults)
            line = {"entry": name, "severity": severity} | {k: v for k, v in record.items() if k != "entry"}
            print(json.dumps(line, default=lambda number: number.item()), flush=True)


def _keep_picture(folder: Path, regime: Any, severity: float, name: str, seen: Any, exposure: float) -> None:
    """The method's picture, the reference and the error, side by side."""
    from benchharness import metrics
    from benchharness.report.matrix import picture_name

    pictures = [metrics.tonemap(image, exposure) for image in (seen.image, seen.truth)]
    folder.mkdir(parents=True, exist_ok=True)
    whole = np.concatenate([*pictures, metrics.error_picture(seen.error)], axis=1)
    metrics.save_png(folder / picture_name(regime.name, severity, name), whole)


def _symptom(regime: Any, seen: Any) -> float | None:
    if isinstance(regime.measure, str):
        return seen.record.get(regime.measure)
    value = regime.measure(seen)
    return None if value is None or not np.isfinite(value) else float(value)


if __name__ == "__main__":
    _work(json.loads(sys.argv[1]))
