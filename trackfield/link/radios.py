"""Radios by name: power, noise, frames, and channel access."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from math import inf
from typing import Final

from trackfield.link import lora868, reception
from trackfield.link.access import Access, Aloha
from trackfield.link.csma import Csma
from trackfield.link.dcf import Dcf
from trackfield.link.lora868 import Lora


@dataclass(frozen=True, slots=True)
class Radio:
    """The parameters of a radio; ``what`` describes it in words.

    A payload of up to ``payload_bytes`` goes into one frame, which is ``overhead_bytes`` longer on the air.
    ``prr(snr_db, frame_bytes)`` is the share of frames received, ``airtime_ns(frame_bytes)`` the time on air of one.
    A receiver knows a frame by ``detect_ns`` of its preamble, which is ``preamble_ns`` long.
    An acknowledgement begins ``turnaround_ns`` after a frame and has ``ack_bytes``; a sender waits ``patience_ns`` for
    it. ``ack`` is the most transmissions of a frame until it is acknowledged; 0: sent once, never acknowledged.
    ``channel`` names the path loss (``CHANNELS``) under which its figures are usually given. ``duty`` is the share of
    any hour in which a device may send by law, ``loud`` the power (dBm) above which it has another share, and that one;
    no model enforces it.
    """

    what: str
    tx_dbm: float
    noise_dbm: float
    channel: str
    payload_bytes: int
    overhead_bytes: int
    ack_bytes: int
    turnaround_ns: int
    patience_ns: int
    access: Access
    airtime_ns: Callable[[int], int]
    prr: Callable[[float, int], float]
    detect_ns: int
    preamble_ns: int
    ack: int = 0
    duty: float = 1.0
    loud: tuple[float, float] = (inf, 1.0)

    def duty_at(self, tx_dbm: float) -> float:
        """The share of any hour in which a device may send with this power."""
        above_dbm, duty = self.loud
        return duty if tx_dbm > above_dbm else self.duty

    @property
    def ack_ns(self) -> int:
        """From the end of a frame to the end of its acknowledgement."""
        return self.turnaround_ns + self.airtime_ns(self.ack_bytes)


# CC2420: 250 kbit/s. Preamble, delimiter and length are 6 bytes, header and check sum 11; an acknowledgement 6 + 5.
# macAckWaitDuration is 54 symbols. A carrier is sensed over 8 symbols, as long as the preamble.
_CC2420: Final = Radio(
    what="IEEE 802.15.4 at 2.4 GHz, 250 kbit/s (CC2420)",
    tx_dbm=0.0,
    noise_dbm=-100.0,
    channel="castalia",
    payload_bytes=116,
    overhead_bytes=17,
    ack_bytes=11,
    turnaround_ns=192_000,
    patience_ns=864_000,
    access=Csma(),
    airtime_ns=lambda frame_bytes: 32_000 * frame_bytes,
    prr=reception.cc2420,
    detect_ns=128_000,
    preamble_ns=128_000,
)

# CC1000 under TinyOS: 19.2 kbit/s; the longest frame has the 50 bytes of Zuniga and Krishnamachari, 29 of them payload.
# B-MAC (Polastre et al. 2004) backs off for up to 32 byte times, whatever came before, and samples the channel for
# 350 us; its preamble has 8 bytes.
_MICA2: Final = Radio(
    what="the radio of Mica2 nodes, 19.2 kbit/s (CC1000, B-MAC)",
    tx_dbm=0.0,
    noise_dbm=-105.0,
    channel="usc",
    payload_bytes=29,
    overhead_bytes=21,
    ack_bytes=21,
    turnaround_ns=250_000,
    patience_ns=250_000 + 21 * 416_667,
    access=Csma(unit_ns=416_667, be_min=5, cca_ns=416_667, turnaround_ns=250_000),
    airtime_ns=lambda frame_bytes: 416_667 * frame_bytes,
    prr=reception.mica2,
    detect_ns=350_000,
    preamble_ns=8 * 416_667,
)

# 802.11b at its basic rate of 1 Mbit/s with the long preamble (192 us). MAC header and check sum 28 bytes, LLC and SNAP
# 8; an acknowledgement 14, after a SIFS of 10 us. A carrier is sensed within 15 us. Noise: thermal in 22 MHz, and a
# noise figure of 7 dB. Seven transmissions are the standard's short retry limit.
_WIFI11B: Final = Radio(
    what="Wi-Fi, IEEE 802.11b at its basic rate of 1 Mbit/s",
    tx_dbm=15.0,
    noise_dbm=-93.6,
    channel="castalia",
    payload_bytes=2304,
    overhead_bytes=36,
    ack_bytes=14,
    turnaround_ns=10_000,
    patience_ns=314_000,
    access=Dcf(),
    airtime_ns=lambda frame_bytes: 192_000 + 8_000 * frame_bytes,
    prr=reception.dsss_dbpsk,
    detect_ns=15_000,
    preamble_ns=144_000,
    ack=7,
)


def _lora(sf: int) -> Radio:
    """The overhead is LoRaWAN's: header 8 bytes, port 1, integrity code 4. An acknowledgement has no payload.

    It is answered as soon as the radio has turned round: LoRaWAN's receive windows, a second later, are left out.
    """
    modem, overhead, turnaround_ns = Lora(sf), 13, 1_000_000
    return Radio(
        what="LoRa at 868 MHz, with the spreading factor link.sf",
        tx_dbm=14.0,
        noise_dbm=lora868.NOISE_DBM,
        channel="petajajarvi",
        payload_bytes=lora868.PAYLOAD_BYTES[sf],
        overhead_bytes=overhead,
        ack_bytes=overhead,
        turnaround_ns=turnaround_ns,
        patience_ns=turnaround_ns + modem.airtime_ns(overhead),
        access=Aloha(),
        airtime_ns=modem.airtime_ns,
        prr=modem.prr,
        detect_ns=2 * modem.symbol_ns,
        preamble_ns=lora868.PREAMBLE_SYMBOLS * modem.symbol_ns,
        duty=lora868.DUTY,
        loud=(lora868.LOUD_DBM, lora868.LOUD_DUTY),
    )


RADIOS: Final[Mapping[str, Callable[[int], Radio]]] = {
    "802154-0dbm": lambda _: _CC2420,
    "802154-20dbm": lambda _: replace(_CC2420, what=f"{_CC2420.what} with an amplifier", tx_dbm=20.0),
    "lora868": _lora,
    "mica2": lambda _: _MICA2,
    "wifi11b": lambda _: _WIFI11B,
}
"""Makers of radios, from a spreading factor (which only LoRa uses)."""
