"""Records and the files of a run folder.

A record is a dict with the keys of COLUMNS, one per scene, frame, method and parameters. This module alone knows how
records become CSV, what the files of a run are called, and where a run came from.

In a CSV a number is finite and at least 0, or its cell is empty: a number without meaning (None, NaN or infinite here) is
never 0. Floats are written by `repr`, so that what is read is bit for bit what was written. Every file is written beside its
place and renamed into it.
"""

from __future__ import annotations

import contextlib
import csv
import hashlib
import importlib.metadata
import io
import json
import math
import os
import platform
import re
import shutil
import statistics
import subprocess
import tempfile
from collections.abc import Collection, Iterable, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

COLUMNS = (
    "run config scene detail frame method params variant status reason "
    "vertices triangles reflectors reflector_px "
    "prepare_ms update_ms shade_ms shade_ms_lo shade_ms_hi kernel_ms first_ms gbuffer_ms frame_ms "
    "rmse relmse flip flip_p95 coverage nonfinite_px distance_err "
    "residual_px converged_ratio wrong_ratio iterations_mean iterations_max temporal_diff jitter_px "
    "reference_lighting reference_spp reference_noise config_hash method_hash scene_hash environment "
    "calibration_ms ppd counters residual_px_max second_px flip_second reference_px mask_diff_px dark_px back_px"
).split()
"""Columns of results.csv, in order. `residual_px` is a median over vertices; `counters` is the canonical `name=value` list;
`calibration_ms` the fixed kernel; `second_px` counts the mask's pixels whose reflected ray meets a reflector first, and
`flip_second` is the mean of the FLIP map over those, without meaning against a reference of one bounce;
`reference_noise` the mean FLIP inside the mask that the reference's own noise causes (the unit of `flip`);
`reference_px` counts the mirrors' pixels in the reference, `mask_diff_px` those that are a mirror's in only one of frame and
reference, `dark_px` those where the reference is black, `back_px` those that show the back of an object first."""

REQUIRED = COLUMNS[: COLUMNS.index("environment") + 1]
"""Columns without which a results.csv is not one; later ones may be missing in a file and read as None."""

KEY = ("scene", "detail", "frame", "method", "params")
STATUSES = ("ok", "refused", "invalid", "timeout", "crashed")
"""From best to worst; a summary shows the worst of its frames."""
VERDICTS = ("holds", "degrades", "fails", "refuses")
"""Of the stability suite, see `benchharness.stability.atlas.verdict`."""

INTEGERS = frozenset(
    "frame vertices triangles reflectors reflector_px nonfinite_px iterations_max reference_spp second_px "
    "reference_px mask_diff_px dark_px back_px "
    "round frames frames_ok frames_in_view".split()
)
TEXTS = frozenset(
    "run config scene detail method params variant status reason reference_lighting "
    "config_hash method_hash scene_hash environment counters clock".split()
)

TIMES = "prepare_ms update_ms shade_ms shade_ms_lo shade_ms_hi kernel_ms first_ms gbuffer_ms frame_ms".split()
ERRORS = (
    "rmse relmse flip flip_p95 coverage distance_err residual_px converged_ratio wrong_ratio iterations_mean "
    "temporal_diff jitter_px residual_px_max flip_second"
).split()
SUMMARY_COLUMNS = [
    *"config scene detail method params status reason frames frames_ok frames_in_view ok_ratio".split(),
    *TIMES, *ERRORS, *"flip_min flip_max nonfinite_px iterations_max reference_noise calibration_ms second_px".split(),
    *"mask_diff_px dark_px back_px".split(),
]  # fmt: skip
"""Columns of summary.csv: medians of TIMES, means of ERRORS and `reference_noise`, the largest `iterations_max`, each
over the frames with status ok that have the number; `nonfinite_px`, `second_px` and
what follows are summed, over all frames."""

SAMPLE_COLUMNS = [*KEY, "clock", "round", "ms"]
"""Columns of samples.csv. `clock` is prepare, update, shade, kernel, gbuffer, calibration ...; `round` is from 0."""


