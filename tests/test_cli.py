"""The command line: what each command answers, and its exit code."""

from __future__ import annotations

import sys
import types
from contextlib import contextmanager

import mitsuba as mi  # noqa: F401  (so that the variant is set)
import pytest
import study
from typer.testing import CliRunner

from benchharness import check, cli, doctor, platform, report, results, runner


def call(*arguments: object):
    return CliRunner().invoke(cli.app, [str(a) for a in arguments])


@pytest.fixture
def fake(monkeypatch, plugins_here):
    monkeypatch.setattr(runner, "BENCH", "study:Bench")
    monkeypatch.setattr(report, "write", lambda folder: folder / "report.html", raising=False)


def test_run_ends_with_the_reports_path_and_resume_and_only_and_plugin_reach_the_runner(tmp_path, fake):
    path = study.write(tmp_path, '["a", "refuses"]')
    (tmp_path / "extra.py").write_text(study.METHOD)
    done = call("run", path, "--out", tmp_path / "out", "--plugin", tmp_path / "extra.py", "--only", "extra")
    assert done.exit_code == 0, done.output
    assert done.stdout.splitlines()[-1] == str(tmp_path / "out" / "report.html")
    assert "frame 4: 1 ok" in done.stdout
    command = results.read_command(tmp_path / "out")
    assert command == {"config": str(path), "plugins": [str(tmp_path / "extra.py")]}
    again = call("run", path, "--out", tmp_path / "out")
    assert (again.exit_code, "holds a run" in again.stderr) == (2, True)
    other = call("run", path, "--out", tmp_path / "out", "--resume")
    assert (other.exit_code, "was another one" in other.stderr) == (4, True)


def test_a_crash_is_exit_code_three_and_said(tmp_path, fake):
    done = call("run", study.write(tmp_path, '["a", "aborts 0"]'), "--out", tmp_path / "out")
    assert done.exit_code == 3
    assert "crashed: actor behaviour=aborts 0" in done.stdout


def test_wrong_input_is_exit_code_two_and_one_message_without_traceback(tmp_path):
    path = study.write(tmp_path, '["a"]', run="seeed = 1")
    done = call("run", path)
    assert done.exit_code == 2
    assert done.stderr.startswith(f"error: {path}: [run]: key 'seeed' is unknown, did you mean 'seed'?; accepted: ")
    assert "Traceback" not in done.output
    assert call("run").exit_code == 2
    assert call("run", path, "--nonsense").exit_code == 2
    assert call("list", "methds").exit_code == 2
    assert "did you mean 'methods'?" in call("list", "methds").stderr


def test_a_cluster_without_its_package_is_refused(tmp_path, fake, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    done = call("run", study.write(tmp_path, '["a"]'), "--out", tmp_path / "out", "--cluster", "tcp://nowhere:1")
    assert done.exit_code == 2
    assert "benchharness[cluster]" in done.stderr


def test_a_cluster_is_given_every_job_and_its_rows_come_out_in_order(tmp_path, fake, monkeypatch):
    """A stand-in for distributed that runs a job where it is asked for, the last first."""

    class Client:
        def __init__(self, address):
            assert address == "tcp://head:8786"

        def __enter__(self):
            return self

        def __exit__(self, *error):
            pass

        def submit(self, function, *arguments, **options):
            return types.SimpleNamespace(result=lambda: function(*arguments))

    fake_module = types.SimpleNamespace(Client=Client, as_completed=lambda futures: reversed(futures))
    monkeypatch.setitem(sys.modules, "distributed", fake_module)
    path = study.write(tmp_path, '["a"]')
    path.write_text(path.read_text().replace('"place.py"', '"place.py"\nsize = [1.0, 2.0]'))
    done = call("run", path, "--out", tmp_path / "out", "--cluster", "tcp://head:8786")
    assert done.exit_code == 0, done.output
    scenes = [line.split(",")[2] for line in (tmp_path / "out" / "results.csv").read_text().splitlines()[1:]]
    assert scenes == ["place[size=1.0]"] * 3 + ["place[size=2.0]"] * 3


def test_compare_report_and_accept_hand_on_and_answer(tmp_path, monkeypatch):
    verdict = types.SimpleNamespace(exit_code=1)
    fake = types.ModuleType("benchharness.compare")
    fake.compare = lambda base, new, fail_on_time: verdict
    fake.FORMATS = {"text": lambda v: "worse", "json": lambda v: "{}"}
    fake.accept = lambda run, baselines, because, replaces: baselines / f"{run.name}-{because}{'!' * replaces}"
    monkeypatch.setitem(sys.modules, "benchharness.compare", fake)
    monkeypatch.setattr("benchharness.compare", fake, raising=False)
    monkeypatch.setattr(report, "write", lambda folder: folder / "report.html", raising=False)
    done = call("compare", "a", "b")
    assert (done.exit_code, done.stdout) == (1, "worse\n")
    done = call("accept", "run1", "--because", "better")
    assert (done.exit_code, done.stdout) == (0, "results/baselines/run1-better\n")
    assert call("accept", "run1", "--because", "better", "--replace").stdout == "results/baselines/run1-better!\n"
    assert call("accept", "run1").exit_code == 2
    assert call("compare", "a", "b", "--format", "json").stdout == "{}\n"
    done = call("compare", "a", "b", "--format", "jsn")
    assert (done.exit_code, "did you mean 'json'?" in done.stderr) == (2, True)
    assert call("report", tmp_path).stdout == f"{tmp_path}/report.html\n"


def test_list_shows_fields_with_defaults_and_what_is_broken(tmp_path, monkeypatch):
    for name in [m for m in sys.modules if m.partition(".")[0] in ("methods", "scenes")]:
        monkeypatch.delitem(sys.modules, name)
    for name, text in [("methods/actor", study.METHOD), ("methods/torn", "def ("), ("scenes/place", study.SCENE)]:
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / f"{name}.py").write_text(text)
        (tmp_path / name).with_name("__init__.py").touch()
    (tmp_path / "configs").mkdir()
    (tmp_path / "configs" / "a.toml").write_text("# What it is about.\n")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.chdir(tmp_path)
    done = call("list")
    assert done.exit_code == 0, done.output
    lines = done.stdout.splitlines()
    assert "actor  (none)" in lines
    assert "  size = 1  (int)" in lines
    assert "  detail = lean  (str)" in lines
    assert "configs/a.toml  What it is about." in lines
    assert any(line.startswith("torn  BROKEN (package methods): SyntaxError") for line in lines)
    assert call("list", "configs").stdout == "configs/a.toml  What it is about.\n"
    for name in [m for m in sys.modules if m.partition(".")[0] in ("methods", "scenes")]:
        del sys.modules[name]


