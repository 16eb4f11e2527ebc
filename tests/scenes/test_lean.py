"""What lean scenes are made of: they leave out what is named, and everything that they keep is needed."""

from __future__ import annotations

import pytest
from support.small_room import box

from benchharness.scene import Object
from scenes.props.lean import without

THINGS = [Object(name, box((0, 0, 0), (1, 1, 1)), "a box of that name") for name in ("one", "two", "three")]


def test_what_is_named_is_left_out_and_the_order_stays():
    assert [thing.name for thing in without(THINGS, ["two"])] == ["one", "three"]
    assert without(iter(THINGS), []) == tuple(THINGS)


def test_a_name_that_no_object_has_is_refused():
    with pytest.raises(ValueError, match="four: no object; accepted: one, two, three"):
        without(THINGS, ["two", "four"])
