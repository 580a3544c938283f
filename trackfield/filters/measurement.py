"""The reports of a step as one measurement vector, for filters that take any sensor.

Its K m numbers are those of the first sensor, then those of the second, and so on. States may have leading batch axes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from trackfield.filters import particles
from trackfield.filters.types import Array, Model, Reports
from trackfield.models import doa


@dataclass(frozen=True)
class OfSensor:
    """The measurement model of a user's ``sensor`` (``sensing.kinds.Sensor``), which may lack ``residual``."""

    sensor: Any

    @property
    def range_m(self) -> float:
        """See ``OwnMeasurement``."""
        return float(self.sensor.range_m)

    @property
    def sd(self) -> Sequence[float]:
        """See ``Measurement``."""
        sd: Sequence[float] = self.sensor.sd
        return sd

    def h(self, states: Array, positions: Array) -> Array:
        """See ``Measurement``."""
        return np.asarray(self.sensor.h(states, positions), float)

    def jacobian(self, states: Array, positions: Array) -> Array:
        """See ``Measurement``."""
        return np.asarray(self.sensor.jacobian(states, positions), float)

    def residual(self, difference: Array) -> Array:
        """See ``Measurement``."""
        wrapped = getattr(self.sensor, "residual", None)
        return difference if wrapped is None else np.asarray(wrapped(difference), float)


def measured(reports: Reports) -> Array:
    """The readings z (K m,)."""
    return reports.bearings if reports.readings is None else reports.readings.reshape(-1)


def noise_sd(model: Model, reports: Reports) -> Array:
    """The noise's sd of each of them (K m,)."""
    if model.own is None:
        return np.full(len(reports), model.sigma_w)
    return np.tile(np.asarray(model.own.sd, float), len(reports))


def expected(model: Model, states: Array, reports: Reports) -> Array:
    """h(x) (..., K m): the noiseless readings of ``states`` (..., 4)."""
    if model.own is None:
        return doa.measure(states, reports.positions)
    readings = model.own.h(states, reports.positions)
    return readings.reshape(*readings.shape[:-2], -1)


def jacobians(model: Model, states: Array, reports: Reports) -> Array:
    """dh/dx (..., K m, 4) at ``states`` (..., 4)."""
    if model.own is None:
        return doa.jacobian(states, reports.positions)
    slopes = model.own.jacobian(states, reports.positions)
    return slopes.reshape(*slopes.shape[:-3], -1, 4)


def residual(model: Model, difference: Array) -> Array:
    """Differences of readings (..., K m) in their valid range; angles are wrapped."""
    if model.own is None:
        return doa.wrap(difference)
    apart = difference.reshape(*difference.shape[:-1], -1, len(model.own.sd))
    return model.own.residual(apart).reshape(difference.shape)


def innovations(model: Model, states: Array, reports: Reports) -> Array:
    """z - h(x) (..., K m) for ``states`` (..., 4)."""
    return residual(model, measured(reports) - expected(model, states, reports))


def log_likelihood(model: Model, states: Array, reports: Reports) -> Array:
    """log p(z | x) (...,) of all readings for ``states`` (..., 4), up to a constant."""
    if model.own is None:
        return particles.log_likelihood(states, reports, model.sigma_w)
    log_weights: Array = -0.5 * np.square(innovations(model, states, reports) / noise_sd(model, reports)).sum(axis=-1)
    return log_weights
