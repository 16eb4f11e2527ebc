"""The cache: what makes a key, and what a crash or a damaged file leaves behind."""

from __future__ import annotations

import logging
import random
from types import SimpleNamespace

import numpy as np
import pytest
from support.damage import damaged

from benchharness import cache


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("BENCHHARNESS_CACHE", str(tmp_path / "cache"))


def test_keys_differ_by_value_type_shape_and_grouping() -> None:
    a = np.arange(6.0)
    contents = [
        (1,),
        (1.0,),
        (True,),
        ("1",),
        (b"1",),
        ([1],),
        (None,),
        (1, 2),
        ((1, 2),),
        ({"a": 1},),
        (a,),
        (a.reshape(2, 3),),
        (a.astype(np.float32),),
        (-a,),
        (("a", "bc"),),
        (("ab", "c"),),
    ]
    assert len({cache.content_hash(*content) for content in contents}) == len(contents)
    assert cache.content_hash({"a": 1, "b": 2}) == cache.content_hash({"b": 2, "a": 1})
    assert cache.content_hash(a[::2]) == cache.content_hash(a[::2].copy())
    with pytest.raises(TypeError, match="object"):
        cache.content_hash(object())


def test_an_entry_is_computed_once() -> None:
    calls = []

    def compute():
        calls.append(1)
        return {"x": np.eye(3, dtype=np.float32)}

    first, second = (cache.cached("kind", "key", compute) for _ in range(2))
    assert len(calls) == 1
    assert second["x"].dtype == np.float32
    assert np.array_equal(first["x"], second["x"])


def test_an_entry_that_is_not_what_was_filed_under_its_key_is_made_again(caplog) -> None:
    """Another key's entry; one without a checksum, as of old; keys and shapes that nobody filed; what is no archive."""
    x = {"x": np.arange(6.0)}
    cache.cached("kind", "other", lambda: {"x": np.ones(6)})
    path = cache.cache_folder() / "kind" / "key.npz"
    whole = path.with_name("other.npz").read_bytes()
    with np.load(path.with_name("other.npz")) as entry:
        seal = entry["checksum"]
    for wrong in [
        whole,
        {"x": np.arange(6.0)},
        {"x": np.arange(6.0).reshape(2, 3), "checksum": seal},
        {"y": np.arange(6.0), "checksum": seal},
        {"x": np.arange(6.0), "checksum": np.array("text")},
        {"x": np.array([object()]), "checksum": seal},
        np.arange(6.0),
    ]:
        if isinstance(wrong, bytes):
            path.write_bytes(wrong)
        elif isinstance(wrong, dict):
            np.savez(path, **wrong)
        else:
            with path.open("wb") as file:
                np.save(file, wrong)
        caplog.clear()
        with caplog.at_level(logging.WARNING):
            assert np.array_equal(cache.cached("kind", "key", lambda: x)["x"], x["x"])
        assert "key.npz" in caplog.text
        assert list(cache.cached("kind", "key", lambda: pytest.fail("not mended"))) == ["x"]


def test_no_damage_of_an_entry_is_believed_or_stops_anything(caplog) -> None:
    """400 damaged entries, from one seed."""
    rng = random.Random(7)
    good = {"image": np.arange(60, dtype=np.float32).reshape(4, 5, 3), "mask": np.eye(4, dtype=bool), "spp": np.array(64)}
    cache.cached("kind", "key", lambda: good)
    path = cache.cache_folder() / "kind" / "key.npz"
    whole = path.read_bytes()
    for _ in range(400):
        path.write_bytes(damaged(whole, rng))
        found = cache.cached("kind", "key", lambda: good)
        assert list(found) == list(good)
        for name, array in good.items():
            assert found[name].dtype == array.dtype and np.array_equal(found[name], array)


