"""Scenes out of TOML tables, and eyes inside mirrors."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from benchharness.modelling import winding
from benchharness.modelling.winding import winding_number
from benchharness.render import inside
from benchharness.scene import Camera, Mesh, Object, Reflector, Scene
from benchharness.study import placed, scenes, tablescene

CAMERA = {"path": [[0, -4, 0], [0, -4, 2]], "target": [0, 0, 0], "fov_deg": 40}


def ball(radius: float = 1.0) -> Mesh:
    shape = trimesh.creation.icosphere(subdivisions=2, radius=radius)
    return Mesh(shape.vertices, shape.faces)


def built(folder, **changes):
    table = {
        "objects": [{"name": "box", "mesh": "box.obj", "shows": "an edge", "albedo": [0.1, 0.2, 0.3]}],
        "reflectors": [{"name": "ball", "mesh": "ball.ply"}],
        "camera": CAMERA,
        "frames": 3,
        **changes,
    }
    trimesh.creation.box().export(folder / "box.obj")
    trimesh.creation.icosphere(subdivisions=2).export(folder / "ball.ply")
    trimesh.creation.icosphere(subdivisions=2).export(folder / "ball.glb")
    return tablescene.build("mine", tablescene.SceneTable.model_validate(table, strict=False), folder, "f.toml: mine")


def loaded(path, **table) -> Mesh:
    entry = placed.Placed(name="a", mesh=path.name, **table)
    asset = placed.read(path, "k", entry)
    return placed.mesh(asset, placed.pose(asset, entry, "k"))


def test_the_winding_number_is_one_inside_a_closed_mesh_and_zero_outside():
    assert winding_number(ball(), np.array([0.3, -0.2, 0.4])) == pytest.approx(1.0, abs=1e-12)
    assert winding_number(ball(), np.array([0.0, 0.0, 1.5])) == pytest.approx(0.0, abs=1e-12)
    flipped = Mesh(ball().vertices, ball().faces[:, ::-1])
    assert winding_number(flipped, np.zeros(3)) == pytest.approx(-1.0, abs=1e-12)


def test_one_octant_triangle_covers_an_eighth_of_the_sphere():
    # The triangle (1,0,0), (0,1,0), (0,0,1) hides one octant of the directions from the origin: 1/8 of 4π.
    octant = Mesh(np.eye(3), np.array([[0, 1, 2]]))
    assert winding_number(octant, np.zeros(3)) == pytest.approx(1 / 8, abs=1e-15)


def test_a_mesh_is_closed_if_every_edge_has_two_faces_wherever_its_vertices_are_split():
    assert winding.is_closed(ball())
    soup = Mesh(ball().vertices[ball().faces].reshape(-1, 3), np.arange(3 * len(ball().faces)).reshape(-1, 3))
    assert winding.is_closed(soup)
    assert not winding.is_closed(Mesh(ball().vertices, ball().faces[1:]))


@pytest.mark.parametrize("suffix", ["ply", "glb"])
def test_a_table_of_mesh_files_is_a_scene(tmp_path, suffix):
    scene = built(
        tmp_path,
        reflectors=[{"name": "ball", "mesh": f"ball.{suffix}", "closed": "ball.ply", "scale": 0.5, "translate": [1, 2, 3]}],
    )
    assert scene.objects[0].mesh.albedo[0] == pytest.approx([0.1, 0.2, 0.3])
    assert scene.objects[0].shows == "an edge"
    radius = np.linalg.norm(scene.reflectors[0].mesh.vertices - [1, 2, 3], axis=1)
    assert radius == pytest.approx(0.5, abs=1e-6)  # single precision in the file
    outward = (scene.reflectors[0].mesh.vertices - [1, 2, 3]) / radius[:, None]
    assert np.abs(scene.reflectors[0].mesh.normals - outward).max() < 0.02  # 42 vertices more or less on a sphere
    assert [scene.camera(scene.time(i)).eye for i in range(3)] == [(0, -4, 0), (0, -4, 1), (0, -4, 2)]


def test_a_quarter_turn_about_x_takes_y_up_to_z_up():
    assert placed.turn((90.0, 0.0, 0.0)) @ [0, 1, 0] == pytest.approx([0, 0, 1])
    assert placed.turn((90.0, 0.0, 90.0)) @ [1, 0, 0] == pytest.approx([0, 1, 0])


def test_normals_of_the_file_are_kept(tmp_path):
    (tmp_path / "flat.obj").write_text(
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0.6 0.8\nvn 0 0.6 0.8\nvn 0 0.6 0.8\nf 1//1 2//2 3//3\n"
    )
    mesh = loaded(tmp_path / "flat.obj")
    assert mesh.normals == pytest.approx(np.tile([0, 0.6, 0.8], (3, 1)))


def test_the_nodes_of_a_glb_stand_where_its_scene_puts_them(tmp_path):
    ball, far, wide = trimesh.creation.icosphere(subdivisions=2), np.eye(4), np.diag([-2.0, 1.0, 1.0, 1.0])
    far[0, 3] = 10.0
    scene = trimesh.Scene()
    scene.add_geometry(ball, transform=far)
    scene.add_geometry(ball, transform=wide)
    scene.export(tmp_path / "two.glb")
    mesh = loaded(tmp_path / "two.glb")
    x = mesh.vertices[:, 0]
    assert (x.max(), x.min()) == pytest.approx((11, -2), abs=1e-6)
    # The mirrored node is turned inside out again: its faces go round the origin counter-clockwise from outside.
    assert winding_number(mesh, np.zeros(3)) == pytest.approx(1.0, abs=1e-6)
    # On the ellipsoid x²/4 + y² + z² = 1 the normal is along (x/4, y, z).
    near = x < 5
    outward = mesh.vertices[near] * [0.25, 1, 1]
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    assert np.abs(mesh.normals[near] - outward).max() < 0.03  # vertex normals of the coarse ball are off by 0.02


@pytest.mark.parametrize(
    ("name", "text", "reason"),
    [
        ("nan.obj", "v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", r"nan\.obj cannot be read: vertex 0, .*finite"),
        ("points.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n", "cannot be read|no faces"),
        ("noise.ply", "this is no mesh", "cannot be read"),
        ("model.dae", "", r"accepted: a file that ends in \.obj, \.ply, \.stl, \.glb, \.gltf"),
    ],
)
def test_a_mesh_that_is_none_is_refused_with_its_file_and_key(tmp_path, name, text, reason):
    (tmp_path / name).write_text(text)
    with pytest.raises(ValueError, match=reason) as error:
        built(tmp_path, reflectors=[{"name": "ball", "mesh": name}])
    assert "f.toml: mine.reflectors[0].mesh" in str(error.value)
    assert name in str(error.value)


def test_a_missing_file_a_lone_eta_and_an_open_proxy_are_refused(tmp_path):
    with pytest.raises(ValueError, match=r"objects\[0\].mesh: there is no file"):
        built(tmp_path, objects=[{"name": "a", "mesh": "none.obj", "shows": "x"}])
    with pytest.raises(ValueError, match=r"reflectors\[0\] has only one of eta and k"):
        built(tmp_path, reflectors=[{"name": "ball", "mesh": "ball.ply", "eta": [1, 1, 1]}])
    trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]).export(tmp_path / "open.ply")
    with pytest.raises(ValueError, match=r"open\.ply is not watertight"):
        built(tmp_path, reflectors=[{"name": "ball", "mesh": "ball.ply", "closed": "open.ply"}])
    with pytest.raises(ValueError, match="the name 'a' is there twice"):
        built(tmp_path, objects=[{"name": "a", "mesh": "box.obj", "shows": "x"}] * 2)


def room(eyes, reflector: Reflector) -> Scene:
    thing = Object("thing", ball(0.1), "something")
    return Scene("room", (thing,), (reflector,), lambda t: Camera(eyes[round(t * 25)], (9, 9, 9), 40.0), len(eyes))


def test_an_eye_inside_a_closed_reflector_is_refused_at_the_frame_where_it_is():
    scene = room([(0, -4, 0), (0, -0.5, 0)], Reflector("ball", ball()))
    inside.check_cameras(scene, [0], "f.toml: room")
    with pytest.raises(ValueError, match=r"camera of frame 1, eye \[0, -0.5, 0\], is inside reflector 'ball'"):
        inside.check_cameras(scene, [0, 1], "f.toml: room")


def test_the_eye_follows_the_reflector_into_its_own_space_and_an_open_sheet_has_no_inside():
    away = np.eye(4)
    away[0, 3] = 5.0
    moved = Reflector("ball", ball(), motion=lambda t: away)
    inside.check_cameras(room([(0, 0, 0)], moved), [0], "here")
    with pytest.raises(ValueError, match="inside reflector"):
        inside.check_cameras(room([(5, 0, 0)], moved), [0], "here")
    inside.check_cameras(room([(0, 0, 0)], Reflector("bowl", Mesh(ball().vertices, ball().faces[1:]))), [0], "here")


def test_a_camera_that_looks_at_its_own_eye_is_refused():
    with pytest.raises(ValueError, match=r"frame 0 .* has no picture"):
        inside.check_cameras(room([(9, 9, 9)], Reflector("ball", ball())), [0], "here")


# Panoramas


def written(path, picture: np.ndarray):
    import mitsuba as mi

    mi.Bitmap(np.float32(picture)).write(str(path))
    return path.name


@pytest.mark.parametrize("suffix", ["exr", "hdr"])
def test_a_panorama_file_is_seen_as_it_was_photographed(tmp_path, suffix):
    picture = np.zeros((9, 16, 3))  # HDR files keep 8 bits of mantissa: powers of two are exact
    picture[0], picture[8] = 4.0, 0.5  # straight up, straight down
    picture[1:8, 11:13, 0] = 1.0  # around three quarters from the left: +y
    picture[1:8, 7:9, 1] = 1.0  # the middle: -x
    scene = built(tmp_path, environment=written(tmp_path / f"sky.{suffix}", picture), environment_centre=[1, 2, 3])
    seen = scene.environment.lookup([[0, 0, 1], [0, 0, -1], [0, 1, 0], [-1, 0, 0], [1, 0, 0], [0, -1, 0]])
    np.testing.assert_allclose(seen, [[4] * 3, [0.5] * 3, [1, 0, 0], [0, 1, 0], [0] * 3, [0] * 3], atol=1e-12)
    assert scene.environment.centre == (1.0, 2.0, 3.0)
    assert built(tmp_path).environment is None


def test_a_panorama_that_is_none_is_refused_with_its_key(tmp_path):
    good = written(tmp_path / "good.exr", np.ones((4, 8, 3)))
    (tmp_path / "noise.exr").write_text("no picture")
    for changes, reason in (
        ({"environment": "sky.png"}, r"environment is .*sky\.png'; accepted: a file that ends in \.exr, \.hdr"),
        ({"environment": "none.exr"}, r"environment: there is no file .*none\.exr"),
        ({"environment": "noise.exr"}, r"environment: .*noise\.exr cannot be read"),
        ({"environment": written(tmp_path / "dark.exr", np.full((4, 8, 3), -1.0))}, r"dark\.exr: .*row 0.*from 0"),
        ({"environment": written(tmp_path / "thin.exr", np.ones((1, 8, 3)))}, r"thin\.exr: .*at least 2"),
        ({"environment": good, "background": (0.1, 0.2, 0.3)}, "a background and an environment; accepted: one"),
        ({"environment_centre": (0.0, 0.0, 1.0)}, "environment_centre is there without"),
    ):
        with pytest.raises(ValueError, match=reason) as error:
            built(tmp_path, **changes)
        assert "f.toml: mine" in str(error.value)


def coarse_room(folder, **changes):
    """A room of 12 triangles around a ball."""
    walls = trimesh.creation.box((6, 6, 6))
    walls.invert()
    walls.export(folder / "walls.obj", include_normals=False)
    things = [{"name": "walls", "mesh": "walls.obj", "shows": "straight edges", "emission": [1, 1, 1]}]
    return built(folder, objects=things, camera={**CAMERA, "path": [[0, -2.5, 0]]}, **changes)


def test_edges_of_objects_are_split_where_the_table_says_so_and_light_is_found_between_them(tmp_path):
    mesh = coarse_room(tmp_path, h_max=0.4).objects[0].mesh
    edges = mesh.vertices[mesh.faces] - mesh.vertices[np.roll(mesh.faces, 1, axis=1)]
    assert np.linalg.norm(edges, axis=2).max() <= 0.4
    whole = coarse_room(tmp_path)
    assert len(whole.objects[0].mesh.faces) == 12 and whole.lightmaps


def test_normals_that_are_nothing_are_made_of_the_faces_around(tmp_path):
    (tmp_path / "tent.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 0\nvn 0 0 1\nf 1//1 3//2 2//2\n")
    things = [{"name": "tent", "mesh": "tent.obj", "shows": "one normal of nothing"}]
    normals = built(tmp_path, objects=things, h_max=10.0).objects[0].mesh.normals
    # The face goes round clockwise from above, and the second normal points away from it.
    assert normals[:, 2].round(6).tolist() == [-1.0, -1.0, -1.0]


# What files bring along, and where they are put

TWO = "v 0 0 0\nv 0 1 0\nv 0 0 3\nv 2 0 0\nusemtl red\nf 1 3 2\nusemtl lamp\nf 1 4 3\nusemtl red\nf 1 2 4\nf 2 3 4\n"
LIBRARY = "newmtl red\nKd 0.5 0.25 0\nnewmtl lamp\nKd 0 0 0\nKe 5 6 7\n"


def two(folder, **table):
    """The objects of a file of two materials."""
    (folder / "two.obj").write_text("mtllib two.mtl\n" + TWO)
    (folder / "two.mtl").write_text(LIBRARY)
    return built(folder, objects=[{"name": "two", "mesh": "two.obj", **table}], h_max=10.0).objects


def test_a_file_of_two_materials_is_two_objects_in_its_own_colours(tmp_path):
    red, lamp = two(tmp_path)
    assert (red.name, lamp.name) == ("two/red", "two/lamp")
    assert (red.shows, lamp.shows) == ("red of two.obj", "lamp of two.obj")
    assert (len(red.mesh.faces), len(lamp.mesh.faces)) == (3, 1)
    assert red.mesh.albedo[0] == pytest.approx([0.5, 0.25, 0]) and not red.mesh.emission.any()
    assert lamp.mesh.emission[0] == pytest.approx([5, 6, 7])


def test_an_albedo_of_the_table_makes_it_one_object_and_an_emission_does_not(tmp_path):
    (one,) = two(tmp_path, albedo=(0.1, 0.2, 0.3), shows="a thing")
    assert (one.name, one.shows, len(one.mesh.faces)) == ("two", "a thing", 4)
    assert one.mesh.albedo == pytest.approx(np.tile([0.1, 0.2, 0.3], (len(one.mesh.vertices), 1)))
    assert sorted(set(one.mesh.emission[:, 2])) == [0, 7]
    assert [o.mesh.emission[0].tolist() for o in two(tmp_path, emission=(1.0, 1.0, 1.0))] == [[1, 1, 1]] * 2


def test_a_file_without_colours_is_grey_and_one_with_colours_of_vertices_has_these(tmp_path):
    (tmp_path / "plain.obj").write_text(TWO.replace("usemtl", "#"))
    things = [{"name": "plain", "mesh": "plain.obj"}]
    assert built(tmp_path, objects=things, h_max=10.0).objects[0].mesh.albedo == pytest.approx(np.full((12, 3), 0.5))
    (tmp_path / "plain.obj").write_text("v 0 0 0 1 0 0\nv 1 0 0 1 0 0\nv 0 1 0 0 0 1\nf 1 2 3\n")
    assert built(tmp_path, objects=things, h_max=10.0).objects[0].mesh.albedo.tolist() == [[1, 0, 0], [1, 0, 0], [0, 0, 1]]


def test_a_picture_is_the_texture_of_its_material_where_the_file_has_it(tmp_path):
    from PIL import Image

    rows = np.zeros((4, 4, 3), np.uint8)
    rows[:2] = 255  # the upper half white
    Image.fromarray(rows).save(tmp_path / "p.png")
    (tmp_path / "p.mtl").write_text("newmtl m\nKd 1 0.5 1\nmap_Kd p.png\n")
    uv = "vt 0 0.25\nvt 0.999 0.25\nvt 0.999 0.999\nvt 0 0.999\n"
    (tmp_path / "p.obj").write_text(f"mtllib p.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n{uv}usemtl m\nf 1/1 2/2 3/3 4/4\n")
    table = {
        "objects": [{"name": "p", "mesh": "p.obj"}],
        "reflectors": [{"name": "ball", "mesh": "ball.ply"}],
        "camera": CAMERA,
    }
    built(tmp_path)
    table = tablescene.SceneTable.model_validate(table, strict=False)
    scene, notes = tablescene.built("mine", table, tmp_path, "f.toml: mine")
    mesh = scene.objects[0].mesh
    assert mesh.albedo[0] == pytest.approx([1, 0.5, 1]) and "picture" not in str(notes)
    assert mesh.texture is not None and mesh.texture.pixels[:, 0, 0].tolist() == [1, 1, 0, 0]
    assert mesh.uv is not None and mesh.uv[:, 1] == pytest.approx(0.25 + 0.749 * mesh.vertices[:, 1])
    grey = {**table.model_dump(mode="json"), "objects": [{"name": "p", "mesh": "p.obj", "albedo": [0.2, 0.2, 0.2]}]}
    plain = tablescene.build("mine", tablescene.SceneTable.model_validate(grey, strict=False), tmp_path, "f.toml: mine")
    assert plain.objects[0].mesh.texture is None  # the table's colour replaces the file's


@pytest.mark.parametrize(
    ("unit", "metres"), [("mm", 0.001), ("cm", 0.01), ("m", 1), ("in", 0.0254), ("ft", 0.3048), (2.5, 2.5)]
)
def test_units_are_metres(tmp_path, unit, metres):
    (tmp_path / "two.obj").write_text(TWO)
    mesh = loaded(tmp_path / "two.obj", unit=unit, scale=2.0, translate=(1.0, 1.0, 1.0))
    assert np.ptp(mesh.vertices, axis=0) == pytest.approx(2 * metres * np.array([2, 1, 3]))
    assert mesh.vertices.min(axis=0) == pytest.approx([1, 1, 1])


def test_up_is_what_the_table_says_and_else_what_the_format_says(tmp_path):
    (tmp_path / "two.obj").write_text(TWO)
    trimesh.Trimesh([[0, 0, 0], [2, 0, 0], [0, 1, 0], [0, 0, 3]], [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]).export(
        tmp_path / "two.glb"
    )
    upright, lying = ((0, -3, 0), (2, 0, 1)), ((0, 0, 0), (2, 1, 3))
    for name, up, box in [
        ("two.obj", None, lying), ("two.obj", "z", lying), ("two.obj", "y", upright),
        ("two.glb", None, upright), ("two.glb", "y", upright), ("two.glb", "z", lying),
    ]:  # fmt: skip
        mesh = loaded(tmp_path / name, up=up)
        assert (mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)) == (pytest.approx(box[0]), pytest.approx(box[1])), (
            name,
            up,
        )
        assert winding_number(mesh, np.mean(mesh.vertices, axis=0)) == pytest.approx(1.0)


def test_a_file_is_fitted_after_it_was_turned_and_its_proxy_with_it(tmp_path):
    (tmp_path / "two.obj").write_text(TWO)
    mesh = loaded(tmp_path / "two.obj", rotate_deg=(0.0, 0.0, 90.0), fit={"centre": (1.0, 2.0, 3.0), "size": 6.0})
    assert mesh.vertices.min(axis=0) == pytest.approx([0, 0, 0]) and mesh.vertices.max(axis=0) == pytest.approx([2, 4, 6])
    fitted = {"name": "ball", "mesh": "half.ply", "closed": "ball.ply", "fit": {"centre": (0.0, 0.0, 0.0), "size": 4.0}}
    shape = trimesh.creation.icosphere(subdivisions=2)
    upper = shape.faces[shape.triangles_center[:, 2] > 0]
    trimesh.Trimesh(shape.vertices, upper).export(tmp_path / "half.ply")
    mirror = built(tmp_path, reflectors=[fitted]).reflectors[0]
    closed = {tuple(v) for v in np.round(mirror.closed.vertices, 5)}
    assert {tuple(v) for v in np.round(mirror.mesh.vertices, 5)} <= closed
    with pytest.raises(ValueError, match=r"reflectors\[0\] has fit and scale; accepted: one of them"):
        built(tmp_path, reflectors=[{**fitted, "scale": 2.0}])


@pytest.mark.parametrize(
    ("entry", "said"),
    [
        ({"unit": "yard"}, r"objects\[0\]\.unit is \"yard\"; accepted: mm, cm, m, in, ft, or a number of metres"),
        ({"unit": -1}, r"objects\[0\]\.unit is -1"),
        ({"up": "x"}, r"objects\[0\]\.up is \"x\""),
        ({"fit": {"centre": [0, 0, 0]}}, r"objects\[0\]\.fit\.size is missing"),
        ({"fit": {"size": 1, "center": [0, 0, 0]}}, r"objects\[0\]\.fit: .*center.*centre"),
    ],
)
def test_what_is_said_of_a_place_wrongly_is_refused_by_its_key(entry, said):
    reflectors = [{"name": "ball", "mesh": "ball.ply"}]
    table = {"objects": [{"name": "a", "mesh": "a.obj", **entry}], "reflectors": reflectors, "camera": CAMERA}
    with pytest.raises(ValueError, match=said):
        tablescene.validated(table, "f.toml: mine")


def test_what_was_mended_of_a_file_reaches_the_notes_of_a_run(tmp_path):
    trimesh.creation.icosphere(subdivisions=1).export(tmp_path / "ball.ply")
    (tmp_path / "two.obj").write_text("mtllib gone.mtl\n" + TWO + "f 1 1 2\n")
    table = {
        "objects": [{"name": "two", "mesh": "two.obj", "unit": "mm", "emission": [1, 1, 1]}],
        "reflectors": [{"name": "ball", "mesh": "ball.ply", "scale": 1000}],
        "camera": {**CAMERA, "path": [[0, -4000, 0]]},
    }
    spec = scenes.SceneSpec("mine", "mine", None, table=True, keywords=table, base=str(tmp_path), where="f.toml: mine")
    notes = scenes.examined(vars(spec), {"size": (60, 40), "frames": 1}, "f.toml")["notes"]
    assert [note.partition(":")[0] for note in notes[:2]] == ["object two, two.obj", "mirror ball, ball.ply"]
    for part in ("two corners at one place, left out: 1", "library gone.mtl is missing", "0.002 x 0.001 x 0.003 m large"):
        assert part in notes[0]
    assert "2000 x 2000 x 2000 m large" in notes[1]
