"""The perturbation study: what it changes, what it counts, and that it tells what amplifies from what does not."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from support.here import Here
from support.mirror_room import mirror_room

from benchharness.measure import truth
from benchharness.scene import Mesh, Reflector
from benchharness.stability import altered, perturbation
from benchharness.study import methods, plugins

SIZE = (64, 48)
NOISE = '''
import drjit as dr
import mitsuba as mi
from dataclasses import dataclass
from benchharness.api import Method, Reflection


@dataclass(frozen=True)
class HashOfTheEye(Method):
    """Radiance that has nothing to do with that of an eye a little aside."""

    paper = "none"

    def prepare(self, scene):
        return None

    def shade(self, state, frame):
        lane = mi.Float(dr.arange(mi.UInt32, dr.width(frame.active)))
        wave = 4e6 * frame.view.eye.x + lane
        return Reflection(mi.Color3f(0.5 + 0.1 * dr.sin(wave)), mi.Float(1), mi.Bool(True)), state
'''


# What is changed.


def test_a_camera_moved_aside_sees_its_target_that_much_further_left():
    made = mirror_room()
    moved = altered.aside(made, 0.1, 120)
    before, after = (truth.on_screen(np.array([made.camera(0.0).target]), s.camera(0.0), 160, 120)[0] for s in (made, moved))
    np.testing.assert_allclose(after - before, [-0.1, 0.0], atol=1e-9)


def test_rounding_moves_by_at_most_one_float_and_what_is_at_one_place_alike():
    made = mirror_room()
    ball = made.reflectors[0].mesh  # coinciding vertices at seam and poles
    half = Mesh(ball.vertices, ball.faces[: len(ball.faces) // 2], ball.normals)
    moved = altered.rounded(replace(made, reflectors=(Reflector("mirror", half, ball),))).reflectors[0]
    assert moved.closed is not None
    np.testing.assert_array_equal(moved.mesh.vertices, moved.closed.vertices)
    before = ball.vertices.astype(np.float32)
    step = np.abs(moved.closed.vertices - before) / np.spacing(np.abs(before))
    assert step.max() <= 1 and 0.3 < (step > 0).mean() < 0.9
    _, first, which = np.unique(ball.vertices, axis=0, return_index=True, return_inverse=True)
    np.testing.assert_array_equal(moved.closed.vertices, moved.closed.vertices[first][which.reshape(-1)])


def test_what_is_numbered_otherwise_has_the_same_triangles_and_vertices():
    made = mirror_room()
    mixed, was = altered.renumbered(made)
    here, there = (np.concatenate([part.mesh.vertices for part in s.parts]) for s in (made, mixed))
    np.testing.assert_array_equal(there, here[was])
    assert not (there == here).all()

    def triangles(part) -> np.ndarray:
        carried = [part.mesh.vertices, part.mesh.normals] + ([] if part.mesh.radiance is None else [part.mesh.radiance])
        rows = np.concatenate([a[part.mesh.faces].reshape(len(part.mesh.faces), -1) for a in carried], axis=1)
        return rows[np.lexsort(rows.T)]

    for one, other in zip(made.parts, mixed.parts, strict=True):
        np.testing.assert_array_equal(triangles(one), triangles(other))


# What is counted.


def seen(image, truth_, mask) -> SimpleNamespace:
    return SimpleNamespace(image=image, truth=truth_, mask=mask)


def test_changes_are_of_common_pixels_in_display_white_and_amplification_is_their_ratio():
    black, mask = np.zeros((2, 5, 3)), np.zeros((2, 5), bool)
    mask[:, 1:4] = True
    image, truth_ = black.copy(), black.copy()
    image[0, 1], truth_[0, 2], image[0, 0] = 0.6, 0.2, 9.0  # the last is off the mask
    got = perturbation.compared(seen(black, black, mask), seen(image, truth_, mask), 0, 1.0)
    assert got["change"] == pytest.approx(1.0 / 6)  # twice 0.6 is cut off at white
    assert got["reference_change"] == pytest.approx(0.4 / 6) and got["amplification"] == pytest.approx(2.5)
    assert got["changed_px"] == pytest.approx(1 / 6) and got["reflector_px"] == 6
    wide = np.pad(image, ((0, 0), (1, 1), (0, 0)), constant_values=7.0)
    still = perturbation.compared(seen(image, truth_, mask), seen(wide, np.pad(truth_, ((0, 0), (1, 1), (0, 0))),
                                  np.pad(mask, ((0, 0), (1, 1)))), 1, 0.0)  # fmt: skip
    assert still["change"] == 0 and still["amplification"] == 0 and still["changed_px"] == 0
    nothing = perturbation.compared(seen(image, truth_, 0 * mask > 0), seen(image, truth_, mask), 0, 0.0)
    assert nothing["change"] is None


OK = {"status": "ok", "change": 0.01, "reference_change": 0.01, "amplification": 1.0, "coverage": 1.0, "converged_ratio": None}


@pytest.mark.parametrize(
    ("record", "expected"),
    [
        ({}, "holds"),
        ({"amplification": 2.1}, "fails"),
        ({"amplification": 2.1, "converged_ratio": 0.9}, "degrades"),
        ({"amplification": 2.1, "coverage": 0.9}, "degrades"),
        ({"change": None, "amplification": None}, "holds"),
        ({"status": "refused", "reason": "no"}, "refuses"),
        ({"status": "crashed", "reason": "it ended"}, "fails"),
        ({"status": "invalid", "reason": "NaN"}, "fails"),
    ],
)
def test_verdicts(record, expected):
    assert perturbation.verdict(OK | record)[0] == expected


# What comes out.


@pytest.fixture(scope="module")
def rows(tmp_path_factory):
    """Rows of a floor in a convex mirror, by method and kind: traced rays, and a hash of the eye's position."""
    folder = tmp_path_factory.mktemp("perturbation")
    (folder / "hash_of_the_eye.py").write_text(NOISE)
    traced = next(entry for entry in methods.installed(Here()) if entry.method == "ray_traced")
    entries = [traced, methods.plugged_in(str(folder / "hash_of_the_eye.py"), Here())]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(perturbation, "SIZE", SIZE)
        (name, units), *others = perturbation.units(entries, ["hidden"]).items()
        assert name == "hidden" and not others and len(units) == 2 * len(perturbation.KINDS)
        done = [perturbation.row(u, r) for u, r in zip(units, perturbation.work(units, folder), strict=True)]
    assert all(list(row) == perturbation.COLUMNS for row in done)
    return {(row["method"], row["kind"]): row for row in done}, folder


