"""Fixed clusters that hear targets pass, without I/O: a story for each step that may be lost, and for each that dies.

The pentagon of the paper: nodes that are neighbours on its sides hear each other, those on diagonals do not.
"""

from __future__ import annotations

from dataclasses import replace
from math import inf

import pytest

from tests.ether import ORIGIN_NS
from tests.hearing import BASE, GATHER_NS, INTEREST_S, STEP_NS, TURN_NS, Field, Line, field_of, pentagon
from tests.puppet import MS
from trackfield.role import NS
from trackfield.sensing.cpa import Passed
from trackfield.wire.interests import Interest
from trackfield.wire.passes import CpaReport

LINE = Line(3.0, 2.0, 80.0, at_s=8.0)
"""It passes all five nodes between 6.4 and 9.2 s."""
LAPSE_S = 0.75 * INTEREST_S
PASSES = {"passes": [6.6, 9.2]}


def fixes(field: Field, by: str = BASE) -> list[str]:
    return ["fix" if not point.refused else point.refused for point in field.events(by)]


def exact(field: Field, line: Line = LINE, by: str = BASE) -> None:
    """The last point is where the target is, as readings have no noise but that of their resolution."""
    away_m, off = field.error(line, by)
    assert away_m < 0.05
    assert off < 0.01


# --- as it should be --------------------------------------------------------------------------------------------------


def test_a_pass_becomes_a_fix_at_the_base() -> None:
    field = field_of(LINE).until(16)
    exact(field)
    exact(field, by="n00")
    (point,) = field.events(BASE)
    assert point.status == "tracking"
    assert set(point.sensors) == set(field.nodes)
    assert (point.origin, point.term, point.known_step) == ("n00", point.step, point.step)
    assert point.event_ns is not None
    assert abs(point.event_ns - ORIGIN_NS - 7.77 * NS) < 0.1 * NS  # nearest to the middle of the five
    assert field.leaders() == ["n00"]
    assert {one.kind for one in field.sent} == {"announce", "interest", "data", "reinforce", "data-ack"}


