"""What entries of a scene's table take of their files: by nodes, by materials, and what they leave."""

from __future__ import annotations

import numpy as np
import pytest
from support.gltf_files import Gltf
from support.mesh_cases import CUBE, TRIANGLES

from benchharness.scene import Scene
from benchharness.study import tablescene

CAMERA = {"path": [[0.0, -40.0, 0.0]], "target": [0.0, 0.0, 0.0], "fov_deg": 40.0}


def scene(folder, objects, reflectors, **more) -> Scene:
    table = {"objects": objects, "reflectors": reflectors, "camera": CAMERA, "h_max": 100.0, **more}
    return tablescene.build("mine", tablescene.validated(table, "f.toml: mine"), folder, "f.toml: mine")


def house(folder, how: str = "glb") -> str:
    """Cubes along x, 4 apart, y up: wood at 0 and glass at 4 in one mesh, wood at 8 and glass at 12 below a frame."""
    g = Gltf()
    wood, glass = g.material((0.5, 0.25, 0), name="wood"), g.material((0, 0, 1), name="glass")

    def cube(x, material):
        return {**g.primitive(np.add(CUBE, [x, 0, 0]), TRIANGLES), "material": material}

    g.node(g.mesh(cube(0, wood), cube(4, glass)), name="wall")
    low = g.node(g.mesh(cube(0, wood)), root=False, name="post", translation=[8, 0, 0])
    high = g.node(g.mesh(cube(0, glass)), root=False, name="pane", translation=[12, 0, 0])
    g.node(name="frame", children=[low, high])
    return g.write(folder, how).name


def middles(*meshes) -> list[float]:
    """Where the cubes of meshes are along x, ascending."""
    x = np.concatenate([mesh.vertices[mesh.faces].mean(axis=1)[:, 0] for mesh in meshes])
    places = np.unique(np.round(x / 4) * 4)
    assert len(x) == len(TRIANGLES) * len(places)
    return places.tolist()


@pytest.mark.parametrize(
    ("named", "places"),
    [
        ({}, [0, 4, 8, 12]),
        ({"material": "glass"}, [4, 12]),
        ({"material": ["glass", "wood"]}, [0, 4, 8, 12]),
        ({"node": "wall"}, [0, 4]),
        ({"node": "frame"}, [8, 12]),
        ({"node": ["post", "wall"]}, [0, 4, 8]),
        ({"node": "frame", "material": "glass"}, [12]),
        ({"without": {"material": "glass"}}, [0, 8]),
        ({"without": [{"node": "pane"}, {"node": "wall", "material": "wood"}]}, [4, 8]),
        ({"material": "wood", "without": {"node": "frame"}}, [0]),
    ],
)
def test_an_entry_takes_what_it_names_and_leaves_what_it_says(tmp_path, named, places):
    house(tmp_path)
    every, one = {"name": "all", "mesh": "a.glb"}, {"name": "some", "mesh": "a.glb", **named}
    of_objects = scene(tmp_path, [one], [{**every}])
    assert middles(*(o.mesh for o in of_objects.objects)) == places
    of_mirrors = scene(tmp_path, [every], [one])
    assert middles(of_mirrors.reflectors[0].mesh) == places


def test_a_room_and_its_mirror_of_one_file_stand_as_they_do_in_it(tmp_path):
    # The box of the whole is 14 x 2 x 2, and fitted to 7: half its size, its middle x = 6 at 10.
    house(tmp_path)
    fit = {"fit": {"centre": [10, 0, 0], "size": 7}}
    room = {"name": "room", "mesh": "a.glb", "without": {"node": "pane"}, **fit}
    made = scene(tmp_path, [room], [{"name": "mirror", "mesh": "a.glb", "node": "pane", **fit}])
    x = made.reflectors[0].mesh.vertices[:, 0]
    assert (x.min(), x.max()) == pytest.approx((10 + (11 - 6) / 2, 10 + (13 - 6) / 2))
    assert [o.name for o in made.objects] == ["room/wood", "room/glass"]
    x = np.concatenate([o.mesh.vertices[:, 0] for o in made.objects])
    assert (x.min(), x.max()) == pytest.approx((10 + (-1 - 6) / 2, 10 + (9 - 6) / 2))


