"""The same filters in other packages: filterpy, Stone Soup and particles, each as in its own documentation.

Each function gives a contender: called, it runs over the whole track and returns the means (T, 4). Without its
package it raises ``ImportError``.
"""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime, timedelta
from typing import Any

import numpy as np

from bench.data import BEARINGS, DT, Track
from trackfield.filters.gaussian import constant_velocity
from trackfield.filters.types import Array
from trackfield.models import doa
from trackfield.models.doa import wrap

Contender = Callable[[], Array]


def filterpy_ekf(track: Track) -> Contender:
    """``ExtendedKalmanFilter``."""
    from filterpy.kalman import ExtendedKalmanFilter

    def run() -> Array:
        one = ExtendedKalmanFilter(dim_x=4, dim_z=BEARINGS)
        one.x, one.P = track.prior.mean.copy(), track.prior.covariance.copy()
        one.F, one.Q = constant_velocity(DT, track.model.sigma_v)
        one.R = track.model.sigma_w**2 * np.eye(BEARINGS)
        means = []
        for sensors, bearings in zip(track.sensors, track.bearings, strict=True):
            one.predict()
            one.update(bearings, doa.jacobian, doa.measure, args=(sensors,), hx_args=(sensors,), residual=_difference)
            means.append(one.x.copy())
        return np.array(means)

    return run


def filterpy_ukf(track: Track) -> Contender:
    """``UnscentedKalmanFilter`` with Julier's sigma points."""
    from filterpy.kalman import JulierSigmaPoints, UnscentedKalmanFilter

    F, Q = constant_velocity(DT, track.model.sigma_v)

    def mean_bearing(points: Array, weights: Array) -> Array:
        centre: Array = points[0] + weights @ wrap(points - points[0])
        return centre

    def run() -> Array:
        one = UnscentedKalmanFilter(
            4,
            BEARINGS,
            DT,
            hx=doa.measure,
            fx=lambda x, dt: F @ x,
            points=JulierSigmaPoints(4, kappa=1.0),
            z_mean_fn=mean_bearing,
            residual_z=_difference,
        )
        one.x, one.P, one.Q = track.prior.mean.copy(), track.prior.covariance.copy(), Q
        one.R = track.model.sigma_w**2 * np.eye(BEARINGS)
        means = []
        for sensors, bearings in zip(track.sensors, track.bearings, strict=True):
            one.predict()
            one.update(bearings, sensors=sensors)
            means.append(one.x.copy())
        return np.array(means)

    return run


def _difference(a: Array, b: Array) -> Array:
    return wrap(a - b)


def stonesoup_kalman(track: Track, kind: str) -> Contender:
    """``ExtendedKalmanUpdater`` or ``UnscentedKalmanUpdater``, one bearing after the other."""
    from stonesoup.predictor import kalman as predictors
    from stonesoup.types.state import GaussianState
    from stonesoup.updater import kalman as updaters

    predictor = getattr(predictors, f"{kind}KalmanPredictor")(_stonesoup_motion(track))
    updater = getattr(updaters, f"{kind}KalmanUpdater")(None)
    prior = GaussianState(
        track.prior.mean[_INTERLEAVED], track.prior.covariance[np.ix_(_INTERLEAVED, _INTERLEAVED)], _ZERO
    )
    return lambda: _stonesoup_run(track, predictor, [updater] * BEARINGS, prior)


def stonesoup_particles(track: Track, n: int) -> Contender:
    """``ParticleUpdater``, one bearing after the other, with systematic resampling after the last."""
    from stonesoup.predictor.particle import ParticlePredictor
    from stonesoup.resampler.particle import SystematicResampler
    from stonesoup.types.array import StateVectors
    from stonesoup.types.state import ParticleState
    from stonesoup.updater.particle import ParticleUpdater

    predictor = ParticlePredictor(_stonesoup_motion(track))
    updaters = [ParticleUpdater(None)] * (BEARINGS - 1) + [ParticleUpdater(None, SystematicResampler())]
    rng = np.random.default_rng(1)
    points = track.prior.mean + rng.standard_normal((n, 4)) * np.sqrt(np.diag(track.prior.covariance))
    prior = ParticleState(StateVectors(points[:, _INTERLEAVED].T), weight=np.full(n, 1.0 / n), timestamp=_ZERO)
    return lambda: _stonesoup_run(track, predictor, updaters, prior)


