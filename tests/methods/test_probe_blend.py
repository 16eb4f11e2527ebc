"""Blended probes: energy is kept whatever the weights, images are double between maps, the environment fills what is left."""

from __future__ import annotations

from dataclasses import replace

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from oracles.proxy_oracle import turned
from scipy.ndimage import binary_erosion, label
from support.mirror_room import Answer, mirror_ball, mirror_room, plain, scene, shaded, still, walls
from support.proxy_rooms import SIZE, Truth, hall, red
from support.small_room import box

from benchharness.render.frame import FrameRenderer
from benchharness.scene import Object
from methods.box_projection import BoxProjection
from methods.environment_map import EnvironmentMap
from methods.probe_blend import ProbeBlend
from scenes.stress.comb import comb
from scenes.stress.contact import contact

GREY = (0.5, 0.5, 0.5)
FRAME = turned(np.array([1.0, 2.0, -1.5]), 50.0)


def grey_room(*things: Object, at=(0.0, 0.0, 0.0), radius: float = 0.4):
    """All of one colour but for what is added: what a mirror shows is that colour whatever is looked up, and how."""
    room = Object("walls", plain(box((-2, -2, -2), (2, 2, 2), inside=True), GREY), "one colour")
    at = np.asarray(at, float)
    camera = still(tuple(at + np.array([0.1, -1.6, 0.2])), tuple(at))
    return scene((room, *things), (mirror_ball(center=tuple(at.tolist()), radius=radius),), camera)


@pytest.fixture(scope="module")
def turned_hall():
    return Truth(hall(FRAME, (5.0, -3.0, 2.0)))


# Exact


def test_in_an_empty_room_blended_maps_agree_and_are_exact(turned_hall):
    """Of any place and turn, by any number of maps; texels are coarser the farther a map is from what is shown."""
    for probes in (1, 2):
        assert turned_hall.error(ProbeBlend(probes=probes)) < 0.008
    assert turned_hall.error(EnvironmentMap()) > 0.04
    true, found = turned_hall.answer.distance[turned_hall.inner], turned_hall.of(ProbeBlend()).distance[turned_hall.inner]
    assert np.median(np.abs(found / true - 1)) < 3e-3


def test_a_room_of_one_colour_keeps_it_whatever_the_weights():
    """No border is dark, nothing gains energy: at a corner of eight cells, at hard borders, and in a cell that has no map, as
    its place is within a block."""
    block = Object("block", plain(box((0.75, 0.75, 0.75), (1.25, 1.25, 1.25)), GREY), "around the place of a map")
    for made, methods in (
        (grey_room(), [ProbeBlend(blend=b, resolution=16) for b in (0.5, 0.0, 1.0)]),
        (grey_room(block, at=(1.0, 0.45, 0.45), radius=0.2), [ProbeBlend(blend=b, resolution=16) for b in (0.5, 0.0)]),
    ):
        renderer = FrameRenderer(made, *SIZE)
        for method in methods:
            (found,) = shaded(method, made, 0, renderer=renderer)
            assert found.active.sum() > 200
            np.testing.assert_allclose(found.L[found.active], 0.5, rtol=1e-4)


def test_the_order_of_the_maps_does_not_matter(turned_hall):
    """None is the last that wins."""
    made, method = mirror_room(), ProbeBlend(resolution=64)
    frame = FrameRenderer(made, *SIZE).render(0)
    state = method.update(method.prepare(made), frame)
    assert state.maps is not None
    count, packets = state.grid.count, np.arange(4)
    order = np.arange(count)[::-1]

    def reversed_(values: mi.Float, each: int) -> mi.Float:
        return mi.Float(np.ascontiguousarray(np.array(values).reshape(count, each)[order]).ravel())

    stride = dr.width(state.maps.texels) // count
    grid = replace(
        state.grid,
        places=reversed_(state.grid.places, len(packets)),
        middles=reversed_(state.grid.middles, len(packets)),
        rest=count - 1 - state.grid.rest,
    )
    other = replace(state, grid=grid, maps=replace(state.maps, texels=reversed_(state.maps.texels, stride)))
    one, two = (Answer(frame, *method.shade(s, frame)) for s in (state, other))
    np.testing.assert_allclose(one.L, two.L, atol=1e-5)


