"""A fence whose bars are an alpha picture is drawn, and mirrored, as one whose bars are triangles of a file."""

from __future__ import annotations

import io

import numpy as np
import pytest
import trimesh
from PIL import Image
from support.gltf_files import Gltf
from support.mesh_cases import HALF_THERE
from support.mesh_cases_gltf import DOWN, square

from benchharness.measure.bench import Bench
from benchharness.render.reference import ReferenceOptions
from benchharness.study import plugins, tablescene

SIZE = (96, 72)
BARS = 4
SHINING = {"albedo": [0, 0, 0], "emission": [1.0, 0.6, 0.2]}  # the same everywhere: nothing has to be baked


def fence(folder, mode: str) -> str:
    """A square of four pictures side by side, of each of which the left half is there."""
    png, document = io.BytesIO(), Gltf()
    Image.fromarray(HALF_THERE).save(png, "png")
    square(document, uv=DOWN * [BARS, 1], image=png.getvalue(), material={"alphaMode": mode})
    document.write(folder).rename(folder / f"{mode}.glb")
    return f"{mode}.glb"


def bars(folder) -> str:
    x = [(k / BARS, (k + 0.5) / BARS) for k in range(BARS)]
    corners = "".join(f"v {a} 0 0\nv {b} 0 0\nv {b} 0 1\nv {a} 0 1\n" for a, b in x)
    (folder / "bars.obj").write_text(corners + "f -16 -15 -14 -13\nf -12 -11 -10 -9\nf -8 -7 -6 -5\nf -4 -3 -2 -1\n")
    return "bars.obj"


METHODS = "ray_traced", "newton", "environment_map"


def pictures(folder, mesh: str, methods: tuple[str, ...] = METHODS) -> dict[str, np.ndarray]:
    """What each method shows of a ball, the fence beside it and its image in it."""
    trimesh.creation.icosphere(subdivisions=4, radius=0.6).export(folder / "ball.ply")
    table = {
        "background": [0.3, 0.4, 0.6],
        "objects": [{"name": "fence", "mesh": mesh, "scale": 1.6, "translate": [-1.7, -1.2, -0.8], **SHINING}],
        "reflectors": [{"name": "ball", "mesh": "ball.ply"}],
        "camera": {"path": [[0.6, -4, 0.3]], "target": [-0.3, 0, 0], "fov_deg": 42},
    }
    made = tablescene.build("mine", tablescene.SceneTable.model_validate(table, strict=False), folder, "f.toml: mine")
    bench = Bench(made, SIZE, ReferenceOptions(spp=2, bake_spp=4), None, 0, (1, 1))
    found = {}
    for name in methods:
        record, seen = bench.show(0, name, plugins.discover("method")[name].target())
        assert record["status"] == "ok" and seen is not None
        found[name] = np.asarray(seen.image)
    return found


def test_methods_show_the_bars_of_a_picture_as_they_show_bars(tmp_path):
    cut, right = pictures(tmp_path, fence(tmp_path, "MASK")), pictures(tmp_path, bars(tmp_path))
    opaque = pictures(tmp_path, fence(tmp_path, "OPAQUE"), METHODS[:1])
    for name, image in right.items():
        # The same triangles' rims, so the same pixels, but for those of whose centres rounding decides.
        off = np.abs(cut[name] - image).max(axis=-1)
        assert (off > 0.02).mean() < 0.005, name
        assert off.mean() < 0.1 * np.abs(opaque["ray_traced"] - right["ray_traced"]).mean() > 0.002, name
    assert right["ray_traced"].max() == pytest.approx(1.0, abs=1e-3)
