"""Which master each slave is expected to have, and which slaves find none.

Özfidan et al. (2018), Table I: each slave, in the order of their numbers, has the nearest master with a place left.
Here it must also be one that it hears, and that hears it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import hypot
from typing import Final, NamedTuple

import numpy as np

from launcher.records import SENSES, Place, Plan, Schedule
from trackfield.link.fate import Link
from trackfield.protocols.association.joining import TRIES
from trackfield.tracking.selection import Cluster

GOOD: Final = 0.5
"""A link that delivers less than this share of its messages is no link to a master."""
NO_MASTER: Final = "no master in reach"
FULL: Final = "all in reach are full"


class Asked(NamedTuple):
    """A slave asks this ``master``, so often until it is answered or gives up, and is answered so often."""

    master: str
    joins: int
    answers: int


@dataclass(frozen=True)
class Association:
    """The ``masters`` of slaves by id, ``orphans`` with the reason, and whom each slave asked.

    ``references`` are those who set the clocks of masters.
    """

    masters: Mapping[str, str]
    orphans: Mapping[str, str]
    asked: Mapping[str, Sequence[Asked]]
    references: Mapping[str, str]
    clusters: Sequence[Cluster]

    def why(self, reason: str) -> int:
        """How many orphans there are for this reason."""
        return sum(one == reason for one in self.orphans.values())


def associated(plan: Plan, schedule: Schedule, link: Link, sizes: Mapping[str, int]) -> Association:
    """The expected one; ``sizes`` are the bytes of messages by kind."""
    sensors = plan.info.tagged(SENSES)
    free = {id: schedule.capacity for id, _, _ in schedule.masters}
    masters, orphans, asked = dict[str, str](), dict[str, str](), dict[str, list[Asked]]()
    for place, order in zip(sensors, _orders(sensors, schedule), strict=True):
        asked[place.id] = found = []
        for id in order:
            if not free[id] or not _announced(link, sizes, id, place.id):
                continue
            up = link.reception(place.id, id, sizes["join"], "join")
            both = up * link.reception(id, place.id, sizes["admit"], "admit")
            joins = max(round(sum((1 - both) ** i for i in range(TRIES))), 1)
            found.append(Asked(id, joins, round(joins * up)))
            if both >= GOOD:
                masters[place.id], free[id] = id, free[id] - 1
                break
        else:
            near = (id for id in order if not free[id] and _announced(link, sizes, id, place.id))
            orphans[place.id] = FULL if any(_joins(link, sizes, place.id, id) for id in near) else NO_MASTER
    members = {id: tuple(one for one, master in masters.items() if master == id) for id in free}
    clusters = [Cluster(id, (x, y), members[id]) for id, x, y in schedule.masters]
    return Association(masters, orphans, asked, _references(plan, schedule, link, sizes), clusters)


def _orders(sensors: Sequence[Place], schedule: Schedule) -> list[list[str]]:
    """Of each sensor the masters, the nearest first."""
    at = np.array([(place.x, place.y) for place in sensors], float)
    stand = np.array([place for _, *place in schedule.masters], float)
    away = np.hypot(*np.moveaxis(at[:, None] - stand, -1, 0))
    ids = [id for id, _, _ in schedule.masters]
    return [[ids[i] for i in row] for row in np.argsort(away, axis=1, kind="stable").tolist()]


def _announced(link: Link, sizes: Mapping[str, int], master: str, other: str) -> bool:
    """Whether half of what a master announces is heard."""
    return link.reception(master, other, sizes["announce"], "announce") >= GOOD


def _joins(link: Link, sizes: Mapping[str, int], sensor: str, master: str) -> bool:
    up = link.reception(sensor, master, sizes["join"], "join")
    return up * link.reception(master, sensor, sizes["admit"], "admit") >= GOOD


def _references(plan: Plan, schedule: Schedule, link: Link, sizes: Mapping[str, int]) -> dict[str, str]:
    """Each master asks the one of those that it hears that is nearest to the base, or else the base."""
    base = next(place for place in plan.info.places if place.id == schedule.base)
    away = sorted((hypot(x - base.x, y - base.y), id) for id, x, y in schedule.masters)
    ranked = [schedule.base, *(id for _, id in away)]
    return {
        id: next((one for one in ranked if one != id and _announced(link, sizes, one, id)), schedule.base)
        for id in ranked[1:]
    }
