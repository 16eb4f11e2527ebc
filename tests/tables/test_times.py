"""The gate on times, on made-up machines whose noise is known: unchanged code passes, a slower kernel is found."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from benchharness.tables import times

METHODS, FRAMES, RUNS = 8, 2, 10


def machine(rng, slower: float = 1.0, own: float = 0.02, shared: float = 0.1, heavy: bool = False, changed: int | None = 0):
    """Two sides of RUNS runs of METHODS methods, made in turns; in the new side, method `changed` takes `slower` as long.

    own, shared  standard deviations, of the log, of one method's noise between runs and of what all methods share
    heavy        whether both have far more outliers than a normal distribution (Student's t with 3 degrees of freedom)
    """
    draw = (lambda n: rng.standard_t(3, n) / np.sqrt(3)) if heavy else rng.standard_normal
    sides = [], []
    load = 0.0
    for number in range(RUNS):
        for side in (0, 1) if number % 2 == 0 else (1, 0):
            load = 0.7 * load + shared * float(draw(1)[0])
            noise = own * draw(METHODS)
            run = {}
            for method, frame in itertools.product(range(METHODS), range(FRAMES)):
                ms = (1.0 + method) * np.exp(load + noise[method]) * (slower if side and method == changed else 1.0)
                run[("s", "", frame, f"m{method}", "")] = {
                    "prepare_ms": 20.0,
                    "update_ms": 0.01,
                    "shade_ms": ms,
                    "calibration_ms": 10.0,
                    "environment": "e",
                    "method_hash": f"h{method}{side if method == changed else ''}",
                }
            sides[side].append(run)
    return sides


def judged(sides) -> times.Times:
    return times.judge(*sides, list(sides[0][0]))


def alarms(found: times.Times) -> list[str]:
    return [pace.method for pace in found.paces if pace.verdict == "slow"]


@pytest.mark.parametrize("heavy", [False, True])
@pytest.mark.parametrize("changed", [None, 0])
def test_unchanged_code_is_not_slower_on_a_machine_that_is_not_quiet(heavy, changed):
    rng = np.random.default_rng(1)
    false = [alarms(judged(machine(rng, own=0.04, shared=0.3, heavy=heavy, changed=changed))) for _ in range(60)]
    assert not any(false), false


def test_a_kernel_that_is_a_tenth_slower_is_found_and_alone():
    rng = np.random.default_rng(2)
    found = [alarms(judged(machine(rng, slower=1.1))) for _ in range(40)]
    assert sum("m0" in methods for methods in found) >= 39
    assert all(methods in ([], ["m0"]) for methods in found)


def test_a_kernel_that_is_a_tenth_faster_is_told():
    (pace,) = [
        p for p in judged(machine(np.random.default_rng(3), slower=1 / 1.1)).paces if p.method == "m0" and p.clock == "shade"
    ]
    assert pace.verdict == "fast" and pace.ratio == pytest.approx(1 / 1.1, rel=0.04)
    assert pace.low is not None and pace.high is not None and pace.low < pace.ratio < pace.high


def test_drift_that_unchanged_methods_share_is_subtracted_and_said():
    base, new = machine(np.random.default_rng(4), own=0.005, shared=0.0)
    for run in new:
        for record in run.values():
            record["shade_ms"] *= 1.3
    found = judged((base, new))
    assert {pace.verdict for pace in found.paces} == {"same"}
    assert found.drift["shade"] == pytest.approx(1.3, rel=0.02)


def test_drift_of_the_machine_is_no_alarm_where_every_method_changed():
    base, new = machine(np.random.default_rng(5), own=0.005, shared=0.1)
    for run in new:
        for record in run.values():
            record["method_hash"] += "x"
    found = judged((base, new))
    assert "shade" not in found.drift and not alarms(found)
    assert "ambiguous" in {pace.verdict for pace in found.paces}


def test_a_slowdown_within_the_margin_is_no_alarm():
    sides = machine(np.random.default_rng(6), slower=1.015, own=0.001, shared=0.0)
    assert not alarms(judged(sides))


def test_noise_that_cannot_tell_is_ambiguous():
    sides = machine(np.random.default_rng(7), slower=1.1, own=0.3)
    (pace,) = [p for p in judged(sides).paces if (p.method, p.clock) == ("m0", "shade")]
    assert pace.verdict == "ambiguous" and pace.p is not None and pace.p > times.ALPHA


def test_runs_that_are_equal_to_the_last_bit_prove_no_small_difference():
    base, new = machine(np.random.default_rng(8), own=0.0, shared=0.0, slower=1.021)
    assert not alarms(judged((base, new)))


def test_the_number_of_tests_is_corrected_for():
    base, new = machine(np.random.default_rng(9), slower=1.06, own=0.02, shared=0.0)
    alone = [key for key in base[0] if key[3] == "m0"]
    (one,) = [pace for pace in times.judge(base, new, alone).paces if pace.clock == "shade"]
    (among,) = [pace for pace in judged((base, new)).paces if (pace.method, pace.clock) == ("m0", "shade")]
    assert one.p is not None and among.p is not None and among.p > one.p


def test_times_of_a_launch_and_times_that_a_run_lacks_are_not_compared():
    base, new = machine(np.random.default_rng(10))
    assert "update" not in {pace.clock for pace in judged((base, new)).paces}
    for record in new[3].values():
        record["prepare_ms"] = None
    assert "prepare" not in {pace.clock for pace in judged((base, new)).paces}


def test_nothing_to_compare_is_no_alarm():
    found = times.judge([{}], [{}], [])
    assert found.paces == () and found.unproven is not None


def test_what_does_not_follow_the_drift_does_not_take_on_its_noise():
    """A kernel that computes among others that wait for memory, which is what runs differ in."""
    rng = np.random.default_rng(11)
    found = []
    for _ in range(20):
        base, new = machine(rng, slower=1.1, own=0.02, shared=0.15)
        for number, run in enumerate((*base, *new)):
            for key, record in run.items():
                if key[3] == "m0":
                    record["shade_ms"] = (1.1 if number >= RUNS else 1.0) * np.exp(0.03 * rng.standard_normal())
        found.append(alarms(judged((base, new))))
    assert sum("m0" in methods for methods in found) >= 18
    assert all(methods in ([], ["m0"]) for methods in found)


def interrupted(rng, ms: float) -> list[float]:
    """Fifteen rounds of a kernel, beside somebody who takes a core away from most of them, and in some runs from nearly all."""
    busy = rng.choice([0.1, 0.4, 0.7])
    return [
        ms * (1 + 0.02 * abs(rng.standard_normal())) * (rng.uniform(1.5, 3.5) if rng.random() < busy else 1.0)
        for _ in range(15)
    ]


def test_rounds_that_are_interrupted_hide_no_slower_kernel_and_are_none():
    rng = np.random.default_rng(12)
    by_rounds, by_medians, false = 0, 0, 0
    for number in range(30):
        slower = 1.1 if number < 20 else 1.0
        sides = machine(rng, own=0.01, shared=0.02)
        rounds = []
        for place, run in enumerate(itertools.chain(*sides)):
            taken = {}
            for key, record in run.items():
                ms = record["shade_ms"] * (slower if place >= RUNS and key[3] == "m0" else 1.0)
                taken[*key, "shade"] = interrupted(rng, ms)
                record["shade_ms"] = float(np.median(taken[*key, "shade"]))
            rounds.append(taken)
        found = alarms(times.judge(*sides, list(sides[0][0]), rounds))
        if slower > 1:
            by_rounds += found == ["m0"]
            by_medians += alarms(judged(sides)) == ["m0"]
        else:
            false += bool(found)
    assert (by_rounds >= 18, by_medians < 5, false) == (True, True, 0), (by_rounds, by_medians)
