"""A mirror shows the same whether its file's vertices are shared, split along a seam, between materials, or all loose."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from support import split_balls
from support.mirror_room import shaded
from support.textured_rooms import SQUARE, room, wavy
from support.tiers import exhaustive

from benchharness.modelling import surfacefacts
from benchharness.render import reference
from benchharness.render.ready import ready
from benchharness.scene import Reflector, Scene
from benchharness.study import placed, plugins
from benchharness.study.entries import ReflectorTable

SIZE = (96, 72)
SPLIT = ["seam", "rounded", "loose", "materials", "bare", "primitives"]
ALIKE = SPLIT[:3]  # the others are meshes as one of these is, but for the order in which they come
METHODS = {name: plugin.target for name, plugin in plugins.discover("method").items() if plugin.error is None}
BY_RAY = {f"{name} by rays": (name, {"resolve": "ray"}) for name in ("newton", "image_space_search", "secant_triangle")}
ASKED = {**{name: (name, {}) for name in METHODS if name != "planar_mirror"}, **BY_RAY}
UNLIKE = ["ray_traced", "image_space_search", "newton"]
SHARE = 1e-3  # of the mean radiance that a mirror shows: by how much it may be another in the mean
MADE = {"loose": 1.5, "bare": 1.5}  # times that where normals are made, which are off by the square of an edge

Shown = tuple[np.ndarray, np.ndarray]
"""Radiance [H, W, 3], and where it is one [H, W]."""


@lru_cache
def made(kind: str) -> Scene:
    """The ball of a file of this kind in a papered room, as it is drawn."""
    with TemporaryDirectory() as folder:
        path = split_balls.KINDS[kind](Path(folder))
        asset = placed.read(path, "reflectors.ball", ReflectorTable(name="ball", mesh=path.name))
        ball = Reflector("ball", placed.mesh(asset, np.eye(4)))
    return ready(room(wavy("mirror"), wavy("repeat"), ball, uv=1.5 * SQUARE), 1)


@lru_cache
def shown(asked: str, kind: str) -> Shown:
    name, options = ASKED[asked]
    [answer] = shaded(METHODS[name](**options), made(kind), 0, size=SIZE)
    return answer.L, answer.active & answer.found


@lru_cache
def traced(kind: str) -> Shown:
    seen = reference.render(made(kind), 0.0, SIZE)
    return seen.image, seen.mask


def share_off(one: Shown, other: Shown) -> float:
    """Mean absolute difference where both show something, of the mean of the other."""
    (a, seen), (b, also) = one, other
    assert (seen != also).sum() <= SHARE * also.sum() > 0
    both = seen & also
    return float(np.abs(a - b)[both].mean() / b[both].mean())


def test_files_are_split_as_they_say_and_read_as_one_closed_ball():
    split = {kind: surfacefacts.facts(made(kind).reflectors[0].mesh) for kind in split_balls.KINDS}
    assert {(it.faces, it.pieces, it.closed) for it in split.values()} == {(len(split_balls.FACES), 1, 1)}
    seams = {kind: (it.seams > 0, it.creases > 0) for kind, it in split.items()}
    assert {kind for kind, (seam, _) in seams.items() if seam} == {"seam", "rounded", "materials", "torn"}
    assert {kind for kind, (_, crease) in seams.items() if crease} == {"torn"}


@pytest.mark.parametrize("kind", SPLIT)
def test_the_reference_shows_what_it_shows_of_the_welded_ball(kind):
    assert share_off(traced(kind), traced("welded")) <= SHARE


def test_a_seam_whose_sides_have_normals_of_their_own_is_seen():
    for one, other in ((traced("torn"), traced("welded")), (shown("ray_traced", "torn"), shown("ray_traced", "welded"))):
        assert share_off(one, other) > 2 * SHARE


@pytest.mark.parametrize("asked", UNLIKE)
def test_a_method_shows_what_it_shows_of_the_welded_ball(asked):
    off = {kind: share_off(shown(asked, kind), shown(asked, "welded")) for kind in ALIKE}
    assert max(off.values()) <= SHARE, off


@exhaustive
@pytest.mark.parametrize("asked", ASKED)
def test_a_method_shows_so_of_every_kind_of_file(asked):
    off = {kind: share_off(shown(asked, kind), shown(asked, "welded")) / MADE.get(kind, 1.0) for kind in SPLIT}
    assert max(off.values()) <= SHARE, off
