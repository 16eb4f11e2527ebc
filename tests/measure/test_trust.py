""" "ok" is what somebody could rely on: what cannot be judged is invalid, and says why."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from oracles.room_oracle import room

from benchharness.measure.bench import Bench
from benchharness.render.reference import ReferenceOptions
from benchharness.study import plugins
from benchharness.tables.remarks import remarks

SIZE = (96, 72)


def row(scene) -> dict:
    """What a run says of a frame that `ray_traced` shows."""
    bench = Bench(scene, SIZE, ReferenceOptions(spp=2), None, 0, (1, 1))
    return bench.run_frame(0, {"ray_traced": plugins.discover("method")["ray_traced"].target()}, lambda entry: None)[0][0]


def coloured(scene, colour):
    walls = scene.objects[0]
    mesh = replace(walls.mesh, radiance=np.broadcast_to(colour, walls.mesh.vertices.shape))
    return replace(scene, objects=(replace(walls, mesh=mesh),))


def test_an_ordinary_frame_is_ok_and_its_masks_agree():
    record = row(room())
    assert record["status"] == "ok" and record["reference_px"] == record["reflector_px"] > 500
    assert record["mask_diff_px"] == record["dark_px"] == record["back_px"] == 0


def test_a_mirror_that_shows_black_is_not_ranked():
    record = row(coloured(room(), (0.0, 0.0, 0.0)))
    assert record["status"] == "invalid" and record["dark_px"] == record["reference_px"]
    assert record["reason"] == f"the reference is black in {record['dark_px']} of the mirrors' {record['dark_px']} pixels"


def test_a_mirror_that_shows_mostly_backs_is_not_ranked():
    # From an eye that goes through the wall: outside in one frame, inside in the other, the room keeps its winding.
    scene = room(inside=False)
    eyes = [scene.camera(0.0), replace(scene.camera(0.0), eye=(0.0, -9.0, 0.0))]
    record = row(replace(scene, camera=lambda t: eyes[int(t > 0)], frames=2))
    assert record["status"] == "invalid" and record["back_px"] > 0.9 * record["reference_px"] > 0


def test_a_mirror_that_the_near_plane_cuts_open_is_not_ranked():
    # The ball's nearest point is 1.34 m from the eye. Through the cut, a ray meets its inside, which the frame never shows.
    record = row(replace(room(), near=1.6))
    assert record["status"] == "invalid" and record["mask_diff_px"] > 100


def test_what_is_nearer_than_the_near_plane_is_seen_in_neither_frame_nor_reference():
    record = row(replace(room(), near=2.4))
    assert record["status"] == "ok" and record["flip"] is None
    assert record["reflector_px"] == record["reference_px"] == 0
    assert remarks([record | {"method": "ray_traced", "params": ""}]) == ["no mirror in view: times, and no errors (all)"]


def test_masks_that_differ_are_not_ranked():
    # Whatever the cause may be: here, a reference of something beside.
    bench = Bench(room(), SIZE, ReferenceOptions(spp=2), None, 0, (1, 1))
    frames = bench._frames

    def otherwise(index):
        shown, references = frames(index)
        return shown, [replace(r, mask=np.roll(r.mask, 20, axis=1)) for r in references]

    bench._frames = otherwise
    record = bench.run_frame(0, {"ray_traced": plugins.discover("method")["ray_traced"].target()}, lambda entry: None)[0][0]
    assert record["status"] == "invalid" and "a mirror's in only one of frame" in record["reason"]


def test_the_console_says_what_is_not_ranked_and_what_is_unanswered():
    ok = {"status": "ok", "reflector_px": 10, "coverage": 0.48, "method": "newton", "params": "multi=2", "reason": None}
    bad = {"status": "invalid", "reason": "the reference is black", "method": "sky", "params": ""}
    assert remarks([ok, bad, {**ok, "coverage": 1.0}]) == [
        "no answer in 52% of the mirror, shown as it is (newton multi=2)",
        "not ranked: the reference is black (sky)",
    ]
    astray = {**ok, "wrong_ratio": 0.286}
    assert remarks([astray, {**ok, "wrong_ratio": 0.0}], lambda row: row["method"]) == [
        "no answer in 52% of the mirror, shown as it is (all)",
        "29% of the reflection points that are called right are more than 2 pixels off (newton)",
    ]