@pytest.mark.parametrize("damage", ["empty", "cut", "flipped"])
def test_a_damaged_entry_is_made_again_and_said_so(damage: str, caplog) -> None:
    cache.cached("kind", "key", lambda: {"x": np.arange(1000)})
    path = cache.cache_folder() / "kind" / "key.npz"
    data = bytearray(path.read_bytes())
    if damage == "flipped":
        data[len(data) // 2] ^= 0xFF
    path.write_bytes({"empty": b"", "cut": data[: len(data) // 2], "flipped": bytes(data)}[damage])
    with caplog.at_level(logging.WARNING):
        again = cache.cached("kind", "key", lambda: {"x": np.arange(1000)})
    assert np.array_equal(again["x"], np.arange(1000))
    assert "key.npz" in caplog.text
    assert np.array_equal(cache.cached("kind", "key", lambda: pytest.fail("not mended"))["x"], np.arange(1000))


def test_a_crash_while_writing_leaves_no_entry(monkeypatch) -> None:
    def crash(file, **arrays):
        file.write(b"half of it")
        raise KeyboardInterrupt

    monkeypatch.setattr(cache.np, "savez", crash)
    with pytest.raises(KeyboardInterrupt):
        cache.cached("kind", "key", lambda: {"x": np.zeros(3)})
    assert list((cache.cache_folder() / "kind").iterdir()) == []


def test_a_folder_that_cannot_be_written_costs_the_entry_only(tmp_path, monkeypatch, caplog) -> None:
    (tmp_path / "file").write_text("not a folder")
    monkeypatch.setenv("BENCHHARNESS_CACHE", str(tmp_path / "file"))
    assert cache.cached("kind", "key", lambda: {"x": np.ones(1)})["x"] == 1
    assert "BENCHHARNESS_CACHE" in caplog.text


@pytest.fixture
def clock(monkeypatch):
    """Time stands still until it is told to go on."""
    now = [0.0]
    monkeypatch.setattr(cache, "time", SimpleNamespace(monotonic=lambda: now[0]))
    return now


def test_parts_are_there_for_whoever_goes_on_and_gone_when_the_whole_is_filed(clock) -> None:
    first = cache.Parts("kind", "key")
    for second in range(1, 26):
        clock[0] = float(second)
        first.put(str(second), {"x": np.full(3, second)})
    later = cache.Parts("kind", "key")
    kept = [second for second in range(1, 26) if later.get(str(second)) is not None]
    assert kept == list(range(1, 21)), "filed after 10 s and after 20"
    assert np.array_equal((later.get("7") or {})["x"], np.full(3, 7))
    other = cache.Parts("kind", "other")
    assert other.get("7") is None

    def compute(parts: cache.Parts) -> cache.Arrays:
        return {"sum": np.sum([(parts.get(str(second)) or {"x": np.zeros(3)})["x"] for second in range(1, 26)], axis=0)}

    assert np.array_equal(cache.cached_in_parts("kind", "key", compute)["sum"], np.full(3, 210))
    assert [path.name for path in (cache.cache_folder() / "kind").iterdir()] == ["key.npz"]
    first.put("26", {"x": np.ones(3)})
    clock[0] = 100.0
    first.put("27", {"x": np.ones(3)})  # somebody else makes the same, and is later
    assert (cache.cache_folder() / "kind" / "key.parts").exists()
    cache.cached_in_parts("kind", "key", lambda parts: pytest.fail("not cached"))
    assert [path.name for path in (cache.cache_folder() / "kind").iterdir()] == ["key.npz"]


def test_a_part_of_the_same_name_is_replaced(clock) -> None:
    parts = cache.Parts("kind", "key")
    for second in (11.0, 22.0):
        clock[0] = second
        parts.put("sums", {"x": np.array(second)})
    assert (cache.Parts("kind", "key").get("sums") or {})["x"] == 22.0


def test_filing_takes_a_twentieth_of_the_time_at_most(clock, monkeypatch) -> None:
    write = cache._write

    def slow(path, arrays):
        write(path, arrays)
        clock[0] += 3.0

    monkeypatch.setattr(cache, "_write", slow)
    parts, filed = cache.Parts("kind", "key"), []
    for _ in range(100):
        clock[0] += 1.0
        before = clock[0]
        parts.put("sums", {"x": np.array(before)})
        if clock[0] != before:
            filed.append(before)
    assert filed == [10.0, 73.0], "and 60 s after 13 s"


def test_a_kill_while_a_part_is_written_leaves_the_part_before(clock, monkeypatch) -> None:
    clock[0] = 11.0
    parts = cache.Parts("kind", "key")
    clock[0] = 22.0
    parts.put("sums", {"x": np.array(1)})

    def crash(file, **arrays):
        file.write(b"half of it")
        raise KeyboardInterrupt

    clock[0] = 33.0
    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(cache.np, "savez", crash)
        parts.put("sums", {"x": np.array(2)})
    assert (cache.Parts("kind", "key").get("sums") or {})["x"] == 1
    assert [path.name for path in (cache.cache_folder() / "kind" / "key.parts").iterdir()] == ["sums.npz"]


def test_a_folder_that_cannot_be_written_costs_the_parts_only_and_is_said_once(tmp_path, monkeypatch, caplog, clock) -> None:
    (tmp_path / "file").write_text("not a folder")
    monkeypatch.setenv("BENCHHARNESS_CACHE", str(tmp_path / "file"))

    def compute(parts: cache.Parts) -> cache.Arrays:
        for second in range(0, 100, 20):
            clock[0] = second
            parts.put(str(second), {"x": np.ones(1)})
        return {"x": np.ones(1)}

    assert cache.cached_in_parts("kind", "key", compute)["x"] == 1
    assert len(caplog.records) == 2, "a part, and the whole"
