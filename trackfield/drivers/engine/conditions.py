"""Conditions of a process that do not depend on its role: its lifespan, faults, battery and radio."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Final, NamedTuple

from trackfield.drivers.engine.frames import FREE, Frame
from trackfield.link.energy import Power
from trackfield.link.fate import FIELD, Fate

NEVER: Final = 1 << 62
"""Later than any time."""

Sense = Callable[[str, int], Any]
"""Reads the sensor of this name at a true time (ns)."""
QUEUE: Final = 32
"""How many frames may wait for a radio."""
MAINS: Final = Power(0, 0, 0, 0)
"""A device whose energy is not counted."""


class At(NamedTuple):
    """A sensor's answer that is a true time; the role sees it on its own clock. It costs no energy."""

    true_ns: int | None


def _free(frame: Frame) -> Fate:
    """No radio: a frame occupies nothing and costs nothing."""
    return FREE


@dataclass(frozen=True, slots=True)
class Conditions:
    """Times are true, in ns.

    The life is [``start_ns``, ``kill_ns``). During each of the ``freezes`` (from, until), disjoint and in order, no
    frame is received, and timers wait for its end. At each of the ``jumps`` (at, by), in order, the clock is put
    forward by that amount. ``cost`` gives a frame's cost for its sender. ``powers`` are its devices by medium: the one
    of the field has the battery; a medium without one costs no energy. ``queues`` say how many frames may wait for the
    radio of a medium.
    """

    start_ns: int = 0
    kill_ns: int = NEVER
    freezes: tuple[tuple[int, int], ...] = ()
    jumps: tuple[tuple[int, int], ...] = ()
    powers: Mapping[str, Power] = field(default_factory=lambda: {FIELD: MAINS})
    queues: Mapping[str, int] = field(default_factory=dict)
    cost: Callable[[Frame], Fate] = _free

    def thaw_ns(self, t_ns: int) -> int:
        """This time, or the end of the freeze that contains it."""
        return next((until for begin, until in self.freezes if begin <= t_ns < until), t_ns)

    @property
    def battery_fj(self) -> int | None:
        """What its battery holds; None on mains."""
        return self.powers[FIELD].battery_fj

    def air_ns(self, frame: Frame, fate: Fate) -> int:
        """A frame's time on air, over all its fragments and repeats; 0 if it found no free channel."""
        power = self.powers.get(frame.medium)
        if fate.busy_ns or power is None:
            return fate.air_ns
        return (len(frame.payload) + power.overhead_bytes) * power.byte_ns + frame.preamble_ns
