"""What a file or a config holds, in sentences and pictures, before anything is run: `benchharness inspect`.

A config is read as `run` reads it, and the first frame of each of its scenes is drawn. A mesh file is put into a scene of its
own: seen, beside a ball that mirrors it, and as a mirror itself.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

from benchharness import platform
from benchharness.assets import reading
from benchharness.inspection import trial
from benchharness.inspection.report import Note, of_scene
from benchharness.study import config as configs
from benchharness.study import methods, shipped
from benchharness.study.apart import Apart
from benchharness.tables.naming import safe_name

VARIANT = "llvm_ad_rgb"
BAKE_SPP = 64  # paths per vertex: enough to see what is lit


def examined(asked: Path, out: Path, size: tuple[int, int], say: Callable[[str], None]) -> Iterator[Note]:
    """Notes on a mesh file or a config, by path or name. Pictures are written into the folder `out`; `say` hears what is being
    done. Raises ValueError for what cannot be run, with the reason, and for a size below 16 x 16 or above 4096 x 4096."""
    if min(size) < 16 or max(size) > 4096:
        raise ValueError(f"--size {size[0]} {size[1]}; accepted: 16 to 4096 pixels each")
    with Apart(VARIANT) as apart:
        entries = methods.installed(apart, say)
    if asked.suffix.lower() in reading.SUFFIXES:
        platform.use_variant(VARIANT)
        asset = trial.read(asked)
        yield from (Note(text) for text in trial.described(asset))
        scenes = trial.scenes(asset)
    else:
        study = configs.load(shipped.config(asked), tell=say)
        platform.use_variant(VARIANT)
        scenes = ((job.scene.build(), job.notes) for job in study.jobs)
    out.mkdir(parents=True, exist_ok=True)
    for scene, notes in scenes:
        yield from of_scene(scene, notes, entries, size, out / f"{safe_name(scene.name)}.png", BAKE_SPP, say)