def test_where_a_cell_has_no_map_the_environment_takes_its_share():
    """The mirror stands in the middle of a cell whose map is within a block; without it, that cell's own map is there."""
    thing = red((0.0, -1.5, 1.0), 0.3)
    block = Object("block", plain(box((0.75, 0.75, 0.75), (1.25, 1.25, 1.25)), GREY), "around the place of a map")
    views = [(grey_room(thing, *more, at=(1.0, 0.55, 0.55), radius=0.15)) for more in ((), (block,))]
    shown = [shaded(ProbeBlend(blend=0.1), made, 0, size=SIZE)[0] for made in views]
    states = [answer.state.grid for answer in shown]
    assert [grid.count for grid in states] == [8, 7]
    inner = binary_erosion(shown[0].active, iterations=2)
    assert np.abs(shown[0].L - shown[1].L)[inner].max() > 0.2  # the thing is elsewhere in the environment
    assert np.isfinite(shown[1].L).all() and shown[1].found[shown[1].active].all()


# Double


def images(found) -> tuple[int, float]:
    """How many pieces differ from the grey of the room, of three pixels or more, and by how much the reddest of them."""
    off = found.L[..., 0] - 0.5
    pieces = np.zeros(off.shape, np.int32)
    label(found.active & (off > 0.05), output=pieces)
    return int((np.bincount(pieces.ravel())[1:] >= 3).sum()), float(off[found.active].max())


def test_midway_between_two_maps_a_thing_is_there_twice_at_half_strength():
    """The mirror is at the border of two cells along x, and well within one along y and z."""
    made = grey_room(red((0.35, 0.2, 1.5), 0.15), at=(0.0, 1.0, 1.0), radius=0.3)
    truth = Truth(made)
    assert images(truth.answer)[0] == 1
    count, strength = images(truth.of(BoxProjection()))
    assert count == 1 and strength == pytest.approx(0.4, abs=0.03)
    count, strength = images(truth.of(ProbeBlend(blend=1.0)))
    assert count == 2 and strength == pytest.approx(0.2, abs=0.03)


def test_a_map_alone_shows_it_once():
    """In the middle of a cell, whose map has all the weight; there the map is as good as the mirror's own."""
    truth = Truth(grey_room(red((-0.8, 0.1, 1.7), 0.25), at=(-1.0, 1.0, 1.0), radius=0.3))
    one, strength = images(truth.of(ProbeBlend(blend=0.25)))
    assert one == images(truth.of(BoxProjection()))[0] == 1 and strength == pytest.approx(0.4, abs=0.03)


# Doubt


def test_what_is_wrong_is_doubted_and_little_else():
    for made in (contact(0.0), comb(6)):
        wrong, recall, wolf = Truth(made).judged(ProbeBlend())
        assert wrong > 0.015 and recall > 0.85 and wolf < 0.15


def test_what_is_exact_is_hardly_doubted(turned_hall):
    assert turned_hall.judged(ProbeBlend())[2] < 0.01


def test_what_another_mirror_hides_is_doubted():
    mirrors = (mirror_ball("one", (-0.45, 0.0, 0.0), 0.35), mirror_ball("two", (0.45, 0.1, 0.0), 0.35))
    truth = Truth(scene((walls(),), mirrors))
    found = truth.of(ProbeBlend())
    doubt = np.array(found.reflection.doubt).reshape(found.active.shape)
    hidden = truth.answer.active & (truth.answer.L.max(axis=2) == 0)
    assert hidden.sum() > 20 and doubt[hidden].all() and (found.L[hidden].max(axis=1) > 0.2).all()
    assert doubt[truth.inner & ~hidden].mean() < 0.1


# Parameters


def test_bad_values_are_refused_with_what_is_accepted():
    with pytest.raises(ValueError, match="resolution is 100; accepted: a power of two"):
        ProbeBlend(resolution=100)
