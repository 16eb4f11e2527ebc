"""Impostors, I-01 to I-18, and traps of metrics and libraries, M-01 to M-08."""

from __future__ import annotations

import subprocess
import sys
from functools import cache

import flip_evaluator
import mitsuba as mi
import numpy as np
from catalogue.catalogue_row import Elsewhere, Row
from oracles.depth_oracle import BACKGROUND
from scipy.ndimage import distance_transform_edt
from support.depth_objects import built, device, figure

from benchharness.kernels.images import deptherror

BLACK_HDR = "import numpy, flip_evaluator; z = numpy.zeros((16, 16, 3), 'f4'); flip_evaluator.evaluate(z, z, 'HDR')"


@cache
def simplified(m: int) -> dict[str, float]:
    """4.4, I-12: what rows of m points lose of a figure of balls, n = 18; spans dropped at n = 60."""
    cam, depth = figure()
    layout, rows, _ = built(depth, 18, m)
    loss = deptherror.simplification(device(depth), device(cam.packet()), rows, layout)
    return {"z": 100 * loss.depth, "range": 100 * loss.range, "dropped": int(np.array(built(depth, 60, m)[2]).sum())}


def corners_lost(rows_only: bool) -> float:
    """I-18: share of a square's texels that rows turned by 45 degrees lack; `rows_only`: with samples enough."""
    w = 256
    c = 0.5 * (w - 1)
    y, x = np.mgrid[:w, :w] - c
    across, along = (y - x) / np.sqrt(2), (y + x) / np.sqrt(2)
    return float(((np.abs(across) > c + 0.5) | ((np.abs(along) > c + 0.5) & (not rows_only))).mean())


def covered_at_45() -> float:
    """The same of the kernel: share of a full plate that is not in its rows."""
    w = 256
    layout, rows, _ = built(np.full((w, w), 0.5), 4, 4)
    ends = np.array(rows).reshape(4, w, 4, 2)[1, ..., 0]
    assert (np.array(rows).reshape(-1, 2)[:, 1] < BACKGROUND).any() and layout.w == w
    ends = np.sort(np.where(ends < 0, -ends - 1, ends), axis=-1)
    return float(1 - (ends[:, -1] - ends[:, 0] + 1).sum() / w**2)


def exit_code() -> int:
    return subprocess.run([sys.executable, "-c", BLACK_HDR], capture_output=True, check=False).returncode


