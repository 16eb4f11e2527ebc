"""Pictures as large as they are seen: they show what large ones show, and are taken when that would be seen."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.board_scenes import SKY, row_of_mirrors
from support.mirror_room import ball, mirror_ball, mirror_room, scene, shaded, still

from benchharness.measure import metrics
from benchharness.scene import Camera, Object
from methods.billboard_impostor import BillboardImpostor
from methods.depth_impostor import DepthImpostor
from methods.ray_traced import RayTraced

SIZE = (160, 120)
METHODS = [BillboardImpostor(), DepthImpostor(), DepthImpostor(intersector="march")]
NAMES = ["billboards", "rows", "texels"]


def sizes(answer) -> np.ndarray:
    """Texels across the picture of each slot that is no plane's."""
    return answer.state.captured.pictures.sizes


def taken(answers) -> list[int]:
    return [int(answer.counted("pictures_taken").sum()) for answer in answers]


@pytest.mark.parametrize("method", METHODS, ids=NAMES)
@pytest.mark.parametrize("made", [mirror_room(), row_of_mirrors(3, 3)], ids=["room", "row"])
def test_they_are_smaller_and_show_what_large_ones_show(made, method):
    """FLIP against ray tracing; what is left is how outlines fall between texels."""
    (exact,), (large,), (small,) = (
        shaded(m, made, 0, size=SIZE) for m in (RayTraced(bounces=2), method, replace(method, sizes="seen"))
    )
    flips = [
        float(metrics.flip_map(a.L, exact.L, exact.active, ppd=67.0, exposure=0.0)[exact.active].mean()) for a in (large, small)
    ]
    assert (sizes(large) == 256).all() and 0 < sizes(small).max() <= 128
    assert (sizes(small) ** 2.0).sum() < 0.1 * (sizes(large) ** 2.0).sum()
    assert flips[1] < flips[0] + 0.01, flips


@pytest.mark.parametrize("method", METHODS[:2], ids=NAMES[:2])
def test_the_eye_that_comes_nearer_gets_larger_ones_without_an_update_and_the_same_as_if_it_had_been_there(method):
    places = [(0.0, -6.0, 0.5), (0.0, -3.0, 0.4), (0.0, -1.7, 0.25)]

    def camera(time: float) -> Camera:
        return Camera(places[round(time)], (0.0, 0.0, 0.0), 45.0)

    made = mirror_room(fps=1.0)
    made = replace(made, camera=camera)
    seen = replace(method, sizes="seen")
    answers = shaded(seen, made, 0, 1, 2, size=SIZE)
    assert (np.diff([sizes(a) for a in answers], axis=0) >= 0).all() and (sizes(answers[2]) > 2 * sizes(answers[0])).any()
    counts = taken(answers)
    assert counts[0] == 3 and all(0 < n <= 3 for n in counts[1:])
    (alone,) = shaded(seen, made, 2, size=SIZE)
    np.testing.assert_array_equal(sizes(alone), sizes(answers[2]))
    np.testing.assert_allclose(alone.L, answers[2].L, atol=1e-5)


