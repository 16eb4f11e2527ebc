"""Diffuse light per vertex, path-traced by Mitsuba with all of the scene's transport, mirrors included.

The radiance that leaves a vertex is

    L = L_e + ρ ∫ L_i(ω) K(ω) dω,    K(ω) = (max(0, n·ω) + max(0, n·ω')) / π

emission, albedo ρ, and incoming radiance under the cosine about the vertex normal n. A texture, a factor of the albedo, is no
part of ρ here: it is put on where the surface is looked at, by paths that come by too. Over a curved mesh part of that
hemisphere lies below the face; those directions are mirrored at the face (ω', ω with its component along the face
normal turned round), which keeps the energy: in uniform light a convex mesh gets exactly ρ L_i. On flat surfaces K is
cos/π.

L_i is averaged over points around the vertex, with the density of the vertex's hat function: linear over the incident
faces, one at the vertex, zero at its neighbours. A vertex thus stands for its neighbourhood, and one that touches
another surface is not black. Points inside a closed part of the scene (floor under a table leg) are not counted; a
vertex that has no other point takes the mean of its neighbours.

With `Scene.lightmaps`, light is found in the same way at more places than vertices (`benchharness.render.finer`), so that it
does not hang on how finely surfaces are cut: a floor of two triangles is lit as one of thousands. The scene itself is not cut.
What is seen is what a mesh cut there would show, and it is kept in maps (`benchharness.modelling.lightmap`). Vertices have
light all the same, for triangles that are small, and for whoever looks at nothing else.

Where there are highlights (`Scene.glossy`), the share of each point light that is seen is baked too: over the same points,
as far as their faces are turned to the light. So a shadow's edge is as wide as the triangles it is drawn with, and a curved
mesh does not shade itself in facets where it turns away; there the normals make an end. A vertex without such a point
takes the mean of its neighbours.

Emitters are sampled from the vertex as well as hit by chance, weighted by the power heuristic. All vertices use the
same random numbers, Sobol' points for the first segment: what error remains is alike for neighbours and shows as faint
blotches rather than noise. A mirror's caustics are found by chance and converge last.

Poses are those at time 0; shadows and bounces do not follow objects that move. The back of an open sheet has no light
of its own: it shows that of its front.

What is traced is the normalised scene (`benchharness.render.normalisation`), wherever the given one stands.

Vertices are traced some at a time, and those that are done are kept until all are (`cache.Parts`), so that a bake that is
killed goes on from there: no vertex depends on which others are traced with it.
"""

# pyright: reportArgumentType=false, reportCallIssue=false, reportAttributeAccessIssue=false
# The type stubs of Mitsuba and Dr.Jit know neither NumPy arguments nor points and vectors in one expression.

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import count, pairwise

import drjit as dr
import mitsuba as mi
import numpy as np
from scipy.stats import qmc

import benchharness.cache as cache
import benchharness.render.mitsuba_scene as mitsuba_scene
from benchharness.modelling import lightmesh, winding
from benchharness.modelling.lightmesh import LightMesh, filled
from benchharness.render import finer, lightmaps, making
from benchharness.render.normalisation import normalised
from benchharness.scene import Mesh, PointLight, Scene

LANES = 1 << 20
"""Paths traced at once: bounds memory (under 1 GB)."""


def bake(scene: Scene, spp: int = 512, max_depth: int = 6, seed: int = 0) -> Scene:
    """The scene with `radiance` set in every mesh, a reflector's is zero; the objects' `visibility` if it is glossy, and
    `light` if it has lightmaps: then triangles do not share all vertices that they shared. Cached by content.

    spp        paths per vertex; a power of two serves the Sobol' points best
    max_depth  segments of a path, counted from the vertex: 1 is light that comes straight from emitters
    seed       of the random numbers; same seed, same result, bit for bit

    Raises ValueError for spp or max_depth below 1, and a negative seed.
    """
    for name, value, least in (("spp", spp, 1), ("max_depth", max_depth, 1), ("seed", seed, 0)):
        if int(value) != value or value < least:
            raise ValueError(f"bake: {name} is {value!r}; accepted: whole numbers from {least}")
    local = normalised(scene)
    key = cache.content_hash(
        cache.source_hash(__file__, winding.__file__, lightmesh.__file__, *mitsuba_scene.SOURCES),
        (mi.__version__, mi.variant()),
        mitsuba_scene.fingerprint(local, 0.0, "transport"),
        (int(spp), int(max_depth), int(seed)),
        [cache.source_hash(*lightmaps.SOURCES)] if scene.lightmaps else [],
    )
    options = int(spp), int(max_depth), int(seed)
    baked = cache.cached_in_parts("bake", key, lambda parts: _light(local, _Tracing(*options, parts)))
    meshes = [part.mesh for part in scene.objects]
    meshes = (lightmaps.applied if scene.lightmaps and scene.objects else _applied)(meshes, baked)
    objects = (replace(part, mesh=mesh) for part, mesh in zip(scene.objects, meshes, strict=True))
    black = np.zeros(3)
    reflectors = [replace(part, mesh=replace(part.mesh, radiance=black)) for part in scene.reflectors]
    return replace(scene, objects=tuple(objects), reflectors=tuple(reflectors))


