"""What a case costs and what it leaves: error against the path-traced reference, and the time of whole frames."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from benchharness import platform
from benchharness.api import Method
from benchharness.measure import contract, host, metrics, runup, timing
from benchharness.needs import cases
from benchharness.needs.knee import Error, error_of, knee_of
from benchharness.render import reference
from benchharness.render.frame import FrameRenderer
from benchharness.scene import Scene
from benchharness.tables.needs import ENDS, NUMBERS

ROUNDS = 5  # of the last frame, of which the median is taken


@dataclass(frozen=True)
class Setting:
    """How everything is rendered."""

    size: tuple[int, int]
    frames: list[int]
    options: reference.ReferenceOptions
    seed: int


@dataclass(frozen=True, eq=False)
class _Shown:
    """Of several frames: error maps and the pixels they hold in, shares that were answered, vertices that were searched where
    a method tells them; and the last frame."""

    maps: list[np.ndarray]
    masks: list[np.ndarray]
    found: list[float]
    searched: list[int]
    last: runup.Step


class Unanswered(Exception):
    """What a method refuses, or fails in: `status` is "refused" or "crashed", and the text is the reason."""

    def __init__(self, status: str, reason: str) -> None:
        super().__init__(reason)
        self.status = status


@contextlib.contextmanager
def _answering(method: Method, scene: Scene) -> Iterator[None]:
    refused = contract.refusal(method, scene)
    if refused is not None:
        raise Unanswered("refused", refused)
    try:
        yield
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # a plugin may raise what is no Exception
        raise Unanswered("crashed", contract.account(error)) from error


class Bench:
    """A scene and its references; renderers are kept as long as the scene is the same. `waits` hears of it when another process
    is timing on this machine, and this one would."""

    def __init__(self, scene: Scene, setting: Setting, waits: Callable[[str], None] = lambda text: None) -> None:
        self.scene, self.setting, self._waits = scene, setting, waits
        self._drawn: tuple[Scene, FrameRenderer] | None = None

    def renderer(self, scene: Scene) -> FrameRenderer:
        if self._drawn is None or self._drawn[0] is not scene:
            self._drawn = scene, FrameRenderer(scene, *self.setting.size)
        return self._drawn[1]

    def truth(self, index: int, more: dict) -> reference.Reference:
        """The reference of a frame; it is cached. `more`: options of its own."""
        setting, time = self.setting, self.scene.time(index)
        return reference.render(self.scene, time, setting.size, replace(setting.options, **more), setting.seed)

    def measured(self, scene: Scene, method: Method, more: dict) -> dict:
        """A row of SAMPLES, without what names it. What a method refuses or fails in is its status."""
        try:
            with _answering(method, scene):
                shown = self._shown(scene, method, more)
                error = error_of(shown.maps, shown.masks)
            with platform.alone(self._waits), _answering(method, scene):
                ms = _frame_ms(self.renderer(scene), method, scene, shown.last)
        except Unanswered as unanswered:
            return {"status": unanswered.status, "reason": str(unanswered)}
        return {
            "status": "ok",
            "vertices": scene.vertices,
            "searched": int(np.mean(shown.searched)) if shown.searched else None,
            "flip": error.mean,
            "flip_lo": error.low,
            "flip_hi": error.high,
            "coverage": float(np.nanmean(shown.found)),
            "frame_ms": ms,
        }

    def error(self, scene: Scene, method: Method) -> Error:
        """The error of cold frames. Raises Unanswered for what a method refuses or fails in."""
        with _answering(method, scene):
            shown = self._shown(scene, method, {}, warm=False)
            return error_of(shown.maps, shown.masks)

    def _shown(self, scene: Scene, method: Method, more: dict, *, warm: bool = True) -> _Shown:
        """`warm`: whether frames have a run-up, and so something to start from."""
        renderer, maps, masks, found, searched = self.renderer(scene), [], [], [], []
        state = method.prepare(scene)
        for index in self.setting.frames:
            frames = [renderer.render(i) for i in (runup.numbers(index, scene.frames) if warm else [index])]
            *_, last = runup.carried(scene, method, state, frames)
            truth, answer = self.truth(index, more), host.answer(last.frame, last.reflection)
            image = host.image(renderer.compose(last.frame, last.reflection.L), last.frame)
            mask = truth.mask & answer.mirror
            maps.append(metrics.flip_map(image, truth.image, mask, ppd=scene.ppd, exposure=scene.exposure))
            masks.append(mask)
            found.append(answer.found[mask].mean() if mask.any() else np.nan)
            if (steps := last.reflection.counters.get("iterations")) is not None:
                searched.append(np.count_nonzero(np.array(steps)))
        return _Shown(maps, masks, found, searched, last)


def _frame_ms(renderer: FrameRenderer, method: Method, scene: Scene, last: runup.Step) -> float:
    """Time of a frame in which everything that can move does: G-buffer, update, reflection and composite."""
    index, view = last.frame.index, last.frame.view
    moves = any(part.motion is not None for part in scene.parts)

    def work() -> tuple:
        frame = renderer.draw(index, view)
        state = method.update(last.outdated, frame) if moves else last.before
        reflection, state = method.shade(state, frame)
        return renderer.compose(frame, reflection.L), reflection.distance, reflection.found, state

    timing.warm_up(work)
    return float(np.median([timing.timed(work)[1] for _ in range(ROUNDS)]))


def turned(bench: Bench, scene: str, turn: cases.Turn, say: Callable[[str], None]) -> tuple[list[dict], dict | None]:
    """The rows of a knob, and that of its knee; None where fewer than two values were measured."""
    rows = []
    for value, (made, method) in zip(turn.values, turn.cases, strict=True):
        say(f"{scene}: {turn.method}, {turn.knob} {value}")
        named = {"scene": scene, "method": turn.method, "knob": turn.knob, "given": turn.given, "value": value}
        rows.append({**named, **bench.measured(made(), method, turn.truth)})
    good = [row for row in rows if row["status"] == "ok"]
    if len(good) < 2:
        return rows, None
    knee = good[knee_of([Error(row["flip"], row["flip_lo"], row["flip_hi"]) for row in good])]
    least, most = good[0], good[-1]
    told = {name: good[0][name] for name in ("scene", "method", "knob", "given")}
    for end, row in zip(ENDS, (least, knee, most), strict=True):
        told |= {end: row["value"], **{f"{end}_{name}": row.get(name) for name in NUMBERS}}
    return rows, told
