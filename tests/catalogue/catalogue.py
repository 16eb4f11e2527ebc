"""The catalogue's figures beside this project's: `PYTHONPATH=tests python -m catalogue.catalogue`, from the repository's root.

The catalogue of failures and the description of algorithms quote what a prototype measured. Each of those figures is a row: it
is measured here with this project's kernels and accepted within an interval that has a reason, or another test pins it. What
papers claim without a figure is measured too, where a small experiment can say it.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

from catalogue.catalogue_row import Elsewhere, Row

from benchharness import platform


def table() -> list[Row | Elsewhere]:
    """Every row, by part. The parts import Mitsuba: LLVM has to be chosen before."""
    from catalogue import (
        catalogue_costs,
        catalogue_curves,
        catalogue_images,
        catalogue_pictures,
        catalogue_refraction,
        catalogue_searches,
        catalogue_secants,
        catalogue_steps,
        catalogue_triangles,
        catalogue_truths,
    )

    searches = (catalogue_truths, catalogue_searches, catalogue_secants, catalogue_triangles)
    claims = (catalogue_steps, catalogue_curves, catalogue_costs, catalogue_refraction, catalogue_pictures)
    parts = (*searches, catalogue_images, *claims)
    return [row for part in parts for row in part.ROWS]


def exists(tested: str) -> bool:
    """Whether a test "file::function" is there."""
    name, _, function = tested.partition("::")
    paths = Path(__file__).parents[1].rglob(name)
    return any(re.search(rf"^def {function}\(", path.read_text(), re.MULTILINE) for path in paths)


def line(row: Row | Elsewhere) -> tuple[str, bool]:
    """A row as text, and whether it is within its interval."""
    if isinstance(row, Elsewhere):
        good, ours, accepted = exists(row.tested), row.ours, row.tested
    else:
        value = float(row.measure())
        good, ours, accepted = row.low <= value <= row.high, f"{value:.4g}", f"{row.low:.4g} to {row.high:.4g}"
    cells = (row.entry, row.what, row.catalogue, ours, accepted, "within" if good else "OUTSIDE", row.why)
    return " | ".join(cells), good


def main() -> int:
    platform.use_variant("llvm_ad_rgb")
    print("entry | what | catalogue | here | accepted, or where tested | verdict | why")
    outside = 0
    for row in table():
        text, good = line(row)
        outside += not good
        print(text, flush=True)
    print(f"{outside} outside")
    return 1 if outside else 0


if __name__ == "__main__":
    sys.exit(main())
