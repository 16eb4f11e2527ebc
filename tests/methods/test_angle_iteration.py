"""Angle iteration: what it finds and says of vertices, warm and cold, contact, exact pixels, and which mirrors it refuses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.answers import apart_px, clearances, hollow, off_px, picture, tilted_sheet
from support.mirror_room import ball, error, mirror_ball, scene, shaded, smooth, walls
from support.small_room import box

from benchharness.scene import Object
from methods.angle_iteration import AngleIteration
from methods.ray_traced import RayTraced

SMALL = (96, 72)
METHOD = AngleIteration(resolution=64, split_px=0.0)


def vertex(answer, field):
    return np.array(getattr(answer.reflection.vertices, field))


def doubted(answer) -> float:
    return float(np.array(answer.reflection.doubt)[answer.active.ravel()].mean())


@pytest.fixture(scope="module")
def found(room, renderer):
    return shaded(METHOD, room, 0, 1, renderer=renderer)


def test_points_are_right_to_a_texels_curvature_and_all_else_is_hidden(found, room, truth_of_room):
    """Measured: 0.025 px with 64 texels, 0.007 px with 256."""
    first, warm = found
    off = off_px(first, room, step=3)
    assert len(off) > 1000 and np.isfinite(off).mean() > 0.99 and np.nanmax(off) < 0.04
    own = np.concatenate([o.mesh.vertices for o in room.objects])
    region, converged = vertex(first, "region")[: len(own)], vertex(first, "converged")[: len(own)]
    assert ((region == 1) != converged).mean() < 0.002
    clearance = clearances(own)
    assert (region[clearance > 0] == 1).all() and (region[clearance < -1e-3] == 3).all() and (region == 3).sum() > 50
    assert error(first, truth_of_room) < 0.012  # images of straight edges are straight: Newton's method leaves as much
    means = [i[i > 0].mean() for i in (vertex(a, "iterations") for a in (first, warm))]
    assert means[1] <= 2.1 < means[0] < 3


def test_what_has_not_converged_says_so_and_is_doubted(found, room, renderer):
    """On the room's ball of half a metre a whole step runs away from what is near its outline."""
    naive = shaded(replace(METHOD, damping="naive"), room, 0, renderer=renderer)[0]
    searched = vertex(naive, "iterations") > 0
    lost = searched & ~vertex(naive, "converged")
    assert lost.sum() > 50 and vertex(naive, "residual")[lost].max() > 0.01
    assert (vertex(naive, "iterations")[lost & (vertex(naive, "region") == 1)] > 50).mean() > 0.5
    assert np.nanmax(off_px(naive, room, step=3)) < 0.04  # what has converged is right
    assert doubted(naive) > 3 * doubted(found[0])


def test_what_stands_on_a_mirror_meets_its_image():
    """F-29: a ball that touches the mirror ball, with a vertex of either at the very point."""
    mirror = mirror_ball(fine=192)
    along = mirror.mesh.vertices @ [np.sin(np.radians(50)), -np.cos(np.radians(50)), 0.0]
    towards = 2 * mirror.mesh.vertices[along.argmax()]
    red = ball(0.15, (0, 0, 0), (0.9, 0.1, 0.1), 4)
    turn = Rotation.align_vectors([-towards], [red.vertices[0].copy()])[0].as_matrix()
    red = replace(red, vertices=red.vertices @ turn.T + 0.65 * towards, normals=red.normals @ turn.T)
    made = scene((walls(), Object("red", red, shows="contact")), (mirror,))
    answer, expected = shaded(METHOD, made, 0)[0], picture(made)
    contact = np.linalg.norm(red.vertices - 0.5 * towards, axis=1).argmin() + len(made.objects[0].mesh.vertices)
    assert vertex(answer, "converged")[contact] and vertex(answer, "residual")[contact] == 0
    np.testing.assert_allclose(vertex(answer, "R")[:, contact], 0.5 * towards, atol=1e-5)
    is_red, truly = (x[..., 0] - x[..., 1] > 0.5 for x in (answer.L, expected.image))
    both = answer.active & expected.mask
    assert (truly & both).sum() > 150 and ((is_red != truly) & both).sum() <= 4


