"""The reports of a step kind by kind: each kind's readings, its formulas at a state, its columns of a state.

What ``measurement.py`` makes one vector of; see there for the axes.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from trackfield.filters.types import Array, Model, Reports, Sensing

OWN = 4
"""The numbers of a state that are not unknowns of the sensing: x, y, vx, vy."""


class Part(NamedTuple):
    """The reports of one kind: its model, its readings (..., k, n), sensors (..., k, 2), and its columns of a state.

    ``z`` (..., k, m) is what of the readings the kind predicts. ``early_s`` (k,) is how long before the instant of the
    state each reading was made; None: at that instant. Then the target was where its velocity brought it from.
    """

    kind: Sensing
    values: Array
    positions: Array
    columns: list[int] | None
    early_s: Array | None
    z: Array

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
            own[..., 2:OWN] -= self.early_s[:, None, None] * own[..., :2]
        if self.columns is None:
            return own
        slopes = np.zeros((*own.shape[:-1], states.shape[-1]))
        slopes[..., self.columns] = own
        return slopes

    def misses(self, states: Array) -> Array:
        """Readings less noiseless ones (..., k, m)."""
        if self.z.ndim == 2:
            return np.asarray(self.kind.residual(self.z - self.h(states)), float)
        found = np.asarray(self.kind.residual(spread(self.z, states) - self.h(states)), float)
        return np.where(np.isnan(found), 0.0, found)

    @property
    def padded(self) -> Array | None:
        """Infinite (..., k, m) for padding, else 0; None if there is none."""
        z = self.z
        return None if z.ndim == 2 or not np.isnan(z).any() else np.where(np.isnan(z), np.inf, 0.0)

    def _at(self, function: Callable[[Array, Array], Array], states: Array, axis: int) -> Array:
        """A function of states and positions, of the states at the instants of the readings."""
        if self.columns is None and self.early_s is None:
            at = self.positions
            return np.asarray(function(states, at if at.ndim == 2 else spread(at, states)), float)
        x = states if self.columns is None else states[..., self.columns]
        if self.early_s is None:
            return np.asarray(function(x, self.positions), float)
        each = [function(_before(x, s), at[None]) for s, at in zip(self.early_s.tolist(), self.positions, strict=True)]
        return np.concatenate(each, axis=axis) if each else np.asarray(function(x, self.positions), float)


def spread(values: Array, states: Array) -> Array:
    """Values (runs..., k, n) with an axis of length 1 for each axis that states (runs..., ..., 4 + u) have besides."""
    runs = values.ndim - 2
    return values.reshape(*values.shape[:runs], *(1,) * (states.ndim - 1 - runs), *values.shape[runs:])


def _before(x: Array, seconds: float) -> Array:
    """The states (..., 4 + u) so long before, at their velocity."""
    earlier = x.copy()
    earlier[..., :2] -= x[..., 2:OWN] * seconds
    return earlier


@lru_cache(maxsize=8)
def parts_of(model: Model, reports: Reports) -> tuple[Part, ...]:
    """The reports kind by kind; a filter asks for those of one step several times."""
    if len(reports.readings) == 1 and len(model.kinds) == 1:
        ((name, values, early_s),) = reports.readings
        kind = model.kinds[name]
        return (Part(kind, values, reports.positions, None, early_s, values[..., : kind.m]),)
    columns, first, parts = _columns(model), 0, list[Part]()
    for name, values, early_s in reports.readings:
        positions = reports.positions[..., first : first + values.shape[-2], :]
        kind = model.kinds[name]
        parts.append(Part(kind, values, positions, columns[name], early_s, values[..., : kind.m]))
        first += values.shape[-2]
    return tuple(parts)


def _columns(model: Model) -> dict[str, list[int]]:
    """Which numbers of a state each kind depends on."""
    columns, first = {}, OWN
    for name, kind in model.kinds.items():
        columns[name] = [*range(OWN), *range(first, first + len(kind.unknowns))]
        first += len(kind.unknowns)
    return columns


def flat(values: Array) -> Array:
    """(..., k, m) as (..., k m)."""
    return values[..., 0] if values.shape[-1] == 1 else values.reshape(*values.shape[:-2], -1)


def rows(slopes: Array) -> Array:
    """(..., k, m, n) as (..., k m, n)."""
    return slopes[..., 0, :] if slopes.shape[-2] == 1 else slopes.reshape(*slopes.shape[:-3], -1, slopes.shape[-1])


def joined(parts: list[Array], axis: int = -1) -> Array:
    """What the kinds have, one after the other."""
    if len(parts) == 1:
        return parts[0]
    return np.concatenate(parts, axis=axis) if parts else np.empty(0)
