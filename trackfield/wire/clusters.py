"""The messages of masters and slaves: clusters that form, measure, and hand a track on; docs/wire.md prints them.

A *term* is a time for which one master leads: a number, which grows with each hand-over and take-over, and the leader's
id. Every message between masters has the number; the leader is its sender or receiver, unless a field names it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Final

from trackfield.wire.registry import Blob, Scaled, kind

CYCLE: Final = 128
"""Of the steps of ``no-target`` only the remainder by this travels: one byte."""
_NUMBER: Final = Scaled(0, 2**31 - 1, unit="number of the term")
_STEP: Final = Scaled(0, 65535, unit="filter step")
_SENSOR: Final = Scaled(0, 65535, unit="number of the sensor")
_SLOT: Final = Scaled(0, 65535, unit="slot")
_PLACE: Final = Scaled(-1_000_000, 1_000_000, 0.1, "m")
_FREE: Final = Scaled(0, 255, unit="places")
_ID: Final = Blob(32, "id, ASCII")
BELIEFS_BYTES: Final = 1024
"""What a leader shares of what its trackers know, at most."""
_BELIEFS: Final = Blob(BELIEFS_BYTES, "beliefs")


@kind(30, "announce")
@dataclass(frozen=True, slots=True)
class Announce:
    """A master says where it stands, for slaves that look for one; this is number ``number`` of its announcements.

    ``of`` is how many it makes; 0: this answers a slave that asked who is there. It has ``free`` places left.
    """

    number: Annotated[int, Scaled(0, 255, unit="number of the announcement")]
    of: Annotated[int, Scaled(0, 255, unit="announcements")]
    free: Annotated[int, _FREE]
    x_m: Annotated[float, _PLACE]
    y_m: Annotated[float, _PLACE]


@kind(31, "solicit")
@dataclass(frozen=True, slots=True)
class Solicit:
    """A slave without a master asks who is there."""

    number: Annotated[int, Scaled(0, 65535, unit="number of the search")]


@kind(32, "join")
@dataclass(frozen=True, slots=True)
class Join:
    """The sensor ``sensor`` of the field's list asks a master for a place, or says that it still has it."""

    sensor: Annotated[int, _SENSOR]


@kind(33, "admit")
@dataclass(frozen=True, slots=True)
class Admit:
    """A master's answer to ``join``: the sensor has ``place`` in its list; 255: it has none, the list is full.

    Others that hear it know how many places are ``free``.
    """

    sensor: Annotated[int, _SENSOR]
    place: Annotated[int, Scaled(0, 255, unit="place in the list")]
    free: Annotated[int, _FREE]


@kind(34, "wake")
@dataclass(frozen=True, slots=True)
class Wake:
    """The beacon of a master: these of its slaves measure at the steps from ``step`` on, for ``steps`` steps.

    ``places`` are theirs in its list, a byte each, in the order of their slots, the first of which is ``slot``. All
    others sleep. It also says which term its sender knows of: the number and the ``leader``.
    """

    number: Annotated[int, _NUMBER]
    leader: Annotated[bytes, _ID]
    step: Annotated[int, _STEP]
    steps: Annotated[int, Scaled(0, 255, unit="steps")]
    slot: Annotated[int, _SLOT]
    places: Annotated[bytes, Blob(255, "places in the list")]


@kind(35, "no-target")
@dataclass(frozen=True, slots=True)
class NoTarget:
    """A slave that measures senses no target at the step with this remainder by 128."""

    step: Annotated[int, Scaled(0, CYCLE - 1, unit="filter step, modulo 128")]


@kind(36, "merge")
@dataclass(frozen=True, slots=True)
class Merge:
    """The leader asks another master to have these slaves measure from ``step`` on, for ``steps`` steps.

    ``slot`` is that of the first; after the last one the master sends what they reported. Without ``sensors`` it asks
    for nothing any more. ``sensors`` are numbers in the field's list, two little-endian bytes each.
    """

    number: Annotated[int, _NUMBER]
    step: Annotated[int, _STEP]
    steps: Annotated[int, Scaled(0, 255, unit="steps")]
    slot: Annotated[int, _SLOT]
    sensors: Annotated[bytes, Blob(512, "numbers of sensors")]


@kind(37, "aggregate")
@dataclass(frozen=True, slots=True)
class Aggregate:
    """What slaves reported of a step, in one message to the leader, whose term has this ``number``.

    ``reports`` are, one after the other, a sensor's number (two little-endian bytes), the length of its report (one
    byte), and the report, encoded.
    """

    number: Annotated[int, _NUMBER]
    step: Annotated[int, _STEP]
    reports: Annotated[bytes, Blob(3500, "reports")]


@kind(38, "hand-over")
@dataclass(frozen=True, slots=True)
class HandOver:
    """The leader asks a master to lead from now on, in the term of this ``number``.

    ``beliefs`` are those of its trackers after ``step``: MessagePack, as what a process stores.
    """

    number: Annotated[int, _NUMBER]
    step: Annotated[int, _STEP]
    beliefs: Annotated[bytes, Blob(3700, "beliefs")]


@kind(39, "hand-over-ack")
@dataclass(frozen=True, slots=True)
class HandOverAck:
    """A master leads, in the term of this ``number``."""

    number: Annotated[int, _NUMBER]


@kind(40, "share")
@dataclass(frozen=True, slots=True)
class Share:
    """The leader tells all in reach what its trackers know after ``step``, and who leads first if it should die.

    Without ``beliefs`` it has lost the target, and the term is over.
    """

    number: Annotated[int, _NUMBER]
    step: Annotated[int, _STEP]
    heir: Annotated[bytes, _ID]
    beliefs: Annotated[bytes, _BELIEFS]


@kind(41, "roster")
@dataclass(frozen=True, slots=True)
class Roster:
    """A master tells those in reach which slaves it has: numbers in the field's list, two little-endian bytes each."""

    sensors: Annotated[bytes, Blob(512, "numbers of sensors")]


@kind(42, "led-track")
@dataclass(frozen=True, slots=True)
class LedTrack:
    """The leader tells the base what its trackers know after ``step``, and which sensors' reports it used there."""

    number: Annotated[int, _NUMBER]
    step: Annotated[int, _STEP]
    sensors: Annotated[bytes, Blob(512, "numbers of sensors")]
    beliefs: Annotated[bytes, _BELIEFS]


@kind(43, "doubt")
@dataclass(frozen=True, slots=True)
class Doubt:
    """A master has not heard the ``leader`` of a term for long, and asks all in reach whether they have."""

    number: Annotated[int, _NUMBER]
    leader: Annotated[bytes, _ID]


@kind(44, "alive")
@dataclass(frozen=True, slots=True)
class Alive:
    """The answer to ``doubt``: the ``leader`` of the term was heard of late, or is the sender itself."""

    number: Annotated[int, _NUMBER]
    leader: Annotated[bytes, _ID]
