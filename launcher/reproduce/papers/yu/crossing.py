"""Two targets that cross: what they emit adds up at sensors (Yu et al. 2009, eq. 1); one stacked filter for both."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from launcher.reproduce.kernels.draws import generators, normals, stacked
from launcher.reproduce.papers.yu.truth import NOISE, PRIOR_SD, SENSORS, SIZE_M, STEPS, Field, T, paths
from trackfield.filters import stacked as filters
from trackfield.filters.blackwell import one
from trackfield.filters.jm_rbpf import JmRbpf
from trackfield.filters.metrics import Lost
from trackfield.filters.rao_blackwell import Draws, Start, begin
from trackfield.filters.turning import Indices
from trackfield.filters.types import Array, Gaussian, Model

STARTS: Final = ((300.0, 300.0, 5.0, 5.0), (300.0, 800.0, 5.0, -5.0))
"""Both come to (550, 550) after 50 s, at right angles, but for their noise."""
EACH: Final = 4
"""Sensors for each target."""
TARGETS: Final = len(STARTS)


class Crossing(NamedTuple):
    """R runs: ``means`` and ``truth`` (R, K, T, 2), the positions of each target."""

    means: Array
    truth: Array


class Held(NamedTuple):
    """Of each run (R,): whether a target was lost, and whether the tracks ended on each other's target instead."""

    lost: npt.NDArray[np.bool_]
    swapped: npt.NDArray[np.bool_]


def crossings(tracker: JmRbpf, field: Field, runs: Sequence[int]) -> Crossing:
    """The tracks of these runs."""
    kind, model = field.kind, field.model
    fields, rngs = (generators(runs, "yu", "crossing", what) for what in ("truth", "filter"))
    places = np.stack([rng.uniform(0.0, SIZE_M, (SENSORS, 2)) for rng in fields])
    kicks, still = normals(fields, TARGETS, STEPS, 2, 2), np.zeros(STEPS)
    path = np.stack([paths(kicks[:, k], NOISE, start, still) for k, start in enumerate(STARTS)], axis=1)
    readings = _readings(field, path, places, normals(fields, STEPS, SENSORS))
    off = normals(fields, TARGETS, 5)
    log_s = np.full((len(runs), TARGETS, 1), model.unknowns[0].mean)
    means = np.concatenate((path[:, :, 0], log_s), axis=-1) + off * PRIOR_SD
    prior = Gaussian(means, np.broadcast_to(np.diag(np.square(PRIOR_SD)), (*means.shape, 5)))
    start, step = partial(starts, tracker, model), partial(steps, tracker, model)
    cloud, found = begin(one(prior), stacked(start, rngs), tracker.turns), []
    for t in range(STEPS):
        mean = cloud.points.mean(axis=-2)
        chosen = nearest(places, mean[..., :2] + T * mean[..., 2:4])
        at = np.take_along_axis(places, chosen[..., None], axis=1)
        told = np.take_along_axis(readings[:, t], chosen, axis=1)
        cloud, posterior = filters.advance(tracker, kind, cloud, told, at, model, T, stacked(step, rngs))
        found.append(posterior.mean[..., :2])
    return Crossing(np.stack(found, axis=2), path[:, :, 1:, :2])


def starts(tracker: JmRbpf, model: Model, rng: np.random.Generator) -> Start:
    """The random numbers of a start for each target."""
    return stacked(partial(tracker.start, model=model), [rng] * TARGETS)


def steps(tracker: JmRbpf, model: Model, rng: np.random.Generator) -> Draws:
    """The random numbers of a step for each target, with one for resampling."""
    draws = stacked(partial(tracker.draws, model=model), [rng] * TARGETS)
    return draws._replace(u=np.full(TARGETS, np.asarray(draws.u)[0]))


def nearest(places: Array, expected: Array) -> Indices:
    """``EACH`` sensors (R, K EACH) for each target: those whose rank among the nearest to any is best."""
    away = np.square(places[:, None] - expected[:, :, None]).sum(axis=-1)
    ranks = np.argsort(np.argsort(away, axis=-1), axis=-1).min(axis=1)
    return np.asarray(np.argsort(ranks, axis=-1, kind="stable")[:, : TARGETS * EACH])


def held(tracks: Crossing, rule: Lost) -> Held:
    """Who is lost, each step judged by the assignment of tracks to targets that fits it better; who ends swapped."""
    straight, crossed = tracks.means - tracks.truth, tracks.means - tracks.truth[:, ::-1]
    other = np.square(crossed).sum(axis=(1, 3)) < np.square(straight).sum(axis=(1, 3))
    lost = rule.holds(np.where(other[:, None, :, None], crossed, straight)).any(axis=-1)
    return Held(np.asarray(lost), other[:, -1] & ~lost)


def _readings(field: Field, path: Array, places: Array, normals: Array) -> Array:
    """(R, T, S), NaN where no target is in range."""
    kind = field.kind
    away = np.linalg.norm(path[:, :, 1:, None, :2] - places[:, None, None], axis=-1)
    received = (kind.gain * kind.emitted * np.maximum(away, kind.floor_m) ** -kind.alpha).sum(axis=1)
    found = received + np.sqrt(kind.variance_of(received)) * normals
    return np.where(away.min(axis=1) <= kind.range_m, found, np.nan)
