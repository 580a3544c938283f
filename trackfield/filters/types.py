"""What filters and trackers take and give. Metres, seconds, radians; bearings clockwise from north (+y).

The target's state is (x, y, vx, vy). Nobody writes into the arrays.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Protocol, TypeVar

import numpy as np
import numpy.typing as npt

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
    """(K, 2) m, where the sensors say they stand."""
    bearings: Array
    """(K,) rad, direction from sensor to target."""
    levels: Array
    """(K,) dB, received sound."""

    def __len__(self) -> int:
        return len(self.bearings)

    def only(self, which: npt.NDArray[np.intp]) -> Reports:
        """These of the reports, by their place."""
        sensors = tuple(self.sensors[i] for i in which)
        return Reports(self.step, sensors, self.positions[which], self.bearings[which], self.levels[which])


@dataclass(frozen=True, slots=True)
class Model:
    """What a tracker is told of the deployment."""

    sigma_w: float
    """sd of a reported bearing, rad."""
    sigma_v: float = 0.1
    """sd of the target's acceleration per axis, m/s^2, for trackers with a single motion model."""


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
    """A tracker is two pure functions over a state of its own, an immutable value."""

    def init(self, prior: Gaussian, model: Model) -> S:
        """The state of belief ``prior`` over (x, y, vx, vy)."""
        ...

    def step(self, state: S, reports: Reports, dt: float, rng: np.random.Generator) -> tuple[S, Estimate]:
        """The state ``dt`` seconds later, when ``reports`` were taken, and the estimate for that time."""
        ...
