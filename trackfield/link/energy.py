"""Power figures of devices by name, in exact integers.

Powers are in microwatts and energies in femtojoules, so that power times nanoseconds is an energy. They are integers,
so that the instant at which a battery is empty does not depend on the order in which the two drivers add.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
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
