"""Stories of nodes of which any may lead: for each message one in which it is lost, and what follows."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import pytest

from head.peers.choice import DEAF, MOST_SILENT, PAUSE
from node.member import HOLD
from tests.ether import ORIGIN_NS, Place
from tests.peered import (
    MANNERS,
    WORD_NS,
    Field,
    Manner,
    eastward,
    field_of,
    grid,
)
from tests.puppet import MS
from trackfield.role import NS

LEADERS: dict[Manner, Sequence[str]] = {
    "location-central": ("n00", "n02", "n04", "n06", "n08"),
    "elected": ("n00", "n02", "n05", "n07", "n09"),
}
"""Those that lead one after the other while the target moves along the nodes."""
SQUARE = grid(2, 2)
"""Four nodes, all of which measure a target in their midst."""


def square(manner: Manner, places: Sequence[Place] = SQUARE, **settings: Any) -> Field:
    """A field in which all measure a target that hardly moves, and n00 leads."""
    given = {"count": len(places), "target": eastward(14.0, 0.01, 14.0), **settings}
    field = field_of(manner, places, **given).to_step(5)
    assert field.leaders() == ["n00"]
    return field


def sensors(field: Field, since: int) -> list[tuple[int, tuple[int, ...]]]:
    """The steps that were polled from that one on, and the numbers of who was to measure."""
    polls = [one.message for one in field.frames("poll")]
    return [(p.step, tuple(p.sensors[::2])) for p in polls if p.step >= since]


# --- a calm run -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("manner", MANNERS)
def test_nothing_is_lost(manner: Manner) -> None:
    """The one that hears the target loudest is elected; later ones are handed the track; each step has one track."""
    field = field_of(manner).to_step(30)
    assert [who for who, _, _ in field.begun()][:5] == list(LEADERS[manner])
    assert [number for _, number, _ in field.begun()] == list(range(1, len(field.begun()) + 1))
    assert field.begun()[0][2] == "elected"
    assert all(why.endswith("hands over") for _, _, why in field.begun()[1:])
    assert field.follows_well(2, 30, 3.0)
    assert field.follows_well(5, 30, 0.5)
    assert all(len(field.used(step)) >= 2 for step in range(2, 31))
    assert [p.step for _, id, p in field.points if id != "base"] == list(range(2, 31))
    assert not field.ignored
    assert len(field.frames("claim")) <= 2
    assert len(field.frames("poll", since=1)) == len(range(2, 32))


@pytest.mark.parametrize("manner", MANNERS)
def test_the_base_hears_what_the_head_says(manner: Manner) -> None:
    field = field_of(manner).to_step(20)
    for step in range(4, 20):
        point = field.track(step, "base")
        assert point is not None
        assert (point.known_step, point.origin in LEADERS[manner]) == (step, True)
        assert abs(point.mean[0] - (8.0 + 5.0 * step)) < 0.6


@pytest.mark.parametrize("manner", MANNERS)
def test_only_the_head_and_those_that_measure_listen_all_the_time(manner: Manner) -> None:
    for step in (9, 17, 26):
        field = field_of(manner).to_step(step, 100 * MS)
        asked = {*field.leads(field.leader()).asked, field.leader()}
        assert {id for id in field.nodes if field.actors[id].receiver.opening is True} == asked
        assert {id for id in field.nodes if field.header(id).phase.value in ("polled", "leading")} == asked


# --- claim, join-claim ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("manner", MANNERS)
def test_a_claim_that_nobody_hears_is_repeated(manner: Manner) -> None:
    field = field_of(manner, before=lambda f: f.rule("claim", "n00")).to_step(4)
    assert field.begun()[0] == ("n00", 1, "elected")
    assert [number for _, number, why in field.begun() if why == "elected"] == [1]


@pytest.mark.parametrize("manner", MANNERS)
def test_one_that_nobody_hears_contend_yields_when_the_other_polls(manner: Manner) -> None:
    """Neither its claim nor its repeats are heard: another one is elected, too; of one number the higher id holds."""

    def rules(field: Field) -> None:
        field.rule("claim", "n00")
        field.rule("join-claim", "n00")

    field = field_of(manner, before=rules).to_step(1, 960 * MS)
    (other,) = set(field.leaders()) - {"n00"}
    assert field.leaders() == ["n00", other]
    assert field.to_step(3).leaders() == [other]
    assert any(f"yields to {other}, term 1" in text for _, id, text in field.notes if id == "n00")
    assert field.follows_well(4, 9, 3.0) if field.to_step(9) else False


@pytest.mark.parametrize("manner", MANNERS)
def test_an_election_without_any_relay_has_one_winner_all_the_same(manner: Manner) -> None:
    field = field_of(manner, before=lambda f: f.rule("join-claim")).to_step(12)
    assert [number for _, number, why in field.begun() if why == "elected"] == [1]
    assert field.follows_well(4, 12, 3.0)


def test_a_head_that_hears_of_no_joins_has_the_nearest_measure() -> None:
    field = field_of("elected").to_step(8)
    field.rule("join-claim")
    field.to_step(22)
    head = field.leader()
    able = {id for id, until in field.header(head).joined.items() if until >= 22 and id != head}
    assert not able
    assert field.follows_well(8, 22, 1.0)


# --- poll -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("lost", [1, HOLD, HOLD + 1])
@pytest.mark.parametrize("manner", MANNERS)
def test_a_poll_that_is_lost_is_taken_for_the_one_before(manner: Manner, lost: int) -> None:
    """For so many steps; then the sensor waits for a poll."""
    field = square(manner)
    field.rule("poll", "n00", "n02", count=lost)
    field.to_step(8 + lost)
    silent = [step for step in range(6, 8 + lost) if "n02" not in field.used(step)]
    assert silent == [7 + HOLD] * (lost > HOLD)  # it has heard the poll of step 6
    assert field.leaders() == ["n00"]


# --- reports ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("manner", MANNERS)
def test_a_report_that_is_lost_is_missed_in_its_step_only(manner: Manner) -> None:
    field = square(manner)
    field.rule("range", "n02", count=1)
    field.to_step(8)
    assert [field.used(step) for step in (6, 7)] == [("n00", "n01", "n03"), ("n00", "n01", "n02", "n03")]
    assert field.follows_well(5, 8)


@pytest.mark.parametrize("manner", MANNERS)
def test_one_whose_reports_are_lost_for_long_is_left_alone_for_a_while(manner: Manner) -> None:
    field = square(manner)
    field.rule("range", "n02", count=MOST_SILENT)
    field.to_step(14)
    without = [step for step, numbers in sensors(field, 6) if 2 not in numbers]
    last = 5 + MOST_SILENT
    assert without == list(range(last + 1, last + PAUSE + 1))
    assert "n02" in field.used(last + PAUSE + 1)


FAR: tuple[Place, ...] = (*SQUARE, (90.0, 15.0))


@pytest.mark.parametrize("manner", MANNERS)
def test_one_that_senses_no_target_is_asked_again_two_steps_later(manner: Manner) -> None:
    field = square(manner, FAR).to_step(14)
    asked = [step for step, numbers in sensors(field, 6) if 4 in numbers]
    assert {b - a for a, b in pairwise(asked)} == {DEAF + 1}
    assert len(field.frames("no-target", "n04", "n00", since=6)) == len([step for step in asked if step <= 14])


@pytest.mark.parametrize("manner", MANNERS)
def test_one_whose_word_that_it_senses_no_target_is_lost_is_asked_again_at_once_and_then_left_alone(
    manner: Manner,
) -> None:
    field = square(manner, FAR, before=lambda f: f.rule("no-target", "n04")).to_step(20)
    asked = [step for step, numbers in sensors(field, 3) if 4 in numbers]
    assert {b - a for a, b in pairwise(asked)} == {1, PAUSE + 1}


# --- result, estimate -------------------------------------------------------------------------------------------------


def test_one_that_hears_no_result_asks_the_others_and_does_not_take_over() -> None:
    field = square("location-central")
    field.rule("result", "n00", "n02", count=1)
    field.to_step(8)
    (doubt,) = field.frames("doubt")
    assert (doubt.src, doubt.t_ns) == ("n02", ORIGIN_NS + 6 * NS + WORD_NS)
    assert {one.src for one in field.frames("alive", dst="n02")} == {"n00", "n01", "n03"}
    assert (field.leaders(), len(field.begun())) == (["n00"], 1)


@pytest.mark.parametrize("vouching", ["n00", "n01"])
def test_one_link_that_is_bad_for_long_brings_no_new_head(vouching: str) -> None:
    """Whether it is the head that hears the doubt, or another one that hears the head."""
    field = square("location-central")
    for kind in ("result", "poll"):
        field.rule(kind, "n00", "n02")
    for id in {"n00", "n01", "n03"} - {vouching}:
        field.rule("alive", id, "n02")
    field.to_step(20)
    assert (field.leaders(), len(field.begun())) == (["n00"], 1)
    assert len(field.frames("doubt", "n02")) >= 1


def test_a_result_that_nobody_hears_brings_no_new_head_while_the_head_hears_doubts() -> None:
    field = square("location-central")
    field.rule("result", "n00", count=len(field.nodes))
    field.to_step(8)
    assert {one.src for one in field.frames("doubt")} == {"n01", "n02", "n03"}
    assert (field.leaders(), len(field.begun())) == (["n00"], 1)


def test_if_the_answers_are_lost_it_takes_over_and_the_old_head_yields() -> None:
    field = square("location-central")
    field.rule("result", "n00", "n02", count=1)
    field.rule("alive", None, "n02")
    field.to_step(9)
    assert field.begun()[1:] == [("n02", 2, "n00 is silent")]
    assert field.leaders() == ["n02"]
    assert any("yields to n02, term 2" in text for _, id, text in field.notes if id == "n00")
    assert field.follows_well(5, 9)


def test_without_estimates_the_next_head_goes_on_with_an_older_one() -> None:
    field = square("elected")
    field.rule("estimate")
    field.to_step(8)
    assert {field.header(id).known.step for id in ("n01", "n02", "n03")} == {5}  # type: ignore[union-attr]
    field.kill("n00")
    field.to_step(13)
    assert field.begun()[1][1:] == (2, "elected")
    assert field.track(11).status != "waiting" if field.track(11) else True  # type: ignore[union-attr]
    assert field.follows_well(12, 13)
