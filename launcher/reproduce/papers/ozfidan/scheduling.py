"""The policies of ``trackfield.tracking.selection`` for many runs at once: who measures, as numbers of slaves.

A choice is an array (R, K) of the numbers of slaves, padded with ``NOBODY``, and the leaders (R,). A test has both make
the same choices.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from launcher.reproduce.papers.ozfidan.field import NOBODY, Truth
from trackfield.filters.gate import Indices
from trackfield.filters.types import Array, Gaussian
from trackfield.tracking.selection import FEWEST, HYSTERESIS

Flags = npt.NDArray[np.bool_]


class Chosen(NamedTuple):
    """The ``slaves`` (R, K) that measure, and the ``leader`` (R,)."""

    slaves: Indices
    leader: Indices


class Scene(NamedTuple):
    """What a policy goes by: the ``estimate`` (R, 4), the belief ``ahead``, and the leaders (R,) of the step.

    ``information`` gives D (R, S, 4, 4) of the readings of all slaves about states (R, 4).
    """

    truth: Truth
    estimate: Array
    ahead: Gaussian
    leader: Indices
    information: Callable[[Array], Array]


Policy = Callable[[Scene], Chosen]


def closest(scene: Scene, fewest: int = 0) -> Chosen:
    """The slaves of the closest master; with ``fewest`` also those of the next ones, until so many measure."""
    truth = scene.truth
    order = np.argsort(_away(truth.masters, scene.estimate), axis=1, kind="stable")
    rank = np.argsort(order, axis=1)  # of each master
    theirs = np.take_along_axis(rank, np.where(truth.owner == NOBODY, 0, truth.owner), axis=1)
    theirs = np.where(truth.owner == NOBODY, order.shape[1], theirs)
    counts = np.stack([np.bincount(one, minlength=order.shape[1] + 1)[:-1] for one in theirs])
    before = np.cumsum(counts, axis=1) - counts  # that measure without this master's and those farther away
    last = np.maximum((before < fewest).sum(axis=1), 1)  # so many masters wake theirs
    return Chosen(listed(theirs < last[:, None], theirs), order[:, 0])


def nearest(scene: Scene, k: int) -> Chosen:
    """The ``k`` slaves that are nearest to where the target will be."""
    away = np.where(scene.truth.owner == NOBODY, np.inf, _away(scene.truth.slaves, scene.ahead.mean))
    return Chosen(np.argsort(away, axis=1, kind="stable")[:, :k], _leader(scene))


def everybody(scene: Scene) -> Chosen:
    """All slaves that have a master."""
    owner = scene.truth.owner
    return Chosen(listed(owner != NOBODY, owner), _leader(scene))


def informative(scene: Scene, k: int) -> Chosen:
    """The ``k`` slaves, one after the other, that leave the smallest covariance of the position."""
    D = scene.information(scene.ahead.mean)
    J = _inverse(scene.ahead.covariance)
    free, runs, found = scene.truth.owner != NOBODY, np.arange(len(J)), []
    for _ in range(k):
        left = np.where(free, _traces(J[:, None] + D), np.inf)
        best = left.argmin(axis=1)
        J = J + D[runs, best]
        free[runs, best] = False
        found.append(best)
    return Chosen(np.stack(found, axis=1), _leader(scene))


def smallest_trace(scene: Scene, hysteresis: float = HYSTERESIS) -> Chosen:
    """The slaves of the master whose readings leave the smallest covariance, if that is by enough the smallest."""
    truth, runs = scene.truth, np.arange(len(scene.estimate))
    D = scene.information(scene.ahead.mean)
    sums = np.zeros((*truth.masters.shape[:2], 4, 4))
    run, slave = np.nonzero(truth.owner != NOBODY)
    np.add.at(sums, (run, truth.owner[run, slave]), D[run, slave])
    able = sums[..., 0, 0] + sums[..., 1, 1] > 0.0
    left = np.where(able, _traces(_inverse(scene.ahead.covariance)[:, None] + sums), np.inf)
    best = left.argmin(axis=1)
    stays = left[runs, best] > (1.0 - hysteresis) * left[runs, scene.leader]
    leader = np.where((scene.leader != NOBODY) & stays, scene.leader, best)
    return Chosen(listed(truth.owner == leader[:, None], truth.owner), leader)


POLICIES: Final[dict[str, Policy]] = {
    "closest": closest,
    "merge_until_3": lambda scene: closest(scene, FEWEST),
    "nearest_4": lambda scene: nearest(scene, 4),
    "nearest_5": lambda scene: nearest(scene, 5),
    "information_2": lambda scene: informative(scene, 2),
    "information_4": lambda scene: informative(scene, 4),
    "trace": smallest_trace,
    "all": everybody,
}
"""By the names that scenarios have for them."""


def _away(places: Array, state: Array) -> Array:
    """(R, N) m from places (R, N, 2) to states (R, 4)."""
    return np.asarray(np.hypot(*(places - state[:, None, :2]).transpose(2, 0, 1)))


def _leader(scene: Scene) -> Indices:
    return np.asarray(_away(scene.truth.masters, scene.estimate).argmin(axis=1))


def _inverse(matrices: Array) -> Array:
    return np.asarray(np.linalg.inv(matrices), float)


def _traces(J: Array) -> Array:
    return np.asarray(np.trace(_inverse(J)[..., :2, :2], axis1=-2, axis2=-1))


def listed(some: Flags, order: Indices) -> Indices:
    """The numbers (R, K) of those that are chosen (R, N), in this order, padded with ``NOBODY``."""
    most = max(int(some.sum(axis=1).max()), 1)
    first = np.argsort(np.where(some, order, order.max() + 1), axis=1, kind="stable")[:, :most]
    return np.where(np.take_along_axis(some, first, axis=1), first, NOBODY)
