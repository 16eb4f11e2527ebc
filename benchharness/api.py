"""The method contract: all that a method author reads.

A method is a frozen dataclass in a file of its own; its fields are its parameters. It is given a scene once
(`prepare`), told when something moved (`update`) and asked for every frame (`shade`). State goes in and comes out;
`self` never changes. The harness owns time, synchronisation and files.

Device arrays are Mitsuba's types of the active variant (`mi.Float`, `mi.Point3f`, ...). Per-pixel arrays have one lane
per pixel, row major: lane = row * width + column. All positions and directions are in world space.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

import mitsuba as mi

if TYPE_CHECKING:
    from benchharness.scene import Scene


@dataclass
class View:
    """A pinhole camera on the device. All arrays are opaque, so that a new frame compiles nothing.
    eye                position
    x, y, w            world to screen: pixel column = (x · (P, 1)) / (w · (P, 1)), row likewise with y; w · (P, 1) is depth
    right, down, axis  the ray through column c, row r (centres at + 0.5) has direction axis + c right + r down, unnormalised
    depth, origin      and passes through origin + depth (c right + r down), whose depth that is: near the mirrors where the eye
                       is far from them, else the eye itself and 0 (`kernels.depths`)
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

    index, time  number in the animation, which other cameras may have too; seconds. view: the camera
    poses        12 floats per part (`scene.parts`): rows of its 3 x 4 object-to-world matrix
    reflector    number of the reflector seen, 0 ..; -1 where none is
    active       reflector >= 0
    pixels       the lanes with `active`, ascending; its length is the number of reflector pixels
    p, n         first hit and its interpolated unit normal, turned to the eye; defined where `active`
    v            unit direction from the hit to the eye
    radiance     directly seen radiance; 0 where `active`
    surfaces     per reflector, as it is seen (open)
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
    """What a vertex-driven method found, one lane per (reflector, vertex of `scene.parts`), reflector major.

    valid     converged, and the mirror hides R neither from the eye nor from the vertex; nothing that draws needs it, so it may
              be an array that is evaluated, and costs rays, when it is read
    region    0 unknown, 1 reflected (A), 2 unreflected (B), 3 hidden (C)
    residual  |half vector - normal| at R; border: the search ended at the edge of the reflector's image
    further   a vertex's second reflection and so on, 0 for none; the first has not converged where there is no room for all"""

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


class Method(ABC):
    """Base of all methods. Subclasses are `@dataclass(frozen=True)`.

    paper   whose idea it is
    limits  entry of the catalogue of failures, as in `Regime.entry` -> why the method may fail there and cannot know
    """

    paper: ClassVar[str]
    limits: ClassVar[dict[str, str]] = {}

    def refuses(self, scene: Scene) -> str | None:
        """A sentence why this method cannot serve the scene, or None."""
        return None

    @abstractmethod
    def prepare(self, scene: Scene) -> Any:
        """Once per scene: the state that the other two start from. Timed as `prepare_ms`."""

    def update(self, state: Any, frame: Frame) -> Any:
        """Once at the start and whenever a part moved: what does not depend on the eye; other cameras may follow. Timed as
        `update_ms`."""
        return state

    @abstractmethod
    def shade(self, state: Any, frame: Frame) -> tuple[Reflection, Any]:
        """Every frame, never twice the same while time is taken. No NumPy, no printing. Timed as `shade_ms`."""
