"""The picture that all methods are measured against: Mitsuba's path integrator, asked for rays that we make.

The integrator's rays go exactly where the methods sample: through pixel centres (`filter = "center"`), or spread evenly
over the pixel ("box", antialiased). With baked lighting and centre rays nothing is random and the variance comes out as
zero; it is measured all the same. The picture is whole: mirrors show their conductor's reflectance, and everything
else is there. A reflected ray that dips below the mirror's own faceted surface, at silhouettes of coarse meshes, meets
that mirror again and costs a bounce.

What is traced is the normalised scene (`benchharness.render.normalisation`): Mitsuba moves the origins of rays by lengths that
are small beside a metre, and only there. Rays of the eye start at the near plane, or where the scene begins if that is
farther: from an eye that is far away, single precision would start them beside their pixels.

Samples are taken in passes over all pixels, whose sums are kept until all are done (`cache.Parts`), so that a reference that
is killed goes on from the last of them.
"""

# pyright: reportArgumentType=false, reportCallIssue=false, reportAttributeAccessIssue=false, reportOperatorIssue=false
# The type stubs of Mitsuba and Dr.Jit know neither NumPy arguments nor points and vectors in one expression.

from __future__ import annotations

from dataclasses import asdict, dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

import benchharness.cache as cache
import benchharness.render.mitsuba_scene as mitsuba_scene
from benchharness.render import making, mitsuba_normalmap
from benchharness.render.bake import bake
from benchharness.render.normalisation import normalised
from benchharness.scene import Camera, Reflector, Scene

FILTERS = ("center", "box")
LANES = 1 << 21
"""Rays traced at once: bounds memory."""
MOST_SPP, MOST_DEPTH = 1 << 20, 1024


@dataclass(frozen=True)
class ReferenceOptions:
    """How a reference is rendered.

    lighting   "baked": surfaces emit their baked radiance; isolates the reflection. "transport": all light transport
    filter     "center": rays through pixel centres. "box": spread over the pixel
    spp        rays per pixel, at least two are traced, to measure the variance; baked and centred, the rest only if
               those two differ
    max_depth  segments of a path from the eye. Baked: 2 shows one mirror bounce, 3 two. Transport: every bounce counts.
               None is 2 where baked, 8 in transport
    bake_spp   paths per vertex, if the scene comes without radiance

    Raises ValueError for other values, and for transport with a max_depth of 2, which lights nothing in a mirror.
    """

    lighting: str = "baked"
    filter: str = "center"
    spp: int = 64
    max_depth: int | None = None
    bake_spp: int = 512

    def __post_init__(self) -> None:
        for name, accepted in (("lighting", mitsuba_scene.LIGHTINGS), ("filter", FILTERS)):
            if getattr(self, name) not in accepted:
                raise ValueError(f"reference: {name} is {getattr(self, name)!r}; accepted: {', '.join(accepted)}")
        least = 1 if self.lighting == "baked" else 3
        for name, low, high in (("spp", 1, MOST_SPP), ("max_depth", least, MOST_DEPTH), ("bake_spp", 1, MOST_SPP)):
            value = getattr(self, name)
            if value is None and name == "max_depth":
                continue
            if not isinstance(value, int) or isinstance(value, bool) or not low <= value <= high:
                raise ValueError(f"reference: {name} is {value!r}; accepted: whole numbers from {low} to {high}")

    @property
    def depth(self) -> int:
        """`max_depth`, or its default."""
        if self.max_depth is not None:
            return self.max_depth
        return 2 if self.lighting == "baked" else 8


@dataclass(frozen=True, eq=False)
class Reference:
    """A rendered reference; row 0 is the top of the picture.

    image     float32 [H, W, 3] linear radiance
    variance  float32 [H, W, 3] of the mean that `image` is
    mask      bool [H, W]: a reflector is what the ray through the pixel's centre meets first
    reflector int32 [H, W]: which one, -1 where none
    distance  float32 [H, W] metres from there to what the reflected ray meets; inf: the surroundings, NaN: off the mask
    second    bool [H, W]: pixels of the mask that show a second reflection: the reflected ray meets a reflector first
    back      bool [H, W]: pixels of the mask whose reflected ray meets an object's back
    spp       rays per pixel that were traced
    """

    image: np.ndarray
    variance: np.ndarray
    mask: np.ndarray
    reflector: np.ndarray
    distance: np.ndarray
    second: np.ndarray
    back: np.ndarray
    spp: int


