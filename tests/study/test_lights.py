"""Point lights of a scene's table, and what they throw on a floor, by the law of the square of the distance."""

from __future__ import annotations

import numpy as np
import pytest
from support.gltf_files import Gltf
from support.mesh_cases import CUBE, TRIANGLES

from benchharness.render.ready import ready
from benchharness.scene import Scene
from benchharness.study import tablescene

CAMERA = {"path": [[0.0, -9.0, 4.0]], "target": [0.0, 0.0, 0.0], "fov_deg": 40.0}
HALF = np.sqrt(0.5)


def built(folder, lights, **more) -> tuple[Scene, list[str]]:
    """A floor from -2 to 2, and as a mirror a cube that stands aside."""
    (folder / "floor.obj").write_text("v -2 -2 0\nv 2 -2 0\nv 2 2 0\nv -2 2 0\nvn 0 0 1\nf 1//1 2//1 3//1 4//1\n")
    (folder / "mirror.obj").write_text("v 9 0 -9\nv 10 0 -9\nv 9 1 -9\nf 1 2 3\n")
    table = {
        "objects": [{"name": "floor", "mesh": "floor.obj", "albedo": [0.5, 0.5, 0.5]}],
        "reflectors": [{"name": "mirror", "mesh": "mirror.obj"}],
        "camera": CAMERA,
        "lights": lights,
        "h_max": 0.1,
        **more,
    }
    return tablescene.built("mine", tablescene.validated(table, "f.toml: mine"), folder, "f.toml: mine")


def test_a_floor_below_a_point_is_lit_by_the_square_of_its_distance(tmp_path):
    scene, _ = built(tmp_path, [{"position": [0, 0, 1], "intensity": [8, 4, 2]}])
    drawn = ready(scene, 64)
    floor = drawn.objects[0].mesh
    assert floor.radiance is not None
    where = floor.vertices * drawn.unit + np.array(drawn.origin)
    at = np.linalg.norm(where[:, :2], axis=1)
    for distance in (0.0, 1.0, 1.5):  # away from the foot: the slant is sqrt(1 + d²), and the cosine one over it
        nearest = int(np.argmin(np.abs(at - distance)))
        wanted = 0.5 / np.pi * np.array([8, 4, 2]) / (1 + at[nearest] ** 2) ** 1.5
        assert floor.radiance[nearest] == pytest.approx(wanted, rel=0.02)  # a vertex is the mean over 0.1 m around it


def lamps(folder, kind: str = "point", **more) -> None:
    """A cube, and two lights: one below a post, which is turned and sized, and one of its own."""
    g = Gltf()
    defined = [{"type": kind, "intensity": 6, "color": [1, 0.5, 0], **more}, {"type": "point"}]
    g.json["extensions"] = {"KHR_lights_punctual": {"lights": defined}}
    g.node(g.mesh(g.primitive(CUBE, TRIANGLES)))
    bulb = g.node(root=False, name="bulb", translation=[1, 2, 0], extensions={"KHR_lights_punctual": {"light": 0}})
    g.node(name="post", children=[bulb], translation=[0, 0, 3], rotation=[0, HALF, 0, HALF], scale=[2, 2, 2])
    g.node(name="moon", translation=[0, 5, 0], extensions={"KHR_lights_punctual": {"light": 1}})
    g.write(folder)


def test_lights_of_a_file_stand_where_it_is_placed_and_light_it_as_before(tmp_path):
    # The bulb: (2, 4, 0) turned by 90 degrees about y is (0, 4, -2), and 3 further (0, 4, 1), which z up is (0, -1, 4).
    lamps(tmp_path)
    thing = {"name": "cube", "mesh": "a.glb"}
    scene, said = built(tmp_path, [{"file": "a.glb"}], objects=[thing])
    bulb, moon = scene.lights
    assert (bulb.position, bulb.intensity) == (pytest.approx((0, -1, 4), abs=1e-6), pytest.approx((6, 3, 0)))
    assert (moon.position, moon.intensity) == (pytest.approx((0, 0, 5), abs=1e-6), pytest.approx((1, 1, 1)))
    assert not any("lights, left out" in text for text in said)
    assert any("lights, left out: 2" in text for text in built(tmp_path, [], objects=[{**thing, "emission": [1, 1, 1]}])[1])
    # Twice as large, turned by 90 degrees about z and moved; at twice the distance it takes four times the intensity.
    (bulb,) = built(
        tmp_path, [{"file": "a.glb", "node": "post", "scale": 2.0, "rotate_deg": [0, 0, 90], "translate": [10, 0, 0]}]
    )[0].lights
    assert (bulb.position, bulb.intensity) == (pytest.approx((12, 0, 8), abs=1e-6), pytest.approx((24, 12, 0)))
    # The cube, 2 long, is made 1 with its middle at (0, 0, 1).
    (moon,) = built(tmp_path, [{"file": "a.glb", "node": "moon", "fit": {"size": 1.0, "centre": [0, 0, 1]}}])[0].lights
    assert (moon.position, moon.intensity) == (pytest.approx((0, 0, 3.5), abs=1e-6), pytest.approx((0.25,) * 3))


def test_a_range_is_said(tmp_path):
    lamps(tmp_path, range=10)
    assert "lights, a.glb: lights that end at a range, which shine beyond it: 1" in built(tmp_path, [{"file": "a.glb"}])[1]


POINT = {"position": [0, 0, 1], "intensity": [1, 1, 1]}


@pytest.mark.parametrize(
    ("kind", "lights", "said"),
    [
        ("spot", [{"file": "a.glb"}], r"lights\[0\]\.file: .*a\.glb cannot be read: light 'bulb' is spot; accepted: point"),
        ("directional", [{"file": "a.glb", "node": "post"}], r"light 'bulb' is directional; accepted: point"),
        ("point", [{"file": "a.glb", "node": "sun"}], r"no light at or below node 'sun'; accepted: 'bulb', 'moon'"),
        ("point", [{"file": "b.glb"}], r"lights\[0\]\.file: there is no file .*b\.glb; accepted"),
        ("point", [{"file": "floor.obj"}], r"floor\.obj has no lights; accepted: files that end in \.glb, \.gltf"),
        ("point", [{"position": [0, 0, 1]}], r"lights\[0\] has position; accepted: position and intensity, or a file"),
        ("point", [{}], r"lights\[0\] has nothing; accepted"),
        ("point", [{**POINT, "file": "a.glb"}], r"lights\[0\] has file, intensity, position; accepted"),
        ("point", [{**POINT, "scale": 2}], r"lights\[0\] has intensity, position, scale; accepted"),
        ("point", [{**POINT, "colour": [1, 1, 1]}], r"lights\[0\]: key 'colour' is unknown.*; accepted: .*intensity"),
        ("point", [{**POINT, "intensity": [1, -1, 1]}], r"lights\[0\]\.intensity\[1\] is -1; accepted"),
        ("point", [POINT, POINT, POINT, {"file": "a.glb"}], r"lights are 5 with those of files; accepted: at most 4"),
    ],
)  # fmt: skip
def test_lights_that_are_none_are_refused(tmp_path, kind, lights, said):
    lamps(tmp_path, kind)
    with pytest.raises(ValueError, match=said) as error:
        built(tmp_path, lights)
    assert str(error.value).startswith("f.toml: mine.lights")


def test_a_file_takes_the_point_lights_that_are_named_beside_others(tmp_path):
    lamps(tmp_path, "spot")
    assert len(built(tmp_path, [{"file": "a.glb", "node": ["moon"]}])[0].lights) == 1
