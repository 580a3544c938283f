"""Roles and architectures of somebody who knows the package from outside only, at places where processes find them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from statistics import fmean
from typing import Annotated, Any

import trackfield as tf
from trackfield.protocols.timesync import TimeSync
from trackfield.role import NS, Effect, Event, Ignored, Publish, Received, Send, SetTimer, Started, Timer
from trackfield.tracking.forwarding import Gathered, Gathering, Numbering
from trackfield.wire.messages import SyncRequest, Track
from trackfield.wire.registry import Scaled, kind


@kind(231, "hello")
@dataclass(frozen=True)
class Hello:
    """A message of a user's own."""

    number: Annotated[int, Scaled(0, 65535)]


class Herald:
    """Tells the time, and says hello once a second to some others."""

    def __init__(self, *, to: list[str]) -> None:
        self.to, self.time = frozenset(to), TimeSync()
        self.kinds = self.time.kinds

    def begin(self) -> tuple[Any, int]:
        return self.time.begin(), 0

    def handle(self, state: tuple[Any, int], event: Event) -> tuple[tuple[Any, int], tuple[Effect, ...]]:
        time, said = state
        match event:
            case Timer(now):
                return (time, said + 1), (Send(Hello(said), self.to), SetTimer("hello", now + NS))
            case Started(now):
                time, effects = self.time.handle(time, event)
                return (time, said), (*effects, SetTimer("hello", now + NS))
            case Received(_, SyncRequest()):
                time, effects = self.time.handle(time, event)
                return (time, said), effects
        return state, ()


@dataclass(frozen=True)
class Heralded:
    """One centre, and a herald that tells the time to all and says hello to the centre."""

    herald: str = "herald"
    changes: Mapping[str, Any] | None = None

    def arrange(self, field: tf.Field) -> tf.Arranged:
        ids = [id for id, *_ in field.sensors]
        centre = field.fusion_centre("fusion", *field.centre, ids, asks=self.herald)
        nodes = field.sensor_nodes("fusion", asks=self.herald)
        x, y = field.centre
        herald = tf.Process(self.herald, "herald", x + 10.0, y, Herald, {"to": ["fusion"]}, sends={"hello": ["fusion"]})
        return tf.Arranged([herald, replace(centre, **(self.changes or {})), *nodes], {"base": ["fusion"]})


class Merger:
    """Publishes the mean of the tracks that came for an instant, as its own."""

    kinds = frozenset({"track"})

    def __init__(self, *, numbering: Mapping[str, Any]) -> None:
        self.gathering = Gathering(Numbering(**numbering), 5 * NS)

    def begin(self) -> Gathered:
        return self.gathering.begin()

    def handle(self, state: Gathered, event: Event) -> tuple[Gathered, tuple[Effect, ...]]:
        match event:
            case Received(now, Track() as message, sender):
                state, points = self.gathering.take(state, now, message, sender)
                if isinstance(points, Ignored):
                    return state, (points,)
                x, y, vx, vy = (fmean(numbers) for numbers in zip(*(point.mean for point in points), strict=True))
                sensors = sorted({id for point in points for id in point.sensors})
                merged = replace(points[0], mean=(x, y, vx, vy), sensors=tuple(sensors), origin="")
                return state, (Publish(merged),)
        return state, ()


@dataclass(frozen=True)
class Merged:
    """Two centres with every other sensor, whose tracks a base merges."""

    def arrange(self, field: tf.Field) -> tf.Arranged:
        ids = [id for id, *_ in field.sensors]
        config = {"numbering": field.numbering}
        processes = [tf.Process("base", "merger", *field.centre, Merger, config, tags={"tracks"})]
        for centre, half in (("a", ids[::2]), ("b", ids[1::2])):
            processes.append(field.fusion_centre(centre, *field.centre, half, forwards_to="base"))
            processes += field.sensor_nodes(centre, half)
        return tf.Arranged(processes, {"base": ["base"], "in-network": ["a", "b"]})
