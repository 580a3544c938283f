"""What a process knows and does of directed diffusion, and what an event leads to."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

from trackfield.protocols.interest.interests import Interests
from trackfield.protocols.interest.paths import Paths
from trackfield.protocols.interest.timed import Timed
from trackfield.protocols.interest.traffic import Traffic
from trackfield.role import Effect, Received


@dataclass(frozen=True, slots=True)
class Spread:
    """The state of a process."""

    interests: Interests = field(default_factory=Interests)
    paths: Paths = field(default_factory=Paths)
    traffic: Traffic = field(default_factory=Traffic)
    timed: Timed = field(default_factory=Timed)


class Step(NamedTuple):
    """What an event leads to; ``arrived`` are the messages that were for this process, from their origins."""

    state: Spread
    effects: tuple[Effect, ...] = ()
    arrived: tuple[Received, ...] = ()

    def then(self, after: Step) -> Step:
        """This step, and the one that follows it."""
        return Step(after.state, (*self.effects, *after.effects), (*self.arrived, *after.arrived))
