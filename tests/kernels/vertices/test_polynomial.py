"""The law of reflection as polynomials: roots of single triangles beside elimination and a dense search, and what rules
triangles out."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from oracles import polynomial_oracle as oracle
from support.truth_shapes import unit

from benchharness.kernels.placement import MirrorFrame
from benchharness.kernels.vertices import cones, mirrormesh, polynomial
from scenes.stress.bumps import bumpy

CORNERS = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
UP = np.tile([0.0, 0, 1], (3, 1))


def where(eye, V) -> MirrorFrame:
    """Eyes and vertices [N, 3], one each per lane, in the mirror's frame."""
    nowhere = mi.Vector4f(0, 0, 0, 1)
    eye, V = (mi.Point3f(np.broadcast_to(x, np.shape(V)).astype(np.float32).T) for x in (eye, V))
    return MirrorFrame(eye, V, nowhere, nowhere, nowhere)


def built(p, n):
    """A mesh of single triangles p, n [K, 3, 3], as the kernels take it."""
    faces = np.arange(3 * len(p)).reshape(-1, 3)
    return mirrormesh.build(p.reshape(-1, 3), n.reshape(-1, 3), faces, backs=False)


def solved(p, n, eye, V) -> tuple[list[np.ndarray], np.ndarray, np.ndarray]:
    """Roots [K, 2] of each of some triangles, whether they are settled, and parts that were asked."""
    f = polynomial.fields(built(p, n), where(eye, V), dr.arange(mi.UInt32, len(p)), True)
    found = polynomial.roots_of(f, dr.full(mi.Bool, True, len(p)))
    dr.eval(found)
    b = np.stack([np.array(x, np.float64).T for x in found.b], axis=1)
    return [own[:k] for own, k in zip(b, np.array(found.count), strict=True)], np.array(found.settled), np.array(found.nodes)


def cases(seed: int, count: int, bent: float, hollow: float = 0.0, size: float = 1.0, far: tuple[float, float] = (0.3, 3.0)):
    """Triangles whose normals differ by about `bent`, and lean inwards as those of a sphere of radius 1 / `hollow` do, an eye
    and a vertex for each, and a root that they have: p, n, eye, V, b."""
    rng = np.random.default_rng(seed)
    p = rng.normal(size=(20 * count, 3, 3))
    facet = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    longest = np.linalg.norm(p - np.roll(p, 1, axis=1), axis=2).max(axis=1)
    n = unit(unit(facet)[:, None] + bent * rng.normal(size=p.shape) - hollow * (p - p.mean(axis=1, keepdims=True)))
    b = rng.dirichlet((1.5, 1.5, 1.5), len(p))
    P, N = np.einsum("nk,nkd->nd", b, p), unit(np.einsum("nk,nkd->nd", b, n))
    w = unit(rng.normal(size=P.shape))
    cosine = (w * N).sum(axis=1, keepdims=True)
    kept = (np.linalg.norm(facet, axis=1) > 0.3 * longest**2) & (cosine[:, 0] > 0.15)
    s, t = (np.exp(rng.uniform(np.log(far[0]), np.log(far[1]), cosine.shape)) for _ in range(2))
    eye, V = P + s * w, P + t * (2 * cosine * N - w)
    return tuple(a[kept][:count] for a in (size * p, n, size * eye, size * V, b[:, 1:]))


# The oracle


def test_on_a_flat_triangle_the_root_is_where_the_mirrored_vertex_is_seen():
    eye, V = np.array([0.1, 0.2, 1.0]), np.array([0.5, 0.2, 1.0])
    for find in (oracle.eliminated, oracle.dense):
        np.testing.assert_allclose(find(CORNERS, UP, eye, V), [[0.3, 0.2]], atol=1e-12)
    beside = oracle.eliminated(CORNERS, UP, eye, V + np.array([2, 0, 0]))
    assert beside is not None and len(beside) == 0


@pytest.mark.parametrize("hollow", [0.0, 0.8])
def test_elimination_and_a_dense_search_find_the_same(hollow):
    several = 0
    for p, n, eye, V, b in zip(*cases(1, 16, 0.15, hollow), strict=True):
        one, other = oracle.eliminated(p, n, eye, V), oracle.dense(p, n, eye, V)
        assert one is not None and np.abs(one - b).max(axis=1).min() < 1e-7
        assert one.shape == other.shape
        np.testing.assert_allclose(one, other, atol=1e-6)
        several += len(one) > 1
    assert several > 3 or not hollow


