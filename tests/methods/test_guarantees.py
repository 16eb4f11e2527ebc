"""What every method guarantees in every regime of failure, G1 to G5 of the catalogue, whoever wrote it.

    G1  no NaN, no infinity, nothing negative
    G2  searches end within their limit
    G3  a vertex called converged obeys the law of reflection
    G4  the same again bit for bit, and the same but for rounding if vertices and triangles are numbered otherwise
    G5  the same if everything is turned and moved

Derived exceptions. A vertex may have several reflections where a mirror is not convex, and which one a method comes to may
depend on its start: then another true one is as good, and the picture of a scene that is turned may be another one. What a
method ends with is as near to a root as the law that is left over says: |half vector - normal| by the least singular value of
its derivative along the mirror, both in float64. Pictures within a method have texels, whose grid does not turn with the
scene: its picture keeps within a pixel, but for few. What has no walls has no axes: the box around it may turn otherwise.

The first tier draws pairs: every regime, mildest and severest, with one method, and the methods take turns. Of those pairs,
G3 has all whose method reports vertices, and "again", "renumbered" and "turned" have as many in a row as there are methods.
The rest has a fourth of all pairs, and of those that are only repeated, "again" and "renumbered", an eighth.
"""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from scipy.ndimage import maximum_filter, minimum_filter
from support.known_reflections import SEARCHING, VERTEXWISE
from support.stress_rooms import METHODS, REGIMES, Law, Shown, any_motion, extremes, kept, laws, prepared, shown
from support.tiers import complete, exhaustive, in_turns, paired, up_to_the_rest

from benchharness.kernels.images import roombox
from benchharness.kernels.vertices.mirrormesh import is_convex
from benchharness.stability import altered
from benchharness.study import params

FEWEST_STEPS = 250  # the limit of a search that has none of its own
LAW_PX = 1.0  # pixels: what is left of the law, by what one pixel changes at most; searches stop in triangles as wide
LAW = 0.01  # or this, |half vector - normal|, half a degree, where that is more: on a mirror that hardly turns in a pixel
HEIGHT_PX = 0.5  # pixels: how far from the mesh; what looks at textures extrapolates from their texels
TOUCHES = 2e-5  # of the mirror's size: a vertex as near to it is its own reflection, and there is no half vector
MOVED = 1e-4  # of the mirror's size: R after a rigid motion
SAME_COLOUR = 0.05  # radiance: a sixth of the checkered floor's contrast, which texels blend otherwise if they are turned
STRAY_PX = 0.01  # share of pixels that rounding decides: edges in a picture of edges
TURNED_PX = 0.02  # share of pixels that texels decide, if their grid is turned
SKINS_PX = {"distance_impostor": 0.04}  # the same, where a map's single layer sees thin things edge-on: skins a texel wide
SKINS_PX |= {"near_far": 0.08}  # and where a ring shows a map's far checkers several times, each a pixel or two wide
LOOKED_UP = 0.8  # share of converged vertices that still are, for what is looked up in a map whose grid does not turn
ROUNDED = 1e-3  # radiance
ROOMS = ("box_projection", "probe_blend")  # methods that fit a box around what surrounds a mirror
GRIDS = ("reflection_morph",)  # methods whose maps stand in a row along each axis of a mirror's box
UNTURNED = {
    ("probe_blend", "next_room"): "two rooms have no box of their own, and maps stand elsewhere in one that is turned",
}
CONVERGE = 0.8  # share of regimes whose mildest scene has vertices that converge
REPEATED = 8  # every so many-th pair asked twice and renumbered: what breaks these is in a method, hardly in a regime

methods = pytest.mark.parametrize("method", METHODS)


DRAWN = in_turns(REGIMES, list(METHODS))


def pairs(of, drawn, step: int = 4):
    """Every regime with every method of some; those drawn are in the first tier, and every so many-th in the rest."""
    return pytest.mark.parametrize(("regime", "method"), paired(REGIMES, of, drawn, step))


def both(method: str, regime: str) -> list[tuple[float, Shown]]:
    """What it shows at the mildest and at the severest severity."""
    answers = [(severity, kept(method, regime, severity)) for severity in extremes(regime)]
    given = [(severity, answer) for severity, answer in answers if answer is not None]
    if not given:
        pytest.skip("the method refuses")
    return given


