"""Frames on their way in: each version with a fate of its own, what is final, whose word counts, and what it costs."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from tests.network import LATER, Payload, sample_of
from tests.puppet import MS, Puppet, core_of, run
from tests.toys import Request
from trackfield.drivers.engine.frames import Frame
from trackfield.drivers.exchange.incoming import Incoming
from trackfield.drivers.exchange.versions import Digest, digest
from trackfield.drivers.spec import ProcessSpec
from trackfield.link.fate import Fate, Transmission
from trackfield.role import NS, Effect, Event, Received, Send, SetTimer, Started, Timer
from trackfield.wire.codec import decode, encode
from trackfield.wire.envelope import Envelope

ME = ProcessSpec("me", "puppet", "", peers={"peer": (0.0, 0.0), "other": (0.0, 0.0)})
SHORT, LONG, HUGE = encode(Request(1)), encode(Request(1000)), encode(Request(60000))


class Sized:
    """A link on which payloads of some sizes are lost; each byte takes a millisecond."""

    def __init__(self, lost: dict[int, str]) -> None:
        self.lost = lost

    def fate(self, frame: Transmission) -> Fate:
        return Fate(self.lost.get(frame.size), delay_ns=frame.size * MS)

    def reception(self, *_: Any) -> float:
        return 1.0


def incoming(
    puppet: Puppet | None = None, *, lost: dict[int, str] | None = None, horizon_ns: int = 10 * NS
) -> Incoming:
    core = core_of(puppet or Puppet(), horizon_ns=horizon_ns)
    return Incoming(ME, Sized(lost or {}), core, lambda t_ns: t_ns)


def framed(payload: bytes, *, src: str = "peer", sent_ns: int = 10 * MS, copy: int = 0, incarnation: int = 0) -> Frame:
    return Frame(src, incarnation, "request", sent_ns, copy, "me", "field", payload)


def take(at: Incoming, frame: Frame, version: int | None) -> bool:
    """Whether the sample was news."""
    return at.take(sample_of(frame, version), LATER, NS) is not None


def waiting(at: Incoming) -> list[tuple[int, bytes]]:
    """When what waits is due, and its payload."""
    return [(one.due_ns, one.frame.payload) for one in at.core.waiting()]  # type: ignore[union-attr]


def heard(at: Incoming) -> list[Any]:
    return [event.message for event in at.core.state if isinstance(event, Received)]


def strange(at: Incoming) -> int:
    return at._strange.total


# --- a fate of its own ------------------------------------------------------------------------------------------------


def test_a_version_of_another_size_comes_at_another_time() -> None:
    at = incoming()
    assert len(SHORT) < len(LONG)
    take(at, framed(SHORT), 0)
    assert waiting(at) == [(10 * MS + len(SHORT) * MS, SHORT)]
    take(at, framed(LONG), 1)
    assert waiting(at) == [(10 * MS + len(LONG) * MS, LONG)]
    assert at.heard == digest([(framed(LONG), 1)])


@pytest.mark.parametrize("cause", ["radio", "partition"])
def test_a_version_may_be_lost_where_the_one_before_was_not(cause: str) -> None:
    """And the other way round; what is counted is the version that holds."""
    at = incoming(lost={len(LONG): cause})
    take(at, framed(SHORT), 0)
    assert (at.counts[cause], len(waiting(at))) == (0, 1)
    take(at, framed(LONG), 1)
    assert (at.counts[cause], waiting(at), at.heard) == (1, [], Digest())
    take(at, framed(SHORT), 2)
    assert (at.counts[cause], len(waiting(at))) == (0, 1)
    assert at.heard == digest([(framed(SHORT), 2)])


@pytest.mark.parametrize("cause", ["radio", "partition"])
def test_a_frame_that_was_lost_and_is_taken_back_was_not_lost(cause: str) -> None:
    at = incoming(lost={len(LONG): cause})
    take(at, framed(LONG), 0)
    assert at.counts[cause] == 1
    take(at, framed(LONG).taken_back, 1)
    assert at.counts[cause] == 0
    take(at, framed(LONG), 2)
    assert at.counts[cause] == 1


def test_a_version_that_moves_what_was_handled_is_handled_at_its_own_time() -> None:
    at = incoming()
    other = framed(HUGE, src="other", sent_ns=10 * MS + (len(SHORT) - len(HUGE)) * MS + MS // 2)
    take(at, framed(SHORT), 0)
    take(at, other, 0)
    run(at.core, NS)
    assert heard(at) == [decode(SHORT), decode(HUGE)]
    take(at, framed(LONG), 1)
    at.core.catch_up()
    run(at.core, NS)
    assert heard(at) == [decode(HUGE), decode(LONG)]
    assert at.core.host_late == 0


# --- whatever the order -----------------------------------------------------------------------------------------------


def test_a_version_that_a_higher_one_has_overtaken_has_no_effect() -> None:
    at = incoming(lost={len(LONG): "radio"})
    take(at, framed(SHORT), 5)
    before = waiting(at), at.heard, dict(at.counts)
    for version in (4, 0):
        assert not take(at, framed(LONG), version)
        assert not take(at, framed(LONG).taken_back, version)
    assert (waiting(at), at.heard) == before[:2]
    assert at.counts == before[2]


@pytest.mark.parametrize("payload", [SHORT, b""], ids=["frame", "word"])
def test_what_comes_again_is_a_duplicate(payload: bytes) -> None:
    at = incoming()
    take(at, framed(SHORT), 0)
    take(at, framed(LONG), 1)
    assert take(at, framed(payload), 2)
    run(at.core, NS)
    assert not take(at, framed(payload), 2)
    assert (at.counts["duplicate"], at.core.behind) == (1, False)


def test_word_that_comes_before_its_frame_keeps_it_out() -> None:
    """A tombstone: the frame is on its way still."""
    at = incoming()
    assert take(at, framed(SHORT).taken_back, 1)
    assert not take(at, framed(SHORT), 0)
    assert (waiting(at), at.heard, at.core.behind) == ([], Digest(), False)
    assert take(at, framed(SHORT), 2)
    assert len(waiting(at)) == 1


# --- what is final ----------------------------------------------------------------------------------------------------


def without_envelope(frame: Frame) -> Any:
    sample = sample_of(frame, None)
    sample.attachment = None
    return sample


@pytest.mark.parametrize("wrapped", [True, False], ids=["24 bytes", "none"])
def test_what_a_foreign_device_sent_cannot_be_taken_back(wrapped: bool) -> None:
    """Nor replaced: either would be another version of what has none. It is refused, and the first frame stands."""
    at = incoming()
    sample = sample_of(framed(SHORT), None) if wrapped else without_envelope(framed(SHORT))
    assert len(sample.attachment.to_bytes() if sample.attachment else b"") == (24 if wrapped else 0)
    assert at.take(sample, LATER, NS, lambda: Envelope(10 * MS)) is not None
    assert len(waiting(at)) == 1
    for version in (0, 1, 7):
        assert not take(at, framed(SHORT).taken_back, version)
        assert not take(at, framed(LONG), version)
    assert not take(at, framed(SHORT).taken_back, None)
    assert strange(at) == 7
    assert waiting(at) == [(10 * MS + len(SHORT) * MS, SHORT)]
    assert at.core.host_late == 0
    assert at.counts["foreign"] == (not wrapped)


def test_what_a_foreign_device_sent_stands_for_no_put_of_a_process() -> None:
    """A field settles when as much came as its processes have put, with what came again or was overtaken."""
    at = incoming()
    at.take(without_envelope(framed(SHORT)), LATER, NS, lambda: Envelope(10 * MS))
    take(at, framed(SHORT, copy=1), None)
    assert at.came == 0
    for version in (1, 1, 0):
        take(at, framed(SHORT, copy=2), version)
    assert at.came == 3


def test_an_unversioned_frame_does_not_replace_one_with_a_version() -> None:
    at = incoming()
    take(at, framed(SHORT), 0)
    assert not take(at, framed(LONG), None)
    assert strange(at) == 1
    assert waiting(at) == [(10 * MS + len(SHORT) * MS, SHORT)]


# --- whose word counts ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "change",
    [{"src": "other"}, {"incarnation": 1}, {"copy": 1}, {"sent_ns": 11 * MS}, {"kind": "reply"}, {"to": "other"}],
    ids=lambda change: next(iter(change)),
)
def test_word_of_another_frame_changes_nothing_of_this_one(change: dict[str, Any]) -> None:
    """Source and life are parts of what a frame is: nobody can take back another's, not even the next life."""
    at = incoming()
    take(at, framed(SHORT), 0)
    take(at, replace(framed(SHORT), **change).taken_back, 1)
    assert waiting(at) == [(10 * MS + len(SHORT) * MS, SHORT)]
    assert at.heard == digest([(framed(SHORT), 0)])
    run(at.core, NS)
    take(at, replace(framed(SHORT), **change).taken_back, 2)
    assert not at.core.behind


