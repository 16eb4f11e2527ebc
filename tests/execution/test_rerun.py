"""Runs in turns: who runs when, with which code, and what is kept."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from support import quick_cli
from typer.testing import CliRunner

from benchharness import cli
from benchharness.execution import rerun
from benchharness.tables import origin


@pytest.fixture
def fake(tmp_path, monkeypatch):
    """A study whose runs measure nothing, and so are quick."""
    monkeypatch.setattr(rerun, "CLI", (str(quick_cli.command(tmp_path)),))
    monkeypatch.chdir(tmp_path)
    (tmp_path / "study.toml").touch()
    return tmp_path / "study.toml"


@pytest.fixture
def started(monkeypatch):
    """Instead of runs: what would have been run, and a table where it is expected."""
    calls = []

    def run(side, arguments, out, say):
        calls.append((out.relative_to(out.parents[1]).as_posix(), side, list(arguments)))
        out.mkdir(parents=True)

    monkeypatch.setattr(rerun, "run_once", run)
    return calls


def test_the_sides_take_turns_after_a_run_of_each_to_warm_up(started, tmp_path):
    heard = []
    sides = rerun.rerun(["study.toml", "--only", "a"], 3, None, tmp_path / "out", heard.append)
    assert sides == (tmp_path / "out" / "base", tmp_path / "out" / "new")
    order = [name for name, *_ in started]
    assert order == ["warm-up/base", "warm-up/new", "base/01", "new/01", "new/02", "base/02", "base/03", "new/03"]
    assert all(arguments == ["study.toml", "--only", "a"] for *_, arguments in started)
    assert len({side for _, side, _ in started}) == 1
    assert heard[0].startswith("base: ") and heard[1].startswith("new: ")


def test_a_checkout_is_imported_from_in_its_own_folder(started, tmp_path):
    checkout = tmp_path / "checkout"
    (checkout / "benchharness").mkdir(parents=True)
    for name in ("__init__", "cli"):
        (checkout / "benchharness" / f"{name}.py").touch()
    heard = []
    rerun.rerun(["study.toml"], 1, checkout, tmp_path / "out", heard.append)
    assert heard[0] == f"base: {checkout / 'benchharness'}" and heard[1] != heard[0]
    sides = {name.partition("/")[0]: side for name, side, _ in started[2:]}
    assert sides["base"] == rerun.Installation(sys.executable, (str(checkout),), checkout)
    assert sides["new"] == rerun.here()


def test_a_folder_without_the_harness_is_where_the_base_runs(tmp_path):
    assert rerun.installation(tmp_path) == rerun.Installation(sys.executable, rerun.here().path, tmp_path)


def test_a_python_is_another_environment(tmp_path, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", "/mine")
    other = rerun.installation(Path(sys.executable))
    assert other.python == sys.executable and other.environment()["PYTHONPATH"] == ""


@pytest.mark.parametrize("against", ["nowhere", "file.txt"])
def test_what_is_no_installation_is_refused(tmp_path, against):
    (tmp_path / "file.txt").touch()
    with pytest.raises(ValueError, match="neither a folder nor a Python interpreter"):
        rerun.installation(tmp_path / against)


def test_a_python_without_the_harness_is_refused(started, tmp_path):
    bare = tmp_path / "python"
    bare.write_text(f'#!/bin/sh\nexec {sys.executable} -S -E "$@"\n')
    bare.chmod(0o755)
    with pytest.raises(ValueError, match="cannot import benchharness"):
        rerun.rerun(["study.toml"], 1, bare, tmp_path / "out", print)


def test_a_folder_in_use_and_no_runs_are_refused(started, tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "file").touch()
    with pytest.raises(ValueError, match="is not empty"):
        rerun.rerun(["study.toml"], 1, None, tmp_path / "out", print)
    with pytest.raises(ValueError, match="at least 1"):
        rerun.rerun(["study.toml"], 0, None, tmp_path / "new", print)


def call(*arguments: object):
    return CliRunner().invoke(cli.app, [str(a) for a in arguments])


def test_runs_are_made_compared_and_taken_up(fake, tmp_path):
    done = call("rerun", fake.name, "--times", 1, "--out", "out", "--only", "a")
    assert done.exit_code == 3, done.output  # one run against one: unproven
    assert "unproven: one run against one" in done.stdout
    command = origin.read_command(tmp_path / "out" / "new" / "01")
    assert command == {"config": str(fake), "plugins": []}
    before = (tmp_path / "out" / "base" / "01" / "results.csv").stat().st_mtime_ns
    again = call("rerun", fake.name, "--times", 1, "--out", "out", "--only", "a", "--resume")
    assert again.exit_code == 3 and "run out" not in again.stdout
    assert (tmp_path / "out" / "base" / "01" / "results.csv").stat().st_mtime_ns == before


def test_a_run_that_fails_ends_it_with_its_code_and_its_words(fake):
    done = call("rerun", "nowhere.toml", "--times", 1, "--out", "out")
    assert done.exit_code == 2
    assert "exit code 2" in done.stderr and "there is no such config" in done.stderr


def test_runs_in_which_nothing_is_measured_are_not_made_again_and_again(fake, monkeypatch):
    monkeypatch.setenv("QUICK_STATUS", "crashed")
    done = call("rerun", fake.name, "--times", 3, "--out", "out")
    assert done.exit_code == 3 and done.stdout.count("run out") == 1
    assert "nothing was measured: out of luck" in done.stderr