def time_of(regime: str, scene) -> float:
    return scene.time(REGIMES[regime][0].frame)


@pairs(METHODS, DRAWN)
def test_answers_are_numbers_and_searches_end_within_their_limit(method, regime):
    limit = params.of_method(METHODS[method]).get("max_iter")
    for _, answer in both(method, regime):
        assert np.isfinite(answer.L).all() and (answer.L >= 0).all()
        assert not np.isnan(answer.distance).any() and (answer.distance >= 0).all()
        for name, value in (answer.vertices or {}).items():
            assert np.isfinite(value).all(), name
        if answer.vertices is not None:
            # A search may be followed by another one from its end.
            assert answer.vertices["iterations"].max() <= (FEWEST_STEPS if limit is None else 2 * limit.default)


@methods
def test_a_low_limit_is_kept(method):
    if "max_iter" not in params.of_method(METHODS[method]):
        pytest.skip("searches nothing")
    answer = shown(method, "coarse_mirror", extremes("coarse_mirror")[0], max_iter=3)
    assert answer is not None and answer.vertices is not None
    assert 0 < answer.vertices["iterations"].max() <= 6
    assert all(np.isfinite(value).all() for value in answer.vertices.values()) and np.isfinite(answer.L).all()


@pairs(VERTEXWISE, DRAWN)
def test_what_is_called_converged_obeys_the_law_of_reflection(regime, method):
    judged = 0
    for severity, answer in both(method, regime):
        assert answer.vertices is not None
        scene = prepared(regime, severity)[0]
        for mirror, chosen, law in laws(scene, answer.vertices, time_of(regime, scene)):
            apart = law.reach > TOUCHES * size_of(scene, mirror)
            assert obeyed(law)[apart].all()
            assert (law.height <= HEIGHT_PX * law.pixel).all()
            assert (law.towards[:, 0] > 0).all() and (law.towards[apart, 1] > 0).all()
            judged += len(chosen)
    if not judged:
        pytest.skip("nothing converged")


IN_THE_REST = up_to_the_rest(paired(REGIMES, VERTEXWISE, DRAWN))


@exhaustive
@pytest.mark.parametrize(
    "among", [IN_THE_REST, pytest.param([*product(REGIMES, SEARCHING)], marks=complete)], ids=["some", "all"]
)
@pytest.mark.parametrize("method", SEARCHING)
def test_in_most_regimes_a_method_converges_somewhere(method, among):
    """So that there is something for G3 to judge, method by method, of what it judges in the same tier."""
    shares = []
    for regime in (regime for regime, other in among if other == method):
        answer = kept(method, regime, extremes(regime)[0])
        if answer is not None:
            assert answer.vertices is not None
            shares.append(answer.vertices["converged"].any())
    assert len(shares) >= 8 and np.mean(shares) > CONVERGE


@pairs(METHODS, DRAWN[: len(METHODS)], REPEATED)
def test_asked_twice_everything_is_the_same_bit_for_bit(method, regime):
    severity, answer = both(method, regime)[-1]
    again = shown(method, regime, severity)
    assert again is not None and again.bytes() == answer.bytes()


@pairs(METHODS, DRAWN[len(METHODS) : 2 * len(METHODS)], REPEATED)
def test_numbered_otherwise_everything_is_the_same_but_for_rounding(method, regime):
    severity, answer = both(method, regime)[-1]
    other = shown(method, regime, severity, "renumbered")
    assert other is not None
    assert (answer.active == other.active).all()
    assert (np.abs(answer.L - other.L).max(axis=2) > ROUNDED).mean() <= STRAY_PX
    if answer.vertices is not None and other.vertices is not None:
        scene = prepared(regime, severity)[0]
        now_at = np.argsort(altered.renumbered(scene)[1])
        same_roots(regime, scene, answer.vertices, {k: v[:, now_at] for k, v in other.vertices.items()}, 0.97)


