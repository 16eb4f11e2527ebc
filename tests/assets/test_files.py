"""Mesh files as users have them, written by hand: each is right, or refused in words that name what is wrong. None is silently
something else."""

from __future__ import annotations

import re
from collections import Counter

import numpy as np
import pytest
from oracles import mesh_oracle
from support import mesh_cases_gltf, mesh_cases_gltf_looks, mesh_cases_mtl, mesh_cases_obj, mesh_cases_ply
from support.mesh_cases import Case

from benchharness.assets.asset import Asset, Refused
from benchharness.assets.reading import read

KINDS = {
    "OBJ": mesh_cases_obj,
    "MTL": mesh_cases_mtl,
    "PLY": mesh_cases_ply,
    "glTF": mesh_cases_gltf,
    "glTF's look": mesh_cases_gltf_looks,
}
CASES = [pytest.param(case, id=f"{kind} {case.name}") for kind, cases in KINDS.items() for case in cases.CASES]
CLOSE = 2e-6  # coordinates are float32 in most formats


@pytest.mark.parametrize("case", CASES)
def test_a_file_is_right_or_refused(tmp_path, case):
    path = case.write(tmp_path)
    if case.refused:
        with pytest.raises(Refused, match=case.refused) as error:
            read(path)
        assert str(error.value).startswith(path.name) and "accepted: " in str(error.value)
        return
    asset = read(path)
    _sound(asset)
    _shaped(asset, case)
    if case.normals is not None:
        _lit(asset, case)
    if case.parts is not None:
        assert {part.material.name for part in asset.parts} == set(case.parts)
        for part in asset.parts:
            assert part.material.base_colour == pytest.approx(case.parts[part.material.name])
    for point, colour in (case.colours or {}).items():
        assert mesh_oracle.colour_at(asset.parts, point) == pytest.approx(colour, abs=1e-4), point
    for name, emission in (case.emits or {}).items():
        assert [part.material.emission for part in asset.parts if part.material.name == name] == [pytest.approx(emission)]
    _said(asset, case)


def _sound(asset: Asset) -> None:
    """What holds for every file: finite numbers, unit normals, no index that is none, no vertex that no face has."""
    for part in asset.parts:
        count = len(part.vertices)
        assert part.vertices.dtype == part.normals.dtype == np.float64 and part.faces.dtype == np.int32
        assert sorted(set(part.faces.reshape(-1).tolist())) == list(range(count))
        assert np.isfinite(part.vertices).all()
        assert np.linalg.norm(part.normals, axis=1) == pytest.approx(np.ones(count), abs=1e-9)
        assert part.uv is None or (part.uv.shape == (count, 2) and np.isfinite(part.uv).all())
        assert part.colours is None or (part.colours.shape == (count, 3) and 0 <= part.colours.min() <= part.colours.max() <= 1)
        assert part.name


def together(asset: Asset) -> tuple[np.ndarray, np.ndarray]:
    starts = np.cumsum([0, *(len(part.vertices) for part in asset.parts)])
    faces = [part.faces + start for part, start in zip(asset.parts, starts, strict=False)]
    return np.concatenate([part.vertices for part in asset.parts]), np.concatenate(faces)


def _shaped(asset: Asset, case: Case) -> None:
    vertices, faces = together(asset)
    if case.box is not None:
        assert asset.box == pytest.approx(np.array(case.box), abs=1e-5)
    if case.area is not None:
        assert mesh_oracle.area(vertices, faces) == pytest.approx(case.area, rel=CLOSE)
    if case.volume is not None:
        assert mesh_oracle.volume(vertices, faces) == pytest.approx(case.volume, rel=CLOSE)
    if case.faces is not None:
        assert len(faces) == case.faces
    if case.closed is not None:
        assert mesh_oracle.closed(vertices, faces) == case.closed


def _lit(asset: Asset, case: Case) -> None:
    for part in asset.parts:
        corners = part.vertices[part.faces]
        upright = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        if case.normals == "flat":
            wanted, own = np.repeat(upright[:, None], 3, axis=1).reshape(-1, 3), part.normals[part.faces].reshape(-1, 3)
        elif case.normals == "radial":
            wanted, own = part.vertices, part.normals
        elif case.normals == "ellipsoid":  # of half axes 0.5, 1, 2: along the gradient of x²/a² + y²/b² + z²/c²
            wanted, own = part.vertices / np.square([0.5, 1, 2]), part.normals
        else:
            wanted, own = np.broadcast_to(np.array(case.normals), part.normals.shape), part.normals
        wanted = wanted / np.linalg.norm(wanted, axis=1, keepdims=True)
        assert np.einsum("ni,ni->n", wanted, own).min() > np.cos(np.radians(1.5))  # normals of a coarse ball's faces


def _said(asset: Asset, case: Case) -> None:
    """Every finding is expected, and everything expected is found."""
    left = list(asset.findings)
    for expression in case.says:
        found = [said for said in left if re.search(expression, said)]
        assert found, f"{expression!r} is not said: {asset.findings}"
        left.remove(found[0])
    assert not left


def test_there_are_many_and_no_two_have_a_name():
    names = Counter(param.id for param in CASES)
    assert len(names) > 150 and max(names.values()) == 1
