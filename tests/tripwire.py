"""A sensor that reports by itself; in a module of its own, as each node of a run imports it."""

from __future__ import annotations

from dataclasses import dataclass
from math import dist
from typing import Any


@dataclass(frozen=True)
class Trip:
    """Tells how far away a target was when it was closest."""

    range_m: float = 60.0
    sd_m: float = 2.0

    resolution = (0.01,)
    units = ("m",)
    fix_sensors = 3
    rhythm = "events"

    @property
    def sd(self) -> tuple[float, ...]:
        return (self.sd_m,)

    def simulate(self, target: Any, position: Any, normals: Any) -> tuple[float, ...]:
        return (dist(target[:2], position) + self.sd_m * normals[0],)

    def h(self, states: Any, positions: Any) -> Any:
        import numpy as np

        return np.linalg.norm(states[..., None, :2] - positions, axis=-1)[..., None]

    def jacobian(self, states: Any, positions: Any) -> Any:
        import numpy as np

        slopes = np.zeros((*states.shape[:-1], len(positions), 1, 4))
        slopes[..., 0, :2] = (states[..., None, :2] - positions) / np.maximum(self.h(states, positions), 1e-6)
        return slopes