def test_the_fix_comes_at_the_deadline_of_the_step_after_the_last_report() -> None:
    """The last of five reports is made 1 s after its pass, for the step that follows, and the event is over with it."""
    field = field_of(LINE).until(16)
    last_ns = max(at_ns for id in field.nodes for at_ns, _ in field.known(id))
    (told,) = [t_ns for t_ns, id, point in field.points if id == "n00" and point.event_ns is not None]
    step = -(-(last_ns - ORIGIN_NS) // STEP_NS)
    assert told == ORIGIN_NS + step * STEP_NS + 300 * MS


def test_points_of_a_head_hold_by_the_step_of_its_last_fix() -> None:
    field = field_of(LINE, replace(LINE, at_s=30.0)).until(38)
    terms = [point.term for _, id, point in field.points if id == "n00"]
    first, second = (point.step for point in field.events("n00"))
    assert sorted(set(terms)) == [0, first, second]
    assert terms == sorted(terms)


def test_without_an_interest_nothing_is_reported() -> None:
    field = field_of(LINE, before=lambda field: field.rule("interest")).until(5)
    heard = [one.kind for one in field.until(12).sent]
    # each node leads alone in the end, and hears itself only
    assert "data" not in heard
    assert fixes(field) == []


def test_a_target_out_of_hearing_is_none() -> None:
    field = field_of(replace(LINE, heard_m=1.0)).until(16)
    assert fixes(field, "n00") == []
    assert field.last("n00").status == "waiting"


# --- nodes that are silent --------------------------------------------------------------------------------------------


def variance(field: Field) -> float:
    (point,) = field.events("n00")
    return point.covariance[0] + point.covariance[5]


def test_with_one_silent_node_the_fix_is_less_certain() -> None:
    whole = field_of(LINE).until(16)
    field = field_of(LINE).until(1)
    field.kill("n03")
    exact(field.until(18))
    (point,) = field.events(BASE)
    assert set(point.sensors) == {"n00", "n01", "n02", "n04"}
    assert variance(field) > variance(whole)


def test_with_two_silent_nodes_there_is_an_honest_refusal() -> None:
    field = field_of(LINE, base=(0.0, 40.0)).until(1)
    field.kill("n02", "n03")
    field.until(18)
    assert fixes(field) == fixes(field, "n00") == ["too few reports"]
    assert field.last().mean == ()


def test_a_sensor_that_is_deaf_is_like_a_silent_node() -> None:
    field = field_of(LINE)
    known = field.known
    field.known = lambda id: [] if id == "n01" else known(id)  # type: ignore[method-assign]
    for id in ("n01",):
        field.start(id)
    exact(field.until(18))
    assert set(field.events(BASE)[0].sensors) == {"n00", "n02", "n03", "n04"}


# --- reports that are late, doubled or false --------------------------------------------------------------------------


def test_a_late_report_makes_the_fix_better() -> None:
    field = field_of(LINE).until(1)
    field.rule("data", sender="n04", delays=(3 * NS,))
    field.until(18)
    assert fixes(field) == ["fix", "fix"]
    assert [len(point.sensors) for point in field.events(BASE)] == [4, 5]
    exact(field)


def test_reports_that_come_twice_count_once() -> None:
    field = field_of(LINE).until(1)
    field.rule("data", delays=(0, 300 * MS))
    field.rule("data-ack", delays=(0, 300 * MS))
    once = field_of(LINE).until(16)
    field.until(16)
    assert len(field.head("n00").passes) == 5
    assert field.events("n00") == once.events("n00")


def test_the_same_report_again_is_known_by_its_number_and_time() -> None:
    """Also for another step; one of another number is another pass."""
    field = field_of(LINE).until(9)
    (one,) = [one for one in field.head("n00").passes if one.sensor == "n01"]
    passes = len(field.head("n00").passes)
    again = replace(one.report, step=one.report.step + 1, early_s=one.report.early_s + 0.5)
    field.inject("n00", again, "n01")
    assert len(field.head("n00").passes) == passes
    assert field.reasons("n00")[-1] == "repeated"
    field.inject("n00", replace(again, event=(one.report.event + 1) % 256), "n01")
    assert len(field.head("n00").passes) == passes + 1


@pytest.mark.parametrize("trackers", [("ml",), ("ecpa", "ml")])
def test_a_fix_is_told_with_the_reports_that_it_is_made_of(trackers: tuple[str, ...]) -> None:
    """Not with that of a sensor which says a second later that it was passed again; solvers drop it."""
    field = field_of(LINE, trackers=trackers)
    first = min(field.nodes, key=lambda id: field.known(id)[0][0])
    field.extra[first] = [(field.known(first)[0][0] + NS, Passed((-1.0, -30.0, 1.0)))]
    field.start(first)
    field.until(16)
    assert len(field.head("n00").passes) == 6
    assert sorted(field.events(BASE)[-1].sensors) == field.nodes
    exact(field)


def test_a_false_report_does_not_spoil_the_next_fix() -> None:
    field = field_of(replace(LINE, at_s=20.0))
    field.extra["n02"] = [(ORIGIN_NS + 7 * NS, Passed((-1.0, -30.0, 1.0)))]
    field.start("n02")
    field.until(30)
    assert fixes(field) == ["too few reports", "fix"]
    exact(field, field.lines[0])


def test_a_false_report_within_the_pass_is_left_out() -> None:
    field = field_of(LINE)
    field.extra["n02"] = [(ORIGIN_NS + 10100 * MS, Passed((-1.0, -30.0, 1.0)))]
    field.start("n02")
    exact(field.until(16))


@pytest.mark.parametrize(
    ("report", "sender", "reason"),
    [
        (CpaReport(60000, 0.5, 0, -20.0, 1.0), "n01", "from the future"),
        (CpaReport(10, 0.5, 0, -20.0, 1.0), "n77", "unknown sensor"),
        (CpaReport(1, 6.0, 0, -20.0, 1.0), "n01", "late"),
    ],
)
def test_a_report_that_cannot_be_is_ignored(report: CpaReport, sender: str, reason: str) -> None:
    field = field_of(LINE).until(19)
    field.inject("n00", report, sender)
    assert field.reasons("n00")[-1] == reason


# --- clocks -----------------------------------------------------------------------------------------------------------

SYNC = {"reference": BASE, "exchanges": 3, "resync_ns": 20 * NS, "timeout_ns": 200 * MS, "seed": 1}


@pytest.mark.parametrize("id", ["n00", "n03"])
def test_a_clock_that_is_off_by_100_ms_costs_a_report(id: str) -> None:
    """That is ten standard deviations: the report is taken for a bad one, whether of the head or of another node."""
    field = field_of(LINE, ahead_ns={id: 100 * MS}).until(18)
    assert fixes(field) == ["fix"]
    exact(field)
    whole = field_of(LINE).until(18)
    assert variance(field) > variance(whole)


def test_clocks_are_set_hop_by_hop() -> None:
    """Frames take as long there as back, so clocks are right to the resolution of the messages."""
    ahead = {"n00": 100 * MS, "n01": -70 * MS, "n03": 40 * MS}
    field = field_of(LINE, sync=SYNC, ahead_ns=ahead).until(16)
    for id in field.nodes:
        assert abs(field.ear(id).time.correction_ns + ahead.get(id, 0)) < 10_000
        assert field.head(id).time.correction_ns == field.ear(id).time.correction_ns
    exact(field)


# --- heads that die ---------------------------------------------------------------------------------------------------


def test_when_the_head_dies_in_a_pass_another_takes_over_from_the_interest_and_makes_the_fix() -> None:
    field = field_of(LINE).until(8.3)
    field.kill("n00")
    field.until(18)
    assert field.leaders() == ["n01"]
    exact(field)
    (point,) = field.events(BASE)
    assert point.origin == "n01"
    exact(field, by="n01")


def test_who_takes_over_later_does_not_tell_of_the_pass_again() -> None:
    """Its head has told of it, and has lived on; some reports of it are still sent to the next head."""
    field = field_of(LINE).until(16)
    field.kill("n00")
    field.until(26)
    assert field.leaders() == ["n01"]
    assert 1 <= len(field.head("n01").passes) <= 3
    assert fixes(field, "n01") == []
    assert fixes(field) == ["fix"]


def test_it_takes_over_when_two_refreshes_were_missed() -> None:
    field = field_of().until(2.9)
    field.kill("n00")
    heard = max(one.t_ns for one in field.heard if one.dst == "n01" and one.message.sink == b"n00" and
                one.kind == "interest" and isinstance(one.message, Interest) and one.message.task == 1)  # fmt: skip
    due_s = (heard - ORIGIN_NS) / NS + LAPSE_S + 2 * TURN_NS / NS
    assert field.until(due_s - 0.1).leaders() == []
    assert field.until(due_s + 0.1).leaders() == ["n01"]


def test_one_missed_refresh_does_not_end_a_head() -> None:
    field = field_of().until(2.9)
    lost = field.rule("interest", sender="n00")
    field.until(4)
    field.rules.remove(lost)
    assert lost.hits
    assert field.until(20).leaders() == ["n00"]
    assert field.said("leads") == ["n00 leads: nobody else of its cluster does"]


def test_when_two_die_the_third_takes_over() -> None:
    field = field_of(reach_m=45.0).until(1)
    field.kill("n00", "n01")
    assert field.until(12).leaders() == ["n02"]


def test_a_head_that_comes_back_follows() -> None:
    field = field_of(LINE, replace(LINE, at_s=40.0)).until(8.3)
    field.kill("n00")
    field.until(18)
    field.start("n00")
    field.until(48)
    assert field.leaders() == ["n01"]
    assert [point.origin for point in field.events(BASE)] == ["n01", "n01"]
    exact(field, field.lines[1])


def test_of_two_that_lead_after_a_partition_the_earlier_in_the_group_goes_on() -> None:
    field = field_of(replace(LINE, at_s=40.0)).until(1)
    before = field.reaches
    field.cut("n00")
    field.until(12)
    assert set(field.leaders()) == {"n00", "n01"}
    field.reaches = before
    field.until(48)
    assert field.leaders() == ["n00"]
    assert len(field.said("leads no more: n00 does")) == 1
    exact(field, field.lines[0])


def test_a_whole_field_that_starts_again_has_one_head() -> None:
    field = field_of(LINE).until(5)
    field.kill(*field.nodes)
    for id in field.nodes:
        field.start(id)
    assert field.until(20).leaders() == ["n00"]


# --- frames that are lost, and relays that die ------------------------------------------------------------------------


def test_when_a_relay_dies_reports_take_the_other_way() -> None:
    """n02 reaches its head over n01 only as long as that lives; then over n03 and n04."""
    field = field_of(replace(LINE, at_s=14.0)).until(5)
    field.kill("n01")
    field.until(26)
    assert set(field.events("n00")[-1].sensors) <= set(field.events(BASE)[-1].sensors)
    assert set(field.events(BASE)[-1].sensors) == {"n00", "n02", "n03", "n04"}
    exact(field, field.lines[0])


@pytest.mark.parametrize("kind", ["interest", "data", "reinforce", "data-ack"])
@pytest.mark.parametrize("skip", [0, 1, 2, 3])
def test_any_frame_may_be_lost(kind: str, skip: int) -> None:
    """One frame of each kind, to all that would have heard it."""
    field = field_of(LINE, before=lambda field: field.rule(kind, count=1, skip=skip)).until(20)
    assert fixes(field)[-1] == "fix"
    exact(field)


@pytest.mark.parametrize("kind", ["data", "data-ack"])
def test_so_may_every_third(kind: str) -> None:
    field = field_of(LINE)
    for skip in range(0, 300, 3):
        field.rule(kind, count=1, skip=skip)
    exact(field.until(20))


def test_what_a_head_tells_is_repeated_until_the_base_has_it() -> None:
    field = field_of(LINE).until(10.5)
    lost = field.rule("data", sender="n00", count=1)
    field.until(18)
    assert lost.hits == 1
    exact(field)


def test_the_base_asks_again_after_its_interest_was_lost() -> None:
    field = field_of(LINE, before=lambda field: field.rule("interest", sender=BASE, count=10)).until(16)
    exact(field)


# --- other clusters ---------------------------------------------------------------------------------------------------

EAST = Line(3.0, 2.0, 90.0, at_s=8.0, heard_m=28.0)


def row(count: int = 3) -> list[tuple[float, float]]:
    return [place for number in range(count) for place in pentagon(60.0 * number)]


def test_clusters_hand_a_track_on() -> None:
    field = field_of(EAST, places=row(), hand_m=90.0, radius_m=30.0, reach_m=35.0).until(26)
    assert field.said("goes on with") == ["n05 goes on with the fix of n00", "n10 goes on with the fix of n05"]
    assert [point.origin for point in field.events(BASE)] == ["n00", "n05", "n10"]
    exact(field, EAST)


def test_the_next_head_has_the_track_before_the_target_comes() -> None:
    field = field_of(EAST, places=row(), hand_m=90.0, radius_m=30.0, reach_m=35.0).until(12)
    exact(field, EAST, by="n05")
    assert field.last("n05").term == field.last("n00").term
    assert field.error(EAST, by="n10") == (inf, inf)


def test_a_new_head_is_handed_what_was_told_before_it_led() -> None:
    """The second head dies; the one that takes over asks for fixes, too, and gets that of the first cluster."""
    later = replace(EAST, at_s=9.0, speed=4.0)  # it is with the second cluster 15 s after the first
    field = field_of(later, places=row(2), hand_m=90.0, radius_m=30.0, reach_m=35.0).until(9.5)
    field.kill("n05")
    field.until(19)
    assert field.leaders() == ["n00", "n06"]
    assert field.said("goes on with") == ["n06 goes on with the fix of n00"]
    exact(field, later, by="n06")


def test_a_report_that_is_of_no_event_does_not_keep_a_track_away() -> None:
    """The second cluster hears a false one, long before, that its trackers never conclude."""
    field = field_of(replace(EAST, at_s=24.0), places=row(2), hand_m=90.0, radius_m=30.0, reach_m=35.0)
    field.extra["n05"] = [(ORIGIN_NS + 6 * NS, Passed((-1.0, -30.0, 1.0)))]
    field.start("n05")
    field.until(8)
    again = replace(field.head("n05").passes[0].report, event=77)  # of the same pass, as its trackers see it
    field.inject("n05", again, "n05")
    field.until(30)
    assert field.said("goes on with") == ["n05 goes on with the fix of n00"]


def test_a_target_that_goes_elsewhere_is_not_handed_on() -> None:
    north = replace(EAST, bearing_deg=0.0)
    field = field_of(north, places=row(2), hand_m=90.0, radius_m=30.0, reach_m=35.0).until(16)
    assert fixes(field) == ["fix"]
    assert field.said("goes on with") == []


def test_a_target_that_came_from_there_is_not_handed_back() -> None:
    west = replace(EAST, bearing_deg=270.0, x_m=63.0)
    field = field_of(west, places=row(2), hand_m=90.0, radius_m=30.0, reach_m=35.0).until(24)
    assert field.said("goes on with") == ["n00 goes on with the fix of n05"]


# --- several trackers -------------------------------------------------------------------------------------------------


def test_trackers_work_side_by_side() -> None:
    field = field_of(LINE, trackers=("ml", "ecpa", "ukf")).until(16)
    told = {point.tracker: point for point in field.events(BASE)}
    assert set(told) >= {"ml", "ecpa"}
    last = {point.tracker: point for _, id, point in field.points if id == BASE}
    for name in ("ml", "ukf"):
        x, y, *_ = LINE.at((last[name].at_ns - ORIGIN_NS) / NS)
        assert abs(last[name].mean[0] - x) < 1.0
        assert abs(last[name].mean[1] - y) < 1.0


def test_a_filter_that_says_of_no_event_is_told_of_when_a_pass_is_over() -> None:
    prior = {"mean": [-100.0, -16.0, 13.2, 2.3], "sd": [5.0, 5.0, 1.0, 1.0]}
    field = field_of(LINE, trackers=("ukf",), prior=prior).until(18)
    assert fixes(field, "n00") == []
    last = field.last()
    assert last.status == "coasting"
    x, y, *_ = LINE.at((last.at_ns - ORIGIN_NS) / NS)
    assert abs(last.mean[0] - x) < 1.5
    assert abs(last.mean[1] - y) < 1.5


def test_a_head_gathers_before_it_begins() -> None:
    field = field_of(LINE)
    assert field.run(ORIGIN_NS + GATHER_NS - MS).leads("n00").progress is None
    assert field.run(ORIGIN_NS + GATHER_NS + MS).leads("n00").progress is not None
