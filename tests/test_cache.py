"""The cache: what makes a key, and what a crash or a damaged file leaves behind."""

from __future__ import annotations

import logging
import random

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
