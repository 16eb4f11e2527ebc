"""Measures methods on one scene, frame by frame: three clocks, errors against the reference, and what vertices tell.

A frame is measured at the end of a run-up: the method shades the frames just before it, cold at the first, so that what
it carries from frame to frame is there, and so that the numbers do not depend on which frames were measured before.
Rounds are interleaved over the methods, so that drift of the machine hits all alike.
"""

from __future__ import annotations

import traceback
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import drjit as dr
import numpy as np

from benchharness import metrics, reference, results, timing, truth
from benchharness.api import Frame, Method, Reflection, Vertices
from benchharness.frame import FrameRenderer
from benchharness.orientation import oriented
from benchharness.ready import ready
from benchharness.regime import Seen
from benchharness.scene import Scene, refined

RUN_UP = 2  # frames shaded before the one that is measured; jitter is a second difference and needs both
VERTEX_SAMPLE = 150  # vertices per reflector whose true reflection point is solved for
WRONG_PX = 2.0  # further off than this is the wrong point, not an inaccurate one
KERNEL_ROUNDS = 3


@dataclass
class _Entry:
    """A method on this scene. `state` is what `prepare` returned; `broken` why it stopped."""

    method: Method
    state: Any = None
    prepare_ms: float | None = None
    first_ms: float | None = None
    broken: str | None = None
    outdated: Any = None
    """State before the last update of the run-up: what updates are timed from."""
    before: Any = None
    """State after the run-up and, if something moved, the update: what the measured frame is shaded from."""
    shown: list[tuple[np.ndarray, Reflection]] = field(default_factory=list)
    samples: dict[str, list[float]] = field(default_factory=dict)
    error: np.ndarray | None = None
    """FLIP map of the last frame."""


DARK = 3e-4  # of display white: the first step of eight bits in sRGB
MOSTLY = 0.5  # of the mirrors' pixels
OTHER_MASK = 0.02  # share of the mirrors' pixels that may be a mirror's in one of frame and reference alone, and
OTHER_MASK_PX = 32  # as many always may: edges run through pixels' centres


