"""How a run tells how far it is, from the worker to the console; and what has time, and whose the machine is, meanwhile."""

from __future__ import annotations

from dataclasses import asdict
from io import StringIO

import mitsuba as mi  # noqa: F401  (so that the variant is set)
import pytest
from rich.console import Console
from support import study
from support.ear import Ear

from benchharness import processes
from benchharness.execution import attempt, progress, runner, worker
from benchharness.render.making import Share
from benchharness.study import config
from benchharness.study.scenes import SceneSpec

KEY = "[reference] bake_spp = 512"
SPEC = SceneSpec("vase", "vase", None, False, {}, "", "vase")


def told(*, terminal: bool, step_s: float) -> str:
    """What a console shows of light in parts of 10 %."""
    shown = StringIO()
    console = Console(file=shown, force_terminal=terminal, width=160, color_system=None)
    now = [0.0]
    with progress.listener(console) as listener:
        pace = listener._pace if isinstance(listener, progress.Bars) else listener._teller._pace
        pace._clock = lambda: now[0]
        if isinstance(listener, progress.Lines):
            listener._teller._clock = pace._clock
        listener.job(0, config.Job(SPEC, [0, 1], [], {"scene": "vase", "detail": "lean"}, [], []), 2)
        for done in range(0, 101, 10):
            listener.making(Share("vase, light", done, 100, KEY))
            if isinstance(listener, progress.Bars) and done < 100:
                listener._progress.refresh()
            now[0] += step_s
    return shown.getvalue()


def test_a_terminal_has_a_bar_of_light_with_the_time_left_and_names_the_key_once():
    shown = told(terminal=True, step_s=40.0)
    assert "vase, light: 50 %, about 3 min left" in shown and "50/100" in shown
    assert shown.count(f"less than {KEY} is quicker") == 1
    assert KEY not in told(terminal=True, step_s=5.0)
    last = shown.rpartition("vase (lean)")[2]
    assert "light" not in last, "the bar goes when the light is there"


def test_elsewhere_there_are_lines_seldom():
    lines = told(terminal=False, step_s=40.0).splitlines()
    assert lines[0].startswith("vase (lean): 2 of 2 frames") and lines[-1] == "  vase, light: 100 %"
    assert lines[1] == f"  vase, light: 10 %, about 6 min left; less than {KEY} is quicker"
    assert len(told(terminal=False, step_s=10.0).splitlines()) == 1 + 3 + 1, "every 30 s of 100, and the end"
    assert len(told(terminal=False, step_s=1.0).splitlines()) == 1, "what is quick is not spoken of"


def test_shares_come_from_the_worker_in_their_order_and_stay_out_of_the_journal(tmp_path, plugins_here):
    path, ear = study.write(tmp_path, '["a"]'), Ear()
    code, folder = runner.run(config.load(path), tmp_path / "out", ear, bench="support.study:Telling")
    assert code == 0
    frames = [Share(f"reference {frame}", done, 2, "") for frame in (0, 2, 4) for done in (0, 2)]
    assert ear.shares == [Share("light", done, 3, KEY) for done in range(4)] + frames
    assert "makes" not in (folder / runner.folder.JOURNAL).read_text()


SAYS = """
import json, sys, time
def say(**event): print(json.dumps(event), flush=True)
for done in range(5):
    say(event="makes", what="light", done=done, total=9 if "nonsense" not in sys.argv else -9, cheaper="")
    time.sleep(0.8)
if "method" in sys.argv:
    say(event="watch", entry="a")
    for done in range(5):
        time.sleep(0.8)
        say(event="makes", what="light", done=done, total=9, cheaper="")
if "hangs" in sys.argv: time.sleep(60)
say(event="ready")
say(event="frame", frame=0, records=[{"entry": "a"}], samples=[], pictures={})
say(event="done")
"""


@pytest.mark.parametrize(
    ("word", "failed", "events"),
    [
        ("goes on", None, [*5 * ["makes"], "frame"]),
        ("hangs", "the preparation of the scene took more than 2.5 s", 5 * ["makes"]),
        pytest.param("method", "the preparation of the scene took more than 2.5 s", None, marks=pytest.mark.exhaustive),
        ("nonsense", "is no share of anything", []),
    ],
)
def test_light_that_gets_on_has_time_and_what_hangs_or_is_a_method_has_no_more(word, failed, events, tmp_path, monkeypatch):
    """Four seconds, of two and a half."""
    (tmp_path / "says.py").write_text(SAYS)
    monkeypatch.syspath_prepend(tmp_path)
    child, heard = processes.Child("says", word, log=tmp_path / "log"), []
    try:
        said = attempt.heard(child, 2.5, {"a"}, {0}, attempt.Ending())
        while True:
            heard.append(next(said)["event"])
    except StopIteration as end:
        assert (failed in end.value) if failed else end.value is None
    finally:
        child.end()
    assert events is None or heard == events


def test_the_machine_is_free_while_light_is_baked_and_references_are_rendered_and_held_while_methods_run(
    tmp_path, monkeypatch, plugins_here
):
    """The bench that measures, and light that is traced."""
    monkeypatch.setenv("BENCHHARNESS_CACHE", str(tmp_path / "cache"))
    loaded = config.load(study.write(tmp_path, '["a"]', run="min_rounds = 1\nmax_rounds = 1"))
    job, setting = loaded.jobs[0], runner._setting(loaded, tmp_path, "", runner.BENCH)
    document = {**setting.document, "scene": asdict(job.scene), "entries": [asdict(entry) for entry in job.entries]}
    document |= {"frames": job.frames[1:2], "images": [], "out": None, "reference": {**loaded.reference, "bake_spp": 4}}
    seen: list[tuple[str, str]] = []

    def say(event: dict) -> None:
        if event["event"] == "makes":
            seen.append((event["what"], study.machine()))
        elif event["event"] in ("watch", "frame"):
            seen.append((event["event"], study.machine()))

    worker._work(document, say)
    begun = next(i for i, (what, _) in enumerate(seen) if "reference" in what)
    made = [(what.partition(", ")[2].split(" ")[0], state) for what, state in seen if what.startswith("place")]
    assert {("light", "free"), ("reference", "free")} == set(made)
    assert {state for what, state in seen[begun:] if what == "watch"} == {"held"}
    assert seen[-1] == ("frame", "free")
