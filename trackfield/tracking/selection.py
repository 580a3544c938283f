"""Choice of sensors: which clusters a leader wakes for the next step, by policies that a scenario names.

Özfidan et al. (2018), eqs. 16 and 17, choose the master that is closest to the estimate; its slaves measure at the next
step. A cluster without sensors, or with one, blinds the tracker and is never left, as the estimate stays where it is:
``merge_until_3`` wakes the next-nearest clusters, too, until three sensors measure. The other policies choose single
sensors, or the cluster whose readings would leave the smallest covariance.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple, Protocol

import numpy as np

from trackfield.filters.measurement import jacobians, log_noise_slopes, noise_sd, owners, varies
from trackfield.filters.types import Array, Gaussian, Model, Reports

FEWEST: Final = 3
"""So many sensors measure at least, by ``merge_until_3``: with fewer a range leaves two places, or a curve of them."""
HYSTERESIS: Final = 0.2
"""By so much the trace of another cluster's covariance must be smaller to leave the one that measures now."""


@dataclass(frozen=True)
class Cluster:
    """A master ``id`` at ``place`` (m east, north), and the ids of the slaves that are its ``members``."""

    id: str
    place: tuple[float, float]
    members: tuple[str, ...]


class Choice(NamedTuple):
    """The cluster that leads, and the sensors that measure at the next step, cluster by cluster."""

    leader: str
    sensors: Mapping[str, tuple[str, ...]]

    @property
    def measuring(self) -> int:
        """How many sensors measure."""
        return sum(map(len, self.sensors.values()))


@dataclass(frozen=True)
class Grounds:
    """What a policy goes by.

    ``estimate`` (n,) is the mean of the belief at this step, ``ahead`` the belief predicted to the next one;
    ``information`` gives D (K, n, n) of the readings of some sensors about a state (n,), each by itself.
    """

    clusters: Sequence[Cluster]
    estimate: Array
    ahead: Gaussian
    positions: Mapping[str, tuple[float, float]]
    information: Callable[[Sequence[str], Array], Array]
    leader: str = ""
    """The cluster that leads now; empty: none does."""

    def by_distance(self) -> list[Cluster]:
        """The clusters, the one whose master is nearest to the estimate first; of equals the first."""
        places = np.array([one.place for one in self.clusters])
        away = np.hypot(*(places - self.estimate[:2]).T)
        return [self.clusters[i] for i in np.argsort(away, kind="stable")]

    def each(self) -> list[tuple[Cluster, str]]:
        """Each sensor with its cluster."""
        return [(one, id) for one in self.clusters for id in one.members]


class Policy(Protocol):
    """A way to choose; of the same grounds it makes the same choice."""

    def choose(self, grounds: Grounds) -> Choice:
        """Who leads and who measures at the next step."""
        ...


@dataclass(frozen=True)
class Closest:
    """The cluster whose master is closest to the estimate (Özfidan et al., eqs. 16 and 17: closest point activate).

    Those that are next-nearest are woken, too, until at least ``fewest`` sensors measure.
    """

    fewest: int = 0

    def choose(self, grounds: Grounds) -> Choice:
        """See ``Policy``."""
        nearest = grounds.by_distance()
        woken = {nearest[0].id: nearest[0].members}
        for one in nearest[1:]:
            if sum(map(len, woken.values())) >= self.fewest:
                break
            if one.members:
                woken[one.id] = one.members
        return Choice(nearest[0].id, woken)


@dataclass(frozen=True)
class All:
    """Every sensor, whatever the target: no scheduling."""

    def choose(self, grounds: Grounds) -> Choice:
        """See ``Policy``."""
        return Choice(grounds.by_distance()[0].id, {one.id: one.members for one in grounds.clusters if one.members})


