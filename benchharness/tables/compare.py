"""Two sides, each of one run or several -> verdict: did a change make it better or worse?

Errors and counters of work are deterministic, so they decide; times decide where there are runs enough to prove it, see
`benchharness.tables.times`. A row is (scene, detail, frame, method, params). A status decides first; numbers are compared where
config, scene and reference are the same on both sides. The code of the method may differ, that is what is being judged.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path

from benchharness.tables import results, times
from benchharness.tables.verdict import EXIT_CODES, FORMATS, Finding, Verdict, render

__all__ = ["EXIT_CODES", "FORMATS", "GATES", "Finding", "Verdict", "accept", "compare", "render"]


@dataclass(frozen=True)
class Gate:
    """A column that decides. Worse by more than `absolute + relative * |base|` in the direction `sign` is a regression.

    sign   +1 where more is worse, -1 where less is
    image  an error of the picture against the reference: not ranked where it is within the reference's noise

    The tolerances are for another machine. In the same environment runs repeat bit for bit, and SAME_MACHINE of them do.
    """

    column: str
    sign: int
    absolute: float
    relative: float
    image: bool = False

    def allowed(self, base: float, same_machine: bool) -> float:
        """How much worse than `base` is not worth a word."""
        return (SAME_MACHINE if same_machine else 1.0) * (self.absolute + self.relative * abs(base))


SAME_MACHINE = 0.1
"""Of the tolerances: what a harmless change in the order of operations may move."""

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
LENIENT = (*(gate.column for gate in GATES), "counters")
"""Columns that may hold what is no number in a new run: that is a regression, not a damaged file."""

SETTINGS = ("scene_hash", "reference_lighting", "reference_spp", "ppd")
"""What has to be the same on both sides for a row's errors to mean the same."""
SAME_NOISE = Gate("reference_noise", +1, 1e-3, 0.1)
"""The reference's noise is a setting, too, but measured."""
NOISIEST = 0.1
"""FLIP; a reference with more noise than this cannot judge a picture that changed, where it hides the change."""

BROKEN = ("crashed", "timeout")


@dataclass(frozen=True)
class Side:
    """The runs of one side: their names, and their records by `results.key`."""

    path: Path
    names: list[str]
    tables: list[dict[tuple, dict]]

    @property
    def records(self) -> list[dict]:
        return [record for table in self.tables for record in table.values()]


def compare(base: Path, new: Path, *, fail_on_time: bool = False) -> Verdict:
    """Judges `new` against `base`: each a run folder, its CSV file, or a folder that holds the run folders of one side.

    fail_on_time  what is proven slower is a regression; incomplete where nothing can be proven

    Raises ValueError where a file is missing or malformed, or names a row twice.
    """
    sides = _side(base, ()), _side(new, LENIENT)
    old, young = sides[0].tables[0], sides[1].tables[0]
    command = results.read_command(_folders(new)[0]) if new.is_dir() else None
    runs = len(sides[0].tables), len(sides[1].tables)
    findings = _tables_differ(sides[0].records, sides[1].records)
    if findings:
        return Verdict(base, new, runs, (), 0, tuple(findings), None, command)
    common = [key for key in old if key in young]
    findings = list(_errors(*sides))
    if not common:
        findings.append(Finding("not comparable", "rows", "the two have no row in common"))
    timed = [key for key in common if _timed([table.get(key) for side in sides for table in side.tables])]
    found = times.judge(sides[0].tables, sides[1].tables, timed, rounds(base, new))
    findings += _paces(found, old, fail_on_time)
    groups = tuple(dict.fromkeys(_group(young[key]) for key in common))
    return Verdict(base, new, runs, groups, len(common), tuple(findings), found, command)


def _side(path: Path, lenient: Sequence[str]) -> Side:
    folders = _folders(path)
    return Side(path, [f.name for f in folders], [_by_key(f, results.read_results(f, lenient)) for f in folders])


