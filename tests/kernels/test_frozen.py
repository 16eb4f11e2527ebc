"""Recorded functions and what is freed while they are recorded."""

from __future__ import annotations

import subprocess
import sys

CHILD = """
from benchharness import platform
platform.use_variant("llvm_ad_rgb")
import gc
import drjit as dr, mitsuba as mi
from benchharness.kernels.frozen import frozen

class Kept:
    def __init__(self):
        self.itself = self

def lose_a_scene():
    made = Kept()
    made.scene = mi.load_dict({"type": "scene", "ball": {"type": "sphere"}})
    rays = mi.Ray3f(mi.Point3f(dr.arange(mi.Float, 1000), 0, -3), mi.Vector3f(0, 0, 1))
    dr.eval(made.scene.ray_test(rays))

@frozen
def more(x):
    gc.set_threshold(1)
    kept = [Kept() for _ in range(100)]
    gc.set_threshold(700)
    return x + 1

@frozen
def failing(x):
    raise ValueError("on purpose")

gc.collect()
gc.set_threshold(100000)
lose_a_scene()
print(more(dr.arange(mi.Float, 3)))
assert gc.isenabled()
try:
    failing(mi.Float(1))
except RuntimeError:
    assert gc.isenabled()
gc.disable()
more(dr.arange(mi.Float, 5))
assert not gc.isenabled()
"""


def test_a_scene_that_is_lost_before_is_not_collected_while_a_function_is_recorded():
    """Dr.Jit ends the process then; the scene of a method that failed hangs on the cycle of its traceback."""
    done = subprocess.run([sys.executable, "-c", CHILD], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "[1, 2, 3]"
