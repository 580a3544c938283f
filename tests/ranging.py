"""A kind of sensing that a user brings: how far away the target is. Its nodes need no numpy, only trackers do."""

from __future__ import annotations

from dataclasses import dataclass
from math import dist
from typing import Any


@dataclass(frozen=True)
class Ranging:
    """How far away the target is."""

    range_m: float = 100.0
    sd_m: float = 2.0

    resolution = (0.01,)
    units = ("m",)
    fix_sensors = 3

    @property
    def sd(self) -> tuple[float, ...]:
        return (self.sd_m,)

    def simulate(self, target: Any, place: Any, normals: Any) -> tuple[float, ...]:
        return (dist(target[:2], place) + self.sd_m * normals[0],)

    def h(self, x: Any, at: Any) -> Any:
        import numpy as np

        return np.linalg.norm(x[..., None, :2] - at, axis=-1)[..., None]

    def jacobian(self, x: Any, at: Any) -> Any:
        import numpy as np

        slopes = np.zeros((*x.shape[:-1], len(at), 1, 4))
        slopes[..., 0, :2] = (x[..., None, :2] - at) / np.maximum(self.h(x, at), 1e-6)
        return slopes
