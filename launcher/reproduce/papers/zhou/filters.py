"""The filters on many runs at once: for each, estimates of all steps from the reports of all steps."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from launcher.reproduce.kernels.draws import Generators, normals, stacked
from launcher.reproduce.papers.zhou.setups import DT
from trackfield.filters.clouds import Cloud, CloudTracker, begun, weighted
from trackfield.filters.gaussian import predict
from trackfield.filters.gpf_ukf import Corrected, GpfUkf
from trackfield.filters.measurement import log_likelihood, moving
from trackfield.filters.particles import moved
from trackfield.filters.types import Array, Gaussian, Model, Reports
from trackfield.filters.updates import unscented


class Estimates(NamedTuple):
    """Of R runs and T steps: ``mean`` (R, T, 4), ``covariance`` (R, T, 4, 4), and the effective number of particles
    (R, T), None of filters without particles."""

    mean: Array
    covariance: Array
    effective: Array | None = None


Filter = Callable[[Gaussian, Sequence[Reports], Model, Generators], Estimates]
"""Of the prior, the reports of all steps (arrays (R, K, ...)), the model, and a generator for each run."""


def particles(tracker: CloudTracker) -> Filter:
    """A tracker with a cloud of particles."""
    return partial(_particles, tracker)


def _particles(
    tracker: CloudTracker, prior: Gaussian, reports: Sequence[Reports], model: Model, rngs: Generators
) -> Estimates:
    cloud = begun(_many(prior, len(rngs)), normals(rngs, tracker.particles, 4))
    clouds = []
    for some in reports:
        cloud = tracker.fuse(cloud, some, model, DT, stacked(tracker.draws, rngs))
        clouds.append(cloud)
    return _of_clouds(clouds)


def bootstrap(n: int, ess: float = 0.5) -> Filter:
    """The bootstrap filter of ``n`` particles, resampled when their effective number is at most ``ess`` of them."""
    return partial(_bootstrap, n, ess)


def _bootstrap(
    n: int, ess: float, prior: Gaussian, reports: Sequence[Reports], model: Model, rngs: Generators
) -> Estimates:
    cloud = begun(_many(prior, len(rngs)), normals(rngs, n, 4))
    clouds = []
    for some in reports:
        places = moved(cloud.particles, DT, model.sigma_v, normals(rngs, n, 2))
        u = np.array([rng.random() for rng in rngs])
        cloud = weighted(places, cloud.log_weights + log_likelihood(model, places, some), u, ess)
        clouds.append(cloud)
    return _of_clouds(clouds)


def gpf_ukf(tracker: GpfUkf) -> Filter:
    """The Gaussian particle filter."""
    return partial(_gpf_ukf, tracker)


def _gpf_ukf(tracker: GpfUkf, prior: Gaussian, reports: Sequence[Reports], model: Model, rngs: Generators) -> Estimates:
    after = Corrected(_many(prior, len(rngs)), np.empty(0), np.empty(0))
    means, covariances, effective = list[Array](), list[Array](), list[Array]()
    for some in reports:
        after = tracker.fuse(after.belief, after.fixes, some, model, DT, np.stack([tracker.draws(rng) for rng in rngs]))
        means.append(after.belief.mean)
        covariances.append(after.belief.covariance)
        effective.append(after.effective)
    return Estimates(np.stack(means, axis=1), np.stack(covariances, axis=1), np.stack(effective, axis=1))


def ukf(*, robust: bool = False) -> Filter:
    """The UKF alone."""
    return partial(_ukf, robust)


def _ukf(robust: bool, prior: Gaussian, reports: Sequence[Reports], model: Model, rngs: Generators) -> Estimates:
    belief, means, covariances = _many(prior, len(rngs)), [], []
    for some in reports:
        belief = unscented(predict(belief, moving(model, DT)), some, model, robust=robust)
        means.append(belief.mean)
        covariances.append(belief.covariance)
    return Estimates(np.stack(means, axis=1), np.stack(covariances, axis=1))


def _many(belief: Gaussian, runs: int) -> Gaussian:
    return Gaussian(*(np.broadcast_to(part, (runs, *part.shape)).copy() for part in belief))


def _of_clouds(clouds: Sequence[Cloud]) -> Estimates:
    return Estimates(
        np.stack([cloud.posterior.mean for cloud in clouds], axis=1),
        np.stack([cloud.posterior.covariance for cloud in clouds], axis=1),
        np.stack([cloud.effective for cloud in clouds], axis=1),
    )
