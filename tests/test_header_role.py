"""A header, event by event: announcements, what was stored, keys, terms; and all that is of no use."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import msgpack
import numpy as np
import pytest
from immutables import Map

from head.header import Header
from head.peers.memory import TRANSITIONS, Memory, Phase
from head.peers.settings import Settings, Times
from tests.ether import ORIGIN_NS
from tests.peered import (
    ANNOUNCE_NS,
    ANNOUNCEMENTS,
    DEADLINE_NS,
    LEASE_NS,
    MANNERS,
    TIMES,
    WORD_NS,
    Manner,
    field_of,
    grid,
    header_of,
)
from tests.puppet import MS
from trackfield.filters.types import Gaussian
from trackfield.protocols.lease import MOST_NUMBER, Term
from trackfield.role import (
    NEIGHBOURHOOD,
    NS,
    Effect,
    Event,
    Ignored,
    IllegalEvent,
    Note,
    Radio,
    Received,
    Sampled,
    Send,
    SetTimer,
    Started,
    State,
    Store,
    Timer,
    check_transition,
)
from trackfield.tracking.stored import pack
from trackfield.wire.clusters import Alive, Announce, HandOver, HandOverAck, Share
from trackfield.wire.listed import packed
from trackfield.wire.peers import MOST_KEY, Claim, Dissolve, Poll, Result

SQUARE = grid(2)
NEAR = Map(dict.fromkeys(("n00", "n01", "n02", "n03"), ANNOUNCEMENTS))
HEADERS = {manner: header_of(3, SQUARE, manner) for manner in MANNERS}
HEADER = HEADERS["location-central"]


def at(step: float) -> int:
    return ORIGIN_NS + round(step * NS)


def sent(effects: tuple[Effect, ...]) -> list[tuple[Any, Any]]:
    return [(one.message, one.to) for one in effects if isinstance(one, Send)]


def ignored(effects: tuple[Effect, ...]) -> list[str]:
    return [one.reason for one in effects if isinstance(one, Ignored)]


def timers(effects: tuple[Effect, ...]) -> dict[str, int]:
    return {one.name: one.at for one in effects if isinstance(one, SetTimer)}


def idle(header: Header = HEADER, stored: bytes = b"") -> Memory:
    """A header that heard all others announce themselves."""
    state, _ = header.handle(header.begin(), Started(0, stored))
    return replace(state, announced=ANNOUNCEMENTS, near=NEAR)


def hears(
    state: Memory, now: int, message: Any, sender: str = "n00", header: Header = HEADER
) -> tuple[Memory, tuple[Effect, ...]]:
    return header.handle(state, Received(now, message, sender))


def belief(x: float = 15.0, y: float = 15.0, sd: float = 1.0, step: int = 5) -> bytes:
    return pack(step, None, {"ukf": Gaussian(np.array([x, y, 0.0, 0.0]), sd**2 * np.eye(4))})


def result(number: int = 2, step: int = 5) -> Result:
    return Result(number, step, 15.0, 15.0, 0.0, 0.0, 1.0, 1.0)


def polled(step: int = 5, *, number: int = 2, manner: Manner = "location-central") -> Memory:
    """It follows n00, which had all measure at this step."""
    poll = Poll(number, step, packed(range(4)))
    return hears(idle(HEADERS[manner]), at(step - 0.01), poll, "n00", HEADERS[manner])[0]


def leading(step: int = 5, *, number: int = 2, manner: Manner = "location-central") -> Memory:
    """It was handed the track after this step."""
    header = HEADERS[manner]
    over = HandOver(number, step, belief(step=step))
    state, effects = hears(idle(header), at(step) + DEADLINE_NS, over, "n00", header)
    assert sent(effects) == [(HandOverAck(number), "n00")]
    return state


# --- announcements ----------------------------------------------------------------------------------------------------


def test_it_announces_itself_in_its_turn_of_each_round() -> None:
    state, effects = HEADER.handle(HEADER.begin(), Started(0))
    assert State("idle") in effects
    assert Radio(False) in effects  # its member listens during the set-up
    round_ns, times = ANNOUNCE_NS // ANNOUNCEMENTS, []
    for _ in range(ANNOUNCEMENTS):
        now = timers(effects)["announce"]
        times.append(now)
        state, effects = HEADER.handle(state, Timer(now, "announce"))
        assert sent(effects) == [(Announce(len(times), ANNOUNCEMENTS, 0, 30.0, 30.0), NEIGHBOURHOOD)]
    assert times == [k * round_ns + round_ns * 3 // 5 for k in range(ANNOUNCEMENTS)]
    assert timers(effects) == {}


def test_turns_differ_between_nodes() -> None:
    headers = [header_of(number, SQUARE, "elected") for number in range(4)]
    turns = [timers(one.handle(one.begin(), Started(0))[1])["announce"] for one in headers]
    assert sorted(set(turns)) == turns


def test_whom_it_heard_and_the_term_outlive_it() -> None:
    state, _ = HEADER.handle(HEADER.begin(), Started(0))
    for _ in range(2):
        state, effects = hears(state, NS, Announce(1, 3, 0, 0.0, 0.0), "n01")
        assert effects == ()
    state, effects = HEADER.handle(state, Timer(ANNOUNCE_NS, "known"))
    assert [one for one in effects if isinstance(one, Store)]
    state, effects = hears(state, at(4.99), Poll(7, 5, packed([0])), "n00")
    (kept,) = [one.data for one in effects if isinstance(one, Store)]
    after, effects = HEADER.handle(HEADER.begin(), Started(at(9), kept))
    assert (after.near, after.held.term, after.announced) == (Map({"n01": 2}), Term(7, ""), ANNOUNCEMENTS)
    assert timers(effects) == {}
    assert after.phase is Phase.IDLE


def test_one_that_is_started_again_in_between_goes_on_announcing_itself() -> None:
    field = field_of("elected", SQUARE).run(3 * NS)
    field.kill("n03")
    field.start("n03")
    field.to_step(0)
    assert len(field.frames("announce", "n03")) >= ANNOUNCEMENTS
    assert field.header("n00").near["n03"] == ANNOUNCEMENTS


@pytest.mark.parametrize(
    "stored",
    [
        b"\xc1",
        b"x",
        *map(
            msgpack.packb,
            [
                None,
                3,
                [1],
                [1, 2],
                [1, {}, 3],
                ["7", {}],
                [7.0, {}],
                [float("inf"), {}],
                [-1, {}],
                [MOST_NUMBER + 1, {}],
                [7, {"n01": "many"}],
                [7, {"n01": 2**40}],
                [7, {"n01": -1}],
                [7, {"n01": None}],
            ],
        ),
    ],
)
def test_stored_bytes_that_cannot_be_used_are_noted(stored: bytes) -> None:
    after, effects = HEADER.handle(HEADER.begin(), Started(0, stored))
    assert any(isinstance(one, Note) and "cannot be used" in one.text for one in effects)
    assert (after.near, after.held.term) == (Map(), Term())


def test_nodes_of_another_field_are_left_out_of_what_was_stored() -> None:
    stored = msgpack.packb([7, {"n01": 3, "elsewhere": 3}])
    assert HEADER.handle(HEADER.begin(), Started(0, stored))[0].near == Map({"n01": 3})


# --- settings ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("db", "key"), [(9.0, 0), (0.0, 0), (-10.0, 16384), (-20.0, 32768), (-40.0, MOST_KEY), (-99.0, MOST_KEY)]
)
def test_the_key_of_an_election_is_linear_in_the_loudness(db: float, key: int) -> None:
    times = Times(**TIMES, nodes=4)
    assert Settings("n00", 0, {}, times, quiet_db=-40.0, loud_db=0.0).key(db) == key
    assert Settings("n00", 0, {}, times).key(db) == 0  # it is not known


# --- following --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("manner", MANNERS)
def test_a_poll_of_itself_keeps_it_awake_and_one_of_others_does_not(manner: Manner) -> None:
    header = HEADERS[manner]
    state, effects = hears(idle(header), at(4.99), Poll(2, 5, packed([0, 3])), "n00", header)
    assert (state.phase, state.polled.ids) == (Phase.POLLED, ("n00", "n03"))
    assert Radio(True) in effects
    assert timers(effects).get("word") == (at(5) + WORD_NS if manner == "location-central" else None)
    assert timers(effects)["lease"] == at(4.99) + LEASE_NS
    state, effects = hears(state, at(5.99), Poll(2, 6, packed([0, 1])), "n00", header)
    assert state.phase is Phase.FOLLOWING
    assert Radio(False) in effects


def test_a_result_is_remembered_and_an_older_one_does_not_replace_it() -> None:
    state, effects = hears(polled(5), at(5.2), result(step=5))
    assert state.known is not None
    assert state.known.step == 5
    assert timers(effects)["word"] == at(6) + WORD_NS
    again, _ = hears(state, at(5.3), result(step=4))
    assert again.known == state.known


def test_who_leads_in_a_lower_term_is_told_of_the_higher_one() -> None:
    state = polled(5, number=4)
    after, effects = hears(state, at(5.2), result(number=3), "n01")
    assert ignored(effects) == ["outdated"]
    assert sent(effects) == [(Alive(4, b"n00"), "n01")]
    assert after == state or after.held == state.held


def test_a_leader_yields_to_a_higher_term_and_of_one_number_to_the_higher_id() -> None:
    for number, sender, yields in ((3, "n00", True), (2, "n00", False), (1, "n02", False)):
        state, effects = hears(leading(5, number=2), at(5.5), result(number=number), sender)
        assert (state.leads is None) == yields
        assert any(isinstance(one, Note) and f"yields to {sender}" in one.text for one in effects) == yields
        assert (Alive(2, b"n03"), sender) in sent(effects) or yields


@pytest.mark.parametrize(
    "message",
    [
        Poll(1, 5, b""),
        result(),
        Claim(1, 0, 9),
        HandOver(9, 5, belief()),
        Alive(9, b"n00"),
    ],
    ids=lambda one: type(one).__name__,
)
@pytest.mark.parametrize("sender", ["n03", "stranger", "base"])
def test_what_no_peer_says_is_ignored(message: Any, sender: str) -> None:
    state = idle()
    after, effects = hears(state, at(5.1), message, sender)
    assert effects == (Ignored("unknown node"),)
    assert (after.held, after.near, after.leads) == (state.held, state.near, None)


@pytest.mark.parametrize(
    ("message", "sender"), [(Announce(1, 3, 0, 0, 0), "stranger"), (Announce(0, 0, 0, 0, 0), "n01")]
)
def test_announcements_that_are_none_do_not_count(message: Announce, sender: str) -> None:
    state, _ = HEADER.handle(HEADER.begin(), Started(0))
    assert hears(state, NS, message, sender) == (state, ())


def test_terms_beyond_any_are_not_believed() -> None:
    for message in (Poll(MOST_NUMBER + 1, 5, packed([3])), result(MOST_NUMBER + 1), Alive(MOST_NUMBER + 1, b"n00")):
        after, effects = hears(idle(), at(4.99), message)
        assert ignored(effects) == ["outdated"]
        assert after.held.term == Term()


def test_a_dissolved_term_is_over_and_what_was_lost_is_forgotten() -> None:
    state, _ = hears(polled(5), at(5.2), result())
    for lost in (0, 1):
        after, effects = hears(state, at(5.3), Dissolve(2, 5, lost))
        assert (after.held.term, after.phase) == (Term(2, ""), Phase.IDLE)
        assert (after.known is None) == bool(lost)
    for message, sender in ((Dissolve(1, 5, 1), "n00"), (Dissolve(2, 5, 1), "n01"), (Dissolve(3, 5, 1), "n00")):
        after, effects = hears(state, at(5.3), message, sender)
        assert ignored(effects) == ["outdated"]
        assert after.held == state.held


# --- anything else ----------------------------------------------------------------------------------------------------


def test_an_unknown_kind_is_ignored() -> None:
    assert ignored(hears(idle(), at(5), Share(1, 5, b"n01", belief()), "n00")[1]) == ["unexpected"]


@pytest.mark.parametrize(
    "event", [Timer(at(5), "deadline"), Timer(at(5), "report"), Sampled(at(5), "sound", None), Started(at(5))], ids=repr
)
def test_what_only_a_broken_driver_can_cause(event: Event) -> None:
    with pytest.raises(IllegalEvent):
        HEADER.handle(idle(), event)


def test_its_phases_follow_each_other_as_the_table_says() -> None:
    for before in set(Phase) - {Phase.NEW}:
        check_transition(TRANSITIONS, before, Timer(0, "word"), Phase.LEADING)
        for event in (Timer(0, "word"), Started(0)):
            with pytest.raises(IllegalEvent):
                check_transition(TRANSITIONS, before, event, Phase.NEW)
    with pytest.raises(IllegalEvent):
        check_transition(TRANSITIONS, Phase.NEW, Timer(0, "word"), Phase.IDLE)


@pytest.mark.parametrize("manner", MANNERS)
def test_the_phases_of_a_run(manner: Manner) -> None:
    """Each was there: one that leads, is polled, follows or contends."""
    field, seen = field_of(manner), set[str]()
    for ms in range(20_000, 32_000, 100):
        field.run(ms * MS)
        seen |= {field.header(id).phase.value for id in field.nodes}
    assert seen == {phase.value for phase in Phase} - {"new"}
