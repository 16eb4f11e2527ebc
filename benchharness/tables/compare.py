"""Two sides, each of one run or several -> verdict: did a change make it better or worse?

Errors and counters of work are deterministic, so they decide; times decide where there are runs enough to prove it, see
`benchharness.tables.times`. A row is (scene, detail, frame, method, params). A status decides first; numbers are compared where
config, scene and reference are the same on both sides. The code of the method may differ, that is what is being judged.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from benchharness.tables import gates, origin, results, sides, times
from benchharness.tables.columns import BROKEN, STATUSES, Gate
from benchharness.tables.sides import Side, Table
from benchharness.tables.verdict import EXITS, Finding, Verdict, group

SETTINGS = ("scene_hash", "reference_lighting", "reference_spp", "ppd")
"""What has to be the same on both sides for a row's errors to mean the same."""
SAME_NOISE = Gate(1e-3, 0.1, "The reference's noise is a setting, too, but measured.")


def compare(base: Path, new: Path, *, fail_on_time: bool = False) -> Verdict:
    """Judges `new` against `base`: each a run folder, its CSV file, or a folder that holds the run folders of one side.

    fail_on_time  what is proven slower is a regression; incomplete where nothing can be proven

    Raises ValueError where a file is missing or malformed, or names a row twice.
    """
    was, now = sides.read(base), sides.read(new, gates.LENIENT)
    command = origin.read_command(now.runs[0]) if new.is_dir() else None
    runs = len(was.tables), len(now.tables)
    if findings := _tables_differ(was.records, now.records):
        return Verdict(base, new, runs, (), 0, tuple(findings), None, command)
    old, young = was.tables[0], now.tables[0]
    common = [key for key in old if key in young]
    findings = list(_errors(was, now))
    if not common:
        findings.append(Finding("not comparable", "rows", "the two have no row in common"))
    timed = [key for key in common if _timed([table.get(key) for table in (*was.tables, *now.tables)])]
    found = times.judge(was.tables, now.tables, timed, sides.rounds([*was.runs, *now.runs]))
    findings += _paces(found, old, fail=fail_on_time)
    groups = tuple(dict.fromkeys(group(young[key]) for key in common))
    return Verdict(base, new, runs, groups, len(common), tuple(findings), found, command)


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
    if None not in noise and not abs(noise[1] - noise[0]) <= gates.allowed(SAME_NOISE, noise[0]):
        names.append("reference_noise")
    text = "{0} is {1} in the base, {2} in the new run"
    return [Finding.about(new, "not comparable", name, text.format(name, old[name], new[name])) for name in names]


def _missing(old: Table, new: Table) -> list[Finding]:
    """Rows of one side alone. Where a method shares none of its parameter sets, its parameters were changed."""
    params = [{}, {}]
    for side, rows in zip(params, (old, new), strict=True):
        for record in rows.values():
            side.setdefault((record["scene"], record["detail"], record["method"]), set()).add(record["params"])
    findings, told = [], set()
    for key in (key for key in old if key not in new):
        record = old[key]
        about = (record["scene"], record["detail"], record["method"])
        one, other = params[0][about], params[1].get(about)
        if other is None or one & other:
            findings.append(Finding.about(record, "incomplete", "missing", "is in the base, not in the new run"))
        elif about not in told:
            told.add(about)
            named = [" | ".join(sorted(side)) or "none" for side in (one, other)]
            text = f"its parameters are {named[0]} in the base, {named[1]} in the new run"
            findings.append(Finding.about(record | {"params": ""}, "not comparable", "params", text, frame=False))
    for key in (key for key in new if key not in old):
        kind = "incomplete" if new[key]["status"] in BROKEN else "note"
        text = f"is not in the base, so nothing judges it ({new[key]['status']})"
        findings.append(Finding.about(new[key], kind, "new row", text))
    return findings


# Errors and work


def _errors(base: Side, new: Side) -> Iterator[Finding]:
    """Judges every run of the new side against the first of the base; and the base against itself, which should be equal."""
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
            if finding.kind in (*EXITS, "improvement"):
                text = f"the base's run {name} differs from its run {base.names[0]}: {finding.text}"
                yield replace(finding, kind="warning", text=text)


def _judged(old: Table, new: Table) -> list[Finding]:
    return _missing(old, new) + [finding for key in old if key in new for finding in _row(old[key], new[key])]


def _row(old: dict, new: dict) -> list[Finding]:
    findings = []
    if None not in (old["method_hash"], new["method_hash"]) and old["method_hash"] != new["method_hash"]:
        findings.append(Finding.about(new, "note", "method_hash", "the code of the method changed", frame=False))
    if old["status"] != new["status"]:
        return [*findings, _status(old, new)]
    if new["status"] in ("refused", *BROKEN):
        return [*findings, Finding.about(new, "note", "status", f"{new['status']}, as in the base")]
    if differs := _settings_differ(old, new):
        return [*findings, *differs]

    # Another mask means other pixels in every mean; a thousandth is the rasterizer's rounding.
    pixels = old["reflector_px"], new["reflector_px"]
    if None not in pixels and abs(pixels[1] - pixels[0]) > 2 + 1e-3 * pixels[0]:
        text = f"the mirror's mask had {pixels[0]} pixels and has {pixels[1]}: errors are means over other pixels"
        findings.append(Finding.about(new, "warning", "reflector_px", text))
    return [*findings, *gates.judged(old, new)]


def _status(old: dict, new: dict) -> Finding:
    text = f"was {old['status']}, is {new['status']}" + (f": {new['reason']}" if new["reason"] else "")
    if new["status"] in BROKEN:
        return Finding.about(new, "incomplete", "status", text)
    order = list(STATUSES)
    better = order.index(new["status"]) < order.index(old["status"])
    return Finding.about(new, "improvement" if better else "regression", "status", text)


# Times


def _timed(records: Sequence[dict | None]) -> bool:
    """Whether a row's times may be compared: it was measured in every run, under the same conditions."""
    first, *others = records
    if first is None or any(record is None or record["status"] != "ok" for record in records):
        return False
    return not any(_settings_differ(first, record) for record in others if record is not None)


def _paces(found: times.Times, old: Table, *, fail: bool) -> Iterator[Finding]:
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
