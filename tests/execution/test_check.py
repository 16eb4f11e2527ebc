"""`check-method` on a method that keeps the contract, and on one that breaks each clause of it.

In the first tier it breaks every third.
"""

from __future__ import annotations

from pathlib import Path

import mitsuba as mi  # noqa: F401  (so that the variant is set)
import pytest
from support.tiers import every, first

from benchharness.execution import check, tiny
from benchharness.execution import findings as checks
from benchharness.study import plugins, template

GOOD = template.METHOD.format(title="Sky", name="Sky").replace('"none"', '"nobody 2024"')


def findings(folder: Path, text: str) -> list[check.Finding]:
    (folder / "sky.py").write_text(text)
    plugin = plugins.from_path("method", "sky.py", folder, "test")
    return list(checks.findings(plugin))


def test_the_template_keeps_the_contract(tmp_path):
    found = findings(tmp_path, GOOD)
    assert [f for f in found if f.level != "pass"] == []
    assert len(found) >= 18
    assert check.Finding("pass", "frame unchanged") in found


METHODS = [name for name, plugin in plugins.discover("method").items() if plugin.error is None]


@pytest.mark.parametrize("name", first(METHODS, ("environment_map", "ray_traced")))
def test_every_method_of_the_package_keeps_the_contract(name):
    found = list(checks.findings(plugins.discover("method")[name]))
    assert [f for f in found if f.level == "fail"] == []


@pytest.mark.parametrize(
    ("old", "new", "level", "says"),
    every(3, [
        ("L = mi.Color3f(state *", "L = mi.Color3f(dr.nan *", "fail", "not finite in"),
        ("(0.5 + 0.5 * wo.z)", "wo.z", "fail", "radiance is negative"),
        ("100.0, dr.width(L)", "-1.0, dr.width(L)", "fail", "distance is NaN or not positive"),
        ("100.0, dr.width(L)", "1.0, 7", "fail", "distance has 7 lanes; accepted: 6144"),
        ("100.0, dr.width(L)", "dr.inf, dr.width(L)", "fail", "are found at infinity, and walls enclose the mirror"),
        ("found=frame.active", "found=frame.active & False", "fail", "found: 0% of the pixels"),
        ("found=frame.active", "found=frame.active & (wo.z > 0)", "warn", "found: "),
        ("found=frame.active", "found=frame.active, doubt=frame.reflector", "fail", "doubt is Int; accepted: Bool, or None"),
        ("found=frame.active", "found=frame.active, doubt=dr.full(mi.Bool, True, 7)", "fail", "doubt has 7 lanes; accepted"),
        ("found=frame.active", "found=frame.reflector", "fail", "found is Int; accepted: Bool"),
        ("wo = 2.0", "COUNT.append(0); state = state * len(COUNT); wo = 2.0", "fail", "two runs of a frame differ"),
        ("(0.5 + 0.5 * wo.z)", "(0.5 + 0.0 * wo.z)", "fail", "another camera gives the same answer"),
        ("wo = 2.0", "COUNT.append(0) if frame.index else 0; state = state * (1 + len(COUNT)); wo = 2.0",
         "fail", "after another frame, a fresh state differs"),
        ("return dr.opaque", "object.__setattr__(self, 'brightness', 2.0); return dr.opaque", "fail", "self changed"),
        ("distance = ", "dr.eval(L); distance = ", "warn", "shade launches 1 kernels"),
        ("distance = ", "raise KeyError('root'); distance = ", "fail", "96 x 64: KeyError: 'root'"),
        ('"nobody 2024"', '""', "fail", "names no paper"),
        ("brightness  radiance", "radiance", "warn", "no docstring tells of the parameters brightness"),
        ("L = mi.Color3f(state *", "L = mi.Color3f(frame.view.width *", "warn", "twice the resolution changes"),
        ("    def prepare", "    def refuses(self, scene): return 'no'\n    def prepare", "warn", "it refuses"),
        ("    def prepare", "    def refuses(self, scene): return 7\n    def prepare", "fail", "refuses returns int; accepted"),
        ("    def prepare", "    def refuses(self, scene): 1 / 0\n    def prepare", "fail", "refuses: ZeroDivisionError"),
        ("distance = ", "raise SystemExit(0); distance = ", "fail", "96 x 64: SystemExit: 0"),
        ("), state", ")", "fail", "shade returns Reflection; accepted: a Reflection and the next state"),
        ("found=frame.active", "found=frame.active, counters=None", "fail", "counters is None; accepted: a dict"),
        ("found=frame.active", "found=frame.active, counters={'a': 10**40}", "fail", "counter a is int; accepted: UInt"),
        ("found=frame.active", "found=frame.active, vertices=3", "fail", "vertices is int; accepted: Vertices"),
        ("distance = ", "frame.n += 0.1; distance = ", "fail", "it writes into the frame: n"),
        ("distance = ", "frame.p.x.numpy()[0] = 9; distance = ", "fail", "it writes into the frame: p"),
        ("distance = ", "frame.surfaces.clear(); distance = ", "fail", "it writes into the frame: surfaces"),
        ("        return dr.opaque", "        scene.objects[0].mesh.vertices[:] = 0; return dr.opaque", "fail", "read-only"),
    ]),
)  # fmt: skip
def test_a_broken_clause_is_found_and_named(tmp_path, old, new, level, says):
    assert old in GOOD
    text = GOOD.replace(old, new).replace("@dataclass", "COUNT = []\n\n\n@dataclass", 1)
    found = findings(tmp_path, text)
    assert [f for f in found if f.level == level and says in f.text], found


