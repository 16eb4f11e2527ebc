"""Pictures into linear RGB."""

from __future__ import annotations

import numpy as np
import pytest
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
