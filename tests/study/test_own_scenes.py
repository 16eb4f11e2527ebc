"""A user's room of twelve triangles, lit by a lamp of two, with a ball in it: what a run says of it can be relied on."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from benchharness.measure.bench import Bench
from benchharness.render.orientation import oriented
from benchharness.render.reference import ReferenceOptions
from benchharness.study import plugins, tablescene

SIZE = (120, 80)
RANKED = ("ray_traced", "newton", "environment_map")


def own_room(folder, inside: bool, scale: float = 1.0, at=(0.0, 0.0, 0.0)):
    walls = trimesh.creation.box((6, 6, 3))
    walls.apply_translation((0, 0, 1.5))
    if inside:
        walls.invert()
    trimesh.creation.box((0.4, 0.4, 0.4)).export(folder / "cube.obj", include_normals=False)
    trimesh.creation.icosphere(subdivisions=3, radius=0.6).export(folder / "ball.obj", include_normals=False)
    walls.export(folder / "room.obj", include_normals=False)
    (folder / "lamp.obj").write_text("v -.5 -.5 2.95\nv .5 -.5 2.95\nv .5 .5 2.95\nv -.5 .5 2.95\nf 1 4 3\nf 1 3 2\n")

    def placed(x, y, z):
        return {"scale": scale, "translate": tuple(scale * v + o for v, o in zip((x, y, z), at, strict=True))}

    table = {
        "objects": [
            {"name": "room", "mesh": "room.obj", "albedo": (0.7, 0.6, 0.5), "shows": "walls", **placed(0, 0, 0)},
            {"name": "lamp", "mesh": "lamp.obj", "emission": (10.0, 10.0, 10.0), "shows": "light", **placed(0, 0, 0)},
            {"name": "red", "mesh": "cube.obj", "albedo": (0.8, 0.1, 0.1), "shows": "contact", **placed(1.3, -0.8, 0.2)},
        ],
        "reflectors": [{"name": "ball", "mesh": "ball.obj", **placed(0, 0, 1)}],
        "camera": {"path": [placed(0.3, -2.7, 1.5)["translate"]], "target": placed(0, 0, 0.9)["translate"], "fov_deg": 50.0},
    }
    return tablescene.build("mine", tablescene.SceneTable(**table), folder, "f.toml: mine")


@pytest.mark.parametrize("inside", [True, False], ids=["wound inwards", "wound outwards"])
def test_a_room_of_twelve_triangles_ranks_the_methods_as_a_finely_cut_one(tmp_path, inside):
    # A finely cut room of this kind: environment map .19, Newton's method at most .05. Split to half a pixel, it shows spots of
    # light, of which there are many after 32 paths, half a pixel off: .075.
    bench = Bench(own_room(tmp_path, inside), SIZE, ReferenceOptions(spp=2, bake_spp=32), None, 0, (1, 1))
    methods = {name: plugins.discover("method")[name].target() for name in RANKED}
    records = {r["entry"]: r for r in bench.run_frame(0, methods, lambda entry: None)[0]}
    assert {r["status"] for r in records.values()} == {"ok"}
    assert all(r["coverage"] == 1 and r["dark_px"] < 0.01 * r["reference_px"] for r in records.values())
    assert records["ray_traced"]["flip"] < records["newton"]["flip"] < 0.09 < 0.1 < records["environment_map"]["flip"]
    assert records["newton"]["converged_ratio"] > 0.99


def test_a_room_wound_outwards_is_said_to_be_turned(tmp_path):
    notes = [str(note) for note in oriented(own_room(tmp_path, False))[1] if note.remarkable]
    assert len(notes) == 1 and notes[0].startswith("object room: ")


def test_a_table_far_away_and_small_is_the_same_scene(tmp_path):
    options = ReferenceOptions(spp=2, bake_spp=32)
    flips = []
    for scale, at in ((1.0, (0.0, 0.0, 0.0)), (1e-3, (5.0, 3.0, 0.0)), (1.0, (1e4, 1e4, 0.0))):
        bench = Bench(own_room(tmp_path, True, scale, at), SIZE, options, None, 0, (1, 1))
        record, seen = bench.show(0, "newton", plugins.discover("method")["newton"].target())
        assert record["status"] == "ok" and np.isfinite(seen.image).all()
        flips.append(record["flip"])
    assert flips[1:] == pytest.approx([flips[0]] * 2, rel=0.1)
