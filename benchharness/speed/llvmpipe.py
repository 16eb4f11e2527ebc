"""Mesa's llvmpipe as a rival: the same triangles and camera drawn by OpenGL on the processor, into float32 targets.

Needs moderngl (`pip install 'benchharness[speed]'`) and Mesa's EGL. Where something is missing, or EGL hands out another
renderer, `Llvmpipe` raises `Unavailable` and says what; so it does for scenes with textures, light maps or normal maps.
llvmpipe starts as many threads as Dr.Jit does.

Rows of the targets are rows of our pictures, the first at the top: y is not turned over, so that what is
counter-clockwise in space is clockwise here. As in `kernels.raster`, backs are culled of closed pieces alone.
"""

from __future__ import annotations

import os
from typing import Any

import drjit as dr
import numpy as np

from benchharness.kernels.geometry import oriented_closed_faces
from benchharness.scene import Scene

VERTEX = """
#version 330
uniform vec4 screen_x, screen_y, screen_w;
uniform vec2 size;
uniform float near;
in vec3 position;
in float part;
in vec3 value;
out vec3 p;
out vec3 shown;
flat out float number;
void main() {
    vec4 q = vec4(position, 1.0);
    float x = dot(screen_x, q), y = dot(screen_y, q), w = dot(screen_w, q);
    gl_Position = vec4(2.0 * x / size.x - w, 2.0 * y / size.y - w, w - 2.0 * near, w);
    p = position;
    shown = value;
    number = part;
}
"""

FRAGMENT = """
#version 330
#define TARGETS %d
uniform vec3 eye;
uniform float objects;
in vec3 p;
in vec3 shown;
flat in float number;
layout(location = 0) out vec4 position;
layout(location = 1) out vec4 normal;
#if TARGETS == 3
layout(location = 2) out vec4 radiance;
#endif
void main() {
    bool mirror = number >= objects;
    vec3 n = normalize(shown);
    n = dot(n, eye - p) < 0.0 ? -n : n;
    position = vec4(p, number + 1.0);
#if TARGETS == 3
    normal = vec4(mirror ? n : vec3(0.0), 0.0);
    radiance = vec4(mirror ? vec3(0.0) : shown, 0.0);
#else
    normal = vec4(mirror ? n : shown, 0.0);
#endif
}
"""

TARGETS = (3, 2)
"""Three: position and number of the part plus 1; a mirror's normal, turned to the eye; what else is seen's radiance. Two:
the same, with normal and radiance in one."""


class Unavailable(RuntimeError):
    """llvmpipe cannot be had here, or not for this scene; the message says why."""


