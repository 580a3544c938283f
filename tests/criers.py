"""Processes that cry out now and then to all in reach of them, beside a field with one centre."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, cast

import trackfield as tf
from launcher.plan.architectures.centralised import Centralised
from tests.toys import Feedback, mix
from trackfield.draw import uniform
from trackfield.role import NEIGHBOURHOOD, NS, Effect, Event, Received, Send, SetTimer, Started, Timer
from trackfield.wire.keys import Medium


class Crier:
    """Cries once a second, at an instant of its own; what it hears changes its chain."""

    kinds = frozenset({"feedback"})

    def __init__(self, *, number: int, medium: Any = "field") -> None:
        self.number, self.medium = number, medium

    def begin(self) -> int:
        return self.number

    def handle(self, state: int, event: Event) -> tuple[int, tuple[Effect, ...]]:
        match event:
            case Started(now):
                at = now + int(NS * uniform(self.number, "cry"))
                return state, (SetTimer("cry", at),)
            case Timer(now, "cry"):
                cry = Send(Feedback(now // NS, state), NEIGHBOURHOOD, self.medium)
                return state, (cry, SetTimer("cry", now + NS))
            case Received(message=Feedback(_, chain)):
                return mix(state, chain), ()
        return state, ()


@dataclass(frozen=True)
class Crying:
    """A row of criers, ``spacing_m`` apart; the last ``wired`` cry on another ``medium``, too far away to be heard."""

    criers: int = 8
    spacing_m: float = 40.0
    wired: int = 3
    walks: bool = True
    medium: str = "backbone"

    def arrange(self, field: tf.Field) -> tf.Arranged:
        """See ``tf.Architecture``; the first walks along the row, slowly, if one ``walks``."""
        arranged = Centralised().arrange(field)
        criers = [self._crier(i, field) for i in range(self.criers + self.wired)]
        return tf.Arranged([*arranged.processes, *criers], arranged.views)

    def _crier(self, i: int, field: tf.Field) -> tf.Process:
        wired, medium = i >= self.criers, cast(Medium, self.medium)
        x = i * self.spacing_m + (1e5 * (i + 1) if wired else 0.0)
        legs = ((0, x, 0.0), (field.site.end_ns, x + self.criers * self.spacing_m, 0.0)) if not i and self.walks else ()
        return tf.Process(
            f"c{i}",
            "crier",
            x,
            0.0,
            factory=Crier,
            config={"number": i, "medium": self.medium if wired else "field"},
            sends={"feedback": ["*"]},
            hears=["feedback"],
            over={"feedback": medium} if wired else {},
            media=[medium] if wired else ["field"],
            route=legs,
        )