def _applied(meshes: Sequence[Mesh], arrays: cache.Arrays) -> list[Mesh]:
    """The meshes with what was found at their vertices, in a row."""
    ends = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    rows = [{name: a[start:end] for name, a in arrays.items()} for start, end in pairwise(ends)]
    return [replace(mesh, light=None, **found) for mesh, found in zip(meshes, rows, strict=True)]


@dataclass(frozen=True)
class _Tracing:
    """How paths are traced, as in `bake`, and where vertices are kept that are done."""

    spp: int
    max_depth: int
    seed: int
    parts: cache.Parts


def _light(scene: Scene, tracing: _Tracing) -> cache.Arrays:
    """Radiance of all objects' vertices, float32 [V, 3]; and visibility, float32 [V, L], if the scene is glossy. With lightmaps
    what `lightmaps.found` says, in the place of the former."""
    if not scene.objects:
        return {"radiance": np.zeros((0, 3), np.float32)}
    meshes = [part.mesh.transformed(part.pose(0.0)) for part in scene.objects]
    world = mitsuba_scene.mitsuba_scene(scene, 0.0, "transport", [winding.closed_faces(part.mesh) for part in scene.parts])
    rounds = count()

    def arriving(mesh: LightMesh, chosen: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        vertices, number = _Vertices(mesh.places, mesh.normals, mesh.faces), next(rounds)
        stage = f"finer light, {number} of at most {finer.ROUNDS} times" if number else "light"
        incoming, counted, batches, *_ = _incoming(scene, world, vertices, chosen, tracing, stage)
        return incoming, counted, batches

    arrays = {}
    if not scene.lightmaps or scene.glossy:
        arrays = _at_vertices(scene, world, meshes, tracing)
    if not scene.lightmaps:
        return arrays
    found = lightmaps.found(meshes, scene.size, arriving)
    if scene.glossy:
        starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])[:-1]
        found["visibility"] = arrays["visibility"][found["source"] + np.repeat(starts, found["counts"][:, 0])]
    return found


def _at_vertices(scene: Scene, world: mi.Scene, meshes: Sequence[Mesh], tracing: _Tracing) -> cache.Arrays:
    """Radiance at vertices, and visibility if the scene is glossy."""
    starts = np.cumsum([0] + [len(mesh.vertices) for mesh in meshes])
    p, n = (np.concatenate([np.asarray(getattr(mesh, name)) for mesh in meshes]) for name in ("vertices", "normals"))
    faces = np.concatenate([mesh.faces + start for mesh, start in zip(meshes, starts, strict=False)])
    every = np.arange(len(p))
    incoming, counted, _, *seen = _incoming(scene, world, _Vertices(p, n, faces), every, tracing, "light at vertices")
    out, visibility, start = [], [], 0
    for mesh in meshes:
        end = start + len(mesh.vertices)
        arrives = filled(incoming[start:end], counted[start:end], mesh.faces)
        out.append(np.asarray(mesh.emission) + np.asarray(mesh.albedo) * arrives)
        each = [filled(share[start:end, None], turned[start:end], mesh.faces) for share, turned in seen]
        visibility.append(np.concatenate(each, axis=1) if each else None)
        start = end
    arrays = {"radiance": out} | ({"visibility": visibility} if seen else {})
    return {name: np.concatenate(values).astype(np.float32) for name, values in arrays.items()}


class _Vertices:
    """Vertices, and their incident faces.

    p, n        float64 [V, 3]
    corners     float64 [C, 3, 3], one per vertex of a face, sorted by vertex: that vertex, then the other two, in order
    face_n      float64 [C, 3] unit normals of those faces
    owner, cdf  [C]: the vertex, and the share of its area up to and including this face
    """

    def __init__(self, p: np.ndarray, n: np.ndarray, faces: np.ndarray) -> None:
        self.p, self.n = p, n
        turned = np.concatenate([np.roll(faces, -k, axis=1) for k in range(3)])
        p = self.p[turned]
        crossed = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
        twice_area = np.linalg.norm(crossed, axis=1)
        real = twice_area > 1e-12 * np.ptp(self.p, axis=0).max() ** 2
        order = np.flatnonzero(real)[np.argsort(turned[real, 0], kind="stable")]
        self.owner = turned[order, 0].astype(np.int64)
        self.corners = p[order]
        self.face_n = crossed[order] / twice_area[order, None]
        total = np.cumsum(twice_area[order])
        before = np.concatenate([[0.0], total])[np.searchsorted(self.owner, self.owner)]
        last = total[np.searchsorted(self.owner, self.owner, side="right") - 1]
        self.cdf = (total - before) / (last - before)


