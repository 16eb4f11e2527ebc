"""Plugins that do what none should: each is an error that says so, and the others go on."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import mitsuba as mi  # noqa: F401  (so that the variant is set)
import pytest
from support import hostile_plugins, study

from benchharness import processes
from benchharness.study import apart, config, listing, methods, plugins
from benchharness.study.apart import Apart

PLUGINS = hostile_plugins.plugins()
GOOD = hostile_plugins.GOOD


@pytest.fixture(scope="module")
def asked():
    """A child that all of them share, as long as it lives."""
    with Apart("llvm_ad_rgb") as child:
        yield child


@pytest.fixture
def impatient(monkeypatch):
    monkeypatch.setattr(apart, "LOAD_S", 3.0)


def write(folder: Path, plugin: hostile_plugins.Plugin) -> Path:
    (folder / "colorsys.py").write_text("a = 1\n")
    file = folder / f"{plugin.name}.py"
    file.write_bytes(plugin.source.encode())
    return file


def test_there_are_fifty_of_them():
    assert len(PLUGINS) >= 50
    assert len({plugin.name for plugin in PLUGINS}) == len(PLUGINS)


def tier(plugin: hostile_plugins.Plugin) -> object:
    """What costs a process is exhaustive but for one of each kind."""
    dear = plugin.deadly and plugin.name.endswith("_when_built") and not plugin.name.startswith("leaves_when")
    return pytest.param(plugin, marks=[pytest.mark.exhaustive] if dear or plugin.name.startswith("sleeps") else [])


@pytest.mark.parametrize("plugin", [tier(plugin) for plugin in PLUGINS], ids=[plugin.name for plugin in PLUGINS])
def test_a_hostile_plugin_is_an_error_that_says_so(tmp_path, impatient, asked, plugin):
    file = write(tmp_path, plugin)
    with pytest.raises(ValueError) as error:
        methods.plugged_in(str(file), asked)
    said = str(error.value)
    assert re.search(plugin.says, said, re.DOTALL), said
    assert said.startswith("--plugin")
    assert len(said) < 2 * processes.LONGEST
    assert processes.clean(said) == said or len(said) > processes.LONGEST


def test_after_all_of_them_a_good_one_is_heard(tmp_path, asked):
    (tmp_path / "good.py").write_text(GOOD)
    entry = methods.plugged_in(str(tmp_path / "good.py"), asked)
    assert (entry.key, entry.changed, len(entry.method_hash)) == ("good size=3", [], 16)


def test_the_process_that_keeps_results_imports_no_plugin_and_no_dr_jit(tmp_path):
    path = study.write(tmp_path, '["a"]')
    (tmp_path / "actor.py").write_text(study.METHOD + "\nprint('imported by', os.getpid(), flush=True)\n")
    code = (
        "import sys; from pathlib import Path\n"
        "from benchharness.execution import runner; from benchharness.study import config, listing\n"
        f"study = config.load(Path({str(path)!r}))\n"
        "print(len(study.jobs), [m for m in sys.modules if m.partition('.')[0] in ('drjit', 'mitsuba', 'methods', 'scenes')\n"
        "      or m.startswith('benchharness_plugin')])"
    )
    env = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    seen = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=env, check=True)
    assert seen.stdout == "1 []\n"


def test_an_installed_plugin_that_leaves_is_listed_as_broken_and_the_others_go_on(tmp_path, monkeypatch):
    folder = tmp_path / "leaving-1.0.dist-info"
    folder.mkdir()
    (folder / "METADATA").write_text("Metadata-Version: 2.1\nName: leaving\nVersion: 1.0\n")
    (folder / "entry_points.txt").write_text("[benchharness.methods]\nleaving = leaving\nzealous = zealous\n")
    (tmp_path / "leaving.py").write_text("import os; os._exit(0)")
    (tmp_path / "zealous.py").write_text(GOOD)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(plugins, "_in_package", lambda kind: [])
    lines = list(listing.KINDS["methods"]())
    (broken,) = (line for line in lines if line.startswith("leaving"))
    assert broken.startswith("leaving  BROKEN (entry point leaving): cannot be used: the process that imports it ended with")
    assert "zealous  (none)" in lines
    notes: list[str] = []
    with Apart() as asked:
        names = [entry.method for entry in methods.installed(asked, notes.append)]
    assert names == ["zealous"]
    assert len(notes) == 1 and notes[0].startswith("left out: leaving: cannot be used")


@pytest.mark.parametrize(
    ("deed", "says"),
    [
        ("__import__('os')._exit(0)", "ended with exit code 0"),
        pytest.param("[0 for _ in iter(int, 1)]", "within 3 s", marks=pytest.mark.exhaustive),
    ],
)
def test_a_scene_that_ends_its_process_or_never_ends_is_an_error(tmp_path, deed, says):
    path = study.write(tmp_path, '["a"]', run=f"timeout_s = {3.0 if 'iter' in deed else 60.0}")
    (tmp_path / "place.py").write_text(study.SCENE.replace("    thing =", f"    {deed}\n    thing ="))
    with pytest.raises(ValueError, match=rf"\[scenes.place\]: cannot be used: .*{says}"):
        config.load(path)


def test_what_lies_beside_a_plugin_is_imported_and_part_of_its_hash(tmp_path, asked):
    def hashed() -> str:
        return methods.plugged_in(str(tmp_path / "good.py"), asked).method_hash

    late = GOOD.replace("def prepare(self, scene): return None", "def prepare(self, scene): import late; return late")
    (tmp_path / "good.py").write_text("import early\n" + late)
    (tmp_path / "early.py").write_text("from deeper.still import x\n")
    (tmp_path / "deeper").mkdir()
    (tmp_path / "deeper" / "still.py").write_text("x = 1\n")
    (tmp_path / "deeper" / "__init__.py").touch()
    (tmp_path / "late.py").write_text("a = 1\n")
    (tmp_path / "unrelated.py").write_text("a = 1\n")
    first = hashed()
    (tmp_path / "unrelated.py").write_text("a = 2\n")
    assert hashed() == first
    seen = {first}
    for name in ("early.py", "late.py", "deeper/still.py"):
        (tmp_path / name).write_text((tmp_path / name).read_text() + "b = 2\n")
        seen.add(hashed())
    assert len(seen) == 4


def test_two_plugins_do_not_get_each_others_helpers(tmp_path, asked):
    for folder in ("one", "two"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "helper_of_two.py").write_text(f"x = {folder!r}\n")
        (tmp_path / folder / f"{folder}.py").write_text("import helper_of_two\n" + GOOD)
    methods.plugged_in(str(tmp_path / "one" / "one.py"), asked)
    with pytest.raises(
        ValueError, match=r"'helper_of_two', which is both beside it and at .*one.helper_of_two.py; accepted: a name"
    ):
        methods.plugged_in(str(tmp_path / "two" / "two.py"), asked)


@pytest.mark.parametrize(("kind", "name"), [("methods", "newton"), ("scenes", "kitchen")])
def test_a_file_may_not_go_by_the_name_of_what_is_installed(plugins_here, tmp_path, kind, name):
    path = study.write(tmp_path, '["a"]')
    old = {"methods": "[methods.actor]", "scenes": "[scenes.place]"}[kind]
    path.write_text(path.read_text().replace(old, f"[{kind}.{name}]").replace('"place.py"', '"place.py:place"'))
    with pytest.raises(ValueError, match=rf"\[{kind}.{name}\]: the name '{name}' is taken by package {kind}; accepted: a name"):
        config.load(path)


def test_a_plugin_may_not_go_by_the_name_of_a_method_unless_it_is_that_method(tmp_path, asked):
    (tmp_path / "newton.py").write_text(GOOD)
    with pytest.raises(ValueError, match="--plugin: the name 'newton' is taken by package methods"):
        methods.plugged_in(str(tmp_path / "newton.py"), asked)
    own = Path(__file__).parents[2] / "methods" / "newton.py"
    assert methods.plugged_in(str(own), asked).method == "newton"


def command(*arguments: object) -> subprocess.CompletedProcess:
    env = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    line = "import sys; from benchharness import cli; from benchharness.study import apart; apart.LOAD_S = 10.0; cli.main()"
    return subprocess.run([sys.executable, "-c", line, *map(str, arguments)], capture_output=True, text=True, env=env)


@pytest.mark.claims
@pytest.mark.parametrize("plugin", PLUGINS, ids=lambda plugin: plugin.name)
def test_a_run_with_a_hostile_plugin_is_exit_code_two_and_leaves_nothing_behind(tmp_path, plugin):
    path = study.write(tmp_path, '["a"]')
    file = write(tmp_path, plugin)
    done = command("run", path, "--out", tmp_path / "out", "--plugin", file)
    assert (done.returncode, "Traceback" in done.stderr) == (2, False), done.stderr
    assert not (tmp_path / "out").exists()
