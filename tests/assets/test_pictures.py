"""Pictures into linear RGB, and the mean of what a surface shows of one."""

from __future__ import annotations

import numpy as np
import pytest
from oracles import mesh_oracle
from PIL import Image

from benchharness.assets import pictures

VALUES = np.array([[0, 10, 11], [100, 188, 255]], np.uint8)


def decoded(value: float) -> float:
    """sRGB as the standard has it, one number."""
    return value / 12.92 if value <= 0.04045 else ((value + 0.055) / 1.055) ** 2.4


@pytest.mark.parametrize(
    ("name", "mode"), [("a.png", "RGB"), ("a.png", "RGBA"), ("a.png", "L"), ("a.png", "LA"), ("a.bmp", "RGB"), ("a.tga", "RGB")]
)
def test_pictures_of_eight_bits_are_decoded_whatever_their_channels(tmp_path, name, mode):
    image = Image.fromarray(VALUES).convert(mode)
    image.save(tmp_path / name)
    for source in (tmp_path / name, (tmp_path / name).read_bytes()):
        seen = pictures.decoded(source)
        assert seen.dtype == np.float32 and seen.shape == (2, 3, 3)
        assert seen == pytest.approx(
            np.repeat([[[decoded(v / 255)] for v in row] for row in VALUES.tolist()], 3, axis=2), abs=1e-6
        )


def test_palettes_and_sixteen_bits(tmp_path):
    Image.fromarray(np.array([[[255, 0, 0], [0, 0, 255]]], np.uint8)).convert("P", palette=Image.Palette.ADAPTIVE).save(
        tmp_path / "p.png"
    )
    assert pictures.decoded(tmp_path / "p.png").tolist() == [[[1, 0, 0], [0, 0, 1]]]
    Image.fromarray(np.array([[0, 32768, 65535]], np.uint16)).save(tmp_path / "d.png")
    assert pictures.decoded(tmp_path / "d.png")[0, :, 1] == pytest.approx([0, decoded(32768 / 65535), 1], abs=1e-6)


@pytest.mark.parametrize("wrap", ["repeat", "mirror", "clamp"])
def test_what_is_looked_up_is_the_texel_that_the_oracle_names(wrap):
    rng = np.random.default_rng(3)
    picture = rng.random((3, 5, 3))
    uv = rng.uniform(-3, 3, (200, 2))
    wanted = [mesh_oracle.texel(picture, point, (wrap, "repeat")) for point in uv]
    assert np.array_equal(pictures.looked_up(picture, uv, (wrap, "repeat")), wanted)


def test_the_mean_is_of_what_the_triangles_show_weighted_by_their_areas():
    picture = np.zeros((2, 2, 3))
    picture[0, 0], picture[1, 1] = 1.0, 3.0  # upper left, lower right
    uv = np.array([[0, 0.5], [0.5, 0.5], [0.5, 1], [0.5, 0], [1, 0], [1, 0.5]])
    faces = np.array([[0, 1, 2], [3, 4, 5]])
    assert pictures.mean(picture, uv, faces, np.array([3.0, 1.0]), ("repeat", "repeat")) == pytest.approx([1.5] * 3)


def test_the_mean_over_a_whole_picture_is_its_mean():
    picture = np.random.default_rng(4).random((16, 16, 3))
    uv, faces = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]), np.array([[0, 1, 2], [0, 2, 3]])
    mean = pictures.mean(picture, uv, faces, np.ones(2), ("clamp", "clamp"))
    assert mean == pytest.approx(picture.mean(axis=(0, 1)), abs=0.02)
