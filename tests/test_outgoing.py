"""Frames on their way out: what is put and when, in which version, and what it costs to take it back."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from tests.puppet import MS
from tests.toys import Request
from trackfield.drivers.engine.frames import Frame
from trackfield.drivers.exchange.outgoing import Outgoing
from trackfield.drivers.exchange.versions import Digest, digest
from trackfield.role import NEIGHBOURHOOD
from trackfield.wire.codec import encode

NOBODY = 10**18
ONE, OTHER = encode(Request(1)), encode(Request(2))


class Air:
    """All that was put."""

    def __init__(self) -> None:
        self.put: list[tuple[Frame, int]] = []
        self.out = Outgoing(lambda frame, version: self.put.append((frame, version)))

    def versions(self) -> list[tuple[bytes, int]]:
        return [(frame.payload, version) for frame, version in self.put]


def framed(payload: bytes = ONE, *, sent_ns: int = 10 * MS, copy: int = 0, to: str = "hub") -> Frame:
    return Frame("me", 0, "request", sent_ns, copy, to, "field", payload)


# --- two counters -----------------------------------------------------------------------------------------------------


def test_one_counter_is_of_puts_and_the_other_of_frames_that_hold() -> None:
    air, frame = Air(), framed()
    deeds: list[tuple[Callable[..., None], tuple[Any, ...]]] = [
        (air.out.send, (frame, 0, 0)),
        (air.out.send, (framed(copy=1), 0, 0)),
        (air.out.take_back, (frame,)),
        (air.out.send, (frame, 0, 0)),
        (air.out.send, (framed(OTHER), 0, 0)),
    ]
    counts = []
    for deed, arguments in deeds:
        deed(*arguments)
        counts.append((air.out.seq, air.out.live.size, air.out.retractions))
    assert counts == [(1, 1, 0), (2, 2, 0), (3, 1, 1), (4, 2, 2), (5, 2, 3)]
    assert air.versions() == [(ONE, 0), (ONE, 0), (b"", 1), (ONE, 2), (OTHER, 3)]
    assert air.out.live == digest([(framed(OTHER), 3), (framed(copy=1), 0)])


def test_what_is_taken_back_is_the_same_frame_without_content() -> None:
    air, frame = Air(), framed()
    air.out.send(frame, 0, 0)
    air.out.take_back(frame)
    assert air.put[-1] == (replace(frame, payload=b""), 1)
    assert air.put[-1][0].identity == frame.identity
    assert air.out.live == Digest()


def test_puts_are_counted_by_whom_they_are_for() -> None:
    air = Air()
    air.out.send(framed(), 0, 0)
    air.out.send(framed(to=NEIGHBOURHOOD), 0, 0)
    air.out.send(framed(to="base"), 0, 0)
    air.out.take_back(framed())
    assert air.out.puts == {"hub": 2, NEIGHBOURHOOD: 1, "base": 1}
    assert sum(air.out.puts.values()) == air.out.seq == 4


# --- the radio's queue ------------------------------------------------------------------------------------------------


def test_a_frame_leaves_when_its_radio_sends_it() -> None:
    air, late, soon = Air(), framed(OTHER, sent_ns=30 * MS), framed(sent_ns=20 * MS)
    air.out.send(late, 30, 10)
    air.out.send(soon, 20, 10)
    assert (air.out.seq, air.out.next_ns(NOBODY)) == (0, 20)
    assert not air.out.release(19)
    assert air.out.release(20)
    assert air.put == [(soon, 0)]
    assert not air.out.release(29)
    assert air.out.next_ns(NOBODY) == 30
    assert air.out.release(35)
    assert air.put == [(soon, 0), (late, 0)]
    assert air.out.next_ns(NOBODY) == NOBODY


def test_a_frame_that_waits_for_its_radio_is_taken_back_free_of_cost() -> None:
    """Nobody ever hears of it, and what is then sent in its place is the first version."""
    air, frame = Air(), framed()
    air.out.send(frame, 20, 10)
    air.out.take_back(frame)
    assert not air.out.release(100)
    assert (air.put, air.out.seq, air.out.retractions, air.out.puts) == ([], 0, 0, {})
    assert (air.out.live, air.out.next_ns(NOBODY)) == (Digest(), NOBODY)
    air.out.send(framed(OTHER), 20, 100)
    assert air.versions() == [(OTHER, 0)]


def test_a_frame_is_replaced_free_of_cost_while_it_waits() -> None:
    air = Air()
    air.out.send(framed(), 20, 10)
    air.out.send(framed(copy=1), 30, 10)
    air.out.send(framed(OTHER), 20, 10)
    while air.out.release(100):
        pass
    assert air.versions() == [(OTHER, 0), (ONE, 0)]
    assert air.out.retractions == 0


def test_of_those_that_wait_only_the_one_is_taken_back() -> None:
    air = Air()
    for copy in range(3):
        air.out.send(framed(copy=copy), 20, 10)
    air.out.take_back(framed(copy=1))
    air.out.flush()
    assert [frame.copy for frame, _ in air.put] == [0, 2]


def test_all_that_waits_leaves_at_the_end() -> None:
    air = Air()
    air.out.send(framed(copy=1), 30, 10)
    air.out.send(framed(), 20, 10)
    air.out.flush()
    assert [frame.copy for frame, _ in air.put] == [0, 1]
    assert (air.out.live.size, air.out.next_ns(NOBODY)) == (2, NOBODY)


# --- what never left, and what is too old -----------------------------------------------------------------------------


def test_a_frame_that_never_left_needs_no_word() -> None:
    air = Air()
    air.out.take_back(framed())
    assert (air.put, air.out.seq, air.out.retractions) == ([], 0, 0)


def test_what_is_too_old_to_be_undone_is_forgotten_and_stays_counted() -> None:
    air, old, new = Air(), framed(), framed(sent_ns=50 * MS)
    air.out.send(old, 0, 0)
    air.out.send(new, 0, 0)
    air.out.forget(50 * MS)
    air.out.take_back(old)
    air.out.take_back(new)
    assert air.put == [(old, 0), (new, 0), (new.taken_back, 1)]
    assert air.out.live == digest([(old, 0)])


def test_what_was_taken_back_is_remembered_for_as_long_as_a_frame() -> None:
    """Else its next version would begin again at 0, and nobody would take it."""
    air, frame = Air(), framed()
    air.out.send(frame, 0, 0)
    air.out.take_back(frame)
    air.out.forget(frame.sent_ns)
    air.out.send(frame, 0, 0)
    assert air.versions()[-1] == (ONE, 2)