@pairs(METHODS, DRAWN[-len(METHODS) :])
def test_turned_and_moved_everything_is_the_same(method, regime):
    if (method, regime) in UNTURNED:
        pytest.skip(UNTURNED[method, regime])
    severity, answer = both(method, regime)[-1]
    scene = prepared(regime, severity)[0]
    if scene.environment is not None:
        pytest.skip("a panorama's texels do not turn")
    other = shown(method, regime, severity, "carried")
    assert other is not None
    if method in ROOMS and not all(box.walled for box in roombox.around_mirrors(scene)):
        pytest.skip("what surrounds the mirror has no walls")
    if method in GRIDS and not all(turns_along(r, any_motion()) for r in scene.reflectors):
        pytest.skip("maps of a round mirror stand elsewhere in one that is turned")
    if all(boxed(r, any_motion()) if answer.vertices is None else convex(scene, i) for i, r in enumerate(scene.reflectors)):
        alike(answer, other, SKINS_PX.get(method, TURNED_PX))
    if answer.vertices is not None and other.vertices is not None:
        pose = any_motion()
        back = other.vertices | {"R": (other.vertices["R"] - pose[:3, 3]) @ pose[:3, :3]}
        same_roots(regime, scene, answer.vertices, back, 0.97 if method in SEARCHING else LOOKED_UP)


def obeyed(law: Law) -> np.ndarray:
    return law.off <= np.maximum(LAW, LAW_PX * law.most * law.pixel)


def size_of(scene, mirror: int) -> float:
    reflector = scene.reflectors[mirror]
    return float(np.linalg.norm(np.ptp((reflector.closed or reflector.mesh).vertices, axis=0)))


def same_roots(regime: str, scene, one: dict[str, np.ndarray], other: dict[str, np.ndarray], both: float) -> None:
    """Of vertices that both call converged, at least the share `both` of those that one of them does: the same points, as near
    as what is left of the law allows; where the mirror is not convex, other roots too."""
    time = time_of(regime, scene)
    first, second = ({i: (chosen, law) for i, chosen, law in laws(scene, v, time)} for v in (one, other))
    assert first.keys() == second.keys()
    for mirror, (chosen, law) in first.items():
        others, other_law = second[mirror]
        common, a, b = np.intersect1d(chosen, others, return_indices=True)
        # What one calls converged and the other does not lies at the outline or at a focus.
        assert len(common) >= both * max(len(chosen), len(others)) or not convex(scene, mirror)
        apart = np.linalg.norm(one["R"][mirror, common] - other["R"][mirror, common].astype(float), axis=1)
        allowed = 2 * (law.off[a] + other_law.off[b]) / np.minimum(law.least[a], other_law.least[b])
        allowed += MOVED * size_of(scene, mirror) + (law.height[a] + other_law.height[b])
        if convex(scene, mirror):
            assert (apart <= allowed).all()
        else:
            assert obeyed(other_law).all()


def boxed(reflector, pose: np.ndarray) -> bool:
    """Whether the middle of a mirror's box along its own axes stays where it is if its vertices are moved by a rigid motion and
    its axes are not: environment maps stand there."""
    old = (reflector.closed or reflector.mesh).vertices
    new = old @ pose[:3, :3].T + pose[:3, 3]
    middles = [0.5 * (v.min(axis=0) + v.max(axis=0)) for v in (old, new)]
    apart = np.linalg.norm(pose[:3, :3] @ middles[0] + pose[:3, 3] - middles[1])
    return bool(apart < 0.01 * np.linalg.norm(np.ptp(old, axis=0)))


def turns_along(reflector, pose: np.ndarray) -> bool:
    """Whether the axes of a mirror's box turn with it."""
    mesh = reflector.closed or reflector.mesh
    old, new = (roombox.settled(v, mesh.faces).axes for v in (mesh.vertices, mesh.vertices @ pose[:3, :3].T + pose[:3, 3]))
    return bool((np.abs(old @ pose[:3, :3].T @ new.T).max(axis=1) > 0.999).all())


def convex(scene, mirror: int) -> bool:
    reflector = scene.reflectors[mirror]
    mesh = reflector.closed or reflector.mesh
    return is_convex(mesh.vertices, mesh.faces)


def alike(one: Shown, other: Shown, share: float) -> None:
    """Every pixel's colour lies among those of the other picture's pixels around it, and the other way round, but for few."""
    common = one.active & other.active
    assert (one.active != other.active).sum() <= TURNED_PX * common.sum() + 2
    for a, b in ((one.L, other.L), (other.L, one.L)):
        low, high = (f(b, (3, 3, 1)) for f in (minimum_filter, maximum_filter))
        outside = ((a < low - SAME_COLOUR) | (a > high + SAME_COLOUR)).any(axis=2) & common
        assert outside.sum() <= share * common.sum() + 2