def test_check_method_answers_its_findings(tmp_path, monkeypatch):
    assert call("check-method", tmp_path / "none.py").exit_code == 2
    found = [check.Finding("pass", "good"), check.Finding("warn", "so so")]
    monkeypatch.setattr(check, "check", lambda spec: found)
    done = call("check-method", "a.py")
    assert (done.exit_code, done.stdout) == (0, "pass  good\nwarn  so so\n")
    found.append(check.Finding("fail", "bad"))
    assert call("check-method", "a.py").exit_code == 2


def test_doctor_says_how_to_mend_an_llvm_that_does_not_work(monkeypatch):
    monkeypatch.setattr(doctor, "PROBED", ("llvm_ad_rgb",))
    monkeypatch.setenv("DRJIT_LIBLLVM_PATH", "/nowhere/libLLVM.so")
    done = call("doctor")
    assert done.exit_code == 5, done.output
    assert "llvm_ad_rgb: does not work: exit code 1" in done.stdout
    assert "mend: DRJIT_LIBLLVM_PATH names /nowhere/libLLVM.so; unset it" in done.stdout


@pytest.mark.parametrize(
    ("part", "mend"),
    [("method", "LLVM at"), ("cache", "set BENCHHARNESS_CACHE to a folder"), ("lock", "a plain one that you can write")],
)
def test_doctor_finds_a_method_a_cache_and_a_lock_that_do_not_work(tmp_path, monkeypatch, part, mend):
    works = doctor.Diagnosis("llvm_ad_rgb", True, "right")
    monkeypatch.setattr(doctor, "_variant", lambda name: works)
    monkeypatch.setattr(doctor, "PROBED", ("llvm_ad_rgb",))
    monkeypatch.setattr(doctor, "_broken_plugins", list)
    (tmp_path / "file").touch()
    monkeypatch.setenv("BENCHHARNESS_CACHE", str(tmp_path / ("file" if part == "cache" else "folder")))

    @contextmanager
    def alone(say):
        if part == "lock":
            raise PermissionError("there is a folder in its place")
        say("another run is timing")
        yield

    monkeypatch.setattr(platform, "alone", alone)
    level = "fail" if part == "method" else "pass"
    monkeypatch.setattr(check, "check", lambda spec: [check.Finding(level, "the process ended with signal 6")])
    done = call("doctor")
    assert done.exit_code == 5, done.output
    answers = dict(line.split(": ")[:2] for line in done.stdout.splitlines() if not line.startswith(" "))
    assert answers == {"llvm_ad_rgb": "works"} | {
        name: "does not work" if name == part else "works" for name in ("method", "cache", "lock")
    }
    (mended,) = (line for line in done.stdout.splitlines() if line.startswith("  mend: "))
    assert mend in mended


def test_a_broken_environment_is_exit_code_five(tmp_path, monkeypatch):
    monkeypatch.setenv("DRJIT_LIBLLVM_PATH", "/nowhere/libLLVM.so")
    done = call("run", study.write(tmp_path, '["a"]'))
    assert (done.exit_code, "mend: run `benchharness doctor`" in done.stderr) == (5, True)


def test_what_nobody_foresaw_is_a_traceback_and_never_a_regression(monkeypatch, capsys):
    monkeypatch.setattr(cli, "app", lambda: 1 / 0)
    with pytest.raises(SystemExit) as end:
        cli.main()
    assert end.value.code == 3
    assert "ZeroDivisionError" in capsys.readouterr().err
