"""Distances, some of them far too long, as those beside the line of sight: a kind of sensing for runs with roles."""

from __future__ import annotations

from dataclasses import dataclass
from statistics import NormalDist

from trackfield.sensing.kinds import SENSORS, register_sensor
from trackfield.sensing.range import Range
from trackfield.sensing.sensing import Numbers, Point, Scene

KIND = "range-outliers"
_NORMAL = NormalDist()
_CELLS = 1 << 20


@dataclass(frozen=True)
class Outlying(Range):
    """``Range``, of which the share ``outliers`` of the readings is too long by up to ``up_to_m``, uniformly.

    What filters know of it is what they know of ``Range``.
    """

    outliers: float = 0.1
    up_to_m: float = 20.0

    def simulate(self, scene: Scene, t_ns: int, place: Point, normals: tuple[float, ...]) -> Numbers | None:
        """See ``Sensing``."""
        normal, longer_m = self.split(normals[0])
        reading = super().simulate(scene, t_ns, place, (normal,))
        return None if reading is None else (reading[0] + longer_m,)

    def split(self, normal: float) -> tuple[float, float]:
        """Two independent draws from one of N(0, 1): another of N(0, 1), and by how much (m) the reading is too long.

        Its place u in (0, 1) decides: below ``outliers`` it is an outlier; what is left of u is uniform again, of which
        the first 20 bits are the outlier's size, and the others the noise.
        """
        u = _NORMAL.cdf(normal)
        if u >= self.outliers:
            return _gaussian((u - self.outliers) / (1.0 - self.outliers)), 0.0
        cell, rest = divmod(u / self.outliers * _CELLS, 1.0)
        return _gaussian(rest), self.up_to_m * (cell + 0.5) / _CELLS


def _gaussian(u: float) -> float:
    return _NORMAL.inv_cdf(min(max(u, 1e-12), 1.0 - 1e-12))


def known() -> None:
    """Let scenarios of this process name the kind."""
    if KIND not in SENSORS:
        register_sensor(KIND, Outlying)
