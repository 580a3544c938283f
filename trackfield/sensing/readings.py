"""Readings of sensors, and the windows in which they may read anything: the same for all kinds of sensing."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass
from math import inf
from typing import Any, Protocol, Self

from trackfield.wire.messages import Measurement
from trackfield.wire.registry import Number, kind_of_class

Window = tuple[int, int]
"""(from ns, to ns), both included, in true time since the start of the run."""


class Reading(Protocol):
    """What a sensor read at an instant."""

    @property
    def values(self) -> tuple[float, ...]:
        """Its numbers, in the units of its kind."""
        ...

    @property
    def level(self) -> float:
        """What is compared with the threshold of its node; infinite for kinds that have none."""
        ...

    def report(self, step: int, early_ns: int = 0) -> Any:
        """The message that reports it for a step, whose instant is ``early_ns`` later."""
        ...


@dataclass(frozen=True, slots=True)
class Measured:
    """A reading in whole ``steps`` of its kind's resolutions; ``values`` are in the kind's units.

    If it is ``timed``, its report says how long before the step it was made: one more number, in microseconds.
    """

    steps: tuple[int, ...]
    values: tuple[float, ...]
    level: float = inf
    timed: bool = False

    def report(self, step: int, early_ns: int = 0) -> Measurement:
        """The message that reports it for a step, whose instant is ``early_ns`` later."""
        return Measurement(step, (*self.steps, early_ns // 1000) if self.timed else self.steps)


@dataclass(frozen=True, slots=True)
class Said:
    """A reading whose numbers are the fields of its ``message`` after the step."""

    message: type
    values: tuple[float, ...]
    level: float = inf

    @classmethod
    def limited(cls, message: type, values: Sequence[float]) -> Self:
        """The reading of these numbers, each limited to what a ``message`` holds (docs/wire.md)."""
        limits = (field.scaled for field in kind_of_class(message).fields[1:] if isinstance(field, Number))
        return cls(message, tuple(min(max(v, one.low), one.high) for v, one in zip(values, limits, strict=True)))

    def report(self, step: int, early_ns: int = 0) -> Any:
        """The message that reports it."""
        return self.message(step, *self.values)


class Ears(Protocol):
    """The interface of a sensor to its node; times are true."""

    def sample(self, t_ns: int) -> Reading | None:
        """The reading at this time; None if nothing is heard."""
        ...

    def next_window(self, t_ns: int) -> int | None:
        """The start (ns) of the window that this time lies in, or else of the next; None after the last."""
        ...


def window_at(windows: Sequence[Window], t_ns: int) -> int | None:
    """The start (ns) of the window that this time lies in, or else of the next; None after the last."""
    i = bisect_left(windows, t_ns, key=lambda window: window[1])
    return windows[i][0] if i < len(windows) else None
