"""Records of a run as the report reads them, made up."""

from __future__ import annotations

from benchharness.tables import results


def record(method="box", params="", frame: int | None = 0, time=8.0, flip: float | None = 0.1, **values) -> dict:
    """A row that is ok, of a method that takes `time` ms a frame."""
    base = dict.fromkeys(results.COLUMNS)
    base.update(run="r", config="quick", scene="kitchen", detail="lean", frame=frame, method=method, params=params)
    base.update(status="ok", reflector_px=500, gbuffer_ms=1.0, update_ms=0.5, shade_ms=time - 2, frame_ms=time)
    base.update(flip=flip, shade_ms_lo=time - 2.1, shade_ms_hi=time - 1.7, prepare_ms=30.0, rmse=0.02)
    base.update(reference_noise=0.0, config_hash="c1", method_hash=f"h-{method}", scene_hash="s1", calibration_ms=9.0)
    return base | values


def swept(method, name, values, times, flips, frames=(0, 5)) -> list[dict]:
    """A method through values of a parameter; errors grow by a fifth from frame to frame."""
    return [
        record(method, f"{name}={v}", f, t, e * (1 + 0.2 * i))
        for v, t, e in zip(values, times, flips, strict=True)
        for i, f in enumerate(frames)
    ]


def families() -> list[dict]:
    """Two families, a method without one, and a method that is two curves."""
    kinds = {"newton": "vertices", "search": "vertices", "box": "maps", "mine": ""}
    rows = [record(name, time=5.0 + i, flip=0.1 + 0.01 * i, family=kind) for i, (name, kind) in enumerate(kinds.items())]
    return rows + [record("sweep", f"rule={rule}; n={n}", time=n, family="maps") for rule in ("a", "b") for n in (4, 9)]
