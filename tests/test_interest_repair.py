"""Directed diffusion by stories: which path, message or relay is lost, and what arrives all the same."""

from __future__ import annotations

from itertools import pairwise

import pytest

from tests.diffusing import CHAIN, DETOUR, DIAMOND, REACH_M, Field, asked, hops, way
from tests.puppet import MS
from trackfield.protocols.interest.carrying import MOST_TRIES
from trackfield.protocols.interest.traffic import CARRIED, LOOPED
from trackfield.wire.interests import Data, Reinforce

# --- paths are lost --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kind", "sender", "receiver"),
    [("data", "c", "b"), ("data", "b", "a"), ("reinforce", "base", "a"), ("reinforce", "b", "c")],
)
def test_data_goes_by_gradients_until_a_path_is_found_anew(kind: str, sender: str, receiver: str) -> None:
    """An empty message or a reinforcement is lost; the source explores again after the next refresh."""
    field = Field(CHAIN, REACH_M)
    field.rule(kind, sender, receiver, count=2 if kind == "data" else 1)
    field.ask("base")
    field.wait(2)
    assert way(field) != ["c", "b", "a", "base"]
    field.tell("c", 1)
    assert field.wait(1).got("base") == [1]
    assert way(field.wait(3)) == ["c", "b", "a", "base"]


def test_the_first_report_finds_the_path_of_who_did_not_explore() -> None:
    field = Field(CHAIN, REACH_M, sources=())
    field.ask("base")
    field.wait(1)
    field.tell("c", 1)
    field.wait(1)
    assert field.got("base") == [1]
    assert way(field) == ["c", "b", "a", "base"]


def test_reinforcements_in_a_circle_do_not_hold_data_up() -> None:
    """Paths that cannot come about by themselves: ``p`` to ``q`` to ``r`` to ``p``."""
    field = Field({**CHAIN, "p": (60.0, 10.0), "q": (60.0, -10.0), "b": (55.0, 0.0)}, REACH_M)
    field.rule("reinforce")
    field.ask("base")
    field.wait(2)
    for to, next in (("p", "q"), ("q", "b"), ("b", "p")):
        field.inject(to, Reinforce(b"base", 1, b"c"), next)
    field.tell("c", 1)
    field.wait(2)
    assert field.got("base", "c") == [1]
    (first,) = [one for one in field.frames("data", "c") if one.message.message]
    went = [(one.src, one.dst) for one in field.frames("data") if one.message.message]
    assert max(went.count(one) for one in went) == 1
    circle = {("p", "q"), ("q", "b"), ("b", "p")}
    assert circle & set(went), "it went at least a part of the circle"
    assert CARRIED | LOOPED in [
        how for one, how, _ in field.state(first.dst).traffic.seen["c"] if one == first.message.serial
    ]
    field.tell("c", 2)
    field.wait(2)
    assert field.got("base", "c") == [1, 2]
    assert len(hops(field)) == len(went) + 3, "the second goes straight"


# --- data is lost ----------------------------------------------------------------------------------------------------


def test_data_that_is_lost_is_sent_again() -> None:
    field = asked().wait(1)
    field.rule("data", "b", "a", count=1)
    field.tell("c", 1)
    field.wait(1)
    assert field.got("base") == [1]
    assert hops(field) == [("c", "b"), ("b", "a"), ("b", "a"), ("a", "base")]


def test_data_whose_acknowledgement_is_lost_arrives_once() -> None:
    field = asked().wait(1)
    field.rule("data-ack", "a", "b", count=1)
    field.tell("c", 1)
    field.wait(1)
    assert field.got("base") == [1]
    assert hops(field) == [("c", "b"), ("b", "a"), ("a", "base"), ("b", "a")]
    assert field.reasons("a")[-1] == "repeated"


def test_data_that_reached_the_sink_twice_counts_once() -> None:
    field = asked().wait(1)
    field.rule("data-ack", "base", "a")
    field.tell("c", 1)
    field.wait(1)
    assert field.got("base") == [1]
    assert field.reasons("base").count("repeated") >= 1


def test_the_next_gradient_takes_the_place_of_a_relay_that_died() -> None:
    field = asked(DIAMOND).wait(1)
    dead = way(field)[1]
    (other,) = {"a", "b"} - {dead}
    field.kill(dead)
    field.tell("c", 1)
    field.wait(1)
    assert field.got("base") == [1]
    assert hops(field) == [("c", dead)] * MOST_TRIES + [("c", other), (other, "base")]
    assert way(field) == ["c", other, "base"], "the new path is reinforced"
    field.tell("c", 2)
    field.wait(1)
    assert field.got("base") == [1, 2]
    assert len(hops(field)) == MOST_TRIES + 4, "nobody tries the dead one again"


