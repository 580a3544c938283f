"""The first-order radio model: the energy of sending, receiving and aggregating bits, by distance only.

Heinzelman, Chandrakasan, Balakrishnan (2002), "An Application-Specific Protocol Architecture for Wireless Microsensor
Networks". Much of the literature uses it. It has no listening, no sleep and no overhead of frames. Energies
are in femtojoules, as in ``energy``.
"""

from __future__ import annotations

from math import sqrt
from typing import Final

ELECTRONICS_FJ: Final = 50_000_000
"""Energy of transmitter or receiver, per bit: 50 nJ."""
FREE_SPACE_FJ: Final = 10_000
"""Energy of the amplifier, per bit and m^2, nearer than ``D0_M``: 10 pJ."""
MULTIPATH_FJ: Final = 1.3
"""Energy of the amplifier, per bit and m^4, from ``D0_M`` on: 0.0013 pJ."""
AGGREGATION_FJ: Final = 5_000_000
"""Energy of a processor that combines received data, per bit: 5 nJ."""
D0_M: Final = sqrt(FREE_SPACE_FJ / MULTIPATH_FJ)
"""The distance at which both amplifier terms are equal: 87.7 m."""


def send_fj(bits: int, distance_m: float) -> int:
    """Energy (fJ) of sending this many bits over this distance."""
    amplifier = FREE_SPACE_FJ * distance_m**2 if distance_m < D0_M else MULTIPATH_FJ * distance_m**4
    return bits * ELECTRONICS_FJ + round(bits * amplifier)


def receive_fj(bits: int) -> int:
    """Energy (fJ) of receiving this many bits."""
    return bits * ELECTRONICS_FJ


def aggregate_fj(bits: int) -> int:
    """Energy (fJ) of combining this many bits with others."""
    return bits * AGGREGATION_FJ
