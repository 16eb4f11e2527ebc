"""What changes from frame to frame that should not, and where the pictures of what moves are (`stability.strips`)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib as mpl
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from benchharness.report.chart import STYLE
from benchharness.report.points import looks
from benchharness.tables.naming import picture_name


def files(folder: Path, row: Mapping[str, str]) -> tuple[Path | None, Path | None]:
    """The strip and the animation of a row of motion.csv, in the folder of pictures; None where there is none."""
    if not row["first"]:
        return None, None
    still = folder / picture_name(f"{row['scene']}-{row['kind']}", float(row["first"]), row["label"])
    moving = still.with_suffix(".webp")
    return (still if still.is_file() else None), (moving if moving.is_file() else None)


def changes(rows: Sequence[Mapping[str, str]], column: str = "temporal_diff") -> Figure:
    """A column of motion-frames.csv over the frames, a line per method; a row of panels per scene, a column per kind of run."""
    scenes, kinds = (list(dict.fromkeys(row[key] for row in rows)) for key in ("scene", "kind"))
    styles = looks([{"method": row["label"]} for row in rows])
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(3.6 * len(kinds) + 0.6, 2.0 * len(scenes) + 0.9), layout="constrained")
        panels = figure.subplots(len(scenes), len(kinds), squeeze=False, sharey="row")
        for (i, scene), (j, kind) in ((a, b) for a in enumerate(scenes) for b in enumerate(kinds)):
            axes = panels[i, j]
            for label, look in styles.items():
                own = [r for r in rows if (r["scene"], r["kind"], r["label"]) == (scene, kind, label)]
                # Empty where there is nothing to compare, as across a jump: the line has a gap there.
                x, y = [int(r["frame"]) for r in own], [float(r[column] or "nan") for r in own]
                axes.plot(x, y, color=look.colour, ls=look.dash[0], marker=look.marker[0], ms=2.5, lw=1.2, label=label)
            axes.set_title(f"{scene}: {kind}", fontsize=10)
            axes.xaxis.set_major_locator(MaxNLocator(integer=True, nbins=5))
            axes.set_ylim(bottom=0)
            axes.set_xlabel("frame" if i == len(scenes) - 1 else "")
            axes.grid(True)
        figure.supylabel(f"{column}   (↓ less is better)", fontsize=9)
        handles, names = panels[0, 0].get_legend_handles_labels()
        figure.legend(handles, names, loc="outside lower center", ncols=min(len(names), 4), fontsize=8)
    return figure
