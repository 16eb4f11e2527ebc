"""What counts as closed: for culling, for baking, and for telling in from out; and what turns with a part."""

from __future__ import annotations

import mitsuba as mi
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.small_room import box

from benchharness.kernels import geometry
from benchharness.kernels.geometry import oriented_closed_faces
from benchharness.modelling import winding
from benchharness.scene import Mesh, merged

BOX = box((0, 0, 0), (1, 1, 1))
ALONG_AN_EDGE = merged(BOX, box((1, 1, 0), (2, 2, 1)))


def with_faces(faces) -> Mesh:
    return Mesh(BOX.vertices, np.asarray(faces), BOX.normals)


def one_turned() -> Mesh:
    faces = BOX.faces.copy()
    faces[0] = faces[0, ::-1]
    return with_faces(faces)


@pytest.mark.parametrize(
    ("mesh", "culled", "baked", "piece"),
    [
        (BOX, True, True, True),
        (with_faces(BOX.faces[1:]), False, False, False),
        (one_turned(), False, True, True),  # its back may be seen, though no light gets in
        (ALONG_AN_EDGE, True, False, True),  # four faces at one edge, two in either direction, and two of each box
        (with_faces([*BOX.faces, BOX.faces[0, [0, 0, 1]]]), True, True, True),  # it has no edges
    ],
    ids=["box", "without a face", "with one face turned", "beside another", "with a face without area"],
)
def test_three_meanings_of_closed(mesh, culled, baked, piece):
    count = 12 if len(mesh.faces) > 12 else len(mesh.faces)  # of the first box
    assert oriented_closed_faces(mesh.vertices, mesh.faces)[:count].tolist() == [culled] * count
    assert winding.closed_faces(mesh)[:count].tolist() == [baked] * count
    found = winding.pieces(mesh)
    assert found.closed[found.piece][:count].tolist() == [piece] * count


def test_directions_are_turned_with_the_part_that_they_belong_to():
    rng = np.random.default_rng(3)
    poses = np.concatenate([Rotation.random(4, random_state=5).as_matrix(), rng.normal(size=(4, 3, 1))], axis=2)
    part, n = np.array([2, 0, 3, 3, 1]), rng.normal(size=(5, 3))
    rows = mi.Float(poses.astype(np.float32).ravel())
    turned = geometry.turned_of(mi.Vector3f(n.T.astype(np.float32)), rows, mi.UInt32(part), mi.Bool(True))
    np.testing.assert_allclose(np.array(turned).T, np.einsum("lij,lj->li", poses[part, :, :3], n), atol=1e-6)
