"""What is said of surfaces, against counts and volumes worked out by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from benchharness.modelling import surfacefacts
from benchharness.scene import Mesh


def box(extents=(1.0, 2.0, 3.0)) -> Mesh:
    """A box with its faces' normals, 4 vertices a face."""
    solid = trimesh.creation.box(extents=extents)
    corners = solid.vertices[solid.faces].reshape(-1, 3)
    return Mesh(corners, np.arange(36).reshape(-1, 3), np.repeat(solid.face_normals, 3, axis=0))


def test_a_box_is_closed_has_its_volume_and_creases_at_its_eight_corners():
    it = surfacefacts.facts(box())
    assert (it.faces, it.pieces, it.closed, it.one_sided, it.degenerate, it.away) == (12, 1, 1, 0, 0, 0)
    assert it.volume == pytest.approx(6.0, rel=1e-12)
    assert (it.seams, it.creases) == (8, 8)
    assert np.allclose(it.high - it.low, (1, 2, 3))
    said = surfacefacts.described(surfacefacts.facts(box()))
    assert "12 triangles, 36 vertices, 1 x 2 x 3 m" in said and "closed, fronts outwards" in said
    assert surfacefacts.faults(surfacefacts.facts(box()), mirror=True) == []


def test_what_is_wound_inwards_with_normals_outwards_is_said():
    mesh = box()
    inside = replace(mesh, faces=mesh.faces[:, ::-1])
    it = surfacefacts.facts(inside)
    assert it.volume == pytest.approx(-6.0) and it.away == 36
    assert "fronts inwards" in surfacefacts.described(surfacefacts.facts(inside))
    assert any("36 of 36 normals" in text for text in surfacefacts.faults(surfacefacts.facts(inside), mirror=False))


def test_an_open_sheet_triangles_without_area_and_unused_vertices():
    vertices = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0, 0], [100, 100, 100]], float)
    mesh = Mesh(vertices, [[0, 1, 2], [0, 2, 3], [0, 4, 1]], normals=np.tile([0.0, 0, 1], (6, 1)))
    it = surfacefacts.facts(mesh)
    assert (it.degenerate, it.closed, it.volume) == (1, 0, 0.0)
    assert it.high.max() == 1.0  # the vertex that no face has is nothing of the surface
    assert "open" in surfacefacts.described(surfacefacts.facts(mesh))
    assert surfacefacts.faults(surfacefacts.facts(mesh), mirror=False) == ["1 of 3 triangles have no area"]


@pytest.mark.parametrize(("scale", "place"), [(1e-4, 0.0), (1.0, 0.0), (1e4, 1e6)])
def test_counts_do_not_depend_on_size_or_place(scale, place):
    mesh = box()
    it = surfacefacts.facts(replace(mesh, vertices=mesh.vertices * scale + place))
    assert (it.closed, it.degenerate, it.seams, it.away) == (1, 0, 8, 0)
    assert it.volume == pytest.approx(6.0 * scale**3, rel=1e-6)


def test_a_mirror_of_few_triangles_is_said_to_be_coarse_and_a_fine_one_is_not():
    def ball(subdivisions):
        shape = trimesh.creation.icosphere(subdivisions=subdivisions)
        return Mesh(shape.vertices, shape.faces, shape.vertices)

    assert surfacefacts.facts(ball(0)).turn_deg == pytest.approx(63.43, abs=0.01)  # of an icosahedron's edge, from its middle
    assert any("63 degrees" in text for text in surfacefacts.faults(surfacefacts.facts(ball(0)), mirror=True))
    assert (
        surfacefacts.faults(surfacefacts.facts(ball(0)), mirror=False)
        == surfacefacts.faults(surfacefacts.facts(ball(2)), mirror=True)
        == []
    )


def test_a_smooth_sphere_that_a_seam_splits_has_no_crease():
    shape = trimesh.creation.icosphere(subdivisions=1)
    corners = shape.vertices[shape.faces].reshape(-1, 3)
    it = surfacefacts.facts(Mesh(corners, np.arange(len(corners)).reshape(-1, 3), corners))
    assert (it.seams, it.creases, it.closed) == (42, 0, 1)
