"""The reports of a step as one measurement vector, for filters that take any kind of sensing.

Its numbers are those of the first sensor, then those of the second, and so on: m of each, K m in all, or with several
kinds the sum of K m over kinds. States (..., 4 + u) have the unknowns of all kinds after (x, y, vx, vy); they may have
leading batch axes.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from trackfield.filters.bounds import information
from trackfield.filters.gaussian import Motion, constant_velocity
from trackfield.filters.types import Array, Gaussian, Model, Reports, Sensing
from trackfield.models.unknowns import Unknown

STATE = 4
"""The numbers of a state that are not unknowns of the sensing: x, y, vx, vy."""


class _Part(NamedTuple):
    """The reports of one kind: its model, its readings (k, n), the sensors (k, 2), and its columns of a state.

    ``early_s`` (k,) is how long before the instant of the state each reading was made; None: at that instant. Then the
    target was where its velocity brought it from.
    """

    kind: Sensing
    values: Array
    positions: Array
    columns: list[int] | None
    early_s: Array | None

    def h(self, states: Array) -> Array:
        """Noiseless readings (..., k, m)."""
        return self._at(self.kind.h, states, -2)

    def variance(self, states: Array) -> Array:
        """Variances (..., k, m) of a kind whose noise depends on the state."""
        assert self.kind.variance is not None
        return self._at(self.kind.variance, states, -2)

    def jacobian(self, states: Array) -> Array:
        """dh/dx (..., k, m, 4 + u), u of all kinds."""
        own = self._at(self.kind.jacobian, states, -3)
        if self.columns is None and self.early_s is None:
            return own
        if self.early_s is not None:
            own = own.copy()
            own[..., 2:STATE] -= self.early_s[:, None, None] * own[..., :2]
        if self.columns is None:
            return own
        slopes = np.zeros((*own.shape[:-1], states.shape[-1]))
        slopes[..., self.columns] = own
        return slopes

    def misses(self, states: Array) -> Array:
        """Readings less noiseless ones (..., k, m)."""
        return np.asarray(self.kind.residual(self.values[:, : self.kind.m] - self.h(states)), float)

    def _at(self, function: Callable[[Array, Array], Array], states: Array, axis: int) -> Array:
        """A function of states and positions, of the states at the instants of the readings."""
        if self.columns is None and self.early_s is None:
            return np.asarray(function(states, self.positions), float)
        x = states if self.columns is None else states[..., self.columns]
        if self.early_s is None:
            return np.asarray(function(x, self.positions), float)
        each = [function(_before(x, s), at[None]) for s, at in zip(self.early_s.tolist(), self.positions, strict=True)]
        return np.concatenate(each, axis=axis) if each else np.asarray(function(x, self.positions), float)


def _before(x: Array, seconds: float) -> Array:
    """The states (..., 4 + u) so long before, at their velocity."""
    earlier = x.copy()
    earlier[..., :2] -= x[..., 2:STATE] * seconds
    return earlier


def measured(model: Model, reports: Reports) -> Array:
    """The readings z (K m,)."""
    return _joined([_flat(part.values[:, : part.kind.m]) for part in _parts(model, reports)])


def noise_sd(model: Model, reports: Reports, states: Array | None = None) -> Array:
    """The noise's sd of each of them (K m,), or (..., K m) at ``states`` (..., 4 + u) where it depends on them.

    Raises ``ValueError`` if it depends on the state, and none is given.
    """
    found = []
    for part in _parts(model, reports):
        if part.kind.variance is None:
            sd, count = part.kind.sd, len(part.values)
            found.append(np.full(count, sd[0]) if len(sd) == 1 else np.tile(np.asarray(sd, float), count))
        elif states is None:
            raise ValueError("the noise of this kind of sensing depends on the state; expected states")
        else:
            found.append(np.sqrt(_flat(part.variance(states))))
    if len(found) > 1:
        batch = np.broadcast_shapes(*(one.shape[:-1] for one in found))
        found = [np.broadcast_to(one, (*batch, one.shape[-1])) for one in found]
    return _joined(found)


@lru_cache(maxsize=64)
def varies(model: Model) -> bool:
    """Whether the noise of any kind depends on the state."""
    return any(kind.variance is not None for kind in model.kinds.values())


def expected(model: Model, states: Array, reports: Reports) -> Array:
    """h(x) (..., K m): the noiseless readings of ``states`` (..., 4 + u)."""
    return _joined([_flat(part.h(states)) for part in _parts(model, reports)])


def jacobians(model: Model, states: Array, reports: Reports) -> Array:
    """dh/dx (..., K m, 4 + u) at ``states`` (..., 4 + u)."""
    return _joined([_rows(part.jacobian(states)) for part in _parts(model, reports)], axis=-2)


def residual(model: Model, reports: Reports, difference: Array) -> Array:
    """Differences of readings (..., K m) in their valid range; angles are wrapped."""
    parts, first = [], 0
    for part in _parts(model, reports):
        count = len(part.values) * part.kind.m
        apart = difference if count == difference.shape[-1] else difference[..., first : first + count]
        first += count
        each = apart[..., None] if part.kind.m == 1 else apart.reshape(*apart.shape[:-1], -1, part.kind.m)
        parts.append(_flat(np.asarray(part.kind.residual(each), float)))
    return _joined(parts)


def innovations(model: Model, states: Array, reports: Reports) -> Array:
    """z - h(x) (..., K m) for ``states`` (..., 4 + u)."""
    return residual(model, reports, measured(model, reports) - expected(model, states, reports))


def log_likelihood(model: Model, states: Array, reports: Reports) -> Array:
    """log p(z | x) (...,) of all readings for ``states`` (..., 4 + u), up to a constant."""
    log_weights = np.zeros(states.shape[:-1])
    for part in _parts(model, reports):
        kind, miss = part.kind, part.misses(states)
        if kind.variance is None:
            for j, sd in enumerate(kind.sd):
                log_weights += np.vecdot(miss[..., j], miss[..., j]) * (-0.5 / sd**2)
        else:
            variance = part.variance(states)
            log_weights -= 0.5 * (np.square(miss) / variance + np.log(variance)).sum(axis=(-2, -1))
    return log_weights


def log_ratios(model: Model, belief: Gaussian, reports: Reports) -> Array:
    """Log of the density of each reading (K,) from the ``belief`` to that of one from anywhere.

    Only of kinds that know the latter (``log_clutter``); the belief is over (4 + u,).
    """
    found = []
    for part in _parts(model, reports):
        kind, at = part.kind, part.positions
        if kind.log_clutter is None or not len(at):
            continue
        H, miss = part.jacobian(belief.mean), part.misses(belief.mean)
        if kind.m == 1:  # in numbers, which takes half the time
            R = kind.sd[0] ** 2 if kind.variance is None else part.variance(belief.mean)[:, 0]
            S = np.vecdot(H[:, 0] @ belief.covariance, H[:, 0]) + R
            cost = np.square(miss[:, 0]) / S + np.log(2.0 * np.pi * S)
        else:
            R = np.square(np.asarray(kind.sd, float)) if kind.variance is None else part.variance(belief.mean)
            S = H @ belief.covariance @ H.mT + R[..., None] * np.eye(kind.m)
            square = np.vecdot(miss, np.linalg.solve(S, miss[..., None])[..., 0])
            cost = square + np.linalg.slogdet(2.0 * np.pi * S)[1]
        found.append(-0.5 * cost - kind.log_clutter(part.values, at))
    return _joined(found)


def sensing_information(model: Model, state: Array, reports: Reports) -> Array:
    """D (4 + u, 4 + u): the Fisher information of the readings about a ``state`` (4 + u,).

    H^T R^-1 H, and half the sum of the squared slopes of log R where the noise depends on the state, by central
    differences (Kay 1993, eq. 3.31).
    """
    D = information(jacobians(model, state, reports), noise_sd(model, reports, state))
    if varies(model):
        step = 1e-5 * np.maximum(np.abs(state), 1.0)
        ends = state + np.stack((np.diag(step), -np.diag(step)))
        up, down = (2.0 * np.log(noise_sd(model, reports, these)) for these in ends)
        slopes = (up - down) / (2.0 * step[:, None])
        D = D + 0.5 * slopes @ slopes.T
    return D


# --- unknowns of the sensing ------------------------------------------------------------------------------------------


@lru_cache(maxsize=64)
def moving(model: Model, dt: float, sigma_v: float | None = None) -> Motion:
    """Nearly constant velocity over ``dt`` seconds, the unknowns of the sensing as random walks beside it."""
    motion = constant_velocity(dt, model.sigma_v if sigma_v is None else sigma_v)
    return widened(motion, model.unknowns, dt) if model.unknowns else motion


def widened(motion: Motion, unknowns: tuple[Unknown, ...], dt: float) -> Motion:
    """A motion (4, 4) with random walks of these unknowns beside it: (4 + u, 4 + u)."""
    walks = np.array([one.walk_sd for one in unknowns]) ** 2 * dt
    return Motion(_beside(motion.F, np.eye(len(unknowns))), _beside(motion.Q, np.diag(walks)))


def extended(belief: Gaussian, unknowns: tuple[Unknown, ...]) -> Gaussian:
    """A belief over (x, y, vx, vy) with what is known of the unknowns at the start: (4 + u,)."""
    if not unknowns or len(belief.mean) > STATE:
        return belief
    mean = np.append(belief.mean, [one.mean for one in unknowns])
    return Gaussian(mean, _beside(belief.covariance, np.diag([one.sd**2 for one in unknowns])))


def _beside(a: Array, b: Array) -> Array:
    """Two square matrices along the diagonal of one."""
    n = len(a) + len(b)
    matrix = np.zeros((n, n))
    matrix[: len(a), : len(a)], matrix[len(a) :, len(a) :] = a, b
    return matrix


# --- parts ------------------------------------------------------------------------------------------------------------


@lru_cache(maxsize=8)
def _parts(model: Model, reports: Reports) -> tuple[_Part, ...]:
    """The reports kind by kind; a filter asks for those of one step several times."""
    if len(reports.readings) == 1 and len(model.kinds) == 1:
        ((name, values, early_s),) = reports.readings
        return (_Part(model.kinds[name], values, reports.positions, None, early_s),)
    columns, first, parts = _columns(model), 0, list[_Part]()
    for name, values, early_s in reports.readings:
        positions = reports.positions[first : first + len(values)]
        parts.append(_Part(model.kinds[name], values, positions, columns[name], early_s))
        first += len(values)
    return tuple(parts)


def _columns(model: Model) -> dict[str, list[int]]:
    """Which numbers of a state each kind depends on."""
    columns, first = {}, STATE
    for name, kind in model.kinds.items():
        columns[name] = [*range(STATE), *range(first, first + len(kind.unknowns))]
        first += len(kind.unknowns)
    return columns


def _flat(values: Array) -> Array:
    """(..., k, m) as (..., k m)."""
    return values[..., 0] if values.shape[-1] == 1 else values.reshape(*values.shape[:-2], -1)


def _rows(slopes: Array) -> Array:
    """(..., k, m, n) as (..., k m, n)."""
    return slopes[..., 0, :] if slopes.shape[-2] == 1 else slopes.reshape(*slopes.shape[:-3], -1, slopes.shape[-1])


def _joined(parts: list[Array], axis: int = -1) -> Array:
    if len(parts) == 1:
        return parts[0]
    return np.concatenate(parts, axis=axis) if parts else np.empty(0)
