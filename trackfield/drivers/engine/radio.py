"""A process's radios and wires, one for each medium: each sends one frame at a time, listens or sleeps, draws power.

Pure functions of a ``Life``. A wire on which frames take no time has no queue, and one without a device no energy.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

from trackfield.drivers.engine.conditions import QUEUE, Conditions
from trackfield.drivers.engine.frames import Arrival, Frame, Overflowed, Queued
from trackfield.drivers.engine.life import Life
from trackfield.drivers.engine.receiver import Opening, Receiver, Windows
from trackfield.wire.keys import Medium

ALWAYS: Final = Receiver()
"""One that was never switched."""


def send(life: Life, frame: Frame, given: Conditions) -> tuple[Life, Frame | None, Queued | Overflowed | None]:
    """Give the radio of its medium a frame, at its ``sent_ns``.

    Returns the life, the frame with the instant at which it leaves and its copy number (None if it never leaves, as the
    queue is full or this life ends before), and telemetry about it.
    """
    t, medium = frame.sent_ns, frame.medium
    ahead = tuple(end for end in life.sending.get(medium, ()) if end > t)
    if len(ahead) > given.queues.get(medium, QUEUE):
        return life, None, Overflowed(frame)
    leaves = max(t, *ahead) if ahead else t
    if leaves >= given.kill_ns:
        return life, None, None
    copies = {address: count for address, count in life.copies.items() if address[0] >= t}
    address = (leaves, frame.kind, frame.to, frame.medium)
    copy = copies.get(address, 0)
    copies[address] = copy + 1
    frame, life = replace(frame, sent_ns=leaves, copy=copy), life._replace(copies=copies)
    cost = given.cost(frame)
    meter = life.meter.sent(medium, leaves, given.air_ns(frame, cost), cost.ack_air_ns)
    sending = {**life.sending, medium: (*ahead, leaves + cost.busy_ns) if cost.busy_ns else ahead}
    life = life._replace(sending=sending, meter=meter)
    return life, frame, Queued(frame.kind, leaves, leaves - t, len(ahead)) if leaves > t else None


def hears_from(life: Life, arrival: Arrival) -> int | None:
    """From when on a frame that is due now is heard; None: its receiver is asleep."""
    frame, fate = arrival.frame, arrival.fate
    receiver = life.receivers.get(frame.medium, ALWAYS)
    return receiver.hears_from(arrival.due_ns, fate.span_ns, frame.preamble_ns)


def hear(life: Life, arrival: Arrival, from_ns: int, given: Conditions) -> Life:
    """The life after it received a frame, which it heard from then on, and acknowledged it if required."""
    medium, fate = arrival.frame.medium, arrival.fate
    receiver = life.receivers.get(medium, ALWAYS)
    woken = isinstance(receiver.opening, Windows)
    heard_ns = arrival.due_ns - from_ns if woken else given.air_ns(arrival.frame, fate)
    return life._replace(meter=life.meter.received(medium, heard_ns, fate.ack_air_ns))


def switch(life: Life, opening: Opening, medium: Medium, t_ns: int) -> Life:
    """The life with this receiver open in this way from then on."""
    receiver = life.receivers.get(medium, ALWAYS).changed(opening, t_ns)
    return life._replace(receivers={**life.receivers, medium: receiver}, meter=life.meter.switched(medium, opening))
