"""Our scene at one moment as a Mitsuba scene: the one place where the two meet.

`lighting` says what surfaces do:

"baked"      Every object emits its baked radiance (`Mesh.radiance`, interpolated over the triangle, or `Mesh.light`) to both
             sides and scatters nothing. Mitsuba's own area emitters shine to the front alone, hence ours. The material is a
             conductor of reflectance zero rather than a black diffuse one, which keeps the path integrator from sampling
             emitters: without that the picture has no noise at all. Highlights of point lights on objects with gloss are
             part of what they emit, with the baked visibility of the lights that the methods use too; there are no
             shadow rays. All objects without gloss are one mesh: what Mitsuba does before it traces grows with the
             square of the number of emitters, and took ten times as long as the rays of a small picture. Textures are a
             factor of what is emitted, but for highlights.
"transport"  Objects are diffuse on both sides (`Mesh.albedo` times the texture, vertex normals), glossy where they have gloss
             (which reflects everything, not only point lights), and emit where their author said so, to both sides; point
             lights cast traced shadows.
             Mitsuba can sample an emitter of constant radiance only: from one of a `mesh_attribute` most of the light
             is lost, silently. So a mesh is split: faces of one emission become one emitter each, and faces over which
             emission varies become one of `sampling_weight` 0, which paths find by chance.

In both, reflectors are smooth conductors with vertex normals (turned by normal maps), mirrors on both sides, so that the inside
of an open one is not black; they use their open mesh. The surroundings are a constant environment, or a panorama, which paths
sample too where they sample emitters. Radiance is linear RGB, as is.
"""

# pyright: reportArgumentType=false, reportCallIssue=false, reportAttributeAccessIssue=false
# The type stubs of Mitsuba and Dr.Jit know neither NumPy arguments nor points and vectors in one expression.

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import drjit as dr
import mitsuba as mi
import numpy as np

from benchharness.cache import source_hash
from benchharness.kernels import mitsuba_mesh
from benchharness.modelling import winding
from benchharness.render import mitsuba_gloss, mitsuba_light, mitsuba_normalmap, mitsuba_texture
from benchharness.scene import Gloss, Mesh, Object, PointLight, Reflector, Scene, merged

LIGHTINGS = ("baked", "transport")
SOURCES = (__file__, mitsuba_mesh.__file__)
"""What a scene is made by, for content hashes; see also `fingerprint`."""


def mitsuba_scene(scene: Scene, time: float, lighting: str, marks: Sequence[np.ndarray] | None = None) -> mi.Scene:
    """The scene at `time` seconds; `lighting` is "baked" or "transport".

    marks   per part of `scene.parts` a float [F]: given to Mitsuba as the attribute `face_mark` of that part's faces

    Raises ValueError for another lighting, and for "baked" where an object has no radiance, or gloss and no visibility.
    """
    if lighting not in LIGHTINGS:
        raise ValueError(f"lighting is {lighting!r}; accepted: {', '.join(LIGHTINGS)}")
    marks = [np.zeros(len(part.mesh.faces)) for part in scene.parts] if marks is None else marks
    shapes: list[mi.Mesh] = []
    matt: list[tuple[Mesh, np.ndarray]] = []
    around = _surroundings(scene)
    sampled = around is not None
    for part, mark in zip(scene.parts, marks, strict=True):
        mesh = part.mesh.transformed(part.pose(time))
        if isinstance(part, Reflector):
            shapes.append(_mirror(part, mesh, mark))
        elif lighting == "baked":
            if mesh.radiance is None:
                raise ValueError(f"object {part.name} has no radiance; accepted with baked lighting: what `bake` returned")
            if part.gloss is not None and scene.lights:
                shapes.append(_shining(part, part.gloss, mesh, mark, scene.lights))
            else:
                matt.append((mesh, mark))
        else:
            for chosen, emission, closed in _by_emission(mesh):
                shapes.append(_lit(part, mesh, chosen, mark, emission, closed=closed))
                sampled |= emission is not None and bool(emission.any())
    if matt:
        meshes, of_faces = zip(*matt, strict=True)
        shapes.append(_emitting("objects", meshes, np.concatenate(of_faces)))
    content: dict = {f"shape_{i:04d}": shape for i, shape in enumerate(shapes)}
    if lighting == "transport":
        for i, light in enumerate(scene.lights):
            content[f"light_{i}"] = {"type": "point", "position": list(light.position), "intensity": _rgb(light.intensity)}
            sampled = True

    # Mitsuba wants something to sample where there are emitters: a black environment stands in.
    emits = any(shape.is_emitter() for shape in shapes)
    if around is None and lighting == "transport" and emits and not sampled:
        around = {"type": "constant", "radiance": _rgb((0, 0, 0))}
    if around is not None:
        content["background"] = around
    # A ray through the middle of a pixel may run along an edge, and must not slip through.
    return mi.load_dict({"type": "scene", "embree_use_robust_intersections": True, **content})