# Keys and parameters


def key(record: Mapping) -> tuple:
    """What a record is about: (scene, detail, frame, method, params)."""
    return tuple(record[name] for name in KEY)


def params_text(mapping: Mapping[str, Any]) -> str:
    """Parameters as `name=value; name=value`, in the order given; floats by repr, strings plain."""
    parts = []
    for name, value in mapping.items():
        text = value if isinstance(value, str) else repr(value.item() if hasattr(value, "item") else value)
        if not name.isidentifier() or "; " in text or text != text.strip() or "\n" in text:
            accepted = "an identifier, and a value without '; ', outer blanks or line ends"
            raise ValueError(f"parameter {name!r} = {text!r}; accepted: {accepted}")
        parts.append(f"{name}={text}")
    return "; ".join(parts)


def parse_params(text: str | None) -> dict[str, int | float | bool | str | None]:
    """The inverse of `params_text`; what looks like an int, float, True, False or None becomes one."""
    out: dict[str, int | float | bool | str | None] = {}
    for part in (text or "").split("; ") if text else []:
        name, equals, value = part.partition("=")
        if not equals or not name.isidentifier():
            raise ValueError(f"parameters {text!r}: {part!r} is not name=value; accepted: name=value; name=value")
        out[name] = _literal(value)
    return out


def _literal(text: str) -> int | float | bool | str | None:
    if text in ("True", "False", "None"):
        return {"True": True, "False": False, "None": None}[text]
    for kind in (int, float):
        with contextlib.suppress(ValueError):
            return kind(text)
    return text


# Names


def image_name(scene: str, detail: str, frame: int, kind: str, method: str | None = None, params: str | None = None) -> str:
    """File name of a picture in `images/`.

    kind   "reference", "image" (a method's picture) or "error" (its FLIP map); PNG, the sRGB picture as it is looked
           at. An error map is either coloured already or one channel, where 0 .. 255 is FLIP 0 .. 1.
    params hashed to 8 hex digits when present. Names that are not safe in a file system get a hash of their own.
    """
    if kind not in ("reference", "image", "error"):
        raise ValueError(f"image kind {kind!r}; accepted: 'reference', 'image', 'error'")
    if (kind == "reference") != (method is None):
        raise ValueError(f"image kind {kind!r} with method {method!r}; accepted: a method for all but the reference")
    parts = [safe_name(scene), safe_name(detail), f"{frame:04d}", kind]
    if method is not None:
        parts.append(safe_name(method))
    if params:
        parts.append(hashlib.sha256(params.encode()).hexdigest()[:8])
    return "-".join(parts) + ".png"


def picture_name(regime: str, severity: float, label: str) -> str:
    """Name of a picture of the stability suite."""
    return safe_name(f"{regime}-{severity:g}-{label}") + ".png"


def safe_name(text: str) -> str:
    """`text` if it is safe as part of a file name, else its safe letters and a hash, so that no two collide."""
    if re.fullmatch(r"[A-Za-z0-9_]{1,64}", text):
        return text
    return re.sub(r"[^A-Za-z0-9_]+", "_", text)[:48].strip("_") + "_" + hashlib.sha256(text.encode()).hexdigest()[:8]


def short_hash(value: Any) -> str:
    """12 hex digits of a JSON value's content, whatever the order of its keys."""
    return hashlib.sha256(json.dumps(value, sort_keys=True, ensure_ascii=False).encode()).hexdigest()[:12]


# Reading and writing


def write_atomic(path: Path, text: str) -> None:
    """Writes beside the place and renames: a crash leaves the old file or the new one, never half of one."""
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(handle, "w", encoding="utf-8", newline="") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        os.chmod(temporary, 0o644)
        os.replace(temporary, path)
    except BaseException:
        os.unlink(temporary)
        raise


