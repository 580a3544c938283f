"""Inputs and outputs of filters and trackers. Metres, seconds, radians; bearings clockwise from north (+y).

The target's state is (x, y, vx, vy). The arrays must not be modified.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol, TypeVar

import numpy as np
import numpy.typing as npt

from trackfield.models.unknowns import Unknown

Array = npt.NDArray[np.float64]


class Gaussian(NamedTuple):
    """N(mean, covariance): ``mean`` (..., n), ``covariance`` (..., n, n)."""

    mean: Array
    covariance: Array


class Update(NamedTuple):
    """A posterior, and log p(z) (...,): the evidence that the measurements give for the prior."""

    posterior: Gaussian
    log_evidence: Array


class Readings(NamedTuple):
    """The reports of one kind of sensing: ``values`` (k, n), in the units of the kind's ``h``.

    ``early_s`` (k,) is how long before the step's instant each was made; None: all at that instant.
    """

    kind: str
    values: Array
    early_s: Array | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Reports:
    """The K reports of one step that reached the tracker; K may be 0.

    With several kinds of sensing, those of the first kind come first, then those of the second, and so on.
    """

    step: int
    sensors: tuple[str, ...]
    positions: Array
    """(K, 2) m, the assumed places of the sensors."""
    readings: tuple[Readings, ...]
    """What they read, by kind; together as many as there are sensors."""
    m: int | None = None
    """How many of a reading's numbers ``h`` predicts, if there is one kind; None: all."""
    directional: bool = True
    """Whether sensors of all kinds report bearings and levels."""

    def __len__(self) -> int:
        return len(self.sensors)

    @property
    def values(self) -> Array:
        """(K, m) what ``h`` predicts, in its units, of sensors of one kind. Raises ``ValueError`` for several."""
        if len(self.readings) != 1:
            raise ValueError(f"reports of {len(self.readings)} kinds of sensing; expected those of one")
        return self.readings[0].values[..., : self.m]

    @property
    def bearings(self) -> Array:
        """(K,) rad, the directions from sensors to the target; NaN in a field with sensors that report none."""
        return self._column(0)

    @property
    def levels(self) -> Array:
        """(K,) dB, the received sound; NaN in a field with sensors that report no bearings."""
        return self._column(1)

    def _column(self, number: int) -> Array:
        if not self.directional:
            return np.full(len(self), math.nan)
        if len(self.readings) == 1:
            return self.readings[0].values[..., number]
        return np.concatenate([one.values[..., number] for one in self.readings], axis=-1)

    def only(self, which: npt.NDArray[np.intp]) -> Reports:
        """The reports at these indices, which are ascending."""
        sensors, found, first = tuple(self.sensors[i] for i in which), list[Readings](), 0
        if len(self.readings) == 1:
            alone = (_at(self.readings[0], which),)
            return Reports(self.step, sensors, self.positions[which], alone, self.m, self.directional)
        for one in self.readings:
            found.append(_at(one, which[(which >= first) & (which < first + len(one.values))] - first))
            first += len(one.values)
        return Reports(self.step, sensors, self.positions[which], tuple(found), self.m, self.directional)


def _at(readings: Readings, which: npt.NDArray[np.intp]) -> Readings:
    """The readings at these indices."""
    kind, values, early_s = readings
    return Readings(kind, values[which], None if early_s is None else early_s[which])


def of_bearings(step: int, sensors: tuple[str, ...], positions: Array, bearings: Array, levels: Array) -> Reports:
    """Reports of arrays of microphones: ``positions`` (K, 2) m, ``bearings`` (K,) rad, ``levels`` (K,) dB."""
    return Reports(step, sensors, positions, (Readings("doa", np.array((bearings, levels)).T),), 1)


class PassNoise(Protocol):
    """The noise of reports of passes, as a kind's options have it (``trackfield/models/noise.py``)."""

    @property
    def time_sd_s(self) -> float:
        """The sd of times, at one distance and 30 mph if it depends on them."""
        ...

    @property
    def distance_power(self) -> float:
        """With which power of the distance it grows."""
        ...

    @property
    def speed_power(self) -> float:
        """With which power of the speed it falls."""
        ...

    def time_sd(self, away_m: Array, speed_m_s: Array, *, larger: Callable[[Array, float], Array]) -> Array:
        """The sd (s) of times at these distances and speeds, which broadcast; ``larger`` is ``numpy.maximum``."""
        ...

    @property
    def strength_sd(self) -> float:
        """The sd of amplitudes, relative."""
        ...

    @property
    def place_sd_m(self) -> float:
        """The sd of the sensors' places per axis."""
        ...


