"""Heads that hand over, where any node may lead: offers, acknowledgements and joins that are lost, twice or late."""

from __future__ import annotations

from typing import Any

import pytest

from tests.ether import DELAY_NS, ORIGIN_NS
from tests.peered import DEADLINE_NS, HANDOVER_NS, MANNERS, Field, Manner, field_of
from tests.puppet import MS
from tests.test_peer_stories import sensors
from trackfield.role import NS

MANY: dict[Manner, dict[str, Any]] = {"location-central": {}, "elected": {"count": 5, "keep_within_m": 22.0}}
"""Settings by which a head that hands over has two that it may ask."""


def before_the_hand_over(manner: Manner, **settings: Any) -> tuple[Field, str, str, int]:
    """Just before the second leader hands over: the field, that leader, to whom it will do so, and the step."""
    calm = field_of(manner, **settings).to_step(15)
    over = calm.frames("hand-over")[1]
    step = (over.t_ns - ORIGIN_NS) // NS
    field = field_of(manner, **settings).to_step(step, 100 * MS)
    assert field.leaders() == [over.src]
    return field, over.src, over.dst, step


@pytest.mark.parametrize("manner", MANNERS)
def test_a_hand_over_and_its_acknowledgement(manner: Manner) -> None:
    field, head, third, step = before_the_hand_over(manner)
    field.to_step(step)
    (over,), (ack,) = field.frames("hand-over", since=step), field.frames("hand-over-ack", since=step)
    at_ns = ORIGIN_NS + step * NS + DEADLINE_NS
    assert (over.t_ns, over.src, over.dst, over.message.number) == (at_ns, head, third, 3)
    assert (ack.t_ns, ack.src, ack.dst) == (at_ns + DELAY_NS, third, head)
    assert [one.src for one in field.frames("poll", since=step)] == [third]


@pytest.mark.parametrize("manner", MANNERS)
def test_a_hand_over_that_is_lost_goes_to_the_second_nominee(manner: Manner) -> None:
    field, head, third, step = before_the_hand_over(manner, **MANY[manner])
    field.rule("hand-over", head, third, count=1)
    field.to_step(step)
    first, second = field.frames("hand-over", since=step)
    assert (first.message.number, second.message.number) == (3, 4)
    assert second.t_ns - first.t_ns == HANDOVER_NS
    assert field.leaders() == [second.dst]
    assert field.follows_well(5, 15) if field.to_step(15) else False


def test_a_head_whom_nobody_answers_goes_on_itself_and_tries_again() -> None:
    field, head, _, step = before_the_hand_over("location-central")
    field.rule("hand-over", count=2)
    field.to_step(step)
    assert [one.t_ns for one in field.frames("hand-over", since=step)] == [
        ORIGIN_NS + step * NS + DEADLINE_NS + k * HANDOVER_NS for k in (0, 1)
    ]
    assert field.leaders() == [head]
    field.to_step(step + 6)
    assert field.leaders() != [head]
    assert len(field.leaders()) == 1
    assert field.follows_well(5, step + 6)
    assert not field.frames("dissolve")


def test_an_elected_head_whom_nobody_answers_dissolves_and_another_is_elected() -> None:
    field, head, _, step = before_the_hand_over("elected")
    field.rule("hand-over")
    field.to_step(step)
    dissolve, *again = field.frames("dissolve")
    assert [one.message for one in again] == [dissolve.message]  # in the next window, for those that sleep
    tried = len(field.frames("hand-over", since=step))
    assert dissolve.t_ns == ORIGIN_NS + step * NS + DEADLINE_NS + tried * HANDOVER_NS
    assert (dissolve.src, dissolve.message.lost) == (head, 0)
    field.rules.clear()
    field.to_step(step + 6)
    who, _, why = field.begun()[2]
    assert (why, who in field.nodes) == ("elected", True)
    assert field.began_ns()[2] < (step + 2) * NS  # by those that sense the target at the next step
    assert field.follows_well(step + 2, step + 6)  # with what the old head said last


@pytest.mark.parametrize("settings", [{}, {"count": 5, "keep_within_m": 22.0}])
@pytest.mark.parametrize("manner", MANNERS)
@pytest.mark.parametrize("all_of_them", [False, True])
def test_an_acknowledgement_that_is_lost(manner: Manner, all_of_them: bool, settings: dict[str, Any]) -> None:
    """The nominee leads, and the second one is asked in a higher term; or the old term ends. One leads at last."""
    if manner == "location-central":
        settings = {}
    field, head, third, step = before_the_hand_over(manner, **settings)
    field.rule("hand-over-ack", None if all_of_them else third, head, count=99 if all_of_them else 1)
    field.to_step(step + 1)
    assert len(field.leaders()) == 1
    assert field.leader() != head
    assert field.follows_well(5, step + 6) if field.to_step(step + 6) else False


@pytest.mark.parametrize("manner", MANNERS)
def test_a_hand_over_that_comes_twice_is_acknowledged_twice_and_one_leads(manner: Manner) -> None:
    field, head, third, step = before_the_hand_over(manner)
    field.rule("hand-over", count=1, delays=(0, 30 * MS))
    field.to_step(step)
    assert len(field.frames("hand-over-ack", since=step)) == 2
    assert field.leaders() == [third]
    assert len([why for *_, why in field.begun() if why == f"{head} hands over"]) == 1


@pytest.mark.parametrize("manner", MANNERS)
def test_a_hand_over_that_comes_late(manner: Manner) -> None:
    """It is outdated if another one leads by then, in a higher term; and one leads at last."""
    field, head, third, step = before_the_hand_over(manner)
    field.rule("hand-over", head, third, count=1, delays=(900 * MS,))
    field.to_step(step + 2)
    assert ("outdated" in field.reasons(third)) == (manner == "location-central")
    assert len(field.leaders()) == 1
    assert field.follows_well(step, step + 6) if field.to_step(step + 6) else False


def test_joins_are_told_to_the_new_head_after_a_hand_over() -> None:
    """Those that sense the target, and are not asked to measure at once, tell the next head so."""
    field, _, _, step = before_the_hand_over("elected")
    sensing = {id for id in field.nodes if field.reading(id, ORIGIN_NS + step * NS) is not None}
    field.to_step(step + 1)
    new = field.leader()
    told = {one.src for one in field.frames("join-claim", dst=new, since=step)}
    asked = {field.nodes[n] for s, numbers in sensors(field, step + 1) if s == step + 1 for n in numbers}
    silent = sensing - asked - {new}
    assert silent
    assert silent <= told
    assert told <= set(field.header(new).joined)
