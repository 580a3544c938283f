"""Power figures of devices by name, in exact integers.

Powers are in microwatts and energies in femtojoules, so that power times nanoseconds is an energy. They are integers,
so that the instant at which a battery is empty does not depend on the order in which the two drivers add.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

CAUSES: Final = ("send", "receive", "listen", "sleep", "sense")
"""The causes of energy use."""


@dataclass(frozen=True, slots=True)
class Power:
    """The figures of one device, its processor included.

    While its radio sends, receives, only listens or is off it draws ``send_uw``, ``receive_uw``, ``listen_uw``,
    ``sleep_uw``; ``sample_fj`` is spent on each reading of a sensor. ``battery_fj`` is what the battery holds (None:
    mains). A link without a radio model gives no time on air: then a frame is ``overhead_bytes`` longer
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


NODE_UW: Final = 6_000
"""The power of a sensor node besides its radio, in every state: Castalia's baseline, 6 mW. It is part of all four
powers of a node below, also asleep; the rest is the power of its radio."""


def _node(send_uw: int, receive_uw: int, sleep_uw: int, byte_ns: int = 32_000, overhead_bytes: int = 17) -> Power:
    """A sensor node with this radio, which takes the same power for listening as for receiving."""
    send_uw, receive_uw, sleep_uw = send_uw + NODE_UW, receive_uw + NODE_UW, sleep_uw + NODE_UW
    return Power(send_uw, receive_uw, receive_uw, sleep_uw, byte_ns=byte_ns, overhead_bytes=overhead_bytes)


DEVICES: Final[Mapping[str, Power]] = {
    # CC2420 data sheet (TI SWRS041), at 3 V: 17.4 mA sending at 0 dBm, 18.8 mA receiving. Sleep: Castalia, 1.4 mW.
    "cc2420": _node(52_200, 56_400, 1_400),
    # The same behind a CC2591 (TI SWRS070), which adds 100 mA sending at 20 dBm, 3.4 mA receiving in high-gain mode,
    # and 0.1 uA switched off.
    "cc2420-20dbm": _node(352_200, 66_600, 1_400),
    # SX1276 at 3.3 V and 125 kHz: 10.8 mA receiving, and 44 mA sending at 14 dBm by Semtech's LoRa calculator; 0.2 uA
    # asleep (data sheet, table 6). Bytes as at SF9, where 7.2 bits go into a symbol of 4.096 ms; preamble and LoRaWAN's
    # header are as long as 34 of them.
    "sx1276": _node(145_200, 35_640, 1, byte_ns=4_551_111, overhead_bytes=34),
    # ESP8266 (Espressif, electrical characteristics), at 3.3 V: 145 mA sending at 16 dBm, the power listed next to 15;
    # 60 mA receiving 802.11b; 0.9 mA in standby. The processor is on the chip and in these figures. The long preamble
    # of 192 us is as long as 24 bytes, ahead of 36 of headers.
    "wifi11b": Power(478_500, 198_000, 198_000, 2_970, byte_ns=8_000, overhead_bytes=60),
}
"""Devices by name, on mains, with sensors that use no energy: the defaults of a scenario."""

SENDING_UW: Final[Mapping[str, tuple[tuple[float, int], ...]]] = {
    # CC2420 data sheet, table 9, at 3 V
    "cc2420": (
        (-25.0, 25_500), (-15.0, 29_700), (-10.0, 33_600), (-7.0, 37_500), (-5.0, 41_700), (-3.0, 45_600),
        (-1.0, 49_500), (0.0, 52_200),
    ),
    # the amplifier is taken to draw at lower powers what it draws at 20 dBm
    "cc2420-20dbm": ((20.0, 352_200),),
    # SX1276 data sheet, table 10, at 3.3 V: 20 mA at 7 dBm, 29 at 13 (RFO), 87 at 17, 120 at 20 (PA_BOOST)
    "sx1276": ((7.0, 66_000), (13.0, 95_700), (14.0, 145_200), (17.0, 287_100), (20.0, 396_000)),
    "wifi11b": ((16.0, 478_500),),
}  # fmt: skip
"""What the radios alone draw when they send, by transmit power (dBm) in increasing order, up to the most they have."""


def sending_at(device: str, tx_dbm: float) -> Power:
    """The figures of a device that sends with this power, or with the nearest one that is known of it.

    Between the powers of its data sheet, by linear interpolation in dB.
    """
    table, power = SENDING_UW[device], DEVICES[device]
    at_dbm = min(max(tx_dbm, table[0][0]), table[-1][0])
    i = max(bisect_left(table, at_dbm, key=lambda point: point[0]), 1) if len(table) > 1 else 0
    (x0, y0), (x1, y1) = table[max(i - 1, 0)], table[i]
    draws_uw = y0 + (round((y1 - y0) * (at_dbm - x0) / (x1 - x0)) if i else 0)
    return replace(power, send_uw=draws_uw + (0 if device == "wifi11b" else NODE_UW))
