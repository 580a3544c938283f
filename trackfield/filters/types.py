"""Inputs and outputs of filters and trackers. Metres, seconds, radians; bearings clockwise from north (+y).

The target's state is (x, y, vx, vy). The arrays must not be modified.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol, TypeVar

import numpy as np
import numpy.typing as npt

from trackfield.models.doa import Bearings

Array = npt.NDArray[np.float64]


class Gaussian(NamedTuple):
    """N(mean, covariance): ``mean`` (..., n), ``covariance`` (..., n, n)."""

    mean: Array
    covariance: Array


class Update(NamedTuple):
    """A posterior, and log p(z) (...,): the evidence that the measurements give for the prior."""

    posterior: Gaussian
    log_evidence: Array


@dataclass(frozen=True, slots=True, eq=False)
class Reports:
    """The K reports of one step that reached the tracker; K may be 0."""

    step: int
    sensors: tuple[str, ...]
    positions: Array
    """(K, 2) m, the assumed places of the sensors."""
    bearings: Array
    """(K,) rad, direction from sensor to target."""
    levels: Array
    """(K,) dB, received sound."""
    readings: Array | None = None
    """(K, m), readings of sensors that report no bearings; then ``bearings`` and ``levels`` are NaN."""

    def __len__(self) -> int:
        return len(self.sensors)

    @property
    def values(self) -> Array:
        """(K, m) the readings of any kind of sensor, in the units of ``Model.sensor``."""
        return self.bearings[:, None] if self.readings is None else self.readings

    def only(self, which: npt.NDArray[np.intp]) -> Reports:
        """The reports at these indices."""
        sensors = tuple(self.sensors[i] for i in which)
        readings = None if self.readings is None else self.readings[which]
        return Reports(self.step, sensors, self.positions[which], self.bearings[which], self.levels[which], readings)


class Measurement(Protocol):
    """A measurement model for readings of m numbers: z = h(x) + noise, independent, Gaussian, of sd ``sd``."""

    @property
    def sd(self) -> Sequence[float]:
        """The noise's sd (m,)."""
        ...

    def h(self, states: Array, positions: Array) -> Array:
        """Noiseless readings (..., K, m) of ``states`` (..., 4) by sensors at ``positions`` (K, 2)."""
        ...

    def jacobian(self, states: Array, positions: Array) -> Array:
        """dh/dx (..., K, m, 4)."""
        ...

    def residual(self, difference: Array) -> Array:
        """Differences of readings (..., m) in their valid range; angles are wrapped."""
        ...


class OwnMeasurement(Measurement, Protocol):
    """The measurement model of a user's own sensors."""

    @property
    def range_m(self) -> float:
        """The largest distance (m) between the target and a sensor that measured it."""
        ...


@dataclass(frozen=True, slots=True)
class Model:
    """The knowledge of a tracker about the deployment."""

    sigma_w: float
    """sd of a reported bearing, rad; NaN if the sensors report no bearings."""
    sigma_v: float = 0.1
    """sd of the target's acceleration per axis, m/s^2, for trackers with a single motion model."""
    own: OwnMeasurement | None = None
    """The measurement model of sensors that report no bearings."""

    @property
    def dimension(self) -> int:
        """How many numbers the target's state has: x, y, vx, vy."""
        return 4

    @property
    def sensor(self) -> Measurement:
        """The measurement model of the reports, bearings or not."""
        return self.own or Bearings(self.sigma_w)


@dataclass(frozen=True, slots=True, eq=False)
class Estimate:
    """A tracker's answer for one step."""

    mean: Array
    """(4,)"""
    covariance: Array
    """(4, 4)"""
    particles: Array | None = None
    """(n, 2) positions, of trackers that have particles."""


S = TypeVar("S")


class Tracker(Protocol[S]):
    """A tracker: two pure functions over a state of its own, an immutable value.

    It may have further methods: ``motion`` (``trackfield.tracking.smoothing.Foresees``), so that its track can be
    smoothed, and ``belief`` and ``resume`` (``trackfield.filters.belief.Believes``), if it knows more than its estimate
    says.
    """

    def init(self, prior: Gaussian, model: Model) -> S:
        """The state of belief ``prior`` over (x, y, vx, vy)."""
        ...

    def step(self, state: S, reports: Reports, dt: float, rng: np.random.Generator) -> tuple[S, Estimate]:
        """The state ``dt`` seconds later, when ``reports`` were measured, and the estimate for that time."""
        ...
