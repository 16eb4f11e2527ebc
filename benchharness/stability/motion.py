"""What happens over time: a stretch of every animation at a fine step, a camera cut, and things that jump.

A row of motion.csv is one scene, one kind of run (`film`) and one method with its parameters; motion-frames.csv has a
row per frame. State is carried from frame to frame as in a real run: prepared once, updated when something moved.

All numbers are inside the mirrors, without pixels of second reflections, and means over the run's frames unless said:

    temporal_diff    `metrics.temporal_diff`; `pops`: `metrics.pops`; across a jump neither is counted
    jitter_px        `metrics.jitter_px` of the images V' of a sample of vertices, of methods that report them, while their
                     true reflection points are inside the picture; `jitter_median_px`: the median in place of the rms
    image_jitter_px  the same of the images of whole objects (`markers`), of all methods; `image_floor_px`: what sampling alone
                     may do to it; `image_off_px`: how far they are from where they should be; `images`: how many are followed,
                     `images_lost`: of those, how many were gone in some frame
    root_switches    share of those vertices, per frame, whose R left the true reflection point that it was at: it moved by more
                     than `watch.SWITCH_PX` more than that did
    converge_changes share of searched vertices, per frame, that converged and had not, or had and did not
    spike            the most iterations (mean over searched vertices) of a frame, over their median; the first is not counted

and after a jump

    recovery         frames until the mean FLIP is at most `watch.RECOVERED` above that of a method that starts cold at that
                     frame: 0 where it is at once; empty where it never is in this run
    other_roots      share of sampled vertices that, in the last frame, have R more than SWITCH_PX from where a cold start has
                     it
    temporal_diff    of the frames on either side of the jump
"""

from __future__ import annotations

import itertools
import shlex
import traceback
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from benchharness.measure import metrics
from benchharness.stability import plan, strips
from benchharness.study import plugins
from benchharness.study.apart import Apart
from benchharness.study.methods import Entry
from benchharness.tables import naming

FILE, FRAMES_FILE = "motion.csv", "motion-frames.csv"
APIECE = 1  # groups that share a process
UNIT_S = 1.5  # about, on two cores
COLUMNS = (
    "scene kind method setting params status reason first jump frames substeps width height reflector_px "
    "flip temporal_diff temporal_diff_max pops pops_max coverage "
    "jitter_px jitter_median_px image_jitter_px image_floor_px image_off_px images images_lost "
    "root_switches converge_changes iterations_mean iterations_max spike recovery other_roots cold_flip command"
).split()
FRAME_COLUMNS = (
    "scene kind method setting params frame time reflector_px flip temporal_diff pops coverage iterations_mean iterations_max "
    "converge_changes root_switches cold_flip"
).split()


def units(entries: Sequence[Entry], asked: plan.Motion) -> dict[str, list[dict[str, Any]]]:
    """What is to be measured, by scene.

    Raises ValueError for an unknown kind of run and for a scene that is not there, or does not load.
    """
    for kind in asked.kinds:
        if kind not in plan.KINDS:
            raise ValueError(f"kind {kind!r}; accepted: {', '.join(plan.KINDS)}")
    names = asked.scenes or [name for name, site in plugins.sites("scene").items() if site.offers]
    with Apart() as apart:
        for name in names:
            apart.call("benchharness.stability.film:checked", f"--scene {name}", name=name)
    options = {"count": asked.frames, "substeps": asked.substeps, "start": asked.start, "size": list(asked.size)}
    options |= {"followed": asked.followed, "places": asked.places}
    return {
        name: [{"scene": name, "kind": kind, "entry": asdict(entry), **options} for kind in asked.kinds for entry in entries]
        for name in names
    }


def work(units: Sequence[dict[str, Any]], folder: Path) -> Iterator[dict[str, Any]]:
    """Measures units of one scene; see `benchharness.stability.children`. Pictures go to `folder`."""
    from benchharness.measure import contract
    from benchharness.stability import film, markers, watch

    what = "scene kind count substeps start size followed places".split()
    for asked, group in itertools.groupby(units, lambda unit: [unit[key] for key in what]):
        name, kind, count, substeps, start, (width, height), followed, places = asked
        seen = film.film(name, kind, count, substeps, start, (width, height))
        marked = markers.Markers(seen, places, followed) if kind == "steady" else None
        for unit in group:
            entry = Entry(**unit["entry"])
            method = contract.made(entry.build, seen.scene)
            if isinstance(method, contract.Out):
                yield asdict(method)
                continue
            try:
                shown = watch.run(seen, method)
                record = watch.measured(seen, shown) | (watch.followed(marked, method) if marked else {})
            except Exception as error:  # whatever a plugin may raise
                traceback.print_exc()
                yield {"status": "crashed", "reason": contract.account(error)}
                continue
            _keep_pictures(folder, name, kind, plan.label(entry), seen, shown)
            yield record


def row(unit: Mapping[str, Any], record: Mapping[str, Any]) -> dict[str, Any]:
    """The row of `FILE`."""
    only = shlex.quote(plan.label(Entry(**unit["entry"])))
    command = f"benchharness stability --study motion --scene {shlex.quote(unit['scene'])} --only {only}"
    width, height = unit["size"]
    known = {column: record.get(column) for column in COLUMNS}
    return known | _about(unit) | {"substeps": unit["substeps"], "width": width, "height": height, "command": command}


def frame_rows(unit: Mapping[str, Any], record: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The rows of `FRAMES_FILE`; none for a unit that did not come to an end."""
    return [{column: frame.get(column) for column in FRAME_COLUMNS} | _about(unit) for frame in record.get("per_frame", [])]


def _about(unit: Mapping[str, Any]) -> dict[str, Any]:
    entry = Entry(**unit["entry"])
    about = {"scene": unit["scene"], "kind": unit["kind"], "method": entry.method}
    return about | {"setting": plan.setting(entry), "params": entry.params_text}


def _keep_pictures(folder: Path, scene: str, kind: str, label: str, film: Any, shown: Any) -> None:
    def viewed(images: list[np.ndarray]) -> list[np.ndarray]:
        return [metrics.tonemap(image, film.scene.exposure) for image in images]

    method, truth = viewed(shown.images), viewed([r.image for r in film.references])
    box = strips.crop([r.mask for r in film.references])
    file = folder / naming.picture_name(f"{scene}-{kind}", film.first, label)
    errors = [metrics.error_picture(error) for error in shown.errors]
    chosen = strips.chosen(film.count, None if film.jump is None else film.jump - film.first)
    metrics.save_png(file, strips.strip(method, truth, errors, box, chosen))
    if kind == "steady":
        file.with_suffix(".webp").write_bytes(strips.animated(method, truth, box))
