"""Where a run came from: the machine and its software (environment.json), and the command that made it (command.json)."""

from __future__ import annotations

import contextlib
import importlib.metadata
import json
import os
import platform
import shutil
import subprocess
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from benchharness.tables.files import write_atomic
from benchharness.tables.naming import short_hash


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
    """What `write_command` kept in a run folder; None where there is none. Raises ValueError for a damaged file."""
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
    """environment.json of a run folder; empty where there is none. Raises ValueError for a damaged one."""
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
    """The output of git where this package lies, None where it lies in no repository of its own."""
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
