"""An architecture with serial lines: a desk asks a gauge once a second, and some more that a device cannot replace."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated

import trackfield as tf
from tests.strangers import Herald
from trackfield.role import NS, Effect, Event, Ignored, Received, Send, SetTimer, Started, Timer
from trackfield.wire.keys import Medium
from trackfield.wire.registry import Scaled, kind


@kind(233, "question")
@dataclass(frozen=True)
class Question:
    number: Annotated[int, Scaled(0, 65535)]


@kind(234, "gauge-answer")
@dataclass(frozen=True)
class Answer:
    number: Annotated[int, Scaled(0, 65535)]


class Desk:
    """Asks with the number that the last answer had, or with 0."""

    kinds = frozenset({"gauge-answer"})

    def __init__(self, *, to: str) -> None:
        self.to = to

    def begin(self) -> int:
        return 0

    def handle(self, state: int, event: Event) -> tuple[int, tuple[Effect, ...]]:
        match event:
            case Started(now):
                return state, (SetTimer("ask", now + NS // 2),)
            case Timer(now):
                return state, (Send(Question(state), self.to, "serial"), SetTimer("ask", now + NS // 2))
            case Received(_, Answer(number)):
                return number, ()
        return state, (Ignored("unexpected"),)


class Gauge:
    """Answers with the next number."""

    kinds = frozenset({"question"})

    def begin(self) -> int:
        return 0

    def handle(self, state: int, event: Event) -> tuple[int, tuple[Effect, ...]]:
        match event:
            case Received(_, Question(number), sender):
                return state, (Send(Answer(number + 1), sender, "serial"),)
        return state, ()


@dataclass(frozen=True)
class Lined:
    """A centre and its nodes by radio; beside them a desk with a gauge, by a line, and a hub with two more.

    If the gauge has a radio, too, a herald says hello to it by that.
    """

    gauge: Sequence[Medium] = ("serial",)

    def arrange(self, field: tf.Field) -> tf.Arranged:
        ids, (x, y) = [id for id, *_ in field.sensors], field.centre
        wire: Sequence[Medium] = ("serial",)
        asking, answering = {"question": wire[0]}, {"gauge-answer": wire[0]}
        desk = tf.Process(
            "desk",
            "desk",
            x,
            y,
            Desk,
            {"to": "gauge"},
            sends={"question": ["gauge"]},
            over=asking,
            media=("field", *wire),
        )
        gauge = tf.Process(
            "gauge", "gauge", x, y, Gauge, sends={"gauge-answer": ["desk"]}, over=answering, media=self.gauge
        )
        hub = replace(gauge, id="hub", media=wire, sends={"gauge-answer": ["one", "two"]})
        ends = [replace(hub, id=id, sends={"question": ["hub"]}, over=asking) for id in ("one", "two")]
        lonely = replace(hub, id="lonely", sends={}, over={})
        centre = field.fusion_centre("fusion", x, y, ids)
        processes = [desk, gauge, hub, *ends, lonely, centre, *field.sensor_nodes("fusion")]
        if "field" in self.gauge:
            herald = tf.Process("herald", "herald", x, y, Herald, {"to": ["gauge"]}, sends={"hello": ["gauge"]})
            processes.append(herald)
        return tf.Arranged(processes, {"base": ["fusion"]})
