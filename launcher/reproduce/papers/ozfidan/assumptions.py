"""In words: the frames, powers and times that energy is counted from, and where they differ from a prototype's."""

from __future__ import annotations

from typing import Final

from launcher.reproduce.kernels.study import Found
from launcher.reproduce.papers.ozfidan.counts import BEACON_EVERY
from launcher.reproduce.papers.ozfidan.energies import ledger, spent_mj
from launcher.reproduce.papers.ozfidan.energy import (
    BASELINE_W,
    CC2420,
    ESTIMATE,
    EVERY_1,
    EVERY_10,
    HANDOVER,
    HEADER,
    NAME,
    ON,
    RADIO,
    RANGE,
    REPORT,
    REPORTS,
    SLEEP,
    SLOTS,
    Radio,
)
from launcher.reproduce.papers.ozfidan.experiments import FALLBACK, RARELY
from launcher.reproduce.papers.ozfidan.field import T
from trackfield.link.lora868 import DUTY

CHUNK: Final = 100
"""Bytes of particles in a frame: 32 frames for 200 particles of four numbers of 4 bytes."""


def assumed(found: Found) -> str:
    """All of it, in paragraphs."""
    return "\n\n".join((_SENT, _lengths(), _accounts(), _RARELY, _differs(found), _lora()))


_SENT: Final = (
    "Counted, not sent: no frame is lost or sent twice. In each step, each slave that is awake reports to its master; "
    "each master that got reports forwards them in one frame (to the leader if it does not lead itself; without "
    "scheduling to the sink); the leader sends its estimate to the sink, and hands its belief over when the lead "
    "changes. All these are acknowledged; frames and bytes below include acknowledgements. An acknowledgement tells a "
    "slave whether to sleep. A beacon, without acknowledgement, goes to the slaves of a master that are to be awake, "
    f"when one is woken and every {BEACON_EVERY} steps; beacons are in the accounts with windows alone."
)


_RARELY: Final = (
    f"Only in the row *{RARELY}* slaves are in fact woken at every 10th step only. In the others they are woken at any "
    f"step, and the account *{EVERY_10}* says what seldom windows cost, not that they would do."
)


def _lengths() -> str:
    radio = RADIO[CC2420]
    particles, gaussian = 32 * (CHUNK + radio.overhead + radio.ack), HANDOVER + radio.overhead + radio.ack
    return (
        f"Payloads, bytes: report {REPORT}, forward {HEADER} + {RANGE} for each range, estimate {ESTIMATE}, hand-over "
        f"{HANDOVER}, beacon {HEADER} + {NAME} for each slave. IEEE 802.15.4 (CC2420 at 3 V: 17.4 mA sending, 18.8 mA "
        f"receiving, 5.1 uA asleep) adds {radio.overhead} bytes, acknowledges with {radio.ack}, and takes 32 us for a "
        f"byte. LoRa (SX1276 at 14 dBm) adds and acknowledges with {RADIO['LoRa SF7'].overhead}. Each frame is paid "
        "for at the sender and at the receiver, the sink's receiver, too. A hand-over of 200 particles would take 32 "
        f"frames and {particles} bytes with their acknowledgements, in place of {gaussian}."
    )


def _accounts() -> str:
    windows = ", ".join(f"{name} {1e3 * one.window_s:.1f} ms" for name, one in RADIO.items())
    return (
        f"The accounts: *{REPORTS}*: these frames. *{SLEEP}*: and the sleep of all slaves. *{EVERY_10}*, *{EVERY_1}*: "
        f"to that the windows in which those listen that sleep and have a master ({windows}: 5 ms, or two symbols), "
        f"and beacons. *{ON}*: {SLEEP}, and masters whose receivers are on when they do not send. *{SLOTS}*: {SLEEP}, "
        "and masters that sleep but in the slots of their own frames, by clocks that cost nothing. Without scheduling "
        f"nobody opens windows. The baseline is the {1e3 * BASELINE_W:g} mW of all that a node has besides its radio: "
        "during frames in the first account, always for slaves in the others, and for masters, too, in the last two."
    )


def _differs(found: Found) -> str:
    radio = RADIO[CC2420]
    window_mj = 1e3 * radio.window_s * radio.receive_w
    asleep = float(ledger(found, FALLBACK).counts["asleep"].mean())
    ours, theirs = (
        float(spent_mj(ledger(found, FALLBACK, scheduled=scheduled), CC2420, REPORTS).mean())
        for scheduled in (True, False)
    )
    return (
        f"Where ours differ from the prototype's: a window of 5 ms costs {window_mj:.3f} mJ with CC2420, so that "
        f"{asleep:.0f} sleepers that listen in every step take {asleep * window_mj:.1f} mJ; all frames without "
        f"scheduling take {theirs:.1f} mJ, those of {FALLBACK} {ours:.2f} mJ. The prototype's ratios with windows are "
        "those of windows that cost about half as much, and its ratio with slots is that of masters that cost less "
        "than sleep does here. That all frames are acknowledged, and that a master forwards in one frame, was read off "
        "the prototype's frames and bytes of a step, which do not say so: that these agree is no check of ours."
    )


def _lora() -> str:
    loras = ", ".join(
        f"{name} {1e3 * _report_s(one):.0f} ms, {_report_s(one) / T:.1%} of the time"
        for name, one in RADIO.items()
        if name != CC2420
    )
    return (
        f"With LoRa a report every {T:g} s takes {loras}; by law a device may send {DUTY:.0%} of the time at 868.0 to "
        "868.6 MHz. Where the channel is in use for more than the whole time, the frames do not fit into one channel "
        "at all, and the energy is that of as many channels as it takes."
    )


def _report_s(radio: Radio) -> float:
    return radio.airtime_s(REPORT + radio.overhead)
