"""The tables of the stability suite, read as texts."""

from __future__ import annotations

from pathlib import Path

from benchharness.tables import files


def read(path: Path) -> list[dict[str, str]]:
    """The rows of a table, with `label`: the method and its setting, as it is called on the command line and on the page.

    Raises ValueError where there is no table, or it has no rows.
    """
    if not path.is_file():
        raise ValueError(f"{path}: there is no such file; accepted: a folder of the stability suite")
    rows = files.read(path, {})
    if not rows:
        raise ValueError(f"{path}: no rows; accepted: the results of the stability suite")
    return [{**row, "label": f"{row['method']} {row['setting']}".strip()} for row in rows]
