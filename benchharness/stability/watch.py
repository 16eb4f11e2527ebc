"""What a method shows of a film, and the numbers of `motion`."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from benchharness.api import Method, Reflection
from benchharness.kernels.pixels import WRONG_PX
from benchharness.measure import host, metrics, truth
from benchharness.measure.runup import carried
from benchharness.render.frame import FrameRenderer
from benchharness.stability.film import Film
from benchharness.stability.markers import Markers

SAMPLE = 60  # vertices whose true reflection points are followed, in all mirrors together
SWITCH_PX = 1.5 * WRONG_PX  # two answers are compared, each of which may be off a little: more than where one is wrong
MEANS = "reflector_px flip temporal_diff pops coverage iterations_mean converge_changes root_switches cold_flip".split()
RECOVERED = 0.005  # mean FLIP; a twentieth of `metrics.POP`


@dataclass
class Shown:
    """Frame by frame.

    images     radiance [H, W, 3]
    masks      `Film.mask`
    found      share of the mask with an answer
    errors     FLIP maps [H, W]
    vertices   fields of `Vertices` as arrays [N] or [N, 3]; none for methods without
    cold       by number of the frame: mean FLIP, and such fields, of a cold start there; see `run`
    """

    images: list[np.ndarray] = field(default_factory=list)
    masks: list[np.ndarray] = field(default_factory=list)
    found: list[float | None] = field(default_factory=list)
    errors: list[np.ndarray] = field(default_factory=list)
    vertices: list[dict[str, np.ndarray]] = field(default_factory=list)
    cold: dict[int, tuple[float | None, dict[str, np.ndarray] | None]] = field(default_factory=dict)


def run(film: Film, method: Method) -> Shown:
    """All frames in order; from a jump on once more from a cold start, until that is no better, and in the last."""
    renderer, state, shown = FrameRenderer(film.scene, *film.size), method.prepare(film.scene), Shown()
    frames = (renderer.render(i) for i in film.numbers)
    for k, step in enumerate(carried(film.scene, method, state, frames)):
        frame, reflection = step.frame, step.reflection
        image, mask = host.image(renderer.compose(frame, reflection.L), frame), film.mask(k, frame)
        shown.images.append(image)
        shown.masks.append(mask)
        shown.found.append(float(host.answer(frame, reflection).found[mask].mean()) if mask.any() else None)
        shown.errors.append(_error(film, k, image, mask))
        vertices = _vertices(reflection)
        if vertices is not None:
            shown.vertices.append(vertices)
    recovered = film.jump is None
    for i in () if film.jump is None else range(film.jump, film.first + film.count):
        if recovered and i != film.numbers[-1]:
            continue
        (step,) = carried(film.scene, method, state, [renderer.render(i)])
        k = i - film.first
        image = host.image(renderer.compose(step.frame, step.reflection.L), step.frame)
        error = _error(film, k, image, shown.masks[k])
        cold = _mean(error, shown.masks[k])
        shown.cold[i] = cold, _vertices(step.reflection)
        recovered |= _recovered(_mean(shown.errors[k], shown.masks[k]), cold)
    return shown


def _recovered(flip: float | None, cold: float | None) -> bool:
    return flip is not None and cold is not None and flip <= cold + RECOVERED


def measured(film: Film, shown: Shown) -> dict[str, Any]:
    """The record of a unit, `per_frame` included, but for the images of objects."""
    frames = [_frame(film, shown, k) for k in range(film.count)]
    bad = sum(
        int((~np.isfinite(image).all(axis=2) & mask).sum()) for image, mask in zip(shown.images, shown.masks, strict=True)
    )
    record: dict[str, Any] = {"status": "ok", "first": film.first, "jump": film.jump, "frames": film.count, "per_frame": frames}
    if bad:
        record |= {"status": "invalid", "reason": f"{bad} pixels are NaN or infinite"}
    if shown.vertices:
        record |= _roots(film, shown, frames) if film.jump is None else {"other_roots": _other_roots(film, shown)}
        effort = [f["iterations_mean"] for f in frames[1:] if f["iterations_mean"]]
        record["spike"] = max(effort) / float(np.median(effort)) if effort else None
        record["iterations_max"] = max((f["iterations_max"] for f in frames if f["iterations_max"] is not None), default=None)
    if film.jump is not None:
        after = frames[film.jump - film.first :]
        record["recovery"] = next((k for k, f in enumerate(after) if _recovered(f["flip"], f["cold_flip"])), None)
    for column in MEANS:
        known = [f[column] for f in frames if f.get(column) is not None]
        record[column] = float(np.mean(known)) if known else None
        if column in ("temporal_diff", "pops"):
            record[f"{column}_max"] = max(known, default=None)
    return record


def followed(marked: Markers, method: Method) -> dict[str, Any]:
    """What the images of objects tell."""
    if not marked.images:
        return {"images": 0}
    off = marked.follow(method)
    distance = np.linalg.norm(off, axis=2)
    return {
        "images": len(marked.images),
        "images_lost": int(np.isnan(distance).any(axis=0).sum()),
        "image_jitter_px": metrics.jitter_px(off),
        "image_floor_px": marked.floor_px,
        "image_off_px": None if np.isnan(distance).all() else float(np.nanmean(distance)),
    }


def _frame(film: Film, shown: Shown, k: int) -> dict[str, Any]:
    number, mask = film.first + k, shown.masks[k]
    out: dict[str, Any] = {
        "frame": number,
        "time": film.scene.time(number),
        "reflector_px": int(mask.sum()),
        "coverage": shown.found[k],
        "flip": _mean(shown.errors[k], mask),
        "iterations_mean": None,
        "iterations_max": None,
        "cold_flip": None,
    }
    if k > 0 and number != film.jump:
        four = (shown.images[k - 1], shown.images[k], film.references[k - 1].image, film.references[k].image)
        both = mask & shown.masks[k - 1]
        out["temporal_diff"] = metrics.temporal_diff(*four, both)
        out["pops"] = metrics.pops(*four, both, ppd=film.scene.ppd, exposure=film.scene.exposure)
    if film.jump is not None and number >= film.jump:
        out["cold_flip"] = shown.cold[number][0] if number in shown.cold else None
    if shown.vertices:
        iterations = shown.vertices[k]["iterations"]
        searched = iterations > 0
        if searched.any():
            out |= {"iterations_mean": float(iterations[searched].mean()), "iterations_max": int(iterations.max())}
        if k > 0 and number != film.jump:
            before = shown.vertices[k - 1]
            either = searched | (before["iterations"] > 0)
            changed = shown.vertices[k]["converged"] != before["converged"]
            out["converge_changes"] = float(changed[either].mean()) if either.any() else None
    return out


def sampled(film: Film, vertices: list[dict[str, np.ndarray]]) -> list[tuple[int, np.ndarray]]:
    """Per mirror its number and the vertices to follow: spread evenly over those that ever converged."""
    count, mirrors = film.scene.vertices, len(film.scene.reflectors)
    ever = np.any([v["converged"] for v in vertices], axis=0).reshape(mirrors, count)
    out = []
    for number in range(mirrors):
        here = np.flatnonzero(ever[number])
        if len(here):
            out.append((number, here[:: max(1, len(here) * mirrors // SAMPLE)]))
    return out


def _roots(film: Film, shown: Shown, frames: list[dict]) -> dict[str, Any]:
    """Follows sampled vertices and their true reflection points; writes `root_switches` into `frames`."""
    errors, left = [], [[] for _ in range(film.count)]
    for number, sample in sampled(film, shown.vertices):
        lanes, last, tracks = number * film.scene.vertices + sample, None, []
        for k, i in enumerate(film.numbers):
            own = {name: a[lanes] for name, a in shown.vertices[k].items()}
            mirror = truth.Mirror(film.scene, film.scene.time(i), film.size, number)
            now = mirror.roots(sample, own["R"], own["virtual"], own["converged"])
            if last is not None:
                left[k].append(_switched(mirror, sample, last, now))
            tracks.append(np.where(_within(now.true, film.size)[:, None], now.virtual - now.image, np.nan))
            last = now
        errors.append(np.stack(tracks))
    for frame, each in zip(frames, left, strict=True):
        known = np.concatenate(each) if each else np.zeros(0)
        known = known[np.isfinite(known)]
        frame["root_switches"] = float(known.mean()) if len(known) else None
    if not errors:
        return {}
    second = np.linalg.norm(np.diff(np.concatenate(errors, axis=1), n=2, axis=0), axis=2)
    second = second[np.isfinite(second)]
    median = float(np.median(second)) if len(second) else None
    return {"jitter_px": metrics.jitter_px(np.concatenate(errors, axis=1)), "jitter_median_px": median}


def _switched(mirror: truth.Mirror, sample: np.ndarray, last: truth.Roots, now: truth.Roots) -> np.ndarray:
    """1 for vertices whose R left the true one that it was at, 0 for those that stayed, NaN where one is not known, [N]."""
    went = now.found - last.found
    path = now.true - last.true
    out = switches(went, path, last.found - last.true)
    # The nearest true root may be another one than before: where it jumped too, ask for the one that goes on.
    jumped = np.flatnonzero(np.linalg.norm(path, axis=1) > SWITCH_PX)
    if len(jumped):
        on = mirror.continued(sample[jumped], last.world[jumped])
        path[jumped] = truth.on_screen(on, mirror.scene.camera(mirror.time), *mirror.size) - last.true[jumped]
        out[jumped] = switches(went[jumped], path[jumped], (last.found - last.true)[jumped])
    return out


def switches(went: np.ndarray, path: np.ndarray, off: np.ndarray) -> np.ndarray:
    """Which points left the root that they were at: 1, 0, or NaN, [N].

    went, path  how a point and the root that it was at moved, pixels [N, 2]
    off         how far it was from that root before; a point that was at none cannot leave it
    """
    apart = np.linalg.norm(went - path, axis=1)
    known = np.isfinite(apart) & (np.linalg.norm(off, axis=1) <= SWITCH_PX)
    return np.where(known, (apart > SWITCH_PX).astype(float), np.nan)


def _other_roots(film: Film, shown: Shown) -> float | None:
    """Share of sampled vertices that have R elsewhere in the last frame than a cold start has."""
    warm, cold = shown.vertices[-1], shown.cold[film.numbers[-1]][1]
    assert cold is not None
    lanes = np.concatenate([n * film.scene.vertices + s for n, s in sampled(film, [warm])] or [np.zeros(0, int)])
    lanes = lanes[warm["converged"][lanes] & cold["converged"][lanes]]
    if not len(lanes):
        return None
    camera = film.scene.camera(film.scene.time(film.numbers[-1]))
    one, other = (truth.on_screen(v["R"][lanes].astype(np.float64), camera, *film.size) for v in (warm, cold))
    return float((np.linalg.norm(one - other, axis=1) > SWITCH_PX).mean())


def _within(points: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """Points [N, 2] that lie inside the picture."""
    return np.asarray(((points >= 0) & (points <= size)).all(axis=1))


def _error(film: Film, k: int, image: np.ndarray, mask: np.ndarray) -> np.ndarray:
    seen = {"ppd": film.scene.ppd, "exposure": film.scene.exposure}
    return metrics.flip_map(image, film.references[k].image, mask, **seen)


def _mean(error: np.ndarray, mask: np.ndarray) -> float | None:
    """None for an empty mask and where a pixel of it is no colour."""
    inside = error[mask].astype(np.float64)
    return float(inside.mean()) if inside.size and np.isfinite(inside).all() else None


def _vertices(reflection: Reflection) -> dict[str, np.ndarray] | None:
    found = reflection.vertices
    if found is None:
        return None
    return {name: np.array(getattr(found, name)).T for name in ("R", "virtual", "converged", "iterations")}
