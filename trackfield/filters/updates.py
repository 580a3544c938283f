"""A belief updated with the reports of a step, of any kinds of sensing: the kernels of ``ekf`` and ``ukf`` on them.

Beliefs may have leading axes (of models, or of runs if the reports have them, too). Where the noise depends on the
state, the extended filter takes it at the mean, the unscented one as its mean over the belief. With ``robust`` noise is
inflated for outliers (``robust.py``).
"""

from __future__ import annotations

import numpy as np

from trackfield.filters import ekf, ukf
from trackfield.filters.measurement import linearised, noise_sd, problem, varies
from trackfield.filters.robust import inflated
from trackfield.filters.types import Array, Gaussian, Model, Reports, Update


def extended(belief: Gaussian, reports: Reports, model: Model, *, robust: bool = False) -> Gaussian:
    """The posterior of the extended Kalman filter; at least one report."""
    miss, H, sd = linearised(model, belief.mean, reports)
    if robust:
        sd = inflated(sd, miss, np.vecdot(H @ belief.covariance, H))
    return ekf.corrected(belief, miss, H, sd)


def unscented(belief: Gaussian, reports: Reports, model: Model, *, robust: bool = False) -> Gaussian:
    """The posterior of the unscented Kalman filter; at least one report."""
    z, sd, measure, apart = _problem(belief, reports, model, robust)
    return ukf.posterior(belief, z, sd, measure, apart)


def unscented_update(belief: Gaussian, reports: Reports, model: Model, *, robust: bool = False) -> Update:
    """The same with the evidence, which takes more time."""
    z, sd, measure, apart = _problem(belief, reports, model, robust)
    return ukf.update(belief, z, sd, measure, apart)


def unscented_predictive(belief: Gaussian, reports: Reports, model: Model, *, robust: bool = False) -> Array:
    """log p(z_k | all others) (..., K m) of each number."""
    z, sd, measure, apart = _problem(belief, reports, model, robust)
    return ukf.predictive(belief, z, sd, measure, apart)


def mean_sd(belief: Gaussian, reports: Reports, model: Model) -> Array:
    """Root of the mean of the noise's variance (..., K m) over the belief, where it depends on the state."""
    if not varies(model):
        return noise_sd(model, reports)
    points, weights = ukf.sigma_points(belief)
    variances = np.square(noise_sd(model, reports, points))
    if variances.ndim == 1:
        return noise_sd(model, reports, belief.mean)
    return np.asarray(np.sqrt(weights @ variances))


def _problem(belief: Gaussian, reports: Reports, model: Model, robust: bool) -> tuple[Array, Array, ukf.Map, ukf.Map]:
    """The arguments of the unscented kernels after the belief."""
    sd = mean_sd(belief, reports, model)
    z, measure, apart = problem(model, reports)
    if z.ndim > 1:
        z = np.nan_to_num(z)  # padding, whose noise is infinite
    if robust:
        innovation, spread = ukf.innovation(belief, z, measure, apart)
        sd = inflated(sd, innovation, spread)
    return z, sd, measure, apart