def render(
    scene: Scene, time: float, size: tuple[int, int], options: ReferenceOptions | None = None, seed: int = 0
) -> Reference:
    """The scene at `time` seconds in `size` = (width, height) pixels. Cached by content.

    A scene whose objects lack radiance is baked first, where the lighting asks for it. Raises ValueError for a size
    below 1 pixel and a negative seed.
    """
    options = ReferenceOptions() if options is None else options
    width, height = size
    if width < 1 or height < 1:
        raise ValueError(f"reference: size is {width} x {height}; accepted: at least 1 x 1 pixels")
    if seed < 0:
        raise ValueError(f"reference: seed is {seed}; accepted: whole numbers from 0")
    if options.lighting == "baked" and any(part.mesh.radiance is None for part in scene.objects):
        scene = bake(scene, spp=options.bake_spp)
    local = normalised(scene)
    to_metres = local.unit / scene.unit
    scene, camera = local, local.camera(time)
    key = cache.content_hash(
        cache.source_hash(__file__, *mitsuba_scene.SOURCES),
        (mi.__version__, mi.variant()),
        mitsuba_scene.fingerprint(scene, time, options.lighting),
        (*map(float, (*camera.eye, *camera.target, *camera.up, camera.fov_deg)), int(width), int(height), int(seed)),
        scene.near_plane,
        asdict(options) | {"max_depth": options.depth, "bake_spp": 0},
    )
    arrays = cache.cached_in_parts(
        "reference", key, lambda parts: _render(scene, time, camera, width, height, options, seed, parts)
    )
    arrays = {**arrays, "distance": np.float32(to_metres) * arrays["distance"]}
    return Reference(**{name: array for name, array in arrays.items() if name != "spp"}, spp=int(arrays["spp"]))


def _render(
    scene: Scene,
    time: float,
    camera: Camera,
    width: int,
    height: int,
    options: ReferenceOptions,
    seed: int,
    parts: cache.Parts,
) -> cache.Arrays:
    number = [_reflector_number(scene, part) for part in scene.parts]
    marks = [np.full(len(part.mesh.faces), i) for part, i in zip(scene.parts, number, strict=True)]
    world = mitsuba_scene.mitsuba_scene(scene, time, options.lighting, marks)
    start = max(scene.near_plane, _nearest(scene, time, camera))
    what = f"{scene.name}, reference at {time:g} s"
    image, variance, spp = _sampled(world, camera, start, width, height, options, seed, parts, what)
    mapped = any(one.normal_map is not None for one in scene.reflectors)
    reflector, distance, second, back = _geometry(world, camera, start, width, height, mapped=mapped)
    shape = (height, width)
    return {
        "image": image.reshape(*shape, 3).astype(np.float32),
        "variance": variance.reshape(*shape, 3).astype(np.float32),
        "mask": (reflector >= 0).reshape(shape),
        "reflector": reflector.reshape(shape),
        "distance": distance.reshape(shape),
        "second": second.reshape(shape),
        "back": back.reshape(shape),
        "spp": np.array(spp),
    }


def _reflector_number(scene: Scene, part) -> int:
    return scene.reflectors.index(part) if isinstance(part, Reflector) else -1


def _nearest(scene: Scene, time: float, camera: Camera) -> float:
    """A depth in front of which there is nothing of the scene."""
    ahead = camera.axes()[2]
    depths = [((part.mesh.transformed(part.pose(time)).vertices - camera.eye) @ ahead).min() for part in scene.parts]
    return min(depths, default=0.0) - 1e-3 * scene.size


def camera_rays(camera: Camera, start: float, width: int, height: int, x: mi.Float, y: mi.Float) -> mi.Ray3f:
    """Rays of the eye through image positions x (to the right) and y (down), in pixels from the top left corner, from the depth
    `start` on."""
    axes, focal = camera.axes(), 0.5 * height / np.tan(0.5 * np.radians(camera.fov_deg))
    middle = mi.Point3f(*map(float, np.asarray(camera.eye, np.float64) + start * axes[2]))
    right, down, forward = (mi.Vector3f(*map(float, axis)) for axis in axes)
    depth, per_pixel = mi.Float(start), mi.Float(1 / focal)
    dr.make_opaque(right, down, forward, middle, depth, per_pixel)  # else every frame of an animation compiles all again
    aside = (x - 0.5 * width) * per_pixel * right + (y - 0.5 * height) * per_pixel * down
    return mi.Ray3f(middle + depth * aside, dr.normalize(forward + aside))