def test_word_from_a_stranger_is_refused() -> None:
    """Not even a process of the run takes part if it is none of the peers."""
    at = incoming()
    assert not take(at, framed(SHORT, src="stranger").taken_back, 1)
    assert strange(at) == 1


# --- how far back -----------------------------------------------------------------------------------------------------


def ticking(event: Event) -> tuple[Effect, ...]:
    return (SetTimer("tick", event.now + 10 * MS),) if isinstance(event, Started | Timer) else ()


def test_what_is_too_old_is_counted_and_was_not_heard() -> None:
    at = incoming(Puppet(ticking), horizon_ns=100 * MS)
    run(at.core, 500 * MS)
    state = at.core.state
    assert take(at, framed(SHORT), 0)
    assert (at.core.host_late, at.core.behind, at.heard) == (1, False, Digest())
    assert at.core.state == state


def test_word_that_is_too_old_leaves_what_was_heard_as_it_was() -> None:
    """So that the digest, other than that of the sender, tells of it."""
    at = incoming(Puppet(ticking), horizon_ns=100 * MS)
    take(at, framed(SHORT), 0)
    run(at.core, 500 * MS)
    take(at, framed(SHORT).taken_back, 1)
    assert (at.core.host_late, at.core.behind) == (1, False)
    assert at.heard == digest([(framed(SHORT), 0)])
    assert heard(at) == [decode(SHORT)]


