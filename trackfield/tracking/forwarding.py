"""Tracks handed on by radio: a point as a message, and the message as a point of the process that made it.

Who receives a track publishes it of the same instant, with its ``origin``. Nothing that a peer sends is an error: a
message of no use gives the reason to ignore it.

A process that tracks sends what it publishes (``Forwarding``). One that receives tracks, of one sender or of several,
keeps the latest of each and may choose among them (``Gathering``)::

    case Received(now, Track() as message, sender):
        state, points = self.gathering.take(state, now, message, sender)
        if isinstance(points, Ignored):
            return state, (points,)
        return state, (Publish(min(points, key=position_sd)),)
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final, Literal, Self

import numpy as np
from immutables import Map

from trackfield.errors import ScenarioError
from trackfield.filters.belief import form_of, moments, pack, unpack
from trackfield.filters.types import Gaussian
from trackfield.role import Ignored, Send, TrackPoint
from trackfield.tracking.bank import Bank
from trackfield.wire.keys import Medium
from trackfield.wire.listed import packed, unpacked
from trackfield.wire.messages import MOST_US, Track
from trackfield.words import quoted

MOST_NUMBERS: Final = 16
"""The longest state in a message; of a longer one only x, y, vx, vy are sent."""
MOST_SENSORS: Final = 1024
"""The most sensors that a message names; of more reports the first count as used."""
_OLDEST_MS: Final = 2**32 - 1
_SENSORS: Final = 2**16
_TRACKERS: Final = 2**8


@dataclass(frozen=True)
class Numbering:
    """What sender and receiver of a track both know: the lists in which messages count, and the instants of the steps.

    ``trackers`` are the names of the run's trackers, ``sensors`` the ids of all sensors of the field, in the same order
    at both ends. Step k is at ``origin_ns`` + k ``step_ns``. ``target`` is the id of what is tracked.
    """

    trackers: Sequence[str]
    sensors: Sequence[str]
    step_ns: int
    origin_ns: int = 0
    target: str = "target"

    @classmethod
    def of(cls, bank: Bank, sensors: Sequence[str] = ()) -> Self:
        """With the trackers and the steps of a ``bank``, and these sensors (none: its own)."""
        return cls(tuple(bank.trackers), sensors or tuple(bank.positions), bank.step_ns, bank.origin_ns, bank.target)

    def __post_init__(self) -> None:
        for what, names, most in (("trackers", self.trackers, _TRACKERS), ("sensors", self.sensors, _SENSORS)):
            if len(names) > most:
                raise ScenarioError(f"a track cannot be handed on with {len(names)} {what}", expected=f"up to {most}")

    @cached_property
    def tracker_numbers(self) -> dict[str, int]:
        """Their numbers by name."""
        return {name: number for number, name in enumerate(self.trackers)}

    @cached_property
    def sensor_numbers(self) -> dict[str, int]:
        """Their numbers by id."""
        return {id: number for number, id in enumerate(self.sensors)}

    def instant(self, at_us: int) -> tuple[int, int | None]:
        """The instant (ns) that was rounded to ``at_us``, and its step: None if it is not that of a step."""
        step = round((at_us * 1000 - self.origin_ns) / self.step_ns)
        step_ns = self.origin_ns + step * self.step_ns
        return (step_ns, step) if _microseconds(step_ns) == at_us else (at_us * 1000, None)


def sent_dimension(dimension: int) -> int:
    """How many numbers are sent of a state that has so many."""
    return dimension if dimension <= MOST_NUMBERS else 4


def message_of(point: TrackPoint, numbering: Numbering, now: int) -> Track | None:
    """The message that hands a point on at ``now`` (ns, the sender's clock).

    None for a point that is not sent: without a track, of a smoothed track, not finite, of a tracker or with a sensor
    that is not numbered, or of an instant that no message can have. What is unknown besides x, y, vx, vy is sent as if
    it were independent of these.
    """
    if not point.mean or point.lag or not _numbered(point, numbering):
        return None
    more = point.unknowns[: sent_dimension(4 + len(point.unknowns)) - 4]
    covariance = np.zeros((4 + len(more),) * 2)
    covariance[:4, :4] = np.reshape(point.covariance, (4, 4))
    covariance[range(4, len(covariance)), range(4, len(covariance))] = np.square(point.unknown_sds[: len(more)])
    belief = Gaussian(np.array((*point.mean, *more)), covariance)
    try:
        data = pack(belief)
    except ValueError:
        return None
    numbers = (numbering.sensor_numbers[id] for id in point.sensors[:MOST_SENSORS])
    return Track(
        _microseconds(point.at_ns),
        min(max((now - point.at_ns) // 1_000_000, 0), _OLDEST_MS),
        numbering.tracker_numbers[point.tracker],
        form_of(belief),
        len(covariance),
        data,
        packed(numbers),
    )


def point_of(message: Track, sender: str, numbering: Numbering, now: int) -> TrackPoint | Ignored:
    """The point in a message that came at ``now`` (ns, the receiver's clock), made by ``sender``; or why it is none."""
    if message.tracker >= len(numbering.trackers):
        return Ignored("unknown tracker")
    at_ns, step = numbering.instant(message.at_us)
    if at_ns < numbering.origin_ns:
        return Ignored("before the first step")
    if at_ns > now + numbering.step_ns:
        return Ignored("from the future")
    sensors = unpacked(message.sensors, numbering.sensors)
    if sensors is None:
        return Ignored("unknown sensor")
    try:
        mean, covariance = moments(unpack(message.form, message.dimension, message.belief))
    except ValueError:
        return Ignored("unusable belief")
    status: Literal["tracking", "coasting"] = "tracking" if sensors else "coasting"
    return TrackPoint(
        numbering.trackers[message.tracker],
        numbering.target,
        at_ns,
        status,
        tuple(mean[:4].tolist()),
        tuple(covariance[:4, :4].ravel().tolist()),
        sensors,
        step=step,
        origin=sender,
        unknowns=tuple(mean[4:].tolist()),
        unknown_sds=tuple(np.sqrt(covariance.diagonal()[4:]).tolist()),
    )


def received(point: TrackPoint, numbering: Numbering) -> TrackPoint | None:
    """What a receiver has of a point that its source sends; None if it is not sent, or of no use."""
    message = message_of(point, numbering, point.at_ns)
    found = message and point_of(message, point.source, numbering, point.at_ns)
    return found if isinstance(found, TrackPoint) else None


@dataclass(frozen=True)
class Forwarding:
    """Hands on what a process publishes, ``to`` one process or several, over a ``medium``."""

    to: str | frozenset[str]
    numbering: Numbering
    medium: Medium = "field"

    def sends(self, points: Iterable[TrackPoint], now: int) -> tuple[Send, ...]:
        """A message for each point that is sent (``message_of``), in their order."""
        messages = (message_of(point, self.numbering, now) for point in points)
        return tuple(Send(message, self.to, self.medium) for message in messages if message is not None)


def forwarding(
    bank: Bank, to: str | Collection[str], *, sensors: Sequence[str] = (), medium: Medium = "field"
) -> Forwarding:
    """Hands on what the trackers of a ``bank`` know. ``sensors`` are all of the field (none: those of the bank).

    Raises ``ScenarioError`` if a sensor of the bank is not among them.
    """
    receivers = to if isinstance(to, str) else frozenset(to)
    numbering = Numbering.of(bank, sensors)
    if unlisted := [id for id in bank.positions if id not in numbering.sensor_numbers]:
        raise ScenarioError(
            f"the sensors of a track that is handed on do not list {quoted(unlisted[0])}",
            expected="all sensors of the field",
        )
    return Forwarding(receivers, numbering, medium)


Gathered = Map[tuple[int, str], Map[str, tuple[int, TrackPoint]]]
"""By instant (ns) and tracker, the latest point of each sender and its age (ms) when it left."""


@dataclass(frozen=True)
class Gathering:
    """Takes tracks of any number of senders, as long as they are not older than ``max_age_ns``.

    A step that its sender fused again, with late reports, comes again; that of the greater age counts.
    """

    numbering: Numbering
    max_age_ns: int

    def begin(self) -> Gathered:
        """Nothing came yet."""
        return Map()

    def take(
        self, state: Gathered, now: int, message: Track, sender: str
    ) -> tuple[Gathered, tuple[TrackPoint, ...] | Ignored]:
        """After a message at ``now`` (ns): the points of its instant and tracker, one of each sender in their order.

        Or why it is of no use.
        """
        point = point_of(message, sender, self.numbering, now)
        if isinstance(point, Ignored):
            return state, point
        oldest_ns = now - self.max_age_ns
        if point.at_ns < oldest_ns:
            return state, Ignored("late")
        key = (point.at_ns, point.tracker)
        points = state.get(key, Map())
        if sender in points and points[sender][0] >= message.age_ms:
            return state, Ignored("repeated")
        points = points.set(sender, (message.age_ms, point))
        kept = state.set(key, points)
        for old in [one for one in kept if one[0] < oldest_ns]:
            kept = kept.delete(old)
        return kept, tuple(points[one][1] for one in sorted(points))


def _numbered(point: TrackPoint, numbering: Numbering) -> bool:
    """Whether its tracker, its instant and the sensors that its message names have numbers."""
    known = point.tracker in numbering.tracker_numbers and abs(_microseconds(point.at_ns)) <= MOST_US
    return known and all(id in numbering.sensor_numbers for id in point.sensors[:MOST_SENSORS])


def _microseconds(at_ns: int) -> int:
    return (at_ns + 500) // 1000