KEEPING = {
    "number": "key = frame.index",
    "number of the pixel": "key = (frame.index, dr.width(frame.pixels))",
    "class": "key = (self, frame.index)",
}


@pytest.mark.parametrize("key", KEEPING.values(), ids=KEEPING.keys())
def test_an_answer_that_is_kept_by_the_number_of_the_frame_is_found(tmp_path, key):
    start = "        wo = 2.0"
    kept = f"        {key}\n        if key in COUNT:\n            return COUNT[key], state\n"
    text = GOOD.replace(start, kept + start)
    text = text.replace("        return Reflection(", "        COUNT[key] = Reflection(").replace("active), state", "active)\n")
    text = text.rstrip() + "\n        return COUNT[key], state\n"
    found = findings(tmp_path, text.replace("@dataclass", "COUNT = {}\n\n\n@dataclass", 1))
    failed = [f.text for f in found if f.level == "fail"]
    assert any("second call of shade launches kernels for 0%" in text for text in failed)
    if "pixels" not in key:
        assert any("it is kept by number" in text for text in failed)


def test_an_answer_that_is_kept_in_the_state_is_found(tmp_path):
    text = GOOD.replace("return dr.opaque(mi.Float, self.brightness)", "return dr.opaque(mi.Float, self.brightness), {}")
    start = "        wo = 2.0"
    text = text.replace(start, "        state, kept = state\n        if frame.index in kept:\n"
                               "            return kept[frame.index], (state, kept)\n" + start)  # fmt: skip
    text = text.replace("        return Reflection(", "        kept[frame.index] = Reflection(")
    text = text.replace("active), state", "active)\n        return kept[frame.index], (state, kept)")
    failed = [f.text for f in findings(tmp_path, text) if f.level == "fail"]
    assert any("it is kept by number" in text for text in failed), failed


UPDATE = """
    def update(self, state, frame):
        BODY

    def shade"""


def with_update(body: str) -> str:
    return GOOD.replace("\n    def shade", UPDATE.replace("BODY", body)).replace("@dataclass", "KEPT = {}\n\n\n@dataclass", 1)


@pytest.mark.parametrize(
    ("body", "says"),
    [
        ("return dr.opaque(mi.Float, 1.0) + frame.view.eye.x * 0.1", "update does what depends on the eye"),
        ("return dr.mean(frame.n.z) + state", "update does what depends on the eye"),
        (
            "KEPT[frame.index] = KEPT.get(frame.index) or [state + dr.sum(frame.poses) * 0.01]; return KEPT[frame.index][0]",
            "update launches nothing when things have moved",
        ),
    ],
)
def test_an_update_that_looks_at_the_eye_or_keeps_what_it_made_is_found(tmp_path, body, says):
    failed = [f.text for f in findings(tmp_path, with_update(body)) if f.level == "fail"]
    assert len(failed) == 1 and says in failed[0], failed


def test_an_update_that_looks_at_the_poses_keeps_the_contract(tmp_path):
    found = findings(tmp_path, with_update("return state + dr.sum(frame.poses) * 0.01"))
    assert [f for f in found if f.level != "pass"] == []


WORKING = """
import threading, time

def spin():
    end = time.perf_counter() + 1.0
    while time.perf_counter() < end:
        pass
"""


@pytest.mark.parametrize(
    ("act", "level", "says"),
    [
        ("threading.Thread(target=spin, daemon=True).start()", "fail", "after shade has returned, "),
        ("threading.Thread(target=time.sleep, args=(60.0,), daemon=True).start()", "warn", "1 threads of its own are there"),
    ],
)
def test_what_works_on_after_shade_has_returned_is_found(tmp_path, act, level, says):
    text = GOOD.replace("        wo = 2.0", f"        {act}\n        wo = 2.0")
    text = text.replace("@dataclass", WORKING + "\n\n@dataclass", 1)
    found = findings(tmp_path, text)
    assert [f for f in found if f.level == level and f.text.startswith(says)], found


def test_what_is_checked_is_a_mirror_within_walls():
    assert tiny.scene().enclosed == (True,)


@pytest.mark.parametrize(
    ("deed", "ending"),
    [("os.abort()", "SIGABRT"), ("os._exit(0)", "exit code 0"), ("raise KeyboardInterrupt", "KeyboardInterrupt")],
)
def test_a_method_that_ends_its_process_is_a_finding_with_exit_code_zero_too(tmp_path, deed, ending):
    (tmp_path / "sky.py").write_text(f"import os\n{deed}\n")
    (found,) = check.check(str(tmp_path / "sky.py"))
    assert (found.level, ending in found.text) == ("fail", True)


def test_a_new_method_is_never_written_over_a_file(tmp_path):
    path = template.new_method("my_sky", tmp_path)
    assert "class MySky(Method)" in path.read_text()
    with pytest.raises(ValueError, match=r"my_sky\.py exists"):
        template.new_method("my_sky", tmp_path)
    for name in ("My", "a-b", "2x", "../x"):
        with pytest.raises(ValueError, match="is no name; accepted: up to 64 small letters"):
            template.new_method(name, tmp_path)
