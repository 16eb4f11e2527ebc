"""The scene model: all that a scene author reads.

A scene is objects that are seen in mirrors, reflectors that are the mirrors, and a camera path. Everything here is
float64 NumPy on the host, right-handed, z up, in metres and seconds; radiance and albedo are linear RGB.

Surfaces are diffuse, one-sided in spirit and two-sided in effect: a mesh whose back can be seen should be closed. Their albedo
is one of vertices, interpolated, times that of a picture where there is one (`Texture`).
Light comes from objects that emit (``Mesh.emission``), from ``Scene.lights`` and from the surroundings at infinity, one
colour (``Scene.background``) or a panorama (``Scene.environment``). What a surface sends back is not stored by the author
but baked (``benchharness.render.bake``) into ``Mesh.radiance``, or finer than there are vertices into ``Mesh.light``, so that
every method sees the same light; a picture colours it where it is seen. Only highlights, of point lights on objects with
``Gloss``, depend on where one looks from.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from benchharness.modelling import normalmap
from benchharness.modelling.lightmap import LightMap as LightMap
from benchharness.modelling.panorama import Environment as Environment
from benchharness.modelling.panorama import read_only
from benchharness.modelling.subdivision import split_edges
from benchharness.modelling.texture import Texture as Texture

Motion = Callable[[float], np.ndarray]
"""Time in seconds -> rigid pose, float64 [4, 4], object to world."""

NEAR = 1e-3  # of a mirror's half diagonal
MOST_LIGHTS = 4  # point lights of a scene: their visibilities at a vertex are one packet of 4 floats on the device
PER_VERTEX = ("normals", "albedo", "emission", "radiance", "visibility", "uv", "light_at")
"""What a mesh carries, where it has it."""


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles with what each vertex needs to be lit.

    vertices   float64 [V, 3], object space
    faces      int32   [F, 3], counter-clockwise seen from outside
    normals    float64 [V, 3], unit, outward; area-weighted vertex normals where not given
    albedo     float64 [V, 3] in [0, 1]; one colour [3] is spread over all vertices
    emission   float64 [V, 3] radiance that the surface emits by itself, W/(m² sr); one colour [3] is spread
    radiance   float64 [V, 3] radiance that leaves the surface, highlights aside and without the texture, baked; None until then
    visibility float64 [V, L] in [0, 1]: how much of each of `Scene.lights` is seen, baked where highlights need it; else None
    uv         float64 [V, 2], where in the texture, or a mirror's normal map, a vertex is; one on a seam comes twice. None for
               a mesh without
    texture    colours what leaves the surface, a factor of the albedo that differs point by point. A mirror's is not looked at
    light      baked radiance on grids of triangles, finer than there are vertices: what those show that have one; else None
    light_at   float64 [V, 2], where in `light` a vertex is, negative for one of no grid. Triangles with grids share no vertices

    None of them can be written to: whoever wants another mesh makes one. Raises ValueError for no faces, non-finite numbers,
    indices out of range, a texture without uv or on a mesh that emits, and light that has no place.
    """

    vertices: np.ndarray
    faces: np.ndarray
    normals: np.ndarray = None  # type: ignore[assignment]
    albedo: np.ndarray | tuple = (0.5, 0.5, 0.5)
    emission: np.ndarray | tuple = (0.0, 0.0, 0.0)
    radiance: np.ndarray | None = None
    visibility: np.ndarray | None = None
    uv: np.ndarray | None = None
    texture: Texture | None = None
    light: LightMap | None = None
    light_at: np.ndarray | None = None

    def __post_init__(self) -> None:
        vertices = np.ascontiguousarray(self.vertices, np.float64)
        faces = np.ascontiguousarray(self.faces, np.int32)
        if vertices.ndim != 2 or vertices.shape[1] != 3:
            raise ValueError(f"mesh: vertices have shape {vertices.shape}; accepted: [V, 3]")
        if faces.ndim != 2 or faces.shape[1] != 3 or len(faces) == 0:
            raise ValueError(f"mesh: faces have shape {faces.shape}; accepted: [F, 3] with at least one face")
        if not np.isfinite(vertices).all():
            bad = int(np.flatnonzero(~np.isfinite(vertices).all(axis=1))[0])
            raise ValueError(f"mesh: vertex {bad} is {vertices[bad]}; accepted: finite coordinates")
        if faces.min() < 0 or faces.max() >= len(vertices):
            bad = faces.min() if faces.min() < 0 else faces.max()
            raise ValueError(f"mesh: a face names vertex {bad}; accepted: 0 to {len(vertices) - 1}")
        normals = vertex_normals(vertices, faces) if self.normals is None else np.asarray(self.normals, np.float64)
        for name, value in [
            ("vertices", vertices),
            ("faces", faces),
            ("normals", self._per_vertex("normals", normals, len(vertices))),
            ("albedo", self._per_vertex("albedo", self.albedo, len(vertices))),
            ("emission", self._per_vertex("emission", self.emission, len(vertices))),
        ]:
            object.__setattr__(self, name, read_only(value))
        if self.radiance is not None:
            object.__setattr__(self, "radiance", read_only(self._per_vertex("radiance", self.radiance, len(vertices))))
        if self.visibility is not None:
            visibility = np.ascontiguousarray(self.visibility, np.float64)
            if visibility.shape not in [(len(vertices), n + 1) for n in range(MOST_LIGHTS)]:
                raise ValueError(
                    f"mesh: visibility has shape {visibility.shape}; accepted: [{len(vertices)}, 1 to {MOST_LIGHTS}]"
                )
            if not ((visibility >= 0) & (visibility <= 1)).all():
                raise ValueError("mesh: visibility is not within 0 and 1; accepted: the share of a light that is seen")
            object.__setattr__(self, "visibility", read_only(visibility))
        for name in ("uv", "light_at"):
            if (given := getattr(self, name)) is not None:
                there = np.ascontiguousarray(given, np.float64)
                if there.shape != (len(vertices), 2) or not np.isfinite(there).all():
                    raise ValueError(f"mesh: {name} has shape {there.shape}; accepted: finite numbers [{len(vertices)}, 2]")
                object.__setattr__(self, name, read_only(there))
        if self.texture is not None and self.uv is None:
            raise ValueError("mesh: it has a texture and no uv; accepted: where in the texture each vertex is, [V, 2]")
        if self.texture is not None and np.any(self.emission):
            raise ValueError("mesh: it has a texture and emits; accepted: one of the two")
        if self.light is not None and self.light_at is None:
            raise ValueError("mesh: it has light and no light_at; accepted: where in it each vertex is, [V, 2]")

    @staticmethod
    def _per_vertex(name: str, value, n: int) -> np.ndarray:
        value = np.asarray(value, np.float64)
        if value.shape not in ((3,), (n, 3)):
            raise ValueError(f"mesh: {name} has shape {value.shape}; accepted: [3] or [{n}, 3]")
        if not np.isfinite(value).all():
            raise ValueError(f"mesh: {name} is not finite; accepted: finite numbers")
        return np.ascontiguousarray(np.broadcast_to(value, (n, 3)))

    def transformed(self, pose: np.ndarray) -> Mesh:
        """The mesh moved by a rigid or uniformly scaling pose, float64 [4, 4]."""
        linear = pose[:3, :3]
        normals = self.normals @ linear.T
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
        return replace(self, vertices=self.vertices @ linear.T + pose[:3, 3], normals=normals)


