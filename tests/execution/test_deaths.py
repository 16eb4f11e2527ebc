"""Workers and runs that are killed: nobody is blamed without evidence, and what is taken up ends as if nothing had been."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import mitsuba as mi  # noqa: F401  (so that the variant is set)
import pytest
from support import mortal_bench, study
from support.ear import Ear
from support.tiers import complete, exhaustive

from benchharness import report
from benchharness.execution import runner
from benchharness.study import config

BENCH = "support.mortal_bench:Bench"
BEHAVIOURS = '["a", "poison"]'


pytestmark = pytest.mark.usefixtures("plugins_here")


@pytest.fixture(autouse=True)
def tables_only(monkeypatch):
    monkeypatch.setattr(report, "write", lambda folder: folder / "report.html")


def run(path: Path, out: Path, bench: str = BENCH, **options) -> tuple[int, Ear]:
    ear = Ear()
    return runner.run(config.load(path), out, ear, bench=bench, **options)[0], ear


def statuses(out: Path) -> dict[str, list[str]]:
    found: dict[str, list[str]] = {}
    for row in mortal_bench.told(out)[0]:
        found.setdefault(row["params"].split("=")[1].split(";")[0], []).append(row["status"])
    return found


def crashes(ear: Ear) -> list[str]:
    """What was said of crashes; others on this machine may hold the lock, which is said, too."""
    return [note for note in ear.notes if note.startswith("crashed")]


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("undisturbed")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(report, "write", lambda folder: folder / "report.html")
        assert run(study.write(folder, BEHAVIOURS), folder / "out")[0] == 0
    return mortal_bench.told(folder / "out")


@exhaustive
@pytest.mark.parametrize(
    "moments",
    [
        ["prepare", "ready", "before 0", "method 2", "pictures 2", "after 2"],  # one of each kind
        pytest.param(["method 0", "after 0", "method 4", "pictures 4", "after 4"], marks=complete),
    ],
)
def test_a_worker_that_is_killed_at_any_moment_costs_nothing(tmp_path, undisturbed, moments):
    path = study.write(tmp_path, BEHAVIOURS)
    signals = ["SIGKILL", "SIGTERM", "SIGINT", "SIGSEGV"]
    deaths = [f"{moment} {signals[n % 4]}" for n, moment in enumerate(moments)]
    (tmp_path / "deaths").write_text("\n".join(deaths))
    code, ear = run(path, tmp_path / "out")
    assert (tmp_path / "deaths").read_text() == ""
    assert (code, crashes(ear)) == (0, [])
    assert mortal_bench.told(tmp_path / "out") == undisturbed


@exhaustive
def test_a_frame_of_which_workers_die_outside_any_method_is_done_in_halves_and_tried_again_later(tmp_path, undisturbed):
    path = study.write(tmp_path, BEHAVIOURS)
    (tmp_path / "poison").touch()
    code, ear = run(path, tmp_path / "out")
    assert code == 3
    assert statuses(tmp_path / "out") == {"a": ["ok"] * 3, "poison": ["crashed"] * 3}
    (note,) = crashes(ear)
    assert note.startswith("crashed: actor behaviour=poison; size=1: the worker ended with SIGSEGV")
    assert "outside any method" in note
    # Healed, it is taken up, and everything is as if nothing had been.
    (tmp_path / "poison").unlink()
    code, _ = run(path, tmp_path / "out", resume=True)
    assert code == 0
    assert mortal_bench.told(tmp_path / "out") == undisturbed


@exhaustive
def test_a_disk_that_was_full_is_held_against_no_method(tmp_path, undisturbed):
    path = study.write(tmp_path, BEHAVIOURS)
    (tmp_path / "full").touch()
    code, ear = run(path, tmp_path / "out")
    assert code == 3
    assert {status for row in statuses(tmp_path / "out").values() for status in row} == {"crashed"}
    assert "No space left on device outside any method" in crashes(ear)[0]
    assert len((tmp_path / "out" / "benches").read_text()) == 2
    (tmp_path / "full").unlink()
    assert run(path, tmp_path / "out", resume=True)[0] == 0
    assert mortal_bench.told(tmp_path / "out") == undisturbed


@exhaustive
def test_a_run_whose_journal_could_not_be_written_is_taken_up(tmp_path, undisturbed, monkeypatch):
    path = study.write(tmp_path, BEHAVIOURS)
    append, left = runner.Journal.append, [1, 0]

    def full(journal, line):
        if not left.pop(0):
            with open(journal.path, "ab") as stream:
                stream.write(b'{"job": 0, "fra')
            raise OSError(28, "No space left on device")
        append(journal, line)

    with monkeypatch.context() as patch:
        patch.setattr(runner.Journal, "append", full)
        with pytest.raises(OSError, match="No space left on device"):
            run(path, tmp_path / "out")
    code, ear = run(path, tmp_path / "out", resume=True)
    assert (code, ear.frames) == (0, [2, 2, 4])
    assert mortal_bench.told(tmp_path / "out") == undisturbed


RUN = """
import signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell that started us in the background lets it be ignored
from pathlib import Path
from benchharness import cli, report
from benchharness.execution import progress, runner
report.write = lambda folder: folder
runner.BENCH = "support.mortal_bench:Slow"
sys.argv = ["benchharness", "run", sys.argv[1], "--out", sys.argv[2], *sys.argv[3:]]
cli.main()
"""


def start(*arguments: object, stderr: int = subprocess.DEVNULL) -> subprocess.Popen:
    env = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    command = [sys.executable, "-c", RUN, *(str(a) for a in arguments)]
    return subprocess.Popen(command, env=env, stdout=subprocess.DEVNULL, stderr=stderr, text=True)


def children(process: int) -> list[int]:
    found = subprocess.run(["pgrep", "-P", str(process)], capture_output=True, text=True).stdout.split()
    return [int(child) for child in found]


def alive(process: int) -> bool:
    try:
        return "\nState:\tZ" not in Path(f"/proc/{process}/status").read_text()
    except OSError:
        return False


def gone(processes: list[int]) -> bool:
    deadline = time.monotonic() + 20
    while any(map(alive, processes)):
        if time.monotonic() > deadline:
            return False
        time.sleep(0.02)
    return True


def killed_at(folder: Path, whom: str, name: str, delay_s: float, undisturbed) -> str:
    """Kills a run, or its worker, some time after the worker came up; takes it up. Returns how the first part ended."""
    path, out = study.write(folder, BEHAVIOURS), folder / "out"
    process = start(path, out)
    deadline = time.monotonic() + 60
    while not (out / "run.json").exists() and process.poll() is None and time.monotonic() < deadline:
        time.sleep(0.01)
    time.sleep(delay_s)
    offspring = children(process.pid)
    victim = process.pid if whom == "main" else next(iter(offspring), None)
    if victim is not None and process.poll() is None:
        os.kill(victim, signal.Signals[name])
    ended = process.wait(timeout=120)
    assert gone(offspring), "a child outlived the run"
    if whom == "worker":
        assert ended == 0
    else:
        assert ended in ({0, -9} if name == "SIGKILL" else {0, 3})
    with start(path, out, "--resume") as again:
        assert again.wait(timeout=120) == 0
    assert mortal_bench.told(out) == undisturbed
    return str(ended)


@exhaustive
def test_a_run_whose_worker_is_killed_goes_on_and_has_the_rows_of_an_undisturbed_one(tmp_path, undisturbed):
    killed_at(tmp_path, "worker", "SIGINT", 1.9, undisturbed)


@pytest.mark.claims
@pytest.mark.parametrize("name", ["SIGKILL", "SIGTERM", "SIGINT"])
@pytest.mark.parametrize("whom", ["main", "worker"])
def test_kills_at_twenty_random_moments(tmp_path, undisturbed, whom, name):
    moments = random.Random(f"{whom} {name}")
    for number in range(20):
        folder = tmp_path / str(number)
        folder.mkdir()
        killed_at(folder, whom, name, moments.uniform(0.0, 3.5), undisturbed)


LATE = """
import os, sys
from benchharness import cli
class Late:
    def __del__(self, kill=os.kill, process=os.getpid(), number=int(sys.argv.pop())):
        kill(process, number)
late = Late()  # dies when modules do, after the interpreter's own handlers
cli.main()
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_who_interrupts_what_has_ended_changes_nothing(number):
    done = subprocess.run(
        [sys.executable, "-c", LATE, "--version", str(int(number))], capture_output=True, text=True, timeout=60
    )
    assert (done.returncode, done.stdout.startswith("benchharness"), done.stderr) == (0, True, "")


@exhaustive
def test_sigterm_ends_as_ctrl_c_does(tmp_path):
    path = study.write(tmp_path, '["a", "sleeps 2"]')
    with start(path, tmp_path / "out", stderr=subprocess.PIPE) as process:
        deadline = time.monotonic() + 60
        while not (tmp_path / "out" / "benches").exists():
            assert time.monotonic() < deadline and process.poll() is None
            time.sleep(0.02)
        offspring = children(process.pid)
        assert offspring
        process.send_signal(signal.SIGTERM)
        said = process.communicate(timeout=30)[1]
    assert (process.returncode, "interrupted" in said, "Traceback" in said) == (3, True, False)
    assert gone(offspring)