class Llvmpipe:
    """Draws one baked scene at one moment into TARGETS of four floats each, and a depth buffer of 24 bits.

    Where nothing is drawn all targets are 0, the number of the part among them. Close it when done.
    """

    def __init__(self, scene: Scene, time: float, size: tuple[int, int]) -> None:
        if any(thing.mesh.texture is not None or thing.mesh.light is not None for thing in scene.objects):
            where = f"scene {scene.name} has textures or light maps"
            raise Unavailable(f"{where}, which are not drawn here; accepted: scenes without")
        if any(mirror.normal_map is not None for mirror in scene.reflectors):
            raise Unavailable(f"scene {scene.name} has normal maps, which are not drawn here; accepted: scenes without")
        self._context = _context()
        self.renderer: str = self._context.info["GL_RENDERER"]
        vertices, closed, open_ = _geometry(scene, time)
        content = [(self._context.buffer(vertices.tobytes()), "3f 1f 3f", "position", "part", "value")]
        pieces = [(self._context.buffer(f.tobytes()), culled) for f, culled in ((closed, True), (open_, False)) if len(f)]
        self._draws, self._targets, self._framebuffers = {}, {}, {}
        for count in TARGETS:
            program = self._program(scene, time, size, count)
            self._draws[count] = [(self._context.vertex_array(program, content, faces), culled) for faces, culled in pieces]
            self._targets[count] = [self._context.texture(size, 4, dtype="f4") for _ in range(count)]
            depth = self._context.depth_renderbuffer(size)
            self._framebuffers[count] = self._context.framebuffer(self._targets[count], depth)
        self._context.enable(self._context.DEPTH_TEST)
        self._context.front_face = "cw"

    def _program(self, scene: Scene, time: float, size: tuple[int, int], targets: int) -> Any:
        camera = scene.camera(time)
        x, y, w = camera.world_to_screen(*size)
        program = self._context.program(vertex_shader=VERTEX, fragment_shader=FRAGMENT % targets)
        vectors = {"screen_x": x, "screen_y": y, "screen_w": w, "size": size, "eye": camera.eye}
        for name, vector in vectors.items():
            program[name].value = tuple(map(float, vector))
        program["near"].value, program["objects"].value = float(scene.near_plane), float(len(scene.objects))
        return program

    def draw(self, targets: int = 3) -> None:
        """One frame; returns when it is done."""
        framebuffer = self._framebuffers[targets]
        framebuffer.use()
        framebuffer.clear(0.0, 0.0, 0.0, 0.0)
        for triangles, culled in self._draws[targets]:
            (self._context.enable if culled else self._context.disable)(self._context.CULL_FACE)
            triangles.render()
        self._context.finish()

    def read(self, targets: int = 3) -> tuple[np.ndarray, ...]:
        """What was drawn, row major, one row per pixel: number of the part int [N], -1 for none; then what is in each
        of the targets, float32 [N, 3]."""
        values = [np.frombuffer(target.read(), np.float32).reshape(-1, 4) for target in self._targets[targets]]
        return np.rint(values[0][:, 3]).astype(int) - 1, *(value[:, :3] for value in values)

    def close(self) -> None:
        self._context.release()


def _context() -> Any:
    """An OpenGL 3.3 context of llvmpipe without a window."""
    os.environ.setdefault("LP_NUM_THREADS", str(dr.thread_count()))
    os.environ.setdefault("LIBGL_ALWAYS_SOFTWARE", "1")
    os.environ.setdefault("GALLIUM_DRIVER", "llvmpipe")
    try:
        import moderngl  # pyright: ignore[reportMissingImports]
    except ImportError as error:
        raise Unavailable(f"moderngl cannot be imported ({error}); pip install 'benchharness[speed]'") from error
    try:
        context = moderngl.create_context(standalone=True, require=330, backend="egl")
    except Exception as error:  # whatever the loader and the driver raise
        raise Unavailable(
            f"no OpenGL 3.3 through EGL ({error}); install Mesa, on Debian libegl1 and libgl1-mesa-dri"
        ) from error
    if "llvmpipe" not in context.info["GL_RENDERER"]:
        found = context.info["GL_RENDERER"]
        context.release()
        raise Unavailable(f"EGL hands out {found!r}, which is not llvmpipe")
    return context


def _geometry(scene: Scene, time: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertices float32 [V, 7] in world space (position, part, radiance or a mirror's normal); faces uint32 [F, 3] of
    closed pieces, and the others."""
    vertices, faces, closed, start = [], [], [], 0
    for number, part in enumerate(scene.parts):
        mesh = part.mesh.transformed(part.pose(time))
        value = mesh.normals if number >= len(scene.objects) else mesh.radiance
        vertices.append(np.column_stack([mesh.vertices, np.full(len(mesh.vertices), number), np.asarray(value)]))
        faces.append(mesh.faces + start)
        closed.append(oriented_closed_faces(part.mesh.vertices, part.mesh.faces))
        start += len(mesh.vertices)
    triangles, whole = np.concatenate(faces).astype(np.uint32), np.concatenate(closed)
    return np.concatenate(vertices).astype(np.float32), triangles[whole], triangles[~whole]
