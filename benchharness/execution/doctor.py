"""What works on this machine: every variant, tried in a child process, since a wrong LLVM aborts and does not raise; a
method; the cache; the lock under which is timed; and every plugin.

`python -m benchharness.execution.doctor VARIANT` is the child: a Dr.Jit kernel of the kind that methods are made of (a symbolic
loop, `dr.maximum`, `dr.clip`: what some LLVM versions abort on) and a tiny picture (Embree or OptiX, and shading).
"""

from __future__ import annotations

import os
import platform as machine
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from benchharness import cache, platform, processes
from benchharness.execution import check
from benchharness.study import plugins, template
from benchharness.study.apart import Apart

PROBED = ("llvm_ad_rgb", "cuda_ad_rgb", "scalar_rgb")
NEEDED = ("method", "cache", "lock")
"""What every study needs beside a variant."""
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
    """All variants, a method, cache and lock, then, if there is a variant to import them with, the plugins that do not load."""
    found = [_variant(name) for name in PROBED]
    if usable(found):
        found.append(_method())
    found += [_cache(), _lock()]
    if any(diagnosis.works for diagnosis in found[: len(PROBED)]):
        found += _broken_plugins()
    return found


def usable(diagnoses: list[Diagnosis]) -> bool:
    """Whether a study can run: on the LLVM variant, which every one can run on, with a method, a cache and a lock."""
    needed = {d.name: d.works for d in diagnoses if d.name in ("llvm_ad_rgb", *NEEDED)}
    return all(needed.values()) and needed.get("llvm_ad_rgb", False)


def _method() -> Diagnosis:
    """What `new-method` writes, put through `check-method`."""
    with tempfile.TemporaryDirectory() as folder:
        path = template.new_method("doctors_method", Path(folder))
        bad = [finding.text for finding in check.check(str(path)) if finding.level == "fail"]
    if bad:
        mend = f"see whether LLVM at {platform.use_llvm() or 'a place of the system'} is of version 19 or newer"
        return Diagnosis("method", False, f"a method of the simplest kind fails: {'; '.join(bad)}", mend)
    return Diagnosis("method", True, "a method of the simplest kind keeps its contract")


def _cache() -> Diagnosis:
    folder = cache.cache_folder()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=folder) as file:
            file.write(bytes(4096))
            file.flush()
            os.fsync(file.fileno())
    except OSError as error:
        mend = "make room there, or set BENCHHARNESS_CACHE to a folder that can be written"
        return Diagnosis("cache", False, f"{folder} cannot be written: {error}", mend)
    return Diagnosis("cache", True, f"{folder} can be written")


class _Held(Exception):
    pass


def _lock() -> Diagnosis:
    def held(text: str) -> None:
        raise _Held

    try:
        with platform.alone(held):
            return Diagnosis("lock", True, "nobody else is timing on this machine")
    except _Held:
        return Diagnosis("lock", True, "another run is timing on this machine")
    except (OSError, ValueError, platform.EnvironmentBroken) as error:
        return Diagnosis("lock", False, str(error), "let the lock's file be a plain one that you can write")


def _broken_plugins() -> Iterator[Diagnosis]:
    with Apart() as apart:
        for kind in ("method", "scene"):
            for name, site in plugins.sites(kind).items():
                try:
                    apart.call("benchharness.study.loading:describe", name, kind=kind, name=name)
                except ValueError as error:
                    yield Diagnosis(f"{kind} {name}", False, str(error).removeprefix(f"{name}: "), f"mend {site.origin}")


def _variant(name: str) -> Diagnosis:
    library = platform.use_llvm()
    with tempfile.TemporaryDirectory(prefix="benchharness-") as folder:
        child = processes.Child("benchharness.execution.doctor", name, str(os.getpid()), log=Path(folder) / "log")
        try:
            works, seen = _heard(child)
        finally:
            child.end()
    return Diagnosis(name, works, seen, None if works else _mend(name, library))


def _heard(child: processes.Child) -> tuple[bool, str]:
    """Whether a variant works, and what was seen of it. A child that ends without a word, with code 0 too, says that it does
    not; so does one that ends otherwise after its word."""
    said, deadline = {}, time.monotonic() + TIMEOUT_S
    try:
        while (line := child.next(deadline - time.monotonic())) is not None:
            said |= line
    except TimeoutError:
        return False, f"no answer within {TIMEOUT_S:g} s"
    except ValueError as error:
        return False, str(error)
    cause = child.cause()
    if cause == "exit code 0" and "works" in said:
        return True, str(said["works"])
    return False, f"{cause}: {said.get('fails') or child.words() or 'no word'}"


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


def main(variant: str, parent: int) -> None:
    """In the child: one line, {"works": ...} or {"fails": ...}."""
    say = processes.channel()
    processes.end_with_parent(parent)
    try:
        say({"works": probe(variant)})
    except Exception as error:  # whatever Dr.Jit and Mitsuba may raise
        say({"fails": str(error.__cause__ or error)})
        sys.exit(1)


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