def stonesoup_proposal(track: Track, n: int) -> Contender:
    """``ParticlePredictor`` with a ``KalmanProposal``, an unscented one, that takes all bearings of a step at once.

    Its motion has white noise in the acceleration, as its weights need a covariance of full rank.
    """
    from stonesoup.models.measurement.nonlinear import Cartesian2DToBearing, CombinedReversibleGaussianMeasurementModel
    from stonesoup.models.transition.linear import CombinedLinearGaussianTransitionModel, ConstantVelocity
    from stonesoup.predictor.kalman import UnscentedKalmanPredictor
    from stonesoup.predictor.particle import ParticlePredictor
    from stonesoup.proposal.simple import KalmanProposal
    from stonesoup.resampler.particle import SystematicResampler
    from stonesoup.types.array import StateVector, StateVectors
    from stonesoup.types.detection import Detection
    from stonesoup.types.hypothesis import SingleHypothesis
    from stonesoup.types.state import ParticleState
    from stonesoup.updater.kalman import UnscentedKalmanUpdater
    from stonesoup.updater.particle import ParticleUpdater

    motion = CombinedLinearGaussianTransitionModel([ConstantVelocity(track.model.sigma_v**2)] * 2)
    proposal = KalmanProposal(UnscentedKalmanPredictor(motion), UnscentedKalmanUpdater(None))
    predictor, updater = ParticlePredictor(motion, proposal=proposal), ParticleUpdater(None, SystematicResampler())
    noise = np.array([[track.model.sigma_w**2]])

    def run() -> Array:
        rng, means = np.random.default_rng(1), []
        np.random.seed(1)  # Stone Soup draws from the global generator
        points = track.prior.mean + rng.standard_normal((n, 4)) * np.sqrt(np.diag(track.prior.covariance))
        state = ParticleState(StateVectors(points[:, _INTERLEAVED].T), weight=np.full(n, 1.0 / n), timestamp=_ZERO)
        for step, (sensors, bearings) in enumerate(zip(track.sensors, track.bearings, strict=True), start=1):
            models = [Cartesian2DToBearing(4, (2, 0), noise, translation_offset=at[::-1, None]) for at in sensors]
            both = CombinedReversibleGaussianMeasurementModel(models)
            now = _ZERO + timedelta(seconds=step * DT)
            seen = Detection(StateVector(bearings), timestamp=now, measurement_model=both)
            ahead = predictor.predict(state, timestamp=now, measurement=seen)
            state = updater.update(SingleHypothesis(ahead, seen))
            means.append(np.asarray(state.mean, float).ravel()[_INTERLEAVED])
        return np.array(means)

    return run


_INTERLEAVED = [0, 2, 1, 3]
"""Stone Soup's state is (x, vx, y, vy)."""
_ZERO = datetime(2020, 1, 1)


def _stonesoup_motion(track: Track) -> Any:
    from stonesoup.models.transition.linear import LinearGaussianTimeInvariantTransitionModel

    F, Q = (matrix[np.ix_(_INTERLEAVED, _INTERLEAVED)] for matrix in constant_velocity(DT, track.model.sigma_v))
    return LinearGaussianTimeInvariantTransitionModel(transition_matrix=F, covariance_matrix=Q, control_matrix=None)


def _stonesoup_run(track: Track, predictor: Any, updaters: list[Any], prior: Any) -> Array:
    from stonesoup.models.measurement.nonlinear import Cartesian2DToBearing
    from stonesoup.types.detection import Detection
    from stonesoup.types.hypothesis import SingleHypothesis

    means, state = [], prior
    for step, (sensors, bearings) in enumerate(zip(track.sensors, track.bearings, strict=True), start=1):
        now = _ZERO + timedelta(seconds=step * DT)
        state = predictor.predict(state, timestamp=now)
        for updater, place, angle in zip(updaters, sensors, bearings, strict=True):
            # of north and east, in this order: clockwise from north
            model = Cartesian2DToBearing(
                4, (2, 0), np.array([[track.model.sigma_w**2]]), translation_offset=place[::-1, None]
            )
            state = updater.update(SingleHypothesis(state, Detection([angle], timestamp=now, measurement_model=model)))
        means.append(np.asarray(state.mean, float).ravel()[_INTERLEAVED])
    return np.array(means)


def particles_bootstrap(track: Track, n: int) -> Contender:
    """``SMC`` of a ``Bootstrap`` model, resampling in every step."""
    import particles
    from particles import collectors, distributions, state_space_models

    Fx, Q = constant_velocity(DT, track.model.sigma_v)
    noise = distributions.MvNormal(cov=Q + 1e-12 * np.eye(4))

    class Field(state_space_models.StateSpaceModel):  # type: ignore[misc]
        def PX0(self) -> Any:  # noqa: N802
            return distributions.MvNormal(loc=Fx @ track.prior.mean, cov=Fx @ track.prior.covariance @ Fx.T + Q)

        def PX(self, t: int, xp: Array) -> Any:  # noqa: N802
            return distributions.MvNormal(loc=xp @ Fx.T, cov=noise.cov)

        def PY(self, t: int, xp: Array, x: Array) -> Any:  # noqa: N802
            return _Bearings(doa.measure(x, track.sensors[t]), track.model.sigma_w)

    class _Bearings:
        def __init__(self, expected: Array, sd: float) -> None:
            self.expected, self.sd = expected, sd

        def logpdf(self, bearings: Array) -> Array:
            log_density: Array = -0.5 * np.square(wrap(bearings - self.expected) / self.sd).sum(axis=-1)
            return log_density

    def run() -> Array:
        model = state_space_models.Bootstrap(ssm=Field(), data=list(track.bearings))
        smc = particles.SMC(fk=model, N=n, ESSrmin=1.0, collect=[collectors.Moments()])
        smc.run()
        return np.array([moment["mean"] for moment in smc.summaries.moments])

    return run
