"""Kinds of sensing of a user's own, for tests: readings of two numbers, and of one."""

from __future__ import annotations

from dataclasses import dataclass
from math import dist
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Ranger:
    """How far away the target is, and how far east: two numbers of different noise and resolution."""

    range_m: float = 100.0
    blind_m: float = 0.0

    sd = (0.5, 2.0)
    resolution = (0.01, 0.1)

    def simulate(self, target: Any, position: Any, normals: Any) -> tuple[float, float] | None:
        away = dist(target[:2], position)
        if away < self.blind_m:
            return None
        return away + 0.5 * normals[0], target[0] - position[0] + 2.0 * normals[1]

    def h(self, states: Any, positions: Any) -> Any:
        apart = states[..., None, :2] - positions
        return np.stack((np.linalg.norm(apart, axis=-1), apart[..., 0]), axis=-1)

    def jacobian(self, states: Any, positions: Any) -> Any:
        apart = states[..., None, :2] - positions
        slopes = np.zeros((*apart.shape[:-1], 2, 4))
        slopes[..., 0, :2] = apart / np.maximum(np.linalg.norm(apart, axis=-1, keepdims=True), 1e-6)
        slopes[..., 1, 0] = 1.0
        return slopes


@dataclass(frozen=True)
class Distance(Ranger):
    """The first of the two alone."""

    sd = (0.5,)  # type: ignore[assignment]
    resolution = (0.01,)  # type: ignore[assignment]

    def simulate(self, target: Any, position: Any, normals: Any) -> Any:
        return (dist(target[:2], position) + 0.5 * normals[0],)

    def h(self, states: Any, positions: Any) -> Any:
        return super().h(states, positions)[..., :1]

    def jacobian(self, states: Any, positions: Any) -> Any:
        return super().jacobian(states, positions)[..., :1, :]
