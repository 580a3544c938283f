"""The energy of a step, by several accounts, of frames that are counted (``counts``) and of three radios.

Payloads: a report has 8 bytes (step 2, slave 2, range 4), so that it is 25 bytes long with IEEE 802.15.4; a forward 2
and 6 for each range; an estimate 18 (step 2, four numbers of 4); a hand-over 64 (mean and covariance 56, step 2, leader
2, trace 4); a beacon 2 and 2 for each slave. All but beacons are acknowledged. Sender and receiver of each frame are
paid for, the sink's receiver, too. A slave that is awake has its radio on for its frames alone. Sleeping is paid for
during the whole step, as frames take little of it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Final, Literal, NamedTuple

import numpy as np

from launcher.reproduce.kernels.study import Figures
from launcher.reproduce.papers.ozfidan.field import T
from trackfield.filters.types import Array
from trackfield.link.energy import DEVICES, NODE_UW
from trackfield.link.radios import RADIOS

REPORT, ESTIMATE, HANDOVER = 8, 18, 64
HEADER, RANGE, NAME = 2, 6, 2
"""Bytes of payload."""
WINDOW_S: Final = 0.005
BASELINE_W: Final = 1e-6 * NODE_UW
"""What a node draws besides its radio."""


@dataclass(frozen=True)
class Radio:
    """Powers (W) of a node's radio alone, and what its frames take (bytes, s)."""

    send_w: float
    receive_w: float
    sleep_w: float
    overhead: int
    ack: int
    window_s: float
    airtime_s: Callable[[int], float]


def radio(name: str, device: str, sf: int = 9, sleep_w: float | None = None) -> Radio:
    """The figures of ``trackfield.link``; a window of ``WINDOW_S``, or as long as it takes to notice a preamble."""
    of, power = RADIOS[name](sf), DEVICES[device]
    send_w, receive_w, asleep_w = (1e-6 * (uw - NODE_UW) for uw in (power.send_uw, power.receive_uw, power.sleep_uw))
    return Radio(
        *(send_w, receive_w, asleep_w if sleep_w is None else sleep_w, of.overhead_bytes, of.ack_bytes),
        window_s=max(WINDOW_S, 1e-9 * of.detect_ns),
        airtime_s=lambda frame_bytes: 1e-9 * of.airtime_ns(frame_bytes),
    )


CC2420: Final = "CC2420"
RADIO: Final[Mapping[str, Radio]] = {
    CC2420: radio("802154-0dbm", "cc2420", sleep_w=5.1e-6 * 3.0),
    "LoRa SF7": radio("lora868", "sx1276", 7),
    "LoRa SF9": radio("lora868", "sx1276", 9),
}
"""By name. CC2420: 17.4 mA sending and 18.8 mA receiving at 3 V, 5.1 uA asleep with its processor."""


class Account(NamedTuple):
    """What is paid for besides frames: that slaves ``sleep``, windows ``every`` so many steps and beacons, masters."""

    sleep: bool = False
    every: int | None = None
    masters: Literal["frames", "on", "slots"] = "frames"


REPORTS, SLEEP, EVERY_10, EVERY_1 = "reports only", "slaves asleep", "windows every 10 steps", "windows every step"
ON, SLOTS = "masters always on", "masters in slots"
ACCOUNTS: Final[Mapping[str, Account]] = {
    REPORTS: Account(),
    SLEEP: Account(sleep=True),
    EVERY_10: Account(sleep=True, every=10),
    EVERY_1: Account(sleep=True, every=1),
    ON: Account(sleep=True, masters="on"),
    SLOTS: Account(sleep=True, masters="slots"),
}
"""By name: frames, and the sleep of the slaves besides; to this the windows in which sleepers listen, and beacons; or
masters whose receivers are always on; or masters who sleep but in the slots of their own frames."""


class Ledger(NamedTuple):
    """The ``counts`` of R runs, of fields of so many slaves and masters; ``scheduled``, or without scheduling."""

    counts: Figures
    slaves: int
    masters: int
    scheduled: bool = True


