"""A role that cries once a second to all in reach: the work of ``bench.broadcasts``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from trackfield.role import NEIGHBOURHOOD, NS, Effect, Event, Listen, Received, Send, SetTimer, Started, Timer
from trackfield.wire.registry import Scaled, kind


@kind(216, "cry")
@dataclass(frozen=True, slots=True)
class Cry:
    """What is broadcast."""

    count: Annotated[int, Scaled(0, 65535)]


class Crier:
    """Cries once a second from ``at`` on (ns), and counts what it hears."""

    kinds = frozenset({"cry"})

    def __init__(self, *, at: int, sleeps: bool) -> None:
        self.at, self.sleeps = at, sleeps

    def begin(self) -> int:
        """Nothing heard."""
        return 0

    def handle(self, state: int, event: Event) -> tuple[int, tuple[Effect, ...]]:
        """See ``trackfield.role.Role``."""
        match event:
            case Started():
                listen = (Listen(2 * NS, NS // 200, self.at),) if self.sleeps else ()
                return state, (*listen, SetTimer("cry", self.at))
            case Timer(now):
                return state, (Send(Cry(now // NS), NEIGHBOURHOOD), SetTimer("cry", now + NS))
            case Received():
                return state + 1, ()
        return state, ()
