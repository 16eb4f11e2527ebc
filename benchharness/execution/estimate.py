"""About how long a run will take, said before it begins; too long a one only begins if it was meant.

Measured on two cores of an AMD EPYC: four studies, 48 to 208 rows of 720 x 512 pixels, took 0.5 to 1.4 times as long as is said
here, with a cache that had their light. Light and full transport were measured apart, without a cache, in processor time of
both cores: in rooms (kitchen, kettle), where paths go on, 1.0 to 1.3 million segments a second either way, compiling
included; under an open sky (teapots), where they end early, 8 of transport and 31 of light. What is said is a room's.
Nothing is known of other machines, of methods that come as plugins, and of what the cache has.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from benchharness.render.making import in_words
from benchharness.study.config import Config, Job

TOO_LONG_S = 3600.0
"""A run that takes longer is to be asked for in so many words."""

SCENE_S = 6.0  # a process, its kernels, and the scene in it
ROW_S = 0.5  # a row, however small its picture
ROW_S_PER_MPX = 4.0  # its kernels, errors and pictures
ROUND_S_PER_MPX = 0.15
SEGMENTS_PER_S = 1.2e6  # of traced paths, of references and of light, in a room
BAKE_SEGMENTS = 6  # of a path, see `bake.bake`


def of_run(config: Config, left: Sequence[int]) -> tuple[str, float]:
    """What is left of a study, in words, and about how many seconds that takes. `left`: frames, by job."""
    rows = sum(frames * len(job.entries) for job, frames in zip(config.jobs, left, strict=True))
    seconds = sum(_of_job(config, job, frames) for job, frames in zip(config.jobs, left, strict=True) if frames)
    scenes = sum(frames > 0 for frames in left)
    return f"{rows} rows ({scenes} scenes, {sum(left)} frames, {len(config.entries)} methods with parameters)", seconds


def _of_job(config: Config, job: Job, frames: int) -> float:
    run, reference = config.run, config.reference
    pixels = run.size[0] * run.size[1]
    row_s = ROW_S + 1e-6 * pixels * (ROW_S_PER_MPX + ROUND_S_PER_MPX * (run.min_rounds + run.max_rounds) / 2)
    baked = reference["lighting"] == "baked"
    spp = 2 if baked and reference["filter"] == "center" else reference["spp"]
    depth = reference["max_depth"] or (2 if baked else 8)
    segments = 2 * frames * pixels * depth * spp  # two references per frame
    if baked:
        segments += job.facts["vertices"] * reference["bake_spp"] * BAKE_SEGMENTS
    return SCENE_S + segments / SEGMENTS_PER_S + frames * len(job.entries) * row_s


def agreed(what: str, seconds: float, tell: Callable[[str], None], *, yes: bool) -> None:
    """Tells what will be done. Raises ValueError where that takes too long and was not agreed to."""
    if seconds > TOO_LONG_S and not yes:
        raise ValueError(f"{what} take about {in_words(seconds)}; accepted: fewer of them, or --yes to begin all the same")
    tell(f"{what}: about {in_words(seconds)}")