class Bench:
    """One scene at one size. `out`: folder of the pictures of the next frame, None for none; see `benchharness.worker`."""

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
        self.entries: dict[str, _Entry] = {}

    def prepare(self, index: int) -> None:
        """Renders what a frame is measured against, so that the cache has it."""
        self._frames(index)

    def run_frame(
        self, index: int, methods: Mapping[str, Method], watch: Callable[[str], None]
    ) -> tuple[list[dict], list[dict]]:
        """Records and samples of one frame; see `benchharness.worker.Bench`."""
        frames, references = self._frames(index)
        entries = {name: self.entries.setdefault(name, _Entry(method)) for name, method in methods.items()}
        for name, entry in entries.items():
            with self._guarded(name, entry, watch):
                self._run_up(entry, frames)
                if entry.broken is None:
                    _warm_up(entry, frames[-1])
        common = self._timed(entries, frames[-1], watch)
        calibration = {"calibration_ms": float(np.median(common["calibration"]))}
        records = []
        for name, entry in entries.items():
            record = _trusted(self._record(entry, frames, references)) | calibration
            clocks = self._clocks(entry, frames, common) if entry.broken is None else {}
            records.append({"entry": name, **record, **clocks})
        if self.out is not None:
            self._keep_pictures(index, entries, methods, references[-1])
        return records, list(_samples(entries, common))

    def show(self, index: int, name: str, method: Method) -> tuple[dict, Seen | None]:
        """What a method shows of one frame: the measured columns but for the clocks, and the pictures; None if it crashed."""
        frames, references = self._frames(index)
        frames = [replace(frame, doubts=True) for frame in frames]
        entry = _Entry(method)
        with self._guarded(name, entry, lambda entry: None):
            self._run_up(entry, frames)
        record = self._record(entry, frames, references)
        return record, None if entry.broken is not None else self._seen(entry, frames[-1], references[-1], record)

    def _frames(self, index: int) -> tuple[list[Frame], list[reference.Reference]]:
        """A frame with its run-up, and the references of the last two."""
        chain = run_up(index, self.scene.frames)
        frames = [self.renderer.render(i) for i in chain]
        return frames, [
            reference.render(self.scene, self.scene.time(i), self.size, self.options, self.seed) for i in chain[-2:]
        ]

    @contextmanager
    def _guarded(self, name: str, entry: _Entry, watch: Callable[[str], None]) -> Iterator[None]:
        """A method's exception ends that method on this scene and nothing else."""
        watch(name)
        try:
            yield
        except Exception as error:  # whatever a plugin may raise
            traceback.print_exc()
            entry.broken = f"{type(error).__name__}: {error}"
        watch("")

    def _run_up(self, entry: _Entry, frames: list[Frame]) -> None:
        """Prepares where that is still to do, and shades the frames in order, the last one included."""
        entry.shown, entry.samples = [], {"update": [], "shade": []}
        if entry.broken is not None:
            return
        if entry.state is None:
            entry.state, entry.prepare_ms = timing.timed(lambda: entry.method.prepare(self.scene))
        entry.outdated = entry.state
        state, _ = timing.timed(lambda: entry.method.update(entry.state, frames[0]))
        for previous, frame in zip([None, *frames], frames, strict=False):
            if previous is not None and self.scene.moves(previous.time, frame.time):
                entry.outdated = state
                state, _ = timing.timed(lambda state=state, frame=frame: entry.method.update(state, frame))
            entry.before = state
            (reflection, state), ms = timing.timed(lambda state=state, frame=frame: entry.method.shade(state, frame))
            entry.first_ms = ms if entry.first_ms is None else entry.first_ms
            check_lanes(reflection, frame)
            image = self._picture(self.renderer.compose(frame, reflection.L))
            entry.shown.append((image, reflection))

    def _timed(self, entries: dict[str, _Entry], frame: Frame, watch: Callable[[str], None]) -> dict[str, list[float]]:
        """Interleaved rounds of everything; what no method owns is returned: G-buffer, composite, calibration."""
        common: dict[str, list[float]] = {"gbuffer": [], "composite": [], "calibration": []}
        running = {name: entry for name, entry in entries.items() if entry.broken is None}
        view = frame.view
        for _ in range(3):
            self.renderer.draw(frame.index, view)
        least, most = self.rounds
        for number in range(most):
            common["calibration"].append(timing.calibration_ms())
            common["gbuffer"].append(timing.timed(lambda: self.renderer.draw(frame.index, view).pixels)[1])
            for name, entry in running.items():
                if entry.broken is not None:
                    continue
                with self._guarded(name, entry, watch):
                    self._round(entry, frame, number < least)
            L = next((e.shown[-1][1].L for e in running.values() if e.broken is None), None)
            if L is not None:
                common["composite"].append(timing.timed(lambda L=L: self.renderer.compose(frame, L))[1])
            if number + 1 >= least and all(e.broken or timing.settled(e.samples["shade"]) for e in running.values()):
                break
        for name, entry in running.items():
            if entry.broken is None:
                with self._guarded(name, entry, watch):
                    histories = [
                        timing.kernels_of(lambda entry=entry: _timed_part(entry.method.shade(entry.before, frame)))
                        for _ in range(KERNEL_ROUNDS)
                    ]
                    entry.samples["kernel"] = [timing.kernel_ms(history) for history in histories]
        return common

    @staticmethod
    def _round(entry: _Entry, frame: Frame, with_update: bool) -> None:
        if with_update:
            entry.samples["update"].append(timing.timed(lambda: entry.method.update(entry.outdated, frame))[1])
        shaded = timing.timed(lambda: _timed_part(entry.method.shade(entry.before, frame)))
        entry.samples["shade"].append(shaded[1])

    def _picture(self, image: Any) -> np.ndarray:
        return np.array(image, np.float32).T.reshape(self.size[1], self.size[0], 3)

    def _record(self, entry: _Entry, frames: list[Frame], references: list) -> dict:
        """The measured columns of one row, but for the clocks."""
        truth_ = references[-1]
        black = truth_.image.max(axis=2) * 2.0**self.scene.exposure < DARK
        facts = {
            "reflector_px": len(frames[-1].pixels),
            "reference_px": int(truth_.mask.sum()),
            "mask_diff_px": int((truth_.mask ^ np.array(frames[-1].active).reshape(truth_.mask.shape)).sum()),
            "dark_px": int((truth_.mask & black).sum()),
            "back_px": int((truth_.mask & truth_.back).sum()),
            "reference_spp": references[-1].spp,
            "reference_noise": metrics.noise(references[-1], ppd=self.scene.ppd, exposure=self.scene.exposure),
        }
        if entry.broken is not None:
            return {"status": "crashed", "reason": entry.broken, **facts}
        record = {"status": "ok", **facts, **self._errors(entry, frames, references)}
        record["counters"] = results.params_text(
            {name: int(np.array(count, np.int64).sum()) for name, count in entry.shown[-1][1].counters.items()}
        )
        if record["nonfinite_px"]:
            record |= {"status": "invalid", "reason": f"{record['nonfinite_px']} pixels are NaN, infinite or negative"}
        return record

    def _clocks(self, entry: _Entry, frames: list[Frame], common: dict[str, list[float]]) -> dict:
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

    def _errors(self, entry: _Entry, frames: list[Frame], references: list) -> dict:
        image, reflection = entry.shown[-1]
        truth_ = references[-1]
        shape = truth_.mask.shape
        mask = truth_.mask & np.array(frames[-1].active).reshape(shape)
        found = np.broadcast_to(np.array(reflection.found), mask.size).reshape(shape)
        distance = np.broadcast_to(np.array(reflection.distance), mask.size).reshape(shape)
        seen_at = {"ppd": self.scene.ppd, "exposure": self.scene.exposure}
        entry.error = metrics.flip_map(image, truth_.image, mask, **seen_at)
        record: dict[str, Any] = metrics.evaluate(image, truth_.image, mask, **seen_at, found=found, error=entry.error)
        record |= self._second(entry.error, truth_.second & mask)
        record["distance_err"] = metrics.distance_error(distance, truth_.distance, mask & found)
        record["nonfinite_px"] += int((np.isnan(distance) & mask & found).sum())
        if len(references) > 1:
            both = mask & references[0].mask & np.array(frames[-2].active).reshape(shape)
            pictures = (entry.shown[-2][0], image, references[0].image, truth_.image)
            record["temporal_diff"] = metrics.temporal_diff(*pictures, both)
        if reflection.vertices is not None:
            record |= self._vertices(entry, frames)
        return record

    def _seen(self, entry: _Entry, frame: Frame, truth_: reference.Reference, record: dict) -> Seen:
        """The last frame that `entry` showed, beside the reference; lengths and places as the scene's author has them."""
        image, reflection = entry.shown[-1]
        unit = self.scene.unit
        shape = truth_.mask.shape
        mask = truth_.mask & np.array(frame.active).reshape(shape)
        found, doubt, distance = (
            np.broadcast_to(np.array(a), mask.size).reshape(shape)
            for a in (reflection.found, False if reflection.doubt is None else reflection.doubt, reflection.distance)
        )
        assert entry.error is not None
        return Seen(
            image, truth_.image, mask, truth_.reflector, found, doubt, unit * distance, unit * truth_.distance, entry.error,
            None if reflection.vertices is None else self._arrays(reflection.vertices), record, self.given, frame.time,
        )  # fmt: skip

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

    def _vertices(self, entry: _Entry, frames: list[Frame]) -> dict:
        """What the reflection points found are worth: screen distances to the true ones, of a sample of vertices."""
        found = entry.shown[-1][1].vertices
        assert found is not None
        count = self.scene.vertices
        iterations = np.array(found.iterations)
        searched = iterations > 0
        converged = np.array(found.converged)
        record: dict[str, Any] = {
            "iterations_mean": float(iterations[searched].mean()) if searched.any() else None,
            "iterations_max": int(iterations.max()) if searched.any() else None,
            "converged_ratio": converged_share(converged, np.array(found.region), iterations),
        }
        off, errors = [], []
        for number in range(len(self.scene.reflectors)):
            here = np.flatnonzero(converged[number * count : (number + 1) * count])
            if not len(here):
                continue
            sample = here[:: max(1, len(here) // VERTEX_SAMPLE)]
            tracks = [self._off(f, shown[1], number, sample) for f, shown in zip(frames, entry.shown, strict=True)]
            off.append(tracks[-1][0])
            errors.append(np.stack([track[1] for track in tracks]))
        if off:
            distance = np.concatenate(off)
            known = distance[np.isfinite(distance)]
            record["residual_px"] = float(np.median(known)) if len(known) else None
            record["residual_px_max"] = float(known.max()) if len(known) else None
            record["wrong_ratio"] = float((known > WRONG_PX).mean()) if len(known) else None
            if len(frames) == RUN_UP + 1:
                record["jitter_px"] = metrics.jitter_px(np.concatenate(errors, axis=1))
        return record

    def _off(self, frame: Frame, reflection: Reflection, number: int, sample: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Pixels between found and true R [N], and V' on the screen less the true one's [N, 2]; NaN where none is known."""
        lanes = number * self.scene.vertices + sample
        assert reflection.vertices is not None
        R, virtual = (np.array(a, np.float64).T[lanes] for a in (reflection.vertices.R, reflection.vertices.virtual))
        usable = np.array(reflection.vertices.converged)[lanes]
        seen = truth.roots(self.scene, frame.time, self.size, number, sample, R, virtual, usable)
        return np.linalg.norm(seen.found - seen.true, axis=1), seen.virtual - seen.image

    def _keep_pictures(self, index: int, entries: dict[str, _Entry], methods: Mapping[str, Method], truth_: Any) -> None:
        """The reference, every method's picture and its error map, as PNG."""
        assert self.out is not None
        self.out.mkdir(parents=True, exist_ok=True)
        scene, exposure = self.scene, self.scene.exposure
        names = (scene.name, scene.detail, index)
        metrics.save_png(self.out / results.image_name(*names, "reference"), metrics.tonemap(truth_.image, exposure))
        for name, entry in entries.items():
            if entry.broken is None and entry.error is not None:
                method, _, params = name.partition(" ")
                image = entry.shown[-1][0]
                error = metrics.error_picture(entry.error)
                for kind, pixels in (("image", metrics.tonemap(image, exposure)), ("error", error)):
                    metrics.save_png(self.out / results.image_name(*names, kind, method, params), pixels)


def _trusted(record: dict) -> dict:
    """The record, its status "invalid" where its errors are against nothing that a method could be judged by."""
    if record["status"] != "ok":
        return record
    shown, union = record["reference_px"], max(record["reflector_px"], record["reference_px"])
    reason = None
    if record["mask_diff_px"] > OTHER_MASK_PX + OTHER_MASK * union:
        both = f"frame ({record['reflector_px']}) and reference ({shown})"
        reason = f"{record['mask_diff_px']} pixels are a mirror's in only one of {both}"
    elif record["dark_px"] > MOSTLY * shown:
        reason = f"the reference is black in {record['dark_px']} of the mirrors' {shown} pixels"
    elif record["back_px"] > MOSTLY * shown:
        reason = f"{record['back_px']} of the mirrors' {shown} pixels show backs of objects, which have no light of their own"
    return record if reason is None else record | {"status": "invalid", "reason": reason}


def check_lanes(reflection: Reflection, frame: Frame) -> None:
    """Raises ValueError for an answer that has neither one lane per pixel nor one for all."""
    pixels = frame.view.width * frame.view.height
    for name in ("L", "distance", "found", "doubt"):
        if name == "doubt" and reflection.doubt is None:
            continue
        lanes = dr.width(getattr(reflection, name))
        if lanes not in (1, pixels):
            raise ValueError(f"{name} has {lanes} lanes; accepted: {pixels}, one per pixel")


def _warm_up(entry: _Entry, frame: Frame) -> None:
    timing.warm_up(lambda: entry.method.update(entry.outdated, frame))
    timing.warm_up(lambda: _timed_part(entry.method.shade(entry.before, frame)))


def converged_share(converged: np.ndarray, region: np.ndarray, iterations: np.ndarray) -> float | None:
    """Share that converged of the vertices that were searched and are not hidden, None if there are none; [N] each, as in
    `benchharness.api.Vertices`. A search that came to nothing leaves its vertex in region 0."""
    counted = (region == 1) | ((region == 0) & (iterations > 0))
    return float(converged[counted].mean()) if counted.any() else None


def run_up(index: int, frames: int) -> list[int]:
    """Frames to shade in order, `index` last: those just before it, or, at the start of the animation, those just after."""
    if index >= RUN_UP:
        return [index - 2, index - 1, index]
    return [i for i in (index + 2, index + 1) if i < frames] + [index]


def _timed_part(shaded: tuple[Reflection, Any]) -> tuple:
    """What a frame needs of `shade`: the picture and the state that the next frame starts from."""
    reflection, state = shaded
    return reflection.L, reflection.distance, reflection.found, state


def _samples(entries: dict[str, _Entry], common: dict[str, list[float]]) -> Iterator[dict]:
    owned = [("", common), *((name, entry.samples) for name, entry in entries.items())]
    for name, clocks in owned:
        for clock, values in clocks.items():
            yield from ({"entry": name, "clock": clock, "round": i, "ms": ms} for i, ms in enumerate(values))
