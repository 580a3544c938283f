"""A tracker's colour is the same wherever it is shown."""

from __future__ import annotations

from launcher.colours import PALETTE, tracker_colours
from trackfield.filters.trackers import TRACKERS


def test_a_packaged_tracker_always_has_its_own_colour() -> None:
    alone = {name: tracker_colours([name])[name] for name in TRACKERS.own}
    assert len(set(alone.values())) == len(alone)
    assert tracker_colours(list(reversed(alone))) == alone


def test_others_take_what_is_left() -> None:
    found = tracker_colours(["mine", "spcpf", "yours"])
    assert found["spcpf"] == tracker_colours(["spcpf"])["spcpf"]
    assert len(set(found.values())) == 3
    many = tracker_colours([f"t{index}" for index in range(2 * len(PALETTE))])
    assert set(many.values()) == set(PALETTE)
