"""What methods are lent is theirs alone, and what they give back is looked at before anything is made of it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from support.mirror_room import mirror_room

from benchharness.api import Frame, Method, Reflection, Vertices
from benchharness.measure import contract
from benchharness.render.frame import FrameRenderer

SIZE = (32, 24)
PIXELS = SIZE[0] * SIZE[1]


@pytest.fixture(scope="module")
def made():
    return mirror_room()


@pytest.fixture
def frame(made) -> Frame:
    return FrameRenderer(made, *SIZE).render(0)


WRITES = {
    "field": lambda f: setattr(f, "n", f.n + 1),
    "in place": lambda f: f.n.__iadd__(1),
    "component": lambda f: f.n.x.__iadd__(1),
    "item": lambda f: f.n.x.__setitem__(0, 7.0),
    "scatter": lambda f: dr.scatter(f.radiance.x, mi.Float(7), mi.UInt32(3)),
    "scatter_add": lambda f: dr.scatter_add(f.poses, mi.Float(7), mi.UInt32(3)),
    "flags": lambda f: dr.scatter(f.active, ~f.active, dr.arange(mi.UInt32, PIXELS)),
    "list": lambda f: f.boxes.clear(),
    "surface": lambda f: f.proxies[0].vertices.__imul__(2),
    "number": lambda f: setattr(f.surfaces[0], "face_count", 1),
    "camera": lambda f: f.view.eye.x.__iadd__(1),
    "size": lambda f: setattr(f.view, "width", 1),
}


@pytest.mark.parametrize("write", WRITES.values(), ids=WRITES.keys())
def test_what_a_method_writes_into_its_frame_nobody_else_sees(frame, write):
    before, own = contract.fingerprint(frame), contract.lent(frame)
    assert contract.written(before, own) == ""
    write(own)
    dr.eval(own)
    assert contract.written(before, frame) == ""
    assert contract.written(before, own) != ""


def test_lending_copies_no_array(frame):
    own = contract.lent(frame)
    assert own.n is not frame.n and own.n.x.index == frame.n.x.index
    assert own.surfaces[0].vertices.index == frame.surfaces[0].vertices.index


def test_what_is_written_into_memory_itself_is_found_and_named(frame):
    before, own = contract.fingerprint(frame), contract.lent(frame)
    own.p.y.numpy()[[3, 4]] = [7.0, 8.0]
    assert contract.written(before, frame) == "p"
    own.surfaces[0].vertices.numpy()[:] = 0
    assert contract.written(before, frame) == "p, surfaces, proxies"  # the room's mirror is its own proxy


def test_numbers_in_another_order_are_another_frame(frame):
    before = contract.fingerprint(frame)
    n = frame.n
    assert contract.written(before, replace(frame, n=mi.Normal3f(n.y, n.x, n.z))) == "n"
    assert contract.written(before, replace(frame, poses=dr.reverse(frame.poses))) == "poses"


def test_meshes_and_panoramas_of_a_scene_cannot_be_written_to(made):
    for name in ("vertices", "faces", "normals", "albedo", "emission", "radiance"):
        with pytest.raises(ValueError, match="read-only"):
            getattr(made.objects[0].mesh, name)[0] = 0
    own = np.zeros((3, 3))
    replace(made.objects[0].mesh, vertices=np.vstack([own, made.objects[0].mesh.vertices[3:]]))
    own[0] = 1  # what an author built a mesh from stays the author's


def good(count: int = PIXELS, **more: Any) -> Reflection:
    filled = dr.full(mi.Float, 0.5, count)
    return Reflection(mi.Color3f(filled), filled, filled > 0, **more)


def vertices(made, **more: Any) -> Vertices:
    zero = dr.zeros(mi.Float, len(made.reflectors) * made.vertices)
    flags, numbers = zero > 1, mi.UInt32(zero)
    point = mi.Point3f(zero)
    whole = Vertices(point, mi.Normal3f(zero), mi.Point3f(zero), ~flags, flags, numbers, numbers + 1, zero, flags)
    return replace(whole, **more)


def looped(made) -> Vertices:
    own = vertices(made)
    own.further.append(own)
    return own


BAD = {
    "nothing": (lambda made: None, "shade returns None; accepted: a Reflection and the next state"),
    "no state": (lambda made: good(), "shade returns Reflection; accepted: a Reflection and the next state"),
    "three": (lambda made: (good(), 0, 0), "shade returns a tuple of 3; accepted"),
    "L": (lambda made: replace(good(), L=mi.Float(1)), "L is Float; accepted: Color3f"),
    "lanes": (lambda made: replace(good(), L=mi.Color3f(dr.zeros(mi.Float, 7))), "L has 7 lanes; accepted: 768, one per pixel"),
    "none": (lambda made: replace(good(), distance=None), "distance is None; accepted: Float"),
    "float found": (lambda made: replace(good(), found=mi.Float(1)), "found is Float; accepted: Bool"),
    "doubt": (lambda made: good(doubt=mi.UInt32(1)), "doubt is UInt; accepted: Bool, or None"),
    "counters": (lambda made: good(counters=None), "counters is None; accepted: a dict, name -> UInt32"),
    "list": (lambda made: good(counters={"work": [1, 2]}), "counter work is list; accepted: UInt32"),
    "empty": (lambda made: good(counters={"work": None}), "counter work is None; accepted: UInt32"),
    "huge": (lambda made: good(counters={"work": 10**40}), "counter work is int; accepted: UInt32"),
    "float": (lambda made: good(counters={"work": mi.Float(1)}), "counter work is Float; accepted: UInt32"),
    "name": (lambda made: good(counters={"a b": mi.UInt32(1)}), "a counter is called 'a b'; accepted: an identifier"),
    "long": (lambda made: good(counters={"a" * 9999: mi.UInt32(1)}), "accepted: an identifier of at most 64 characters"),
    "number": (lambda made: good(counters={7: mi.UInt32(1)}), "a counter is called 7; accepted: an identifier"),
    "many": (lambda made: good(counters={f"a{i}": mi.UInt32(1) for i in range(99)}), "there are 99 counters; accepted"),
    "no vertices": (lambda made: good(vertices={}), "vertices is dict; accepted: Vertices, or None"),
    "R": (lambda made: good(vertices=vertices(made, R=None)), "vertices.R is None; accepted: Point3f"),
    "one vertex": (
        lambda made: good(vertices=vertices(made, iterations=mi.UInt32(0))),
        "vertices.iterations has 1 lanes; accepted: ",
    ),
    "region": (lambda made: good(vertices=vertices(made, region=mi.Float(0))), "vertices.region is Float; accepted: UInt"),
    "nowhere": (
        lambda made: good(vertices=vertices(made, R=mi.Point3f(dr.full(mi.Float, dr.nan, made.vertices)))),
        "that converged have no place; accepted: finite R and virtual",
    ),
    "further": (lambda made: good(vertices=vertices(made, further=None)), "vertices.further is None; accepted: a list"),
    "loop": (lambda made: good(vertices=looped(made)), "further[0].further is not empty"),
}  # fmt: skip


@pytest.mark.parametrize(("build", "says"), BAD.values(), ids=BAD.keys())
def test_what_is_no_answer_is_named_with_what_would_be(made, frame, build, says):
    built = build(made)
    shaded = (built, 0) if isinstance(built, Reflection) and says[:5] != "shade" else built
    with pytest.raises((TypeError, ValueError)) as error:
        contract.answer(shaded, frame, made)
    assert says in str(error.value)
    assert len(str(error.value)) < 200


def test_a_whole_answer_comes_back_as_it_was_whatever_becomes_of_the_methods_own(made, frame):
    own = good(counters={"work": mi.UInt32([1, 2**32 - 1])}, vertices=vertices(made), doubt=mi.Bool(False))
    kept, state = contract.answer((own, 5), frame, made)
    assert state == 5
    own.L *= 2
    own.vertices.R += 1
    own.counters.clear()
    assert kept.L.x[0] == 0.5 and kept.vertices is not None and kept.vertices.R.x[0] == 0
    assert contract.counted(kept) == {"work": 2**32}
    contract.answer((good(1), None), frame, made)  # one lane for all


@dataclass(frozen=True)
class Refusing(Method):
    paper: ClassVar[str] = "none"
    says: Any = field(default=None)

    def refuses(self, scene):
        return self.says

    def prepare(self, scene):
        return None

    def shade(self, state, frame):
        return good(), None


def test_a_refusal_is_a_sentence_in_one_line_or_none(made):
    assert contract.refusal(Refusing(), made) is None
    assert contract.refusal(Refusing("not\n star-shaped"), made) == "not star-shaped"
    assert len(contract.refusal(Refusing("no " * 1_000_000), made) or "") < 1100
    for value, kind in ((False, "bool"), (b"no", "bytes"), ("", "str"), (7, "int"), (["no"], "list")):
        with pytest.raises(TypeError, match=f"refuses returns {kind}; accepted: a sentence, or None"):
            contract.refusal(Refusing(value), made)


class Speechless(Exception):
    def __str__(self) -> str:
        raise RuntimeError("not even that")


def test_an_exception_is_told_in_one_short_line_whatever_it_says():
    assert contract.account(KeyError("moved")) == "KeyError: 'moved'"
    assert contract.account(Speechless()) == "Speechless: it cannot say why (RuntimeError)"
    assert contract.account(ValueError("a\nb")) == "ValueError: a b"
    assert len(contract.account(ValueError("x" * 2_000_000))) < 1100
