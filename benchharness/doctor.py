"""What works on this machine: every variant, tried in a child process, since a wrong LLVM aborts and does not raise.

`python -m benchharness.doctor VARIANT` is the child: a Dr.Jit kernel of the kind that methods are made of (a symbolic
loop, `dr.maximum`, `dr.clip`: what some LLVM versions abort on) and a tiny picture (Embree or OptiX, and shading).
"""

from __future__ import annotations

import os
import platform as machine
import subprocess
import sys
from dataclasses import dataclass

from benchharness import platform, plugins

PROBED = ("llvm_ad_rgb", "cuda_ad_rgb", "scalar_rgb")
TIMEOUT_S = 180.0
SUM = 28.0
"""What the kernel adds up, see `_kernel`."""


@dataclass(frozen=True)
class Diagnosis:
    """What came of one probe. `mend` is what to do; None where nothing has to be done."""

    name: str
    works: bool
    seen: str
    mend: str | None = None


def examine() -> list[Diagnosis]:
    """All variants, then, if there is one to import them with, the plugins that do not load."""
    found = [_variant(name) for name in PROBED]
    working = [diagnosis.name for diagnosis in found if diagnosis.works]
    if not working:
        return found
    platform.use_variant(working[0])
    for kind in ("method", "scene"):
        for plugin in plugins.discover(kind).values():
            if plugin.error is not None:
                found.append(Diagnosis(f"{kind} {plugin.name}", False, plugin.error, f"mend {plugin.origin}"))
    return found


def usable(diagnoses: list[Diagnosis]) -> bool:
    """Whether the LLVM variant works, which every study can run on."""
    return any(d.works for d in diagnoses if d.name == "llvm_ad_rgb")


def _variant(name: str) -> Diagnosis:
    library = platform.use_llvm()
    command = [sys.executable, "-P", "-m", "benchharness.doctor", name]
    env = {**os.environ, "PYTHONPATH": os.pathsep.join(entry or os.getcwd() for entry in sys.path)}
    try:
        child = subprocess.run(command, capture_output=True, text=True, errors="replace", timeout=TIMEOUT_S, env=env)
    except subprocess.TimeoutExpired:
        return Diagnosis(name, False, f"no answer within {TIMEOUT_S:g} s", _mend(name, library))
    if child.returncode == 0:
        return Diagnosis(name, True, child.stdout.strip())
    lines = [line.strip() for line in (child.stdout + child.stderr).splitlines() if line.strip()]
    cause = f"signal {-child.returncode}" if child.returncode < 0 else f"exit code {child.returncode}"
    return Diagnosis(name, False, f"{cause}: {lines[-1] if lines else 'no word'}", _mend(name, library))


def _mend(name: str, library: str | None) -> str | None:
    """What to do about a variant that does not work; None for one that is not needed."""
    if name == "scalar_rgb":
        return "reinstall Mitsuba: pip install --force-reinstall mitsuba"
    if name == "cuda_ad_rgb":
        return None
    bundled = platform.bundled_llvm()
    if library is not None and (bundled is None or library != str(bundled)):
        return f"DRJIT_LIBLLVM_PATH names {library}; unset it, or name a libLLVM of version 19 or newer"
    if sys.platform == "linux" and machine.machine() == "x86_64":
        return "pip install --force-reinstall karellen-llvm-core"
    return "install LLVM 19 or newer, and set DRJIT_LIBLLVM_PATH to its libLLVM"


def probe(variant: str) -> str:
    """Runs in the child. Returns a sentence; whatever is wrong ends the process one way or another."""
    library = platform.use_llvm()
    platform.use_variant(variant)
    import mitsuba as mi
    import numpy as np

    total = SUM if variant == "scalar_rgb" else _kernel()
    if total != SUM:
        raise RuntimeError(f"the kernel returned {total} instead of {SUM}")
    picture = np.array(mi.render(mi.load_dict(_ball()), spp=64))
    # The sky has radiance 1. The ball, convex and of albedo 0.5, sends back half of what comes from the whole sky. A
    # sample of it scatters by 0.3, the mean of the 16 middle pixels by 0.3 / sqrt(16 * 64) = 0.01.
    sky, ball = picture[0, 0].mean(), picture[6:10, 6:10].mean()
    if not (abs(sky - 1.0) < 1e-3 and abs(ball - 0.5) < 0.05):
        raise RuntimeError(f"the picture shows sky {sky:.3f} and ball {ball:.3f} instead of 1 and 0.5")
    where = f", LLVM at {library or 'a place of the system'}" if variant.startswith("llvm") else ""
    return f"a kernel and a picture came out right (mitsuba {mi.__version__}{where})"


def _kernel() -> float:
    """Lanes 0 .. 7, each counted up in a loop from 0 to its own number, bounded on both sides: 0 + 1 + ... + 7 = 28."""
    import drjit as dr
    import mitsuba as mi

    goal = dr.arange(mi.Float, 8)
    start = dr.clip(dr.maximum(-goal, -1.0), 0.0, 1.0)
    count, _ = dr.while_loop((start, goal), lambda i, goal: i < goal, lambda i, goal: (i + 1.0, goal), label="doctor's loop")
    return float(dr.sum(count)[0])


def _ball() -> dict:
    return {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": 2},
        "sensor": {
            "type": "perspective",
            "fov": 45,
            "film": {"type": "hdrfilm", "width": 16, "height": 16, "rfilter": {"type": "box"}},
            "to_world": _looking_down_z(),
        },
        "sky": {"type": "constant", "radiance": 1.0},
        "ball": {"type": "sphere", "bsdf": {"type": "diffuse", "reflectance": 0.5}},
    }


def _looking_down_z():
    import mitsuba as mi

    return mi.ScalarTransform4f().look_at(origin=[0, 0, 4], target=[0, 0, 0], up=[0, 1, 0])


if __name__ == "__main__":
    try:
        print(probe(sys.argv[1]))
    except Exception as error:
        print(error.__cause__ or error, file=sys.stderr)
        sys.exit(1)
