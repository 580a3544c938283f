"""Frames and the other outputs of a role, for both drivers and the recorder."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Final, Self

from trackfield.link.fate import Fate, Link, Transmission
from trackfield.role import NEIGHBOURHOOD, Corrected, Listen, Note, Publish, Radio, State, Store, Tell, Write
from trackfield.wire.keys import Medium

RANK_FAULT: Final = 0
RANK_FRAME: Final = 1
RANK_PORT: Final = 2
RANK_TIMER: Final = 3
RANK_BATTERY: Final = 4

LATE: Final = "late"
"""The reason by which a role says that a frame came after its deadline."""
FREE: Final = Fate(None)
"""The fate of a frame that costs nothing."""

EventKey = tuple[Any, ...]
"""The place of an event in the total order of one process.

``(t, 0, name)`` for starts and faults, ``(t, 1, src, kind, sent_ns, copy, incarnation, to, medium)`` for frames,
``(t, 2, number, port)`` for bytes at a port, ``(t, 3, original due, name)`` for timers, ``(t, 4)`` for a battery that
falls to the next tenth or is empty; t in ns of true time.
"""

Identity = tuple[str, int, str, int, int, str, Medium]
"""What makes two arrivals the same frame."""


@dataclass(frozen=True, slots=True)
class Frame:
    """One transmission. ``to`` is an id or ``NEIGHBOURHOOD``; one without a payload was taken back.

    Its preamble is ``preamble_ns`` longer than usual.
    """

    src: str
    incarnation: int
    kind: str
    sent_ns: int
    copy: int
    to: str
    medium: Medium
    payload: bytes
    preamble_ns: int = 0

    @property
    def identity(self) -> Identity:
        """What makes two arrivals the same frame."""
        return (self.src, self.incarnation, self.kind, self.sent_ns, self.copy, self.to, self.medium)

    @property
    def taken_back(self) -> Self:
        """What says that this frame was taken back."""
        return replace(self, payload=b"")

    @property
    def broadcast(self) -> bool:
        """Whether the frame is for all processes in range."""
        return self.to == NEIGHBOURHOOD

    def fate(self, link: Link, hearer: str) -> Fate:
        """The frame's fate on the way to this receiver."""
        return link.fate(self.transmission(hearer))

    def transmission(self, hearer: str) -> Transmission:
        """The frame as its link sees it, on the way to this receiver."""
        size, medium, preamble_ns = len(self.payload), self.medium, self.preamble_ns
        return Transmission(
            self.src, hearer, self.kind, self.sent_ns, self.copy, size, self.broadcast, medium, preamble_ns
        )

    def cost(self, link: Link) -> Fate:
        """The frame's cost for its sender; only the cost fields of this fate are valid."""
        return self.fate(link, self.to)

    def key(self, due_ns: int) -> EventKey:
        """The frame's place among the events of a receiver that gets it at ``due_ns``."""
        return (
            due_ns,
            RANK_FRAME,
            self.src,
            self.kind,
            self.sent_ns,
            self.copy,
            self.incarnation,
            self.to,
            self.medium,
        )


@dataclass(frozen=True, slots=True)
class Arrival:
    """A frame that survived the link and is due at this process; ``fate`` gives the cost of receiving it.

    ``version`` is that of the frame, None if it is final.
    """

    due_ns: int
    frame: Frame
    fate: Fate = FREE
    version: int | None = None

    @property
    def key(self) -> EventKey:
        """The arrival's place in the order of events."""
        return self.frame.key(self.due_ns)


@dataclass(frozen=True, slots=True)
class PortInput:
    """Bytes that are due at a port; ``number`` counts those of this process."""

    due_ns: int
    number: int
    port: str
    data: bytes

    @property
    def key(self) -> EventKey:
        """Their place in the order of events."""
        return (self.due_ns, RANK_PORT, self.number, self.port)


Input = Arrival | PortInput
"""What comes to a process from outside."""


@dataclass(frozen=True, slots=True)
class Sent:
    """A frame leaves."""

    key: EventKey
    frame: Frame


@dataclass(frozen=True, slots=True)
class TakenBack:
    """A frame that should not have left, or not yet: its hearers go on without it."""

    frame: Frame


@dataclass(frozen=True, slots=True)
class Died:
    """A life is over: ``why`` is ``battery``, or ``killed`` by a planned fault."""

    why: str


@dataclass(frozen=True, slots=True)
class Charge:
    """The remaining charge of the battery, as a share of its capacity, 0 to 1."""

    share: float


@dataclass(frozen=True, slots=True)
class Queued:
    """A frame waited ``waited_ns`` for the radio, behind ``ahead`` others; it left at ``sent_ns``."""

    kind: str
    sent_ns: int
    waited_ns: int
    ahead: int


@dataclass(frozen=True, slots=True)
class Overflowed:
    """A frame found the radio's queue full and was never sent."""

    frame: Frame


Telling = (
    State | Radio | Listen | Publish | Note | Tell | Corrected | Store | Write | Died | Charge | Queued | Overflowed
)
"""The telemetry of a process: of its role, and of its driver."""


@dataclass(frozen=True, slots=True)
class Told:
    """Telemetry; ``key`` is that of the event it came from."""

    key: EventKey
    effect: Telling


@dataclass(frozen=True, slots=True)
class Refused:
    """Telemetry: a delivered frame that the role ignored, and the reason (``late``, ``malformed``, ...)."""

    key: EventKey
    reason: str


@dataclass(frozen=True, slots=True)
class Undone:
    """Telemetry: forget the telemetry of this process from the event ``key`` on; it is sent again."""

    key: EventKey


Output = Sent | TakenBack | Told | Refused | Undone