def _sampled(
    world: mi.Scene,
    camera: Camera,
    start: float,
    width: int,
    height: int,
    options: ReferenceOptions,
    seed: int,
    parts: cache.Parts,
    what: str,
) -> tuple[np.ndarray, np.ndarray, int]:
    """Mean and variance of the mean, float64 [H W, 3], and the number of samples. `parts`: where the sums of passes are kept;
    `what`: see `making.Share`."""
    integrator = mi.load_dict({"type": "path", "max_depth": options.depth, "rr_depth": 1 << 20})
    sampler = mi.load_dict({"type": "independent"})
    pixels = width * height
    per_pass = max(1, LANES // pixels)
    certain = options.lighting == "baked" and options.filter == "center"
    cheaper = f"[run] size = {[width, height]}" if certain else f"[reference] spp = {options.spp}"

    # Sums of differences to the first sample: samples that agree give a variance of exactly zero.
    sums = parts.get("sums") or {"done": np.array(0)} | {name: np.zeros((pixels, 3)) for name in ("first", "total", "squares")}
    first, total, squares, done, wanted = sums["first"], sums["total"], sums["squares"], int(sums["done"]), max(2, options.spp)
    while done < wanted and not (certain and done >= 2 and not squares.any()):
        making.tell(making.Share(what, done, wanted, cheaper))
        n = min(per_pass, wanted - done, 2 if certain and done < 2 else wanted)
        lane = dr.arange(mi.UInt32, pixels * n)
        pixel = lane // dr.opaque(mi.UInt32, n)
        sampler.seed((seed * 7919 + done) % (1 << 32), pixels * n)
        offset = mi.Point2f(0.5) if options.filter == "center" else sampler.next_2d()
        x, y = mi.Float(pixel % width) + offset.x, mi.Float(pixel // width) + offset.y
        rays = mi.RayDifferential3f(camera_rays(camera, start, width, height, x, y))
        L = np.array(integrator.sample(world, sampler, rays)[0], np.float64).T.reshape(pixels, n, 3)
        if done == 0:
            first = L[:, 0]
        total += (L - first[:, None]).sum(axis=1)
        squares += ((L - first[:, None]) ** 2).sum(axis=1)
        done += n
        parts.put("sums", {"done": np.array(done), "first": first, "total": total, "squares": squares})
    making.tell(making.Share(what, wanted, wanted, cheaper))
    mean = total / done
    variance = np.maximum(squares / done - mean**2, 0) / max(done - 1, 1)
    image = first + mean
    if not np.isfinite(image).all():
        raise RuntimeError(f"reference: Mitsuba returned {(~np.isfinite(image)).any(axis=1).sum()} non-finite pixels")
    return image, variance, done


def _geometry(
    world: mi.Scene, camera: Camera, start: float, width: int, height: int, *, mapped: bool
) -> tuple[np.ndarray, ...]:
    """Number of the reflector at each pixel's centre, int32 [H W], and of the reflected ray: its length, float32 [H W], and
    whether it meets a reflector, and whether the back of an object, bool [H W].

    mapped  whether any has a normal map
    """
    lane = dr.arange(mi.UInt32, width * height)
    ray = camera_rays(camera, start, width, height, mi.Float(lane % width) + 0.5, mi.Float(lane // width) + 0.5)
    si = world.ray_intersect(ray)
    valid = si.is_valid()
    number = dr.select(valid, mi.Int32(si.shape.eval_attribute_1("face_mark", si, valid)), -1)
    n = si.sh_frame.n
    d = ray.d - 2 * dr.dot(ray.d, n) * n
    if mapped:
        d = mitsuba_normalmap.reflected(si, number >= 0)
    mirrored = si.spawn_ray(d)
    met = world.ray_intersect(mirrored, active=number >= 0)
    t = met.t + dr.dot(mirrored.o - si.p, mirrored.d)
    second = met.is_valid()
    second &= met.shape.eval_attribute_1("face_mark", met, second) >= 0
    back = met.is_valid() & ~second & (dr.dot(met.n, mirrored.d) > 0)
    length = np.array(dr.select(number >= 0, t, dr.nan), np.float32)
    return np.array(number, np.int32), length, np.array(second, bool), np.array(back, bool)
