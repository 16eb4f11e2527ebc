"""`check-method` on a method that keeps the contract, and on one that breaks each clause of it."""

from __future__ import annotations

from pathlib import Path

import mitsuba as mi  # noqa: F401  (so that the variant is set)
import pytest

from benchharness import check, plugins, template
from benchharness.frame import FrameRenderer

GOOD = template.METHOD.format(title="Sky", name="Sky").replace('"none"', '"nobody 2024"')


def findings(folder: Path, text: str) -> list[check.Finding]:
    (folder / "sky.py").write_text(text)
    plugin = plugins.from_path("method", "sky.py", folder, "test")
    return list(check.findings(plugin, FrameRenderer))


def test_the_template_keeps_the_contract(tmp_path):
    found = findings(tmp_path, GOOD)
    assert [f for f in found if f.level != "pass"] == []
    assert len(found) >= 12


@pytest.mark.parametrize(
    ("old", "new", "level", "says"),
    [
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
    ],
)  # fmt: skip
def test_a_broken_clause_is_found_and_named(tmp_path, old, new, level, says):
    assert old in GOOD
    text = GOOD.replace(old, new).replace("@dataclass", "COUNT = []\n\n\n@dataclass", 1)
    found = findings(tmp_path, text)
    assert [f for f in found if f.level == level and says in f.text], found


def test_what_is_checked_is_a_mirror_within_walls():
    assert check.tiny_scene().enclosed == (True,)


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
        with pytest.raises(ValueError, match="is no name; accepted: small letters"):
            template.new_method(name, tmp_path)
