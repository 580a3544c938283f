"""Shots of a camera beside the truth, by hand-made tellings with exact answers."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from launcher.outside import Exposure, Outside, nearest
from launcher.record.figures.camera.judged import (
    AFTER,
    ELSEWHERE,
    NOBODY,
    REPLACED,
    STILL,
    UNRECORDED,
    UNTOLD,
    Judge,
    Shot,
)
from tests.camera_tellings import END_NS, MOUNT, ONE, PATH, aim, everything, ns, still, turn
from trackfield.models.pointing import Direction
from trackfield.role import NS
from trackfield.world.path import Path


def judged(*shots: object, turns: tuple = (still(),), frames: tuple = (), **more: object) -> tuple[Shot, ...]:  # type: ignore[type-arg]
    outside = Outside(MOUNT, turns, tuple(shots), frames)  # type: ignore[arg-type]
    return Judge(outside, more.get("paths", ONE), more.get("end_ns", END_NS)).shots  # type: ignore[arg-type]


# --- where the camera looked ------------------------------------------------------------------------------------------


def test_the_camera_looks_where_its_motions_say() -> None:
    outside = Outside(MOUNT, (still(1.0), turn(2.0, 0.0, 40.0), turn(2.25, 20.0, -20.0)))
    assert outside.look_at(0) is None, "it has not told"
    assert outside.look_at(ns(1.5)) == Direction(0.0, 0.0)
    assert outside.look_at(ns(2.125)) == Direction(10.0, 0.0)
    assert outside.look_at(ns(2.25)) == Direction(20.0, 0.0), "a newer motion replaces it"
    assert outside.look_at(ns(2.5)) == Direction(0.0, 0.0)
    assert outside.look_at(ns(3.0)) == Direction(-20.0, 0.0)
    assert outside.look_at(ns(19.0)) == Direction(-20.0, 0.0), "and rests"


@given(st.lists(st.tuples(st.integers(0, 20), st.integers(-90, 90)), min_size=1, max_size=8), st.integers(0, 21))
def test_the_latest_motion_holds(told: list[tuple[int, int]], t_s: int) -> None:
    turns = tuple(still(t, pan) for t, pan in sorted(told, key=lambda one: one[0]))
    expected = [one.pan1 for one in turns if one.t_ns <= ns(t_s)]
    look = Outside(MOUNT, turns).look_at(ns(t_s))
    assert (look.pan if look else None) == (expected[-1] if expected else None)


def test_a_frame_is_of_the_latest_shot_of_its_number() -> None:
    first, other, again = aim(1.0, 2.0, 0.0), aim(3.0, 4.0, 0.0, shot=2), aim(5.0, 6.0, 0.0, shot=65537)
    outside = Outside(MOUNT, (), (first, other, again))
    assert outside.shot_of(Exposure(ns(4.0), 1, 0)) == first
    assert outside.shot_of(Exposure(ns(4.0), 2, 0)) == other
    assert outside.shot_of(Exposure(ns(5.0), 1, 0)) == again, "numbers on the wire are cyclic"
    assert outside.shot_of(Exposure(ns(0.5), 1, 0)) is None
    assert outside.shot_of(Exposure(ns(5.0), 3, 0)) is None


def test_the_nearest_target_is_meant() -> None:
    paths = {"a": PATH, "b": Path.of([(0.0, 0.0, 5.0, 0.0, 0.0), (5.0, 0.0, 5.0, 0.0, 0.0)])}
    found = nearest(paths, ns(4.0), 0.0, 0.0)
    assert found is not None and found.id == "b"
    found = nearest(paths, ns(6.0), 0.0, 0.0)
    assert found is not None and (found.id, found.x_m) == ("a", -40.0), "b has gone"
    assert nearest(paths, ns(30.0), 0.0, 0.0) is None


# --- shots ------------------------------------------------------------------------------------------------------------


def test_a_target_in_the_middle_of_the_picture() -> None:
    (shot,) = judged(aim(9.0, 10.0, 0.0))
    assert (shot.in_frame, shot.why, shot.target) == (True, "", "target")
    assert shot.error == (0.0, 0.0, 0.0)


def test_the_edge_of_the_picture_is_where_the_lens_ends() -> None:
    """Half of the picture is 24.4 degrees wide: 13.61 m at a distance of 30 m."""
    inside, outside = (judged(aim(9.0, 10.0, 0.0), turns=(still(0.0, pan),)) for pan in (24.3, 24.5))
    assert (inside[0].in_frame, outside[0].in_frame, outside[0].why) == (True, False, STILL)
    assert inside[0].error is not None and inside[0].error.pan_deg == pytest.approx(24.3)


def test_a_camera_that_still_turns_misses_the_target_and_that_is_said() -> None:
    (shot,) = judged(aim(12.5, 13.0, 30.0), turns=(still(), turn(12.9, 0.0, 45.0)))
    assert (shot.in_frame, shot.why) == (False, STILL)
    assert shot.error is not None
    assert (shot.error.place_m, shot.error.pan_deg) == pytest.approx((0.0, 8.0 - 45.0))


def test_a_camera_that_looks_where_it_was_told_to_and_the_target_is_elsewhere() -> None:
    (shot,) = judged(aim(9.0, 13.0, -20.0), turns=(turn(9.1, 0.0, -33.690067525979785),))
    assert (shot.in_frame, shot.why, shot.target) == (False, ELSEWHERE, "target")
    assert shot.error is not None and shot.error.place_m == pytest.approx(50.0)
    assert shot.slew_s == pytest.approx(33.690067525979785 / 80.0)


def test_an_error_in_pan_is_the_short_way_round() -> None:
    behind = {"target": Path.of([(0.0, 1.0, -60.0, 0.0, 0.0), (20.0, 1.0, -60.0, 0.0, 0.0)])}
    (shot,) = judged(aim(9.0, 10.0, -1.0, -60.0), turns=(still(0.0, -178.0),), paths=behind)
    assert shot.error is not None and abs(shot.error.pan_deg) < 10.0


def test_without_a_target_at_the_aim_nothing_is_seen() -> None:
    short = {"target": PATH.clip(0.0, 9.0)}
    (shot,) = judged(aim(9.0, 10.0, 0.0), paths=short)
    assert (shot.in_frame, shot.why, shot.target, shot.error) == (False, NOBODY, None, None)


@pytest.mark.parametrize(
    ("more", "why"),
    [
        ({"end_ns": ns(9.5)}, AFTER),
        ({"paths": {}}, UNRECORDED),
        ({"paths": {"target": replace(PATH, gaps=((9.0, 11.0),))}}, UNRECORDED),
        ({"turns": ()}, UNTOLD),
    ],
)
def test_shots_of_which_nobody_can_say_what_they_saw(more: dict[str, object], why: str) -> None:
    (shot,) = judged(aim(9.0, 10.0, 0.0), **more)  # type: ignore[arg-type]
    assert (shot.in_frame, shot.judged, shot.why, shot.error) == (None, False, why, None)


def test_a_shot_that_the_next_one_replaces_before_its_aim_is_not_judged() -> None:
    first, second = judged(aim(8.0, 10.0, 0.0), aim(9.0, 10.5, 5.0, shot=2))
    assert (first.in_frame, first.why) == (None, REPLACED)
    assert second.in_frame
    first, _ = judged(aim(8.0, 10.0, 0.0), aim(10.5, 11.0, 5.0, shot=2))
    assert first.in_frame, "the next one came after its aim"


def test_fixes_that_made_no_shot_are_not_judged() -> None:
    assert judged(aim(9.0, 10.0, 0.0, outcome="out of reach", shot=0)) == ()


# --- turning, frames --------------------------------------------------------------------------------------------------


def test_a_turn_counts_if_it_ends_where_the_camera_was_told_to_look() -> None:
    stopped, there = turn(8.95, 10.0, 10.0), turn(9.0, 10.0, 45.05)
    (shot,) = judged(aim(8.9, 13.0, 30.0), turns=(still(), stopped, there))
    assert shot.slew_s == pytest.approx(35.05 / 80.0), "not the stop before it"
    (shot,) = judged(aim(8.9, 13.0, 30.0), turns=(still(), turn(8.0, 0.0, 45.0), stopped))
    assert shot.slew_s is None, "the turn before the command is of another"


def test_frames_show_the_target_of_their_shot() -> None:
    """The target is in the picture of a camera that looks north from 8.64 s to 11.36 s: 13.61 m at 10 m/s."""
    frames = tuple(Exposure(ns(t_s), 1, number) for number, t_s in enumerate((8.6, 8.7, 11.3, 11.4, 20.0, 20.5)))
    (shot,) = judged(aim(8.5, 10.0, 0.0, cpa_ns=ns(7.2)), frames=frames)
    assert [seen for _, seen in shot.frames] == [False, True, True, False, False], "the last is after the run"
    assert shot.first_seen_s == pytest.approx(1.5)


def test_frames_of_a_shot_without_a_target_show_none() -> None:
    far = {"target": PATH.clip(0.0, 9.0)}
    (shot,) = judged(aim(8.5, 10.0, 0.0), frames=(Exposure(ns(8.8), 1, 0),), paths=far)
    assert [seen for _, seen in shot.frames] == [False]
    assert shot.first_seen_s is None


def test_frames_in_a_gap_of_the_truth_do_not_count() -> None:
    gap = {"target": replace(PATH, gaps=((8.9, 9.1),))}
    frames = (Exposure(ns(9.0), 1, 0), Exposure(ns(10.0), 1, 1))
    (shot,) = judged(aim(8.5, 10.0, 0.0), frames=frames, paths=gap)
    assert shot.frames == ((frames[1], True),)


def test_what_was_told_by_hand_is_judged() -> None:
    """The camera reaches 45 degrees at 9.5625 s; the target comes into its picture there later, and is met at 13 s."""
    (shot,) = Judge(everything(), ONE, END_NS).shots
    assert (shot.in_frame, shot.slew_s) == (True, 45.0 / 80.0)
    assert len(shot.frames) == 6 and shot.aim.cpa_ns == round(7.65 * NS)
