"""What is said of work that takes long: how far it is, how long it takes yet, and what makes it cheaper."""

from __future__ import annotations

from io import StringIO

import pytest
from rich.console import Console

from benchharness.render import making
from benchharness.render.making import Pace, Share, Teller

KEY = "[reference] bake_spp = 512"


class Clock:
    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


def light(done: int, total: int = 100, cheaper: str = KEY) -> Share:
    return Share("vase, light", done, total, cheaper)


def said(step_s: float, every_s: float = 0.0, keys=None, first: int = 0, step: int = 10) -> list[str]:
    """The lines of work in parts of `step` %, each of which takes `step_s`."""
    clock, lines = Clock(), []
    tell = Teller(lines.append, every_s, keys, clock)
    for done in range(first, 101, step):
        tell(light(done))
        clock.now += step_s
    return lines


def test_every_line_says_how_far_it_is_and_but_for_the_first_and_the_last_how_long_it_takes_yet():
    # 10 % take 2 s: of 20 s, 2 (10 - n) are left after n parts.
    lines = said(2.0)
    assert lines[0] == "vase, light: 0 %" and lines[-1] == "vase, light: 100 %"
    assert lines[1:-1] == [f"vase, light: {10 * n} %, about {2 * (10 - n)} s left" for n in range(1, 10)]


def test_the_key_is_named_as_soon_as_it_is_expected_to_take_more_than_a_minute_and_no_sooner():
    assert all(KEY not in line for line in said(6.0)), "60 s"
    slow = said(6.1)
    assert KEY not in slow[0], "nothing is known yet"
    assert slow[1] == f"vase, light: 10 %, about 55 s left; less than {KEY} is quicker"
    assert all(line.endswith(f"; less than {KEY} is quicker") for line in slow[1:-1])
    assert slow[-1] == "vase, light: 100 %"


def test_a_key_that_is_not_in_force_is_not_named():
    assert all(KEY not in line for line in said(100.0, keys=()))
    assert KEY in said(100.0, keys={KEY})[1]


def test_what_was_in_the_cache_tells_nothing_of_what_is_left():
    # 80 % were there. 10 % took 30 s: so will the other 10.
    assert said(30.0, first=80) == ["vase, light: 80 %", "vase, light: 90 %, about 30 s left", "vase, light: 100 %"]


def test_lines_that_stay_are_seldom_and_end_with_the_end():
    # Parts of 1 % that take 4 s: a line every 32 s, from 8 % on, and the end.
    lines = said(4.0, every_s=30.0, step=1)
    assert [int(line.partition(": ")[2].partition(" %")[0]) for line in lines] == [*range(8, 100, 8), 100]
    assert said(0.2, every_s=30.0, step=1) == [], "20 s in all"
    assert said(3.1, every_s=30.0) == [], "31 s, of which there is nothing to say but that they are over"


def test_several_works_at_once_and_one_that_begins_anew_are_told_apart():
    clock = Clock()
    pace = Pace(clock)
    pace.hear(light(0))
    clock.now += 10.0
    other = Share("bowl, light", 0, 100)
    assert pace.hear(other).left_s is None and pace.hear(light(50)).left_s == pytest.approx(10.0)
    clock.now += 10.0
    assert pace.hear(Share("bowl, light", 10, 100)).left_s == pytest.approx(90.0)
    assert pace.hear(light(20)).left_s == pytest.approx(20.0 * 80 / 20), "less is done, and not less than at first"
    pace = Pace(clock)
    pace.hear(light(50))
    clock.now += 10.0
    assert pace.hear(light(0)).took_s == 0.0, "a process died, and nothing was kept"


@pytest.mark.parametrize("terminal", [True, False])
def test_brackets_of_keys_and_names_are_shown_in_a_terminal_and_elsewhere(terminal):
    shown, clock = StringIO(), Clock()
    console = Console(file=shown, force_terminal=terminal, width=200, color_system=None)
    with console.status("baking") as status:
        teller = making.teller(console, status, {KEY})
        teller._clock = teller._pace._clock = clock
        for done in (0, 10, 20):
            teller(Share("vase[1], light", done, 100, KEY))
            clock.now += 40.0
        if terminal:
            console.print(status.renderable)
    assert f"vase[1], light: 20 %, about 5 min left; less than {KEY} is quicker" in shown.getvalue()


def test_nobody_need_hear():
    making.tell(light(0))
    heard: list[Share] = []
    with making.told(heard.append):
        making.tell(light(1))
        making.tell(Share("nothing", 0, 0))
    making.tell(light(2))
    assert heard == [light(1)]


@pytest.mark.parametrize(
    "changed",
    [{"done": -1}, {"done": 101}, {"total": 0, "done": 0}, {"done": 1.5}, {"done": True}, {"what": 3}, {"cheaper": None}],
)
def test_what_another_process_says_is_a_share_or_is_refused(changed):
    plain = {"what": "vase, light", "done": 3, "total": 100, "cheaper": KEY}
    assert making.share_of({**plain, "event": "makes"}) == light(3)
    with pytest.raises(ValueError, match="is no share of anything"):
        making.share_of({**plain, **changed})
    with pytest.raises(ValueError, match="is no share of anything"):
        making.share_of({"what": "vase, light"})
