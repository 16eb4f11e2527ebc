"""Two result tables -> verdict: did a change make it better or worse?

Errors and counters of work are deterministic, so they decide; times flake between machines, so they warn. A row is
(scene, detail, frame, method, params). Only rows whose config, scene and reference are the same on both sides are
compared; the code of the method may differ, that is what is being judged.
"""

from __future__ import annotations

import math
import re
import statistics
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from scipy.stats import mannwhitneyu

from benchharness import results
from benchharness.verdict import EXIT_CODES, Finding, Verdict, render

__all__ = ["EXIT_CODES", "GATES", "Finding", "Verdict", "accept", "compare", "render"]


@dataclass(frozen=True)
class Gate:
    """A column that decides. Worse by more than `absolute + relative * |base|` in the direction `sign` is a regression.

    sign   +1 where more is worse, -1 where less is
    image  an error of the picture against the reference: not ranked where it is within the reference's noise
    """

    column: str
    sign: int
    absolute: float
    relative: float
    image: bool = False


GATES = (
    # Another CPU's fused multiply-adds move single edge pixels; a mean over the mask hardly feels them, and FLIP below
    # 0.0005 is not seen.
    Gate("flip", +1, 5e-4, 0.01, image=True),
    # A percentile jumps from pixel to pixel of the map.
    Gate("flip_p95", +1, 2e-3, 0.02, image=True),
    # In units of radiance, of order 1. Squared in relmse, hence twice the share.
    Gate("rmse", +1, 1e-4, 0.01, image=True),
    Gate("relmse", +1, 1e-4, 0.02, image=True),
    Gate("temporal_diff", +1, 1e-4, 0.02, image=True),
    # Float32 lengths against a ray traced in float32: 1e-5 of a length is their rounding.
    Gate("distance_err", +1, 1e-5, 0.02),
    # A hundredth of a pixel is the tolerance of the searches themselves.
    Gate("residual_px", +1, 0.01, 0.02),
    Gate("jitter_px", +1, 0.01, 0.02),
    # Shares of pixels or vertices: a thousandth is the rounding along the silhouette, two for a few thousand vertices.
    Gate("coverage", -1, 1e-3, 0.0),
    Gate("converged_ratio", -1, 2e-3, 0.0),
    Gate("wrong_ratio", +1, 1e-3, 0.0),
    # No non-finite pixel is a rounding error.
    Gate("nonfinite_px", +1, 0.0, 0.0),
    # Work is counted, not measured; a hundredth is for searches that stop one step earlier or later on another CPU.
    Gate("iterations_mean", +1, 0.0, 0.01),
    Gate("iterations_max", +1, 1.0, 0.01),
)
COUNTER = Gate("counters", +1, 0.0, 0.01)

SETTINGS = ("scene_hash", "reference_lighting", "reference_spp", "ppd")
"""What has to be the same on both sides for a row's errors to mean the same."""

CLOCKS = ("prepare", "update", "shade", "kernel")
TIME_FLOOR_MS = 0.1
"""Times below this on both sides are the cost of launching a kernel, and are not compared."""
SIGNIFICANCE = 0.01
"""Two-sided p of the Mann-Whitney test below which a difference of times counts as proven."""
FACTOR = 1.25
"""Ratio of times, each relative to its run's calibration kernel, from which on a difference is worth saying."""


def compare(base: Path, new: Path, *, fail_on_time: bool = False, factor: float = FACTOR) -> Verdict:
    """Judges `new` against `base`, each a run folder or its CSV file.

    fail_on_time  a time that is worse by `factor` is a regression if the raw samples prove it, or if there are none
    factor        > 1; a ratio of times, each divided by its run's calibration time

    Raises ValueError where a file is missing or malformed, or names a row twice.
    """
    if not factor > 1.0:
        raise ValueError(f"factor is {factor}; accepted: a number above 1")
    old_records, new_records = results.read_results(base), results.read_results(new)
    old, young = _by_key(base, old_records), _by_key(new, new_records)
    common = [key for key in old if key in young]
    findings = _tables_differ(old_records, new_records)
    if not findings:
        findings = _missing(old, young)
        judged = []
        for key in common:
            differs = _settings_differ(old[key], young[key])
            findings += differs or _row(old[key], young[key])
            judged += [] if differs else [key]
        samples = _samples(base), _samples(new)
        findings += _times([(old[key], young[key]) for key in judged], samples, fail_on_time, factor)
        if not common:
            findings.append(Finding("not comparable", "rows", "the two have no row in common"))
    return Verdict(base, new, len(common), tuple(findings))


def _by_key(path: Path, records: list[dict]) -> dict[tuple, dict]:
    rows: dict[tuple, dict] = {}
    for record in records:
        if results.key(record) in rows:
            raise ValueError(f"{path}: {results.key(record)} is there twice; accepted: one row per {results.KEY}")
        rows[results.key(record)] = record
    return rows


def _about(record: dict, kind: str, what: str, text: str, size: float = 0.0, frame: bool = True) -> Finding:
    where = {name: record[name] or "" for name in ("config", "scene", "detail", "method", "params")}
    return Finding(kind, what, text, **where, frame=record["frame"] if frame else None, size=size)


