"""What objects are needed for: coarser meshes carry what they stand for, and verdicts of a room whose answer is plain."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.mirror_room import ball
from support.small_room import box

from benchharness.needs.coarser import coarser
from benchharness.needs.knee import Error
from benchharness.needs.objects import Verdict
from benchharness.scene import Mesh, subdivided


def painted_box(edge: float = 0.2) -> Mesh:
    """A box of many triangles: each side has a colour of its own that changes along it."""
    mesh = subdivided(box((0, 0, 0), (1, 2, 3)), edge)
    return replace(mesh, radiance=colours(mesh.vertices, mesh.normals))


def colours(points: np.ndarray, normals: np.ndarray) -> np.ndarray:
    return 3.0 + normals * [1.0, 0.5, 0.25] + 0.3 * points


def face_normals(mesh: Mesh) -> np.ndarray:
    a, b, c = mesh.vertices[mesh.faces].swapaxes(0, 1)
    n = np.cross(b - a, c - a)
    return n / np.linalg.norm(n, axis=1, keepdims=True)


@pytest.mark.parametrize("share", [0.5, 0.25, 0.125])
def test_a_coarser_box_keeps_its_shape_its_creases_and_its_colours(share):
    fine = painted_box()
    coarse = coarser(fine, share)
    assert coarse is not None and len(coarse.faces) <= share * len(fine.faces)
    sides = face_normals(coarse)
    for k in range(3):  # what the corners of a triangle carry is of its own side
        assert np.einsum("fi,fi->f", coarse.normals[coarse.faces[:, k]], sides).min() > 0.999
    wanted = colours(coarse.vertices, coarse.normals)
    assert coarse.radiance is not None
    assert np.abs(coarse.radiance - wanted).max() < 0.02  # they are looked up a little inside their triangle
    assert np.ptp(coarse.vertices, axis=0) == pytest.approx(np.ptp(fine.vertices, axis=0), abs=1e-6)


@pytest.mark.parametrize("scale", [1e-3, 1e3])
def test_a_coarser_ball_has_as_many_corners_at_every_scale_and_its_visibility_stays_a_share(scale):
    usual = ball(0.5, (1, 2, 3), (1, 1, 1), 4)
    other = replace(usual, vertices=scale * usual.vertices, visibility=np.full((len(usual.vertices), 1), 1.0))
    few, same = coarser(usual, 0.25), coarser(other, 0.25)
    assert few is not None and same is not None and same.visibility is not None
    assert len(same.vertices) == len(few.vertices) and same.visibility.max() <= 1


def test_a_coarser_ball_is_still_round_and_smooth():
    fine = ball(0.5, (1, 2, 3), (1, 1, 1), 4)
    coarse = coarser(fine, 0.25)
    assert coarse is not None
    out = coarse.vertices - [1, 2, 3]
    assert np.linalg.norm(out, axis=1) == pytest.approx(np.full(len(out), 0.5), abs=0.02)
    assert np.einsum("vi,vi->v", coarse.normals, out / np.linalg.norm(out, axis=1, keepdims=True)).min() > 0.99


def test_twelve_triangles_are_not_made_fewer():
    assert coarser(box((0, 0, 0), (1, 2, 3)), 0.5) is None


@pytest.mark.parametrize(
    ("change", "order", "lost", "failed", "word"),
    [
        (1.1, "", 0.0, "", "judges"),
        (0.9, "", 0.0, "", "nothing"),
        (0.9, "a, b", 0.0, "", "judges"),
        (0.9, "", 0.0, "a: why", "judges"),
        (0.9, "", 0.02, "", "seen"),
        (0.9, "", 0.01, "", "nothing"),
    ],
)
def test_words(change, order, lost, failed, word):
    assert Verdict("a", change, order, Error(lost, lost, lost), failed).word(0.01) == word