@cache
def with_a_hole(size: int = 64) -> np.ndarray:
    """M-02: FLIP's map of noise with one pixel that is no number."""
    reference = np.random.default_rng(0).random((size, size, 3)).astype(np.float32)
    image = reference.copy()
    image[size // 2, size // 2] = np.nan
    return flip_evaluator.evaluate(reference, image, "LDR", applyMagma=False)[0]


@cache
def leaked() -> tuple[float, float]:
    """M-03: FLIP's mean in a ring of 10 px around the only square that differs, and its largest beyond 14 px."""
    y, x = np.mgrid[:128, :128] - 64
    inside = (np.abs(x) < 20) & (np.abs(y) < 20)
    reference = np.random.default_rng(0).random((128, 128, 3)).astype(np.float32)
    image = np.where(inside[..., None], 1 - reference, reference)
    error = flip_evaluator.evaluate(reference, image, "LDR", applyMagma=False, parameters={"ppd": 67.0})[0][..., 0]
    away = distance_transform_edt(~inside)
    return float(error[(away > 0) & (away <= 10)].mean()), float(error[away > 14].max())


@cache
def scaled_sphere() -> float:
    """M-08: how far a `sphere` scaled by (1, 0.6, 1.4) is from round, along three axes."""
    to_world = mi.ScalarTransform4f().scale([1, 0.6, 1.4])
    made = mi.load_dict({"type": "scene", "ball": {"type": "sphere", "to_world": to_world}})
    reach = [
        4 - np.array(made.ray_intersect_preliminary(mi.Ray3f(mi.Point3f(4 * d), mi.Vector3f(-d))).t)[0]
        for d in (mi.ScalarVector3f(1, 0, 0), mi.ScalarVector3f(0, 1, 0), mi.ScalarVector3f(0, 0, 1))
    ]
    return float(np.ptp(reach))


LOSSES = {4: (2.37, 3.29), 8: (0.61, 0.75), 10: (0.37, 0.46), 12: (0.25, 0.30), 14: (0.19, 0.21), 16: (0.15, 0.16), 32: (0.05,
0.05),
          64: (0.01, 0.02)}  # fmt: skip
HITS = {
    "n = 60, m = 8, mid": ("0.33, 2.3; 1.6 %; 2 and 7 of 700", "0.28, 1.57; 0; 1 and 2"),
    "n = 60, m = 16, mid": ("0.14, 0.7; 0; 2 and 4", "0.08, 0.42; 0; 1 and 1"),
    "n = 18, m = 16, mid (I-16)": ("0.18, 0.9; 0; 0 and 5", "0.09, 0.41; 0; 0 and 6"),
    "n = 18, m = 16, start (I-16)": ("0.20, 1.5; 0.3 %; 8 and 10", "0.19, 1.32; 0; 2 and 10"),
    "n = 9, m = 16, mid": ("0.23, 1.3; 0; 1 and 3", "0.10, 0.47; 0; 3 and 4"),
}
OBJECT = "another object: balls with ripples, whose map is not the prototype's"
CONTACT = "test_billboard_impostor.py::"
PLANAR = "test_planar_mirror.py::"

ROWS: list[Row | Elsewhere] = [
    Elsewhere("F-29", "ball of 0.3 touching at 50 degrees: polar angles, px", "27.0-52.9, 117-188", "27.0-52.9, 117-187",
              f"{CONTACT}test_i02_a_billboard_loses_the_end_at_which_a_ball_touches", "the last pixel whose centre is inside"),
    Elsewhere("F-29", "contact gap", "1 px", "1 px",
        "test_contact.py::test_the_hand_touches_its_image_where_it_touches_the_kettle"),
    Elsewhere("I-01", "overlap of the ball's arc: environment map, billboard", "0.012, 0.683", "within 0.03",
              f"{CONTACT}test_i01_how_much_of_the_image_of_a_touching_ball_is_where_it_should_be"),
    Elsewhere("I-02", "billboard's arc, px lost of 71", "27.3-44.9, 16", "within 0.6 and 1",
        f"{CONTACT}test_i02_a_billboard_loses_the_end_at_which_a_ball_touches"),
    *(Elsewhere("4.3", f"{name}: px median, p95; over 5 px; false, missed", *figures,
                "test_depthray_study.py::test_rows_reach_the_precision_they_are_known_for", OBJECT) for name,
                figures in HITS.items()),
    *(Row("4.4", f"|dz| / (far - near), %, m = {m}", str(then), lambda m=m: simplified(m)["range"], now * 0.9 - 0.005,
        now * 1.1 + 0.005,
          f"our own, pinned; {OBJECT}") for m, (then, now) in LOSSES.items()),
    Row("4.4", "decay from m = 8 to m = 16", "0.25", lambda: simplified(16)["range"] / simplified(8)["range"], 0.18, 0.3,
        "of second order: (8 / 16) squared, less what the gaps take"),
    Elsewhere("4.4", "decay with m", "0.63, 0.49, 0.35, 0.28", "within",
        "test_depthmap.py::test_loss_decays_with_m_as_in_the_paper"),
    Row("I-12", "spans dropped, m = 8, n = 60", "2", lambda: simplified(8)["dropped"], 110, 130,
        f"our own, pinned; {OBJECT}: six parts"),
    Row("I-12", "spans dropped, m = 4, n = 60", "29", lambda: simplified(4)["dropped"], 1000, 1120, "the same"),
    Elsewhere("I-12", "of a comb of 20 teeth 4 are left", "-", "16 dropped",
        "test_depthmap.py::test_a_comb_of_twenty_teeth_keeps_four_in_eight_points"),
    Row("I-18", "share lost at 45 degrees for want of rows", "8.5 %", lambda: corners_lost(True), 0.084, 0.088,
        "two triangles: 2 (sqrt(1/2) - 1/2)^2 = 0.0858"),
    Row("I-18", "share lost by the kernel, w rows of w samples", "8.5 %", covered_at_45, 0.165, 0.178,
        "3 - 2 sqrt 2 = 0.172: the prototype counted the rows alone, samples are lost as many again"),
    Elsewhere("I-18", "a plate loses its corners", "8.5 %", "17 %",
        "test_depthmap.py::test_a_plate_filling_the_map_loses_its_corners_at_45_degrees"),
    Elsewhere("5.3, P-05", "pixels that an oblique plane cuts otherwise than a test of every fragment", "0 of 7543 points", "0",
        f"{PLANAR}test_discard_and_oblique_are_exact_to_the_pixel_and_in_distance"),
    Elsewhere("5.2, P-01", "share of a mirror's pixels that a near plane loses, leaning by 0, 20, 45, 60 degrees", "-",
        "0.6, 2.7, 11.6, 19.9 %", f"{PLANAR}test_a_near_plane_loses_more_the_more_the_mirror_leans"),
    Elsewhere("5.4, P-06", "pictures of 1, 2, 3 mirrors over 3 mirrors", "1, 6, 21", "1, 6, 21",
        f"{PLANAR}test_there_are_as_many_pictures_as_sequences_of_mirrors"),
    Row("M-01", "exit status of flip-evaluator, HDR, two black pictures", "255", exit_code, 255, 255, "the library's"),
    Elsewhere("M-01", "we do not end", "-", "0",
        "test_metrics.py::test_two_black_images_have_no_error_and_do_not_end_the_process"),
    Row("M-02", "NaN in FLIP's map of a picture with one NaN", "0", lambda: np.isnan(with_a_hole()).sum(), 0, 0,
        "the library's"),
    Row("M-02", "mean of that map, 64 px", "0.0008", lambda: with_a_hole().mean(), 0.0003, 0.003,
        "one pixel and its surroundings over all: falls with the picture's size, 0.005 at 32 px, 0.0001 at 128"),
    Elsewhere("M-02", "we give no error", "-", "none",
        "test_metrics.py::test_a_pixel_that_is_no_colour_is_counted_and_no_error_is_given"),
    Row("M-03", "FLIP in a ring of 10 px around what differs, 67 ppd", "0.063", lambda: leaked()[0], 0.05, 0.1,
        "by how much it differs: 0.058 random, 0.065 negative, 0.093 black"),
    Row("M-03", "largest FLIP beyond 14 px", "about 10 px", lambda: leaked()[1], 0, 1e-3, "the filters end"),
    Elsewhere("M-03", "we mask pictures too", "-", "0",
        "test_metrics.py::test_what_is_off_the_mask_does_not_leak_through_the_filters"),
    Row("M-08", "how far a sphere scaled by (1, 0.6, 1.4) is from round", "0", scaled_sphere, 0, 1e-6,
        "it warns, and stays round"),
]  # fmt: skip
