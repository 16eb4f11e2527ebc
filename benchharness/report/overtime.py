"""The part of the stability page about time and about changes that are none: tables, curves, strips, animated pictures."""

from __future__ import annotations

import base64
import io
from pathlib import Path

import jinja2
from markupsafe import Markup
from PIL import Image

from benchharness.report import motion
from benchharness.report.chart import inline
from benchharness.tables.columns import VERDICTS
from benchharness.tables.stability import read

STRIP_QUALITY = 60  # of WebP; a page carries 170 strips
COLUMNS = (
    "flip temporal_diff pops jitter_px image_jitter_px image_floor_px root_switches converge_changes iterations_mean spike"
).split()
JUMP_COLUMNS = "flip temporal_diff spike recovery other_roots cold_flip".split()


def sections(folder: Path) -> list[tuple[str, str, Markup]]:
    """(title, anchor, what it shows) of the studies that a folder of the suite has beside the atlas."""
    found = []
    if (folder / "motion.csv").is_file():
        found.append(("Over time", "motion", _motion(folder)))
    if (folder / "perturbation.csv").is_file():
        found.append(("Changes that are none", "perturbation", _perturbation(folder)))
    return found


def _motion(folder: Path) -> Markup:
    rows, frames = read(folder / "motion.csv"), folder / "motion-frames.csv"
    scenes = list(dict.fromkeys(row["scene"] for row in rows))
    tables = []
    for scene in scenes:
        own = [row for row in rows if row["scene"] == scene]
        steady, jumps = ([row for row in own if (row["kind"] == "steady") == still] for still in (True, False))
        pictures = [(row, *(_data(file) for file in motion.files(folder / "images", row))) for row in own]
        tables.append((scene, steady, jumps, [p for p in pictures if p[1] or p[2]]))
    curves = Markup("")
    if frames.is_file():
        curves = inline(motion.changes(read(frames)))
    return rendered("motion.html.jinja", tables=tables, columns=COLUMNS, jump_columns=JUMP_COLUMNS, curves=curves)


def _perturbation(folder: Path) -> Markup:
    rows = read(folder / "perturbation.csv")
    kinds = list(dict.fromkeys((row["kind"], row["size"]) for row in rows))
    methods, scenes = (list(dict.fromkeys(row[key] for row in rows)) for key in ("label", "scene"))
    found = {(row["scene"], row["kind"], row["label"]): row for row in rows}
    return rendered("perturbation.html.jinja", kinds=kinds, methods=methods, scenes=scenes, found=found)


def rendered(template: str, **values: object) -> Markup:
    """A template of this folder; it knows `verdicts`, and the filter `short` for numbers of a table."""
    loader = jinja2.FileSystemLoader(Path(__file__).parent)
    page = jinja2.Environment(loader=loader, autoescape=True, undefined=jinja2.StrictUndefined)
    page.filters["short"] = lambda text: f"{float(text):.3g}" if text else ""
    return Markup(page.get_template(template).render(verdicts=VERDICTS, **values))


def _data(file: Path | None) -> str:
    """A picture as a data: URL, strips as WebP; empty for none."""
    if file is None:
        return ""
    content = file.read_bytes()
    if file.suffix == ".png":
        out = io.BytesIO()
        Image.open(file).save(out, "WEBP", quality=STRIP_QUALITY)
        content = out.getvalue()
    return f"data:image/webp;base64,{base64.b64encode(content).decode()}"