def test_a_room_of_twelve_triangles_is_exact_by_rays_and_bent_edges_are_split():
    mesh = box((-2, -2, -2), (2, 2, 2), inside=True)
    room = Object("walls", replace(mesh, radiance=smooth(mesh.vertices)), "triangles whose images bend by many pixels")
    made = scene((room,), (mirror_ball(),))
    exact = shaded(RayTraced(), made, 0, size=SMALL)[0]
    wrong = {}
    for name, more in {"straight": {}, "split": {"split_px": 1.0}, "ray": {"split_px": 4.0, "resolve": "ray"}}.items():
        answer = shaded(replace(METHOD, **more), made, 0, size=SMALL, doubts=False)[0]
        wrong[name] = (np.abs(answer.L - exact.L).max(axis=2) > 0.02)[exact.active].mean()
    assert wrong["straight"] > 0.5 and wrong["split"] < 0.04 and wrong["ray"] < 0.01


def test_mirrors_that_a_centre_sees_are_refused_with_what_is_accepted():
    made = scene((walls(),), (mirror_ball(), hollow("concave")))
    name = made.reflectors[1].name
    side = "it is a mirror on the side of its centre; accepted: one that is seen from outside"
    assert METHOD.refuses(made) == f"reflector {name}: {side}"
    said = METHOD.refuses(scene((walls(),), (tilted_sheet(),)))
    assert said is not None and said.startswith("reflector sheet: it is not star-shaped: it runs through its own centre")
    assert METHOD.refuses(scene((walls(),), (mirror_ball(),))) is None


def test_levels_of_detail_without_rays_are_refused():
    with pytest.raises(ValueError, match='angle_iteration: lod_px 1 with resolve "interpolate"; accepted: 0, or "ray"'):
        AngleIteration(lod_px=1.0)


def test_points_between_others_are_off_by_the_square_of_their_distance_and_say_by_how_much(found, room, renderer):
    exact = found[0]
    region, off, shares = vertex(exact, "region"), [], []
    for every in (4, 16):
        (answer,) = shaded(replace(METHOD, exact_every=every), room, 0, renderer=renderer)
        both = (region == 1) & (vertex(answer, "region") == 1)
        assert ((region == 1) != (vertex(answer, "region") == 1)).mean() < 0.02
        own = both & (vertex(answer, "iterations") > 0)
        np.testing.assert_allclose(vertex(answer, "R")[:, own], vertex(exact, "R")[:, own], atol=1e-4)
        lying = both & ~own
        shares.append(1 - np.array(answer.reflection.counters["interpolated"]).sum() / (region == 1).sum())
        V = np.concatenate([part.mesh.vertices for part in room.parts])
        assert len(V) == len(region)
        one, other = (vertex(a, "R").T[lying].astype(float) for a in (answer, exact))
        off.append(float(np.median(apart_px(one, other, room))))
        assert np.nanmax(off_px(answer, room, step=3)) < 0.35  # what calls itself converged: a quarter pixel, and texels
        lost = lying & ~vertex(answer, "converged")
        assert lost.any() and (every == 4 or doubted(answer) > doubted(exact))
    assert shares[0] > 1.5 * shares[1] and shares[1] < 0.5
    assert off[1] > 1.8 * off[0] > 0


def test_what_lies_between_is_refused_where_vertices_are_split_or_asked_by_rays():
    for more in ({}, {"split_px": 0.0, "resolve": "ray"}):
        with pytest.raises(ValueError, match=r'exact_every 4 with split_px .*; accepted: 1, or split_px 0 and "interpolate"'):
            AngleIteration(exact_every=4, **more)
