"""Measures methods on one scene, frame by frame: three clocks, errors against the reference, and what vertices tell.

A frame is measured at the end of a run-up: the method shades the frames just before it, cold at the first, so that what
it carries from frame to frame is there, and so that the numbers do not depend on which frames were measured before. Errors
and counters are the run-up's; times are taken afterwards, on frames beside the measured one (`benchharness.measure.rounds`).

All that a method can make fail is inside of what takes that for its own failure.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchharness.api import Frame, Method, Vertices
from benchharness.measure import contract, host, metrics, points, runup, status, timing
from benchharness.measure.entry import Entry, guarded
from benchharness.measure.rounds import Rounds, kept
from benchharness.regime import Seen
from benchharness.render import reference
from benchharness.render.frame import FrameRenderer
from benchharness.render.orientation import oriented
from benchharness.render.ready import ready
from benchharness.scene import Scene, refined
from benchharness.tables import naming, parameters

DARK = 3e-4  # of display white: the first step of eight bits in sRGB


class Bench:
    """One scene at one size. `out`: folder of the pictures of the next frame, None for none; see `execution.worker`."""

    def __init__(
        self,
        scene: Scene,
        size: tuple[int, int],
        options: reference.ReferenceOptions,
        out: Path | None,
        seed: int,
        rounds: tuple[int, int],
    ) -> None:
        self.scene = ready(scene, options.bake_spp, seed)
        self.given = refined(oriented(scene)[0])
        self.size, self.options, self.out, self.seed, self.rounds = size, options, out, seed, rounds
        self.renderer = FrameRenderer(self.scene, *size)
        self.entries: dict[str, Entry] = {}

    def prepare(self, index: int) -> None:
        """Renders what a frame is measured against, so that the cache has it."""
        self._frames(index)

    def run_frame(
        self, index: int, methods: Mapping[str, Method], watch: Callable[[str], None]
    ) -> tuple[list[dict], list[dict]]:
        """Records and samples of one frame; see `benchharness.execution.worker.Bench`."""
        frames, references = self._frames(index)
        facts = self._facts(frames, references)
        entries = {name: self.entries.setdefault(name, Entry(method)) for name, method in methods.items()}
        prints, rounds = _prints(frames), Rounds(self.renderer, frames, self.rounds)
        measured, pictures = {}, {}
        for name, entry in entries.items():
            if entry.broken is not None:
                continue
            entry.begin()
            with guarded(name, entry, watch):
                self._run_up(entry, frames)
                rounds.warm_up(entry)
                measured[name] = self._measured(entry, frames, references)
                pictures[name] = self._pictures(entry) if self.out is not None else {}
            if self._harmed(entry, frames, prints):
                frames, _ = self._frames(index)
                prints, rounds = _prints(frames), Rounds(self.renderer, frames, self.rounds)
        common = rounds.run(entries, watch)
        shared = {"calibration_ms": float(np.median(common["calibration"]))} | facts
        records = []
        for name, entry in entries.items():
            if entry.broken is not None:
                records.append({"entry": name, **status.crashed(entry), **shared})
                continue
            record = status.trusted(status.sound({**measured[name], **shared}, kept(entry, frames[-1])))
            records.append({"entry": name, **record, **self._clocks(entry, frames, common)})
        if self.out is not None:
            whole = {name: pictures[name] for name, entry in entries.items() if entry.broken is None}
            self._keep_pictures(index, whole, references[-1])
        return records, list(_samples(entries, common))

    def show(self, index: int, name: str, method: Method) -> tuple[dict, Seen | None]:
        """What a method shows of one frame: the measured columns but for the clocks, and the pictures; None if it crashed."""
        frames, references = self._frames(index)
        frames = [replace(frame, doubts=True) for frame in frames]
        facts, prints, entry = self._facts(frames, references), _prints(frames), Entry(method)
        record, seen = {}, None
        with guarded(name, entry, lambda entry: None):
            entry.begin()
            self._run_up(entry, frames)
            record = status.sound({**self._measured(entry, frames, references), **facts}, None)
            seen = self._seen(entry, frames[-1], references[-1], record)
        self._harmed(entry, frames, prints)
        return (record, seen) if entry.broken is None else ({**status.crashed(entry), **facts}, None)

    def _frames(self, index: int) -> tuple[list[Frame], list[reference.Reference]]:
        """A frame with its run-up, and the references of the last two."""
        chain = runup.numbers(index, self.scene.frames)
        frames = [self.renderer.render(i) for i in chain]
        return frames, [
            reference.render(self.scene, self.scene.time(i), self.size, self.options, self.seed) for i in chain[-2:]
        ]

    def _run_up(self, entry: Entry, frames: list[Frame]) -> None:
        """Prepares where that is still to do, and shades the frames in order, the last one included."""
        if entry.state is None:
            entry.state, entry.prepare_ms = timing.timed(lambda: entry.method.prepare(self.scene))
        for step in runup.carried(self.scene, entry.method, entry.state, frames):
            entry.outdated, entry.before = step.outdated, step.before
            entry.first_ms = step.ms if entry.first_ms is None else entry.first_ms
            image = self.renderer.compose(step.frame, step.reflection.L)
            entry.shown.append((host.image(image, step.frame), step.reflection))

    def _harmed(self, entry: Entry, frames: list[Frame], prints: list[dict[str, int]]) -> bool:
        """Whether a method wrote into the memory of `frames`, whose fingerprints were `prints`; it is out then, and what
        renders frames is another one."""
        harm = [contract.written(before, frame) for before, frame in zip(prints, frames, strict=True)]
        if not any(harm):
            return False
        entry.broken = f"it writes into memory that all methods are lent: {next(filter(None, harm))} of the frame"
        self.renderer = FrameRenderer(self.scene, *self.size)
        return True

    def _facts(self, frames: list[Frame], references: list[reference.Reference]) -> dict:
        """The measured columns of one row that no method has a part in."""
        truth_ = references[-1]
        black = truth_.image.max(axis=2) * 2.0**self.scene.exposure < DARK
        return {
            "reflector_px": len(frames[-1].pixels),
            "reference_px": int(truth_.mask.sum()),
            "mask_diff_px": int((truth_.mask ^ host.plane(frames[-1].active, frames[-1])).sum()),
            "dark_px": int((truth_.mask & black).sum()),
            "back_px": int((truth_.mask & truth_.back).sum()),
            "reference_spp": truth_.spp,
            "reference_noise": metrics.noise(truth_, ppd=self.scene.ppd, exposure=self.scene.exposure),
        }

    def _measured(self, entry: Entry, frames: list[Frame], references: list[reference.Reference]) -> dict:
        """The columns that tell of the answer."""
        counters = parameters.params_text(contract.counted(entry.shown[-1][1]))
        return {**self._errors(entry, frames, references), "counters": counters}

    def _clocks(self, entry: Entry, frames: list[Frame], common: dict[str, list[float]]) -> dict:
        shade_ms, low, high = timing.median_interval(entry.samples["shade"])
        update_ms, gbuffer_ms = float(np.median(entry.samples["update"])), float(np.median(common["gbuffer"]))
        moves = len(frames) > 1 and self.scene.moves(frames[-2].time, frames[-1].time)
        return {
            "prepare_ms": entry.prepare_ms,
            "update_ms": update_ms,
            "shade_ms": shade_ms,
            "shade_ms_lo": low,
            "shade_ms_hi": high,
            "kernel_ms": float(np.median(entry.samples["kernel"])),
            "first_ms": entry.first_ms,
            "gbuffer_ms": gbuffer_ms,
            "frame_ms": gbuffer_ms + moves * update_ms + shade_ms + float(np.median(common["composite"])),
        }

    def _errors(self, entry: Entry, frames: list[Frame], references: list) -> dict:
        image, reflection = entry.shown[-1]
        truth_, said = references[-1], host.answer(frames[-1], reflection)
        mask, found, distance = truth_.mask & said.mirror, said.found, said.distance
        seen_at = {"ppd": self.scene.ppd, "exposure": self.scene.exposure}
        entry.error = metrics.flip_map(image, truth_.image, mask, **seen_at)
        record: dict[str, Any] = metrics.evaluate(image, truth_.image, mask, **seen_at, found=found, error=entry.error)
        record |= self._second(entry.error, truth_.second & mask)
        record["distance_err"] = metrics.distance_error(distance, truth_.distance, mask & found)
        record["nonfinite_px"] += int(((np.isnan(distance) | (distance < 0)) & mask & found).sum())
        if len(references) > 1:
            both = mask & references[0].mask & host.plane(frames[-2].active, frames[-2])
            pictures = (entry.shown[-2][0], image, references[0].image, truth_.image)
            record["temporal_diff"] = metrics.temporal_diff(*pictures, both)
        if reflection.vertices is not None:
            answers = [reflection for _, reflection in entry.shown]
            record |= points.errors(self.scene, self.size, frames, answers)
        return record

    def _seen(self, entry: Entry, frame: Frame, truth_: reference.Reference, record: dict) -> Seen:
        """The last frame that `entry` showed, beside the reference; lengths and places as the scene's author has them."""
        image, reflection = entry.shown[-1]
        said, unit = host.answer(frame, reflection), self.scene.unit
        assert entry.error is not None
        return Seen(
            image=image,
            truth=truth_.image,
            mask=truth_.mask & said.mirror,
            reflector=truth_.reflector,
            found=said.found,
            doubt=said.doubt,
            distance=unit * said.distance,
            length=unit * truth_.distance,
            error=entry.error,
            vertices=None if reflection.vertices is None else self._arrays(reflection.vertices),
            record=record,
            scene=self.given,
            time=frame.time,
        )

    def _arrays(self, vertices: Vertices) -> dict[str, Any]:
        """The fields as arrays [N] or [N, 3]; of `further`, a list of such."""
        arrays = {f.name: np.array(getattr(vertices, f.name)).T for f in fields(vertices) if f.name != "further"}
        for name in ("R", "virtual"):
            arrays[name] = self.scene.unit * arrays[name].astype(np.float64) + self.scene.origin
        return {**arrays, "further": [self._arrays(more) for more in vertices.further]}

    def _second(self, error: np.ndarray, second: np.ndarray) -> dict:
        """How many pixels show a second reflection, bool [H, W], and the mean error there if the reference shows it too."""
        one_bounce = self.options.lighting == "baked" and self.options.depth <= 2
        mean = None if one_bounce or not second.any() else float(error[second].astype(np.float64).mean())
        return {"second_px": int(second.sum()), "flip_second": mean}

    def _pictures(self, entry: Entry) -> dict[str, np.ndarray]:
        """What the method shows, and its error map, kind -> uint8 [H, W, 3]."""
        assert entry.error is not None
        return {
            "image": metrics.tonemap(entry.shown[-1][0], self.scene.exposure),
            "error": metrics.error_picture(entry.error),
        }

    def _keep_pictures(self, index: int, pictures: Mapping[str, dict[str, np.ndarray]], truth_: reference.Reference) -> None:
        """Writes the reference and what `_pictures` made of every entry, as PNG."""
        assert self.out is not None
        self.out.mkdir(parents=True, exist_ok=True)
        names = (self.scene.name, self.scene.detail, index)
        shown = metrics.tonemap(truth_.image, self.scene.exposure)
        metrics.save_png(self.out / naming.image_name(*names, "reference"), shown)
        for name, kinds in pictures.items():
            method, _, params = name.partition(" ")
            for kind, pixels in kinds.items():
                metrics.save_png(self.out / naming.image_name(*names, kind, method, params), pixels)


def _prints(frames: list[Frame]) -> list[dict[str, int]]:
    return [contract.fingerprint(frame) for frame in frames]


def _samples(entries: dict[str, Entry], common: dict[str, list[float]]) -> Iterator[dict]:
    owned = [("", common), *((name, entry.samples) for name, entry in entries.items())]
    for name, clocks in owned:
        for clock, values in clocks.items():
            yield from ({"entry": name, "clock": clock, "round": i, "ms": ms} for i, ms in enumerate(values))
