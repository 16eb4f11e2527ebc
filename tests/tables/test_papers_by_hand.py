"""What can be said of the papers' own numbers, formulas and listings with a pencil: for the claims that cite it."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from benchharness.tables import claims

BUILT = {"kitchen": (11_379, 14_979), "ufo": (63_884, 81_977), "ant": (14_859, 30_153)}
"""Estalella et al. 2006, section 6: vertices before and after splitting."""
FRAMES_BY_SIZE = {(640, 480): 46, (800, 600): 36, (960, 720): 31, (1120, 840): 25, (1280, 960): 11}
"""Popescu et al. 2006, section 5.1."""


def stated(name: str) -> str:
    """What a claim says the paper says."""
    (claim,) = (claim for claim in claims.load() if claim.id == name)
    return claim.says


def test_splitting_adds_most_to_the_ants():
    growth = {scene: after / before for scene, (before, after) in BUILT.items()}
    assert {scene: round(value, 2) for scene, value in growth.items()} == {"kitchen": 1.32, "ufo": 1.28, "ant": 2.03}
    for scene, (before, after) in BUILT.items():
        assert f"{before:,}" in (said := stated(f"estalella-vertices-{scene}")) and f"{after:,}" in said


def test_a_scene_has_two_counts_and_another_three_rates():
    counts, rates = (81_977, 81_997), (80, 82, 87)
    assert counts[1] - counts[0] == 20  # two digits that changed places, or one that is another
    assert max(rates) / min(rates) == pytest.approx(1.09, abs=0.01)
    assert all(f"{count:,}" in stated("estalella-two-counts") for count in counts)
    assert all(str(rate) in stated("estalella-three-rates") for rate in rates)


def test_mirrors_are_seen_in_all_others():
    assert {n: sum(1 for _ in itertools.permutations(range(n), 2)) for n in (4, 9)} == {4: 12, 9: 72}


def test_a_table_that_all_mirrors_share_is_one_billboard_less():
    pots, statues, tables = 2, 1, 1
    assert (statues + tables) * pots == 4
    assert statues * pots + tables == 3


def test_rows_take_960_kilobytes():
    size = 60 * 256 * 8 * 2 * 4  # turns, rows, points, floats of a point, bytes of a float
    assert size == 983_040 == 960 * 1024
    assert size / (256 * 256 * 4) == 3.75  # a map's bytes


def test_64_points_are_a_quarter_of_a_row():
    assert 64 / 256 == 0.25


def test_a_mirror_at_16_frames_per_second_is_that_many_rays():
    rays = 250 * 350 * 16
    assert rays == 1.4e6
    assert int(100e6 / rays) == 71  # triangles of 100 million per second that each ray may be tested against


def test_pixels_per_second_grow_with_the_picture_but_for_the_last():
    rates = [1e-6 * width * height * frames for (width, height), frames in FRAMES_BY_SIZE.items()]
    assert [round(rate) for rate in rates] == [14, 17, 21, 24, 14]
    assert all(str(frames) in stated("popescu-table-size") for frames in (46, 36, 31, 25))


def renders(mirrors: int, levels: int) -> int:
    """Pictures that facing mirrors take, each reflection in a mirror other than the one before."""
    chains = (itertools.product(range(mirrors), repeat=level) for level in range(1, levels + 1))
    return sum(all(a != b for a, b in itertools.pairwise(chain)) for level in chains for chain in level)


def test_two_facing_mirrors_take_half_the_renders_and_three_soon_more():
    assert renders(2, 3) == 6 and 3 * 2**2 == 12
    assert renders(2, 8) == 16 and 8 * 2**2 == 32
    assert renders(3, 3) == 21 < 3 * 3**2 and renders(3, 8) == 765 > 8 * 3**2
    assert all(renders(n, k) == n * sum((n - 1) ** i for i in range(k)) for n in (1, 2, 3) for k in (1, 2, 3, 4))


def listing(depth: int) -> list[int]:
    """The depths at which the printed recursion of one mirror renders, in order: it renders, and goes on from 0 up."""
    return [depth, *(listing(depth - 1) if depth >= 0 else [])]


def test_the_listing_renders_the_deepest_level_last_and_two_levels_more():
    rendered = listing(8)
    assert len(rendered) == 10 == 8 + 2
    assert rendered == sorted(rendered, reverse=True)  # less depth is left the deeper it is: the deepest is the last


def test_a_view_position_is_on_the_wrong_side_of_a_plane_of_the_world():
    """The mirror is x = 0; the eye is turned by 90 degrees about the upright axis, and stands at (3, 0, 0)."""
    world = np.random.default_rng(0).uniform(-2, 2, (1000, 3))
    turn, eye = np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]]), np.array([3.0, 0, 0])
    in_view = (world - eye) @ turn.T
    wrong = np.sum((in_view[:, 0] < 0) != (world[:, 0] < 0))
    assert wrong == 495  # x there is z here: as good as a coin
    # By the model matrix alone, which is the identity here, none is.
    assert np.sum((world @ np.eye(3))[:, 0] < 0) == np.sum(world[:, 0] < 0)
