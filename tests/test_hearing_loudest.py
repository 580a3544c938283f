"""Clusters around the node that heard a pass loudest, without I/O: who leads, what it uses, and what if it dies."""

from __future__ import annotations

import random
from collections.abc import Sequence

import pytest

from tests.ether import ORIGIN_NS, Place
from tests.hearing import BASE, CLOSE_NS, GATHER_NS, TURN_NS, Field, Line, field_of
from tests.puppet import MS
from trackfield.role import NS
from trackfield.sensing.cpa import Passed

PLACES: list[Place] = [(0.0, 8.0), (14.0, -10.0), (20.0, 15.0), (32.0, -6.0), (40.0, 12.0), (48.0, -14.0)]
LINE = Line(24.0, 0.0, 90.0, at_s=8.0, heard_m=20.0)
"""Six nodes hear it within 3.6 s; n03 is nearest (6 m), then n00 (8 m)."""
BASE_PLACE = (20.0, -30.0)


def loudest(
    *lines: Line, places: Sequence[Place] = PLACES, reach_m: float = 60.0, base: Place = BASE_PLACE, **settings: object
) -> Field:
    given = {"radius_m": 80.0, **settings}
    return field_of(*lines, places=places, heads="loudest", reach_m=reach_m, base=base, **given)  # type: ignore[arg-type]


def heads(field: Field) -> list[str]:
    return [note.split()[0] for note in field.said("leads: ")]


def outcomes(field: Field, by: str = BASE) -> list[str]:
    return ["fix" if not point.refused else point.refused for point in field.events(by)]


def exact(field: Field, line: Line = LINE) -> None:
    away_m, off = field.error(line)
    assert away_m < 0.1
    assert off < 0.02


def test_the_loudest_leads_and_makes_the_fix() -> None:
    field = loudest(LINE).until(16)
    assert heads(field) == ["n03"]
    assert outcomes(field) == outcomes(field, "n03") == ["fix"]
    exact(field)
    assert field.said("n03 uses") == ["n03 uses 5 on the hull of 6: n00, n01, n02, n04, n05"]
    assert set(field.events(BASE)[0].sensors) <= {"n00", "n01", "n02", "n04", "n05"}


def test_nobody_leads_before_a_target_passes() -> None:
    field = loudest(LINE).until(5)
    assert field.leaders() == []
    assert {one.message.task for one in field.sent if one.kind == "interest"} == {2}


def test_it_leads_when_no_report_was_added_for_a_while() -> None:
    field = loudest(LINE).until(9)
    last_ns = max(at_ns for id in field.nodes for at_ns, _ in field.known(id))
    due_ns = last_ns + 20 * MS + CLOSE_NS
    assert field.run(due_ns - MS).leaders() == []
    assert field.run(due_ns + MS).leaders() == ["n03"]


def test_of_equally_loud_nodes_the_lower_id_leads() -> None:
    places = [(10.0, 6.0), (20.0, -6.0), (30.0, 6.0), (0.0, -15.0), (40.0, -15.0)]
    field = loudest(LINE, places=places).until(16)
    assert heads(field) == ["n00"]
    exact(field)


def test_without_an_interest_in_fixes_nobody_says_anything() -> None:
    field = loudest(LINE, before=lambda field: field.rule("interest", sender=BASE)).until(16)
    assert {one.kind for one in field.sent} == {"announce", "interest"}
    assert field.leaders() == []


@pytest.mark.parametrize(("reports", "words"), [(5, "5 on the hull of 6"), (0, "all 6")])
def test_it_uses_five_reports_or_all(reports: int, words: str) -> None:
    field = loudest(LINE, reports=reports).until(16)
    assert field.said("uses")[0].startswith(f"n03 uses {words}")
    exact(field)


def test_it_leads_until_its_track_is_too_old() -> None:
    field = loudest(LINE).until(16)
    assert field.leaders() == ["n03"]
    assert field.until(24).leaders() == []
    assert field.said("leads no more") == ["n03 leads no more: it has no track"]


def test_the_interest_ends_with_the_gathering() -> None:
    field = loudest(LINE).until(16)
    asked = [one.t_ns for one in field.sent if one.kind == "interest" and one.message.task == 1 and one.src == "n03"]
    assert len(asked) == 1


# --- reports and frames that are lost ---------------------------------------------------------------------------------


def test_with_too_few_reports_it_says_so() -> None:
    field = loudest(LINE, places=PLACES[:3]).until(18)
    assert heads(field) == ["n00"]
    assert outcomes(field) == outcomes(field, "n00") == ["too few reports"]
    assert field.leaders() == []
    assert field.last().mean == ()


