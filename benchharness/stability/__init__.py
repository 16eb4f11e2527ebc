"""The stability suite: where methods fail, whether they say so, and whether they come back.

    benchharness stability [CONFIG] [--only METHOD] [--regime NAME] [--severity X] [--plugin FILE] [--out DIR]

Three studies, each a table in the run's folder, in processes of their own (`children`):

    stability.csv      `atlas`: every method in every regime of `scenes.stress`, from mild to severe
    stability.html     all of it on one page
    images/            what was seen, and the reference
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path

from benchharness import platform, results


def run(
    out: Path, config: Path | None = None, extra: Sequence[str] = (), only: Sequence[str] = (), regime: Sequence[str] = (),
    severity: float | None = None, tell: Callable[[str], None] = print,
) -> tuple[int, Path]:  # fmt: skip
    """Runs the suite. Returns how many rows of the atlas fail silently, and the page.

    Raises ValueError for an unknown method, regime or severity, and for a folder that is in use.
    """
    from benchharness.stability import atlas, children, plan, tables

    platform.use_variant(children.VARIANT)
    planned = plan.load(config, extra, only, regime)
    groups = atlas.units(planned.entries, planned.regimes, severity)
    if (out / atlas.FILE).exists():
        raise ValueError(f"{out} holds a run already; accepted: a new folder")
    images = out / "images"
    images.mkdir(parents=True, exist_ok=True)
    rows = []
    for name, done in children.run("atlas", groups, images):
        fresh = [atlas.row(unit, record) for unit, record in done]
        rows += fresh
        seen = Counter(row["verdict"] for row in fresh)
        tell(f"{name}: " + ", ".join(f"{seen[v]} {v}" for v in results.VERDICTS if v in seen))
        tables.write(out / atlas.FILE, rows, atlas.COLUMNS)
    from benchharness.report import matrix

    return sum(row["verdict"] == "fails" for row in rows), matrix.write(out)
