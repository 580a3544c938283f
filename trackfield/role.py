"""The role contract: what a node, fusion centre or cluster head is, free of any I/O.

A role is a pure function of emulated time, ``handle(state, event) -> (state, effects)``. States are immutable
values; events and effects are frozen dataclasses. The same role therefore runs as a process over Zenoh, inside
the virtual driver, and as a plain call in a test, and a driver may undo and replay what it handled.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any, Final, Literal, Protocol, TypeVar

from trackfield.wire.keys import Medium

NS: Final = 1_000_000_000
"""Nanoseconds in a second; emulated time is an int of nanoseconds since the start of the run."""

NEIGHBOURHOOD: Final = "*"
"""The address of a broadcast: all processes in radio range that listen."""


# --- events: what happens to a role; ``now`` is always the role's local clock, in ns ---------------------------


@dataclass(frozen=True, slots=True)
class Started:
    """The role begins a life; ``stored`` is what its previous life stored last (``Store``), empty if nothing."""

    now: int
    stored: bytes = b""


@dataclass(frozen=True, slots=True)
class Received:
    """A frame that survived its link, decoded; ``sender`` is the id of the process that sent it, over this medium."""

    now: int
    message: Any
    sender: str
    medium: Medium = "field"


@dataclass(frozen=True, slots=True)
class Timer:
    """A timer that the role set is due; ``now`` is the time it was set for, or later if that had passed."""

    now: int
    name: str


@dataclass(frozen=True, slots=True)
class Sampled:
    """The answer to ``Sample``, at the same instant; the value's type belongs to the sensor."""

    now: int
    sensor: str
    value: Any


@dataclass(frozen=True, slots=True)
class PortRead:
    """Bytes from a device port (a serial line, a microphone)."""

    now: int
    port: str
    data: bytes


@dataclass(frozen=True, slots=True)
class ClockSet:
    """Another role of the process reported ``Corrected``: local time + ``correction_ns`` is reference time for this
    role, too. Only a ``Host`` gives it, to the roles that follow the clock (``Role``).
    """

    now: int
    correction_ns: int


Event = Started | Received | Timer | Sampled | PortRead | ClockSet


# --- effects: what a role asks of its driver -------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Send:
    """Transmit ``message``: to one id, to each of a set of ids in turn, or once to the neighbourhood.

    Each frame has a preamble that is ``preamble_ns`` longer than usual: so long a receiver that listens only now and
    then (``Listen``) may sleep and still hear it. The sender pays for it.
    """

    message: Any
    to: str | frozenset[str]
    medium: Medium = "field"
    preamble_ns: int = 0


@dataclass(frozen=True, slots=True)
class SetTimer:
    """Wake the role at local time ``at`` (ns); a second timer of the same name replaces the first."""

    name: str
    at: int


@dataclass(frozen=True, slots=True)
class CancelTimer:
    """Forget the timer of this name, if there is one."""

    name: str


@dataclass(frozen=True, slots=True)
class Sample:
    """Read a sensor now; ``Sampled`` follows at once."""

    sensor: str


@dataclass(frozen=True, slots=True)
class Radio:
    """Switch the receiver on or off; a frame due while it is off is lost (asleep)."""

    on: bool
    medium: Medium = "field"


@dataclass(frozen=True, slots=True)
class Listen:
    """Listen for ``open_ns`` from local time ``from_ns`` on, and again every ``every_ns``, until told otherwise.

    In between the receiver is off. It hears a frame if a window is open for ``detect_ns`` of its preamble, which is
    ``spare_ns`` longer than that unless ``Send`` makes it longer still; and then to the frame's end. The windows stay
    where they are if the clock is set or jumps.
    """

    every_ns: int
    open_ns: int
    from_ns: int
    detect_ns: int = 0
    spare_ns: int = 0
    medium: Medium = "field"


@dataclass(frozen=True, slots=True)
class Write:
    """Bytes to a device port."""

    port: str
    data: bytes