@pytest.mark.parametrize(
    ("named", "said"),
    [
        ({"material": "gless"}, r"objects\[0\]\.material of a\.glb.*did you mean 'glass'\?; accepted: wood, glass$"),
        ({"node": "roof"}, r"objects\[0\]\.node of a\.glb: 'roof' is unknown; accepted: wall, frame, post, pane$"),
        ({"without": {"node": "roof"}}, r"objects\[0\]\.without\[0\]\.node of a\.glb: 'roof' is unknown"),
        ({"node": "post", "material": "glass"}, r"objects\[0\]: no part of a\.glb is of that node and that material; accepted"),
        ({"without": [{"node": "wall"}, {"node": "frame"}]}, r"objects\[0\] takes nothing of a\.glb; accepted"),
        ({"without": {}}, r"objects\[0\]\.without\[0\] names nothing; accepted: node, material or both"),
        ({"without": {"nodes": "wall"}}, r"objects\[0\]\.without\[0\]: key .*nodes.*did you mean 'node'"),
        ({"node": []}, r"objects\[0\]\.node is \[\]; accepted"),
        ({"node": 3}, r"objects\[0\]\.node is 3; accepted"),
    ],
)  # fmt: skip
def test_names_that_are_not_there_are_refused_with_those_that_are(tmp_path, named, said):
    house(tmp_path)
    with pytest.raises(ValueError, match=said) as error:
        scene(tmp_path, [{"name": "some", "mesh": "a.glb", **named}], [{"name": "all", "mesh": "a.glb"}])
    assert str(error.value).startswith("f.toml: mine")


OBJ = """mtllib two.mtl
v 0 0 0
v 1 0 0
v 0 1 0
v 0 0 1
v 1 1 1
o first
usemtl red
f 1 3 2
g left inner
f 1 2 4
o second
f 1 4 3
usemtl blue
g inner
f 2 3 5
"""


@pytest.mark.parametrize(
    ("named", "faces"),
    [
        ({}, 4), ({"node": "first"}, 2), ({"node": "left"}, 1), ({"node": "inner"}, 2), ({"node": "second"}, 2),
        ({"node": "second", "material": "red"}, 1), ({"without": {"node": "inner"}}, 2), ({"material": "blue"}, 1),
    ],
)  # fmt: skip
def test_objects_and_groups_of_an_obj_are_its_nodes(tmp_path, named, faces):
    (tmp_path / "two.obj").write_text(OBJ)
    (tmp_path / "two.mtl").write_text("newmtl red\nKd 1 0 0\nnewmtl blue\nKd 0 0 1\n")
    whole = {"name": "all", "mesh": "two.obj"}
    made = scene(tmp_path, [{"name": "some", "mesh": "two.obj", **named}], [whole])
    assert sum(len(o.mesh.faces) for o in made.objects) == faces
    # However they are taken apart, normals are those of the whole.
    every = {tuple(row) for o in scene(tmp_path, [whole], [whole]).objects for row in rows(o.mesh)}
    assert {tuple(row) for o in made.objects for row in rows(o.mesh)} <= every


def rows(mesh) -> list:
    return np.round(np.concatenate([mesh.vertices, mesh.normals], axis=1), 9).tolist()


def test_a_file_in_which_nothing_has_a_name_says_so(tmp_path):
    (tmp_path / "plain.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    entry = {"name": "a", "mesh": "plain.obj"}
    for key in ("node", "material"):
        with pytest.raises(ValueError, match=rf"{key} of plain\.obj: .* accepted: none, as nothing in it has a name"):
            scene(tmp_path, [{**entry, key: "x"}], [entry])
