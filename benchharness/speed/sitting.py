"""How fast is it really: our stages and whole frames against Embree's and llvmpipe's, on this machine, in one sitting.

`benchharness speed` times the kitchen: everything warm, in interleaved rounds. What is compared with what is in
`benchharness.speed.rivals`, what `--vertices` adds in `benchharness.speed.tessellation`, what `--iterations` adds in
`benchharness.speed.iterations`, what `--impostors` adds in `benchharness.speed.impostors`, and what `--complexity` adds in
`benchharness.speed.complexity`. Into the folder go

    speed.csv          a row per rival: medians, how many times as long the rival takes, with its 95 % interval
    samples.csv        every time behind them
    vertices.csv       a row per tessellation and method; vertices-fit.csv, vertices-samples.csv
    iterations.csv     a row per way to search; iterations-vertices.csv, how many vertices took how many steps, and
                       iterations-pictures.npz, where on the mirror
    impostors.csv      a row per number of a paper's tables and ours; impostors-samples.csv, impostor-edges.png
    complexity.csv     a row per mirror and method; complexity-samples.csv
    environment.json   machine, software, and what was asked for

of which `benchharness.report.speed` draws charts.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from benchharness import platform
from benchharness.scene import Scene, refined
from benchharness.tables import files, origin
from benchharness.tables.speed import FITS, IMPOSTORS, ITERATIONS, PICTURES, STEPS, VERTICES

COLUMNS = "name ours_ms rival rival_ms ratio ratio_lo ratio_hi note".split()
"""Columns of speed.csv: medians over rounds; ratio = rival_ms / ours_ms, so that above 1 ours is faster."""
SAMPLE_COLUMNS = "name side round ms".split()
VARIANT = "llvm_ad_rgb"  # Embree's


def baked(name: str, **keywords: Any) -> Scene:
    """A scene as its builder makes it, baked and not yet refined."""
    from benchharness.render.bake import bake
    from benchharness.study import plugins

    return bake(plugins.find("scene", name, "speed").target(**keywords))


def kitchen(detail: str, *, moving: bool = False) -> Scene:
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
    *,
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

    from benchharness.render import making
    from benchharness.speed import llvmpipe, popescu, rivals

    # Kernels are recorded for every scene and every side, which is more often than Dr.Jit finds natural, and warns.
    dr.set_log_level(dr.LogLevel.Error)
    # Light is baked before the machine is held: others may time meanwhile.
    with console.status("baking") as status, making.told(making.teller(console, status)):
        still, moving = kitchen(detail), kitchen(detail, moving=True)
        if frame >= still.frames:
            raise ValueError(f"speed: frame is {frame}; accepted: 0 to {still.frames - 1}")
        details = {d: kitchen(d) for d in ("lean", "paper")} if vertices else {}
        beside = impostor_scenes(detail, popescu.Settings().reflectors) if impostors else None
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
        files.write(out / "speed.csv", rows, COLUMNS)
        files.write(out / "samples.csv", samples, SAMPLE_COLUMNS)
        asked = {"size": list(size), "frame": frame, "detail": detail, "rounds": rounds, "triangles": drawn.triangles}
        origin.write_environment(out, {**origin.environment(VARIANT), "opengl": renderer, "speed": asked})
        console.print(table(rows))
        if vertices:
            _vertices(out, details, size, frame, rounds, console)
        if iterations:
            _iterations(out, drawn, size, frame, console)
        if beside is not None:
            _impostors(out, beside, size, rounds, console)
        if complexity:
            _complexity(out, still, size, frame, rounds, console)
    console.print(str(out))


def _vertices(
    out: Path, details: Mapping[str, Scene], size: tuple[int, int], frame: int, rounds: int, console: Console
) -> None:
    from benchharness.speed import tessellation

    with console.status("") as status:
        found = tessellation.study(details, size, frame, rounds, status.update)
    files.write(out / VERTICES, found.rows, tessellation.COLUMNS)
    files.write(out / FITS, found.fits, tessellation.FIT_COLUMNS)
    files.write(out / "vertices-samples.csv", found.samples, tessellation.SAMPLE_COLUMNS)
    console.print(plain_table(found.rows, ("detail", "method", "vertices", "frame_ms", "flip")))
    console.print(plain_table(found.fits, tessellation.FIT_COLUMNS))


def _iterations(out: Path, scene: Scene, size: tuple[int, int], frame: int, console: Console) -> None:
    from benchharness.speed import iterations

    with console.status("") as status:
        cases = iterations.study(scene, size, frame, status.update)
    rows = [case.row() for case in cases]
    files.write(out / ITERATIONS, rows, iterations.COLUMNS)
    files.write(out / STEPS, (row for case in cases for row in case.steps()), iterations.STEP_COLUMNS)
    np.savez_compressed(out / PICTURES, pictures=np.stack([case.picture for case in cases]))
    console.print(plain_table(rows, iterations.COLUMNS))


def _impostors(
    out: Path, scenes: tuple[Scene, dict[int, Scene], Scene], size: tuple[int, int], rounds: int, console: Console
) -> None:
    from benchharness.speed import edges, popescu
    from benchharness.speed import impostors as study

    with console.status("") as status:
        found = study.study(study.Scenes(*scenes), size, rounds, status.update, popescu.Settings())
    files.write(out / IMPOSTORS, found.rows, popescu.COLUMNS)
    files.write(out / "impostors-samples.csv", found.samples, popescu.SAMPLE_COLUMNS)
    edges.strip(found.panels, out / "impostor-edges.png")
    console.print(plain_table(found.rows, ("table", "setting", "quantity", "ours", "unit", "paper")))


def _complexity(out: Path, scene: Scene, size: tuple[int, int], frame: int, rounds: int, console: Console) -> None:
    from benchharness.speed import complexity

    with console.status("") as status:
        rows, samples = complexity.study(scene, size, frame, rounds, status.update)
    files.write(out / "complexity.csv", rows, complexity.COLUMNS)
    files.write(out / "complexity-samples.csv", samples, complexity.SAMPLE_COLUMNS)
    console.print(plain_table(rows, ("shape", "dents", "triangles", "method", "shade_ms", "update_ms", "flip", "coverage")))


def table(rows: Iterable[Mapping[str, Any]]) -> Table:
    """The rows of speed.csv without the notes, but for what could not be timed."""
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