class Traffic(NamedTuple):
    """Frames of one kind: so many (R,) in a step; ``masters`` is how many of sender and receiver are masters."""

    kind: str
    payload: int
    number: Array
    masters: int
    hearers: int = 1
    acked: bool = True


def traffic(ledger: Ledger) -> Iterator[Traffic]:
    """All frames, by kind and length."""
    counts = ledger.counts
    yield Traffic("report", REPORT, counts["reports"], 1)
    for n, count in enumerate(counts["forwards"].T):
        yield Traffic("forward", HEADER + RANGE * n, count, 2 if ledger.scheduled else 1)
    yield Traffic("estimate", ESTIMATE, counts["estimates"], 1)
    yield Traffic("hand-over", HANDOVER, counts["handovers"], 2)
    for n, count in enumerate(counts["beacons"].T):
        yield Traffic("beacon", HEADER + NAME * n, count, 1, hearers=n, acked=False)


def frames(ledger: Ledger) -> Array:
    """Frames (R,) in a step, acknowledgements among them, without beacons."""
    return _sum((1 + one.acked) * one.number for one in traffic(ledger) if one.kind != "beacon")


def sent_bytes(ledger: Ledger, radio: Radio) -> Array:
    """The bytes (R,) of the same."""
    some = (one for one in traffic(ledger) if one.kind != "beacon")
    return _sum((one.payload + radio.overhead + one.acked * radio.ack) * one.number for one in some)


def on_air_s(ledger: Ledger, radio: Radio) -> Array:
    """How long (R,) frames are on the air in a step, one after the other, without beacons."""
    return _sum(sum(_airtimes(one, radio)) * one.number for one in traffic(ledger) if one.kind != "beacon")


def energy(ledger: Ledger, radio: Radio, account: Account, *, baseline: bool = False) -> Array:
    """J (R,) in a step.

    With ``baseline`` nodes draw ``BASELINE_W`` besides: during frames where these alone are paid for, else slaves all
    the time, and masters if more than their frames is paid for.
    """
    base_w = BASELINE_W if baseline else 0.0
    found = _frames(ledger, radio, account, 0.0 if account.sleep else base_w)
    if account.sleep:
        found = found + T * ledger.slaves * (radio.sleep_w + base_w)
    if account.every is not None:
        found = found + ledger.counts["asleep"] * radio.window_s * radio.receive_w / account.every
    if account.masters != "frames":
        found = found + T * ledger.masters * base_w
    if account.masters == "on":
        found = found + radio.receive_w * (T * ledger.masters - _masters_s(ledger, radio))
    elif account.masters == "slots":
        found = found + T * ledger.masters * radio.sleep_w
    return found


def _frames(ledger: Ledger, radio: Radio, account: Account, base_w: float) -> Array:
    """J (R,) for sending and receiving all frames of a step; beacons are for windows."""
    send_w, receive_w = radio.send_w + base_w, radio.receive_w + base_w
    found = np.zeros_like(ledger.counts["reports"])
    for one in traffic(ledger):
        if one.kind != "beacon" or account.every is not None:
            frame_s, ack_s = _airtimes(one, radio)
            found = found + one.number * (frame_s * (send_w + one.hearers * receive_w) + ack_s * (send_w + receive_w))
    return found


def _masters_s(ledger: Ledger, radio: Radio) -> Array:
    """How long (R,) masters send or receive in a step, all together."""
    return _sum(
        one.masters * sum(_airtimes(one, radio)) * one.number for one in traffic(ledger) if one.kind != "beacon"
    )


def _airtimes(one: Traffic, radio: Radio) -> tuple[float, float]:
    return radio.airtime_s(one.payload + radio.overhead), one.acked * radio.airtime_s(radio.ack)


def _sum(some: Iterator[Array]) -> Array:
    return np.asarray(sum(some), float)
