"""The backbone beyond a gateway: a chain of forwarding nodes, at whose end are processes that reach each other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

CARRIED: Final = "carried"


@dataclass(frozen=True)
class Chain:
    """The processes from the gateway on by their ids, each next to the one before it, and those at the ``end``.

    Those at the end are next to each other and to the last of the chain.
    """

    links: Sequence[str]
    end: Sequence[str]

    def near(self, id: str) -> list[str]:
        """The processes next to one."""
        if id in self.end:
            return [self.links[-1], *(other for other in self.end if other != id)]
        at = self.links.index(id)
        after = self.end if at == len(self.links) - 1 else [self.links[at + 1]]
        return [*self.links[max(at - 1, 0) : at], *after]

    def before(self, id: str) -> str:
        """The one before it on the way from the gateway."""
        return self.links[-1] if id in self.end else self.links[self.links.index(id) - 1]

    def next(self, id: str) -> dict[str, str]:
        """To which neighbour a process gives what is for another one, by the id of that."""
        every, near = [*self.links, *self.end], self.near(id)
        return {other: other if other in near else self._towards(id, other) for other in every if other != id}

    def carries(self, id: str, hold_ns: int) -> dict[str, Any]:
        """The arguments of its ``Carried``; none where all are next to each other."""
        ways = self.next(id)
        if len(self.links) == 1:
            return {}
        return {"next": ways, **({"hold_ns": hold_ns} if hold_ns and id in self.links[1:] else {})}

    def sends(self, id: str) -> dict[str, tuple[str, ...]]:
        """To whom it sends messages on their way."""
        return {CARRIED: tuple(self.near(id))} if len(self.links) > 1 else {}

    def _towards(self, id: str, other: str) -> str:
        if id in self.end:
            return self.links[-1]
        at = self.links.index(id)
        return self.links[at + 1] if other in self.end or self.links.index(other) > at else self.links[at - 1]
