"""Time: synchronise, warm up, repeat, and say how sure.

Dr.Jit is lazy and asynchronous: a call returns long before its work is done. Every clock here evaluates what it was given
and waits for the device on both sides.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

WARM_UP_CALLS = 6  # by then every kernel of a frame has been compiled, or never will be
BOOTSTRAP_DRAWS = 400
CLOSE_ENOUGH = 0.05  # half width of the median's interval, relative, at which more rounds are not worth it


def timed(work: Callable[[], Any]) -> tuple[Any, float]:
    """What `work` returns, evaluated, and the wall time in ms that it took."""
    dr.sync_thread()
    start = time.perf_counter()
    result = work()
    dr.eval(result)
    dr.sync_thread()
    return result, (time.perf_counter() - start) * 1e3


def kernels_of(work: Callable[[], Any]) -> list[dict]:
    """The kernel history of one call."""
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        dr.eval(work())
        dr.sync_thread()
        return dr.kernel_history()


def kernel_ms(history: Sequence[dict]) -> float:
    """Execution time alone: no tracing, no compiling, no waiting."""
    return float(sum(kernel["execution_time"] for kernel in history))


def warm_up(work: Callable[[], Any]) -> bool:
    """Calls `work` until all its kernels come out of the cache. False if they still did not after WARM_UP_CALLS."""
    return any(all(k["cache_hit"] for k in kernels_of(work) if k["type"] == dr.KernelType.JIT) for _ in range(WARM_UP_CALLS))


def median_interval(samples: Sequence[float]) -> tuple[float, float, float]:
    """Median and its 95 % bootstrap interval. Deterministic."""
    values = np.asarray(samples, np.float64)
    draws = np.random.default_rng(0).integers(0, len(values), (BOOTSTRAP_DRAWS, len(values)))
    medians = np.median(values[draws], axis=1)
    return float(np.median(values)), float(np.quantile(medians, 0.025)), float(np.quantile(medians, 0.975))


def settled(samples: Sequence[float]) -> bool:
    """Whether the median is known to CLOSE_ENOUGH."""
    median, low, high = median_interval(samples)
    return high - low <= 2 * CLOSE_ENOUGH * median


def calibration_ms() -> float:
    """Time of one fixed kernel, arithmetic and memory in equal parts: relates times of two machines."""
    n = 1 << 20
    lane = dr.arange(mi.UInt32, n)
    source = dr.opaque(mi.Float, 1.0, n)
    dr.eval(source)

    def work() -> mi.Float:
        x = dr.gather(mi.Float, source, (lane * 40503) & (n - 1))
        for _ in range(64):
            x = dr.fma(x, 0.999, 0.001) + dr.sqrt(dr.abs(x) + 1)
        return x

    timed(work)
    return timed(work)[1]
