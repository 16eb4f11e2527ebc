"""What each object of a scene is needed for: every method is judged in the scene without it, and one with coarser meshes in
its place.

Without an object, references are made without it too: what counts is not that it is missed, but whether the scene would say
the same of the methods. Light stays as it was baked.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import combinations

from benchharness.api import Method
from benchharness.measure import metrics
from benchharness.needs.coarser import coarser
from benchharness.needs.knee import Error, error_of, knee_of
from benchharness.needs.measuring import Bench, Unanswered
from benchharness.scene import Object, Scene

SHARES = (0.125, 0.25, 0.5)  # of the triangles of an object
ALONE = "alone"  # the verdict of an object beside which there is none: a scene without objects is none
TRACED = "ray_traced"  # is as good with any model: coarser meshes are judged by another method where there is one


@dataclass(frozen=True)
class Verdict:
    """What an object is needed for.

    method  whose error changes most when it is left out, in half-widths of its 95 % interval: `change`
    order   pairs of methods that change places
    lost    FLIP between the scene's reference and that of the scene without it
    failed  methods that do not answer without it, and why
    """

    method: str
    change: float
    order: str
    lost: Error
    failed: str = ""

    def word(self, least: float) -> str:
        """Whether it "judges": changes an error by more than its interval, or a ranking, or lets methods fail; is just
        "seen": without it the picture differs by more than `least`; or needed for "nothing"."""
        if self.change > 1 or self.order or self.failed:
            return "judges"
        return "seen" if self.lost.mean > least else "nothing"


@dataclass(frozen=True)
class Model:
    """A share of an object's triangles, as text; how many vertices they have; and the error against the scene's reference."""

    share: str
    vertices: int
    error: Error


def studied(bench: Bench, label: str, methods: dict[str, Method], say: Callable[[str], None]) -> Iterator[dict]:
    """A row of `tables.needs.OBJECTS` per object of the bench's scene, which is called `label`; none where no method
    answers."""
    scene = bench.scene
    say(f"{label}: with all objects")
    whole, _ = errors_of(bench, methods)
    if not whole:
        return
    judge = min(([name for name in whole if not name.startswith(TRACED)] or whole), key=lambda name: whole[name].mean)
    for thing in scene.objects:
        named = {"scene": label, "object": thing.name, "shows": thing.shows, "vertices": len(thing.mesh.vertices)}
        verdict = None
        if len(scene.objects) > 1:
            say(f"{label}: without {thing.name}")
            verdict = left_out(bench, thing, {name: methods[name] for name in whole}, whole)
            named |= {"lost": verdict.lost.mean, "method": verdict.method, "change": verdict.change}
            named |= {"order": verdict.order, "failed": verdict.failed}
        named["verdict"] = ALONE if verdict is None else verdict.word(half(whole[judge]))
        say(f"{label}: coarser {thing.name}")
        unseen = verdict is not None and verdict.lost.mean == 0
        models = [Model("0", 0, whole[judge])] if unseen else _coarser(bench, thing, methods[judge], whole[judge])
        enough = models[knee_of([model.error for model in models])]
        yield {
            **named,
            "judge": judge,
            "enough": enough.share,
            "enough_vertices": enough.vertices,
            "enough_flip": enough.error.mean,
            "flip": whole[judge].mean,
        }


def _of(scene: Scene, objects: tuple[Object, ...]) -> Scene:
    """The scene with these objects, its panorama without a ground if that is none of them."""
    around, names = scene.environment, [thing.name for thing in objects]
    if around is not None and around.ground is not None and around.ground not in names:
        around = replace(around, ground=None)
    return replace(scene, objects=objects, environment=around)


def half(error: Error) -> float:
    """Half the width of its interval."""
    return 0.5 * (error.high - error.low)


def left_out(bench: Bench, thing: Object, methods: dict[str, Method], whole: dict[str, Error]) -> Verdict:
    """What the scene says without one of its several objects. `whole`: the methods' errors with it."""
    rest = tuple(other for other in bench.scene.objects if other is not thing)
    without = Bench(_of(bench.scene, rest), bench.setting)
    lost = _lost(bench, without)
    if lost.mean == 0:  # no mirror shows it
        return Verdict("", 0.0, "", lost)
    errors, failed = errors_of(without, methods)
    change = {name: abs(error.mean - whole[name].mean) / max(half(whole[name]), 1e-12) for name, error in errors.items()}
    most = max(change, key=lambda name: change[name], default="")
    pairs = [f"{a}, {b}" for a, b in combinations(errors, 2) if _reversed(whole[a], whole[b], errors[a], errors[b])]
    return Verdict(most, change.get(most, 0.0), "; ".join(pairs), lost, failed)


def errors_of(bench: Bench, methods: dict[str, Method]) -> tuple[dict[str, Error], str]:
    """Of every method that answers; and which do not, and why."""
    errors, failed = {}, []
    for name, method in methods.items():
        try:
            errors[name] = bench.error(bench.scene, method)
        except Unanswered as unanswered:
            failed.append(f"{name}: {unanswered}")
    return errors, "; ".join(failed)


def _reversed(a: Error, b: Error, other_a: Error, other_b: Error) -> bool:
    """Whether two methods change places, and in one of the two scenes their places are sure."""
    sure = any(x.high < y.low or y.high < x.low for x, y in ((a, b), (other_a, other_b)))
    return sure and (a.mean < b.mean) != (other_a.mean < other_b.mean)


def _lost(bench: Bench, without: Bench) -> Error:
    maps, masks = [], []
    for index in bench.setting.frames:
        full, less, scene = bench.truth(index, {}), without.truth(index, {}), bench.scene
        mask = full.mask | less.mask
        maps.append(metrics.flip_map(less.image, full.image, mask, ppd=scene.ppd, exposure=scene.exposure))
        masks.append(mask)
    return error_of(maps, masks)


def _coarser(bench: Bench, thing: Object, method: Method, whole: Error) -> list[Model]:
    """The scene with ever finer meshes in the place of an object, its own the last."""
    scene, models = bench.scene, []
    for share in SHARES:
        mesh = coarser(thing.mesh, share)
        if mesh is None:
            continue
        objects = tuple(replace(other, mesh=mesh) if other is thing else other for other in scene.objects)
        with contextlib.suppress(Unanswered):  # too coarse for the method, so not enough
            error = bench.error(replace(scene, objects=objects), method)
            models.append(Model(f"1/{1 / share:g}", len(mesh.vertices), error))
    return [*models, Model("1", len(thing.mesh.vertices), whole)]