def test_coplanarity_is_of_degree_two_and_on_a_sphere_s_mesh_the_resultant_of_full_degree_vanishes():
    p, n, eye, V, _ = (a[0] for a in cases(2, 1, 0.3))
    coplanar, angles = oracle.system(p, n, eye, V, unit(p[1] - p[0]))
    powers = np.add.outer(np.arange(4), np.arange(4))
    assert np.abs(coplanar[powers == 3]).max() < 1e-12 * np.abs(coplanar).max()
    assert oracle.degree(coplanar) == 2 and oracle.degree(angles) == 4
    p = unit(np.array([[0.0, 0, 1], [0.1, 0, 1], [0, 0.1, 1]]))
    coplanar, angles = oracle.system(p, p, eye, V, unit(p[1] - p[0]))
    assert oracle.degree(coplanar) == 1 and oracle.degree(angles) <= 3
    full = [np.pad(c, ((0, 0), (0, max(0, k + 1 - c.shape[1]))))[:, : k + 1] for c, k in ((coplanar, 2), (angles, 4))]
    S = oracle.sylvester(*(0.5 ** np.arange(c.shape[0]) @ c for c in full))
    assert abs(np.linalg.det(S)) < 1e-12 * np.abs(S).max() ** 6


# Roots of a triangle


def clear(roots: np.ndarray, apart: float) -> np.ndarray:
    """Which of some roots [K, 2] are this far from all others."""
    away = np.abs(roots[:, None] - roots[None]).max(axis=2) + 9 * np.eye(len(roots))
    return away.min(axis=1, initial=9.0) > apart


FLAT = (0.05, 0.0, 1.0, (5.0, 50.0))


@pytest.mark.parametrize(
    ("bent", "hollow", "size", "far", "count"),
    [(0.15, 0.8, 1.0, (0.3, 3.0), 120), (0.6, 0.0, 1.0, (0.2, 20.0), 60), (*FLAT, 40), (0.05, 0.0, 1e-3, (5.0, 50.0), 40)],
)
def test_a_triangle_s_roots_are_those_of_elimination(bent, hollow, size, far, count):
    p, n, eye, V, _ = cases(3, count, bent, hollow, size, far)
    p, n, eye, V = (a.astype(np.float32).astype(float) for a in (p, n, eye, V))
    roots, settled, nodes = solved(p, n, eye, V)
    missed = ghosts = total = several = 0
    for i, own in enumerate(roots):
        true = oracle.eliminated(p[i], n[i], eye[i], V[i])
        assert true is not None
        near = np.abs(own[:, None] - true).max(axis=2)
        apart = clear(true, 0.02)
        missed += int((near.min(axis=0, initial=9.0)[apart] > 1e-3).sum())
        far = own[near.min(axis=1, initial=9.0) > 1e-3]
        # Where two roots are about to meet, or one is about to leave, rounding decides.
        ghosts += sum(np.abs(oracle.law(x, p[i], n[i], eye[i], V[i])[0]).max() > 1e-4 for x in far)
        total, several = total + apart.sum(), several + (len(true) > 1)
    assert total > 0.9 * count and (several > 0.2 * count or not hollow)
    assert missed == 0 and ghosts == 0
    assert settled.mean() > 0.95
    assert np.median(nodes) <= (1 if bent == FLAT[0] else 40)


