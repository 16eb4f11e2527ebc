"""Lean scenes hold what is needed and no more: by the table of `benchharness needs`, and by leaving things out again."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import pytest
from support.tiers import complete, exhaustive

from benchharness.needs import measuring, objects
from benchharness.render.ready import lit
from benchharness.render.reference import ReferenceOptions
from benchharness.study import plugins
from benchharness.tables import files
from benchharness.tables.needs import NEEDS_OBJECTS, OBJECT_KINDS

TABLE = Path(__file__).parents[2] / "results" / "needs" / NEEDS_OBJECTS
SCENES = ("kitchen", "ufo", "kettle", "ant")
MOVING = {"kitchen": True}
STAY = {
    "kitchen": {"floor": "the eye sees it", "table-frame": "it holds the table top"},
    "ufo": {
        "trees": "with all that is spared, an error would differ",
        "people": "the same",
        "legs": "the saucer stands on them",
        "sun": "it lights the square",
    },
    "kettle": {
        "table-frame": "it holds the table top",
        "trivet": "the kettle stands on it",
        "window-garden": "it lights the room",
        "lamp": "it lights the room",
        "spout": "it is the kettle's",
        "head": "it is the figure's, whose hand touches",
        "upper-arm": "it holds the hand",
        "forearm": "it holds the hand",
    },
    "ant": {
        "sugar": "the ants are around it",
        "chestnut-body": "it bears the head",
        "black-body": "the same",
        "amber-body": "the same",
    },
}
"""What is needed for nothing and yet is there, and why."""


@cache
def rows(scene: str) -> dict[str, dict]:
    table = files.read(TABLE, OBJECT_KINDS, required=["scene", "object", "verdict"])
    return {row["object"]: row for row in table if row["scene"] == scene}


@pytest.mark.parametrize("name", SCENES)
def test_everything_in_a_lean_scene_is_needed_or_stays_for_a_reason(name):
    scene = plugins.discover("scene")[name].target(detail="lean", moving=MOVING.get(name, True))
    assert {thing.name: len(thing.mesh.vertices) for thing in scene.objects} == {
        thing: row["vertices"] for thing, row in rows(name).items()
    }
    needless = {thing for thing, row in rows(name).items() if row["verdict"] == "nothing"}
    assert needless <= set(STAY[name]), needless - set(STAY[name])


@exhaustive
@pytest.mark.parametrize("rank", [0, pytest.param(1, marks=complete)])
@pytest.mark.parametrize("name", SCENES)
def test_what_would_be_missed_least_is_still_missed(name, rank):
    """Of what is just seen, what would be missed least; in all of the tests the next one, too, which is missed more."""
    scene = lit(plugins.discover("scene")[name].target(detail="lean", moving=MOVING.get(name, True)), 128, 0)
    bench = measuring.Bench(scene, measuring.Setting((240, 171), [0, scene.frames - 1], ReferenceOptions(lighting="baked"), 0))
    methods = {"newton": plugins.discover("method")["newton"].target()}
    whole, failed = objects.errors_of(bench, methods)
    assert not failed
    seen = sorted((row for row in rows(name).values() if row["verdict"] == "seen"), key=lambda row: row["lost"])
    row = seen[rank]
    [thing] = [thing for thing in scene.objects if thing.name == row["object"]]
    verdict = objects.left_out(bench, thing, methods, whole)
    # At a quarter of the size the picture without it differs as much, and the interval is no narrower.
    assert verdict.lost.mean == pytest.approx(row["lost"], rel=0.35), thing.name
    assert verdict.lost.mean > 0.5 * objects.half(whole["newton"]), thing.name
