"""Runs of one filter as arrays: the location-central protocol's choice of sensors, and the filter on what they read.

The filter is the tracker's own pure function (``Blackwell.advance``), for all runs of a batch at once; run r draws from
its own generator, as it would alone, so its track does not depend on the batch.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from launcher.reproduce.kernels.draws import generators, normals, stacked
from launcher.reproduce.papers.yu.truth import STEPS, Field, T, Truth, drawn
from trackfield.filters import rts
from trackfield.filters.blackwell import Blackwell, one
from trackfield.filters.gaussian import Motion
from trackfield.filters.rao_blackwell import Cloud, begin, by_mode, foreseen
from trackfield.filters.turning import Indices
from trackfield.filters.types import Array, Gaussian, Readings, Reports

PLAIN: Final = Field()


@dataclass(frozen=True)
class Case:
    """A filter in a field: how many ``sensors`` are chosen, how many steps it looks back (``lag``).

    With ``hands_over`` each new header gets a Gaussian for each mode; else the particles themselves. With
    ``draws_velocities`` particles hold velocities as well, and no Gaussians.
    """

    tracker: Blackwell
    sensors: int = 4
    lag: int = 0
    hands_over: bool = False
    draws_velocities: bool = False
    field: Field = PLAIN


class Tracks(NamedTuple):
    """Of R runs: ``means`` (R, T', n) and ``covariances`` of T' steps, of which ``truth`` (R, T', 4) is the truth.

    ``changes`` (R,) counts the headers that followed another. T' is less than the steps by the lag.
    """

    means: Array
    covariances: Array
    truth: Array
    changes: Array


def tracks(case: Case, runs: Sequence[int]) -> Tracks:
    """The tracks of these runs."""
    told, model, tracker = drawn(case.field, runs), case.field.model, case.tracker
    rngs, hands, speeds = (generators(runs, "yu", what) for what in ("filter", "hand-over", "velocities"))
    start, step = partial(tracker.start, model=model), partial(tracker.draws, model=model)
    cloud = begin(one(told.prior), stacked(start, rngs), tracker.turns)
    header, changes = np.full(len(runs), -1), np.zeros(len(runs))
    beliefs, motions = list[Gaussian](), list[Motion]()
    for t in range(STEPS):
        chosen = selected(cloud, told, t, case.sensors, tracker.silent)
        header, changed = sticky(header, chosen)
        changes += changed
        if case.hands_over:
            cloud = handed(cloud, case, hands, changed)
        draws = [stacked(step, rngs) for _ in range(tracker.looks)]
        then = cloud.points.mean(axis=-2)
        cloud, posterior = tracker.advance(cloud, reports_of(told, t, chosen), model, T, draws[0], draws[-1])
        if case.draws_velocities:
            cloud = with_velocities(cloud, normals(speeds, tracker.particles, 2))
        beliefs.append(posterior)
        motions.append(foreseen(then, cloud.rate, model, T, tracker.density(model, T)))
    means, covariances = (np.stack(parts, axis=1) for parts in zip(*beliefs, strict=True))
    if case.lag:
        F, Q = (np.stack(parts, axis=1) for parts in zip(*motions, strict=True))
        means, covariances = looked_back(Gaussian(means, covariances), Motion(F[:, 1:], Q[:, 1:]), case.lag)
    return Tracks(means, covariances, told.path[:, 1 : STEPS + 1 - case.lag], changes)


def with_velocities(cloud: Cloud, normals: Array) -> Cloud:
    """The same with velocities drawn, too, which makes it a bootstrap filter with modes."""
    points = cloud.points.copy()
    points[..., 2:4] += np.sqrt(cloud.variance)[..., None] * normals
    return cloud._replace(points=points, variance=np.zeros_like(cloud.variance))


# --- the protocol -----------------------------------------------------------------------------------------------------


def selected(cloud: Cloud, told: Truth, t: int, count: int, silent: int) -> Indices:
    """The sensors (R, count) of step ``t`` for these particles, which start anew after ``silent`` steps; 0: never."""
    anew = cloud.silent >= silent if silent else np.zeros(cloud.silent.shape, bool)
    return taking_part(cloud.points.mean(axis=-2), told, t, count, anew)


def taking_part(mean: Array, told: Truth, t: int, count: int, anew: npt.NDArray[np.bool_]) -> Indices:
    """The sensors (R, count) nearest to where a target of state ``mean`` (R, n) is a step later, the nearest first.

    Where a track starts ``anew`` (R,) these are the loudest of the field instead.
    """
    expected, readings = mean[:, :2] + T * mean[:, 2:4], told.readings[:, t]
    away = np.square(told.places - expected[:, None]).sum(axis=-1)
    away = np.where(anew[:, None], -np.where(np.isnan(readings), -np.inf, readings), away)
    return np.asarray(np.argsort(away, axis=-1, kind="stable")[:, :count])


def reports_of(told: Truth, t: int, chosen: Indices) -> Reports:
    """What the chosen sensors (R, K) read in step ``t``; NaN of those that hear nothing."""
    places = np.take_along_axis(told.places, chosen[..., None], axis=1)
    values = np.take_along_axis(told.readings[:, t], chosen, axis=1)[..., None]
    return Reports(t + 1, (), places, (Readings("energy", values),))


def sticky(header: Indices, chosen: Indices) -> tuple[Indices, Array]:
    """The processing headers (R,) among the chosen, and where they are new: one stays as long as it is chosen."""
    stays = (chosen == header[:, None]).any(axis=-1)
    return np.where(stays, header, chosen[:, 0]), ~stays & (header >= 0)


def handed(cloud: Cloud, case: Case, rngs: Sequence[np.random.Generator], changed: Array) -> Cloud:
    """The particles as a new header draws them from a Gaussian for each mode, in the runs (R,) where it is new."""
    tracker, model = case.tracker, case.field.model
    which = np.flatnonzero(changed)
    if not len(which):
        return cloud
    some = Cloud._make(part[which] for part in cloud)
    draws = stacked(partial(tracker.start, model=model), [rngs[int(run)] for run in which])
    anew = begin(by_mode(some), draws, tracker.turns)._replace(silent=some.silent)
    whole = Cloud._make(part.copy() for part in cloud)
    for part, new in zip(whole, anew, strict=True):
        part[which] = new
    return whole


# --- looking back -----------------------------------------------------------------------------------------------------


def looked_back(filtered: Gaussian, motions: Motion, lag: int) -> Gaussian:
    """The beliefs (R, T - lag, n) of each step given the ``lag`` steps after it, as ``tracking.smoothing`` has them."""
    means, covariances = (_windows(part, lag + 1) for part in filtered)
    F, Q = (_windows(part, lag) for part in motions)
    mean, covariance = rts.smooth(Gaussian(means, covariances), Motion(F, Q))
    return Gaussian(mean[:, :, 0], covariance[:, :, 0])


def _windows(part: Array, length: int) -> Array:
    """(R, T - length + 1, length, ...) of (R, T, ...)."""
    return np.moveaxis(np.lib.stride_tricks.sliding_window_view(part, length, axis=1), -1, 2)
