"""Records of runs that never were, and what a comparison finds in them."""

from __future__ import annotations

from benchharness.tables import results

GOOD = dict(
    run="r",
    config="quick",
    scene="kitchen",
    detail="lean",
    method="secant",
    params="steps=8",
    status="ok",
    reflector_px=9000,
    prepare_ms=50.0,
    shade_ms=4.0,
    kernel_ms=3.0,
    frame_ms=9.0,
    rmse=0.02,
    relmse=0.01,
    flip=0.05,
    flip_p95=0.2,
    coverage=0.99,
    nonfinite_px=0,
    distance_err=0.01,
    residual_px=0.3,
    converged_ratio=0.97,
    wrong_ratio=0.01,
    iterations_mean=3.0,
    iterations_max=20,
    temporal_diff=0.004,
    jitter_px=0.2,
    reference_lighting="baked",
    reference_spp=64,
    reference_noise=0.0,
    config_hash="c1",
    method_hash="m1",
    scene_hash="s1",
    environment="e1",
    calibration_ms=10.0,
    ppd=67.0,
    counters="texel_reads=1000; steps=50",
)


def rows(frames: int = 3, **change) -> list[dict]:
    return [dict.fromkeys(results.COLUMNS) | GOOD | {"frame": frame} | change for frame in range(frames)]


def altered(path, column, text):
    """Writes a text into a column of all rows of a run's results.csv, whatever it may be."""
    header, *lines = (path / "results.csv").read_text().splitlines()
    place = header.split(",").index(column)
    cells = [line.split(",") for line in lines]
    for row in cells:
        row[place] = text
    (path / "results.csv").write_text("\n".join([header, *(",".join(row) for row in cells)]) + "\n")


def kinds(verdict) -> set[tuple[str, str]]:
    return {(finding.kind, finding.what) for finding in verdict.findings}