def around(degrees: float):
    """A ball on an arc of radius 1 around the middle of a mirror; its motion, from frame to frame."""

    def pose(time: float) -> np.ndarray:
        angle = np.radians(degrees * time)
        made = np.eye(4)
        made[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
        return made

    return pose


def shifted(step: float):
    """The ball at (0, -1, 0) moves along x by `step` from frame to frame, and does not turn."""

    def pose(time: float) -> np.ndarray:
        made = np.eye(4)
        made[0, 3] = step * time
        return made

    return pose


def moving(motion, fov_deg=45.0):
    red = Object("red", ball(0.15, (0.0, -1.0, 0.0), (0.9, 0.1, 0.1)), "moves", motion=motion)
    return scene(
        (red,), (mirror_ball(radius=0.3),), still((0.6, -2.4, 1.0), fov_deg=fov_deg), frames=8, fps=1.0, background=SKY
    )


@pytest.mark.parametrize("beside", [False, True], ids=["alone", "beside one that is always taken again"])
@pytest.mark.parametrize("method", METHODS[:2], ids=NAMES[:2])
def test_a_ball_is_taken_again_where_it_has_moved_by_half_a_texel_since_it_was_taken(method, beside):
    """Steps of 0.4 of the angle 1 / size: the third after a picture is the first beyond it, however small each of them is."""
    seen = replace(method, sizes="seen")
    (first,) = shaded(seen, moving(None), 0, size=SIZE)
    (size,) = sizes(first)
    made = moving(shifted(0.4 / size))
    if beside:
        blue = Object("blue", ball(0.15, (-1.2, -1.0, 0.0), (0.1, 0.1, 0.9)), "moves far", motion=shifted(0.3))
        made = replace(made, objects=(*made.objects, blue))
    answers = shaded(seen, made, *range(8), size=SIZE)
    assert {int(sizes(a)[0]) for a in answers} == {int(size)}
    assert taken(answers) == [n + beside for n in (1, 0, 0, 1, 0, 0, 1, 0)]
    assert taken(shaded(method, made, *range(8), size=SIZE)) == [1 + beside] * 8


def test_a_ball_that_goes_around_the_mirror_with_its_face_to_it_keeps_its_picture():
    answers = shaded(BillboardImpostor(sizes="seen"), moving(around(5.0), 15.0), *range(4), size=SIZE)
    assert taken(answers) == [1, 0, 0, 0]
    (exact,) = shaded(RayTraced(), moving(around(5.0), 15.0), 3, size=SIZE)
    there, shown = ((a.L[..., 0] > 0.5) & a.active for a in (exact, answers[3]))
    assert (there & shown).sum() > 0.75 * (there | shown).sum() > 20


@pytest.mark.parametrize(("other_mirrors", "more"), [("omitted", 0), ("black", 0), ("reflective", 1)])
def test_a_mirror_out_of_the_picture_has_pictures_only_for_the_mirrors_that_show_it(other_mirrors, more):
    red = Object("red", ball(0.15, (-0.2, -1.0, 0.0), (0.9, 0.1, 0.1)), "is seen in both")
    mirrors = (mirror_ball("here", (-0.6, 0, 0), 0.3), mirror_ball("there", (1.2, 0.0, 0.0), 0.3))
    camera = still((-0.6, -2.4, 0.4), (-0.6, 0.0, 0.0), 20.0)
    made = scene((red,), mirrors, camera, background=SKY)
    answers = [
        shaded(BillboardImpostor(other_mirrors=other_mirrors, sizes=s), made, 0, size=SIZE)[0] for s in ("fixed", "seen")
    ]
    own = 1 if other_mirrors == "omitted" else 2  # the ball, and the other mirror
    assert taken(answers) == [2 * own, own + more]
    np.testing.assert_array_equal(np.isfinite(answers[0].distance).sum() > 20, True)


def test_what_is_less_than_a_pixel_is_not_taken():
    def with_ball(radius: float):
        red = Object("red", ball(radius, (0.0, -1.0, 0.0), (0.9, 0.1, 0.1)), "is small")
        return scene((red,), (mirror_ball(radius=0.05),), still((0.6, -2.4, 1.0), fov_deg=20.0), background=SKY)

    counts = [taken(shaded(BillboardImpostor(sizes="seen"), with_ball(r), 0, size=SIZE))[0] for r in (0.15, 0.002)]
    assert counts == [1, 0]


def test_an_environment_map_is_taken_again_where_the_nearest_wall_has_moved_by_half_a_texel():
    """Walls 2 m away, 256 texels over 90 degrees: half a texel is 6.1 mm there, and the mirror goes 4 mm a frame."""
    made = mirror_room(fps=1.0)
    made = replace(made, reflectors=(replace(made.reflectors[0], motion=shifted(0.004)),), camera=still())
    maps = {}
    for sizes_ in ("fixed", "seen"):
        answers = shaded(BillboardImpostor(sizes=sizes_), made, 0, 1, 2, size=SIZE)
        maps[sizes_] = [a.state.captured.environments[0] for a in answers]
    assert maps["seen"][0] is maps["seen"][1] and maps["seen"][1] is not maps["seen"][2]
    assert len({id(own) for own in maps["fixed"]}) == 3
    assert maps["seen"][2].near == pytest.approx(2.0, abs=0.1)
