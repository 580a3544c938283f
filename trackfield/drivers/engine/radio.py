"""A process's radio: it sends one frame at a time, listens or sleeps, and uses energy all the time.

Pure functions of a ``Life``. The medium ``field`` is the radio; a ``backbone`` is a wire without queue or energy cost.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

from trackfield.drivers.engine.conditions import Conditions
from trackfield.drivers.engine.frames import Arrival, Frame, Overflowed, Queued
from trackfield.drivers.engine.life import Life, Receiver
from trackfield.wire.keys import Medium

RADIO: Final[Medium] = "field"


def send(life: Life, frame: Frame, given: Conditions) -> tuple[Life, Frame | None, Queued | Overflowed | None]:
    """Give the radio a frame, at its ``sent_ns``.

    Returns the life, the frame with the instant at which it leaves and its copy number (None if it never leaves, as the
    queue is full or this life ends before), and telemetry about it.
    """
    t = frame.sent_ns
    ahead = tuple(end for end in life.sending if end > t) if frame.medium == RADIO else ()
    if len(ahead) > given.queue:
        return life, None, Overflowed(frame)
    leaves = max(t, *ahead) if ahead else t
    if leaves >= given.kill_ns:
        return life, None, None
    copies = {address: count for address, count in life.copies.items() if address[0] >= t}
    address = (leaves, frame.kind, frame.to, frame.medium)
    copy = copies.get(address, 0)
    copies[address] = copy + 1
    frame, life = replace(frame, sent_ns=leaves, copy=copy), life._replace(copies=copies)
    if frame.medium == RADIO:
        cost = given.cost(frame)
        meter = life.meter.used(send_ns=given.air_ns(cost, frame.payload), receive_ns=cost.ack_air_ns)
        sending = (*ahead, leaves + cost.busy_ns) if cost.busy_ns else ahead
        life = life._replace(sending=sending, meter=meter)
    return life, frame, Queued(frame.kind, leaves, leaves - t, len(ahead)) if leaves > t else None


def listens(life: Life, medium: Medium, t_ns: int) -> bool:
    """Whether a frame due then is heard."""
    receiver = life.receivers.get(medium)
    return receiver is None or receiver.at(t_ns)


def hear(life: Life, arrival: Arrival, given: Conditions) -> Life:
    """The life after it received a frame, and acknowledged it if required."""
    if arrival.frame.medium != RADIO:
        return life
    heard = given.air_ns(arrival.fate, arrival.frame.payload)
    return life._replace(meter=life.meter.used(receive_ns=heard, send_ns=arrival.fate.ack_air_ns))


def switch(life: Life, on: bool, medium: Medium, t_ns: int) -> Life:
    """The life with this receiver on or off from then on."""
    old = life.receivers.get(medium, Receiver(True, -1, True))
    new = Receiver(on, t_ns, old.before if old.since_ns == t_ns else old.on)
    meter = life.meter._replace(on=on) if medium == RADIO else life.meter
    return life._replace(receivers={**life.receivers, medium: new}, meter=meter)
