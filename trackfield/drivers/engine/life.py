"""The part of a process that changes by handling events, as one immutable value."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

from trackfield.drivers.engine.frames import EventKey, Input, Output
from trackfield.drivers.engine.meter import Meter
from trackfield.drivers.engine.receiver import Receiver
from trackfield.link.clock import Clock
from trackfield.wire.keys import Medium


class Alarm(NamedTuple):
    """A pending timer: when it fires and was meant to fire (true time), and the local time it was set for."""

    fires_ns: int
    due_ns: int
    at: int


class Life(NamedTuple):
    """A snapshot of a process; its parts must not be modified.

    ``sending`` are the times at which the radio of a medium will be done with the frames it was given; ``copies`` the
    number of frames of each (instant, kind, address, medium) that are still to leave; ``stored`` what the role stored
    last; ``jumped`` the number of clock jumps so far; ``told`` the charge that was reported last (%). Its events begin
    when it has ``started``, and end when it is ``over``.
    """

    state: Any
    clock: Clock
    meter: Meter
    alarms: dict[str, Alarm]
    receivers: dict[str, Receiver]
    sending: dict[str, tuple[int, ...]]
    copies: dict[tuple[int, str, str, Medium], int]
    tally: dict[str, int]
    stored: bytes
    jumped: int = 0
    told: int = 100
    started: bool = False
    over: bool = False

    @classmethod
    def new(cls, state: Any, clock: Clock, meter: Meter) -> Life:
        """A life that has not begun."""
        return cls(state, clock, meter, {}, {}, {}, {}, {}, b"")


@dataclass(slots=True)
class Handled:
    """One entry of the history: the event, the life and the largest key before it, what came, and its outputs."""

    key: EventKey
    before: Life
    last: EventKey
    input: Input | None
    outputs: list[Output]


def without(alarms: dict[str, Alarm], name: str) -> dict[str, Alarm]:
    """The alarms but the one of this name."""
    return {n: a for n, a in alarms.items() if n != name}