def test_a_false_report_alone_is_no_fix() -> None:
    field = loudest()
    field.extra["n02"] = [(ORIGIN_NS + 7 * NS, Passed((-1.0, -30.0, 1.0)))]
    field.start("n02")
    field.until(20)
    assert heads(field) == ["n02"]
    assert outcomes(field) == ["too few reports"]


def test_of_two_that_lead_at_once_the_louder_goes_on() -> None:
    """n00 missed the loudest broadcast, and begins to lead; then the report comes under its own interest."""
    field = loudest(LINE, before=lambda field: field.rule("cpa-report", sender="n03", receiver="n00")).until(20)
    assert heads(field) == ["n00", "n03"]
    assert field.said("n03 is louder") == ["n00 leads no more: n03 is louder"]
    assert outcomes(field) == ["fix"]
    exact(field)


def test_when_nobody_hears_the_loudest_broadcast_the_second_loudest_is_told_of_it() -> None:
    field = loudest(LINE, before=lambda field: field.rule("cpa-report", sender="n03")).until(20)
    assert outcomes(field) == ["fix"]
    exact(field)


@pytest.mark.parametrize("kind", ["interest", "data", "data-ack", "reinforce", "cpa-report", "fix"])
@pytest.mark.parametrize("skip", [0, 1, 2, 5])
def test_any_frame_may_be_lost(kind: str, skip: int) -> None:
    field = loudest(LINE, before=lambda field: field.rule(kind, count=1, skip=skip)).until(22)
    assert "fix" in outcomes(field)
    exact(field)


def test_clusters_need_no_direct_way_between_all_nodes() -> None:
    """Reports of nodes two hops away come, too."""
    field = loudest(LINE, reach_m=32.0).until(22)
    assert "fix" in outcomes(field)
    exact(field)


# --- heads that die ---------------------------------------------------------------------------------------------------


def test_when_the_loudest_dies_before_it_leads_the_next_one_does() -> None:
    field = loudest(LINE).until(10.5)
    field.kill("n03")
    field.until(20)
    assert heads(field) == ["n00"]
    exact(field)


def test_when_it_dies_while_it_gathers_the_next_one_takes_over() -> None:
    field = loudest(LINE)
    while not field.leaders():
        field.run(field.t_ns + 100 * MS)
    since_ns = field.t_ns
    field.kill("n03")
    field.until(26)
    assert heads(field) == ["n03", "n00"]
    assert outcomes(field) == ["fix"]
    exact(field)
    took_ns = next(t_ns for t_ns, id, note in field.notes if note.startswith("n00 leads: "))
    assert took_ns - since_ns <= 2 * GATHER_NS + CLOSE_NS + TURN_NS + 100 * MS


def test_when_it_has_told_of_the_fix_nobody_takes_over() -> None:
    field = loudest(LINE).until(16)
    field.kill("n03")
    field.until(30)
    assert heads(field) == ["n03"]


# --- several passes ---------------------------------------------------------------------------------------------------


def test_a_second_target_is_a_second_event() -> None:
    second = Line(24.0, 3.0, 270.0, at_s=30.0, heard_m=20.0)
    field = loudest(LINE, second).until(40)
    assert outcomes(field) == ["fix", "fix"]
    exact(field, second)


def test_one_that_leads_may_lead_again() -> None:
    """The same target returns while its head still holds the track of its first pass."""
    field = loudest(LINE, Line(24.0, 0.0, 270.0, at_s=15.0, heard_m=20.0)).until(25)
    assert heads(field) == ["n03", "n03"]
    assert outcomes(field) == ["fix", "fix"]
    exact(field, field.lines[1])


@pytest.mark.parametrize("seed", range(6))
def test_paths_through_a_random_field(seed: int) -> None:
    """25 nodes in 100 x 100 m, heard within 20 m, radio 40 m: whatever fix there is is right, and no event has two.

    A node that is passed within 1 m is as loud as at 1 m, which solvers do not know.
    """
    rng = random.Random(seed)
    places = [(rng.uniform(0.0, 100.0), rng.uniform(0.0, 100.0)) for _ in range(25)]
    line = Line(50.0, rng.uniform(35.0, 65.0), rng.uniform(60.0, 120.0), at_s=10.0, heard_m=20.0)
    field = loudest(line, places=places, reach_m=40.0, base=(50.0, -10.0)).until(32)
    assert outcomes(field)
    for point in field.events(BASE):
        if not point.refused and point.mean:
            off = [abs(a - b) for a, b in zip(point.mean, line.at((point.at_ns - ORIGIN_NS) / NS), strict=True)]
            assert all(one < min(1.0, 2.0 * point.covariance[5 * i] ** 0.5) for i, one in enumerate(off))
    used = [set(point.sensors) for point in field.events(BASE) if point.status == "tracking"]
    assert all(one != other for i, one in enumerate(used) for other in used[:i])
