"""Clocks: what they wait for, when they are sure, when a kernel is warm."""

from __future__ import annotations

import time

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from benchharness.measure import timing


def heavy(steps: int = 3000, lanes: int = 1 << 16):
    """A tenth of a second of work that a call only orders."""
    x = dr.opaque(mi.Float, 0.3, lanes)
    i = dr.zeros(mi.UInt32, lanes)

    def step(x, i):
        return dr.sin(x) + dr.sqrt(dr.abs(x)), i + 1

    x, _ = dr.while_loop((x, i), lambda x, i: i < dr.opaque(mi.UInt32, steps), step, label="heavy")
    return x


def test_a_clock_waits_for_the_device():
    timing.timed(heavy)  # compiled
    dr.sync_thread()
    start = time.perf_counter()
    result = heavy()
    dr.schedule(result)
    ordered_ms = (time.perf_counter() - start) * 1e3  # what a clock that does not evaluate would say
    dr.eval(result)
    dr.sync_thread()
    result, ms = timing.timed(heavy)
    start = time.perf_counter()
    dr.sync_thread()
    left_ms = (time.perf_counter() - start) * 1e3
    assert ms > 5 * ordered_ms
    assert left_ms < 0.1 * ms
    assert dr.width(result) == 1 << 16


def test_a_clock_does_not_count_what_was_ordered_before():
    whole = timing.timed(heavy)[1]
    pending = heavy()
    dr.eval(pending)  # running
    assert timing.timed(lambda: mi.Float(1.0) + 1)[1] < 0.5 * whole


def test_median_and_interval_by_hand():
    # All alike: no doubt. An odd number of values: the middle one.
    assert timing.median_interval([3.0] * 7) == (3.0, 3.0, 3.0)
    median, low, high = timing.median_interval([1.0, 100.0, 2.0])
    assert median == 2.0
    assert low == 1.0 and high == 100.0  # of three, each is the median of more than 2.5 % of the draws (7 of 27)
    assert timing.median_interval([4.0]) == (4.0, 4.0, 4.0)


def test_the_interval_is_the_same_each_time_and_shrinks_as_the_root_of_the_number():
    rng = np.random.default_rng(0)
    widths = []
    for n in (25, 100, 400, 1600):
        samples = rng.normal(10, 1, n)
        median, low, high = timing.median_interval(samples)
        assert timing.median_interval(samples) == (median, low, high)
        assert low <= median <= high
        widths.append(high - low)
    order = np.polyfit(np.log([25, 100, 400, 1600]), np.log(widths), 1)[0]
    assert -0.7 < order < -0.3
    # For a normal distribution the median's standard error is sqrt(π/2) σ / √n: 2 · 1.96 · 1.2533 / 40 = 0.123.
    assert widths[-1] == pytest.approx(0.123, rel=0.25)


def test_settled_is_an_interval_within_five_percent_of_the_median():
    assert timing.settled([1.0] * 5)
    assert timing.settled([1.0, 1.02, 0.98, 1.01, 0.99] * 4)
    assert not timing.settled([1.0, 1.5, 0.5, 1.2, 0.8])
    # Just at the border: three values, whose interval is all of them.
    assert timing.settled([0.951, 1.0, 1.049]) and not timing.settled([0.949, 1.0, 1.051])


def test_warm_up_ends_when_every_kernel_comes_from_the_cache():
    calls = []

    def work():
        calls.append(0)
        return dr.sqrt(dr.opaque(mi.Float, 2.0, 1000) + 0.7180339)

    assert timing.warm_up(work)
    assert len(calls) <= 2
    assert all(k["cache_hit"] for k in timing.kernels_of(work) if k["type"] == dr.KernelType.JIT)


def test_warm_up_gives_up_on_a_kernel_that_is_new_every_time():
    calls, seed = [], time.time_ns() % 1_000_000  # unlike any kernel of an earlier run, which would be cached on disk

    def work():
        calls.append(0)
        return dr.sqrt(dr.opaque(mi.Float, 2.0, 10) + (seed + len(calls) / 16))

    assert not timing.warm_up(work)
    assert len(calls) == timing.WARM_UP_CALLS


def test_kernel_time_is_that_of_execution_alone():
    timing.timed(heavy)

    def slow_to_order():
        time.sleep(0.2)
        return heavy()

    began = time.perf_counter()
    history = timing.kernels_of(slow_to_order)
    whole_ms = 1e3 * (time.perf_counter() - began)
    assert any(k["type"] == dr.KernelType.JIT for k in history)
    assert 0 < timing.kernel_ms(history) < whole_ms - 150
    assert timing.kernel_ms([{"execution_time": 1.5}, {"execution_time": 2.0}]) == 3.5
    assert not dr.flag(dr.JitFlag.KernelHistory)


def test_the_calibration_kernel_takes_time():
    assert 0.1 < timing.calibration_ms() < 5000
