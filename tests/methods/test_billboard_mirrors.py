"""Billboards of mirrors: second reflections, their light, and how many quads a pixel meets."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.board_scenes import (
    SKY,
    floor,
    one,
    rms,
    row_of_mirrors,
)
from support.mirror_room import mirror_ball, scene, smooth, still, walls

from methods.billboard_impostor import BillboardImpostor
from methods.ray_traced import RayTraced


@pytest.mark.parametrize(("objects", "mirrors", "once", "twice"), [(2, 2, 3, 5), (1, 4, 4, 5), (1, 9, 9, 10), (3, 2, 4, 7)])
def test_i07_a_pixel_meets_d_plus_r_minus_1_quads_and_d_more_for_a_second_reflection(objects, mirrors, once, twice):
    """I-07: D objects and R mirrors: D + R - 1, and 2 D + R - 1."""
    made = row_of_mirrors(objects, mirrors)
    answer = one(BillboardImpostor(), made)
    second, tests = answer.counted("second_order") == 1, answer.counted("quad_tests")
    assert 10 < second.sum() < answer.active.sum() / 2
    assert set(tests[second]) == {twice} and set(tests[answer.active & ~second]) == {once}
    assert (tests[~answer.active] == 0).all()
    black = one(BillboardImpostor(other_mirrors="black"), made)
    np.testing.assert_array_equal(black.counted("second_order") == 1, second)
    assert set(black.counted("quad_tests")[answer.active]) == {once}
    assert (black.L[second] == 0).all() and (answer.L[second].max(axis=1) > 0).all()
    np.testing.assert_array_equal(black.L[~second], answer.L[~second])
    # Fewer pictures lie elsewhere on the sheet that they are taken on, and are rounded otherwise.
    omitted = one(BillboardImpostor(other_mirrors="omitted"), made)
    assert set(omitted.counted("quad_tests")[answer.active]) == {objects}
    assert not omitted.counted("second_order").any()
    np.testing.assert_allclose(omitted.L[~second], answer.L[~second], atol=1e-6)


def far_mirrors(gap: float, second=None):
    ground = floor(6.0)
    ground = replace(ground, mesh=replace(ground.mesh, radiance=smooth(ground.mesh.vertices, 1.0)))
    mirrors = (mirror_ball("one", (-gap / 2, 0, 0), 0.35), mirror_ball("two", (gap / 2, 0, 0), 0.35, **(second or {})))
    eye, one_, two = np.array([0.0, -4.5, 0.6]), np.array([-gap / 2, 0, 0]), np.array([gap / 2, 0, 0])
    halfway = (eye - one_) / np.linalg.norm(eye - one_) + (two - one_) / gap
    seen_in = one_ + 0.35 * halfway / np.linalg.norm(halfway)
    camera = still(eye, seen_in, 5.0 / gap)
    return scene((ground,), mirrors, camera, background=SKY)


def test_i07_a_second_reflection_is_nearer_to_the_truth_than_black_or_none_and_more_so_far_away():
    """I-07: the billboard's normals are right, where they stand is not: the error falls with the distance of the mirrors."""
    errors = []
    for gap in (1.0, 2.0, 4.0):
        made = far_mirrors(gap)
        exact = one(RayTraced(bounces=2), made)
        answers = [one(BillboardImpostor(other_mirrors=o), made) for o in ("reflective", "black", "omitted")]
        second = answers[0].counted("second_order") == 1
        assert second.sum() > 100
        errors.append([rms(a, exact, second) for a in answers])
    assert errors[0][0] < 0.7 * errors[0][1]
    for near in errors[1:]:
        assert near[0] < 0.6 * min(near[1:])
    assert errors[2][0] < 0.7 * errors[1][0] < 0.7**2 * errors[0][0]


GOLD = {"eta": (0.143, 0.375, 1.442), "k": (3.983, 2.386, 1.603)}


def conductor(cosine, eta, k):
    """Unpolarised reflectance, by complex amplitudes."""
    m = eta + 1j * k
    inner = np.sqrt(m * m - (1 - cosine**2))
    s, p = (cosine - inner) / (cosine + inner), (m * m * cosine - inner) / (m * m * cosine + inner)
    return 0.5 * (np.abs(s) ** 2 + np.abs(p) ** 2)


def test_a_second_mirror_of_gold_dims_by_its_reflectance_at_the_angle_of_its_billboard():
    ideal, gold = (one(BillboardImpostor(), far_mirrors(1.0, s)) for s in (None, GOLD))
    seen_in_first = np.array(gold.frame.reflector).reshape(gold.active.shape) == 0
    second = (gold.counted("second_order") == 1) & seen_in_first
    assert second.sum() > 100
    ratio = gold.L[second] / ideal.L[second]
    assert (ratio[:, 0] > ratio[:, 1]).all() and (ratio[:, 1] > ratio[:, 2]).all()
    # One angle explains all three colours.
    table = conductor(np.linspace(0, 1, 4001)[:, None], *(np.array(GOLD[x]) for x in ("eta", "k")))
    nearest = np.abs(table[None] - ratio[:, None]).max(axis=2).min(axis=1)
    assert nearest.max() < 2e-3
    assert ratio[:, 2].max() - ratio[:, 2].min() > 0.01
    np.testing.assert_array_equal(gold.L[gold.active & ~(gold.counted("second_order") == 1)],
                                  ideal.L[ideal.active & ~(ideal.counted("second_order") == 1)])  # fmt: skip


def test_light_is_lost_along_the_ray_exponentially():
    made = row_of_mirrors(3, 2)
    full, dimmed = (one(BillboardImpostor(attenuation=a), made) for a in (0.0, 0.7))
    np.testing.assert_array_equal(full.distance, dimmed.distance)
    share = np.exp(-0.7 * full.distance.astype(float))[..., None]
    np.testing.assert_allclose(dimmed.L, full.L * share, rtol=2e-6, atol=1e-9)
    far = full.active & np.isinf(full.distance)
    assert far.any() and (dimmed.L[far] == 0).all() and (dimmed.L[full.active & ~far].max(axis=1) > 0).all()


def test_i27_no_mirror_is_in_its_own_pictures():
    """I-27: neither among the quads of a mirror nor in its environment map."""
    alone = scene((), (mirror_ball(),), background=SKY)
    answer = one(BillboardImpostor(), alone)
    np.testing.assert_allclose(answer.L[answer.active], np.tile(SKY, (answer.active.sum(), 1)), atol=1e-6)
    assert np.isinf(answer.distance[answer.active]).all() and not answer.counted("quad_tests").any()
    inside = scene((walls(),), (mirror_ball(),))
    answer, exact = one(BillboardImpostor(), inside), one(RayTraced(), inside)
    assert (answer.distance[answer.active] > 1.5).all()  # the walls, not the mirror's own inside
    assert answer.L[answer.active].min() > 0.2 and rms(answer, exact, answer.active) < 0.1
    plan = BillboardImpostor().prepare(row_of_mirrors(2, 4)).scene.plan
    for mirror, shown in enumerate(plan.quads):
        assert sorted(plan.slots[s].part - 2 for s in shown[1]) == [m for m in range(4) if m != mirror]
        assert all(plan.slots[s].mirror == mirror for s in (*shown[0], *shown[1]))