def vertex_normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Area-weighted unit normals, float64 [V, 3]; +z where a vertex has no area around it."""
    corners = vertices[faces]
    face_normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = np.zeros_like(vertices)
    for corner in range(3):
        np.add.at(normals, faces[:, corner], face_normals)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.where(length > 0, normals / np.maximum(length, 1e-300), [0.0, 0.0, 1.0])


def merged(*meshes: Mesh) -> Mesh:
    """One mesh out of several, in their order; radiance, visibility (of as many lights) and uv are kept if all have them.

    Raises ValueError for meshes of different textures or light maps: such stay apart.
    """
    for name, what in (("texture", "textures"), ("light", "light maps")):
        count = len({getattr(m, name) for m in meshes})
        if count > 1:
            raise ValueError(f"merged: meshes have {count} {what}, none being one; accepted: the same for all, or none")
    starts = np.cumsum([0] + [len(m.vertices) for m in meshes])

    def stacked(name: str) -> np.ndarray | None:
        values = [getattr(m, name) for m in meshes]
        widths = {None if value is None else value.shape[1] for value in values}
        return np.concatenate(values) if len(widths) == 1 and None not in widths else None

    return Mesh(
        vertices=np.concatenate([m.vertices for m in meshes]),
        faces=np.concatenate([m.faces + start for m, start in zip(meshes, starts, strict=False)]),
        **{name: stacked(name) for name in PER_VERTEX},  # pyright: ignore[reportArgumentType]
        texture=meshes[0].texture,
        light=meshes[0].light,
    )


def subdivided(mesh: Mesh, h_max: float) -> Mesh:
    """Splits every edge longer than `h_max` metres at its midpoint until none is left.

    The decision is taken per edge and from its end points alone, so that faces that share an edge, within a mesh or
    across two meshes, split it at the same point: no T-junctions. A face with one, two or three split edges becomes
    two, three or four. Attributes are interpolated linearly (normals renormalised).
    """
    if not h_max > 0:
        raise ValueError(f"subdivided: h_max is {h_max}; accepted: a positive length in metres")
    carried = {name: np.asarray(value) for name in PER_VERTEX if (value := getattr(mesh, name)) is not None}
    columns = np.concatenate(list(carried.values()), axis=1)
    v, f, columns = split_edges(mesh.vertices, mesh.faces.astype(np.int64), columns, h_max)
    ends = np.cumsum([value.shape[1] for value in carried.values()])[:-1]
    split = dict(zip(carried, np.split(columns, ends, axis=1), strict=True))
    split["normals"] = split["normals"] / np.maximum(np.linalg.norm(split["normals"], axis=1, keepdims=True), 1e-300)
    return Mesh(vertices=v, faces=f, **split, texture=mesh.texture, light=mesh.light)


@dataclass(frozen=True)
class PointLight:
    """Shines from a point, equally in all directions.

    position   [3] metres, world space; it stands still
    intensity  RGB, W/sr: at distance d it gives intensity / d², W/m², to what faces it

    Raises ValueError for what is not finite, and for a negative intensity.
    """

    position: tuple[float, float, float]
    intensity: tuple[float, float, float]

    def __post_init__(self) -> None:
        _set_triple(self, "point light", "position", -np.inf, np.inf)
        _set_triple(self, "point light", "intensity", 0.0, np.inf)


@dataclass(frozen=True)
class Gloss:
    """A highlight above the diffuse surface: Blinn-Phong, with unit directions to the light and to the viewer and h halfway,

        f = specular (e + 8) / (8 π) max(0, n·h)^e

    per unit of solid angle (Akenine-Möller, Haines and Hoffman, Real-Time Rendering, 3rd edition, 7.6). The factor makes the
    lobe reflect `specular` at normal incidence, or up to 8 % more, whatever the exponent e. One-sided: n is the interpolated
    vertex normal, and behind it there is no highlight.

    specular   RGB in [0, 1]; with the albedo at most 1, or the surface gains energy
    exponent   e, positive

    Raises ValueError for anything else.
    """

    specular: tuple[float, float, float]
    exponent: float

    def __post_init__(self) -> None:
        _set_triple(self, "gloss", "specular", 0.0, 1.0)
        if not 0 < self.exponent < np.inf:
            raise ValueError(f"gloss: exponent is {self.exponent}; accepted: positive numbers, such as 100")


def _set_triple(item, kind: str, name: str, low: float, high: float) -> None:
    """Makes a field of a frozen `item` three plain numbers; ValueError if they are not finite and from `low` to `high`."""
    values = np.asarray(getattr(item, name), np.float64)
    if values.shape != (3,) or not (np.isfinite(values) & (values >= low) & (values <= high)).all():
        raise ValueError(f"{kind}: {name} is {getattr(item, name)}; accepted: three finite numbers from {low:g} to {high:g}")
    object.__setattr__(item, name, tuple(values.tolist()))


@dataclass(frozen=True, eq=False)
class Object:
    """Something that is seen directly and in the mirrors.

    shows    a sentence: what this object is there to show. No reason, no object.
    motion   None for what stands still
    gloss    None for a surface that is diffuse and nothing else
    """

    name: str
    mesh: Mesh
    shows: str
    motion: Motion | None = None
    gloss: Gloss | None = None

    def pose(self, time: float) -> np.ndarray:
        return np.eye(4) if self.motion is None else np.asarray(self.motion(time), np.float64)

    def seen(self, lights: int) -> np.ndarray:
        """`mesh.visibility`, float64 [V, lights]; ValueError where it is not that of so many lights."""
        if self.mesh.visibility is None or self.mesh.visibility.shape[1] != lights:
            raise ValueError(f"object {self.name} has gloss and no visibility of {lights} lights; bake the scene first")
        return self.mesh.visibility


@dataclass(frozen=True, eq=False)
class Reflector:
    """A mirror. Reflects about its interpolated vertex normals; may be open (a sheet) or closed.

    closed   a watertight mesh that contains `mesh` and coincides with it where both exist; searches run on it
    eta, k   complex index of refraction per RGB; both None for an ideal mirror (reflectance 1)
    normal_map  turns the normals point by point, at the uv of `mesh` (`benchharness.modelling.normalmap`); None for none

    Raises ValueError for a normal map without uv, or with normals that point into the surface.
    """

    name: str
    mesh: Mesh
    closed: Mesh | None = None
    eta: tuple[float, float, float] | None = None
    k: tuple[float, float, float] | None = None
    motion: Motion | None = None
    normal_map: Texture | None = None

    def __post_init__(self) -> None:
        if self.normal_map is not None:
            normalmap.check(self.normal_map, self.mesh.uv, f"reflector {self.name}")

    def pose(self, time: float) -> np.ndarray:
        return np.eye(4) if self.motion is None else np.asarray(self.motion(time), np.float64)


@dataclass(frozen=True)
class Camera:
    """A pinhole camera. Pixel (row i, column j) has its centre at x = j + 0.5, y = i + 0.5; y points down.

    fov_deg   vertical field of view
    """

    eye: tuple[float, float, float]
    target: tuple[float, float, float]
    fov_deg: float
    up: tuple[float, float, float] = (0.0, 0.0, 1.0)

    def axes(self) -> np.ndarray:
        """Rows: unit right, down, forward in world space, float64 [3, 3]."""
        forward = np.subtract(self.target, self.eye)
        forward = forward / np.linalg.norm(forward)
        right = np.cross(forward, self.up)
        right /= np.linalg.norm(right)
        return np.stack([right, np.cross(forward, right), forward])

    def world_to_screen(self, width: int, height: int) -> np.ndarray:
        """Float64 [3, 4] that takes (X, Y, Z, 1) to (x w, y w, w): x, y in pixels, w the depth along the view axis."""
        focal = 0.5 * height / np.tan(0.5 * np.radians(self.fov_deg))
        pixels = np.array([[focal, 0.0, 0.5 * width], [0.0, focal, 0.5 * height], [0.0, 0.0, 1.0]])
        axes = self.axes()
        return pixels @ np.concatenate([axes, -(axes @ np.asarray(self.eye, np.float64))[:, None]], axis=1)


@dataclass(frozen=True, eq=False)
class Scene:
    """Everything that a frame is made from.

    camera      time in seconds -> Camera
    frames      length of the animation; frame i is at time i / fps
    near        depth in front of the eye, in metres, below which nothing is drawn; None: NEAR of the smallest mirror
    background  radiance of the surroundings at infinity, linear RGB
    environment surroundings at infinity that differ by direction; ValueError beside a `background` that is not black, and
                for a `ground` that is no object's name
    ppd         pixels per degree at which images are looked at, for FLIP
    exposure    stops (powers of two) that take the scene's radiance to display brightness, for FLIP and the pictures
    detail      "lean" or "paper"
    h_max       edges of objects longer than this, in metres, are split after baking (`refined`); None: no splitting
    lights      point lights; ValueError for more than MOST_LIGHTS
    lightmaps   whether light is baked finer than there are vertices, where it asks for it; else at vertices alone
    unit        metres that a unit of length of this scene stands for, and
    origin      [3] where its origin is, in metres of the author's scene: other than 1 and 0 only where the harness moved it
                (`benchharness.render.normalisation`)
    """

    name: str
    objects: tuple[Object, ...]
    reflectors: tuple[Reflector, ...]
    camera: Callable[[float], Camera]
    frames: int
    fps: float = 25.0
    near: float | None = None
    background: tuple[float, float, float] = (0.0, 0.0, 0.0)
    ppd: float = 67.0
    exposure: float = 0.0
    detail: str = "lean"
    source: dict = field(default_factory=dict)
    """What the builder was asked for, for the records: keyword -> value."""
    h_max: float | None = None
    lights: tuple[PointLight, ...] = ()
    environment: Environment | None = None
    unit: float = 1.0
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    lightmaps: bool = False

    def __post_init__(self) -> None:
        if len(self.lights) > MOST_LIGHTS:
            raise ValueError(f"scene {self.name}: {len(self.lights)} lights; accepted: at most {MOST_LIGHTS} point lights")
        if self.environment is None:
            return
        if np.any(self.background):
            raise ValueError(f"scene {self.name}: background is {self.background} and there is an environment; accepted: one")
        names, ground = [o.name for o in self.objects], self.environment.ground
        if ground is not None and ground not in names:
            raise ValueError(f"scene {self.name}: environment.ground is {ground!r}; accepted: an object, {', '.join(names)}")

    def time(self, frame: int) -> float:
        return frame / self.fps

    @property
    def parts(self) -> tuple[Object | Reflector, ...]:
        """Objects, then reflectors: the order in which vertices and triangles are numbered everywhere."""
        return (*self.objects, *self.reflectors)

    @property
    def glossy(self) -> bool:
        """Whether there are highlights: an object with gloss, and a point light."""
        return bool(self.lights) and any(o.gloss is not None for o in self.objects)

    @property
    def vertices(self) -> int:
        return sum(len(part.mesh.vertices) for part in self.parts)

    @property
    def triangles(self) -> int:
        return sum(len(part.mesh.faces) for part in self.parts)

    @property
    def size(self) -> float:
        """Half the diagonal of the smallest mirror's box, or object's where there is no mirror; 1 without either."""
        boxes = [0.5 * float(np.linalg.norm(np.ptp(part.mesh.vertices, axis=0))) for part in self.reflectors or self.objects]
        return min((box for box in boxes if box > 0), default=1.0)

    @property
    def near_plane(self) -> float:
        """`near`, or what it is if nothing is said."""
        return NEAR * self.size if self.near is None else self.near

    @property
    def enclosed(self) -> tuple[bool, ...]:
        """Per reflector whether it stands wholly within walls, in all frames: the surroundings are nothing that it reflects.
        Found once per scene, in some tens of milliseconds; waits for the device."""
        return self._enclosed

    @cached_property
    def _enclosed(self) -> tuple[bool, ...]:
        from benchharness.kernels import enclosure

        return enclosure.enclosed(self)

    def poses(self, time: float) -> np.ndarray:
        """Poses of `parts` at a time, float64 [P, 3, 4]."""
        return np.stack([part.pose(time)[:3] for part in self.parts])

    def moves(self, one: float, other: float) -> bool:
        """Whether any part stands elsewhere at time `other` than at time `one`."""
        return bool((self.poses(one) != self.poses(other)).any())


def refined(scene: Scene) -> Scene:
    """The scene as it is drawn: its objects subdivided by `scene.h_max`, None afterwards; reflectors as they are.

    Comes after baking, so that the subdivision interpolates `Mesh.radiance` and does not decide where light is sampled.
    """
    if scene.h_max is None:
        return scene
    h_max = scene.h_max
    return replace(scene, objects=tuple(replace(o, mesh=subdivided(o.mesh, h_max)) for o in scene.objects), h_max=None)