@dataclass(frozen=True, slots=True)
class TrackPoint:
    """One published point of a track: the estimate of ``target`` by ``tracker`` at emulated time ``at_ns``.

    ``mean`` is (x, y, vx, vy) in metres and metres per second, ``covariance`` its 4x4 covariance row by row,
    ``particles`` little-endian float32 pairs (x, y), at most 200 of them. ``status`` is ``waiting`` (no track yet;
    mean and covariance empty), ``tracking`` or ``coasting`` (no report was fused at this instant). ``sensors`` are the
    ids of those whose reports were used. A point of a smoothed track uses the reports up to ``lag`` steps later;
    in a live track ``lag`` is 0. ``step`` is the number of the instant if the tracker works in steps.

    ``source`` is the process that published it, set by its driver. If processes take turns, ``term`` counts the
    turns: of two points for one instant the one of the higher term holds. ``origin`` is the process whose tracker made
    the point, if that is another one, which sent it by radio.

    ``unknowns`` are estimates of what the sensors' kind has unknown besides x, y, vx, vy, in its order and units, and
    ``unknown_sds`` their standard deviations.

    ``known_step`` is the step up to which reports are in a point that was predicted from there, by a source that was
    told of that step last; None if nothing is told of it.

    A tracker that solves for a path from the reports of one *event*, such as a pass, says so in the point of the step
    in which the event was closed: ``event_ns`` is when the target was nearest to the middle of its sensors or, without
    a fix, the mean of the reports' times; ``refused`` is then why there is no fix.
    """

    tracker: str
    target: str
    at_ns: int
    status: Literal["waiting", "tracking", "coasting"]
    mean: tuple[float, ...] = ()
    covariance: tuple[float, ...] = ()
    sensors: tuple[str, ...] = ()
    particles: bytes = b""
    lag: int = 0
    step: int | None = None
    term: int = 0
    source: str = ""
    origin: str = ""
    unknowns: tuple[float, ...] = ()
    unknown_sds: tuple[float, ...] = ()
    known_step: int | None = None
    event_ns: int | None = None
    refused: str = ""

    @property
    def reports(self) -> int:
        """How many reports were used."""
        return len(self.sensors)


def formed(point: TrackPoint) -> TrackPoint:
    """The point, if its arrays have their lengths. Raises ``ValueError``."""
    if (len(point.mean), len(point.covariance)) not in ((0, 0), (4, 16)) or len(point.particles) % 8:
        raise ValueError("a point of a track has no state of x, y, vx, vy")
    if len(point.unknowns) != len(point.unknown_sds):
        raise ValueError("a point of a track has not one sd for each unknown")
    return point


@dataclass(frozen=True, slots=True)
class Publish:
    """Publish where the target is, as telemetry: it is not impaired and costs no energy."""

    estimate: TrackPoint


@dataclass(frozen=True, slots=True)
class State:
    """The role entered this state; shown on the timeline, one lane per role of a process."""

    name: str
    lane: str = ""


@dataclass(frozen=True, slots=True)
class Note:
    """A sentence for the log and the timeline."""

    text: str


@dataclass(frozen=True, slots=True)
class Ignored:
    """The current frame was ignored (late, repeated, unexpected, malformed); counted, never an error."""

    reason: str


@dataclass(frozen=True, slots=True)
class Late:
    """The current frame came after its deadline but was used all the same; counted."""


@dataclass(frozen=True, slots=True)
class Tell:
    """What the role has to tell of a ``topic``, as plain values: telemetry for the recorder, in true time.

    The topics and their values are listed in docs/architecture.md.
    """

    topic: str
    values: tuple[int | float | str, ...] = ()


@dataclass(frozen=True, slots=True)
class Store:
    """Store these bytes so that they outlive the process: its next life is given the last ones (``Started.stored``)."""

    data: bytes


@dataclass(frozen=True, slots=True)
class Corrected:
    """The role has a new correction of its clock: local time + ``correction_ns`` is its estimate of reference time.

    Sent to the recorder, which compares it with the truth; the correction itself is part of the role's state.
    """

    correction_ns: int


Effect = (
    Send
    | SetTimer
    | CancelTimer
    | Sample
    | Radio
    | Listen
    | Write
    | Publish
    | State
    | Note
    | Tell
    | Ignored
    | Late
    | Store
    | Corrected
)

S = TypeVar("S")


class Role(Protocol[S]):
    """A pure state machine; see the module's docstring.

    ``kinds`` names the message kinds that the role consumes; a ``Host`` dispatches by them. A role with an attribute
    ``follows`` that is true is given ``ClockSet`` by its host.
    """

    @property
    def kinds(self) -> frozenset[str]:
        """The message kinds that this role consumes."""
        ...

    def begin(self) -> S:
        """The state before ``Started``."""
        ...

    def handle(self, state: S, event: Event) -> tuple[S, tuple[Effect, ...]]:
        """The next state, and what the driver is asked to do, in order.

        Raises ``IllegalEvent`` for what only a broken driver can cause.
        """
        ...


class IllegalEvent(RuntimeError):  # noqa: N818  the usual term
    """The driver broke the contract (started twice, a timer that was not set, time going back)."""


Transitions = Mapping[tuple[Enum, type], frozenset[Enum]]
"""One table per role: which phases may follow a phase on an event of a type."""


def check_transition(table: Transitions, before: Enum, event: Event, after: Enum) -> None:
    """Raise ``IllegalEvent`` unless the role's table allows the step."""
    if after not in table.get((before, type(event)), frozenset()):
        raise IllegalEvent(f"{type(event).__name__} in {before.value} cannot lead to {after.value}")
