"""Who leads and who measures at a step of a field of masters with slaves, if trackers know the true path."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Final, NamedTuple

import numpy as np

from launcher.plan.forecast.masters.association import GOOD, Association
from launcher.records import SENSES, Plan, Schedule
from trackfield.filters.types import Array, Gaussian
from trackfield.link.fate import Link
from trackfield.role import NS
from trackfield.tracking.following import ANYWHERE
from trackfield.tracking.selection import POLICIES, Choice, Closest, Cluster, Grounds, NearestK, Policy

HEARD_BYTES: Final = 24
"""As long as what leaders ask of other masters."""


class Turn(NamedTuple):
    """At a step ``leader`` leads, and the ``sensors`` of these clusters measure; ``slots`` are theirs by id.

    ``gathered`` is by other masters the slot after those of their slaves.
    """

    step: int
    t_ns: int
    leader: str
    sensors: Mapping[str, tuple[str, ...]]
    slots: Mapping[str, int]
    gathered: Mapping[str, int]


@dataclass(frozen=True)
class Turns:
    """The turns of a plan, one step after the other.

    A leader chooses among the masters that it hears and that hear it. Policies that need covariances are replaced by
    those that go by distance: ``information_k`` by the ``k`` nearest sensors, ``trace`` by the closest cluster.
    """

    plan: Plan
    schedule: Schedule
    link: Link
    association: Association
    _known: dict[int, Turn] = field(default_factory=dict)

    def at(self, step: int) -> Turn | None:
        """The turn of a step; None if nobody measures. What came before it is worked out if the step before was."""
        if step not in self._known:
            turn = self._turn(step)
            if turn is None:
                return None
            self._known[step] = turn
        return self._known[step]

    def _turn(self, step: int) -> Turn | None:
        """As the leader of the step before chooses, or, if that is not known, the nearest master."""
        now, ahead = self._where(step - 1), self._where(step)
        if now is None or ahead is None:
            return None
        before = self._known.get(step - 1)
        clusters = self.association.clusters if before is None else self._near[before.leader]
        leader = self._choice(clusters, now, ahead, "" if before is None else before.leader).leader
        choice = self._choice(self._near[leader], now, ahead, leader)
        order = sorted(choice.sensors.items(), key=lambda one: one[0] != leader)
        slot, slots, gathered = 0, dict[str, int](), dict[str, int]()
        for id, sensors in order:
            slots |= {sensor: slot + i for i, sensor in enumerate(sensors)}
            slot += len(sensors)
            if id != leader:
                gathered[id] = slot
                slot += self.schedule.gather_slots
        return Turn(step, self.plan.origin_ns + step * self.plan.step_ns, leader, dict(order), slots, gathered)

    def _choice(self, clusters: Sequence[Cluster], now: Array, ahead: Array, leader: str) -> Choice:
        grounds = Grounds(clusters, now, Gaussian(ahead, ANYWHERE), self.positions, _none, leader)
        return self._policy.choose(grounds)

    def _where(self, step: int) -> Array | None:
        """Where the first of the targets is that are there (4,); None if none is."""
        at_s = (self.plan.origin_ns + step * self.plan.step_ns) / NS
        states = (path.at(at_s) for path in self.plan.paths.values())
        return next((np.asarray(state, float) for state in states if state is not None), None)

    @cached_property
    def _policy(self) -> Policy:
        kind, _, k = self.schedule.policy.rpartition("_")
        if kind == "information":
            return NearestK(int(k))
        return Closest(1) if self.schedule.policy == "trace" else POLICIES[self.schedule.policy]

    @cached_property
    def positions(self) -> dict[str, tuple[float, float]]:
        """Where the sensors are."""
        return {place.id: (place.x, place.y) for place in self.plan.info.tagged(SENSES)}

    @cached_property
    def _near(self) -> Mapping[str, Sequence[Cluster]]:
        return _Near(self.link, self.association.clusters)


class _Near(dict[str, Sequence[Cluster]]):
    """The clusters of whose masters a leader hears, and which hear it; worked out when it leads."""

    def __init__(self, link: Link, clusters: Sequence[Cluster]) -> None:
        self._link, self._clusters = link, clusters

    def __missing__(self, leader: str) -> Sequence[Cluster]:
        self[leader] = [one for one in self._clusters if one.id == leader or self._both(leader, one.id)]
        return self[leader]

    def _both(self, one: str, other: str) -> bool:
        ways = ((one, other), (other, one))
        return all(self._link.reception(src, dst, HEARD_BYTES) >= GOOD for src, dst in ways)


def _none(sensors: Sequence[str], state: Array) -> Array:
    """Policies that go by distance ask for no information."""
    raise NotImplementedError
