"""Distances made from received signal strength: what Zhou et al. (2011) leave to the nodes, and what it costs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import exp, log
from typing import Any, ClassVar

from launcher.reproduce.papers.zhou.setups import World
from trackfield.filters.types import Array, Model, Readings, Reports
from trackfield.models.ranging import distances, distances_and_slopes
from trackfield.sensing.complete import Kind


@dataclass(frozen=True)
class Converted:
    """A distance d e^(s n), n ~ N(0, 1), with s = ``share``, taken for one with Gaussian noise of sd s d."""

    range_m: float
    share: float

    resolution: ClassVar = (0.001,)

    @property
    def sd(self) -> tuple[float, ...]:
        """See ``Sensing``: that in the middle of its range."""
        return (self.share * self.range_m / 2.0,)

    def simulate(self, target: Any, place: Any, normals: Any) -> None:
        """Nothing: its readings are made from those of ``rss``."""

    def h(self, x: Array, at: Array) -> Array:
        """See ``Sensing``."""
        return distances(x, at)[..., None]

    def jacobian(self, x: Array, at: Array) -> Array:
        """See ``Sensing``."""
        return distances_and_slopes(x, at)[1][..., None, :]

    def variance(self, x: Array, at: Array) -> Array:
        """See ``Full``."""
        found: Array = (self.share * self.h(x, at)) ** 2
        return found


def converted(world: World, model: Model, *, unbiased: bool = False) -> tuple[Sequence[Reports], Model]:
    """The readings of kind ``rss`` as distances, d0 10^((P0 - P) / 10 n), and what filters then know.

    Their mean is e^(s^2 / 2) times the distance, s the shadowing's sd in the distance's logarithm; ``unbiased``
    divides by that.
    """
    rss = model.sensor
    level_dbm, exponent, (sd_db,) = rss.own.level_dbm, rss.own.exponent, rss.sd  # type: ignore[attr-defined]
    share = sd_db * log(10.0) / (10.0 * exponent)
    scale = exp(-(share**2) / 2.0) if unbiased else 1.0

    def one(reports: Reports) -> Reports:
        ((_, levels, early_s),) = reports.readings
        away = scale * 10.0 ** ((level_dbm - levels) / (10.0 * exponent))
        return replace(reports, readings=(Readings("converted", away, early_s),))

    kind = Kind("converted", Converted(rss.range_m, share))
    return [one(some) for some in world.reports], Model({"converted": kind}, model.sigma_v)
