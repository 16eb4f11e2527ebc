"""The command line: what each command answers, and its exit code."""

from __future__ import annotations

import errno
import subprocess
import sys
import types
from contextlib import contextmanager
from pathlib import Path

import mitsuba as mi  # noqa: F401  (so that the variant is set)
import pytest
from support import study
from typer.testing import CliRunner

import benchharness
from benchharness import cli, platform, report, stability
from benchharness.execution import check, cluster, doctor, runner
from benchharness.report import matrix
from benchharness.study import shipped
from benchharness.tables import baseline, compare, formats, origin

CONFIGS = Path(__file__).resolve().parents[1] / "configs"


def call(*arguments: object):
    return CliRunner().invoke(cli.app, [str(a) for a in arguments])


@pytest.fixture
def fake(monkeypatch, plugins_here):
    monkeypatch.setattr(runner, "BENCH", "support.study:Bench")
    monkeypatch.setattr(report, "write", lambda folder: folder / "report.html", raising=False)


def test_run_ends_with_the_reports_path_and_resume_and_only_and_plugin_reach_the_runner(tmp_path, fake):
    path = study.write(tmp_path, '["a", "refuses"]')
    (tmp_path / "extra.py").write_text(study.METHOD)
    done = call("run", path, "--out", tmp_path / "out", "--plugin", tmp_path / "extra.py", "--only", "extra")
    assert done.exit_code == 0, done.output
    assert done.stdout.splitlines()[-1] == str(tmp_path / "out" / "report.html")
    assert "frame 4: 1 ok" in done.stdout
    command = origin.read_command(tmp_path / "out")
    assert command == {"config": str(path), "plugins": [str(tmp_path / "extra.py")]}
    again = call("run", path, "--out", tmp_path / "out")
    assert (again.exit_code, "holds a run" in again.stderr) == (2, True)
    other = call("run", path, "--out", tmp_path / "out", "--resume")
    assert (other.exit_code, "was another one" in other.stderr) == (4, True)


@pytest.mark.exhaustive
def test_a_crash_is_exit_code_three_and_said(tmp_path, fake):
    done = call("run", study.write(tmp_path, '["a", "aborts 0"]'), "--out", tmp_path / "out")
    assert done.exit_code == 3
    assert "crashed: actor behaviour=aborts 0" in done.stdout