def test_what_shows_the_truth_changes_as_the_truth_does(rows):
    found, _ = rows
    assert found["ray_traced", "camera"]["amplification"] == pytest.approx(1.0, abs=0.25)  # silhouettes of facets differ
    for kind in ("order", "size"):
        row = found["ray_traced", kind]
        assert row["change"] < 1e-6 and row["reference_change"] < 1e-6 and row["changed_px"] == 0, kind
    assert all(found["ray_traced", kind]["verdict"] == "holds" for kind in perturbation.KINDS)


def test_what_amplifies_is_caught_where_it_does_and_its_pictures_are_kept(rows):
    found, folder = rows
    camera = found["hash_of_the_eye", "camera"]
    assert camera["verdict"] == "fails" and camera["amplification"] > 2 * perturbation.BOUND and camera["changed_px"] > 0.5
    assert found["hash_of_the_eye", "order"]["change"] == 0
    assert found["hash_of_the_eye", "order"]["verdict"] == "holds"
    pictures = [path.name for path in folder.glob("*.png")]
    assert any(name.startswith("hidden_camera") for name in pictures) and not any("ray_traced" in name for name in pictures)


def test_a_scene_that_is_not_in_the_study_is_refused_with_what_would_be_accepted():
    with pytest.raises(ValueError, match="did you mean 'hidden'"):
        perturbation.units([], ["hiden"])


def test_the_real_scene_is_installed_and_the_regimes_have_their_severity():
    from benchharness.stability import atlas

    for name, severity in perturbation.SCENES.items():
        assert name in plugins.discover("scene") if severity is None else severity in atlas.regimes()[name][0].severities
