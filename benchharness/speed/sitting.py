"""How fast is it really: our stages and whole frames against Embree's and llvmpipe's, on this machine, in one sitting.

`benchharness speed` times the kitchen: everything warm, in interleaved rounds. What is compared with what is in
`benchharness.speed.rivals`, what `--vertices` adds in `benchharness.speed.tessellation`, what `--iterations` adds in
`benchharness.speed.iterations`, what `--impostors` adds in `benchharness.speed.impostors`, and what `--complexity` adds in
`benchharness.speed.complexity`. Into the folder go

    speed.csv          a row per rival: medians, how many times as long the rival takes, with its 95 % interval
    samples.csv        every time behind them
    vertices.csv       a row per tessellation and method; vertices-fit.csv, vertices-samples.csv, vertices.png
    iterations.csv     a row per way to search; iterations.png
    impostors.csv      a row per number of a paper's tables and ours; impostors-samples.csv, impostor-edges.png,
                       impostor-cost.png
    complexity.csv     a row per mirror and method; complexity-samples.csv
    environment.json   machine, software, and what was asked for
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from benchharness import platform
from benchharness.scene import Scene, refined
from benchharness.tables import results

COLUMNS = "name ours_ms rival rival_ms ratio ratio_lo ratio_hi note".split()
"""Columns of speed.csv: medians over rounds; ratio = rival_ms / ours_ms, so that above 1 ours is faster."""
SAMPLE_COLUMNS = "name side round ms".split()
VARIANT = "llvm_ad_rgb"  # Embree's


def baked(name: str, **keywords: Any) -> Scene:
    """A scene as its builder makes it, baked and not yet refined."""
    from benchharness.render.bake import bake
    from benchharness.study import plugins

    return bake(plugins.find("scene", name, "speed").target(**keywords))


def kitchen(detail: str, moving: bool = False) -> Scene:
    """The scene that everything is timed on, but for impostors."""
    return baked("kitchen", detail=detail, moving=moving)


def impostor_scenes(detail: str, counts: Iterable[int]) -> tuple[Scene, dict[int, Scene], Scene]:
    """The fields of `impostors.Scenes`, with mirror spheres so many."""
    spheres = {count: baked("spheres", detail=detail, count=count, moving=False) for count in counts}
    return baked("bunnies", detail=detail), spheres, baked("teapots", detail=detail, moving=False)


def speed(
    out: Path,
    size: tuple[int, int],
    frame: int,
    detail: str,
    rounds: int,
    console: Console,
    vertices: bool = False,
    iterations: bool = False,
    impostors: bool = False,
    complexity: bool = False,
) -> None:
    """Times, prints and writes everything. Raises ValueError for numbers that make no sense and a folder in use."""
    for name, value, least in (("width", size[0], 1), ("height", size[1], 1), ("frame", frame, 0), ("rounds", rounds, 2)):
        if value < least:
            raise ValueError(f"speed: {name} is {value}; accepted: whole numbers from {least}")
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise ValueError(f"--out {out} is in use; accepted: an empty or a new folder")
    platform.use_variant(VARIANT)
    import drjit as dr

    from benchharness.speed import llvmpipe, rivals

    # Kernels are recorded for every scene and every side, which is more often than Dr.Jit finds natural, and warns.
    dr.set_log_level(dr.LogLevel.Error)
    still, moving = kitchen(detail), kitchen(detail, moving=True)
    if frame >= still.frames:
        raise ValueError(f"speed: frame is {frame}; accepted: 0 to {still.frames - 1}")
    out.mkdir(parents=True, exist_ok=True)
    with platform.alone(console.print):
        drawn = refined(still)
        try:
            gl = llvmpipe.Llvmpipe(drawn, drawn.time(frame), size)
        except llvmpipe.Unavailable as error:
            gl = str(error)
        compared = rivals.comparisons(drawn, refined(moving), size, frame, gl)
        with console.status("") as status:
            rows, samples = rivals.run(compared, rounds, lambda done: status.update(f"round {done} of {rounds}"))
        renderer = None if isinstance(gl, str) else gl.renderer
        if not isinstance(gl, str):
            gl.close()
        write_csv(out / "speed.csv", rows, COLUMNS)
        write_csv(out / "samples.csv", samples, SAMPLE_COLUMNS)
        asked = {"size": list(size), "frame": frame, "detail": detail, "rounds": rounds, "triangles": drawn.triangles}
        results.write_environment(out, {**results.environment(VARIANT), "opengl": renderer, "speed": asked})
        console.print(table(rows))
        if vertices:
            _vertices(out, size, frame, rounds, console)
        if iterations:
            _iterations(out, drawn, size, frame, console)
        if impostors:
            _impostors(out, size, detail, rounds, console)
        if complexity:
            _complexity(out, still, size, frame, rounds, console)
    console.print(str(out))


def _vertices(out: Path, size: tuple[int, int], frame: int, rounds: int, console: Console) -> None:
    from benchharness.speed import tessellation

    with console.status("") as status:
        found = tessellation.study({d: kitchen(d) for d in ("lean", "paper")}, size, frame, rounds, status.update)
    write_csv(out / "vertices.csv", found.rows, tessellation.COLUMNS)
    write_csv(out / "vertices-fit.csv", found.fits, tessellation.FIT_COLUMNS)
    write_csv(out / "vertices-samples.csv", found.samples, tessellation.SAMPLE_COLUMNS)
    tessellation.chart(found, out / "vertices.png")
    console.print(plain_table(found.rows, ("detail", "method", "vertices", "frame_ms", "flip")))
    console.print(plain_table(found.fits, tessellation.FIT_COLUMNS))


def _iterations(out: Path, scene: Scene, size: tuple[int, int], frame: int, console: Console) -> None:
    from benchharness.speed import iterations

    with console.status("") as status:
        cases = iterations.study(scene, size, frame, status.update)
    rows = [case.row() for case in cases]
    write_csv(out / "iterations.csv", rows, iterations.COLUMNS)
    iterations.chart(cases, out / "iterations.png")
    console.print(plain_table(rows, iterations.COLUMNS))


def _impostors(out: Path, size: tuple[int, int], detail: str, rounds: int, console: Console) -> None:
    from benchharness.speed import edges, popescu
    from benchharness.speed import impostors as study

    settings = popescu.Settings()
    with console.status("baking") as status:
        scenes = study.Scenes(*impostor_scenes(detail, settings.reflectors))
        found = study.study(scenes, size, rounds, status.update, settings)
    write_csv(out / "impostors.csv", found.rows, popescu.COLUMNS)
    write_csv(out / "impostors-samples.csv", found.samples, popescu.SAMPLE_COLUMNS)
    edges.strip(found.panels, out / "impostor-edges.png")
    study.chart(found.rows, out / "impostor-cost.png")
    console.print(plain_table(found.rows, ("table", "setting", "quantity", "ours", "unit", "paper")))


def _complexity(out: Path, scene: Scene, size: tuple[int, int], frame: int, rounds: int, console: Console) -> None:
    from benchharness.speed import complexity

    with console.status("") as status:
        rows, samples = complexity.study(scene, size, frame, rounds, status.update)
    write_csv(out / "complexity.csv", rows, complexity.COLUMNS)
    write_csv(out / "complexity-samples.csv", samples, complexity.SAMPLE_COLUMNS)
    console.print(plain_table(rows, ("shape", "dents", "triangles", "method", "shade_ms", "update_ms", "flip", "coverage")))


def write_csv(path: Path, rows: Iterable[Mapping[str, Any]], columns: Sequence[str]) -> None:
    """Numbers by `repr`, as in results.csv; what a row lacks is empty."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    for row in rows:
        values = (row.get(name, "") for name in columns)
        writer.writerow([value.item() if hasattr(value, "item") else value for value in values])
    results.write_atomic(path, text.getvalue())


def table(rows: Iterable[Mapping[str, Any]]) -> Table:
    """Without the notes, but for what could not be timed."""
    shown = Table("", "ours ms", "rival", "rival ms", "ratio", "95 %")
    last = None
    for row in rows:
        name, last = ("" if row["name"] == last else row["name"]), row["name"]
        numbers = ("", "", row["note"])
        if "ratio" in row:
            numbers = f"{row['rival_ms']:.2f}", f"{row['ratio']:.2f}", f"{row['ratio_lo']:.2f} to {row['ratio_hi']:.2f}"
        shown.add_row(name, f"{row['ours_ms']:.2f}", row["rival"], *numbers)
    return shown


def plain_table(rows: Iterable[Mapping[str, Any]], columns: Sequence[str]) -> Table:
    shown = Table(*columns)
    for row in rows:
        values = (row.get(name, "") for name in columns)
        shown.add_row(*(f"{value:.3f}" if isinstance(value, float) else str(value) for value in values))
    return shown
