"""What a device draws from its battery: figures of radios, in exact integers.

Powers are in microwatts and energies in femtojoules, so that power times nanoseconds is an energy. Integers, because
whether a battery is empty must not depend on the order in which two drivers add.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

CAUSES: Final = ("send", "receive", "listen", "sleep", "sense")
"""What energy is spent for."""


@dataclass(frozen=True, slots=True)
class Power:
    """The figures of one device.

    While its radio sends, receives, listens in vain or is off it draws ``send_uw``, ``receive_uw``, ``listen_uw``,
    ``sleep_uw``; ``sample_fj`` is spent on each reading of a sensor. ``battery_fj`` is what the battery holds (None:
    mains). A link that knows no radio does not say how long a frame is on air: then it is ``overhead_bytes`` longer
    than its payload, and a byte takes ``byte_ns``.
    """

    send_uw: int
    receive_uw: int
    listen_uw: int
    sleep_uw: int
    sample_fj: int = 0
    battery_fj: int | None = None
    byte_ns: int = 32_000
    overhead_bytes: int = 17


DEVICES: Final = {"cc2420": Power(52_200, 56_400, 56_400, 1_400)}


def first_order_send(bits: int, distance_m: float) -> float:
    """stand-in"""
    return 0.0


def first_order_receive(bits: int) -> float:
    """stand-in"""
    return 0.0
