"""References of mirrors with normal maps: against traced rays and Mitsuba's own normal map, and light that comes by them."""

# pyright: reportArgumentType=false, reportCallIssue=false, reportOptionalSubscript=false
# pyright: reportOptionalMemberAccess=false, reportOptionalOperand=false
# Mirrors here have maps, and the stubs of Mitsuba and Dr.Jit do not know that their types are the same.

from __future__ import annotations

from dataclasses import replace

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from oracles.normalmap_oracle import mapped, points, unit
from support.mapped_mirrors import ball, ripples, room, rough, sheet, smooth
from support.mirror_room import EYE, shaded, still
from support.textured_rooms import SQUARE
from support.tiers import exhaustive

from benchharness.kernels import mitsuba_mesh
from benchharness.measure import metrics
from benchharness.render import mitsuba_normalmap, mitsuba_scene
from benchharness.render.bake import bake
from benchharness.render.frame import FrameRenderer
from benchharness.render.reference import ReferenceOptions, render
from benchharness.scene import Scene
from methods.ray_traced import RayTraced

SIZE = (120, 90)
COPPER = {"eta": (0.2, 0.92, 1.1), "k": (3.9, 2.45, 2.1)}
TURNED = SQUARE @ [[-1.5, 0.4], [0.3, 1.2]]  # mirrored, and beyond the edges
GRAZING = (1.9, -0.15, 0.15)


def flip(made: Scene, method=None, max_depth: int = 2) -> tuple[float, float]:
    """Of a method to the reference, in the mirrors; and the middle of how distances differ, relative."""
    renderer, truth = FrameRenderer(made, *SIZE), render(made, 0.0, SIZE, ReferenceOptions(max_depth=max_depth))
    [answer] = shaded(RayTraced() if method is None else method, made, 0, renderer=renderer)
    image = np.array(renderer.compose(answer.frame, answer.reflection.L)).T.reshape(truth.image.shape)
    mask = answer.active & truth.mask
    found = metrics.evaluate(image, truth.image, mask, ppd=made.ppd, exposure=made.exposure)
    known = mask & np.isfinite(answer.distance) & np.isfinite(truth.distance) & (answer.distance > 0)
    assert mask.sum() > 500 and found["flip"] is not None
    return found["flip"], float(np.median(np.abs(answer.distance - truth.distance)[known] / truth.distance[known]))


def turned_round(made: Scene) -> float:
    """The share of a mirror's pixels whose ray the map sends to below their triangle."""
    frame, [mirror] = FrameRenderer(made, *SIZE).render(0), made.reflectors
    lanes = np.flatnonzero(np.array(frame.active))[::37]
    p, v = (np.array(a).T[lanes].astype(np.float64) for a in (frame.p, frame.v))
    face, weights, _ = points(mirror.mesh, p)
    below = []
    for k in range(len(lanes)):
        corners = mirror.mesh.faces[face[k]]
        a, b, c = mirror.mesh.vertices[corners]
        n, g = unit(weights[k] @ mirror.mesh.normals[corners]), np.cross(b - a, c - a)
        N = mapped(np.stack([a, b, c]), mirror.mesh.uv[corners], weights[k], n, mirror.normal_map)
        below.append((2 * (N @ v[k]) * N - v[k]) @ g * (g @ v[k]) < 0)
    return float(np.mean(below))


@pytest.mark.parametrize(
    ("mirror", "eye", "below"),
    [
        (sheet(ripples(0.3), **COPPER), EYE, (0.0, 0.02)),
        pytest.param(sheet(ripples(0.8), TURNED), (-0.3, 1.6, 0.4), (0.0, 0.3), marks=exhaustive),  # from behind
        (sheet(ripples(1.0), TURNED, **COPPER), GRAZING, (0.1, 0.9)),
        (ball(ripples(0.5)), EYE, (0.01, 0.5)),
    ],
    ids=["front", "back", "grazing", "ball"],
)
def test_traced_rays_agree_with_the_reference_to_the_eye(mirror, eye, below):
    made = room(mirror, camera=still(eye))
    assert below[0] <= turned_round(made) <= below[1]
    seen, off = flip(made)
    assert seen < 0.005 and off < 1e-3
    # And the map is what is seen.
    truths = [render(each, 0.0, SIZE) for each in (made, smooth(made))]
    assert np.abs(truths[0].image - truths[1].image)[truths[0].mask].mean() > 0.03


