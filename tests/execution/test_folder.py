"""The folder of a run: who may fill it, and what of it can be trusted."""

from __future__ import annotations

import json
import random

import pytest
from support.damage import damaged

from benchharness.execution import folder

PLAN = {"config": "study", "frames": [[0, 2]]}


def opened(path, resume=False, plan=PLAN):
    return folder.opened("study", path, plan, resume=resume)


def test_a_folder_is_filled_by_one_process_at_a_time(tmp_path):
    with opened(tmp_path / "out") as place:
        assert json.loads((place / "run.json").read_text()) == PLAN
        for resume, reason in [(True, "is being filled by another process"), (False, "holds a run")]:
            with pytest.raises(ValueError, match=reason), opened(place, resume):
                pass
    with opened(place, resume=True):
        pass


def test_two_that_begin_in_one_folder_exclude_each_other(tmp_path):
    (tmp_path / "out").mkdir()
    with (
        folder.platform.locked(tmp_path / "out" / "lock", lambda: None),
        pytest.raises(ValueError, match="is being filled by another process"),
        opened(tmp_path / "out"),
    ):
        pass
    assert not (tmp_path / "out" / "run.json").exists()


def test_no_link_is_followed_to_what_it_would_lock(tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "thesis.tex").write_text("all of it")
    (tmp_path / "out" / "lock").symlink_to(tmp_path / "thesis.tex")
    with pytest.raises(ValueError, match="cannot be written"), opened(tmp_path / "out"):
        pass
    assert (tmp_path / "thesis.tex").read_text() == "all of it"


def test_a_name_that_is_too_long_for_the_file_system_is_refused_and_nothing_is_made(tmp_path):
    for resume in (False, True):
        with pytest.raises(ValueError, match="name too long"), opened(tmp_path / "new" / (300 * "n"), resume):
            pass
    assert not any((tmp_path / "new").glob("*"))


def test_what_is_no_plan_is_no_run(tmp_path):
    for data in (b"[]", b"3", b"{", 100_000 * b"[", b"\xed\xa0\x80"):
        (tmp_path / "run.json").write_bytes(data)
        with pytest.raises(ValueError, match="holds no run"), opened(tmp_path, resume=True):
            pass


def test_pictures_of_work_that_was_cut_short_are_not_among_the_others(tmp_path):
    with opened(tmp_path / "out") as place:
        images = place / "images"
        with folder.pictures(images) as pictures:
            (pictures.folder / "a.png").write_text("a")
            known = pictures.keep()
            (pictures.folder / "b.png").write_text("half of")
        assert [path.name for path in images.iterdir()] == ["a.png"]
        (images / ".killed").mkdir()
        (images / ".killed" / "c.png").touch()
    with opened(place, resume=True):
        assert [path.name for path in images.iterdir()] == ["a.png"]
        assert folder.lost(images, known) == []
        (images / "a.png").write_text("b")
        assert folder.lost(images, known) == ["a.png"]
        (images / "a.png").unlink()
        assert folder.lost(images, known) == ["a.png"]


@pytest.mark.exhaustive
def test_a_journal_says_what_was_appended_or_that_it_is_damaged(tmp_path):
    """Bytes flipped, put in, left out, cut; lines doubled, left out, in another order: 2,000 journals from one seed."""
    path, rng = tmp_path / "journal.jsonl", random.Random(5)
    lines = [{"job": 0, "out": "newton", "status": "refused", "reason": "no \u00e4 \n room"}]
    lines += [{"job": 0, "frame": f, "records": [{"flip": f / 7, "ok": True}], "samples": []} for f in range(4)]
    for line in lines:
        folder.Journal(path).append(line)
    whole, refused = path.read_bytes(), 0
    assert folder.Journal(path).lines() == lines
    for _ in range(2000):
        path.write_bytes(damaged(whole, rng))
        try:
            found = folder.Journal(path).lines()
        except ValueError as error:
            assert "is damaged" in str(error)
            refused += 1
            continue
        for line in found:  # but for a seal that is no longer recognised, which is one more key
            assert {key: value for key, value in line.items() if key in ("job", "out", "frame", *lines[0], *lines[1])} in lines
        assert [line.get("frame") for line in found] == [None, 0, 1, 2, 3][: len(found)]
    assert refused > 1000