def test_a_config_is_found_by_its_path_then_by_name_here_then_among_those_that_come_with_it(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert shipped.config(Path("kitchen-quick")).read_bytes() == (CONFIGS / "kitchen-quick.toml").read_bytes()
    (tmp_path / "configs").mkdir()
    ours = tmp_path / "configs" / "kitchen-quick.toml"
    ours.touch()
    assert shipped.config(Path("kitchen-quick")).resolve() == ours
    (tmp_path / "kitchen-quick").touch()
    assert shipped.config(Path("kitchen-quick")).resolve() == tmp_path / "kitchen-quick"
    assert shipped.config(CONFIGS / "main.toml") == CONFIGS / "main.toml"
    done = call("run", "kitchen-quik")
    assert done.exit_code == 2
    assert "kitchen-quik: there is no such config, did you mean 'kitchen-quick'?; accepted: a TOML file, or" in done.stderr


def test_a_study_that_is_named_is_run(tmp_path, fake, monkeypatch):
    (tmp_path / "configs").mkdir()
    study.write(tmp_path / "configs", '["a"]').rename(tmp_path / "configs" / "mine.toml")
    monkeypatch.chdir(tmp_path)
    done = call("run", "mine", "--out", "out")
    assert done.exit_code == 0, done.output
    command = origin.read_command(tmp_path / "out")
    assert command is not None and command["config"] == str(tmp_path / "configs" / "mine.toml")


def test_every_command_says_what_it_does_in_one_line(monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    said = call("--help").stdout
    for command in cli.app.registered_commands:
        name = command.name or command.callback.__name__
        (line,) = (line for line in said.splitlines() if line[1:].strip().startswith(f"{name} "))
        assert line.rstrip(" │").endswith("."), line


def test_the_module_is_the_command():
    done = subprocess.run([sys.executable, "-m", "benchharness", "--version"], capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (0, f"benchharness {benchharness.__version__}\n")


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


def fake_cluster(monkeypatch, answers=True, workers=1, lost=()):
    """A stand-in for distributed: a scheduler with workers that lose some jobs, by number."""

    class Future:
        def __init__(self, function, number, *arguments):
            self.number, self.call = number, lambda: function(number, *arguments)

        def result(self):
            if self.number in lost:
                raise RuntimeError("the scheduler is gone")
            return self.call()

    class Client:
        def __init__(self, address, timeout):
            assert (address, timeout) == ("tcp://head:8786", cluster.CONNECT_S)
            if not answers:
                raise OSError("Timed out trying to connect")

        def __enter__(self):
            return self

        def __exit__(self, *error):
            pass

        def scheduler_info(self):
            return {"workers": {n: {} for n in range(workers)}}

        def wait_for_workers(self, count, timeout):
            raise TimeoutError

        def submit(self, function, *arguments, **options):
            return Future(function, *arguments)

    stand_in = types.SimpleNamespace(Client=Client, as_completed=lambda futures: reversed([*futures]))
    monkeypatch.setitem(sys.modules, "distributed", stand_in)


@pytest.mark.parametrize(
    ("given", "says"),
    [({"answers": False}, "no scheduler answers"), ({"workers": 0}, "the scheduler has no workers")],
)
def test_a_scheduler_that_is_not_there_or_has_no_workers_is_said_and_leaves_no_folder(tmp_path, fake, monkeypatch, given, says):
    fake_cluster(monkeypatch, **given)
    done = call("run", study.write(tmp_path, '["a"]'), "--out", tmp_path / "out", "--cluster", "tcp://head:8786")
    assert (done.exit_code, f"--cluster tcp://head:8786: {says}" in done.stderr) == (2, True)
    assert "asking for a scheduler at tcp://head:8786, for 15 s at most" in done.stdout
    assert ("waiting for one, for 60 s at most" in done.stdout) == ("workers" in given)
    assert not (tmp_path / "out").exists()


@pytest.mark.exhaustive
def test_a_job_that_a_cluster_loses_is_incomplete_and_done_by_resume(tmp_path, fake, monkeypatch):
    fake_cluster(monkeypatch, lost=[1])
    path = study.write(tmp_path, '["a"]')
    path.write_text(path.read_text().replace('"place.py"', '"place.py"\nsize = [1.0, 2.0]'))
    done = call("run", path, "--out", tmp_path / "out", "--cluster", "tcp://head:8786")
    assert done.exit_code == 3, done.output
    assert "place[size=2.0]: lost by the cluster: RuntimeError: the scheduler is gone; --resume does it" in done.stdout
    assert len((tmp_path / "out" / "results.csv").read_text().splitlines()) == 1 + 3
    done = call("run", path, "--out", tmp_path / "out", "--resume")
    assert done.exit_code == 0, done.output
    assert len((tmp_path / "out" / "results.csv").read_text().splitlines()) == 1 + 6


def test_a_cluster_is_given_every_job_and_its_rows_come_out_in_order(tmp_path, fake, monkeypatch):
    """A stand-in for distributed that runs a job where it is asked for, the last first."""

    fake_cluster(monkeypatch)
    path = study.write(tmp_path, '["a"]')
    path.write_text(path.read_text().replace('"place.py"', '"place.py"\nsize = [1.0, 2.0]'))
    done = call("run", path, "--out", tmp_path / "out", "--cluster", "tcp://head:8786")
    assert done.exit_code == 0, done.output
    scenes = [line.split(",")[2] for line in (tmp_path / "out" / "results.csv").read_text().splitlines()[1:]]
    assert scenes == ["place[size=1.0]"] * 3 + ["place[size=2.0]"] * 3


def test_compare_report_and_accept_hand_on_and_answer(tmp_path, monkeypatch):
    verdict = types.SimpleNamespace(exit_code=1)
    monkeypatch.setattr(compare, "compare", lambda base, new, fail_on_time: verdict)
    monkeypatch.setattr(formats, "FORMATS", {"text": lambda v: "worse", "json": lambda v: "{}"})
    accepted = lambda run, baselines, because, replaces: baselines / f"{run.name}-{because}{'!' * replaces}"  # noqa: E731
    monkeypatch.setattr(baseline, "accept", accepted)
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
    assert "a  What it is about." in lines
    assert any(line.startswith("torn  BROKEN (package methods): SyntaxError") for line in lines)
    configs = call("list", "configs").stdout.splitlines()
    assert configs[0] == "a  What it is about."
    assert {line.partition("  ")[0] for line in configs} > {"kitchen-quick", "main"}, "those that come with it"
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
    monkeypatch.setattr(cli.signal, "signal", lambda number, handler: None)  # whoever tests can be interrupted
    with pytest.raises(SystemExit) as end:
        cli.main()
    assert end.value.code == 3
    assert "ZeroDivisionError" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("error", "code", "says"),
    [
        (OSError(errno.ENAMETOOLONG, "File name too long", "n" * 300), 2, "nnn: File name too long"),
        (FileExistsError(errno.EEXIST, "File exists", "results"), 2, "results: File exists"),
        (OSError(errno.ENOSPC, "No space left on device", "out/a.png"), 5, "out/a.png: No space left on device"),
        (OSError("without a number"), 2, "without a number"),
    ],
)
def test_an_error_of_the_system_is_one_message_with_the_file_it_is_about(monkeypatch, tmp_path, error, code, says):
    def fails(run):
        raise error

    monkeypatch.setattr(report, "write", fails)
    done = call("report", tmp_path)
    assert (done.exit_code, done.stderr.startswith("error: ")) == (code, True)
    assert says in done.stderr and "Traceback" not in done.output


@pytest.mark.exhaustive
def test_names_that_are_longer_than_the_file_systems_and_folders_that_are_files_are_wrong_input(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path, long = study.write(tmp_path, '["a"]'), 300 * "n"
    (tmp_path / "file").touch()
    for arguments in [
        ("run", f"{long}.toml"),
        ("run", path, "--out", long),
        ("run", path, "--out", "file/below"),
        ("run", path, "--plugin", f"{long}.py"),
        ("check-method", f"{long}.py"),
        ("compare", long, long),
        ("report", long),
        ("new-method", long),
        ("stability", f"{long}.toml"),
        ("stability", "--regime", "contact", "--only", "ray_traced", "--out", long),
    ]:
        done = call(*arguments)
        assert (done.exit_code, "Traceback" in done.output) == (2, False), (arguments, done.output)
    assert {p.name for p in tmp_path.iterdir()} - {"__pycache__"} == {"actor.py", "file", "place.py", "study.toml"}


@pytest.mark.exhaustive
def test_baselines_that_are_a_file_are_wrong_input(tmp_path, fake):
    assert call("run", study.write(tmp_path, '["a"]'), "--out", tmp_path / "out").exit_code == 0
    (tmp_path / "file").touch()
    done = call("accept", tmp_path / "out", "--because", "it is", "--baselines", tmp_path / "file")
    assert (done.exit_code, "Traceback" in done.output) == (2, False)


@pytest.mark.parametrize("name", ["none", "true", "class", "method", "reflection", "9", "Ärger", "a b", "", "a" * 65])
def test_a_method_is_not_named_as_what_means_something_else(tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    done = call("new-method", name)
    assert (done.exit_code, "accepted: " in done.stderr, list(tmp_path.iterdir())) == (2, True, [])


def test_stability_ends_with_the_code_and_hands_on_resume_and_yes(tmp_path, monkeypatch):
    given = {}

    def ran(out, config, wanted, **options):
        given.update(options, out=out)
        return stability.Outcome(3, 2, tmp_path)

    monkeypatch.setattr(stability, "run", ran)
    monkeypatch.setattr(matrix, "write", lambda folder: folder / "stability.html")
    done = call("stability", "--out", tmp_path, "--resume", "--yes")
    assert (done.exit_code, done.stdout) == (3, f"{tmp_path}/stability.html: 2 rows fail silently\n")
    assert given == {"out": tmp_path, "resume": True, "yes": True}


@pytest.mark.exhaustive
def test_what_takes_more_than_an_hour_is_begun_with_yes(tmp_path, fake, monkeypatch):
    monkeypatch.setattr(runner.estimate, "TOO_LONG_S", 1.0)
    path = study.write(tmp_path, '["a"]')
    done = call("run", path, "--out", tmp_path / "out")
    assert (done.exit_code, "--yes" in done.stderr, (tmp_path / "out").exists()) == (2, True, False)
    assert call("run", path, "--out", tmp_path / "out", "--yes").exit_code == 0
