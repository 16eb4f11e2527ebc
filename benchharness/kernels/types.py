"""The types of the method contract, of which `benchharness.api` says what holds for all, and what kernels read of a scene."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import mitsuba as mi
import numpy as np


@dataclass
class View:
    """A pinhole camera on the device. All arrays are opaque, so that a new frame compiles nothing.

    eye                position
    x, y, w            world to screen: pixel column = (x · (P, 1)) / (w · (P, 1)), row likewise with y; w · (P, 1) is depth
    right, down, axis  the ray through column c, row r (centres at + 0.5) has direction axis + c right + r down, unnormalised
    depth, origin      and passes through origin + depth (c right + r down), whose depth that is: near the mirrors where the eye
                       is far from them, else the eye itself and 0 (`kernels.depths`)
    near               depth below which nothing is drawn
    width, height      pixels
    """

    eye: mi.Point3f
    x: mi.Vector4f
    y: mi.Vector4f
    w: mi.Vector4f
    right: mi.Vector3f
    down: mi.Vector3f
    axis: mi.Vector3f
    depth: mi.Float
    origin: mi.Point3f
    near: mi.Float
    width: int
    height: int


@dataclass
class Surface:
    """A reflector's triangles on the device, object space.

    vertices   8 floats per vertex: position, 0, normal, 0
    faces      4 integers per triangle: three vertices, and `kernels.raster.CLOSED` where its back is never seen
    """

    vertices: mi.Float
    faces: mi.UInt32
    vertex_count: int
    face_count: int


@dataclass
class Frame:
    """What the harness knows about a frame before any method runs: the rasterized first hit of every pixel. It is lent for
    one call; what is written into it, nobody else sees.

    index, time  number in the animation, which other cameras may have too; seconds. The harness reads them, no method need
    view         the camera
    poses        12 floats per part (`scene.parts`): rows of its 3 x 4 object-to-world matrix
    reflector    number of the reflector seen, 0 ..; -1 where none is
    active       reflector >= 0
    pixels       the lanes with `active`, ascending; its length is the number of reflector pixels
    p, n         first hit and its interpolated unit normal, turned by a normal map and to the eye; defined where `active`
    v            unit direction from the hit to the eye
    radiance     directly seen radiance; 0 where `active`
    surfaces     per reflector, as it is seen (open), without normal map: for methods of others, those here search `proxies`
    proxies      per reflector, its closed stand-in, or the same as the surface
    boxes        per reflector, left, top, right, bottom: no pixel outside can show its proxy; may reach beyond the picture
    doubts       whether `Reflection.doubt` is wanted; never while time is taken
    """

    index: int
    time: float
    view: View
    poses: mi.Float
    reflector: mi.Int32
    active: mi.Bool
    pixels: mi.UInt32
    p: mi.Point3f
    n: mi.Normal3f
    v: mi.Vector3f
    radiance: mi.Color3f
    surfaces: list[Surface]
    proxies: list[Surface]
    boxes: list[tuple[int, int, int, int]]
    doubts: bool = False


@dataclass
class Vertices:
    """What a vertex-driven method found, one lane per (reflector, vertex of `scene.parts`), reflector major. The harness
    measures R, virtual, converged, region and iterations; regimes and tests read the rest too.

    R, n        the reflection point and the mirror's unit normal there
    virtual     where the image of the vertex is drawn
    converged   R is a reflection point, as near as the method can tell
    valid       converged, and the mirror hides R neither from the eye nor from the vertex; nothing that draws needs it, so it
                may be an array that is evaluated, and costs rays, when it is read
    region      0 unknown, 1 reflected (A), 2 unreflected (B), 3 hidden (C)
    iterations  points at which the search looked; 0 for what was not searched
    residual    |half vector - normal| at R
    border      the search ended at the edge of the reflector's image
    further     a vertex's second reflection and so on, 0 for none; the first has not converged where there is no room for all
    """

    R: mi.Point3f
    n: mi.Normal3f
    virtual: mi.Point3f
    converged: mi.Bool
    valid: mi.Bool
    region: mi.UInt32
    iterations: mi.UInt32
    residual: mi.Float
    border: mi.Bool
    further: list[Vertices] = field(default_factory=list)


@dataclass
class Reflection:
    """A method's answer, one lane per pixel; only lanes with `frame.active` are read.

    L         radiance arriving along the reflected ray, before the mirror's own reflectance
    distance  length of the reflected ray to what it shows; inf for the surroundings
    found     False where the method has no answer. The surroundings are none where `Scene.enclosed` holds the mirror: what
              ends there was lost
    vertices  for vertex-driven methods
    counters  name -> one array of integers, summed by the harness: deterministic work of this frame
    doubt     True where the method has an answer and knows that it may show the wrong thing, or the right one more than
              two pixels off; None from a method that never knows, and where `Frame.doubts` is False
    """

    L: mi.Color3f
    distance: mi.Float
    found: mi.Bool
    vertices: Vertices | None = None
    counters: dict[str, mi.UInt32] = field(default_factory=dict)
    doubt: mi.Bool | None = None


class MeshLike(Protocol):
    """What kernels read of a `benchharness.scene.Mesh`: float64 [V, 3], int32 [F, 3] for the faces, and [V, 2] for uv."""

    @property
    def vertices(self) -> np.ndarray: ...
    @property
    def normals(self) -> np.ndarray: ...
    @property
    def faces(self) -> np.ndarray: ...
    @property
    def radiance(self) -> np.ndarray | None: ...
    @property
    def uv(self) -> np.ndarray | None: ...
    @property
    def texture(self) -> Any: ...
    def transformed(self, pose: np.ndarray) -> MeshLike: ...


class PartLike(Protocol):
    """What kernels read of an object; `seen(lights)` is [V, lights] in [0, 1]: how much of each light its vertices see."""

    @property
    def name(self) -> str: ...
    @property
    def mesh(self) -> MeshLike: ...
    @property
    def motion(self) -> Callable[[float], np.ndarray] | None: ...
    @property
    def gloss(self) -> Any: ...
    def pose(self, time: float) -> np.ndarray: ...
    def seen(self, lights: int) -> np.ndarray: ...


class ReflectorLike(Protocol):
    """What kernels read of a mirror."""

    @property
    def mesh(self) -> MeshLike: ...
    @property
    def closed(self) -> MeshLike | None: ...
    @property
    def normal_map(self) -> Any: ...
    @property
    def eta(self) -> Sequence[float] | None: ...
    @property
    def k(self) -> Sequence[float] | None: ...
    @property
    def motion(self) -> Callable[[float], np.ndarray] | None: ...
    def pose(self, time: float) -> np.ndarray: ...


class SceneLike(Protocol):
    """What kernels read of a `benchharness.scene.Scene`; `parts` are the objects, then the mirrors."""

    @property
    def objects(self) -> Sequence[PartLike]: ...
    @property
    def reflectors(self) -> Sequence[ReflectorLike]: ...
    @property
    def parts(self) -> Sequence[PartLike | ReflectorLike]: ...
    @property
    def lights(self) -> Sequence[Any]: ...
    @property
    def glossy(self) -> bool: ...
    @property
    def background(self) -> Sequence[float]: ...
    @property
    def environment(self) -> Any: ...
    @property
    def enclosed(self) -> Sequence[bool]: ...
    @property
    def unit(self) -> float: ...
    @property
    def frames(self) -> int: ...
    def time(self, frame: int) -> float: ...
    def poses(self, time: float) -> np.ndarray: ...