@dataclass(frozen=True)
class NearestK:
    """The ``k`` sensors that are nearest to where the target will be."""

    k: int = 4

    def choose(self, grounds: Grounds) -> Choice:
        """See ``Policy``."""
        each = grounds.each()
        places = np.array([grounds.positions[id] for _, id in each]).reshape(-1, 2)
        away = np.hypot(*(places - grounds.ahead.mean[:2]).T)
        return _of([each[i] for i in np.argsort(away, kind="stable")[: self.k]], grounds)


@dataclass(frozen=True)
class InformationK:
    """The ``k`` sensors, one after the other, that leave the smallest covariance of the predicted position."""

    k: int = 2

    def choose(self, grounds: Grounds) -> Choice:
        """See ``Policy``."""
        each = grounds.each()
        if not each:
            return _of([], grounds)
        D = grounds.information([id for _, id in each], grounds.ahead.mean)
        J, taken, left = np.linalg.inv(grounds.ahead.covariance), list[int](), list(range(len(each)))
        while left and len(taken) < self.k:
            best = left.pop(int(np.argmin(traces(J + D[left]))))
            J = J + D[best]
            taken.append(best)
        return _of([each[i] for i in taken], grounds)


@dataclass(frozen=True)
class Trace:
    """The cluster that leaves the smallest covariance of the predicted position.

    The one that leads stays until another one's trace is smaller by the share ``hysteresis``.
    """

    hysteresis: float = HYSTERESIS

    def choose(self, grounds: Grounds) -> Choice:
        """See ``Policy``."""
        J = np.linalg.inv(grounds.ahead.covariance)
        able = [one for one in grounds.clusters if one.members]
        if not able:
            return _of([], grounds)
        ids = [id for one in able for id in one.members]
        D, ends = grounds.information(ids, grounds.ahead.mean), np.cumsum([len(one.members) for one in able])
        sums = np.array([part.sum(axis=0) for part in np.split(D, ends[:-1])])
        left = traces(J + sums)
        best = int(np.argmin(left))
        for i, one in enumerate(able):
            if one.id == grounds.leader and left[best] > (1.0 - self.hysteresis) * left[i]:
                best = i
        return Choice(able[best].id, {able[best].id: able[best].members})


POLICIES: Final[Mapping[str, Policy]] = {
    "closest": Closest(),
    "merge_until_3": Closest(FEWEST),
    "all": All(),
    "nearest_4": NearestK(4),
    "nearest_5": NearestK(5),
    "information_2": InformationK(2),
    "information_4": InformationK(4),
    "information_5": InformationK(5),
    "trace": Trace(),
}
"""By the names that scenarios have for them."""


def _of(chosen: Sequence[tuple[Cluster, str]], grounds: Grounds) -> Choice:
    """The choice of single sensors; the cluster whose master is nearest to the estimate leads."""
    woken: dict[str, tuple[str, ...]] = {}
    for cluster, id in chosen:
        woken[cluster.id] = (*woken.get(cluster.id, ()), id)
    return Choice(grounds.by_distance()[0].id, woken)


def traces(J: Array) -> Array:
    """The trace (...,) of the position's covariance by information J (..., n, n)."""
    found: Array = np.trace(np.linalg.inv(J)[..., :2, :2], axis1=-2, axis2=-1)
    return found


def informations(model: Model, state: Array, reports: Reports) -> Array:
    """D (K, n, n) of each report of ``reports`` about a state (n,); readings of different sensors are independent.

    H^T R^-1 H, and where the noise depends on the state half the squared slopes of log R (Kay 1993, eq. 3.31).
    """
    of, n = owners(model, reports), len(state)
    rows = jacobians(model, state, reports) / noise_sd(model, reports, state)[:, None]
    parts = rows[:, :, None] * rows[:, None, :]
    if varies(model):
        slopes = log_noise_slopes(model, state, reports)
        parts += 0.5 * slopes[:, :, None] * slopes[:, None, :]
    found = np.zeros((len(reports.sensors), n, n))
    np.add.at(found, of, parts)
    return found
