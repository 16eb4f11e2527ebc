"""Where the images of objects are in mirrors, and how their place trembles: for any method, from pictures alone.

The scene is shown once more, dark but for three objects: one that shines red, one green, one blue, each with radiance 1.
In every mirror the centroid of one colour is where the image of one object is, to a fraction of a pixel; it is compared
with the reference's, frame by frame. Mirrors are ideal here, and what shows a second reflection is left out.

A centroid is known as well as its edges are sampled. Every pixel is asked at `side` x `side` places, by shifting the picture
and not by enlarging it: what a method decides by the size of its picture stays as it is. The reference shows which object
it sees at each of those places. What sampling alone does is measured with it: its centroids from every `side`-th place in
each direction tremble about those from all.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

import drjit as dr
import mitsuba as mi
import numpy as np

from benchharness.api import Frame, Method, View
from benchharness.kernels import depths
from benchharness.measure import contract, host, metrics
from benchharness.measure.runup import carried
from benchharness.render import reference
from benchharness.render.frame import FrameRenderer
from benchharness.scene import PointLight, Scene
from benchharness.stability.film import OPTIONS, Film

LEAST_PX = 80  # pixels of an image, in every frame
MOST = 0.3  # share of its mirror's pixels: what is larger is a surrounding, cut off by the mirror's edge
COLOURS = 3
LOST = 0.1  # share of the reference's pixels, below which an image is not there


def dark(scene: Scene, radiance: Sequence[np.ndarray]) -> Scene:
    """The scene with its objects shining as told, [3] each, and no other light; mirrors ideal."""
    objects = tuple(
        replace(o, mesh=replace(o.mesh, radiance=colour, visibility=None, texture=None, light=None), gloss=None)
        for o, colour in zip(scene.objects, radiance, strict=True)
    )
    mirrors = tuple(replace(r, eta=None, k=None) for r in scene.reflectors)
    around = scene.environment
    if around is not None:
        around = replace(around, radiance=np.zeros_like(np.asarray(around.radiance)))
    lights: tuple[PointLight, ...] = ()
    return replace(
        scene, objects=objects, reflectors=mirrors, background=(0.0, 0.0, 0.0), environment=around, lights=lights, exposure=0.0
    )


@dataclass(frozen=True)
class Image:
    """The image of object number `what` in mirror number `mirror`; `colour`: the channel in which it shines."""

    what: int
    mirror: int
    colour: int


@dataclass(frozen=True, eq=False)
class Markers:
    """The images of a film that are followed.

    side   places per pixel along each axis; odd, so that the centre is one of them
    count  frames, from the first on
    """

    film: Film
    side: int
    count: int

    @cached_property
    def numbers(self) -> range:
        return self.film.numbers[: self.count]

    @cached_property
    def seen(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """Per frame which object, and in which mirror, the reference sees at every place, int [side H, side W]; -1 for none."""
        numbered = dark(self.film.scene, [np.full(3, k + 1.0) for k in range(len(self.film.scene.objects))])
        size = (self.side * self.film.size[0], self.side * self.film.size[1])
        out = []
        for i in self.numbers:
            its = reference.render(numbered, numbered.time(i), size, OPTIONS)
            once = its.mask & ~its.second
            out.append((np.where(once, np.rint(its.image[..., 0]).astype(int) - 1, -1), np.where(once, its.reflector, -1)))
        return out

    @cached_property
    def images(self) -> list[Image]:
        """The images of the three objects that are known best, in all mirrors that show them."""
        objects, mirrors = len(self.film.scene.objects), len(self.film.scene.reflectors)
        counts = np.zeros((len(self.seen), mirrors, objects))
        for k, (what, mirror) in enumerate(self.seen):
            own = what >= 0
            np.add.at(counts[k], (mirror[own], what[own]), 1 / self.side**2)
        whole = np.array([[(mirror == m).sum() for m in range(mirrors)] for _, mirror in self.seen]) / self.side**2
        usable = (counts.min(axis=0) >= LEAST_PX) & (counts <= MOST * whole[..., None]).all(axis=0)
        known = np.zeros(objects)
        for m, what in zip(*np.nonzero(usable), strict=True):
            own = self._own(len(self.seen) // 2, Image(int(what), int(m), 0))
            known[what] += uncertainty(own, self.side) ** -2
        chosen = [int(what) for what in np.argsort(-known, kind="stable")[:COLOURS] if known[what] > 0]
        return [Image(what, m, c) for c, what in enumerate(chosen) for m in range(mirrors) if usable[m, what]]

    @cached_property
    def scene(self) -> Scene:
        """Dark but for the objects that are followed."""
        colours = np.zeros((len(self.film.scene.objects), 3))
        for image in self.images:
            colours[image.what, image.colour] = 1.0
        return dark(self.film.scene, list(colours))

    @cached_property
    def truth(self) -> np.ndarray:
        """Where the reference has the images, pixels [T, images, 2]."""
        return np.array([[centroid(self._own(k, image), self.side) for image in self.images] for k in range(len(self.seen))])

    @cached_property
    def floor_px(self) -> float | None:
        """What sampling alone does to `image_jitter_px`, where the method's edges run through other places than the
        reference's: twice the variance, which goes with the number of places to the power -3/2."""
        if not self.images:
            return None
        some = np.zeros(self.seen[0][0].shape)
        some[:: self.side, :: self.side] = 1
        few = [[centroid(some * self._own(k, image), self.side) for image in self.images] for k in range(len(self.seen))]
        jitter = metrics.jitter_px(np.array(few) - self.truth)
        return None if jitter is None else jitter * float(np.sqrt(2 / (self.side**3 - 1)))

    def _own(self, k: int, image: Image) -> np.ndarray:
        what, mirror = self.seen[k]
        return ((what == image.what) & (mirror == image.mirror)).astype(float)

    def follow(self, method: Method) -> np.ndarray:
        """Where a method has the images, less where the reference has them, pixels [T, images, 2]; NaN where one is lost."""
        shown = self._shown(method)
        places = np.full((len(self.seen), len(self.images), 2), np.nan)
        for k, (_, mirror) in enumerate(self.seen):
            for j, image in enumerate(self.images):
                weights = np.where(mirror == image.mirror, shown[k][..., image.colour], 0)
                if weights.sum() >= LOST * self._own(k, image).sum():
                    places[k, j] = centroid(weights, self.side)
        return places - self.truth

    def _shown(self, method: Method) -> list[np.ndarray]:
        """What the mirrors show, 0 elsewhere, at every place: [side H, side W, 3] per frame.

        All places of a frame start from one state: what moved was taken in once, and the pixels' centres carry it on.
        """
        (width, height), side = self.film.size, self.side
        out = [np.zeros((side * height, side * width, 3), np.float32) for _ in self.numbers]
        renderer, state = FrameRenderer(self.scene, width, height), method.prepare(self.scene)
        middle = side // 2
        for k, step in enumerate(carried(self.scene, method, state, (renderer.render(i) for i in self.numbers))):
            places = out[k].reshape(height, side, width, side, 3)
            for down, right in product(range(side), repeat=2):
                if (down, right) == (middle, middle):
                    there, shown = step.frame, step.reflection
                else:
                    there = _shifted(renderer, step.frame.index, (right - middle) / side, (down - middle) / side)
                    shown = contract.shaded(method, step.before, there, self.scene)[0]
                L, mirror = host.image(shown.L, there), host.plane(there.active, there)
                places[:, down, :, right] = np.where(np.isfinite(L) & mirror[..., None], L, 0)
        return out