def write_table(path: Path, rows: Iterable[Mapping], columns: Sequence[str]) -> None:
    """Rows to CSV. Missing keys, None and what is not finite are empty; a key that is no column raises ValueError."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    for number, row in enumerate(rows):
        unknown = [name for name in row if name not in columns]
        if unknown:
            raise ValueError(f"{path.name}: row {number} has {unknown[0]!r}; accepted: {', '.join(columns)}")
        writer.writerow([_cell(name, row.get(name)) for name in columns])
    write_atomic(path, text.getvalue())


def _cell(column: str, value: Any) -> str:
    if hasattr(value, "item"):
        value = value.item()
    if value is None or (isinstance(value, float) and not math.isfinite(value)):
        return ""
    if column in TEXTS:
        return str(value).replace("\r", "").replace("\n", " ")
    if isinstance(value, str | bool) or (column in INTEGERS and value != int(value)):
        raise ValueError(f"column {column!r} is {value!r}; accepted: {_kind(column)}")
    return str(int(value)) if column in INTEGERS else repr(value)


def _kind(column: str) -> str:
    return "an integer" if column in INTEGERS else "a number"


def read_table(path: Path, columns: Sequence[str], required: Sequence[str], lenient: Collection[str] = ()) -> list[dict]:
    """CSV to rows with the keys `columns`; empty cells are None, but empty `params` and `detail` are "".

    lenient  columns in which NaN and infinity are read as they are; refused in all others

    Columns of the file that are not among `columns` are left out. Raises ValueError where the file is missing, is no
    CSV, lacks a required column or names one twice, or holds something else in place of a number.
    """
    try:
        with path.open(encoding="utf-8", newline="") as file:
            lines = list(csv.reader(file, strict=True))
    except OSError as error:
        raise ValueError(f"{path}: {error.strerror or error}; accepted: a run folder or its CSV file") from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise ValueError(f"{path}: not a table ({error}); accepted: a CSV file in UTF-8") from None
    header = lines[0] if lines else []
    if missing := [name for name in required if name not in header]:
        raise ValueError(f"{path}: missing columns: {', '.join(missing)}; accepted: at least {', '.join(required)}")
    if twice := [name for name in columns if header.count(name) > 1]:
        raise ValueError(f"{path}: column {twice[0]!r} is there twice; accepted: every column once")
    rows = []
    for line, cells in enumerate(lines[1:], start=2):
        if len(cells) != len(header):
            raise ValueError(f"{path}: line {line} has {len(cells)} cells; accepted: {len(header)}, as in the header")
        values: dict[str, Any] = {name: "" if name in ("params", "detail") else None for name in columns}
        for name, cell in zip(header, cells, strict=True):
            if name in values and cell:
                values[name] = cell if name in TEXTS else _number(path, line, name, cell, name in lenient)
        rows.append(values)
    return rows


LARGEST = 2**63 - 1
"""Of the integers, counters included."""


def _number(path: Path, line: int, column: str, cell: str, lenient: bool) -> int | float:
    try:
        value = float(cell)
        value = int(cell) if column in INTEGERS and math.isfinite(value) else value
    except ValueError:
        value = None
    if value is None or "_" in cell or not _within(value, lenient):
        where = f"{path}: line {line}, column {column!r}"
        raise ValueError(f"{where} is {shorten(cell)}; accepted: {_kind(column)} of at least 0, or empty")
    return value


def _within(value: int | float, lenient: bool) -> bool:
    if isinstance(value, int):
        return 0 <= value <= LARGEST
    return value >= 0 if math.isfinite(value) else lenient


def shorten(text: str) -> str:
    """`text` in quotes, cut where it is long: what a message quotes of a file."""
    return repr(text if len(text) <= 60 else text[:57] + "...")


def write_results(run: Path, records: Sequence[Mapping]) -> None:
    """results.csv and summary.csv of a run folder. `params` and `detail` are text, "" where there are none."""
    for record in records:
        if record["status"] not in STATUSES:
            raise ValueError(f"status {record['status']!r} of {key(record)}; accepted: {', '.join(STATUSES)}")
    write_table(run / "results.csv", records, COLUMNS)
    write_table(run / "summary.csv", summary(records), SUMMARY_COLUMNS)


def read_results(path: Path, lenient: Collection[str] = ()) -> list[dict]:
    """Records of a run folder, or of a CSV file with the columns of results.csv.

    lenient  columns that may hold NaN and infinity, as of `read_table`; "counters" among them

    Raises ValueError with file, line and column of what is damaged.
    """
    file = path / "results.csv" if path.is_dir() else path
    records = read_table(file, COLUMNS, REQUIRED, lenient)
    for line, record in enumerate(records, start=2):
        _check_record(record, f"{file}: line {line}", "counters" in lenient)
    return records


def _check_record(record: Mapping, where: str, lenient: bool) -> None:
    """Raises ValueError for a record that does not say what it is about, or whose counters are no numbers."""
    if record["status"] not in STATUSES:
        raise ValueError(f"{where}, column 'status' is {shorten(record['status'] or '')}; accepted: {', '.join(STATUSES)}")
    for name in ("scene", "method"):
        if record[name] is None:
            raise ValueError(f"{where}, column {name!r} is empty; accepted: what the row is about")
    try:
        counters = parse_params(record["counters"])
    except ValueError:
        said = shorten(record["counters"])
        raise ValueError(f"{where}, column 'counters' is {said}; accepted: name=value; name=value") from None
    for name, value in counters.items():
        if isinstance(value, bool) or not isinstance(value, int | float) or not _within(value, lenient):
            said = shorten(str(value))
            raise ValueError(f"{where}, column 'counters': {name} is {said}; accepted: a number of at least 0")


def write_samples(run: Path, samples: Iterable[Mapping]) -> None:
    write_table(run / "samples.csv", samples, SAMPLE_COLUMNS)


def read_samples(run: Path) -> list[dict]:
    """Every raw time of a run folder; empty where it has no samples.csv."""
    file = run / "samples.csv"
    return read_table(file, SAMPLE_COLUMNS, SAMPLE_COLUMNS) if file.is_file() else []


# Over frames


def present(records: Iterable[Mapping], column: str) -> list:
    """The numbers of a column, without those that have no meaning."""
    values = (record.get(column) for record in records)
    return [v for v in values if v is not None and not (isinstance(v, float) and math.isnan(v))]


def summary(records: Iterable[Mapping]) -> list[dict]:
    """One row per (config, scene, detail, method, params), in order of appearance; see SUMMARY_COLUMNS."""
    groups: dict[tuple, list[Mapping]] = {}
    for record in records:
        group = tuple(record[name] for name in ("config", "scene", "detail", "method", "params"))
        groups.setdefault(group, []).append(record)
    return [_summarised(group, rows) for group, rows in groups.items()]


def _summarised(group: tuple, rows: list[Mapping]) -> dict:
    ok = [row for row in rows if row["status"] == "ok"]
    worst = max(rows, key=lambda row: STATUSES.index(row["status"]))
    flips = present(ok, "flip")
    out: dict[str, Any] = dict(zip(("config", "scene", "detail", "method", "params"), group, strict=True))
    out.update(status=worst["status"], reason=worst.get("reason"), frames=len(rows), frames_ok=len(ok))
    out["frames_in_view"] = sum(value > 0 for value in present(rows, "reflector_px"))
    out["ok_ratio"] = len(ok) / len(rows)
    for name in (*TIMES, "calibration_ms"):
        out[name] = statistics.median(values) if (values := present(ok, name)) else None
    for name in (*ERRORS, "reference_noise"):
        out[name] = statistics.fmean(values) if (values := present(ok, name)) else None
    out.update(flip_min=min(flips, default=None), flip_max=max(flips, default=None))
    for name in ("nonfinite_px", "second_px", "mask_diff_px", "dark_px", "back_px"):
        out[name] = sum(values) if (values := present(rows, name)) else None
    out["iterations_max"] = max(present(ok, "iterations_max"), default=None)
    return out


# Where a run came from


def environment(variant: str | None = None) -> dict:
    """Machine, software and source of this process; `None` where the machine does not say."""
    versions = {}
    for name in "mitsuba drjit numpy scipy pandas trimesh flip-evaluator karellen-llvm-core benchharness".split():
        with contextlib.suppress(importlib.metadata.PackageNotFoundError):
            versions[name] = importlib.metadata.version(name)
    commit = _git("rev-parse", "HEAD")
    return {
        "python": platform.python_version(),
        "platform": platform.platform(),
        "cpu": _cpu_model(),
        "cores": len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count(),
        "gpu": _gpu() if variant and variant.startswith("cuda") else None,
        "packages": versions,
        "llvm": os.environ.get("DRJIT_LIBLLVM_PATH"),
        "variant": variant,
        "commit": commit,
        "dirty": None if commit is None else bool(_git("status", "--porcelain", "--untracked-files=no")),
        "time": datetime.now(UTC).isoformat(timespec="seconds"),
    }


def environment_hash(values: Mapping) -> str:
    """The `environment` column: the same for two runs on the same machine with the same software.

    The time, the commit (`method_hash` and `scene_hash` follow the code) and the folder of LLVM are left out.
    """
    kept = {name: value for name, value in values.items() if name not in ("time", "commit", "dirty", "llvm")}
    kept["llvm"] = os.path.basename(values.get("llvm") or "")
    kept["packages"] = {name: v for name, v in values.get("packages", {}).items() if name != "benchharness"}
    return short_hash(kept)


def write_command(run: Path, config: Path, plugins: Sequence[str]) -> None:
    """Keeps in command.json what made a run: the config's file, and the methods that were added by `--plugin`."""
    values = {"config": str(config.resolve()), "plugins": list(plugins)}
    write_atomic(run / "command.json", json.dumps(values, indent=2) + "\n")


