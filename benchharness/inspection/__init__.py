"""What a file or a config holds, in sentences and pictures, before anything is run: `benchharness inspect`.

A config is read as `run` reads it, and the first frame of each of its scenes is drawn. A mesh file is put into a scene of its
own: seen, beside a ball that mirrors it, and as a mirror itself.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from rich.console import Console

from benchharness import platform
from benchharness.assets import reading
from benchharness.inspection import trial
from benchharness.inspection.report import Note, of_scene
from benchharness.render import making
from benchharness.study import config as configs
from benchharness.study import methods, shipped
from benchharness.study.apart import Apart
from benchharness.tables.naming import safe_name

VARIANT = "llvm_ad_rgb"
BAKE_SPP = 64  # paths per vertex: enough to see what is lit


def examined(asked: Path, out: Path, size: tuple[int, int], console: Console) -> Iterator[Note]:
    """Notes on a mesh file or a config, by path or name. Pictures are written into the folder `out`; the console shows what is
    being done, and how long it takes yet.

    Raises ValueError for what cannot be run, with the reason, and for a size below 16 x 16 or above 4096 x 4096.
    """
    if min(size) < 16 or max(size) > 4096:
        raise ValueError(f"--size {size[0]} {size[1]}; accepted: 16 to 4096 pixels each")
    with console.status("reading") as status, making.told(making.teller(console, status)):
        with Apart(VARIANT) as apart:
            entries = methods.installed(apart, status.update)
        if asked.suffix.lower() in reading.SUFFIXES:
            platform.use_variant(VARIANT)
            asset = trial.read(asked)
            yield from (Note(text) for text in trial.described(asset))
            scenes = trial.scenes(asset)
        else:
            study = configs.load(shipped.config(asked), tell=status.update)
            platform.use_variant(VARIANT)
            scenes = ((job.scene.build(), job.notes) for job in study.jobs)
        out.mkdir(parents=True, exist_ok=True)
        for scene, notes in scenes:
            picture = out / f"{safe_name(scene.name)}.png"
            yield from of_scene(scene, notes, entries, size, picture, BAKE_SPP, status.update)