def test_a_flood_finds_a_way_around_a_relay_that_died() -> None:
    field = asked(DETOUR).wait(1)
    field.kill("r")
    field.tell("c", 1)
    field.wait(1)
    assert field.got("base") == [1]
    spread = [(one.src, one.message.spread) for one in field.frames("data") if one.message.message]
    assert spread[MOST_TRIES:] == [("c", 2), ("w", 1), ("x", 0), ("y", 0)]
    assert way(field) == ["c", "w", "x", "y", "base"]
    field.tell("c", 2)
    field.wait(1)
    assert field.got("base") == [1, 2]
    assert hops(field)[-4:] == [*pairwise(["c", "w", "x", "y", "base"])]


def test_a_relay_takes_nothing_that_it_could_only_give_back() -> None:
    field = asked().wait(1)
    field.inject("c", Data(b"base", 1, b"a", 7, 1, 0, b"x"), "b")
    assert field.reasons("c")[-1] == "no way"
    assert not field.frames("data-ack", "c")


def test_a_message_that_nobody_takes_is_given_up() -> None:
    field = asked().wait(1)
    field.kill("a", "b")
    field.tell("c", 1)
    field.run(9000 * MS)
    assert not field.state("c").traffic.queue
    for id in "ab":
        field.start(id)
    field.run(10_000 * MS)
    field.tell("c", 2)
    field.wait(1)
    assert field.got("base") == [2]


def test_no_message_is_taken_by_a_full_queue() -> None:
    """``b`` refuses the third of three messages while two wait; ``c`` keeps it, and the base gets all."""
    field = asked({**CHAIN, "d": (75.0, 15.0), "e": (75.0, -15.0)}, queue=2).wait(2)
    field.rule("data-ack", "a", "b", count=1)
    for id in "cde":
        field.tell(id, 1)
    field.wait(2)
    assert "queue full" in field.reasons("b")
    assert sorted(one.sender for one in field.actors["base"].role.arrived) == ["c", "d", "e"]


def test_of_too_many_own_messages_the_newest_are_kept() -> None:
    field = asked(queue=3).wait(1)
    for step in range(1, 7):
        field.tell("c", step)
    field.wait(2)
    assert field.got("base") == [1, 5, 6], "the first was under way"
    assert len([text for _, id, text in field.notes if id == "c" and "3 wait already" in text]) == 3


# --- frames come twice, processes again ------------------------------------------------------------------------------


def test_frames_that_come_twice_are_one() -> None:
    field = Field(DIAMOND, REACH_M)
    field.rule(delays=(0, 7 * MS))
    field.ask("base")
    field.wait(2)
    for step in (1, 2, 3):
        for id in "abc":
            field.tell(id, step)
        field.wait(1)
    assert [field.got("base", id) for id in "abc"] == [[1, 2, 3]] * 3


def test_a_relay_that_starts_again_has_all_it_needs_with_the_next_refresh() -> None:
    field = asked().wait(1)
    field.start("b")
    assert not field.known("b")
    field.run(4000 * MS)
    field.tell("c", 1)
    assert field.wait(1).got("base") == [1]


def test_messages_of_a_new_life_are_not_taken_for_old_ones() -> None:
    field = asked().wait(1)
    field.tell("c", 1)
    field.wait(1)
    field.start("c")
    field.run(4000 * MS)
    field.tell("c", 1)
    assert field.wait(1).got("base", "c") == [1, 1]


def test_a_sink_that_starts_again_may_ask_anew_by_the_same_number() -> None:
    field = asked().wait(1)
    field.start("base")
    field.tell("c", 1)
    assert field.wait(1).got("base") == []
    field.ask("base", x_m=60.0, radius_m=10.0)
    field.wait(1)
    assert not field.known("c")
    assert field.tell("b", 2)
    assert field.wait(1).got("base") == [2]


# --- pace ------------------------------------------------------------------------------------------------------------


def test_the_latest_message_waits_for_its_turn() -> None:
    field = Field(CHAIN, REACH_M)
    field.ask("base", interval_s=2.0)
    field.wait(1)
    for step in range(1, 7):
        field.tell("c", step)
        field.wait(0.5)
    field.wait(4)
    told = [one for one in field.frames("data", "c") if one.message.message]
    assert field.got("base") == [1, 4, 6]
    assert [after.t_ns - before.t_ns for before, after in pairwise(told)] == [2000 * MS] * 2


def test_what_waits_is_dropped_when_nobody_wants_it_any_longer() -> None:
    field = Field(CHAIN, REACH_M)
    field.ask("base", interval_s=10.0)
    field.wait(1)
    field.tell("c", 1)
    field.tell("c", 2)
    field.kill("base")
    field.wait(12)
    assert [text for _, id, text in field.notes if id == "c"] == [
        "a message is dropped: base does not want it any longer"
    ]


def test_own_data_keeps_the_pace_too() -> None:
    field = Field(CHAIN, REACH_M)
    field.ask("base", interval_s=2.0)
    field.tell("base", 1)
    field.tell("base", 2)
    assert field.got("base") == [1]
    field.wait(2.5)
    assert field.got("base") == [1, 2]
