"""A filter that has lost its target begins anew, from positions that the readings of two steps determine.

Particles that a sharp likelihood left at one place follow only as far as the noise of the motion takes them: then no
particle explains the readings, however long it goes on. What remains unexplained at the particle that fits best is
compared with what the noise alone leaves once in ``ONCE_IN`` steps (the test of the normalised innovation squared,
Bar-Shalom, Li & Kirubarajan 2001, sec. 5.4). If it is larger, the readings are trilaterated (``search``). If that gives
one position, which explains them, and the step before gave one as well, the filter begins there, with the velocity from
the one to the other (two-point differencing, ibid., sec. 5.5.3). Single outliers rarely bring about two such steps.
"""

from __future__ import annotations

from statistics import NormalDist
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from trackfield.filters.clouds import Cloud, Draws, begun
from trackfield.filters.gaussian import symmetric
from trackfield.filters.measurement import STATE, innovations, noise_sd
from trackfield.filters.particles import picked
from trackfield.filters.robust import BEYOND
from trackfield.filters.search import searched
from trackfield.filters.types import Array, Gaussian, Model, Readings, Reports

ONCE_IN: Final = 100_000
"""How many steps of a filter that is right pass until one is mistaken for a lost one."""
_Z: Final = NormalDist().inv_cdf(1.0 - 1.0 / ONCE_IN)


class Start(NamedTuple):
    """How each filter (...,) goes on: whether it is ``lost``, and its ``belief`` over (..., 4 + u), anew if it is lost.

    ``fixes`` has positions (..., 2) from the readings of this step alone, for the next; NaN where there is none.
    """

    lost: npt.NDArray[np.bool_]
    belief: Gaussian
    fixes: Gaussian | None


def restarts(
    before: Gaussian | None,
    nearest: Array,
    posterior: Gaussian,
    reports: Reports,
    model: Model,
    dt: float,
    *,
    robust: bool = False,
) -> Start:
    """Which runs begin anew, and where.

    ``before`` has the fixes of the step before, ``nearest`` (..., 4 + u) the states that explain the readings best,
    ``posterior`` is what the filters believe. ``robust`` filters are not lost for a few outliers (``unexplained``).
    """
    far = unexplained(nearest, reports, model, robust=robust)
    lost = np.zeros(far.shape, bool)
    if not far.any():
        return Start(lost, posterior, None)
    fixes = Gaussian(np.full((*far.shape, 2), np.nan), np.full((*far.shape, 2, 2), np.nan))
    mean, covariance = posterior.mean.copy(), posterior.covariance.copy()
    for run in map(tuple, np.argwhere(far)):
        fix = _fix(alone(reports, run), model, robust)
        if fix is None:
            continue
        if before is not None and not np.isnan(before.mean[run]).any():
            earlier = Gaussian(before.mean[run], before.covariance[run])
            lost[run], mean[run], covariance[run] = True, *_moving(earlier, fix, model.sigma_v, dt)
        else:
            fixes.mean[run], fixes.covariance[run] = fix.mean[:2], fix.covariance[:2, :2]
    return Start(lost, Gaussian(mean, covariance), fixes)


def begun_anew(
    cloud: Cloud,
    before: Gaussian | None,
    particles: Array,
    likely: Array,
    reports: Reports,
    model: Model,
    dt: float,
    draws: Draws,
    *,
    robust: bool = False,
) -> Cloud:
    """The cloud after a step, with particles from the readings alone where a run has lost its target.

    ``before`` has the fixes of the step before, ``particles`` (..., N, n) are those of this step before any resampling,
    and ``likely`` (..., N) is log p(z | x) of each. New ones are placed by the step's own ``draws``, which are of no
    use for the old ones any more.
    """
    nearest = picked(particles, likely.argmax(axis=-1)[..., None])[..., 0, :]
    start = restarts(before, nearest, cloud.posterior, reports, model, dt, robust=robust)
    if not start.lost.any():
        return cloud._replace(fixes=start.fixes)
    lost, (mean, covariance) = start.lost, start.belief
    particles, log_weights, effective = (
        np.array(part) for part in (cloud.particles, cloud.log_weights, cloud.effective)
    )
    fresh = begun(Gaussian(mean[lost], covariance[lost]), draws.normals[lost])
    particles[lost], log_weights[lost], effective[lost] = fresh.particles, fresh.log_weights, fresh.effective
    return Cloud(start.belief, particles, log_weights, effective, start.fixes)


def unexplained(states: Array, reports: Reports, model: Model, *, robust: bool = False) -> npt.NDArray[np.bool_]:
    """Whether the readings are too far from what ``states`` (..., 4 + u) explain (...,).

    With ``robust`` a reading says no more than one that is ``BEYOND`` sds off. As a few never say enough then, readings
    are also too far if most of them are outliers.
    """
    miss, sd = innovations(model, states, reports), noise_sd(model, reports, states)
    squares, count = np.square(miss / sd), np.isfinite(sd).sum(axis=-1)
    far = squares.sum(axis=-1) > largest(count)
    if robust:
        limited = np.minimum(squares, BEYOND**2).sum(axis=-1)
        far &= (limited > largest(count)) | (2 * (squares > BEYOND**2).sum(axis=-1) > count)
    return np.asarray(far)


def largest(count: Array | npt.NDArray[np.intp]) -> Array:
    """What a chi-squared variable of ``count`` (...,) degrees of freedom exceeds once in ``ONCE_IN`` times.

    By the approximation of Wilson & Hilferty (1931), which is a ninth too large for one degree, and less for more.
    """
    k = np.maximum(count, 1)
    bound: Array = k * (1.0 - 2.0 / (9.0 * k) + _Z * np.sqrt(2.0 / (9.0 * k))) ** 3
    return bound


def alone(reports: Reports, run: tuple[int, ...]) -> Reports:
    """The reports of one run, without padding; those of a single run as they are."""
    if not run:
        return reports
    parts, places, first = list[Readings](), list[Array](), 0
    for kind, values, early_s in reports.readings:
        there = ~np.isnan(values[run]).any(axis=-1)
        parts.append(Readings(kind, values[run][there], early_s))
        places.append(reports.positions[run][first : first + len(there)][there])
        first += len(there)
    positions = np.concatenate(places)
    names = tuple(map(str, range(len(positions))))
    return Reports(reports.step, names, positions, tuple(parts), reports.m, reports.directional)


def _fix(reports: Reports, model: Model, robust: bool) -> Gaussian | None:
    """The belief of one run from its readings alone; None if they do not determine a position that explains them."""
    range_m = max(kind.range_m for kind in model.kinds.values())
    fix = searched(range_m**2 * np.eye(STATE), model, reports, range_m, robust=robust)
    return None if fix is None or unexplained(fix.mean, reports, model, robust=robust) else fix


def _moving(earlier: Gaussian, fix: Gaussian, sigma_v: float, dt: float) -> Gaussian:
    """The belief from a position ``dt`` seconds before, and a fix that knows no velocity."""
    mean, covariance = fix.mean.copy(), fix.covariance.copy()
    mean[2:STATE] = (mean[:2] - earlier.mean) / dt
    between = (earlier.covariance + covariance[:2, :2]) / dt**2
    covariance[2:STATE] = covariance[:2] / dt
    covariance[:, 2:STATE] = covariance[:, :2] / dt
    covariance[2:STATE, 2:STATE] = between + (sigma_v * dt / 2.0) ** 2 * np.eye(2)
    return Gaussian(mean, symmetric(covariance))
