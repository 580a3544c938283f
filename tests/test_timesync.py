"""Asking for the time and telling it, event by event."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.puppet import MS
from trackfield.draw import uniform
from trackfield.protocols.timesync import (
    SPREAD_NS,
    TRANSITIONS,
    Offset,
    Phase,
    Rounds,
    Timekeeping,
    TimeSync,
    offset,
)
from trackfield.role import (
    NS,
    Corrected,
    Effect,
    Event,
    Ignored,
    IllegalEvent,
    PortRead,
    Received,
    Role,
    Send,
    SetTimer,
    Started,
    Timer,
)
from trackfield.wire.codec import encode
from trackfield.wire.messages import Doa, SyncReply, SyncRequest

CONFIG: dict[str, Any] = {"exchanges": 3, "resync_ns": 60 * NS, "timeout_ns": 200 * MS, "seed": 1, "id": "n007"}
ROUNDS = Rounds("fusion", **CONFIG)
SYNC: Role[Timekeeping] = TimeSync(ROUNDS)
ROOT: Role[Timekeeping] = TimeSync()
START_NS = int(SPREAD_NS * uniform(1, "n007", "sync", "start"))


# --- the arithmetic -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("there_ms", "back_ms", "held_ms", "wrong_ms"),
    [(5, 5, 0, 0), (5, 5, 40, 0), (9, 5, 0, 2), (1, 31, 7, -15), (31, 1, 0, 15)],
)
def test_an_exchange_is_off_by_half_the_asymmetry_of_its_way(
    there_ms: int, back_ms: int, held_ms: int, wrong_ms: int
) -> None:
    ahead = 250 * MS  # the reference
    t0 = 1000 * MS
    t1 = t0 + there_ms * MS + ahead
    t2 = t1 + held_ms * MS
    t3 = t2 - ahead + back_ms * MS
    assert offset(t0, t1, t2, t3) == Offset((there_ms + back_ms) * MS, ahead + wrong_ms * MS)


@given(*[st.integers(0, 10**12)] * 3, st.integers(-(10**15), 10**15))
def test_the_error_is_at_most_half_the_delay(there: int, back: int, held: int, ahead: int) -> None:
    found = offset(0, there + ahead, there + held + ahead, there + held + back)
    assert found.delta_ns == there + back
    assert abs(found.theta_ns - ahead) <= found.delta_ns / 2 + 1


# --- a round, event by event --------------------------------------------------------------------------------------


def reply(exchange: int, t0: int, *, there: int, back: int, ahead: int) -> Received:
    came = (t0 + there + ahead) // 1000
    return Received(t0 + there + back, SyncReply(exchange, t0 // 1000, came, came), "fusion")


def started(sync: Role[Timekeeping] = SYNC, now: int = 0) -> Timekeeping:
    return sync.handle(sync.begin(), Started(now))[0]


def asking(exchange: int = 1, at: int = NS) -> Timekeeping:
    """Its request ``exchange`` of the first round left at ``at``."""
    slots = CONFIG["exchanges"] - exchange + 1
    return replace(started(), phase=Phase.ASKING, asked=exchange, sent_ns=at, slots=slots)


def resting(correction: int = 0, *, due: int = 90 * NS) -> Timekeeping:
    """A process that has set its clock."""
    return Timekeeping(Phase.RESTING, correction, known=True, asked=8, due_ns=due)


def test_a_round_from_the_first_request_to_the_correction() -> None:
    """Three exchanges in slots of 200 ms, of which the second is the fastest; the reference is 250 ms ahead."""
    ahead, (first, second, third, end) = 250 * MS, (START_NS + slot * 200 * MS for slot in range(4))
    story: list[tuple[Event, tuple[Effect, ...]]] = [
        (Started(0), (SetTimer("sync", first),)),
        (Timer(first, "sync"), (Send(SyncRequest(1, first // 1000), "fusion"), SetTimer("sync", second))),
        (reply(1, first, there=30 * MS, back=10 * MS, ahead=ahead), ()),
        (Timer(second, "sync"), (Send(SyncRequest(2, second // 1000), "fusion"), SetTimer("sync", third))),
        (reply(2, second, there=4 * MS, back=6 * MS, ahead=ahead), ()),
        (Timer(third, "sync"), (Send(SyncRequest(3, third // 1000), "fusion"), SetTimer("sync", end))),
        (reply(3, third, there=4 * MS, back=10 * MS, ahead=ahead), ()),
        (Timer(end, "sync"), (Corrected(249 * MS), SetTimer("sync", end + 60 * NS))),
    ]
    state, phases = SYNC.begin(), []
    for event, expected in story:
        state, effects = SYNC.handle(state, event)
        phases.append(state.phase.value)
        # Replies carry microseconds; so the correction is good to one.
        assert [Corrected(round(e.correction_ns, -6)) if isinstance(e, Corrected) else e for e in effects] == [
            *expected
        ], event
    assert phases == ["resting", *["asking", "answered"] * 3, "resting"]
    assert state == replace(resting(state.correction_ns, due=end + 60 * NS), asked=3, sent_ns=third)


def test_processes_of_a_field_begin_at_different_times_within_the_spread() -> None:
    def starts(seed: int) -> list[int]:
        pieces = [TimeSync(replace(ROUNDS, id=f"n{i}", seed=seed)) for i in range(200)]
        return sorted(started(piece).due_ns for piece in pieces)

    assert starts(1)[0] >= 0
    assert starts(1)[-1] < SPREAD_NS
    assert max(b - a for a, b in pairwise(starts(1))) < SPREAD_NS // 20
    assert starts(1) != starts(2)


def test_a_request_or_reply_that_is_lost_is_given_up() -> None:
    """It asks again; the reply to the first, if it comes after all, is not used for the second."""
    again = NS + 200 * MS
    state, effects = SYNC.handle(asking(1), Timer(again, "sync"))
    assert effects == (Send(SyncRequest(2, again // 1000), "fusion"), SetTimer("sync", again + 200 * MS))
    assert (state.phase, state.asked, state.sent_ns, state.slots) == (Phase.ASKING, 2, again, 2)
    late = replace(reply(1, NS, there=5 * MS, back=5 * MS, ahead=0), now=again + MS)
    assert SYNC.handle(state, late) == (state, (Ignored("outdated"),))


def test_one_reply_of_a_round_will_do() -> None:
    heard = SYNC.handle(asking(2), reply(2, NS, there=5 * MS, back=5 * MS, ahead=-3 * MS))[0]
    asked_again = SYNC.handle(heard, Timer(NS + 200 * MS, "sync"))[0]
    now = NS + 400 * MS
    state, effects = SYNC.handle(asked_again, Timer(now, "sync"))
    assert effects == (Corrected(-3 * MS), SetTimer("sync", now + 60 * NS))
    assert state == replace(resting(-3 * MS, due=now + 60 * NS), asked=3, sent_ns=NS + 200 * MS)


@pytest.mark.parametrize("known", [False, True])
def test_a_round_without_any_reply_keeps_what_was_known_and_is_repeated_soon(known: bool) -> None:
    before, now = replace(asking(3), correction_ns=7 * MS, known=known), NS + 200 * MS
    state, effects = SYNC.handle(before, Timer(now, "sync"))
    assert (state.correction_ns, state.known) == (7 * MS, known)
    assert now + ROUNDS.lead_ns <= state.due_ns <= now + 3 * ROUNDS.lead_ns
    assert effects == (SetTimer("sync", state.due_ns),)


def test_a_round_that_failed_is_not_repeated_later_than_the_next_would_be() -> None:
    often = TimeSync(replace(ROUNDS, resync_ns=NS // 10))
    state, _ = often.handle(asking(3), Timer(NS, "sync"))
    assert state.due_ns == NS + NS // 10


@pytest.mark.parametrize(
    ("message", "sender", "reason"),
    [
        (SyncReply(2, NS // 1000, 10, 10), "n001", "foreign"),
        (SyncReply(1, NS // 1000, 10, 10), "fusion", "outdated"),  # to a request that was given up
        (SyncReply(3, NS // 1000, 10, 10), "fusion", "outdated"),
        (SyncReply(2, NS // 1000 - 1, 10, 10), "fusion", "outdated"),  # to an earlier life
        (SyncReply(2, NS // 1000, 10, 9), "fusion", "implausible"),  # left before it came
        (SyncReply(2, NS // 1000, 0, 5001), "fusion", "implausible"),  # held for longer than it took
        (Doa(1, 0.0, 50.0), "fusion", "unexpected"),
    ],
)
def test_a_frame_of_no_use_is_ignored_and_the_right_one_still_counts(message: Any, sender: str, reason: str) -> None:
    state = asking(2)
    assert SYNC.handle(state, Received(NS + 5 * MS, message, sender)) == (state, (Ignored(reason),))
    right = reply(2, NS, there=5 * MS, back=5 * MS, ahead=0)
    after, effects = SYNC.handle(state, right)
    assert (after.phase, after.best, effects) == (Phase.ANSWERED, Offset(10 * MS, 0), ())
    assert SYNC.handle(after, right) == (after, (Ignored("outdated"),))


@pytest.mark.parametrize("state", [started(), replace(started(), asked=1), resting()])
def test_a_reply_that_nobody_waits_for_is_ignored(state: Timekeeping) -> None:
    for exchange in (0, 1, state.asked):
        answer = Received(5, SyncReply(exchange, 0, 0, 0), "fusion")
        assert SYNC.handle(state, answer) == (state, (Ignored("outdated"),))


def test_requests_are_numbered_round_and_round() -> None:
    after, effects = SYNC.handle(replace(resting(), asked=65535), Timer(5, "sync"))
    assert effects[0] == Send(SyncRequest(0, 0), "fusion")
    found, _ = SYNC.handle(after, Received(10 * MS, SyncReply(0, 0, 0, 0), "fusion"))
    assert found.best is not None


@pytest.mark.parametrize("jump_ms", [500, -500])
def test_a_clock_that_jumps_while_it_waits_spoils_that_exchange_only(jump_ms: int) -> None:
    """Ahead, the reply seems to have taken half a second; back, to have come before the request left."""
    jump, true = jump_ms * MS, reply(1, NS, there=5 * MS, back=5 * MS, ahead=0)
    state, effects = SYNC.handle(asking(1), replace(true, now=true.now + jump))
    assert effects == (() if jump > 0 else (Ignored("implausible"),))
    slot = NS + 200 * MS + jump  # timers fire when they would have
    state, _ = SYNC.handle(state, Timer(slot, "sync"))
    state, _ = SYNC.handle(state, reply(2, slot, there=5 * MS, back=5 * MS, ahead=-jump))
    state, _ = SYNC.handle(state, Timer(slot + 200 * MS, "sync"))
    _, effects = SYNC.handle(state, Timer(slot + 400 * MS, "sync"))
    assert effects[0] == Corrected(-jump)


# --- telling ------------------------------------------------------------------------------------------------------


def test_a_root_tells_its_clock_to_whoever_asks_and_takes_no_time_from_anybody() -> None:
    state, effects = ROOT.handle(ROOT.begin(), Started(0))
    assert effects == ()
    assert ROOT.kinds == {"sync-request"}
    for sender in ("n3", "fusion"):
        asked = Received(5_000_123_999, SyncRequest(7, -42), sender)
        assert ROOT.handle(state, asked) == (state, (Send(SyncReply(7, -42, 5_000_123, 5_000_123), sender),))
    told = Received(5, SyncReply(0, 0, 0, 0), "n3")
    assert ROOT.handle(state, told) == (state, (Ignored("unexpected"),))


def test_whoever_set_its_clock_tells_its_corrected_time_in_a_round_too() -> None:
    assert SYNC.kinds == {"sync-request", "sync-reply"}
    asked = Received(5 * NS, SyncRequest(7, -42), "n3")
    answer = (Send(SyncReply(7, -42, 4_250_000, 4_250_000), "n3"),)
    state = resting(-750 * MS)
    assert SYNC.handle(state, asked) == (state, answer)
    state, _ = SYNC.handle(state, Timer(5 * NS, "sync"))
    assert SYNC.handle(state, asked) == (state, answer)


@pytest.mark.parametrize("state", [started(), asking(1), asking(3)])
def test_whoever_has_not_set_its_clock_tells_nothing(state: Timekeeping) -> None:
    assert SYNC.handle(state, Received(5 * NS, SyncRequest(7, -42), "n3")) == (state, (Ignored("not synchronised"),))


def test_a_correction_of_zero_is_one() -> None:
    state, _ = SYNC.handle(asking(3), reply(3, NS, there=5 * MS, back=5 * MS, ahead=0))
    state, effects = SYNC.handle(state, Timer(NS + 200 * MS, "sync"))
    assert effects[0] == Corrected(0)
    _, effects = SYNC.handle(state, Received(5 * NS, SyncRequest(7, -42), "n3"))
    assert effects == (Send(SyncReply(7, -42, 5_000_000, 5_000_000), "n3"),)


@pytest.mark.parametrize(("told_us", "fits_ns", "beyond_ns"), [(10**15, 0, 5 * NS), (-(10**15), 5 * NS, -NS)])
def test_an_absurd_time_is_not_passed_on_where_no_reply_can_hold_it(told_us: int, fits_ns: int, beyond_ns: int) -> None:
    state, _ = SYNC.handle(asking(3), Received(NS + 10 * MS, SyncReply(3, NS // 1000, told_us, told_us), "fusion"))
    state, _ = SYNC.handle(state, Timer(NS + 200 * MS, "sync"))
    request = SyncRequest(7, -42)
    assert SYNC.handle(state, Received(beyond_ns, request, "n3")) == (state, (Ignored("out of range"),))
    _, (answer,) = SYNC.handle(state, Received(fits_ns, request, "n3"))
    assert isinstance(answer, Send)
    assert encode(answer.message)


# --- whatever happens ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("sync", "state", "event"),
    [
        *((sync, started(sync), event) for sync in (SYNC, ROOT) for event in (Started(0), Timer(0, "nap"))),
        *((sync, sync.begin(), Received(0, SyncRequest(1, 0), "n3")) for sync in (SYNC, ROOT)),
        (SYNC, asking(), Started(0)),
        (SYNC, SYNC.begin(), Timer(0, "sync")),
        (SYNC, SYNC.begin(), Received(0, SyncReply(1, 0, 0, 0), "fusion")),
        (ROOT, started(ROOT), Timer(0, "sync")),
        (SYNC, started(), PortRead(0, "tty", b"")),
    ],
)
def test_a_broken_driver_is_told_so(sync: Role[Timekeeping], state: Timekeeping, event: Event) -> None:
    with pytest.raises(IllegalEvent):
        sync.handle(state, event)


microseconds = st.integers(-(10**15), 10**15)
peers = st.sampled_from(["fusion", "n3"])
times = st.integers(-(10**6) * NS, 10**6 * NS)
events = st.one_of(
    st.builds(Timer, times, st.just("sync")),
    st.builds(Received, times, st.builds(SyncRequest, st.integers(0, 65535), microseconds), peers),
    st.builds(
        Received, times, st.builds(SyncReply, st.integers(0, 9), st.just(0) | microseconds, *[microseconds] * 2), peers
    ),
)


@given(st.lists(events, max_size=30))
def test_any_events_in_any_order(happened: list[Event]) -> None:
    """Equal calls have equal answers, a timer is always set, and what is sent fits the wire."""
    state, pending = started(), True
    for event in happened:
        after, effects = SYNC.handle(state, event)
        assert SYNC.handle(state, event) == (after, effects)
        assert after.phase in TRANSITIONS[state.phase, type(event)]
        assert after.in_round is (after.phase is not Phase.RESTING)
        assert after.known >= state.known
        pending = pending and not isinstance(event, Timer)
        pending = pending or any(isinstance(e, SetTimer) for e in effects)
        assert pending
        for effect in effects:
            if isinstance(effect, Send):
                encode(effect.message)
        state = after