# --- what comes together ----------------------------------------------------------------------------------------------


class Counting(Puppet):
    """Counts what it is asked to handle."""

    handled = 0

    def handle(self, state: Any, event: Event) -> Any:
        self.handled += 1
        return (len(state), event), tuple(self.react(event))  # a small state: what it costs is the driver's


def late_batch(count: int) -> tuple[Counting, Incoming, Callable[[], None]]:
    """A process that handled a timer each millisecond, and in the end hears of as many frames, latest first."""

    def react(event: Event) -> tuple[Effect, ...]:
        if isinstance(event, Received):
            return (Send(event.message, "peer"),)
        return (SetTimer("tick", event.now + MS), Send(Request(event.now // MS), "other"))

    puppet = Counting(react)
    at = incoming(puppet)
    run(at.core, count * MS)

    def come() -> None:
        for n in reversed(range(count)):
            take(at, framed(SHORT, sent_ns=n * MS), 0)
        at.core.catch_up()
        while at.core.next_key() <= at.core.front:  # type: ignore[operator]
            at.core.handle_next()

    return puppet, at, come


def test_frames_that_come_together_are_one_replay() -> None:
    count = 200
    puppet, at, come = late_batch(count)
    before = puppet.handled
    come()
    late = count - len(SHORT) + 1  # the others are due later than all that was handled
    assert at.core.inversions == late
    assert puppet.handled - before <= count + late
    assert at.core.host_late == 0


def test_a_replay_takes_work_in_proportion() -> None:
    """Counted in calls: of twice as many frames twice as many, also to compare what it puts out with what it had."""

    def calls(count: int) -> int:
        _, _, come = late_batch(count)
        made = 0

        def note(frame: Any, event: str, argument: Any) -> None:
            nonlocal made
            made += event in ("call", "c_call")

        sys.setprofile(note)
        try:
            come()
        finally:
            sys.setprofile(None)
        return made

    assert calls(400) < 2.2 * calls(200)


def test_a_sample_without_content_or_envelope_is_nothing() -> None:
    at = incoming()
    sample = without_envelope(framed(SHORT))
    sample.payload = Payload(b"")
    assert at.take(sample, LATER, NS, lambda: Envelope(10 * MS)) is None
    assert (strange(at), waiting(at)) == (1, [])