def _incoming(scene: Scene, world: mi.Scene, vertices: _Vertices, chosen: np.ndarray, tracing: _Tracing, stage: str) -> list:
    """Mean of L_i under K, float64 [V, 3]; how many paths it is the mean of, int [V]; with lightmaps the same of batches of the
    paths, float64 [V, B, 3]; and per light, if the scene is glossy, the share of points that see it, float64 [V], and of how
    many, int [V]. 0 for vertices that are not chosen. `stage`: of the bake, in words."""
    spp, seed = tracing.spp, tracing.seed
    integrator = mi.load_dict({"type": "path", "max_depth": tracing.max_depth, "rr_depth": 1 << 20})
    sampler = _common_sampler(spp)
    sobol = qmc.Sobol(7, scramble=True, rng=np.random.default_rng(seed))
    points = sobol.random_base2((spp - 1).bit_length())[:spp]
    points = np.minimum(points, np.nextafter(np.float32(1), np.float32(0)))

    every = min(finer.BATCHES, spp) if scene.lightmaps else 0
    lights = scene.lights if scene.glossy else ()

    def traced(chunk: np.ndarray) -> cache.Arrays:
        p, face_n = _points(vertices, chunk, points)
        n = np.repeat(vertices.n[chunk], spp, axis=0)
        u = np.tile(points[:, 3:7], (len(chunk), 1))
        sampler.seed(seed, len(p))
        L, valid = _paths(world, integrator, sampler, p, n, face_n, u)
        L, valid = L.reshape(len(chunk), spp, 3), valid.reshape(len(chunk), spp)
        counted = valid.sum(axis=1)
        incoming = (L * valid[..., None]).sum(axis=1) / np.maximum(counted, 1)[:, None]
        batches = np.zeros((len(chunk), every, 3))
        for b in range(every):
            paths, of_batch = L[:, b::every], valid[:, b::every]
            number = of_batch.sum(axis=1)[:, None]
            mean = (paths * of_batch[..., None]).sum(axis=1) / np.maximum(number, 1)
            batches[:, b] = np.where(number > 0, mean, incoming)
        share, number = np.zeros((len(lights), len(chunk))), np.zeros((len(lights), len(chunk)), np.int64)
        for i, light in enumerate(lights):
            turned, open_ = (a.reshape(len(chunk), spp) & valid for a in _sight(world, light, p, face_n))
            number[i] = turned.sum(axis=1)
            share[i] = (turned & open_).sum(axis=1) / np.maximum(number[i], 1)
        return {"incoming": incoming, "counted": counted, "batches": batches, "share": share, "number": number}

    size = len(vertices.p)
    incoming, counted, batches = np.zeros((size, 3)), np.zeros(size, np.int64), np.zeros((size, every, 3))
    share, number = np.zeros((len(lights), size)), np.zeros((len(lights), size), np.int64)
    lit = np.intersect1d(vertices.owner, chosen)
    step = max(1, LANES // spp)

    def tell(done: int) -> None:
        making.tell(making.Share(f"{scene.name}, {stage}", done, len(lit), f"[reference] bake_spp = {spp}"))

    for start in range(0, len(lit), step):
        chunk, name = lit[start : start + step], cache.content_hash(stage, start)
        found = tracing.parts.get(name)
        if found is None:
            tell(start)
            found = traced(chunk)
            tracing.parts.put(name, found)
        incoming[chunk], counted[chunk], batches[chunk] = found["incoming"], found["counted"], found["batches"]
        share[:, chunk], number[:, chunk] = found["share"], found["number"]
    tell(len(lit))
    return [incoming, counted, batches, *zip(share, number, strict=True)]


def _sight(world: mi.Scene, light: PointLight, p: np.ndarray, face_n: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Whether points [N, 3] on faces of these normals are turned to a light, and whether nothing is in between; bool [N]."""
    si = dr.zeros(mi.SurfaceInteraction3f, len(p))
    si.p, si.n = mi.Point3f(np.float32(p).T), mi.Normal3f(np.float32(face_n).T)
    position = mi.Point3f(*light.position)
    blocked = world.ray_test(si.spawn_ray_to(position))
    return np.array(dr.dot(si.n, position - si.p) > 0), ~np.array(blocked)


def _common_sampler(spp: int) -> mi.Sampler:
    """Random numbers that depend on the number of a path alone: lane i draws what lane i - `spp` draws."""

    class Common(mi.Sampler):
        def __init__(self) -> None:
            super().__init__(mi.Properties())
            self.rng = mi.PCG32()

        def seed(self, seed: int, wavefront_size: int) -> None:
            path = dr.arange(mi.UInt32, wavefront_size) % dr.opaque(mi.UInt32, spp)
            self.rng = mi.PCG32(initstate=dr.opaque(mi.UInt64, seed), initseq=mi.UInt64(path))

        def next_1d(self, active: mi.Bool = True) -> mi.Float:
            return self.rng.next_float32(active)

        def next_2d(self, active: mi.Bool = True) -> mi.Point2f:
            x = self.rng.next_float32(active)
            return mi.Point2f(x, self.rng.next_float32(active))

    return Common()


def _points(vertices: _Vertices, chunk: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Hat-distributed points around vertices `chunk` [N] from u [S, 7] -> positions, face normals, [N S, 3]."""
    # The face: among those of the vertex, by area.
    target = (chunk[:, None] + u[None, :, 0]).ravel()
    corner = np.searchsorted(vertices.owner + vertices.cdf, target, side="right")
    first = np.searchsorted(vertices.owner, chunk)
    last = np.searchsorted(vertices.owner, chunk, side="right") - 1
    corner = np.clip(corner, np.repeat(first, len(u)), np.repeat(last, len(u)))

    # The weight of the vertex has density 6 a (1 - a), the hat times the width of the triangle there: its CDF
    # 3 a² - 2 a³ inverted. The rest is split uniformly.
    a = np.tile(0.5 - np.sin(np.arcsin(1 - 2 * u[:, 1]) / 3), len(chunk))
    b = (1 - a) * np.tile(u[:, 2], len(chunk))
    weights = np.stack([a, b, 1 - a - b], axis=1)
    return np.einsum("nk,nkc->nc", weights, vertices.corners[corner]), vertices.face_n[corner]


def _paths(world, integrator, sampler, p, n, face_n, u) -> tuple[np.ndarray, np.ndarray]:
    """Incoming radiance estimated by one path per lane, float64 [N, 3], and whether the path counts, bool [N].

    p, n, face_n [N, 3] are position, shading and face normal; u [N, 4] chooses the first direction and the light.
    """
    si = dr.zeros(mi.SurfaceInteraction3f, len(p))
    si.p, si.n = mi.Point3f(np.float32(p).T), mi.Normal3f(np.float32(face_n).T)
    n, face_n = mi.Vector3f(np.float32(n).T), mi.Vector3f(np.float32(face_n).T)
    u_d, u_l = mi.Point2f(np.float32(u[:, :2]).T), mi.Point2f(np.float32(u[:, 2:]).T)

    def mirrored(d):
        return d - 2 * dr.dot(d, face_n) * face_n

    def density(d):
        both = dr.maximum(dr.dot(n, d), 0) + dr.maximum(dr.dot(n, mirrored(d)), 0)
        return dr.select(dr.dot(face_n, d) > 0, both * dr.inv_pi, 0)

    def power_heuristic(one, other):
        return dr.select(one > 0, one * one / (one * one + other * other), 0)

    # A direction under the cosine about n, mirrored to the upper side of the face.
    d = mi.Frame3f(n).to_world(mi.warp.square_to_cosine_hemisphere(u_d))
    d = dr.select(dr.dot(face_n, d) < 0, mirrored(d), d)
    ray = si.spawn_ray(d)
    hit = world.ray_intersect(ray)
    valid = hit.is_valid()
    inside = valid & (dr.dot(hit.n, d) > 0) & (hit.shape.eval_attribute_1("face_mark", hit, valid) > 0)

    # What arrives along it; if it came from an emitter straight away, weighted against having sampled that emitter.
    L, _, _ = integrator.sample(world, sampler, mi.RayDifferential3f(ray))
    has_emitters = len(world.emitters()) > 0
    if has_emitters:
        emitter = hit.emitter(world)
        seen = emitter != None  # noqa: E711
        Le = dr.select(seen, emitter.eval(hit, seen), 0)
        chance = world.pdf_emitter_direction(si, mi.DirectionSample3f(world, hit, si), seen)
        L -= Le * (1 - power_heuristic(density(d), dr.select(seen, chance, 0)))

        # A sampled emitter, weighted the other way.
        light, weight = world.sample_emitter_direction(si, u_l, True)
        K = density(light.d)
        share = dr.select(light.delta, 1, power_heuristic(light.pdf, K))  # no direction hits a point light by chance
        L += dr.select(light.pdf > 0, weight * K * share, 0)
    return np.array(L, np.float64).T, ~np.array(inside)
