"""Scene + time + camera -> Frame: the rasterized first hit of every pixel (G-buffer).

The geometry is uploaded once; it is posed again only when a part moved. Everything that changes from frame to frame goes
in as opaque arrays, so that no frame compiles a kernel.
"""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np

from benchharness.api import Frame, Surface, View
from benchharness.kernels import geometry, lighting, normalmap, optics, raster, shown, surroundings
from benchharness.kernels.frozen import frozen
from benchharness.scene import Camera, Mesh, Reflector, Scene


def opaque(kind, values):
    """A Dr.Jit array of `values` that no kernel sees as a literal."""
    array = kind(*(float(v) for v in np.ravel(values))) if dr.depth_v(kind) > 1 else kind(values)
    dr.make_opaque(array)
    return array


FAR = 8.0  # units; from an eye this deep before the world's origin, depths are told from there


def view_of(camera: Camera, width: int, height: int, near: float) -> View:
    """The camera on the device; pixel centres at + 0.5, rows downwards."""
    right, down, forward = camera.axes()
    focal = 0.5 * height / np.tan(0.5 * np.radians(camera.fov_deg))
    x, y, w = camera.world_to_screen(width, height)
    axis = forward - (0.5 * width * right + 0.5 * height * down) / focal
    depth = w[3] if w[3] >= FAR else 0.0
    return View(
        eye=opaque(mi.Point3f, camera.eye),
        x=opaque(mi.Vector4f, x),
        y=opaque(mi.Vector4f, y),
        w=opaque(mi.Vector4f, w),
        right=opaque(mi.Vector3f, right / focal),
        down=opaque(mi.Vector3f, down / focal),
        axis=opaque(mi.Vector3f, axis),
        depth=opaque(mi.Float, depth),
        origin=opaque(mi.Point3f, camera.eye + depth * axis),
        near=opaque(mi.Float, near),
        width=width,
        height=height,
    )


def surface_of(mesh: Mesh) -> Surface:
    """A reflector's mesh on the device, object space."""
    zeros = np.zeros((len(mesh.vertices), 1))
    packed = np.hstack([mesh.vertices, zeros, mesh.normals, zeros]).astype(np.float32)
    tags = np.where(geometry.oriented_closed_faces(mesh.vertices, mesh.faces), raster.CLOSED, 0)
    faces = np.hstack([mesh.faces, tags[:, None]]).astype(np.uint32)
    return Surface(mi.Float(packed.ravel()), mi.UInt32(faces.ravel()), len(mesh.vertices), len(mesh.faces))


