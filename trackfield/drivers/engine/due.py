"""What is still to come to a process, in order; anything can be taken out again."""

from __future__ import annotations

from collections.abc import Iterator
from heapq import heappop, heappush

from trackfield.drivers.engine.frames import EventKey, Input


class Due:
    """Inputs by their keys, the first of which is known at any time."""

    __slots__ = ("_inputs", "_order")

    def __init__(self) -> None:
        self._inputs: dict[EventKey, Input] = {}
        self._order: list[EventKey] = []

    def add(self, key: EventKey, one: Input) -> None:
        """Add an input with its key."""
        self._inputs[key] = one
        heappush(self._order, key)

    def remove(self, key: EventKey) -> bool:
        """Take out the input of this key; False if there is none."""
        return self._inputs.pop(key, None) is not None

    def first(self) -> EventKey | None:
        """The key of the first."""
        while self._order and self._order[0] not in self._inputs:
            heappop(self._order)
        return self._order[0] if self._order else None

    def pop(self) -> Input:
        """Take out the first. Raises ``IndexError`` if there is none."""
        key = self.first()
        if key is None:
            raise IndexError("nothing is due")
        heappop(self._order)
        return self._inputs.pop(key)

    def __iter__(self) -> Iterator[Input]:
        return iter(self._inputs.values())
