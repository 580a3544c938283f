"""What waits in a gateway until its receivers have it: in order, one item at a time to each of them.

An item is sent again until it is acknowledged, at longer and longer intervals. Of more than fit, the oldest position
fix is dropped, whether it is under way or not: of where a target is, the latest counts.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Final, NamedTuple

from trackfield.wire.outside import Item

BACK_OFF: Final = 3
"""The time between two transmissions doubles so often."""


class Waiting(NamedTuple):
    """An item for one receiver, and whether it is a position fix."""

    to: str
    item: Item
    fix: bool


class Under(NamedTuple):
    """An item is under way: its ``number``, and how often anything was sent since the last acknowledgement."""

    number: int
    tries: int


@dataclass(frozen=True, slots=True)
class Queue:
    """The items, the oldest first, and which of them is under way, by receiver."""

    items: tuple[Waiting, ...] = ()
    under: Mapping[str, Under] = field(default_factory=dict)

    def first(self, to: str) -> Waiting | None:
        """What this receiver is to have next."""
        return next((one for one in self.items if one.to == to), None)

    def add(self, one: Waiting, most: int) -> tuple[Queue, int]:
        """With one more, and how many were dropped for it."""
        items = (*self.items, one)
        if len(items) <= most:
            return replace(self, items=items), 0
        lost = next((i for i, waiting in enumerate(self.items) if waiting.fix), 0)
        return replace(self, items=(*items[:lost], *items[lost + 1 :])), 1

    def acknowledged(self, to: str, number: int, life: int) -> Queue | None:
        """After its receiver has the item that it is to have next; None if this is another one."""
        first = self.first(to)
        if first is None or (first.item.number, first.item.life) != (number, life):
            return None
        return replace(self.heard(to), items=tuple(one for one in self.items if one is not first))

    def heard(self, to: str) -> Queue:
        """After a sign of life of this receiver: what is under way is sent at once, as if for the first time."""
        under = self.under.get(to)
        return replace(self, under={**self.under, to: under._replace(tries=0)}) if under else self

    def without(self, to: str, task: int) -> tuple[Queue, int]:
        """Without what waits for a receiver that no longer wants this class, and how many those were."""
        items = tuple(one for one in self.items if (one.to, one.item.task) != (to, task))
        return replace(self, items=items), len(self.items) - len(items)

    def sent(self, to: str, number: int) -> Queue:
        """After the first item of this receiver was sent."""
        tries = self.under[to].tries if to in self.under else 0
        return replace(self, under={**self.under, to: Under(number, tries + 1)})

    def resting(self, to: str) -> Queue:
        """Nothing is under way to this receiver."""
        return replace(self, under={one: under for one, under in self.under.items() if one != to})

    def patience_ns(self, to: str, patience_ns: int) -> int:
        """How long an acknowledgement is waited for after the last transmission."""
        return patience_ns << min(self.under[to].tries - 1, BACK_OFF)
