"""LoRa at 868 MHz: time on air and reach of an SX1276 at 125 kHz and coding rate 4/5 (Semtech data sheet, 4.1.1)."""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil
from typing import Final

BANDWIDTH_HZ: Final = 125_000
PREAMBLE_SYMBOLS: Final = 8
NOISE_DBM: Final = -117.0
"""Thermal noise in 125 kHz, and a noise figure of 6 dB."""
SENSITIVITY_DBM: Final = {7: -123.0, 8: -126.0, 9: -129.0, 10: -132.0, 11: -134.5, 12: -137.0}
PAYLOAD_BYTES: Final = {7: 242, 8: 242, 9: 115, 10: 51, 11: 51, 12: 51}
"""The longest payload per spreading factor, LoRaWAN regional parameters for EU 863-870 MHz."""
DUTY: Final = 0.01
"""The share of an hour in which a device may send from 868.0 to 868.6 MHz (ETSI EN 300 220-2): 36 s."""
LOUD_DBM: Final = 14.0
"""With more than these 25 mW it may send from 869.4 to 869.65 MHz alone, with up to 500 mW,"""
LOUD_DUTY: Final = 0.1
"""and there for this share of an hour."""


@dataclass(frozen=True, slots=True)
class Lora:
    """A spreading factor, 7 to 12."""

    sf: int

    @property
    def symbol_ns(self) -> int:
        """The length of a symbol."""
        return (1_000_000_000 << self.sf) // BANDWIDTH_HZ

    def airtime_ns(self, frame_bytes: int) -> int:
        """Time on air with explicit header and CRC; low data rate optimisation from SF11 on, as 125 kHz demands."""
        slow = self.sf >= 11
        bits = 8 * frame_bytes - 4 * self.sf + 28 + 16
        symbols = 8 + max(ceil(bits / (4 * (self.sf - 2 * slow))) * 5, 0)
        return (4 * (PREAMBLE_SYMBOLS + symbols) + 17) * self.symbol_ns // 4  # 4.25 symbols end the preamble

    def prr(self, snr_db: float, frame_bytes: int) -> float:
        """All or nothing: whether the signal is as strong as the sensitivity."""
        return float(snr_db >= SENSITIVITY_DBM[self.sf] - NOISE_DBM)
