"""The bench on a small scene: columns, statuses, and numbers that depend on nothing but the frame and the method."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from PIL import Image
from support.mirror_room import mirror_ball, orbit, scene, still, walls
from support.small_room import quad
from support.tiers import every

from benchharness.api import Method, Reflection
from benchharness.measure import metrics, points, runup
from benchharness.measure.bench import Bench
from benchharness.measure.points import converged_share
from benchharness.measure.rounds import KERNEL_ROUNDS
from benchharness.render.reference import ReferenceOptions
from benchharness.scene import Object, Reflector, Scene
from benchharness.tables import naming, parameters, results, summary
from methods.environment_map import EnvironmentMap
from methods.image_space_search import ImageSpaceSearch
from methods.ray_traced import RayTraced

SIZE = (64, 48)
CLOCKS = "prepare_ms update_ms shade_ms shade_ms_lo shade_ms_hi kernel_ms first_ms gbuffer_ms frame_ms".split()
ERRORS = "rmse relmse flip flip_p95 coverage distance_err".split()
VERTICES = "residual_px converged_ratio wrong_ratio iterations_mean iterations_max jitter_px".split()


@pytest.fixture(scope="module", autouse=True)
def few_samples():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(points, "SAMPLE", 50)  # the true points take most of the time
        yield


def glowing(thing: Object) -> Object:
    """Black but for the light that it emits, which is then all that baking finds."""
    return replace(thing, mesh=replace(thing.mesh, albedo=np.zeros(3), emission=thing.mesh.radiance, radiance=None))


def room(camera=None, mirror: Reflector | None = None, **more) -> Scene:
    """Walls of given light, a mirror ball."""
    mirror = mirror or mirror_ball(fine=48)
    return scene((glowing(walls(h=0.5)),), (mirror,), camera or orbit(1.0), frames=4, **more)


def bench(made: Scene, out=None) -> Bench:
    return Bench(made, SIZE, ReferenceOptions(bake_spp=1, spp=2), out, seed=0, rounds=(2, 2))


def measured(made: Scene, methods: dict[str, Method], *frames: int, out=None, heard: list | None = None):
    """{(frame, entry): record}, samples of the last frame."""
    its, records, samples = bench(made, out), {}, []
    for index in frames:
        found, samples = its.run_frame(index, methods, (heard if heard is not None else []).append)
        records |= {(index, record["entry"]): record for record in found}
    return records, samples


def numbers(record: dict) -> dict:
    """A record without its times."""
    return {name: value for name, value in record.items() if name not in CLOCKS and name != "calibration_ms"}


def pixels_of(path) -> np.ndarray:
    with Image.open(path) as picture:
        return np.asarray(picture, float)


@dataclass(frozen=True)
class Constant(Method):
    """Shows `L` everywhere; what it does wrong is `fault`."""

    L: float = 0.5
    fault: str = ""

    paper: ClassVar[str] = "none"

    def prepare(self, scene: Scene) -> Any:
        if self.fault == "prepare":
            raise RuntimeError("no room")
        if self.fault == "scene":
            scene.reflectors[0].mesh.vertices[:] = 0
        return dr.opaque(mi.Float, self.L)

    def update(self, state, frame):
        if self.fault == "update":
            raise KeyError("moved")
        return state

    def shade(self, state, frame):
        if self.fault == "shade":
            raise ValueError("no root")
        count = frame.view.width * frame.view.height
        L = dr.zeros(mi.Color3f, count) + state
        if self.fault == "memory":
            L, state = L + 0.1 * state, state + 1
        distance = dr.full(mi.Float, dr.nan if self.fault == "distance" else 1.0, 7 if self.fault == "lanes" else count)
        if self.fault == "nan":
            L = dr.select(dr.arange(mi.UInt32, count) % 2 == 0, L, dr.nan)
        if self.fault == "exit":
            raise SystemExit(0)
        if self.fault == "speechless":
            raise Speechless
        if self.fault == "memory of the frame":
            frame.n.x.numpy()[:] = 0
        found = frame.active & (dr.arange(mi.UInt32, count) % 2 == 0) if self.fault == "half" else frame.active
        if self.fault == "half":
            distance = dr.select(found, distance, 100.0)
        if self.fault == "litter":  # in lanes without a mirror, a signalling NaN
            distance = dr.select(frame.active, distance, dr.reinterpret_array(mi.Float, dr.full(mi.UInt32, 0x7F800001, count)))
        answer = Reflection(L, distance, found, counters={"looks": mi.UInt32(frame.active)})
        wrong = {
            "counters": {"counters": None},
            "counter": {"counters": {"looks": 10**40}},
            "found": {"found": mi.Float(found)},
            "vertices": {"vertices": "all"},
        }
        answer = replace(answer, **wrong.get(self.fault, {}))
        return None if self.fault == "nothing" else (answer, state)  # type: ignore[return-value]


class Speechless(Exception):
    def __str__(self) -> str:
        raise RuntimeError("not even that")


@dataclass(frozen=True)
class Vandal(Method):
    """Shows what traced rays show, and writes into its frame."""

    paper: ClassVar[str] = "none"

    def prepare(self, scene: Scene) -> Any:
        return RayTraced().prepare(scene)

    def update(self, state, frame):
        state = RayTraced().update(state, frame)
        frame.poses *= 2
        frame.surfaces.clear()
        return state

    def shade(self, state, frame):
        answer = RayTraced().shade(state, frame)
        dr.scatter(frame.n.x, mi.Float(3), dr.arange(mi.UInt32, 50))
        frame.p += 1
        dr.scatter(frame.active, ~frame.active, dr.arange(mi.UInt32, dr.width(frame.active)))
        frame.boxes[0] = (0, 0, 1, 1)
        frame.view.eye.x += 1
        return answer


@dataclass(frozen=True)
class Keeping(Method):
    """Traced rays, kept by the number of the frame; `asked`: the frames that shade was given, index and eye."""

    paper: ClassVar[str] = "none"
    keeps: bool = True
    asked: ClassVar[list[tuple[int, float]]] = []

    def prepare(self, scene: Scene) -> Any:
        return RayTraced().prepare(scene), {}

    def update(self, state, frame):
        return RayTraced().update(state[0], frame), state[1]

    def shade(self, state, frame):
        self.asked.append((frame.index, float(frame.view.eye.x[0])))
        inner, kept = state
        if frame.index not in kept or not self.keeps:
            kept[frame.index] = RayTraced().shade(inner, frame)[0]
        return kept[frame.index], state


@pytest.fixture(scope="module")
def three():
    methods = {"ray_traced": RayTraced(), "image_space_search": ImageSpaceSearch(), "environment_map res": EnvironmentMap(32)}
    return measured(room(), methods, 3)


def test_a_record_has_the_columns_of_the_table_and_numbers_that_make_sense(three, tmp_path):
    records, samples = three
    for (_, entry), record in records.items():
        assert record["status"] == "ok" and "reason" not in record
        assert set(record) - {"entry"} <= set(results.COLUMNS)
        assert set(CLOCKS) | set(ERRORS) | {"temporal_diff", "nonfinite_px", "reflector_px", "counters"} <= set(record)
        assert all(record[name] > 0 for name in set(CLOCKS) - {"update_ms"}), record
        assert record["shade_ms_lo"] <= record["shade_ms"] <= record["shade_ms_hi"]
        # Nothing moves: a frame is G-buffer, shading and composite, without an update.
        assert record["frame_ms"] >= record["gbuffer_ms"] + record["shade_ms"]
        assert record["reference_noise"] == 0 and record["reference_spp"] == 2 and record["nonfinite_px"] == 0
        assert (set(VERTICES) <= set(record)) == (entry == "image_space_search")
    exact, search, map_ = (records[3, entry] for entry in ("ray_traced", "image_space_search", "environment_map res"))
    assert exact["flip"] < search["flip"] < map_["flip"]
    assert exact["rmse"] < search["rmse"] < map_["rmse"]
    assert exact["distance_err"] < 1e-4 and search["distance_err"] < 0.05
    assert exact["coverage"] == map_["coverage"] == 1
    assert search["residual_px"] < 0.2 and search["wrong_ratio"] < 0.01 and search["converged_ratio"] > 0.8
    assert search["iterations_mean"] < 3 and search["jitter_px"] < 0.2
    assert parameters.parse_params(exact["counters"]) == {"rays": exact["reflector_px"]}
    # They are what the table takes.
    rows = [record | {"scene": "a", "detail": "", "frame": 3, "method": entry, "params": ""} for (_, entry), record in
            records.items()]  # fmt: skip
    for row in rows:
        del row["entry"]
    results.write(tmp_path / "rows.csv", rows)

    clocks = {(sample["entry"], sample["clock"]) for sample in samples}
    assert {("", "gbuffer"), ("", "composite"), ("", "calibration")} <= clocks
    assert {("ray_traced", clock) for clock in ("update", "shade", "kernel")} <= clocks
    shade = [s["ms"] for s in samples if (s["entry"], s["clock"]) == ("ray_traced", "shade")]
    assert np.median(shade) == exact["shade_ms"]
    assert [s["round"] for s in samples if (s["entry"], s["clock"]) == ("ray_traced", "shade")] == list(range(len(shade)))


def test_errors_and_counts_do_not_depend_on_frames_and_methods_that_ran_before(three):
    alone, _ = measured(room(), {"image_space_search": ImageSpaceSearch()}, 0, 2, 3)
    assert numbers(alone[3, "image_space_search"]) == numbers(three[0][3, "image_space_search"])
    assert numbers(alone[2, "image_space_search"]) != numbers(alone[3, "image_space_search"])
    rays, _ = measured(room(), {"ray_traced": RayTraced()}, 1, 3)
    assert numbers(rays[3, "ray_traced"]) == numbers(three[0][3, "ray_traced"])


def test_a_frame_is_always_the_third_that_a_method_sees():
    # Its picture grows brighter by what it has seen; what the third sees is 1.1 times 0.5 + 2.
    records, _ = measured(room(), {"memory": Constant(fault="memory")}, 1, 2, 3)
    alone, _ = measured(room(), {"memory": Constant(fault="memory")}, 3)
    constant, _ = measured(room(), {"plain": Constant(L=2.75)}, 3)
    assert numbers(records[3, "memory"]) == numbers(alone[3, "memory"])
    assert alone[3, "memory"]["rmse"] == pytest.approx(constant[3, "plain"]["rmse"], rel=1e-5)


@pytest.mark.exhaustive
def test_with_a_mirror_and_a_thing_that_move_too():
    def shift(time):
        pose = np.eye(4)
        pose[:3, 3] = [time, 0.5 * time, 0.0]
        return pose

    made = room(mirror=mirror_ball(fine=48, motion=shift), camera=still())
    methods = {"ray_traced": RayTraced(), "search": ImageSpaceSearch(), "map": EnvironmentMap(32)}
    together, _ = measured(made, methods, 0, 3)
    for name, method in methods.items():
        alone, _ = measured(made, {name: method}, 3)
        assert numbers(alone[3, name]) == numbers(together[3, name])
        assert alone[3, name]["frame_ms"] > alone[3, name]["shade_ms"]
    # Measured against the reference of its own time: the traced ray meets what it should.
    assert together[3, "ray_traced"]["distance_err"] < 1e-4
    assert together[3, "search"]["residual_px"] < 0.2


def test_pictures_are_written_and_come_out_the_same_twice(tmp_path):
    methods = {"image_space_search widening=1.5": ImageSpaceSearch(widening=1.5)}
    runs = [measured(room(), methods, 1, out=tmp_path / name)[0] for name in ("one", "two")]
    assert numbers(runs[0][1, next(iter(methods))]) == numbers(runs[1][1, next(iter(methods))])
    names = [
        naming.image_name("mirror_room", "lean", 1, "reference"),
        naming.image_name("mirror_room", "lean", 1, "image", "image_space_search", "widening=1.5"),
        naming.image_name("mirror_room", "lean", 1, "error", "image_space_search", "widening=1.5"),
    ]
    assert sorted(p.name for p in (tmp_path / "one").iterdir()) == sorted(names)
    for name in names:
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "two" / name).read_bytes()
    reference, image, error = (pixels_of(tmp_path / "one" / name) for name in names)
    assert reference.shape == image.shape == error.shape == (SIZE[1], SIZE[0], 3)
    assert np.abs(reference - image).mean() < 3
    none = metrics.error_picture(np.zeros((1, 1)))[0, 0]
    assert (error != none).any() and (error[0] == none).all()  # the ball does not reach the first row


@pytest.mark.parametrize(
    ("fault", "reason"),
    every(
        3,
        [
            ("prepare", "RuntimeError: no room"),
            ("update", "KeyError: 'moved'"),
            ("shade", "ValueError: no root"),
            ("lanes", "ValueError: distance has 7 lanes; accepted: 3072, one per pixel"),
            ("scene", "ValueError: assignment destination is read-only"),
            ("counters", "TypeError: counters is None; accepted: a dict, name -> UInt32"),
            ("counter", "TypeError: counter looks is int; accepted: UInt32"),
            ("found", "TypeError: found is Float; accepted: Bool"),
            ("vertices", "TypeError: vertices is str; accepted: Vertices, or None"),
            ("nothing", "TypeError: shade returns None; accepted: a Reflection and the next state"),
            ("exit", "SystemExit: 0"),
            ("speechless", "Speechless: it cannot say why (RuntimeError)"),
        ],
    ),
)
def test_a_method_that_raises_is_a_crashed_record_and_the_others_are_measured(fault, reason, capfd, tmp_path):
    heard = []
    methods = {"bad": Constant(fault=fault), "good": Constant()}
    records, _ = measured(room(), methods, 2, 3, out=tmp_path, heard=heard)
    for index in (2, 3):
        assert records[index, "bad"]["status"] == "crashed"
        assert records[index, "bad"]["reason"] == reason
        assert "shade_ms" not in records[index, "bad"] and "flip" not in records[index, "bad"]
        assert records[index, "good"]["status"] == "ok"
    assert reason.partition(":")[0] in capfd.readouterr().err  # the traceback is in the log
    assert {"bad", "good", ""} == set(heard)
    assert heard[-1] == ""


def test_what_a_method_writes_into_its_frame_changes_nothing_for_the_others(tmp_path):
    methods = {"vandal": Vandal(), "ray_traced": RayTraced(), "search": ImageSpaceSearch()}
    together, _ = measured(room(), methods, 2, 3)
    alone, _ = measured(room(), {name: methods[name] for name in ("ray_traced", "search")}, 2, 3)
    for key, record in alone.items():
        assert numbers(together[key]) == numbers(record)
    assert together[3, "vandal"]["flip"] == alone[3, "ray_traced"]["flip"]


def test_memory_that_a_method_wrote_to_is_made_anew_for_the_others():
    records, _ = measured(room(), {"bad": Constant(fault="memory of the frame"), "ray_traced": RayTraced()}, 2)
    assert records[2, "bad"]["status"] == "crashed"
    assert records[2, "bad"]["reason"] == "it writes into memory that all methods are lent: n of the frame"
    alone, _ = measured(room(), {"ray_traced": RayTraced()}, 2)
    assert numbers(records[2, "ray_traced"]) == numbers(alone[2, "ray_traced"])


def test_an_answer_that_is_kept_by_number_is_invalid_and_one_that_is_made_anew_is_not():
    Keeping.asked.clear()
    records, _ = measured(room(), {"kept": Keeping(), "anew": Keeping(keeps=False)}, 3)
    kept, anew = records[3, "kept"], records[3, "anew"]
    assert anew["status"] == "ok" and kept["status"] == "invalid"
    assert kept["reason"].startswith("cameras a pixel aside are shown the same picture")
    assert kept["flip"] == anew["flip"]  # errors and counters are those of the frame itself
    assert {index for index, _ in Keeping.asked} == {1, 2, 3}


def test_no_camera_is_timed_twice():
    Keeping.asked.clear()
    _, samples = measured(room(camera=still()), {"anew": Keeping(keeps=False)}, 3)
    rounds = sum(sample["clock"] == "shade" for sample in samples)
    # In order: a run-up of three (one camera, it stands still), the warm-up, the rounds, and those of kernels.
    timed = [eye for _, eye in Keeping.asked][-rounds - KERNEL_ROUNDS :]
    assert len(set(timed)) == rounds + KERNEL_ROUNDS
    assert not set(timed) & {eye for _, eye in Keeping.asked[: -rounds - KERNEL_ROUNDS]}


def test_pictures_that_cannot_be_written_are_no_methods_failure(tmp_path, monkeypatch):
    def full(*args):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(metrics, "save_png", full)
    with pytest.raises(OSError, match="No space left"):
        measured(room(), {"good": Constant()}, 2, out=tmp_path)


def test_a_picture_that_cannot_be_made_is_that_methods_failure(tmp_path, monkeypatch, capfd):
    def picky(error):
        if np.ptp(error) > 0.9:
            raise ValueError("too wrong to look at")
        return metrics.tonemap(np.zeros((*error.shape, 3)), 0.0)

    monkeypatch.setattr(metrics, "error_picture", picky)
    records, _ = measured(room(), {"bad": Constant(L=1e6), "good": Constant()}, 2, out=tmp_path)
    assert records[2, "bad"]["status"] == "crashed" and records[2, "good"]["status"] == "ok"
    assert len(list(tmp_path.iterdir())) == 3  # the reference, and what the other shows


@pytest.mark.parametrize("fault", ["nan", "distance"])
def test_what_is_not_a_number_makes_the_record_invalid(fault, tmp_path):
    record = measured(room(), {"bad": Constant(fault=fault)}, 2, out=tmp_path)[0][2, "bad"]
    assert record["status"] == "invalid"
    share = record["nonfinite_px"] / record["reflector_px"]
    assert share == pytest.approx(0.5 if fault == "nan" else 1.0, abs=0.05)
    assert record["reason"] == f"{record['nonfinite_px']} pixels are NaN, infinite or negative"
    if fault == "nan":
        assert record["flip"] is None and record["rmse"] is None and record["temporal_diff"] is None


def test_what_a_method_leaves_where_no_mirror_is_is_not_shown():
    record, seen = bench(room()).show(2, "litter", Constant(fault="litter"))
    assert record["status"] == "ok"
    assert np.isinf(seen.distance[~seen.mask]).all() and np.isfinite(seen.distance[seen.mask]).all()
    assert not seen.found[~seen.mask].any() and not seen.doubt[~seen.mask].any()


def test_coverage_counts_what_was_found_and_errors_everything(tmp_path):
    records, _ = measured(room(), {"half": Constant(fault="half"), "whole": Constant(), "bright": Constant(L=0.6)}, 2)
    half, whole, bright = (records[2, name] for name in ("half", "whole", "bright"))
    assert half["coverage"] == pytest.approx(0.5, abs=0.05) and whole["coverage"] == 1
    assert half["flip"] == whole["flip"] != bright["flip"]
    assert half["distance_err"] == pytest.approx(whole["distance_err"], rel=0.1)
    assert parameters.parse_params(whole["counters"])["looks"] == whole["reflector_px"]


def test_a_mirror_out_of_view_has_no_pixels_and_no_errors(tmp_path):
    away = still(target=(0.0, -9.0, 0.0))
    methods = {"ray_traced": RayTraced(), "search": ImageSpaceSearch(), "map": EnvironmentMap(32)}
    records, _ = measured(room(camera=away), methods, 2, out=tmp_path)
    for record in records.values():
        assert record["status"] == "ok"
        assert record["reflector_px"] == 0 and record["nonfinite_px"] == 0
        assert all(record.get(name) is None for name in (*ERRORS, "temporal_diff", "residual_px", "wrong_ratio"))
        assert record["reference_noise"] is None
        assert record["shade_ms"] > 0


def test_a_mirror_of_two_triangles_has_vertex_numbers_too():
    sheet = Reflector("sheet", quad((-1.2, 0, -1.0), (2.4, 0, 0), (0, 0, 2.0)))
    record = measured(room(mirror=sheet, camera=still()), {"search": ImageSpaceSearch()}, 0)[0][0, "search"]
    assert record["status"] == "ok"
    assert record["residual_px"] < 0.05 and record["wrong_ratio"] == 0


def test_searches_that_came_to_nothing_count_as_not_converged_and_hidden_vertices_do_not_count():
    """Reflected and converged, reflected and not, lost, hidden, not searched: one of three."""
    region, iterations = np.array([1, 1, 0, 3, 0]), np.array([4, 60, 60, 9, 0])
    assert converged_share(np.array([True, False, False, False, False]), region, iterations) == pytest.approx(1 / 3)
    assert converged_share(np.zeros(2, bool), np.array([3, 0]), np.array([5, 0])) is None


def test_the_run_up_is_the_frames_before_or_at_the_start_those_after():
    assert runup.numbers(7, 20) == [5, 6, 7]
    assert runup.numbers(2, 20) == [0, 1, 2]
    assert runup.numbers(1, 20) == [3, 2, 1]
    assert runup.numbers(0, 20) == [2, 1, 0]
    assert runup.numbers(0, 1) == [0]
    assert runup.numbers(0, 2) == [1, 0]
    assert runup.numbers(1, 2) == [1]


def test_a_single_frame_has_no_change_and_no_jitter():
    made = replace(room(), frames=1)
    record = measured(made, {"search": ImageSpaceSearch()}, 0)[0][0, "search"]
    assert record["status"] == "ok" and record["flip"] is not None
    assert record.get("temporal_diff") is None and record.get("jitter_px") is None


def test_second_reflections_have_an_error_of_their_own_where_the_reference_shows_them():
    mirrors = (mirror_ball("one", (-0.42, 0.0, 0.0), 0.4, fine=48), mirror_ball("two", (0.42, 0.1, 0.0), 0.4, fine=48))
    two = scene((glowing(walls(h=0.5)),), mirrors, frames=1)
    methods = {"one": RayTraced(), "three": RayTraced(bounces=3)}
    found = {}
    for depth in (None, 4):
        its = Bench(two, SIZE, ReferenceOptions(bake_spp=1, spp=2, max_depth=depth), None, seed=0, rounds=(2, 2))
        found[depth] = {record["entry"]: record for record in its.run_frame(0, methods, lambda name: None)[0]}
    counts = {record["second_px"] for records in found.values() for record in records.values()}
    assert len(counts) == 1 and 20 < counts.pop() < found[4]["one"]["reflector_px"] / 3
    assert [record["flip_second"] for record in found[None].values()] == [None, None]
    one, three = found[4]["one"], found[4]["three"]
    assert one["flip_second"] > 0.2 and one["flip_second"] > 5 * three["flip_second"]
    # All that is wrong with one bounce is there; FLIP's filters spread some of it over the pixels around.
    assert 0.5 < one["flip_second"] * one["second_px"] / (one["flip"] * one["reflector_px"]) < 1
    (row,) = summary.summary([{**dict.fromkeys(results.COLUMNS), **one}])
    assert (row["second_px"], row["flip_second"]) == (one["second_px"], one["flip_second"])


def test_a_mirror_alone_shows_no_second_reflection():
    its = Bench(room(), SIZE, ReferenceOptions(bake_spp=1, spp=2, max_depth=4), None, seed=0, rounds=(2, 2))
    (record,) = its.run_frame(0, {"map": EnvironmentMap(16)}, lambda name: None)[0]
    assert record["flip"] > 0 and record["second_px"] <= 2
    assert (record["flip_second"] is None) == (record["second_px"] == 0)