def fingerprint(scene: Scene, time: float, lighting: str) -> list:
    """All that `mitsuba_scene` reads of a scene, for content hashes."""
    content: list = [lighting, tuple(map(float, scene.background))]
    if scene.environment is not None:
        content += ["environment", np.float32(scene.environment.radiance)]
    for part in scene.parts:
        mesh = part.mesh.transformed(part.pose(time))
        content += [np.float32(mesh.vertices), mesh.faces, np.float32(mesh.normals)]  # Mitsuba's precision
        if isinstance(part, Reflector):
            content += ["reflector", part.eta, part.k]
            if part.normal_map is not None:
                content += ["normal map", source_hash(*mitsuba_normalmap.SOURCES)]
                content += [part.normal_map.digest, part.normal_map.along, mesh.uv]
        else:
            content += [mesh.radiance] if lighting == "baked" else [mesh.albedo, mesh.emission]
            if mesh.texture is not None:
                content += ["texture", source_hash(mitsuba_texture.__file__), mesh.texture.digest, mesh.texture.along, mesh.uv]
            if mesh.light is not None and lighting == "baked":
                content += ["light", source_hash(mitsuba_light.__file__), mesh.light.digest, mesh.light_at]
            if part.gloss is not None and (scene.lights or lighting == "transport"):
                content += ["gloss", source_hash(mitsuba_gloss.__file__), part.gloss.specular, part.gloss.exponent]
                content += [mesh.visibility] if lighting == "baked" else []
    if scene.glossy or (scene.lights and lighting == "transport"):
        content += ["lights", *((light.position, light.intensity) for light in scene.lights)]
    return content


