"""Trees of arrays, lane by lane, against NumPy; also where what was recorded for one size is asked for another."""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from benchharness.kernels import lanes
from benchharness.kernels.frozen import frozen


@dataclass
class Inner:
    single: mi.UInt32
    pair: mi.Point2f


@dataclass
class Tree:
    triple: mi.Float
    packet: mi.UInt32
    inner: Inner
    nothing: mi.Float | None = None
    same: mi.Float | None = None


def tree(count: int, first: int = 0, *, same: bool = False) -> Tree:
    n = np.arange(first, first + count)
    three, four = (3 * n[:, None] + np.arange(3)).ravel(), (4 * n[:, None] + np.arange(4)).ravel()
    inner = Inner(mi.UInt32(n.astype(np.uint32)), mi.Point2f(n.astype(np.float32), 10.0 * n.astype(np.float32)))
    made = Tree(
        mi.Float(three.astype(np.float32)), mi.UInt32(four.astype(np.uint32)), inner, None, mi.Float(7) if same else None
    )
    dr.eval(made)
    return made


def told(made: Tree) -> list[int]:
    """Of a tree whose lanes hold what `tree` puts there, the numbers of the lanes."""
    single = np.array(made.inner.single).astype(int)
    x, y = np.array(made.inner.pair)
    triple, packet = np.array(made.triple).reshape(-1, 3), np.array(made.packet).reshape(-1, 4)
    assert np.array_equal(x, single) and np.array_equal(y, 10 * single)
    assert np.array_equal(triple, np.where(single[:, None] > 0, 3 * single[:, None] + np.arange(3), triple))
    assert np.array_equal(packet, np.where(single[:, None] > 0, 4 * single[:, None] + np.arange(4), packet))
    return single.tolist()


@pytest.mark.parametrize("same", [True, False])
def test_lanes_are_gathered_and_where_there_is_none_taken_from_others(same):
    index = np.array([3, lanes.NONE, 8, 1, lanes.NONE], np.uint32)
    made = lanes.gathered(tree(9, same=same), tree(5, 100, same=same), mi.UInt32(index), 9)
    assert told(made) == [3, 101, 8, 1, 104]
    assert made.nothing is None


def test_what_was_recorded_for_few_lanes_gathers_from_many():
    """`wanted` lanes out of `count`: a recording is told the first number alone."""

    @frozen
    def asked(values: Tree, others: Tree, lane: mi.UInt32, wanted: int) -> Tree:
        return lanes.gathered(values, others, dr.select(lane % 2 == 0, lane + 1, lanes.NONE), dr.width(values.inner.single))

    for count in (20, 500, 40, 3000, 20):
        for wanted in (16, 8):
            lane = mi.UInt32(np.arange(wanted, dtype=np.uint32))
            nothing = Inner(dr.zeros(mi.UInt32, wanted), dr.zeros(mi.Point2f, wanted))
            others = Tree(dr.zeros(mi.Float, 3 * wanted), dr.zeros(mi.UInt32, 4 * wanted), nothing)
            made = asked(tree(count), others, lane, wanted)
            assert told(made) == [k + 1 if k % 2 == 0 else 0 for k in range(wanted)], (count, wanted)


def test_lanes_are_joined_made_room_for_put_and_taken():
    made = lanes.joined([tree(4), tree(3, 50)])
    assert told(made) == [0, 1, 2, 3, 50, 51, 52]
    room = lanes.roomy(tree(4, 1, same=True), 4, 10)
    assert told(room) == [1, 2, 3, 4, 0, 0, 0, 0, 0, 0]
    lanes.put(room, tree(3, 20, same=True), mi.UInt32(5), mi.UInt32([0, 1, 2]))
    assert told(room) == [1, 2, 3, 4, 0, 20, 21, 22, 0, 0]
    assert told(lanes.first(room, 10, 7)) == [1, 2, 3, 4, 0, 20, 21]
    assert np.array(room.same).tolist() == [7]