class FrameRenderer:
    """Renders the frames of one baked scene at one size. Raises ValueError for a scene that has not been baked."""

    def __init__(self, scene: Scene, width: int, height: int) -> None:
        for part in scene.objects:
            if part.mesh.radiance is None:
                raise ValueError(f"scene {scene.name}: object {part.name} has no baked radiance; bake the scene first")
        self.scene, self.width, self.height = scene, width, height
        self.geometry = geometry.of_scene_seen(scene)
        self.surfaces = [surface_of(r.mesh) for r in scene.reflectors]
        self.proxies = [self.surfaces[i] if r.closed is None else surface_of(r.closed) for i, r in enumerate(scene.reflectors)]
        self.surroundings = surroundings.of_scene(scene)
        metals = [(r.eta, r.k) for r in scene.reflectors]
        self.eta = [None if eta is None else opaque(mi.Color3f, eta) for eta, _ in metals]
        self.k = [None if eta is None else opaque(mi.Color3f, k) for eta, k in metals]
        self.enclosed = scene.enclosed  # found here, and in no method's time
        self._posed: tuple[np.ndarray, mi.Float, geometry.Geometry] | None = None

    def view(self, index: int) -> View:
        return view_of(self.scene.camera(self.scene.time(index)), self.width, self.height, self.scene.near_plane)

    def render(self, index: int) -> Frame:
        """The frame number `index` of the animation, evaluated."""
        frame = self.draw(index, self.view(index))
        dr.eval(frame)
        return frame

    def draw(self, index: int, view: View) -> Frame:
        """Frame `index` as seen by `view`: the part of `render` that is timed as `gbuffer_ms`. Its `boxes` are those of the
        scene's own camera."""
        poses, world = self._placed(self.scene.poses(self.scene.time(index)))
        visibility = raster.rasterize(world.points, world.faces, world.face_count, view, cull="back")
        reflector, active, p, n, radiance = _first_hits(world, visibility, self.surroundings, view, len(self.scene.objects))
        pixels = mi.UInt32(dr.compress(active))
        v = dr.normalize(mi.Vector3f(view.eye - p))
        time = self.scene.time(index)
        return Frame(
            index=index,
            time=time,
            view=view,
            poses=poses,
            reflector=reflector,
            active=active,
            pixels=pixels,
            p=p,
            n=n,
            v=v,
            radiance=radiance,
            surfaces=self.surfaces,
            proxies=self.proxies,
            boxes=self.boxes(self.scene.camera(time), time),
        )

    def boxes(self, camera: Camera, time: float) -> list[tuple[int, int, int, int]]:
        """Per reflector the pixels that its proxy may be seen in; far beyond the picture where it reaches behind the eye."""
        rows = camera.world_to_screen(self.width, self.height)
        return [self._box(reflector, rows, time) for reflector in self.scene.reflectors]

    def _box(self, reflector: Reflector, rows: np.ndarray, time: float) -> tuple[int, int, int, int]:
        pose = reflector.pose(time)
        vertices = (reflector.closed or reflector.mesh).vertices @ pose[:3, :3].T + pose[:3, 3]
        q = vertices @ rows[:, :3].T + rows[:, 3]
        if (q[:, 2] <= self.scene.near_plane).any():
            return (-10 * self.width, -10 * self.height, 11 * self.width, 11 * self.height)
        pixels = q[:, :2] / q[:, 2:]
        (left, top), (right, bottom) = np.floor(pixels.min(axis=0)), np.ceil(pixels.max(axis=0))
        return int(left), int(top), int(right), int(bottom)

    def compose(self, frame: Frame, L: mi.Color3f) -> mi.Color3f:
        """The whole picture from what a method answered: mirrors show `L` times their reflectance."""
        return composed(frame.radiance, L, frame.n, frame.v, frame.reflector, self.eta, self.k)

    def _placed(self, poses: np.ndarray) -> tuple[mi.Float, geometry.Geometry]:
        """The poses on the device, and the triangles there, with the mirrors' normals in world space too."""
        if self._posed is None or (poses != self._posed[0]).any():
            rows = opaque(mi.Float, poses.astype(np.float32).ravel())
            world = geometry.placed_seen(self.geometry, rows, len(self.scene.objects))
            dr.eval(world)
            self._posed = poses, rows, world
        return self._posed[1:]


@frozen
def _first_hits(world: geometry.Geometry, visibility, around: surroundings.Surroundings, view: View, objects: int):
    """Reflector number, point, normal and radiance at every pixel centre. The attributes of mirrors are their normals."""
    lane = dr.arange(mi.UInt32, view.width * view.height)
    seen = shown.at(world, visibility, around, view, lane)
    p, value = seen.p, seen.value
    reflector = dr.select(seen.hit, mi.Int32(seen.part) - objects, -1)
    reflector = dr.select(reflector >= 0, reflector, -1)
    mirror = reflector >= 0
    n = dr.normalize(mi.Vector3f(value.x, value.y, value.z))
    if world.normal_maps is not None:
        spot = lighting.Spot(world.points, seen.face, seen.part, seen.weights)
        n = normalmap.turned(world.normal_maps, spot, n, dr.normalize(mi.Vector3f(view.eye - p)), mirror)
    n = dr.select(mirror, dr.select(dr.dot(n, mi.Vector3f(view.eye - p)) < 0, -n, n), 0)
    return reflector, mirror, dr.select(mirror, p, 0), mi.Normal3f(n), dr.select(mirror, 0, value)


@frozen
def composed(radiance: mi.Color3f, L: mi.Color3f, n: mi.Normal3f, v: mi.Vector3f, reflector: mi.Int32, eta: list, k: list):
    """The picture: what is seen directly, and each reflector's reflectance times what it shows."""
    image = mi.Color3f(radiance)
    cos_theta = dr.clip(dr.abs(dr.dot(mi.Vector3f(n), v)), 0, 1)
    for i in range(len(eta)):
        reflectance = optics.fresnel_conductor(mi.Float(cos_theta), eta[i], k[i]) if eta[i] is not None else mi.Color3f(1)
        image = dr.select(reflector == i, reflectance * L, image)
    return image