class Sensing(Protocol):
    """The measurement model of a kind of sensing; in full ``trackfield.sensing.sensing.Full``.

    A reading has n numbers; the first m are z = h(x) + noise, independent, Gaussian. States ``x`` (..., 4 + u) are (x,
    y, vx, vy) and the kind's u ``unknowns``.
    """

    @property
    def m(self) -> int:
        """How many numbers ``h`` predicts."""
        ...

    @property
    def sd(self) -> Sequence[float]:
        """The noise's sd (m,)."""
        ...

    @property
    def range_m(self) -> float:
        """The largest distance (m) between the target and a sensor that measured it."""
        ...

    @property
    def fix_sensors(self) -> int:
        """How many sensors determine a position."""
        ...

    @property
    def unknowns(self) -> Sequence[Unknown]:
        """What it depends on beyond (x, y, vx, vy)."""
        ...

    @property
    def bearings(self) -> bool:
        """Whether its first number is a bearing (rad), and its second the level (dB)."""
        ...

    @property
    def speed_m_s(self) -> float:
        """How fast what it senses travels; infinite: at once."""
        ...

    @property
    def passes(self) -> PassNoise | None:
        """The noise of readings that are (time s, strength dB, width s) of a target's pass; None: they are not."""
        ...

    @property
    def h(self) -> Callable[[Array, Array], Array]:
        """Noiseless readings (..., K, m) of states by sensors at (K, 2)."""
        ...

    @property
    def jacobian(self) -> Callable[[Array, Array], Array]:
        """dh/dx (..., K, m, 4 + u)."""
        ...

    @property
    def variance(self) -> Callable[[Array, Array], Array] | None:
        """R(x) (..., K, m), the variances of the noise; None: those of ``sd``, everywhere."""
        ...

    @property
    def residual(self) -> Callable[[Array], Array]:
        """Differences of readings (..., m) in their valid range; angles are wrapped."""
        ...

    @property
    def log_clutter(self) -> Callable[[Array, Array], Array] | None:
        """Log density (K,) of readings (K, n) at (K, 2) that come from anywhere; None: not known."""
        ...

    @property
    def loudness(self) -> Callable[[Array], Array]:
        """How loud readings (K, n) are, in dB (K,): the weight of a sensor beside others."""
        ...

    @property
    def fix(self) -> Callable[[Array, Array, Array], Gaussian | None] | None:
        """A start from readings (K, n) at (K, 2), given a covariance without information; None: the general search."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class Model:
    """The knowledge of a tracker about the deployment: the ``kinds`` of sensing by name, as ``Reports`` name them."""

    kinds: Mapping[str, Sensing]
    sigma_v: float = 0.1
    """sd of the target's acceleration per axis, m/s^2, for trackers with a single motion model."""
    sensors: int = 0
    """How many sensors there are; 0: not known."""

    @property
    def sensor(self) -> Sensing:
        """The measurement model of a field with one kind of sensing. Raises ``ValueError`` if there are several."""
        (kind,) = self.kinds.values()
        return kind

    @property
    def sigma_w(self) -> float:
        """sd of a reported bearing, rad; NaN if the sensors report no bearings."""
        return next((kind.sd[0] for kind in self.kinds.values() if kind.bearings), math.nan)

    @property
    def unknowns(self) -> tuple[Unknown, ...]:
        """Those of all kinds, kind by kind: the columns of a state after (x, y, vx, vy)."""
        return tuple(one for kind in self.kinds.values() for one in kind.unknowns)

    @property
    def dimension(self) -> int:
        """How many numbers the target's state has: x, y, vx, vy, and the unknowns of the sensing."""
        return 4 + len(self.unknowns)


@dataclass(frozen=True, slots=True, eq=False)
class Estimate:
    """A tracker's answer for one step."""

    mean: Array
    """(4 + u,): x, y, vx, vy and the unknowns of the sensing."""
    covariance: Array
    """(4 + u, 4 + u)"""
    particles: Array | None = None
    """(n, 2) positions, of trackers that have particles."""


S = TypeVar("S")


class Tracker(Protocol[S]):
    """A tracker: two pure functions over a state of its own, an immutable value.

    It may have further methods: ``motion`` (``trackfield.tracking.smoothing.Foresees``), so that its track can be
    smoothed, and ``belief`` and ``resume`` (``trackfield.filters.belief.Believes``), if it knows more than its estimate
    says. Trackfield's own may start by themselves (``trackfield.tracking.following.Starts``).
    """

    def init(self, prior: Gaussian, model: Model) -> S:
        """The state of belief ``prior`` over (x, y, vx, vy) and the unknowns of the sensing."""
        ...

    def step(self, state: S, reports: Reports, dt: float, rng: np.random.Generator) -> tuple[S, Estimate]:
        """The state ``dt`` seconds later, when ``reports`` were measured, and the estimate for that time."""
        ...
