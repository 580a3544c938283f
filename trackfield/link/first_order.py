"""The first-order radio model: what sending, receiving and aggregating bits cost, by distance alone.

Heinzelman, Chandrakasan, Balakrishnan (2002), "An Application-Specific Protocol Architecture for Wireless Microsensor
Networks". Much of the literature computes with it. It knows no listening, no sleep and no overhead of frames. Energies
are in femtojoules, as in ``energy``.
"""

from __future__ import annotations

from math import sqrt
from typing import Final

ELECTRONICS_FJ: Final = 50_000_000
"""Of transmitter or receiver, per bit: 50 nJ."""
FREE_SPACE_FJ: Final = 10_000
"""Of the amplifier, per bit and m^2, nearer than ``D0_M``: 10 pJ."""
MULTIPATH_FJ: Final = 1.3
"""Of the amplifier, per bit and m^4, from ``D0_M`` on: 0.0013 pJ."""
AGGREGATION_FJ: Final = 5_000_000
"""Of a processor that combines what it received, per bit: 5 nJ."""
D0_M: Final = sqrt(FREE_SPACE_FJ / MULTIPATH_FJ)
"""Where both amplifiers cost the same: 87.7 m."""


def send_fj(bits: int, distance_m: float) -> int:
    """To send that many bits that far."""
    amplifier = FREE_SPACE_FJ * distance_m**2 if distance_m < D0_M else MULTIPATH_FJ * distance_m**4
    return bits * ELECTRONICS_FJ + round(bits * amplifier)


def receive_fj(bits: int) -> int:
    """To receive that many bits."""
    return bits * ELECTRONICS_FJ


def aggregate_fj(bits: int) -> int:
    """To combine that many bits with others."""
    return bits * AGGREGATION_FJ
