"""What `Vertices.valid` says: converged, and no part of the mirror between R and the eye, nor between R and the vertex."""

from __future__ import annotations

import numpy as np
import pytest
from support.hollow_shapes import Ring
from support.known_reflections import METHODS, points_of, reflected
from support.mirror_room import scene, shaded, still

from benchharness.api import Method
from benchharness.measure import truth

EYE = np.array([0.0, -2.5, 2.0])
SIZE = (320, 240)
SOLVED = 50  # vertices of which all reflections are solved for
# A search ends within a texel, here up to 0.008, of the reflection point. Where a ray passes its own mirror as closely as that,
# as grazing ones do, it may meet what the true one misses.
MISSED = {"newton": 0.0, "image_space_search": 0.06}


@pytest.fixture(scope="module")
def room():
    """A ring, and vertices that it reflects to the eye at points that face it, were it not for the ring itself."""
    shape = Ring(0.5)
    _, V = reflected(shape, EYE, 3, 2000)
    V = V[np.linalg.norm(V, axis=1) > 1.8]  # beyond the ring's outer edge by the length of some of its triangles
    return scene([points_of(V)], [shape.mirror()], still(tuple(EYE), (0.0, 0.0, 0.0), 60.0), frames=1), V


def answer(method: Method, made):
    return shaded(method, made, 0, size=SIZE)[0].reflection.vertices


@pytest.mark.parametrize("multi", [1, 3])
@pytest.mark.parametrize("name", ["newton", "image_space_search"])
def test_a_reflection_is_valid_where_the_mirror_hides_it_neither_from_the_eye_nor_from_the_vertex(room, name, multi):
    made, V = room
    found = answer(METHODS[name](multi=multi), made)
    assert found is not None
    converged, valid, R = np.array(found.converged), np.array(found.valid), np.array(found.R, np.float64).T
    chosen = np.flatnonzero(converged[: len(V)])
    chosen = chosen[:: max(1, len(chosen) // SOLVED)]
    mesh = made.reflectors[0].mesh
    roots, shown = truth.every_reflection_point(mesh.vertices, mesh.normals, mesh.faces, EYE, V[chosen])
    known = [(i, s[np.linalg.norm(P - R[i], axis=1).argmin()]) for i, P, s in zip(chosen, roots, shown, strict=True) if len(P)]
    chosen, true = np.array([i for i, _ in known]), np.array([s for _, s in known])
    assert len(chosen) > 0.95 * len(roots)
    assert not (valid & ~converged).any() or multi > 1
    assert not (valid[chosen] & ~true).any()
    assert (true & ~valid[chosen]).mean() <= MISSED[name]
    if multi == 1:
        assert (~true).mean() > 0.03  # so that there is something to tell
