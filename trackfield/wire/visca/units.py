"""The numbers in packets, and what they stand for: an EVI-D30's positions, speeds and limits."""

from __future__ import annotations

from typing import Final

END: Final = 0xFF
"""The last byte of a packet, and of no packet another one."""
LEAST_BYTES: Final = 3
MOST_BYTES: Final = 16
CONTROLLER: Final = 0
EVERYBODY: Final = 8
CAMERAS: Final = range(1, 8)
"""The addresses that a camera may have."""
SOCKETS: Final = (1, 2)
"""An EVI-D30 can do so many commands at a time; each has a socket, by whose number its end is told."""

PAN_DEG: Final = 100.0
TILT_DEG: Final = 25.0
PAN_STEPS: Final = 0x370
"""Of pan, either way; this is ``PAN_DEG``."""
TILT_STEPS: Final = 0x12C
"""Of tilt, either way; this is ``TILT_DEG``."""
PAN_SPEEDS: Final = range(0x01, 0x18 + 1)
"""Speeds of pan: 10/3 deg/s each (EVI-D100 manual, p. 44: 3.3, 6.7, 10.0, ... 80.0)."""
TILT_SPEEDS: Final = range(0x01, 0x14 + 1)
"""Speeds of tilt: 2.5 deg/s each (the same: 2.5, 5.0, ... 50.0)."""
ZOOM_STEPS: Final = 0x3FF
"""The tele end of an EVI-D30's zoom; its wide end is 0."""

_PAN_DEG_S: Final = 80.0 / PAN_SPEEDS[-1]
_TILT_DEG_S: Final = 50.0 / TILT_SPEEDS[-1]


def pan_steps(deg: float) -> int:
    """The position that is nearest to a pan (deg, to the right)."""
    return round(deg * PAN_STEPS / PAN_DEG)


def tilt_steps(deg: float) -> int:
    """The position that is nearest to a tilt (deg, upwards)."""
    return round(deg * TILT_STEPS / TILT_DEG)


def pan_deg(steps: int) -> float:
    """The pan (deg) of a position."""
    return steps * PAN_DEG / PAN_STEPS


def tilt_deg(steps: int) -> float:
    """The tilt (deg) of a position."""
    return steps * TILT_DEG / TILT_STEPS


def pan_deg_s(speed: int) -> float:
    """How fast pan is (deg/s) at one of ``PAN_SPEEDS``."""
    return speed * _PAN_DEG_S


def tilt_deg_s(speed: int) -> float:
    """How fast tilt is (deg/s) at one of ``TILT_SPEEDS``."""
    return speed * _TILT_DEG_S


def nibbles(number: int) -> bytes:
    """A number of 16 bits in two's complement as four bytes, four bits in each. Raises ``ValueError``."""
    bits = within(number, range(-0x8000, 0x10000)) & 0xFFFF
    return bytes([bits >> 12, bits >> 8 & 0xF, bits >> 4 & 0xF, bits & 0xF])


def unsigned(data: bytes) -> int | None:
    """The inverse of ``nibbles`` for numbers from 0 on; None if these are no four times four bits."""
    if len(data) != 4 or any(one > 0xF for one in data):
        return None
    return data[0] << 12 | data[1] << 8 | data[2] << 4 | data[3]


def signed(data: bytes) -> int | None:
    """The same for numbers from -8000h to 7FFFh."""
    bits = unsigned(data)
    return bits - 0x10000 if bits is not None and bits & 0x8000 else bits


def speeds(pan: int, tilt: int) -> bytes:
    """The speeds in a packet. Raises ``ValueError``."""
    return bytes([within(pan, PAN_SPEEDS), within(tilt, TILT_SPEEDS)])


def within(number: int, allowed: range) -> int:
    """The number, if it is in the range. Raises ``ValueError``."""
    if number not in allowed:
        raise ValueError(f"{number} is not in {allowed.start}..{allowed[-1]}")
    return number