def centroid(weights: np.ndarray, side: int) -> np.ndarray:
    """The middle [x, y], in pixels, of a picture that has `side` x `side` places in a pixel; NaN where it is empty."""
    total = weights.sum()
    if total <= 0:
        return np.full(2, np.nan)
    x = weights.sum(axis=0) @ (np.arange(weights.shape[1]) + 0.5) / total
    y = weights.sum(axis=1) @ (np.arange(weights.shape[0]) + 0.5) / total
    return np.array([x, y]) / side


def uncertainty(own: np.ndarray, side: int) -> float:
    """Pixels by which sampling makes the centroid of a mask uncertain: each place on its edge counts or not, a step that is
    uniform in [0, 1], and pulls by its distance from the middle; own [side H, side W] in {0, 1}, not empty."""
    inside = own > 0
    around = np.pad(inside, 1)
    core = inside & around[:-2, 1:-1] & around[2:, 1:-1] & around[1:-1, :-2] & around[1:-1, 2:]
    y, x = np.nonzero(inside & ~core)
    middle = side * centroid(own, side) - 0.5
    return float(np.sqrt(((x - middle[0]) ** 2 + (y - middle[1]) ** 2).sum() / 12) / inside.sum() / side)


def _shifted(renderer: FrameRenderer, index: int, dx: float, dy: float) -> Frame:
    """A frame whose pixels are seen `dx`, `dy` pixels beside their centres."""
    view = renderer.view(index)
    moved: View = depths.moved(view, dr.opaque(mi.Float, dx), dr.opaque(mi.Float, dy), view.width, view.height)
    dr.make_opaque(moved)
    frame = renderer.draw(index, moved)
    boxes = [(left - 1, top - 1, right + 1, bottom + 1) for left, top, right, bottom in frame.boxes]
    return replace(frame, boxes=boxes)