def read_command(run: Path) -> dict[str, Any] | None:
    """What `write_command` kept in a run folder; None where there is none."""
    file = run / "command.json"
    if not file.is_file():
        return None
    try:
        values = json.loads(file.read_text(encoding="utf-8"))
        return {"config": str(values["config"]), "plugins": [str(plugin) for plugin in values["plugins"]]}
    except (ValueError, KeyError, TypeError) as error:
        raise ValueError(f"{file}: damaged ({error}); accepted: the file that the run wrote") from None


def write_environment(run: Path, values: Mapping) -> None:
    write_atomic(run / "environment.json", json.dumps(values, indent=2, ensure_ascii=False) + "\n")


def read_environment(run: Path) -> dict:
    """environment.json of a run folder; empty where there is none."""
    file = run / "environment.json"
    if not file.is_file():
        return {}
    try:
        values = json.loads(file.read_text(encoding="utf-8"))
    except ValueError as error:
        raise ValueError(f"{file}: not JSON ({error}); accepted: the file that the run wrote") from None
    if not isinstance(values, dict):
        raise ValueError(f"{file}: holds a {type(values).__name__}; accepted: a JSON object")
    return values


def _git(*arguments: str) -> str | None:
    """Output of git where this package lies, None where it lies in no repository of its own."""
    root = Path(__file__).resolve().parents[2]
    if not (root / ".git").exists() or shutil.which("git") is None:
        return None
    done = subprocess.run(["git", "-C", str(root), *arguments], capture_output=True, text=True, timeout=20, check=False)
    return done.stdout.strip() if done.returncode == 0 else None


def _cpu_model() -> str | None:
    with contextlib.suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or None


def _gpu() -> str | None:
    if shutil.which("nvidia-smi") is None:
        return None
    query = ["nvidia-smi", "--query-gpu=name,driver_version", "--format=csv,noheader"]
    done = subprocess.run(query, capture_output=True, text=True, timeout=20, check=False)
    return done.stdout.strip() if done.returncode == 0 else None
