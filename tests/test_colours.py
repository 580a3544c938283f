"""A tracker's colour is the same wherever it is shown."""

from __future__ import annotations

from launcher.colours import PALETTE, tracker_colours
from trackfield.filters.trackers import TRACKERS


def test_a_packaged_tracker_always_has_its_own_colour() -> None:
    alone = {name: tracker_colours([name])[name] for name in TRACKERS.own}
    assert len(set(alone.values())) == len(alone)
    assert tracker_colours(list(reversed(alone))) == alone


def test_the_former_name_has_the_colour_of_the_new_one_unless_both_are_there() -> None:
    new = tracker_colours(["imm-ukf"])["imm-ukf"]
    former = tracker_colours(["fix-imm-ukf", "mine"])
    assert former["fix-imm-ukf"] == new != former["mine"]
    both = tracker_colours(["fix-imm-ukf", "imm-ukf"])
    assert both["imm-ukf"] == new != both["fix-imm-ukf"]


def test_others_take_what_is_left() -> None:
    found = tracker_colours(["mine", "spcpf", "yours"])
    assert found["spcpf"] == tracker_colours(["spcpf"])["spcpf"]
    assert len(set(found.values())) == 3
    many = tracker_colours([f"t{index}" for index in range(2 * len(PALETTE))])
    assert set(many.values()) == set(PALETTE)


def test_no_tracker_is_grey_as_the_target_is() -> None:
    for colour in PALETTE:
        channels = [int(colour[first : first + 2], 16) for first in (1, 3, 5)]
        assert max(channels) - min(channels) > 40  # of the greys of target and sensors 27