def test_eye_and_vertex_in_one_line_with_the_normal_have_a_root_though_coplanarity_holds_everywhere():
    """N . (D_E x D_V) = 0 all over a flat triangle, and over one of a sphere: there is nothing to eliminate."""
    foot = np.array([0.3, 0.25, 0.0])
    ball = unit(np.array([[-0.2, -0.1, 1], [0.3, -0.1, 1], [0.0, 0.3, 1]]))
    p, n = np.stack([CORNERS, ball]), np.stack([UP, ball])
    eye = np.array([[0.3, 0.25, 2.0], [0.0, 0, 3.0]])
    V = np.array([[0.3, 0.25, 0.7], [0.0, 0, 1.5]])
    assert oracle.eliminated(p[0], n[0], eye[0], V[0]) is None and oracle.eliminated(p[1], n[1], eye[1], V[1]) is None
    flat, curved = solved(p, n, eye, V)[0]
    assert len(flat) == len(curved) == 1
    np.testing.assert_allclose(flat[0], foot[:2], atol=1e-6)
    b = curved[0]
    np.testing.assert_allclose((ball[0] + b[0] * (ball[1] - ball[0]) + b[1] * (ball[2] - ball[0]))[:2], 0, atol=1e-6)


def test_neighbours_of_a_triangle_leave_no_gap_at_their_edge_and_one_that_is_beside_has_none():
    """Vertices that are reflected exactly on an edge of two triangles of one quad: at least one has the root."""
    n = unit(np.array([[-0.1, -0.1, 1], [0.1, -0.1, 1], [-0.1, 0.1, 1], [0.1, 0.1, 1]]))
    q = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]])
    t = np.linspace(0.02, 0.98, 60)[:, None]
    P, N = (1 - t) * q[1] + t * q[2], unit((1 - t) * n[1] + t * n[2])
    eye = np.broadcast_to([0.4, 0.3, 3.0], P.shape)
    w = unit(eye - P)
    V = P + 1.3 * (2 * (w * N).sum(axis=1, keepdims=True) * N - w)
    found = np.zeros(len(P), int)
    for corners in ((0, 1, 2), (3, 2, 1)):
        p_, n_ = (np.broadcast_to(x[list(corners)], (len(P), 3, 3)) for x in (q, n))
        found += [len(own) for own in solved(p_, n_, eye, V)[0]]
    assert (found >= 1).all() and (found <= 2).all()
    p_, n_ = (np.broadcast_to(x[[0, 1, 2]], (len(P), 3, 3)) for x in (q + np.array([-2.0, 0, 0]), n))
    assert not any(len(own) for own in solved(p_, n_, eye, V)[0])


# Which triangles are asked


def test_no_cluster_is_left_out_that_has_a_root_and_few_are_asked():
    mesh = bumpy(0.1)
    faces = mesh.faces[::2]
    grouped = cones.clusters(mesh.vertices, mesh.normals, faces)
    walked = mirrormesh.build(mesh.vertices, mesh.normals, faces, backs=False)
    order = np.array(grouped.order)
    assert sorted(order) == list(range(len(faces)))
    parts = [np.array(pieces.bounds).reshape(-1, 12)[:, 10:].astype(int) for pieces in (grouped.clusters, grouped.groups)]
    assert parts[0][:, 1].max() <= cones.CLUSTER and (parts[1][:-1, 1] == cones.GROUP // cones.CLUSTER).mean() > 0.8
    of_cluster = np.empty(len(faces), int)
    for c, (first, size) in enumerate(parts[0]):
        of_cluster[order[first : first + size]] = c
    of_group = np.repeat(np.arange(len(parts[1])), parts[1][:, 1])[of_cluster]
    eye, V = np.array([0.0, 0.3, 4.0]), np.random.default_rng(5).normal(size=(12, 3)) * 2
    V = unit(V) * np.maximum(np.linalg.norm(V, axis=1, keepdims=True), 1.3)
    rooted, asked = 0, []
    for v in V:
        local = where(eye, np.broadcast_to(v, (len(faces), 3)))
        f = polynomial.fields(walked, local, dr.arange(mi.UInt32, len(faces)), True)
        has = np.array(polynomial.roots_of(f, dr.full(mi.Bool, True, len(faces))).count) > 0
        for pieces, owner in ((grouped.clusters, of_cluster), (grouped.groups, of_group)):
            c = dr.arange(mi.UInt32, pieces.count)
            first, end = cones.reaches(pieces, c, where(eye, np.broadcast_to(v, (pieces.count, 3))))
            kept = np.array(first != end)
            assert kept[owner[has]].all()
            asked.append(kept.mean())
        rooted += has.sum()
    assert rooted > 5
    assert np.mean(asked[::2]) < 0.05 and np.mean(asked[1::2]) < 0.45
