"""Figures that Yang et al. published, and those of an independent prototype on the setups of ``setups``."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, NamedTuple

from launcher.reproduce.papers.yang.solved.solving import ECPA, ECPA_ALL, ML, PLANE
from launcher.reproduce.papers.yang.trials.field import MPH, SPEED
from launcher.reproduce.papers.yang.trials.setups import LAWS, PLACES, RADII, SPEEDS, area_case, place_case, speed_case
from launcher.reproduce.tables import Band


class Means(NamedTuple):
    """Mean errors: of the location (m), the speed (m/s) and the heading (deg)."""

    location: float
    speed: float
    heading: float


_VELOCITY, *_ = LAWS
USUAL_CASE: Final = speed_case("constant", SPEED)
SLOW: Final = speed_case(_VELOCITY, SPEEDS[0])
AT_30_MPH: Final = speed_case(_VELOCITY, SPEED)
FAST: Final = speed_case(_VELOCITY, SPEEDS[-1])
PLACES_OFF: Final = place_case(PLACES[-1])
LARGE: Final = area_case(RADII[-1])

PUBLISHED: Final[Mapping[str, Means]] = {
    SLOW: Means(1.35, 1.3, 5.5),
    AT_30_MPH: Means(1.0, 0.76, 3.5),
    FAST: Means(0.7, 0.2, 0.5),
    PLACES_OFF: Means(1.8, 0.8, 6.0),
    LARGE: Means(4.0, 4.0, 10.0),
}
"""Of ECPA in simulations: sec. 6.2 to 6.4, the ends of figs. 14 to 16."""
PROTOTYPE: Final[Mapping[str, Mapping[str, Means]]] = {
    SLOW: {ECPA: Means(1.74, 0.67, 5.6), ECPA_ALL: Means(1.22, 0.67, 5.6)},
    AT_30_MPH: {
        ECPA: Means(1.34, 0.58, 4.2), ECPA_ALL: Means(0.99, 0.58, 4.2), PLANE: Means(0.67, 0.45, 2.4),
        ML: Means(0.47, 0.45, 1.14),
    },
    FAST: {ECPA: Means(0.45, 0.21, 0.57), ECPA_ALL: Means(0.31, 0.21, 0.57)},
    PLACES_OFF: {ECPA: Means(2.65, 1.2, 7.3), ECPA_ALL: Means(2.2, 1.2, 7.3)},
    LARGE: {ECPA: Means(4.7, 0.82, 8.5), ECPA_ALL: Means(3.8, 0.82, 8.5)},
    "5 nodes, 1 silent": {ML: Means(0.87, 0.53, 1.6)},
    "clocks 100 ms": {ML: Means(0.61, 0.66, 1.4)},
}  # fmt: skip
"""Mean errors."""
SUCCESS: Final[Mapping[str, tuple[float, Band]]] = {
    "exact": (1.0, Band(0.99, 1.0)),
    "times 0.01 s": (0.70, Band(0.62, 0.78)),
    "times 0.03 s": (0.28, Band(0.20, 0.36)),
    "times 0.1 s": (0.09, Band(0.03, 0.15)),
}
"""The share of runs in which the original algorithm is right: the prototype's, and where it should lie."""
ENHANCED: Final[Mapping[str, tuple[float, Band]]] = {
    "exact": (1.0, Band(0.95, 1.0)),
    "times 0.1 s": (0.98, Band(0.95, 1.0)),
    "times 0.1 s, places 5 m": (0.79, Band(0.75, 1.0)),
}
"""The same of the enhanced one."""
TO_BOUND: Final = 1.2
"""What the root mean square errors of ``ml`` may be of the bound, in heading and speed."""
END_TO_END: Final = Means(0.6, 0.15, 1.0)
"""What ``fit`` and ``ml`` should reach from sound at 10 dB."""
SOUND: Final[Mapping[str, Means]] = {
    "argmax + ecpa": Means(4.8, 1.95, 17.6), "fit + ecpa": Means(0.57, 0.09, 0.9), "fit + ml": Means(0.31, 0.04, 0.29),
}  # fmt: skip
"""The prototype's errors from sound."""
DETECTORS: Final[Mapping[str, float]] = {"argmax": 0.3, "fit": 0.015}
"""The prototype's sd of a time, in widths d / v."""
OTHERS: Final[Mapping[str, float]] = {"EKF": 8.877, "LAT": 9.362, "EKF & LAT": 11.306}
"""Root mean square errors (m) that the paper quotes of others, from other data (sec. 5.1, after its reference 5)."""
FIELD: Final = Means(1.78, 3.25 * MPH, 5.375)
"""The means of Table 1."""