def _folders(path: Path) -> list[Path]:
    """The run folders of one side: `path` itself, or those in it. Raises ValueError for one that is not finished."""
    if not path.is_dir() or (path / "results.csv").exists():
        return [path]
    runs = sorted(p for p in path.iterdir() if (p / "results.csv").exists() or (p / "run.json").exists())
    for run in runs:
        if not (run / "results.csv").exists():
            raise ValueError(f"{run} holds a run that was not finished; accepted: finished runs, see `--resume`")
    return runs or [path]


def rounds(*sides: Path) -> list[dict[tuple, list[float]]] | None:
    """The rounds of all runs, see `times.judge`; None where a side is a table alone, and no run."""
    folders = [folder for side in sides for folder in _folders(side)]
    if not all((folder / "samples.csv").is_file() for folder in folders):
        return None
    runs = []
    for folder in folders:
        found: dict[tuple, list[float]] = {}
        for sample in results.read_samples(folder):
            found.setdefault((*results.key(sample), sample["clock"]), []).append(sample["ms"])
        runs.append(found)
    return runs


def _by_key(path: Path, records: list[dict]) -> dict[tuple, dict]:
    rows: dict[tuple, dict] = {}
    for record in records:
        if results.key(record) in rows:
            said = results.shorten(str(results.key(record)))
            raise ValueError(f"{path}: {said} is there twice; accepted: one row per {', '.join(results.KEY)}")
        rows[results.key(record)] = record
    return rows


def _group(record: Mapping) -> tuple[str, ...]:
    return tuple(record[name] or "" for name in ("config", "scene", "detail", "method", "params"))


