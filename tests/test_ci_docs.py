"""The commands of docs/ci.md do what it says, in a repository of somebody's own."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest
from support import quick_cli

import benchharness
from benchharness import cli

PAGE = Path(benchharness.__file__).parents[1] / "docs" / "ci.md"


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", PAGE.read_text(), re.DOTALL)


def steps(job: str) -> list[str]:
    """The commands of a job of the workflow, without those that install."""
    (workflow,) = blocks("yaml")
    text = re.split(r"\n  (?=\w+:\n)", workflow.partition("\njobs:")[2])
    (found,) = [part for part in text if part.lstrip().startswith(f"{job}:")]
    commands = re.findall(r"^ +- run: (.*)$", found, re.MULTILINE)
    assert commands[0] == "pip install -e ."
    return commands[1:]


@pytest.fixture
def repository(tmp_path, monkeypatch):
    """A repository with a study and a method of its own, one commit, and the command on the path."""
    home, tools = tmp_path / "repository", tmp_path / "tools"
    for folder in (home, tools):
        folder.mkdir()
    (home / "study.toml").write_text("# What is gated.\n")
    quick_cli.command(tools)
    monkeypatch.chdir(home)
    monkeypatch.setenv("PATH", f"{tools}{os.pathsep}{os.environ['PATH']}")
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(entry or os.getcwd() for entry in sys.path))
    settings = {
        "STUDY": "study.toml", "BASELINE": "results/baselines/study.csv", "BEFORE": "HEAD", "RUNS": "1",
        "GITHUB_STEP_SUMMARY": str(tmp_path / "summary.md"),
    }  # fmt: skip
    for name, value in settings.items():
        monkeypatch.setenv(name, value)
    identity = ["-c", "user.name=a", "-c", "user.email=a@b"]
    for command in (["init", "-q"], ["add", "."], [*identity, "commit", "-q", "-m", "first"]):
        subprocess.run(["git", *command], cwd=home, check=True)
    return home


def does(command: str) -> subprocess.CompletedProcess[str]:
    """Runs a command as GitHub's `shell: bash` does."""
    return subprocess.run(["bash", "-eo", "pipefail", "-c", command], capture_output=True, text=True, check=False)


@pytest.mark.exhaustive
def test_the_workflow_passes_an_unchanged_method_fails_a_worse_one_and_proves_nothing_by_one_run(repository, tmp_path):
    (baseline,) = blocks("sh")
    done = does(baseline)
    assert done.returncode == 0 and (repository / "results" / "baselines" / "study.csv").exists(), done.stderr
    for command in steps("errors"):
        done = does(command)
        assert done.returncode == 0, (command, done.stdout, done.stderr)
    assert ElementTree.parse("verdict.xml").getroot().get("failures") == "0"
    assert "### benchharness: fine" in (tmp_path / "summary.md").read_text()

    table = repository / "now" / "results.csv"
    table.write_text(re.sub(r",ok,", ",refused,", table.read_text(), count=1))
    junit, markdown = (does(command) for command in steps("errors")[1:])
    assert (junit.returncode, markdown.returncode) == (0, 1)
    assert ElementTree.parse("verdict.xml").getroot().get("failures") == "1"
    assert "a regression was found" in (tmp_path / "summary.md").read_text()

    worktree, turns = steps("times")
    assert does(worktree).returncode == 0
    done = does(turns)
    assert done.returncode == 3 and "unproven: one run against one" in done.stdout, (done.stdout, done.stderr)
    assert (repository / "turns" / "base" / "01" / "results.csv").exists()


def test_every_command_and_option_of_the_page_exists():
    text, source = PAGE.read_text(), Path(cli.__file__).read_text()
    registered = [command.name or getattr(command.callback, "__name__", "") for command in cli.app.registered_commands]
    named = set(
        re.findall(r"\bbenchharness ((?:new-|check-)?[a-z]+)", "\n".join(re.findall(r"^.*benchharness .*$", text, re.M)))
    )
    assert {"run", "compare", "accept", "rerun", "doctor"} <= named & set(registered)
    for option in set(re.findall(r"(?<![\w-])--([a-z][a-z-]*)", text)):
        declared = rf'"--{option}"|^    {option.replace("-", "_")}: [A-Z]\w+'
        assert re.search(declared, source, re.MULTILINE), option
