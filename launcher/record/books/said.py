"""Payloads in words, and frames as rows of messages.parquet."""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple

from launcher.records import MessageRow
from trackfield.drivers.engine.frames import Frame
from trackfield.protocols.collection.links import text_of
from trackfield.sensing.complete import Kind
from trackfield.sensing.kinds import SENSORS, known_kind
from trackfield.wire.codec import WireError, decode, kind_name
from trackfield.wire.messages import (
    NOWHERE,
    Hop,
    HopAck,
    Measurement,
    Route,
    SyncReply,
    SyncRequest,
    Threshold,
    Track,
)
from trackfield.wire.outside import Carried as Parcel


class Said(NamedTuple):
    """The content of a payload: in words; of a report also its numbers, in the units of its kind, and its step."""

    text: str
    values: tuple[float, ...] = ()
    step: int | None = None


@cache
def _own_kinds() -> tuple[Kind, ...]:
    """Trackfield's own kinds with messages of their own, which need no settings to be told in words."""
    kinds = (known_kind(name, {}) for name in SENSORS.own)
    return tuple(kind for kind in kinds if kind.message is not Measurement)


def describe(payload: bytes, kind: Kind | None = None) -> Said:
    """The content of a payload in words, if need be those of its sender's ``kind`` of sensing; never raises."""
    try:
        message = decode(payload)
    except WireError as error:
        return Said(f"malformed ({error.reason})")
    match message:
        case Route() | HopAck():
            return Said(_about_tree(message))
        case Hop():
            return _on_its_way(message, kind)
        case Parcel():
            return _over_backbone(message)
    return _told(message, kind)


def _told(message: Any, kind: Kind | None) -> Said:
    """The content of a message that no tree is about."""
    kind = next((one for one in (kind, *_own_kinds()) if one is not None and one.takes(message)), None)
    if kind is not None:
        try:
            return Said(kind.words(message), tuple(map(float, kind.values(message))), message.step)
        except Exception:  # noqa: BLE001  a user's own methods
            return Said(repr(message), step=message.step)
    match message:
        case Threshold(_, level_db):
            text = f"report from {level_db:.2f} dB on"
        case SyncRequest(exchange, sent_us):
            text = f"what time is it? (exchange {exchange}, here {sent_us / 1e6:.6f} s)"
        case SyncReply(exchange, left_us=left_us):
            text = f"it is {left_us / 1e6:.6f} s (exchange {exchange})"
        case Track(at_us, age_ms, tracker, sensors=sensors):
            of = f"tracker {tracker}, {len(sensors) // 2} reports, {age_ms / 1000:.3f} s old"
            text = f"the track at {at_us / 1e6:.3f} s ({of})"
        case _:
            return Said(repr(message), step=getattr(message, "step", None))
    return Said(text)


def _about_tree(message: Route | HopAck) -> str:
    """What a process says of a tree."""
    if isinstance(message, HopAck):
        return f"message {message.number} of {text_of(message.origin)} is here"
    if message.cost == NOWHERE:
        way = "no way to the base is known"
    else:
        over = f" over {text_of(message.parent)}" if message.parent else ""
        way = f"{message.cost:.2f} transmissions to the base{over}"
    return f"{way}{', who knows one?' if message.pull else ''} (beacon {message.number})"


def _on_its_way(hop: Hop, kind: Kind | None) -> Said:
    """What a message of a tree carries; a report counts as one on its first hop, when it leaves its sensor."""
    to = f" to {text_of(hop.to)}" if hop.to else ""
    what = f"message {hop.number} of {text_of(hop.origin)}{to}, hop {hop.hops + 1}"
    if not hop.message:
        return Said(f"here I am ({what})")
    try:
        inner = decode(hop.message)
    except WireError as error:
        return Said(f"malformed: {error.reason} ({what})")
    said = Said("a message of a tree") if isinstance(inner, Route | Hop | HopAck) else _told(inner, kind)
    values, step = (said.values, said.step) if hop.hops == 0 and not to else ((), None)
    return Said(f"{kind_name(inner)}: {said.text} ({what})", values, step)


def _over_backbone(parcel: Parcel) -> Said:
    """What a message carries that goes over several hops of a backbone."""
    to = text_of(parcel.destination)
    what = f"message {parcel.number} of {text_of(parcel.origin)} to {to}, hop {parcel.hops + 1}"
    try:
        inner = decode(parcel.message)
    except WireError as error:
        return Said(f"malformed: {error.reason} ({what})")
    said = Said("a message on its way") if isinstance(inner, Parcel) else _told(inner, None)
    return Said(f"{kind_name(inner)}: {said.text} ({what})")


def row_of(frame: Frame, hearer: str, outcome: str, due_ns: int | None, said: Said, local_ns: int | None) -> MessageRow:
    """What became of a frame at a hearer."""
    return MessageRow(
        frame.kind, frame.src, hearer, frame.medium, frame.sent_ns, due_ns, outcome, len(frame.payload), frame.copy,
        frame.incarnation, said.text, said.values, said.step, local_ns, frame.payload,
    )  # fmt: skip
