"""Reflection points on triangles with interpolated normals, float64: by elimination, as in the paper, and by a dense search.

Elimination (Fan et al. 2024): coplanarity and equal angles are polynomials in the weights u, v of the second and third corner.
Their resultant, the determinant of Sylvester's matrix in v, is a polynomial of degree 8 in u: known from nine values of u, its
roots are eigenvalues. Of each, coplanarity leaves two v. What obeys the law of reflection, is inside and in front is a root.

The dense search knows nothing of that: it compares the reflected ray with the direction to the vertex on a fine grid, and
solves from every cell in which both might agree.
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial import chebyshev

TRIVIAL = 1e-9  # of the greatest; coefficients that are less do not raise the degree
INSIDE = 1e-9  # weights
ONE = 1e-7  # weights; roots that are nearer to each other are one
AGREED = 1e-10  # sine between reflected ray and direction to the vertex
NEWTON = 40  # steps


def unit(v):
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def law(b, p, n, eye, V):
    """The two parts, along the triangle's sides, of what the reflected ray and the direction to V differ in, [..., 2]; P, N."""
    b = np.asarray(b)
    weights = np.stack([1 - b[..., 0] - b[..., 1], b[..., 0], b[..., 1]], axis=-1)
    P, N = weights @ p, unit(weights @ n)
    w = unit(eye - P)
    reflected = 2 * (w * N).sum(axis=-1, keepdims=True) * N - w
    turn = np.cross(unit(V - P), reflected)
    return np.stack([turn @ unit(p[1] - p[0]), turn @ unit(p[2] - p[0])], axis=-1), P, N


def polished(b, p, n, eye, V, step=1e-6):
    """Newton's method on `law` from b [2]; None where it ends outside of the triangle, behind it, or nowhere."""
    b, first, second = np.array(b, float), step * np.array([1.0, 0]), step * np.array([0, 1.0])
    for _ in range(NEWTON):
        f = law(b, p, n, eye, V)[0]
        J = np.stack([law(b + d, p, n, eye, V)[0] - law(b - d, p, n, eye, V)[0] for d in (first, second)], axis=1) / (2 * step)
        if abs(np.linalg.det(J)) < 1e-14:
            return None
        move = np.linalg.solve(J, f)
        b = b - move / max(1.0, np.abs(move).max() / 0.3)
        if np.abs(b - 0.5).max() > 3:
            return None
        if np.abs(move).max() < 1e-14:
            break
    f, P, N = law(b, p, n, eye, V)
    inside = b.min() >= -INSIDE and b.sum() <= 1 + INSIDE
    front = (eye - P) @ N > 0 and (V - P) @ N > 0
    return b if inside and front and np.abs(f).max() < AGREED else None


def distinct(roots):
    """Roots [K, 2], each once."""
    kept = []
    for root in roots:
        if root is not None and all(np.abs(root - other).max() > ONE for other in kept):
            kept.append(root)
    return np.array(sorted(map(tuple, kept))).reshape(-1, 2)


# Elimination


def product(a, b):
    """Of polynomials in u and v, coefficients [power of u, power of v]."""
    out = np.zeros(np.add(a.shape, b.shape) - 1)
    for i in range(a.shape[0]):
        for j in range(a.shape[1]):
            out[i : i + b.shape[0], j : j + b.shape[1]] += a[i, j] * b
    return out


def linear(x):
    """Three polynomials of degree 1 that are x [3, 3] at the corners."""
    return [np.array([[x[0, k], x[2, k] - x[0, k]], [x[1, k] - x[0, k], 0.0]]) for k in range(3)]


def dot(a, b) -> np.ndarray:
    return product(a[0], b[0]) + product(a[1], b[1]) + product(a[2], b[2])


def cross(a, b):
    return [product(a[i], b[j]) - product(a[j], b[i]) for i, j in ((1, 2), (2, 0), (0, 1))]


def system(p, n, eye, V, along):
    """Coplanarity, of degree 2, and equal angles, of degree 4, seen along a direction."""
    N = linear(n)
    to_eye, to_V = linear((eye - p) / np.linalg.norm(eye - p[0])), linear((V - p) / np.linalg.norm(V - p[0]))
    coplanar = dot(cross(to_eye, to_V), N)

    def across(d):
        x, y, z = cross(d, N)
        return along[0] * x + along[1] * y + along[2] * z

    angles = product(dot(to_eye, N), across(to_V)) + product(dot(to_V, N), across(to_eye))
    return coplanar, angles


