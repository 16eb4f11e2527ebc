"""Whatever a vertex method calls converged is a reflection point of the surface that it sees: triangles and their normals.

Mirrors, eyes and vertices are random (`random_mirrors`), the truth is solved for on the mesh in float64 (`mesh_roots`). What
cannot be known is not converged. Near contact, within NEAREST of the mirror's size, the vertex itself is its reflection point.

The first tier has a convex mirror and a hollow one; the rest has two of every kind.
"""

from __future__ import annotations

import numpy as np
import pytest
from oracles.mesh_roots import Surface, pixels_off
from support.known_reflections import METHODS, points_of
from support.mirror_room import scene, shaded, still
from support.random_mirrors import KINDS, eye_before, mirror, vertices
from support.stress_rooms import law
from support.tiers import exhaustive

from benchharness.api import Method
from benchharness.kernels.pixels import WRONG_PX
from benchharness.kernels.vertices.mirrormesh import NEAREST
from benchharness.render.frame import FrameRenderer

SIZE = (320, 240)
COUNT = 6_000
SOLVED = 300
SEEDS = {"fine": 1, "finest": 1}
ASKED = {
    "newton": ("newton", {}),
    "secant_triangle": ("secant_triangle", {}),
    "secant_triangle, always": ("secant_triangle", {"newton": "always"}),
    "secant_triangle, off": ("secant_triangle", {"newton": "off"}),
    "image_space_search": ("image_space_search", {}),
}
# A map or picture of the mirror knows normals at its texels, and what the mesh does between them only if that is smooth: where
# an edge passes between two texels, of its answers this share may be wrong. Newton's steps ask the mesh itself.
UNKNOWN = {"secant_triangle, off": 0.01, "image_space_search": 0.01}
MARGIN = 2.0  # over the bound to first order
VAGUE = 0.02  # share of answers at a focus, of which that bound says more than WRONG_PX
RESIDUAL_PX = {"newton": 0.02, "secant_triangle, always": 0.02}
"""99 in 100 are this near: a walk stops when a step would be shorter than 0.004 px, and float32 knows no more where a step is
as long as its rounding."""


def wrong(made, renderer, mirror_, surface, V, name: str) -> tuple[np.ndarray, float]:
    """Pixels off of a sample of what a method calls converged, and the share that it calls so."""
    found = shaded(method_of(name), made, 0, renderer=renderer)[0].reflection.vertices
    assert found is not None
    converged, R = np.array(found.converged)[: len(V)], np.array(found.R, np.float64).T[: len(V)]
    chosen = np.flatnonzero(converged)
    chosen = chosen[:: max(1, len(chosen) // SOLVED)]
    if not len(chosen):
        return np.zeros(0), 0.0
    off = pixels_off(surface, made.camera(0.0), SIZE, V[chosen], R[chosen], WRONG_PX)
    size = np.linalg.norm(np.ptp(mirror_.mesh.vertices, axis=0))
    off[np.linalg.norm(R[chosen] - V[chosen], axis=1) < NEAREST * size] = 0
    far = np.flatnonzero(off > WRONG_PX)
    if name in UNKNOWN and len(far):
        # There is a root within |half vector - normal| / σ (`test_fuzz`), or two have just met and gone.
        judged = law(mirror_.mesh, mirror_.closed is None, R[chosen[far]], V[chosen[far]], made.camera(0.0), SIZE[1])
        bound = MARGIN * (judged.off / judged.least + judged.height) / judged.pixel
        vague = (bound > WRONG_PX) & ((bound >= off[far]) | ~np.isfinite(off[far]))
        assert vague.sum() <= VAGUE * len(off), f"{name}: {vague.sum()} of {len(off)}"
        off[far[vague]] = 0
    return off, float(converged.mean())


def method_of(name: str) -> Method:
    method, parameters = ASKED[name]
    return METHODS[method](**parameters)


QUICK = [("round", 1), ("hollow", 1)]


@pytest.mark.parametrize(
    ("kind", "seeds"), [*QUICK, *(pytest.param(kind, SEEDS.get(kind, 2), marks=exhaustive) for kind in KINDS)]
)
def test_what_is_called_converged_is_a_reflection_point_of_the_mesh(kind, seeds):
    seen = dict.fromkeys(ASKED, 0.0)
    for seed in range(seeds):
        rng = np.random.default_rng([seed, KINDS.index(kind)])
        mirror_ = mirror(kind, rng)
        eye, fov_deg = eye_before(mirror_, rng)
        V = vertices(mirror_, eye, rng, COUNT)
        made = scene([points_of(V)], [mirror_], still(tuple(eye), (0.0, 0.0, 0.0), fov_deg), frames=1)
        renderer, surface = FrameRenderer(made, *SIZE), Surface(mirror_, eye)
        for name in ASKED:
            if method_of(name).refuses(made) is not None:
                continue
            off, share = wrong(made, renderer, mirror_, surface, V, name)
            case = f"{name}, {kind} {seed}"
            assert (off > WRONG_PX).sum() <= UNKNOWN.get(name, 0) * len(off), f"{case}: {np.sort(off)[-9:]} px off"
            if name in RESIDUAL_PX and len(off):
                assert np.quantile(off, 0.99) < RESIDUAL_PX[name], case
            seen[name] = max(seen[name], share)
    assert seen["newton"] > 0.3 and seen["image_space_search"] > 0.1  # so that there is something to be wrong about
