"""By which neighbour data of an origin goes on to a sink, and from which it came: reinforced paths.

Whoever gets a message of an origin for the first time remembers the neighbour it came from. The sink *reinforces* that
neighbour, which from then on sends data of the origin to the sink, and reinforces the one it has had it from, and so on
back to the origin. A first copy is reinforced once, so no reinforcement goes on for ever.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field, replace
from typing import Final, TypeVar

from trackfield.protocols.interest.interests import Key

MOST_FLOWS: Final = 512
"""Of so many origins under interests a process remembers where data goes and comes from, and of so many neighbours
that they do not answer."""

Flow = tuple[Key, str]
"""Data of an origin, under an interest."""
K = TypeVar("K", bound=Hashable)
V = TypeVar("V")


def kept(known: Mapping[K, V], key: K, value: V, most: int) -> Mapping[K, V]:
    """The mapping with one more; at most so many, of which the oldest is forgotten."""
    others = {one: of for one, of in known.items() if one != key}
    if len(others) >= most:
        del others[next(iter(others))]
    return {**others, key: value}


@dataclass(frozen=True, slots=True)
class Paths:
    """The next neighbour of each flow as it was reinforced, and the neighbour from which its last message came.

    The first is empty where that neighbour did not answer; the next message finds another path, which is reinforced.
    ``silent`` are the neighbours that did not acknowledge a message, and were not heard since.
    """

    onward: Mapping[Flow, str] = field(default_factory=dict)
    came: Mapping[Flow, str] = field(default_factory=dict)
    silent: Mapping[str, None] = field(default_factory=dict)

    def by(self, flow: Flow, neighbour: str) -> Paths:
        """A message that was not known came from this neighbour."""
        return replace(self, came=kept(self.came, flow, neighbour, MOST_FLOWS))

    def reinforced(self, flow: Flow, neighbour: str) -> tuple[Paths, str]:
        """This neighbour wants the flow; the other value is whom to tell in turn, empty if nobody is known."""
        back = self.came.get(flow, "")
        came = {one: of for one, of in self.came.items() if one != flow}
        return replace(self, onward=kept(self.onward, flow, neighbour, MOST_FLOWS), came=came), back

    def lost(self, neighbour: str) -> Paths:
        """This neighbour does not answer: no flow goes by it."""
        onward = {flow: "" if next == neighbour else next for flow, next in self.onward.items()}
        return replace(self, onward=onward, silent=kept(self.silent, neighbour, None, MOST_FLOWS))

    def broken(self, flow: Flow) -> Paths:
        """This flow went round in a circle: its path is not used any longer."""
        return replace(self, onward={**self.onward, flow: ""}) if flow in self.onward else self

    def heard(self, neighbour: str) -> Paths:
        """This neighbour is there."""
        if neighbour not in self.silent:
            return self
        return replace(self, silent={id: None for id in self.silent if id != neighbour})