def degree(c):
    """In v."""
    greatest = np.abs(c).max()
    return max((k for k in range(c.shape[1]) if np.abs(c[:, k]).max() > TRIVIAL * greatest), default=0)


def sylvester(a, b):
    """Of two polynomials in one variable, coefficients from the constant up."""
    m, k = len(a) - 1, len(b) - 1
    S = np.zeros((m + k, m + k))
    for i in range(k):
        S[i, i : i + m + 1] = a[::-1]
    for i in range(m):
        S[k + i, i : i + k + 1] = b[::-1]
    return S


def resultant(first, second, dtype=float):
    """Chebyshev's coefficients on 0 <= u <= 1 of the determinant of Sylvester's matrix in v."""
    first, second = first[:, : degree(first) + 1], second[:, : degree(second) + 1]
    t = chebyshev.chebpts1(9)
    u = 0.5 * (t + 1)
    values = []
    for x in u:
        a, b = (x ** np.arange(c.shape[0]) @ c for c in (first, second))
        values.append(np.linalg.det(sylvester(a, b).astype(dtype)))
    return np.linalg.solve(chebyshev.chebvander(t, 8), np.array(values, float))


def eliminated(p, n, eye, V):
    """The roots [K, 2] of one triangle p, n [3, 3]; None where coplanarity holds all over it, and nothing can be eliminated."""
    along = unit(p[1] - p[0] + 0.37 * (p[2] - p[0]))
    coplanar, angles = system(p, n, eye, V, along)
    scale = np.linalg.norm(p[1] - p[0]) / np.linalg.norm(eye - p[0])
    if np.abs(coplanar).max() < 1e-9 * scale:
        return None
    if degree(coplanar) == 0:  # of u alone: the next corner is the first
        turned = eliminated(p[[1, 2, 0]], n[[1, 2, 0]], eye, V)
        return np.array([(1 - a - b, a) for a, b in turned]).reshape(-1, 2)
    c = resultant(coplanar, angles)
    c = chebyshev.chebtrim(c, 1e-13 * np.abs(c).max())
    if len(c) < 2 or abs(c[0]) > 1.01 * np.abs(c[1:]).sum():  # no root within -1 <= t <= 1
        return np.zeros((0, 2))
    t = chebyshev.chebroots(c)
    u = 0.5 * (t[np.abs(t.imag) < 1e-3].real + 1)
    found = []
    for x in u[(u > -0.02) & (u < 1.02)]:
        rest = x ** np.arange(coplanar.shape[0]) @ coplanar[:, : degree(coplanar) + 1]
        for y in np.roots(rest[::-1]):
            if abs(y.imag) < 0.05 and -0.1 < y.real < 1.1:
                found.append(polished((x, y.real), p, n, eye, V))
    return distinct(found)


# Dense search


def dense(p, n, eye, V, fine=24):
    """The roots [K, 2] of one triangle p, n [3, 3]: from each of fine x fine cells over it where both parts of `law`, if they
    were linear, would vanish no farther than a cell away."""
    u, v = np.meshgrid(np.arange(fine + 1) / fine, np.arange(fine + 1) / fine, indexing="ij")
    f = law(np.stack([u, v], axis=-1), p, n, eye, V)[0]
    at, right, up = f[:-1, :-1], f[1:, :-1], f[:-1, 1:]
    J = np.stack([right - at, up - at], axis=-1)
    det = J[..., 0, 0] * J[..., 1, 1] - J[..., 0, 1] * J[..., 1, 0]
    det = np.where(np.abs(det) < 1e-300, 1e-300, det)
    x = (J[..., 0, 1] * at[..., 1] - J[..., 1, 1] * at[..., 0]) / det
    y = (J[..., 1, 0] * at[..., 0] - J[..., 0, 0] * at[..., 1]) / det
    # Where two roots are about to meet, f is not linear on a cell, however small: there its least values count.
    size = np.linalg.norm(f, axis=-1)
    low = size[:-1, :-1] <= np.minimum.reduce([size[1:, :-1], size[:-1, 1:], size[1:, 1:]])
    near = ((np.abs(x - 0.5) < 1.5) & (np.abs(y - 0.5) < 1.5)) | (low & (size[:-1, :-1] < 0.05 * size.max()))
    inside = u[:-1, :-1] + v[:-1, :-1] < 1
    starts = np.argwhere(near & inside)
    found = [
        polished((a, b), p, n, eye, V) for a, b in (starts + np.clip(np.stack([x, y], axis=-1)[tuple(starts.T)], 0, 1)) / fine
    ]
    return distinct(found)
