"""Bakes and references that are killed and begun again; and what is told of them while they are made."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from itertools import pairwise

import numpy as np
import pytest
from support.killed import Killed, Mortal
from support.mirror_room import scene
from support.small_room import box, quad, small_room

from benchharness import cache
from benchharness.render import bake as bake_module
from benchharness.render import making
from benchharness.render import reference as reference_module
from benchharness.render.bake import bake
from benchharness.render.making import Share
from benchharness.render.reference import ReferenceOptions, render
from benchharness.scene import Gloss, Object, PointLight, Scene

SPP = 16
SIZE = (12, 8)
SEVEN = ReferenceOptions(lighting="transport", spp=7, max_depth=3)


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("BENCHHARNESS_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(cache, "KEEP_S", 0.0)
    monkeypatch.setattr(cache, "KEEP_TIMES", 0.0)


def lamplit(*, lightmaps: bool) -> Scene:
    """A stone on a floor that shines, under a lamp: with light maps light is found at vertices, on a grid, and finer."""
    stone = box((-0.5, -0.5, 0), (0.5, 0.5, 0.6))
    floor = Object("floor", quad((-2, -2, 0), (4, 0, 0), (0, 4, 0)), "gloss", gloss=Gloss((0.2, 0.2, 0.2), 20.0))
    lamp = PointLight((0.3, 0.2, 3), (9, 9, 9))
    return scene((Object("stone", stone, "shadow"), floor), (), lights=(lamp,), lightmaps=lightmaps, background=(0.1, 0.2, 0.3))


def in_parts(monkeypatch, lightmaps: bool) -> None:
    """Few vertices at a time: some parts, whatever is baked."""
    monkeypatch.setattr(bake_module, "LANES", SPP * (512 if lightmaps else 8))


def bits(made: Scene) -> list[bytes]:
    """All light that is kept."""
    meshes = [part.mesh for part in made.objects]
    maps = [mesh.light.samples for mesh in meshes if mesh.light is not None]
    return [np.asarray(values).tobytes() for mesh in meshes for values in (mesh.radiance, mesh.visibility, mesh.faces)] + [
        samples.tobytes() for samples in maps
    ]


def left_in_parts() -> list[str]:
    return [str(path) for path in cache.cache_folder().rglob("*.parts")]


def heard(work: Callable[[], object]) -> list[Share]:
    """What is told of work, which may be killed."""
    shares: list[Share] = []
    with making.told(shares.append), suppress(Killed):
        work()
    return shares


def by_work(shares: list[Share]) -> dict[str, list[Share]]:
    found: dict[str, list[Share]] = {}
    for share in shares:
        found.setdefault(share.what, []).append(share)
    return found


@pytest.mark.parametrize("lightmaps", [False, True], ids=["vertices", "maps"])
def test_a_bake_that_is_killed_goes_on_with_the_parts_that_are_missing_and_ends_in_the_same_bits(
    lightmaps, tmp_path, monkeypatch
):
    made, paths = lamplit(lightmaps=lightmaps), bake_module._paths
    whole = bits(bake(made, spp=SPP))  # as many vertices at a time as there are
    in_parts(monkeypatch, lightmaps)
    monkeypatch.setenv("BENCHHARNESS_CACHE", str(tmp_path / "undisturbed"))
    undisturbed = Mortal(paths)
    monkeypatch.setattr(bake_module, "_paths", undisturbed)
    assert bits(bake(made, spp=SPP)) == whole
    assert undisturbed.calls > 3

    monkeypatch.setenv("BENCHHARNESS_CACHE", str(tmp_path / "killed"))
    first, second = undisturbed.calls // 3, undisturbed.calls // 3
    for calls in (first, second):
        monkeypatch.setattr(bake_module, "_paths", Mortal(paths, calls))
        with pytest.raises(Killed):
            bake(made, spp=SPP)
        assert left_in_parts()
    last = Mortal(paths)
    monkeypatch.setattr(bake_module, "_paths", last)
    assert bits(bake(made, spp=SPP)) == whole
    assert first + second + last.calls == undisturbed.calls
    assert not left_in_parts()


@pytest.mark.parametrize("lightmaps", [False, True], ids=["vertices", "maps"])
def test_a_bake_says_how_far_it_is_and_the_key_that_makes_it_cheaper(lightmaps, monkeypatch):
    in_parts(monkeypatch, lightmaps)
    made, paths = lamplit(lightmaps=lightmaps), bake_module._paths
    monkeypatch.setattr(bake_module, "_paths", Mortal(paths, 2))
    before = heard(lambda: bake(made, spp=SPP))
    monkeypatch.setattr(bake_module, "_paths", paths)
    after = heard(lambda: bake(made, spp=SPP))
    assert before[-1].done > 0 and before[-1] in after, "it goes on where it was"
    told = by_work(before + after)
    first, *rest = (name.removeprefix("mirror_room, ") for name in told)
    finer = [f"finer light, {number} of at most 8 times" for number in range(1, len(rest))]
    assert (first, rest) == ("light at vertices", ["light", *finer] if lightmaps else [])
    assert bool(finer) == lightmaps
    for shares in told.values():
        assert all(one.done <= other.done and one.total == other.total for one, other in pairwise(shares))
        assert shares[0].done == 0 and shares[-1].done == shares[-1].total
    assert {share.cheaper for share in before + after} == {f"[reference] bake_spp = {SPP}"}
    assert heard(lambda: bake(made, spp=SPP)) == [], "what the cache has is not made"


def same(one: reference_module.Reference, other: reference_module.Reference) -> bool:
    names = ("image", "variance", "mask", "reflector", "distance", "second", "back")
    return one.spp == other.spp and all(getattr(one, name).tobytes() == getattr(other, name).tobytes() for name in names)


def test_a_reference_that_is_killed_goes_on_with_the_passes_that_are_missing_and_ends_in_the_same_bits(tmp_path, monkeypatch):
    monkeypatch.setattr(reference_module, "LANES", 2 * SIZE[0] * SIZE[1])  # passes of 2, 2, 2 and 1
    room, rays = small_room(1.0), reference_module.camera_rays
    whole = render(room, 0.0, SIZE, SEVEN)

    monkeypatch.setenv("BENCHHARNESS_CACHE", str(tmp_path / "killed"))
    monkeypatch.setattr(reference_module, "camera_rays", Mortal(rays, 3))
    before = heard(lambda: render(room, 0.0, SIZE, SEVEN))
    assert left_in_parts()
    last = Mortal(rays)
    monkeypatch.setattr(reference_module, "camera_rays", last)
    after = heard(lambda: same(render(room, 0.0, SIZE, SEVEN), whole) or pytest.fail("other bits"))
    assert last.calls == 1 + 1, "the last pass, and the rays that find the mirrors"
    assert not left_in_parts()
    assert [(share.done, share.total) for share in before] == [(0, 7), (2, 7), (4, 7), (6, 7)]
    assert [(share.done, share.total) for share in after] == [(6, 7), (7, 7)]
    assert {(share.what, share.cheaper) for share in before + after} == {
        ("small_room, reference at 0 s", "[reference] spp = 7")
    }


def test_a_reference_without_noise_that_is_killed_after_its_two_rays_traces_no_more(monkeypatch):
    lit, rays = bake(small_room(1.0), spp=4), reference_module.camera_rays
    monkeypatch.setattr(reference_module, "camera_rays", Mortal(rays, 1))
    with pytest.raises(Killed):
        render(lit, 0.0, SIZE)
    last = Mortal(rays)
    monkeypatch.setattr(reference_module, "camera_rays", last)
    shares = heard(lambda: render(lit, 0.0, SIZE))
    assert (last.calls, render(lit, 0.0, SIZE).spp) == (1, 2)
    assert [(share.done, share.total) for share in shares] == [(64, 64)]


def test_a_part_that_is_damaged_is_made_again(tmp_path, monkeypatch, caplog):
    monkeypatch.setattr(reference_module, "LANES", 2 * SIZE[0] * SIZE[1])
    room, rays = small_room(1.0), reference_module.camera_rays
    whole = render(room, 0.0, SIZE, SEVEN)
    monkeypatch.setenv("BENCHHARNESS_CACHE", str(tmp_path / "damaged"))
    monkeypatch.setattr(reference_module, "camera_rays", Mortal(rays, 3))
    with pytest.raises(Killed):
        render(room, 0.0, SIZE, SEVEN)
    (part,) = cache.cache_folder().rglob("*.parts/*.npz")
    part.write_bytes(part.read_bytes()[:-200])
    monkeypatch.setattr(reference_module, "camera_rays", rays)
    assert same(render(room, 0.0, SIZE, SEVEN), whole)
    assert part.name in caplog.text and not left_in_parts()
