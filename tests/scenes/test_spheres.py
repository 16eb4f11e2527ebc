"""The spheres: as round as they say, each on the floor and off the others, one of which bounces."""

from __future__ import annotations

from functools import cache
from itertools import combinations

import numpy as np
import pytest
from support import courtyard_claims as claims

from benchharness.scene import Scene
from scenes.spheres import BOUNCER, COUNT, PLACES, spheres

BOUNCES = f"sphere-{BOUNCER + 1}-{PLACES[BOUNCER].metal}"


@cache
def built(detail="lean", count=COUNT, moving=True) -> Scene:
    return spheres(detail, count, moving=moving)


@pytest.mark.parametrize(("detail", "triangles"), [("lean", 1520), ("paper", 5888)])
def test_a_sphere_has_as_many_triangles_as_its_detail_says(detail, triangles):
    for count in (1, 5, 9):
        scene = built(detail, count)
        assert [len(r.mesh.faces) for r in scene.reflectors] == count * [triangles]


def test_the_scene_says_what_was_asked_for():
    scene = built("paper", 3, False)
    assert (scene.name, scene.detail, scene.frames, scene.fps) == ("spheres", "paper", 100, 25)
    assert scene.source == {"detail": "paper", "count": 3, "moving": False, "base_vertices": scene.vertices}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"detail": 1}, "detail is 1; accepted: lean, paper"),
        ({"count": 0}, "count is 0; accepted: whole numbers from 1 to 9"),
        ({"count": 10}, "count is 10; accepted"),
        ({"count": True}, "count is True; accepted"),
        ({"count": "3"}, "count is '3'; accepted"),
        ({"moving": None}, "moving is None; accepted: true or false"),
    ],
)
def test_anything_else_is_refused_by_name(arguments, message):
    with pytest.raises(ValueError, match=message):
        spheres(**arguments)


def test_more_spheres_leave_the_others_where_they_are():
    for count in range(1, COUNT):
        claims.more_mirrors_leave_the_others_where_they_are(built(count=count), built())


def test_it_stands_in_the_courtyard():
    claims.stands_in_the_courtyard(built())


def test_it_can_be_sent_to_another_process():
    claims.can_be_sent_to_another_process(built())


@pytest.mark.parametrize("detail", ["lean", "paper"])
def test_spheres_are_closed_and_their_normals_unit_and_outward(detail):
    claims.mirrors_are_closed_and_their_normals_unit_and_outward(built(detail))
    for place, r in zip(PLACES, built(detail).reflectors, strict=True):
        assert np.allclose(r.mesh.vertices, place.radius * r.mesh.normals + [*place.at, place.radius], atol=1e-15)


def test_spheres_stand_on_the_floor_and_the_one_that_bounces_comes_back_to_it():
    claims.mirrors_touch_the_floor_or_stay_above_it(built(), flies=BOUNCES)
    scene = built()
    height = np.array([scene.reflectors[BOUNCER].pose(scene.time(f))[2, 3] for f in range(100)])
    assert height.max() > 0.3
    assert height[99] == pytest.approx(0, abs=1e-12)
    # Down to the floor twice on the way, to within what a frame's step may miss.
    low = (height[51:99] < np.minimum(height[50:98], height[52:100])).sum()
    assert low == 2
    assert abs(np.diff(height)).max() < 0.08


def test_spheres_never_touch_each_other():
    # Only one moves, straight up: further from the others than where it stands, or above one that is as low as they.
    for one, other in combinations(PLACES, 2):
        assert np.hypot(*np.subtract(one.at, other.at)) > one.radius + other.radius + 0.01


def test_one_sphere_bounces_and_only_in_the_second_half():
    claims.only_this_moves_and_only_in_the_second_half(built(), BOUNCES, built(moving=False))


def test_the_camera_goes_around_then_rests_and_all_spheres_are_in_the_picture():
    claims.camera_goes_around_then_rests_and_all_mirrors_are_in_the_picture(built())
