"""Noise that is not drawn anew for every reading, and that of when a target is heard to pass."""

from __future__ import annotations

from typing import Any, Final, NamedTuple, TypeVar

T = TypeVar("T")  # float, or an array of them

SLOWEST_M_S: Final = 0.5
"""The lowest speed (m/s) of a target that passes anything: half of a walker's."""
USUAL_M_S: Final = 13.4
"""The speed (30 mph) at which the noise of times is given; Yang et al., section 5."""


class Colour(NamedTuple):
    """What the variance of a reading's noise is made of; the rest is drawn for every reading.

    ``slow`` is the share that changes slowly: of it, readings have the less in common the farther they are apart in
    time, and nothing from twice ``slow_s`` seconds on. ``fixed`` is the share that is drawn once for each sensor.
    """

    slow: float = 0.0
    slow_s: float = 10.0
    fixed: float = 0.0


def time_sd(d: T, speed: T, *, sd: float, floor_m: float, at_m: float, p: float, q: float, larger: Any = max) -> T:
    """The sd (s) of the time at which a target was heard to pass at the distance ``d`` (m) and ``speed`` (m/s).

    sd (max(d, floor_m) / at_m)^p (13.4 / speed)^q: at ``at_m`` and 30 mph it is ``sd``. For arrays that broadcast,
    ``larger`` is ``numpy.maximum``.
    """
    found: T = sd * (larger(d, floor_m) / at_m) ** p * (USUAL_M_S / larger(speed, SLOWEST_M_S)) ** q
    return found
