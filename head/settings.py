"""What a master is told: where it and the others stand, its slots and times, how it chooses."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from math import hypot

from trackfield.tracking.selection import POLICIES, Policy


@dataclass(frozen=True)
class Times:
    """When a master does what in a step, ns after its instant, as planned from the radio.

    Slaves report from the instant on, in up to ``slots`` slots of ``slot_ns``; what a master sends for its slaves takes
    ``gather_slots``. At ``beacon_ns`` beacons leave, with preambles that are ``preamble_ns`` longer. A hand-over that
    is not acknowledged after ``handover_ns`` has failed. ``frame_ns`` is the time that a frame takes, and ``late_ns``
    is how long after the end of its slot a report may arrive. Masters begin to ask for the time one after the other,
    from the base outwards, each ``clock_ns`` after the one before.
    """

    slot_ns: int
    slots: int
    gather_slots: int
    beacon_ns: int
    preamble_ns: int
    handover_ns: int
    frame_ns: int
    late_ns: int
    clock_ns: int


@dataclass(frozen=True)
class Settings:
    """How the master ``id`` works. ``masters`` (id, x m, y m) are all of the field, in a fixed order.

    Slaves that are woken stay awake for ``beacon_every`` steps. The leader shares its belief every ``share_every``
    steps, and tells the ``base`` every ``base_every`` steps. A leader that is silent for ``timeout_steps`` is dead.
    Beliefs are handed over as a Gaussian, or as ``particles`` where trackers have them.
    """

    id: str
    base: str
    base_x_m: float
    base_y_m: float
    masters: tuple[tuple[str, float, float], ...]
    times: Times
    policy: str = "merge_until_3"
    beacon_every: int = 10
    share_every: int = 2
    base_every: int = 1
    timeout_steps: int = 4
    particles: bool = False

    @cached_property
    def places(self) -> Mapping[str, tuple[float, float]]:
        """Where the masters stand."""
        return {id: (x, y) for id, x, y in self.masters}

    @cached_property
    def rank(self) -> int:
        """How many masters are nearer to the base."""
        x, y = self.base_x_m, self.base_y_m
        return sum(self.away(id, x, y) < self.away(self.id, x, y) for id in self.places)

    @cached_property
    def chooses(self) -> Policy:
        """The policy. Raises ``KeyError`` for an unknown name."""
        return POLICIES[self.policy]

    def away(self, id: str, x: float, y: float) -> tuple[float, str]:
        """The distance of a master from a place, and its id, which decides between equal ones."""
        mx, my = self.places[id]
        return hypot(mx - x, my - y), id
