"""A header that leads or takes over, event by event: doubts, hand-overs, reports, and targets that are lost."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from immutables import Map

from head.peers.following import HOLD
from head.peers.memory import Known, Memory, Offer, Phase
from tests.peered import BEACON_NS, DEADLINE_NS, LEASE_NS, TIMES, TURN_NS, WORD_NS
from tests.test_header_role import (
    HEADER,
    HEADERS,
    at,
    belief,
    hears,
    idle,
    ignored,
    leading,
    polled,
    result,
    sent,
    timers,
)
from trackfield.protocols.lease import MOST_NUMBER, Term
from trackfield.role import NEIGHBOURHOOD, CancelTimer, Publish, Send, Timer
from trackfield.wire.clusters import Alive, Doubt, HandOver, HandOverAck, NoTarget
from trackfield.wire.listed import packed
from trackfield.wire.messages import Range
from trackfield.wire.peers import MOST_KEY, Dissolve, JoinClaim, LocalEstimate, Result

# --- silence and doubts -----------------------------------------------------------------------------------------------


def test_without_a_result_it_doubts_and_takes_over_in_its_turn() -> None:
    """By distance to where the target should be, (20, 29): n03 at (30, 30) before n01 (0, 30), n02 (30, 0)."""
    said = replace(result(step=5), x_m=20.0, y_m=29.0)
    state, _ = hears(polled(5), at(5.2), said)
    state, effects = HEADER.handle(state, Timer(at(6) + WORD_NS, "word"))
    assert sent(effects) == [(Doubt(2, b"n00"), NEIGHBOURHOOD)]
    assert timers(effects) == {"take-over": at(6) + WORD_NS + TURN_NS}
    state, effects = HEADER.handle(state, Timer(at(6) + WORD_NS + TURN_NS, "take-over"))
    assert state.phase is Phase.LEADING
    assert (state.held.term, sent(effects)[0][1]) == (Term(3, "n03"), NEIGHBOURHOOD)
    word = sent(effects)[0][0]
    assert (word.number, word.step) == (3, 6)
    assert [one.estimate.step for one in effects if isinstance(one, Publish)] == [6]
    assert timers(effects) == {"window": at(6) + BEACON_NS, "deadline": at(7) + DEADLINE_NS}


def test_the_second_waits_another_turn() -> None:
    said = replace(result(step=5), x_m=2.0, y_m=29.0)
    state, _ = hears(polled(5), at(5.2), said)
    _, effects = HEADER.handle(state, Timer(at(6) + WORD_NS, "word"))
    assert timers(effects) == {"take-over": at(6) + WORD_NS + 2 * TURN_NS}  # n01 is nearer


def test_an_answer_to_its_doubt_makes_it_wait_for_the_next_word() -> None:
    state, _ = hears(polled(5), at(5.2), result())
    state, _ = HEADER.handle(state, Timer(at(6) + WORD_NS, "word"))
    state, effects = hears(state, at(6.54), Alive(2, b"n00"), "n01")
    assert timers(effects) == {"word": at(7) + WORD_NS, "lease": at(6.54) + LEASE_NS}
    assert CancelTimer("take-over") in effects


@pytest.mark.parametrize(("number", "leader", "awake"), [(2, b"n00", True), (5, b"n01", False)])
def test_who_is_told_of_a_new_head_measures_no_more_for_the_old_one(number: int, leader: bytes, awake: bool) -> None:
    state, effects = hears(polled(5), at(5.3), Alive(number, leader), "n02")
    assert state.phase is (Phase.POLLED if awake else Phase.FOLLOWING)
    assert ("word" in timers(effects)) == awake
    assert state.held.term == Term(number, leader.decode())


@pytest.mark.parametrize("since", [HOLD, HOLD + 1])
def test_one_that_was_not_polled_for_some_steps_sleeps_and_takes_no_part(since: int) -> None:
    """Its head may have gone on with others; it follows it as long as its lease lasts."""
    state, _ = hears(polled(5), at(5.2 + since - 1), result(step=5 + since - 1))
    state, effects = HEADER.handle(state, Timer(at(5 + since) + WORD_NS, "word"))
    assert len(sent(effects)) == (since <= HOLD)
    assert state.phase is (Phase.POLLED if since <= HOLD else Phase.FOLLOWING)


@pytest.mark.parametrize("known", ["nothing", "too old", "of the future", "impossible"])
def test_without_a_usable_result_it_does_not_take_over(known: str) -> None:
    state = polled(5)
    step = {"too old": 5 - 20, "of the future": 60}.get(known, 5)
    if known != "nothing":
        data = belief(1e7 if known == "impossible" else 15.0, step=max(step, 0))
        state = replace(state, known=Known(step, data))
    now = at(20 if known == "too old" else 5) + WORD_NS
    state = replace(state, polled=replace(state.polled, step=20 if known == "too old" else 5))
    after, effects = HEADER.handle(state, Timer(now, "word"))
    assert sent(effects) == []
    assert timers(effects) == {}
    assert after.leads is None


def test_only_who_heard_the_head_of_late_vouches_for_it() -> None:
    state, _ = hears(polled(5), at(5.2), result())
    assert sent(hears(state, at(5.52), Doubt(2, b"n00"), "n01")[1]) == [(Alive(2, b"n00"), "n01")]
    assert sent(hears(state, at(5.8), Doubt(2, b"n00"), "n01")[1]) == []
    assert sent(hears(state, at(5.52), Doubt(3, b"n02"), "n01")[1]) == []
    assert sent(hears(state, at(5.8), Doubt(1, b"n02"), "n01")[1]) == [(Alive(2, b"n00"), "n01")]
    assert sent(hears(leading(), at(5.9), Doubt(2, b"n03"), "n01")[1]) == [(Alive(2, b"n03"), "n01")]


# --- hand-overs -------------------------------------------------------------------------------------------------------


def test_who_is_handed_the_track_leads_from_the_next_step_on() -> None:
    state, effects = hears(idle(), at(5.2), HandOver(3, 5, belief()))
    assert sent(effects) == [(HandOverAck(3), "n00")]
    assert timers(effects) == {"window": at(5) + BEACON_NS, "deadline": at(6) + DEADLINE_NS}
    assert (state.phase, state.held.term) == (Phase.LEADING, Term(3, "n03"))
    state, effects = HEADER.handle(state, Timer(at(5) + BEACON_NS, "window"))
    (poll, to), own = sent(effects)
    assert (poll.number, poll.step, to, own) == (3, 6, NEIGHBOURHOOD, (poll, "n03"))
    assert poll.sensors[:2] == packed([3])  # itself first


def test_a_hand_over_that_comes_again_is_acknowledged_again() -> None:
    after, effects = hears(leading(number=3), at(5.3), HandOver(3, 5, belief()))
    assert effects == (Send(HandOverAck(3), "n00"),)
    assert after.phase is Phase.LEADING


@pytest.mark.parametrize(
    ("message", "reason"),
    [
        (HandOver(2, 5, belief()), "outdated"),
        (HandOver(1, 5, belief()), "outdated"),
        (HandOver(MOST_NUMBER + 1, 5, belief()), "outdated"),
        (HandOver(4, 7, belief(step=7)), "from the future"),
        (HandOver(4, 5, b""), "unusable belief"),
        (HandOver(4, 5, b"\xc1"), "unusable belief"),
        (HandOver(4, 5, belief(1e7)), "unusable belief"),
        (HandOver(4, 5, belief(sd=1e7)), "unusable belief"),
    ],
)
def test_hand_overs_that_are_of_no_use(message: HandOver, reason: str) -> None:
    after, effects = hears(polled(5, number=3), at(5.3), message)
    assert ignored(effects) == [reason]
    assert sent(effects) == []
    assert after.leads is None


def offering() -> Memory:
    """It leads, and has offered term 3 to n00 and n01."""
    state = leading(5, number=2)
    assert state.leads is not None
    return replace(state, leads=replace(state.leads, offer=Offer(3, ("n00", "n01"))))


@pytest.mark.parametrize(("number", "sender", "counts"), [(3, "n00", True), (4, "n00", False), (3, "n01", False)])
def test_only_the_acknowledgement_that_it_waits_for_counts(number: int, sender: str, counts: bool) -> None:
    after, effects = hears(offering(), at(5.3), HandOverAck(number), sender)
    assert (after.leads is None) == counts
    assert ignored(effects) == ([] if counts else ["outdated"])
    assert after.held.term == (Term(3, "n00") if counts else Term(2, "n03"))
    assert after.held.watched == counts


def test_nominees_are_asked_one_after_the_other_in_ever_higher_terms() -> None:
    state, effects = HEADER.handle(offering(), Timer(at(5.5), "hand-over"))
    (over, to), *none = sent(effects)
    assert (over.number, to, none) == (4, "n01", [])
    assert timers(effects) == {"hand-over": at(5.5) + TIMES["handover_ns"]}
    state, effects = HEADER.handle(state, Timer(at(5.8), "hand-over"))
    assert (sent(effects), state.phase, state.held.term) == ([], Phase.LEADING, Term(2, "n03"))
    assert state.leads is not None
    assert not {"n00", "n01"} & set(state.leads.chosen)  # they are left alone for a while


def test_an_elected_head_that_finds_nobody_ends_its_term() -> None:
    state = leading(5, number=2, manner="elected")
    assert state.leads is not None
    state = replace(state, leads=replace(state.leads, offer=Offer(3, ("n00",))))
    state, effects = HEADERS["elected"].handle(state, Timer(at(5.5), "hand-over"))
    assert sent(effects) == [(Dissolve(2, 5, 0), NEIGHBOURHOOD)]
    assert (state.phase, state.held.term) == (Phase.IDLE, Term(2, ""))


# --- reports ----------------------------------------------------------------------------------------------------------


def asking() -> Memory:
    return HEADER.handle(leading(), Timer(at(5) + BEACON_NS, "window"))[0]


def test_reports_of_those_that_were_asked_are_collected_once() -> None:
    state, effects = hears(asking(), at(6.05), Range(6, 20.0), "n01")
    assert ignored(effects) == []
    assert state.leads is not None
    assert state.leads.came == {"n01"}
    assert ignored(hears(state, at(6.06), Range(6, 20.0), "n01")[1]) == ["repeated"]
    assert ignored(hears(state, at(6.06), Range(5, 20.0), "n01")[1]) == ["late"]
    assert ignored(hears(state, at(6.06), Range(8, 20.0), "n01")[1]) == ["from the future"]
    assert ignored(hears(state, at(6.06), Range(6, 20.0), "stranger")[1]) != []


def test_reports_and_answers_to_nobody_are_ignored() -> None:
    assert ignored(hears(idle(), at(6.05), Range(6, 20.0), "n01")[1]) == ["not leading"]
    assert ignored(hears(idle(), at(6.05), NoTarget(6), "n01")[1]) == ["not asked"]
    assert ignored(hears(asking(), at(6.05), LocalEstimate(2, 6, belief()), "n01")[1]) == ["not asked"]


def test_one_that_senses_no_target_is_no_more_one_of_those_that_do() -> None:
    state = replace(asking(), joined=Map({"n01": 99}))
    state, _ = hears(state, at(6.05), NoTarget(6), "n01")
    assert state.leads is not None
    assert state.leads.deaf == {"n01"}
    assert not state.joined


def test_a_join_holds_as_long_as_it_says_and_no_longer_than_settings_allow() -> None:
    for own, expires, until in ((5, 9, 9), (5, 65535, 5 + 10), (MOST_KEY, 9, None), (5, 4, None)):
        state, _ = hears(leading(), at(5.3), JoinClaim(2, MOST_KEY, b"n03", own, expires), "n01")
        assert state.joined.get("n01") == until


def test_three_steps_without_a_report_and_the_target_is_lost() -> None:
    state, told = leading(), list[Any]()
    for step in (6, 7, 8):
        assert state.phase is Phase.LEADING
        state, _ = HEADER.handle(state, Timer(at(step - 1) + BEACON_NS, "window"))
        state, effects = HEADER.handle(state, Timer(at(step) + DEADLINE_NS, "deadline"))
        told += [message for message, to in sent(effects) if to == NEIGHBOURHOOD]
    assert [type(one) for one in told] == [Result, Result, Dissolve]
    assert told[-1] == Dissolve(2, 8, 1)
    assert (state.phase, state.known) == (Phase.IDLE, None)


def test_a_window_that_comes_too_late_polls_nobody() -> None:
    assert HEADER.handle(leading(), Timer(at(6), "window"))[1] == ()
