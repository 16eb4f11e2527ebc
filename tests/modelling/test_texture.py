"""Pictures on meshes: what is where in them, what is refused, and that they go with whatever becomes of a mesh."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from oracles.texture_oracle import looked_up
from support.small_room import quad

from benchharness.render.normalisation import normalised
from benchharness.render.orientation import oriented
from benchharness.scene import Camera, Mesh, Object, Scene, Texture, merged, refined, subdivided

SQUARE = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float)
RED, GREEN, BLUE, WHITE = np.eye(3)[0], np.eye(3)[1], np.eye(3)[2], np.ones(3)
FLAG = Texture(np.array([[RED, GREEN], [BLUE, WHITE]]))  # the upper row, then the lower


def painted(texture: Texture = FLAG, **more) -> Mesh:
    return quad((0, 0, 0), (3, 0, 0), (0, 2, 0), uv=SQUARE, texture=texture, **more)


# The oracle, by hand


@pytest.mark.parametrize(
    ("uv", "wrap", "colour"),
    [
        # Centres of the four pixels: v = 3/4 is the upper row, u = 1/4 the left column.
        ((0.25, 0.75), "repeat", RED),
        ((0.75, 0.75), "repeat", GREEN),
        ((0.25, 0.25), "repeat", BLUE),
        ((0.75, 0.25), "repeat", WHITE),
        ((0.5, 0.75), "repeat", 0.5 * (RED + GREEN)),
        ((0.375, 0.75), "repeat", 0.75 * RED + 0.25 * GREEN),
        ((0.25, 0.5), "repeat", 0.5 * (RED + BLUE)),
        ((0.5, 0.5), "repeat", 0.25 * (RED + GREEN + BLUE + WHITE)),
        # On the left edge and beyond it: the right column again, the same one back, the same one on.
        ((0.0, 0.75), "repeat", 0.5 * (RED + GREEN)),
        ((0.0, 0.75), "mirror", RED),
        ((-0.25, 0.75), "repeat", GREEN),
        ((-0.25, 0.75), "mirror", RED),
        ((-0.75, 0.75), "mirror", GREEN),
        ((-0.75, 0.75), "clamp", RED),
        ((-2.25, 0.75), "repeat", GREEN),
        ((-2.25, 0.75), "mirror", RED),
        ((2.75, 0.75), "clamp", GREEN),
        # Above the upper edge.
        ((0.25, 1.25), "repeat", BLUE),
        ((0.25, 1.25), "mirror", RED),
        ((0.25, 1.75), "mirror", BLUE),
        ((0.25, 9.0), "clamp", RED),
        # Each axis in its own way.
        ((-0.75, 1.25), ("mirror", "repeat"), WHITE),
        ((-0.75, 1.25), ("clamp", "mirror"), RED),
    ],
)
def test_the_oracle_is_right_where_a_picture_of_four_pixels_says_so(uv, wrap, colour):
    texture = Texture(FLAG.pixels, wrap)
    np.testing.assert_allclose(looked_up(texture.pixels, texture.along, [uv])[0], colour, atol=1e-15)


# What is refused


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"pixels": np.zeros((4, 4))}, r"texture: pixels have shape \(4, 4\); accepted: \[H, W, 3\]"),
        ({"pixels": np.zeros((0, 4, 3))}, "at least 1"),
        ({"pixels": np.full((2, 3, 3), 1.5)}, r"row 0, column 0 is .*1\.5.*; accepted: numbers from 0 to 1"),
        ({"pixels": np.full((2, 3, 3), np.nan)}, "row 0, column 0 is .*nan"),
        ({"wrap": "tile"}, "wrap is 'tile'; accepted: repeat, mirror, clamp, or two of them"),
        ({"wrap": ("repeat",)}, "accepted: repeat, mirror, clamp, or two"),
        ({"wrap": ("clamp", "zigzag")}, "zigzag"),
    ],
)
def test_a_bad_texture_is_refused_with_what_is_wrong(arguments, message):
    with pytest.raises(ValueError, match=message):
        Texture(**{"pixels": FLAG.pixels, **arguments})


def test_a_mesh_says_where_in_its_texture_it_is_and_emits_nothing():
    with pytest.raises(ValueError, match=r"a texture and no uv; accepted: .* \[V, 2\]"):
        quad((0, 0, 0), (1, 0, 0), (0, 1, 0), texture=FLAG)
    for uv in (SQUARE[:3], np.where(SQUARE == 1, np.inf, SQUARE), np.zeros((4, 3))):
        with pytest.raises(ValueError, match=r"mesh: uv has shape .*; accepted: finite numbers \[4, 2\]"):
            quad((0, 0, 0), (1, 0, 0), (0, 1, 0), uv=uv)
    with pytest.raises(ValueError, match="it has a texture and emits; accepted: one of the two"):
        painted(emission=(0, 0, 1))


def test_nobody_writes_to_a_picture_or_to_its_places():
    mesh = painted()
    for array in (mesh.uv, FLAG.pixels):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0
    assert FLAG.pixels.dtype == np.float32 and FLAG.along == ("repeat", "repeat")


def test_pictures_of_the_same_pixels_have_one_digest_and_others_another():
    assert Texture(FLAG.pixels.copy(), "clamp").digest == FLAG.digest
    others = [FLAG.pixels[::-1], FLAG.pixels[:, ::-1], FLAG.pixels.reshape(1, 4, 3), FLAG.pixels.reshape(4, 1, 3)]
    assert len({FLAG.digest, *(Texture(pixels).digest for pixels in others)}) == 5


# What becomes of a mesh


def test_a_picture_goes_where_its_mesh_goes():
    mesh = painted(radiance=(0.5, 0.5, 0.5))
    turn = np.array([[0, -2.0, 0, 1], [2, 0, 0, 2], [0, 0, 2, 3], [0, 0, 0, 1]])
    moved = mesh.transformed(turn)
    assert moved.texture is FLAG and np.array_equal(moved.uv, mesh.uv)

    fine = subdivided(mesh, 0.4)
    assert fine.texture is FLAG and len(fine.vertices) > 50
    np.testing.assert_allclose(fine.uv, fine.vertices[:, :2] / [3, 2], atol=1e-12)

    other = painted()
    both = merged(mesh, other)
    assert both.texture is FLAG and np.array_equal(both.uv, np.concatenate([SQUARE, SQUARE]))


def test_meshes_of_different_pictures_stay_apart():
    for other in (painted(Texture(FLAG.pixels)), replace(painted(), texture=None)):
        with pytest.raises(ValueError, match=r"merged: meshes have 2 textures.*accepted: the same for all, or none"):
            merged(painted(), other)
    bare = replace(painted(), texture=None)
    assert np.array_equal(merged(bare, bare).uv, np.concatenate([SQUARE, SQUARE]))
    assert merged(bare, replace(bare, uv=None)).uv is None


def test_a_scene_made_ready_keeps_its_pictures():
    # Seen from below only: the quad is turned; scaled; and split.
    mesh = painted(radiance=(0.5, 0.5, 0.5))
    camera = Camera((1.5, 1.0, -9.0), (1.5, 1.0, 0.0), 40.0, (0, 1, 0))
    made = Scene("flag", (Object("flag", mesh, "a picture"),), (), lambda time: camera, 1, h_max=0.5)
    turned, notes = oriented(made)
    assert notes and not np.array_equal(turned.objects[0].mesh.faces, mesh.faces)
    done = refined(normalised(turned)).objects[0].mesh
    scale = np.ptp(done.vertices[:, 0]) / 3
    assert done.texture is FLAG and done.uv is not None
    np.testing.assert_allclose(done.uv, (done.vertices - done.vertices.min(axis=0))[:, :2] / scale / [3, 2], atol=1e-9)