def test_what_is_reflected_twice_is_turned_twice():
    # Two sheets, askew, each in the other.
    other = sheet(ripples(0.4), name="other")
    facing = other.mesh.vertices * [1, -1, 1] + [0.3, -0.9, 0.1]
    other = replace(other, mesh=replace(other.mesh, vertices=facing, faces=other.mesh.faces[:, ::-1], normals=None))
    made = room(sheet(ripples(0.25), TURNED, **COPPER), other, camera=still((1.6, -0.9, 0.7)))
    seen, _ = flip(made, RayTraced(bounces=2), max_depth=3)
    assert seen < 0.01
    # The second mirror's map is part of that.
    plain = replace(made, reflectors=(made.reflectors[0], replace(other, normal_map=None)))
    images = [shaded(RayTraced(bounces=2), each, 0, size=SIZE)[0] for each in (made, plain)]
    again = render(made, 0.0, SIZE, ReferenceOptions(max_depth=3)).second & images[0].active
    assert again.sum() > 400 and np.abs(images[0].L - images[1].L)[again].mean() > 0.05


def theirs(made: Scene) -> mi.Scene:
    """The mirror alone, with Mitsuba's normal map, whose pictures have v down."""
    [mirror] = made.reflectors
    picture = {"type": "bitmap", "bitmap": mi.Bitmap(np.array(mirror.normal_map.pixels)), "raw": True, "wrap_mode": "repeat"}
    conductor = {"type": "twosided", "bsdf": {"type": "conductor", "material": "none"}}
    bsdf = mi.load_dict({"type": "normalmap", "normalmap": picture, "bsdf": conductor})
    mesh, uv = mirror.mesh, mirror.mesh.uv * [1, -1] + [0, 1]
    shape = mitsuba_mesh.mesh("theirs", mesh.vertices, mesh.faces, np.asarray(mesh.normals), uv, bsdf=bsdf)
    return mi.load_dict({"type": "scene", "shape": shape})


@pytest.mark.parametrize("mirror", [sheet(rough(), 2.2 * SQUARE), ball(ripples(0.5))], ids=["sheet", "ball"])
def test_where_mitsubas_own_normal_map_sends_rays_ours_does_too(mirror):
    made = room(mirror)
    rng, count = np.random.default_rng(0), 4000
    target, eye = rng.uniform(-0.45, 0.45, (count, 3)), np.array(EYE) + rng.uniform(-0.2, 0.2, (count, 3))
    ray = mi.Ray3f(mi.Point3f(eye.T), dr.normalize(mi.Vector3f((target - eye).T)))
    alone = replace(made, objects=())
    scenes = mitsuba_scene.mitsuba_scene(alone, 0.0, "baked"), theirs(made)  # which have to outlive what they say
    mine, other = (each.ray_intersect(ray) for each in scenes)
    hit = mine.is_valid() & other.is_valid()
    r = np.array(mitsuba_normalmap.reflected(mine, hit)).T
    bs, weight = other.bsdf().sample(mi.BSDFContext(), other, mi.Float(0.5), mi.Point2f(0.5), hit)
    wo, lit = np.array(other.to_world(bs.wo)).T, np.array(dr.any(weight > 0) & hit)
    # Below the surface theirs is black, and it flips normals that are turned away from the eye.
    g, hit = np.array(other.n).T, np.array(hit)
    above = ((wo * g).sum(axis=1) > 1e-4) & (np.array(other.wi.z) > 0.5)
    assert (lit & above).sum() > 1000
    np.testing.assert_allclose(r[lit & above], wo[lit & above], atol=1e-4)
    assert (hit & ~above).any() and ((r * g).sum(axis=1)[hit] > -1e-6).all(), "ours leave the triangle, whatever theirs do"


def test_light_is_baked_by_way_of_a_mapped_mirror():
    # A lamp that only the mirror lets a wall see: what falls there depends on the map.
    made = room(sheet(ripples(0.8), **COPPER))
    unlit = [replace(o, mesh=replace(o.mesh, radiance=None, albedo=(0.7, 0.7, 0.7))) for o in made.objects]
    lamp = replace(unlit[1], mesh=replace(unlit[1].mesh, emission=(30.0, 30.0, 30.0)))
    made = replace(made, objects=(*unlit[2:], lamp))
    one, other = (bake(each, spp=16) for each in (made, smooth(made)))
    changed = [np.abs(a.mesh.radiance - b.mesh.radiance).max() for a, b in zip(one.objects, other.objects, strict=True)]
    assert max(changed) > 1e-3 and all(np.isfinite(o.mesh.radiance).all() for o in one.objects)
