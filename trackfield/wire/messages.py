"""The messages that Trackfield's roles exchange; docs/wire.md prints them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Final

from trackfield.wire.registry import Scaled, kind

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
