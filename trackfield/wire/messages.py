"""The messages that Trackfield's roles exchange; docs/wire.md prints them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Final

from trackfield.wire.registry import Blob, Scaled, kind

MOST_US: Final = 10**15
"""The latest time that a message can hold, in microseconds: some thirty years; as much before 0."""
_MICROSECONDS: Final = Scaled(-MOST_US, MOST_US, unit="us")


@kind(1, "doa")
@dataclass(frozen=True, slots=True)
class Doa:
    """The bearing and level of the sound that a sensor node heard at a filter step.

    ``bearing_deg`` points from the node to the sound, clockwise from north (+y).
    """

    step: Annotated[int, Scaled(0, 65535, unit="filter step")]
    bearing_deg: Annotated[float, Scaled(0, 359.99, 0.01, "degree", cyclic=True)]
    level_db: Annotated[float, Scaled(-50, 200, 0.01, "dB")]


@kind(2, "sync-request")
@dataclass(frozen=True, slots=True)
class SyncRequest:
    """A process asks for the time; ``sent_us`` is its own clock at sending (t0 of the exchange)."""

    exchange: Annotated[int, Scaled(0, 65535, unit="number of the exchange")]
    sent_us: Annotated[int, _MICROSECONDS]


@kind(3, "sync-reply")
@dataclass(frozen=True, slots=True)
class SyncReply:
    """The answer: the request's ``exchange`` and ``sent_us``, and the reference's time at arrival (t1), reply (t2)."""

    exchange: Annotated[int, Scaled(0, 65535, unit="number of the exchange")]
    sent_us: Annotated[int, _MICROSECONDS]
    came_us: Annotated[int, _MICROSECONDS]
    left_us: Annotated[int, _MICROSECONDS]


@kind(4, "threshold")
@dataclass(frozen=True, slots=True)
class Threshold:
    """The fusion centre sets the level from which a sensor reports, from step ``step`` on."""

    step: Annotated[int, Scaled(0, 65535, unit="filter step")]
    level_db: Annotated[float, Scaled(-50, 200, 0.01, "dB")]


@kind(5, "measurement")
@dataclass(frozen=True, slots=True)
class Measurement:
    """The reading of a user's own sensor at a filter step, in steps of its resolutions."""

    step: Annotated[int, Scaled(0, 65535, unit="filter step")]
    values: tuple[Annotated[int, Scaled(-(10**15), 10**15, unit="resolution")], ...]


@kind(6, "track")
@dataclass(frozen=True, slots=True)
class Track:
    """What a tracker knew at an instant, handed on by the process that tracks.

    ``at_us`` is the instant by the reference clock, ``age_ms`` how long after it the message left: of two about one
    instant, that of the greater age counts. ``tracker`` is a number in the run's list of trackers. ``belief`` has
    ``dimension`` unknowns, the first four x, y, vx, vy; ``form`` says how it is written: 1 a Gaussian, 2 modes,
    3 particles (docs/wire.md). ``sensors`` are those whose reports of this instant were used: their numbers in the
    field's list, two little-endian bytes each.
    """

    at_us: Annotated[int, _MICROSECONDS]
    age_ms: Annotated[int, Scaled(0, 2**32 - 1, unit="ms")]
    tracker: Annotated[int, Scaled(0, 255, unit="number of the tracker")]
    form: Annotated[int, Scaled(1, 3, unit="form of the belief")]
    dimension: Annotated[int, Scaled(4, 16, unit="numbers of a state")]
    belief: Annotated[bytes, Blob(1024, "belief")]
    sensors: Annotated[bytes, Blob(2048, "numbers of sensors")]


@kind(7, "range")
@dataclass(frozen=True, slots=True)
class Range:
    """The distance to the target that a sensor node measured at a filter step."""

    step: Annotated[int, Scaled(0, 65535, unit="filter step")]
    range_m: Annotated[float, Scaled(-100_000, 1_000_000, 0.001, "m")]


@kind(8, "rss")
@dataclass(frozen=True, slots=True)
class Rss:
    """The strength of the target's radio signal that a sensor node received at a filter step."""

    step: Annotated[int, Scaled(0, 65535, unit="filter step")]
    level_dbm: Annotated[float, Scaled(-300, 100, 0.01, "dBm")]


@kind(9, "energy")
@dataclass(frozen=True, slots=True)
class Energy:
    """The mean power of the sound that a sensor node received in a window, relative to a reference."""

    step: Annotated[int, Scaled(0, 65535, unit="filter step")]
    energy: Annotated[float, Scaled(-1_000_000_000_000, 1_000_000_000_000, 0.001, "reference power")]


NOWHERE: Final = 655.35
"""The cost of a process that knows no way to the base."""
_COST: Final = Scaled(0, NOWHERE, 0.01, "transmissions")
_ID: Final = Blob(32, "id, ASCII")


@kind(20, "route")
@dataclass(frozen=True, slots=True)
class Route:
    """A process tells its neighbours what it costs to send to the base through it: a beacon of the collection tree.

    ``number`` counts its beacons. ``cost`` are the transmissions that a frame is expected to need from it to the base;
    655.35: it knows no way. ``parent`` is the neighbour to which it sends, empty for the base and without a way. With
    ``pull`` 1 it asks those who know a way to tell theirs soon.
    """

    number: Annotated[int, Scaled(0, 65535, unit="number of the beacon")]
    cost: Annotated[float, _COST]
    pull: Annotated[int, Scaled(0, 1, unit="1: asks")]
    parent: Annotated[bytes, _ID]


@kind(21, "hop")
@dataclass(frozen=True, slots=True)
class Hop:
    """A message on its way over the collection tree, from one process to the next.

    ``origin`` sent it, as the ``number``-th of its messages; it has made ``hops`` hops before this one. ``cost`` is
    that of the process that hands it on. ``to`` is where an answer of the base goes; empty: to the base. ``message`` is
    the payload; empty: the origin only says where it is.
    """

    origin: Annotated[bytes, _ID]
    number: Annotated[int, Scaled(0, 65535, unit="number of the message")]
    hops: Annotated[int, Scaled(0, 255, unit="hops")]
    cost: Annotated[float, _COST]
    to: Annotated[bytes, _ID]
    message: Annotated[bytes, Blob(3700, "payload")]


@kind(22, "hop-ack")
@dataclass(frozen=True, slots=True)
class HopAck:
    """A process has the ``number``-th message of ``origin``: its neighbour need not send it again."""

    origin: Annotated[bytes, _ID]
    number: Annotated[int, Scaled(0, 65535, unit="number of the message")]