# Can they be compared?


def _tables_differ(old: list[dict], new: list[dict]) -> list[Finding]:
    if not old:
        return [Finding("not comparable", "rows", "the base has no rows")]
    if not new:
        return [Finding("incomplete", "rows", "nothing ran: the new table has no rows", config=old[0]["config"] or "")]
    sides = [sorted({(r["config"] or "", r["config_hash"] or "") for r in records}) for records in (old, new)]
    if sides[0] != sides[1]:
        named = [", ".join(f"{config} {config_hash}" for config, config_hash in side) for side in sides]
        text = f"the config is another: {named[0]} in the base, {named[1]} in the new run"
        return [Finding("not comparable", "config_hash", text, config=new[0]["config"] or "")]
    return []


def _settings_differ(old: dict, new: dict) -> list[Finding]:
    """A side that does not say (a crashed row, an old file) is not held against it."""
    return [
        _about(new, "not comparable", name, f"{name} is {old[name]} in the base, {new[name]} in the new run")
        for name in SETTINGS
        if None not in (old[name], new[name]) and old[name] != new[name]
    ]


def _missing(old: dict[tuple, dict], new: dict[tuple, dict]) -> list[Finding]:
    """Rows of one side alone. Where a method shares none of its parameter sets, its parameters were changed."""
    params = [{}, {}]
    for side, rows in zip(params, (old, new), strict=True):
        for record in rows.values():
            side.setdefault((record["scene"], record["detail"], record["method"]), set()).add(record["params"])
    findings, told = [], set()
    for key in (key for key in old if key not in new):
        record = old[key]
        group = (record["scene"], record["detail"], record["method"])
        one, other = params[0][group], params[1].get(group)
        if other is None or one & other:
            findings.append(_about(record, "incomplete", "missing", "is in the base, not in the new run"))
        elif group not in told:
            told.add(group)
            named = [" | ".join(sorted(side)) or "none" for side in (one, other)]
            text = f"its parameters are {named[0]} in the base, {named[1]} in the new run"
            findings.append(_about(record | {"params": ""}, "not comparable", "params", text, frame=False))
    for key in (key for key in new if key not in old):
        broken = new[key]["status"] in ("crashed", "timeout")
        text = f"is not in the base, so nothing judges it ({new[key]['status']})"
        findings.append(_about(new[key], "incomplete" if broken else "note", "new row", text))
    return findings


# Errors and work


def _row(old: dict, new: dict) -> list[Finding]:
    findings = []
    if None not in (old["method_hash"], new["method_hash"]) and old["method_hash"] != new["method_hash"]:
        findings.append(_about(new, "note", "method_hash", "the code of the method changed", frame=False))
    if old["status"] != new["status"]:
        return [*findings, _status(old, new)]
    if new["status"] in ("refused", "crashed", "timeout"):
        return [*findings, _about(new, "note", "status", f"{new['status']}, as in the base")]

    # Another mask means other pixels in every mean; a thousandth is the rasterizer's rounding.
    pixels = old["reflector_px"], new["reflector_px"]
    if None not in pixels and abs(pixels[1] - pixels[0]) > 2 + 1e-3 * pixels[0]:
        text = f"the mirror's mask had {pixels[0]} pixels and has {pixels[1]}: errors are means over other pixels"
        findings.append(_about(new, "warning", "reflector_px", text))

    noise = max(old["reference_noise"] or 0.0, new["reference_noise"] or 0.0)
    hidden = None not in (old["flip"], new["flip"]) and max(old["flip"], new["flip"]) <= noise
    for gate in GATES:
        if not (gate.image and hidden):
            findings += _gated(gate, gate.column, old, new, old[gate.column], new[gate.column])
    before, after = (results.parse_params(record["counters"]) for record in (old, new))
    for name, value in before.items():
        findings += _gated(COUNTER, f"counter {name}", old, new, value, after.get(name))
    for name in after.keys() - before.keys() if before else ():
        findings.append(_about(new, "note", f"counter {name}", "is counted now", frame=False))
    return findings


def _status(old: dict, new: dict) -> Finding:
    text = f"was {old['status']}, is {new['status']}" + (f": {new['reason']}" if new["reason"] else "")
    if new["status"] in ("crashed", "timeout"):
        return _about(new, "incomplete", "status", text)
    better = results.STATUSES.index(new["status"]) < results.STATUSES.index(old["status"])
    return _about(new, "improvement" if better else "regression", "status", text)


def _gated(gate: Gate, name: str, old_row: dict, new_row: dict, old, new) -> list[Finding]:
    if old is None:
        return []
    if new is None:
        return [_about(new_row, "incomplete", name, f"was {_number(old)}, is not measured any more")]
    allowed = gate.absolute + gate.relative * abs(old)
    worse = gate.sign * (new - old) if new != old else 0.0
    if abs(worse) <= allowed or math.isnan(worse):
        return []
    text = f"{_number(old)} -> {_number(new)}{_share(old, new)}, within {_number(allowed)} is the same"
    return [_about(new_row, "regression" if worse > 0 else "improvement", name, text, size=abs(worse))]