PANORAMA_TO_WORLD = np.array([[0.0, 0.0, -1.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
"""Mitsuba's panoramas have y up, and start in the direction of -z, which is our +x."""


def _surroundings(scene: Scene) -> dict | None:
    """What lights the scene from infinity; None where that is black."""
    if scene.environment is not None and scene.environment.radiance.any():
        seen = scene.environment.as_seen()
        if len(seen) == 2:  # Mitsuba makes three rows of two, in its own way
            seen = np.stack([seen[0], 0.5 * (seen[0] + seen[1]), seen[1]])
        return {"type": "envmap", "bitmap": mi.Bitmap(np.float32(seen)), "to_world": mi.ScalarTransform4f(PANORAMA_TO_WORLD)}
    return {"type": "constant", "radiance": _rgb(scene.background)} if np.any(scene.background) else None


def _rgb(value) -> dict:
    return {"type": "rgb", "value": [float(channel) for channel in value]}


def _mirror(reflector: Reflector, mesh: Mesh, mark: np.ndarray) -> mi.Mesh:
    """A reflector whose mesh is `mesh` in world space."""
    smooth, normals = _conductor(reflector), reflector.normal_map
    if normals is None:
        return _mesh(reflector.name, mesh, mark, bsdf=smooth)
    shape = _mesh(reflector.name, mesh, mark, uv=mesh.uv, bsdf=mitsuba_normalmap.bsdf(smooth, mesh, normals))
    mitsuba_normalmap.describe(shape, mesh, normals)
    return shape


def _conductor(reflector: Reflector) -> mi.BSDF:
    if (reflector.eta is None) != (reflector.k is None):
        given = f"eta is {reflector.eta}, k is {reflector.k}"
        raise ValueError(f"reflector {reflector.name}: {given}; accepted: both or none")
    metal = {"material": "none"} if reflector.eta is None else {"eta": _rgb(reflector.eta), "k": _rgb(reflector.k)}
    return mi.load_dict({"type": "twosided", "bsdf": {"type": "conductor", **metal}})


def _emitting(
    name: str, meshes: Sequence[Mesh], mark: np.ndarray, above: Callable[[mi.Texture], mi.Texture] | None = None
) -> mi.Mesh:
    """Meshes, as one, that shine with their baked radiance; `above` makes of that what is seen."""
    black = mi.load_dict({"type": "conductor", "specular_reflectance": _rgb((0, 0, 0))})
    of_vertices = mi.load_dict({"type": "mesh_attribute", "name": "vertex_radiance"})
    radiance = mitsuba_texture.coloured(mitsuba_light.mapped(of_vertices, meshes), meshes)
    emitter = _shining_both_ways(radiance if above is None else above(radiance))
    mesh = merged(*(replace(one, uv=None, texture=None, light=None) for one in meshes))
    shape = _mesh(name, mesh, mark, bsdf=black, emitter=emitter, face_normals=True)
    shape.add_attribute("vertex_radiance", 3, np.float32(mesh.radiance).ravel())
    mitsuba_texture.describe(shape, meshes)
    return shape


def _shining_both_ways(radiance: mi.Texture, sampling_weight: float = 1.0) -> mi.Emitter:
    """An area emitter that emits to the front and to the back of its shape alike."""

    class Sheet(mi.Emitter):
        def __init__(self) -> None:
            properties = mi.Properties()
            properties["sampling_weight"] = sampling_weight
            super().__init__(properties)
            self.m_flags = mi.EmitterFlags.Surface

        def eval(self, si, active=True):
            return radiance.eval(si, active)

        def eval_direction(self, it, ds, active=True):
            return self.eval(mi.SurfaceInteraction3f(ds, it.wavelengths), active)

        def sample_direction(self, it, sample, active=True):
            ds = self.get_shape().sample_direction(it, sample, active)
            ds.emitter = mi.EmitterPtr(self)
            active = active & (ds.pdf > 0)
            L = self.eval(mi.SurfaceInteraction3f(ds, it.wavelengths), active)
            return ds, dr.select(active, L / ds.pdf, 0)

        def pdf_direction(self, it, ds, active=True):
            return dr.select(active, self.get_shape().pdf_direction(it, ds, active), 0)

        def bbox(self):
            return self.get_shape().bbox()

        def to_string(self) -> str:
            return f"Sheet[{radiance}]"

    return Sheet()


def _shining(part: Object, gloss: Gloss, mesh: Mesh, mark: np.ndarray, lights: Sequence[PointLight]) -> mi.Mesh:
    """The same, with the highlights of lights."""
    shape = _emitting(part.name, [mesh], mark, lambda baked: mitsuba_gloss.radiance(baked, gloss, lights))
    mitsuba_gloss.describe(shape, mesh.normals, part.seen(len(lights)))
    return shape


def _lit(
    part: Object, mesh: Mesh, chosen: np.ndarray, mark: np.ndarray, emission: np.ndarray | None, *, closed: bool
) -> mi.Mesh:
    """Faces `chosen` as a surface with one emission [3], or with what varies over its faces for None; of `closed` pieces."""
    albedo = mitsuba_texture.coloured(mi.load_dict({"type": "mesh_attribute", "name": "vertex_albedo"}), [mesh])
    front = {"type": "diffuse", "reflectance": albedo}
    if part.gloss is not None:
        front = mitsuba_gloss.bsdf(part.gloss, albedo)
    parts: dict = {"bsdf": mi.load_dict({"type": "twosided", "bsdf": front})}
    if emission is None:
        varying = mi.load_dict({"type": "mesh_attribute", "name": "vertex_emission"})
        parts["emitter"] = _shining_both_ways(varying, 0.0)
    elif emission.any():
        if closed:  # no back of it is seen, and half of the samples would go there
            parts["emitter"] = mi.load_dict({"type": "area", "radiance": _rgb(emission)})
        else:
            constant = {"type": "srgb", "color": mi.ScalarColor3f(*map(float, emission)), "unbounded": True}
            parts["emitter"] = _shining_both_ways(mi.load_dict(constant))
    used, faces = np.unique(mesh.faces[chosen], return_inverse=True)
    piece = Mesh(
        vertices=mesh.vertices[used],
        faces=faces.reshape(-1, 3),
        normals=np.asarray(mesh.normals)[used],
        albedo=np.asarray(mesh.albedo)[used],
        emission=np.asarray(mesh.emission)[used],
        uv=None if mesh.uv is None else mesh.uv[used],
        texture=mesh.texture,
    )
    shape = _mesh(part.name, piece, mark[chosen], **parts)
    shape.add_attribute("vertex_albedo", 3, np.float32(piece.albedo).ravel())
    mitsuba_texture.describe(shape, [piece])
    if emission is None:
        shape.add_attribute("vertex_emission", 3, np.float32(piece.emission).ravel())
    return shape


def _by_emission(mesh: Mesh) -> Iterator[tuple[np.ndarray, np.ndarray | None, bool]]:
    """Splits faces by what they emit: (indices of faces, their emission [3], or None where it varies over a face, and whether
    they are of closed pieces, asked of what emits)."""
    corners = np.asarray(mesh.emission)[mesh.faces]
    constant = (corners == corners[:, :1]).all(axis=(1, 2))
    values, which = np.unique(corners[:, 0], axis=0, return_inverse=True)
    closed_faces = np.zeros(len(constant), bool)
    if values.any():
        found = winding.pieces(mesh)
        closed_faces = found.closed[found.piece] & found.two_sided[found.piece]
    for i, value in enumerate(values):
        chosen = constant & (which.ravel() == i)
        sealed = closed_faces if value.any() else np.zeros(len(constant), bool)
        for mine, closed in ((chosen & ~sealed, False), (chosen & sealed, True)):
            if mine.any():
                yield np.flatnonzero(mine), value, closed
    if not constant.all():
        yield np.flatnonzero(~constant), None, False


def _mesh(name: str, mesh: Mesh, mark: np.ndarray, **parts) -> mi.Mesh:
    """World-space mesh; `parts` are its uv, BSDF, emitter and flags."""
    normals = None if parts.get("face_normals", False) else np.asarray(mesh.normals)
    shape = mitsuba_mesh.mesh(name, mesh.vertices, mesh.faces, normals, **parts)
    shape.add_attribute("face_mark", 1, np.float32(mark).ravel())
    return shape