def _about(record: Mapping, kind: str, what: str, text: str, size: float = 0.0, frame: bool = True) -> Finding:
    return Finding(kind, what, text, *_group(record), frame=record["frame"] if frame else None, size=size)


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
    names = [name for name in SETTINGS if None not in (old[name], new[name]) and old[name] != new[name]]
    noise = old["reference_noise"], new["reference_noise"]
    if None not in noise and not abs(noise[1] - noise[0]) <= SAME_NOISE.allowed(noise[0], same_machine=False):
        names.append("reference_noise")
    return [
        _about(new, "not comparable", name, f"{name} is {old[name]} in the base, {new[name]} in the new run") for name in names
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
        kind = "incomplete" if new[key]["status"] in BROKEN else "note"
        text = f"is not in the base, so nothing judges it ({new[key]['status']})"
        findings.append(_about(new[key], kind, "new row", text))
    return findings


# Errors and work


def _errors(base: Side, new: Side) -> Iterator[Finding]:
    """Of every run of the new side against the first of the base; and of the base against itself, which should be equal."""
    first, *others = zip(new.names, new.tables, strict=True)
    said = set()
    for name, table in [first, *others]:
        for finding in _judged(base.tables[0], table):
            place = replace(finding, text="", size=0.0)
            if place not in said:
                said.add(place)
                yield finding if name == first[0] else replace(finding, text=f"{finding.text} (in run {name})")
    for name, table in list(zip(base.names, base.tables, strict=True))[1:]:
        for finding in _judged(base.tables[0], table):
            if finding.kind in (*EXIT_CODES, "improvement"):
                text = f"the base's run {name} differs from its run {base.names[0]}: {finding.text}"
                yield replace(finding, kind="warning", text=text)


def _judged(old: dict[tuple, dict], new: dict[tuple, dict]) -> list[Finding]:
    return _missing(old, new) + [finding for key in old if key in new for finding in _row(old[key], new[key])]


def _row(old: dict, new: dict) -> list[Finding]:
    findings = []
    if None not in (old["method_hash"], new["method_hash"]) and old["method_hash"] != new["method_hash"]:
        findings.append(_about(new, "note", "method_hash", "the code of the method changed", frame=False))
    if old["status"] != new["status"]:
        return [*findings, _status(old, new)]
    if new["status"] in ("refused", *BROKEN):
        return [*findings, _about(new, "note", "status", f"{new['status']}, as in the base")]
    if differs := _settings_differ(old, new):
        return [*findings, *differs]

    # Another mask means other pixels in every mean; a thousandth is the rasterizer's rounding.
    pixels = old["reflector_px"], new["reflector_px"]
    if None not in pixels and abs(pixels[1] - pixels[0]) > 2 + 1e-3 * pixels[0]:
        text = f"the mirror's mask had {pixels[0]} pixels and has {pixels[1]}: errors are means over other pixels"
        findings.append(_about(new, "warning", "reflector_px", text))
    return [*findings, *_numbers(old, new)]


def _status(old: dict, new: dict) -> Finding:
    text = f"was {old['status']}, is {new['status']}" + (f": {new['reason']}" if new["reason"] else "")
    if new["status"] in BROKEN:
        return _about(new, "incomplete", "status", text)
    better = results.STATUSES.index(new["status"]) < results.STATUSES.index(old["status"])
    return _about(new, "improvement" if better else "regression", "status", text)


def _numbers(old: dict, new: dict) -> Iterator[Finding]:
    """What the gates say of two rows that were measured under the same conditions."""
    noise = max(old["reference_noise"] or 0.0, new["reference_noise"] or 0.0)
    flips = old["flip"], new["flip"]
    hidden = None not in flips and all(flip <= noise for flip in flips)
    for gate in GATES:
        for finding in _gated(gate, gate.column, old, new, old[gate.column], new[gate.column]):
            yield _unranked(finding, noise) if gate.image and hidden else finding
    before, after = (results.parse_params(record["counters"]) for record in (old, new))
    for name, value in before.items():
        yield from _gated(COUNTER, f"counter {name}", old, new, value, after.get(name))
    for name in after.keys() - before.keys() if before else ():
        yield from _gated(COUNTER, f"counter {name}", old, new, None, after[name])
        yield _about(new, "note", f"counter {name}", "is counted now", frame=False)


def _unranked(finding: Finding, noise: float) -> Finding:
    """A change of the picture that the reference's noise hides: which side is nearer to the truth is not known."""
    if finding.kind not in ("regression", "improvement"):
        return finding
    kind = "not comparable" if noise > NOISIEST else "warning" if finding.kind == "regression" else "note"
    return replace(finding, kind=kind, text=f"{finding.text}; both are within the reference's noise, {_number(noise)}")


def _gated(gate: Gate, name: str, old_row: dict, new_row: dict, old, new) -> list[Finding]:
    if new is not None and not math.isfinite(new):
        text = f"{'nothing' if old is None else _number(old)} -> {_number(new)}, which is no number"
        return [_about(new_row, "regression", name, text, size=math.inf)]
    if old is None:
        return []
    if new is None:
        return [_about(new_row, "incomplete", name, f"was {_number(old)}, is not measured any more")]
    allowed = gate.allowed(old, old_row["environment"] == new_row["environment"] is not None)
    worse = gate.sign * (new - old)
    if abs(worse) <= allowed:
        return []
    text = f"{_number(old)} -> {_number(new)}{_share(old, new)}, within {_number(allowed)} is the same"
    return [_about(new_row, "regression" if worse > 0 else "improvement", name, text, size=abs(worse))]


def _number(value: float) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _share(old: float, new: float) -> str:
    return f" ({100.0 * (new - old) / abs(old):+.0f} %)" if old else ""


# Times


def _timed(records: Sequence[dict | None]) -> bool:
    """Whether a row's times may be compared: it was measured in every run, under the same conditions."""
    first, *others = records
    if first is None or any(record is None or record["status"] != "ok" for record in records):
        return False
    return not any(_settings_differ(first, record) for record in others if record is not None)


def _paces(found: times.Times, old: dict[tuple, dict], fail: bool) -> Iterator[Finding]:
    """A finding for every time that is not the same; `fail`: what is proven slower fails, and so does what proves nothing."""
    configs = {results.key(record | {"frame": None}): record["config"] or "" for record in old.values()}
    kinds = {"slow": "regression" if fail else "warning", "fast": "improvement", "ambiguous": "note", "unproven": "warning"}
    unproven = found.unproven if found.paces else "no row has times on both sides"
    if fail and unproven:
        text = f"unproven: {unproven}; see `benchharness rerun`"
        yield Finding("incomplete", "times", text, config=next(iter(configs.values())))
    for pace in found.paces:
        sure = pace.verdict != "unproven"
        if pace.verdict == "same" or (not sure and 1.0 / times.FACTOR <= pace.ratio <= times.FACTOR):
            continue
        text = f"{pace.ratio:.2f} times the base"
        if sure:
            text += f" ({pace.low:.2f} to {pace.high:.2f}, p = {pace.p:.1g})"
        if pace.verdict in ("ambiguous", "unproven"):
            text = f"~ {text}: {pace.verdict}"
        kind = "note" if not sure and pace.ratio < 1.0 else kinds[pace.verdict]
        config = configs[(pace.scene, pace.detail, None, pace.method, pace.params)]
        about = config, pace.scene, pace.detail, pace.method, pace.params
        yield Finding(kind, f"{pace.clock}_ms", text, *about, size=pace.ratio)


# A new baseline


def accept(run: Path, baselines: Path, because: str, *, replaces: bool = False) -> Path:
    """Makes the results of a run folder the baseline of its config; returns `baselines/<config>.csv`.

    replaces  whether a baseline of another study may be replaced: one with other settings, or with none of its scenes

    Times are kept beside the `calibration_ms` that relates them to another machine's. A run of some of the methods of
    the same config replaces their rows and leaves the others. The reason, with the date, goes to `baselines/LOG.md`.
    Raises ValueError for an empty reason, for a run that is no measure of anything (no rows, rows of more than one config,
    or a row that crashed), and for another study.
    """
    reason = " ".join(because.split())
    if not reason:
        raise ValueError("--because is empty; accepted: a sentence why the new numbers are right")
    if baselines.exists() and not baselines.is_dir():
        raise ValueError(f"--baselines {baselines} is a file; accepted: a folder")
    records = results.read_results(run)
    config = _accepted_config(run, records)
    file = baselines / f"{re.sub(r'[^A-Za-z0-9_.-]', '_', config.removesuffix('.toml'))[:100]}.csv"
    kept = [] if replaces or not file.exists() else _kept(file, run, results.read_results(file), records)
    results.write_table(file, [*kept, *records], results.COLUMNS)

    log = baselines / "LOG.md"
    text = log.read_text(encoding="utf-8") if log.exists() else "# Why the baselines are what they are\n\n"
    counts = {status: sum(r["status"] == status for r in records) for status in results.STATUSES}
    said = ", ".join(f"{count} {status}" for status, count in counts.items() if count)
    rows = f"{len(records)} rows: {said}" + (f"; {len(kept)} kept" if kept else "")
    results.write_atomic(log, f"{text}- {datetime.now(UTC):%Y-%m-%d} `{file.stem}` {reason} ({rows})\n")
    return file


def _accepted_config(run: Path, records: Sequence[dict]) -> str:
    """The config of a run that may become a baseline. Raises ValueError for any other run."""
    configs = {record["config"] or "" for record in records}
    if len(configs) != 1 or "" in configs:
        raise ValueError(f"{run}: rows of {len(configs - {''})} configs; accepted: a run of exactly one")
    _by_key(run, list(records))
    for record in records:
        if record["status"] in BROKEN:
            where = results.shorten(f"{record['scene']}, {record['method']} {record['params']}".strip())
            raise ValueError(
                f"{run}: frame {record['frame']} of {where} is {record['status']}; accepted: a run in which nothing crashed"
            )
    return Path(configs.pop()).name


def _kept(file: Path, run: Path, before: Sequence[dict], records: Sequence[dict]) -> list[dict]:
    """Rows of the old baseline that stay. Raises ValueError where it belongs to another study."""
    hashes = [{record["config_hash"] for record in rows} for rows in (before, records)]
    scenes = [{(record["scene"], record["detail"]) for record in rows} for rows in (before, records)]
    if before and (hashes[0] != hashes[1] or not scenes[0] & scenes[1]):
        differs = "its settings are others" if hashes[0] != hashes[1] else "they have no scene in common"
        raise ValueError(
            f"{file} is the baseline of another study than {run}: {differs}; accepted: a run of the same study, or "
            "--replace, which drops all rows of the old one"
        )
    replaced = {_unit(record) for record in records}
    return [record for record in before if _unit(record) not in replaced]


def _unit(record: dict) -> tuple:
    """What a run with `--only METHOD` replaces as a whole."""
    return record["scene"], record["detail"], record["method"]