def _number(value: float) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _share(old: float, new: float) -> str:
    return f" ({100.0 * (new - old) / abs(old):+.0f} %)" if old and math.isfinite(new - old) else ""


# Times


def _samples(path: Path) -> dict[tuple, list[float]]:
    """(scene, detail, frame, method, params, clock) -> raw times in ms; empty where there is no samples.csv."""
    out: dict[tuple, list[float]] = {}
    for sample in results.read_samples(path) if path.is_dir() else []:
        if sample["ms"] is not None:
            out.setdefault((*results.key(sample), sample["clock"]), []).append(sample["ms"])
    return out


def _times(pairs: Sequence[tuple[dict, dict]], samples: tuple[dict, dict], fail: bool, factor: float) -> list[Finding]:
    """One finding per (scene, detail, method, params, clock), over its frames.

    A ratio of times is taken per frame, so that frames of unlike cost weigh the same; the finding has their median.
    """
    groups: dict[tuple, list[tuple[dict, dict]]] = {}
    untimed = 0
    for old, new in pairs:
        if old["status"] == new["status"] == "ok":
            if old["calibration_ms"] and new["calibration_ms"]:
                groups.setdefault(results.key(old | {"frame": None}), []).append((old, new))
            else:
                untimed += 1
    findings = []
    if untimed:
        findings.append(Finding("note", "times", f"not compared in {untimed} rows: no calibration_ms on both sides"))
    for rows in groups.values():
        for clock in CLOCKS:
            findings += _clock(clock, rows, samples, fail, factor)
    return findings


def _clock(clock: str, rows: Sequence[tuple[dict, dict]], samples: tuple[dict, dict], fail: bool, factor: float):
    column = f"{clock}_ms"
    ratios, sides = [], ([], [])
    for old, new in rows:
        before, after = old[column], new[column]
        if not before or not after or max(before, after) < TIME_FLOOR_MS:
            continue
        relative = before / old["calibration_ms"]
        ratios.append(after / new["calibration_ms"] / relative)
        for side, record, raw in zip(sides, (old, new), samples, strict=True):
            times = raw.get((*results.key(record), clock), [])
            side += [ms / record["calibration_ms"] / relative for ms in times]
    ratio = statistics.median(ratios) if ratios else 1.0
    if 1.0 / factor <= ratio <= factor:
        return []
    tested = bool(sides[0] and sides[1])
    p = mannwhitneyu(*sides).pvalue if tested else math.nan
    proven = tested and p < SIGNIFICANCE
    how = f"Mann-Whitney p = {p:.2g}" if tested else "no raw samples on both sides to prove it"
    text = f"{'' if proven else '~ '}{ratio:.2f} times the base, relative to the calibration kernel ({how})"
    kind = "improvement" if ratio < 1.0 else "warning"
    if kind == "warning" and fail and (proven or not tested):
        kind = "regression"
    if kind == "improvement" and not proven:
        kind = "note"
    return [_about(rows[0][1], kind, column, text, size=ratio, frame=False)]


# A new baseline


def accept(run: Path, baselines: Path, because: str) -> Path:
    """Makes the results of a run folder the baseline of its config; returns `baselines/<config>.csv`.

    Times are kept beside the `calibration_ms` that relates them to another machine's. A run of some of the methods of
    the same config replaces their rows and leaves the others. The reason, with the date, goes to `baselines/LOG.md`.
    Raises ValueError for an empty reason, and for a run with no rows or with those of more than one config.
    """
    reason = " ".join(because.split())
    if not reason:
        raise ValueError("--because is empty; accepted: a sentence why the new numbers are right")
    records = results.read_results(run)
    configs = {record["config"] or "" for record in records}
    if len(configs) != 1 or "" in configs:
        raise ValueError(f"{run}: rows of {len(configs - {''})} configs; accepted: a run of exactly one")
    config = Path(configs.pop()).name
    file = baselines / f"{re.sub(r'[^A-Za-z0-9_.-]', '_', config.removesuffix('.toml'))}.csv"

    kept = []
    if file.exists():
        hashes = {record["config_hash"] for record in records}
        replaced = {_unit(record) for record in records}
        kept = [r for r in results.read_results(file) if r["config_hash"] in hashes and _unit(r) not in replaced]
    results.write_table(file, [*kept, *records], results.COLUMNS)

    log = baselines / "LOG.md"
    text = log.read_text(encoding="utf-8") if log.exists() else "# Why the baselines are what they are\n\n"
    counts = {status: sum(r["status"] == status for r in records) for status in results.STATUSES}
    said = ", ".join(f"{count} {status}" for status, count in counts.items() if count)
    rows = f"{len(records)} rows: {said}" + (f"; {len(kept)} kept" if kept else "")
    results.write_atomic(log, f"{text}- {datetime.now(UTC):%Y-%m-%d} `{file.stem}` {reason} ({rows})\n")
    return file


def _unit(record: dict) -> tuple:
    """What a run with `--only METHOD` replaces as a whole."""
    return record["scene"], record["detail"], record["method"]
