"""The check of a scene's cameras: that they have a picture, and stand outside of every closed mirror."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from benchharness.modelling.winding import is_closed, winding_number
from benchharness.scene import Scene


def check_cameras(scene: Scene, frames: Iterable[int], where: str) -> None:
    """Raises ValueError if a camera has no direction, or stands inside a closed reflector, at any of the frames."""
    solids = []
    for reflector in scene.reflectors:
        solid = reflector.closed if reflector.closed is not None else reflector.mesh
        if reflector.closed is not None or is_closed(solid):
            solids.append((reflector, solid))
    for frame in frames:
        time = scene.time(frame)
        camera = scene.camera(time)
        eye = np.asarray(camera.eye, np.float64)
        with np.errstate(invalid="ignore", divide="ignore"):
            usable = bool(np.isfinite(camera.axes()).all()) and 0 < camera.fov_deg < 180
        if not usable:
            raise ValueError(
                f"{where}: the camera of frame {frame} (eye {_point(eye)}, target {_point(camera.target)}, "
                f"fov_deg {camera.fov_deg}) has no picture; accepted: a target away from the eye, not straight along "
                "`up`, and a field of view between 0 and 180 degrees"
            )
        for reflector, solid in solids:
            pose = reflector.pose(time)
            local = np.linalg.solve(pose, [*eye, 1.0])[:3]
            if abs(winding_number(solid, local)) > 0.5:
                raise ValueError(
                    f"{where}: the camera of frame {frame}, eye {_point(eye)}, is inside reflector {reflector.name!r}; "
                    "accepted: eyes outside every closed reflector (an open sheet has no inside)"
                )


def _point(values) -> str:
    return "[" + ", ".join(f"{float(v):g}" for v in values) + "]"
