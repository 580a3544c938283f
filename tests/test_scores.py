"""How a tracker is scored: errors, expected steps, blackouts, gaps of the truth, the bound beside it, the verdict."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import pytest

from launcher.record.figures.scores import scored
from launcher.record.metrics import tracker_metrics
from launcher.record.tables import TrackRow
from launcher.records import Plan
from tests.command_line import Call, trackfield
from tests.tiny import point, tiny
from trackfield.filters.metrics import Lost
from trackfield.role import NS
from trackfield.world.path import Path

__all__ = ["trackfield"]
LAST = Lost()
GOOD = (3, 4, 0, 0)
FAR = (99, 0, 0, 0)


def field(steps: int, *, there: int | None = None, lost: Lost = LAST, gaps: Sequence[tuple[float, float]] = ()) -> Plan:
    """So many steps, and a target that is there until one of them, with gaps in its recording."""
    end_s = float(steps if there is None else there)
    path = Path.of([(0.0, 0.0, 0.0, 1.0, 0.0), (end_s, end_s, 0.0, 1.0, 0.0)], gaps)
    plan = tiny()
    return replace(plan, run=replace(plan.run, end_ns=(steps + 1) * NS), paths={"target": path}, lost=lost)


def score(plan: Plan, *tracks: TrackRow, bound: dict[int, float] | None = None) -> Any:
    return scored(plan, tracks, plan.run.end_ns, {"fusion": bound or {}})


def of(*tracks: TrackRow) -> Any:
    """Scored over the steps up to the last of these."""
    return score(field(max(row.point.step or 0 for row in tracks)), *tracks)


def good(*steps: int) -> list[TrackRow]:
    return [point(step, GOOD) for step in steps]


# --- errors -----------------------------------------------------------------------------------------------------------


def test_errors_are_those_of_the_formulas() -> None:
    found = of(point(1, (3, 4, 0, 0)), point(2, (0, 0, 0, 1)))
    assert found == {
        "rmse": {"x": (9 / 2) ** 0.5, "y": (16 / 2) ** 0.5, "position": (25 / 2) ** 0.5, "velocity": (1 / 2) ** 0.5},
        "median_error": 2.5,  # of 5 and 0
        "nees": pytest.approx((1 + 1 + 1) / 2),  # 3^2/9 + 4^2/16 in the first step, 1^2/1 in the second
        "nees_band": pytest.approx([1.0899, 8.7673], abs=1e-4),  # chi-square of 8 at 2.5 and 97.5 %, over 2
        "nees_position": pytest.approx((1 + 1) / 2),
        "nees_position_band": pytest.approx([0.2422, 5.5716], abs=1e-4),  # chi-square of 4
        "steps": 2,
        "bound_m": None,
        "times_bound": None,
        "verdict": "tracked",
        "lost": False,
        "steps_expected": 2,
        "steps_tracked": 2,
        "share_within": 1.0,
        "longest_blackout_s": 0.0,
        "gap": {"rmse": None, "steps": 0},
    }


def test_an_infinite_nees_is_nothing_to_say() -> None:
    """A covariance without any extent, and an error all the same."""
    found = of(point(1, GOOD, covariance=(0.0,) * 16))
    assert found["nees"] is found["nees_band"] is found["nees_position"] is found["nees_position_band"] is None
    assert found["rmse"]["position"] == 5.0
    assert of(point(1, (0, 0, 0, 0), covariance=(0.0,) * 16))["nees"] == 0.0


@pytest.mark.parametrize("value", [float("nan"), float("inf"), -float("inf")])
def test_a_state_that_is_no_number_is_no_track(value: float) -> None:
    for bad in (point(2, (value, 0, 0, 0)), point(2, (0, 0, 0, 0), covariance=(value,) * 16)):
        found = of(*good(1), bad)
        assert (found["steps"], found["rmse"]["position"], found["lost"]) == (1, 5.0, True)


# --- the rule of a loss -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("last", "lost"), [((50.0, 0, 0, 0), False), ((50.001, 0, 0, 0), True), ((30.0, 40.001, 0, 0), True), (None, True)]
)
def test_lost_is_who_ends_far_off_or_without_a_track(last: tuple[float, ...] | None, lost: bool) -> None:
    assert of(*good(1), point(2, last))["lost"] is lost


def test_a_track_without_a_truth_says_nothing_about_a_loss() -> None:
    unseen = point(3, (0, 0, 0, 0), truth=False)
    for error, lost in ((GOOD, False), (FAR, True), (None, True)):
        assert score(field(3, there=2), *good(1), point(2, error), unseen)["lost"] is lost


def test_a_loss_goes_by_the_rule_that_is_given() -> None:
    """Two steps in a row, anywhere: one too far off and one without a track."""
    tracks = [point(1, (9, 0, 0, 0)), point(2, (21, 0, 0, 0)), point(3, None), point(4, (9, 0, 0, 0))]
    for n, lost in ((1, True), (2, True), (3, False)):
        assert tracker_metrics(replace(tiny(), lost=Lost(20.0, n, None)), tracks)["t"]["lost"] is lost


def test_a_step_of_which_nobody_told_is_one_without_a_track() -> None:
    """The centre died: its last word was good, and there was none at the last step."""
    assert score(field(3), *good(1, 2))["lost"] is True


def test_who_found_its_way_back_is_not_lost() -> None:
    assert of(point(1, FAR), *good(2))["lost"] is False


# --- expected steps ---------------------------------------------------------------------------------------------------


def test_every_step_with_a_target_is_expected() -> None:
    found = score(field(10, there=8), *good(1, 2, 6, 8))
    assert (found["steps_expected"], found["steps_tracked"], found["steps"]) == (8, 4, 4)
    assert found["share_within"] == 4 / 8
    assert found["longest_blackout_s"] == 3.0  # steps 3 to 5


def test_a_step_far_off_is_tracked_but_not_within() -> None:
    found = of(*good(1, 2, 3), point(4, FAR))
    assert (found["steps_tracked"], found["share_within"], found["longest_blackout_s"]) == (4, 0.75, 0.0)


def test_a_run_that_ended_early_is_judged_by_what_there_was() -> None:
    plan = field(10)
    for end_s, expected in ((4.2, 3), (4.3, 3), (4.31, 4), (5.2, 4)):  # a track is told 0.3 s after its step
        found = scored(plan, good(*range(1, expected + 1)), round(end_s * NS), {})
        assert (found["steps_expected"], found["steps"], found["verdict"]) == (expected, expected, "tracked")


def test_a_track_that_is_due_as_the_run_ends_is_not_expected() -> None:
    plan = replace(field(3), deadline_s=1.0)
    assert score(plan, *good(1, 2))["steps_expected"] == 2


def test_a_smoothed_track_ends_before_the_others() -> None:
    plan = replace(field(5), tracking={"trackers": ["other"], "smooth_lag": 2})
    late = [replace(row, point=replace(row.point, lag=2)) for row in good(1, 2, 3)]
    assert tracker_metrics(plan, late)["t"]["steps_expected"] == 3
    never = tracker_metrics(replace(plan, tracking={"trackers": ["other"], "smooth_lag": 9}), [])["t"]
    assert (never["steps_expected"], never["verdict"]) == (0, None)  # nothing was due


def test_nothing_to_judge_by_is_no_verdict() -> None:
    nothing = scored(field(3), [], NS, {})  # it ended before the first step
    assert (nothing["verdict"], nothing["lost"], nothing["share_within"]) == (None, False, None)


# --- the verdict ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("missing", "verdict"),
    [
        ([], "tracked"),
        (range(100, 106), "tracked with gaps"),  # 97 % are there, but 6 in a row are not
        (range(100, 105), "tracked"),
        (range(1, 6), "tracked"),
        (range(20, 190, 10), "tracked with gaps"),  # one at a time, but 8.5 % of all
        (range(20, 120, 10), "tracked"),  # 5 %
        (range(2, 190, 2), "tracked with gaps"),
        (range(50, 151), "lost"),  # less than half
        ([200], "lost"),  # the rule: none at the last step
    ],
)
def test_a_verdict_goes_by_share_blackouts_and_the_rule(missing: Sequence[int], verdict: str) -> None:
    found = score(field(200), *good(*(k for k in range(1, 201) if k not in missing)))
    assert found["verdict"] == verdict


def test_far_off_for_more_than_half_is_lost_whatever_the_rule_says() -> None:
    tracks = [point(k, GOOD if k > 6 else FAR) for k in range(1, 11)]
    found = score(field(10), *tracks)
    assert (found["lost"], found["verdict"]) == (False, "lost")


# --- gaps of the truth ------------------------------------------------------------------------------------------------


def test_errors_inside_gaps_of_the_truth_stand_apart() -> None:
    plan = field(6, gaps=[(2.0, 5.0)])
    guessed = [replace(point(k, FAR), interpolated=True) for k in (3, 4)]
    found = score(plan, *good(1, 2, 5, 6), *guessed)
    assert (found["rmse"]["position"], found["steps"]) == (5.0, 4)
    assert found["gap"] == {"rmse": 99.0, "steps": 2}
    assert (found["steps_expected"], found["steps_tracked"], found["share_within"]) == (4, 4, 1.0)
    assert found["verdict"] == "tracked"


def test_a_blackout_counts_in_a_gap_too() -> None:
    assert score(field(9, gaps=[(2.0, 8.0)]), *good(1, 8, 9))["longest_blackout_s"] == 6.0


# --- the bound --------------------------------------------------------------------------------------------------------


def test_error_and_bound_are_over_the_same_steps() -> None:
    """The bound of a step without a track does not count, nor the error of a step without a bound."""
    tracks = [point(1, FAR), *good(2, 4)]
    found = score(field(4), *tracks, bound={2 * NS: 3.0, 3 * NS: 1000.0, 4 * NS: 1.0})
    assert found["bound_m"] == pytest.approx(((9 + 1) / 2) ** 0.5)
    assert found["times_bound"] == pytest.approx(5.0 / 5**0.5)


# --- what a user sees -------------------------------------------------------------------------------------------------


def test_an_outage_is_said_in_the_table_and_in_the_metrics(trackfield: Call) -> None:
    outage = "faults=[{kind='restart', nodes=['fusion'], at_s=10, until_s=50}]"
    seen = trackfield("run", "zhai-spcpf", "--virtual", "--json", "--set", outage)
    for name, figures in json.loads(seen.out)["trackers"].items():
        assert figures["verdict"] == "lost"
        assert figures["steps_expected"] == 60
        assert figures["steps_tracked"] <= 21
        assert figures["longest_blackout_s"] >= 39.0
        (line,) = [line for line in seen.err.splitlines() if f"│ {name} " in line]
        assert "lost" in line
        assert f"{figures['steps_tracked']} of 60" in line
