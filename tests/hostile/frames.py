"""Bad frames: on the plane that models the radio."""

from __future__ import annotations

import struct
import time
from dataclasses import replace
from typing import Any

import msgpack

from tests.hostile.samples import ALARM, EITHER, REFUSED, Draw, Means, Sample, bad
from trackfield.role import NS
from trackfield.wire import Doa, Envelope, Threshold, encode
from trackfield.wire.messages import NOWHERE, Hop, HopAck, Measurement, Route, SyncReply, SyncRequest, Track

DATA = "data"
CELL = "x0_y0"
"""The field that is attacked is within one."""


def report(draw: Draw) -> bytes:
    """A bearing that points anywhere, as loud as can be."""
    step = max(draw.known.now_ns // NS, 1)
    return encode(Doa(step, draw.uniform(0, 359), draw.uniform(60, 90)))


def stamp(draw: Draw, sent_ns: int | None = None, incarnation: int = 0, copy: int = 0) -> bytes:
    """An envelope of just now."""
    if sent_ns is None:
        sent_ns = max(draw.known.now_ns - draw.randrange(NS // 2), 0)
    return Envelope(sent_ns, incarnation, copy, draw.randrange(1000), time.monotonic_ns()).pack()


def aloud(src: str, kind: str, cell: str = CELL) -> str:
    """The key of a broadcast."""
    return f"data/field/all/{cell}/{src}/{kind}"


def inbox(src: str, dst: str, kind: str = "doa", medium: str = "field") -> str:
    return f"data/{medium}/to/{dst}/{src}/{kind}"


def to_centre(draw: Draw, payload: bytes, attachment: bytes | None) -> Sample:
    """A frame that looks like one of a node's."""
    return Sample(inbox(draw.node(), draw.known.centre), payload, attachment)


def frames_heard(draw: Draw) -> list[Sample]:
    return [sample for sample in draw.known.heard_below("data/") if sample.attachment]


# --- what no process would take for a message ------------------------------------------------------------------------


@bad(DATA, REFUSED)
def no_message(draw: Draw) -> Sample:
    return to_centre(draw, draw.junk(256), stamp(draw))


@bad(DATA, REFUSED)
def oversized(draw: Draw) -> Sample:
    size = draw.choice([257, 300, 4097, 5000, 100_000])
    return to_centre(draw, draw.choice([b"\x90", b"\x00", b"\xff"]) * size, stamp(draw))


@bad(DATA, REFUSED)
def another_version_or_kind(draw: Draw) -> Sample:
    version, kind = draw.choice([(2, 1), (0, 1), (1, 0), (1, 99), (1, 255), (-1, 1), (2**63, 1)])
    return to_centre(draw, msgpack.packb([version, kind, 3, 100, 6000]), stamp(draw))


@bad(DATA, REFUSED)
def wrong_fields(draw: Draw) -> Sample:
    fields: list[int | float] = draw.choice(
        [[3, 40000, 6000], [3, -1, 6000], [70000, 1, 1], [3, 1], [3, 1, 1, 1], [True, 1, 1], [1.5, 1, 1]]
    )
    return to_centre(draw, msgpack.packb([1, 1, *fields]), stamp(draw))


def to_centre_as_track(draw: Draw, payload: bytes) -> Sample:
    return Sample(inbox(draw.node(), draw.known.centre, "track"), payload, stamp(draw))


@bad(DATA, REFUSED)
def oversized_track(draw: Draw) -> Sample:
    return to_centre_as_track(draw, msgpack.packb([1, 6, 0, 0, 0, 1, 4, bytes(draw.randint(3400, 9000)), b""]))


@bad(DATA, REFUSED)
def track_with_wrong_fields(draw: Draw) -> Sample:
    fields: list[Any] = draw.choice(
        [[0, 0, 0, 1, 4, bytes(56)], [0, 0, 0, 1, 4, 56, 8], [0, 0, 0, 1, 4, "belief", ""], [0, 0, 0, 1, 4, None, []]]
        + [[0, 0, 0, form, size, draw.junk(), b""] for form, size in ((0, 4), (4, 4), (1, 3), (1, 17), (-1, 2**40))]
        + [[0, -1, 0, 1, 4, b"", b""], [0, 0, 256, 1, 4, b"", b""], [0, 0, 0, 1, 4, bytes(1025), bytes(2049)]]
    )
    return to_centre_as_track(draw, msgpack.packb([1, 6, *fields]))


@bad(DATA, REFUSED)
def any_value(draw: Draw) -> Sample:
    return to_centre(draw, msgpack.packb(draw.value()), stamp(draw))


@bad(DATA, REFUSED)
def key_of_another_kind(draw: Draw) -> Sample:
    message = draw.choice([Threshold(3, 60.0), SyncReply(1, 2, 3, 4), Measurement(3, (1, 2))])
    return to_centre(draw, encode(message), stamp(draw))


# --- bad envelopes ----------------------------------------------------------------------------------------------------


@bad(DATA, REFUSED)
def no_envelope(draw: Draw) -> Sample:
    """At a speed other than 1 its arrival says nothing about emulated time."""
    return to_centre(draw, report(draw), None)


@bad(DATA, REFUSED)
def bad_envelope(draw: Draw) -> Sample:
    negative = b"\xff" * 8 + bytes(16)
    lengths = [bytes(n) for n in (0, 1, 23, 25, 27, 29)]
    return to_centre(draw, report(draw), draw.choice([*lengths, draw.junk(20), negative, negative + bytes(4)]))


@bad(DATA, REFUSED)
def nothing_without_a_version(draw: Draw) -> Sample:
    """An empty payload takes a frame back, but this one is final."""
    return to_centre(draw, b"", stamp(draw))


@bad(DATA, REFUSED)
def sent_in_the_future(draw: Draw) -> Sample:
    ahead = draw.choice([30 * NS, 3600 * NS, 2**62])
    return to_centre(draw, report(draw), stamp(draw, min(draw.known.now_ns + ahead, 2**63 - 1)))


@bad(DATA, ALARM)
def life_that_nobody_has(draw: Draw) -> Sample:
    return to_centre(draw, report(draw), stamp(draw, incarnation=draw.choice([2, 3, 500, 65535])))


# --- strangers --------------------------------------------------------------------------------------------------------


@bad(DATA, REFUSED)
def sender_that_nobody_knows(draw: Draw) -> Sample:
    return Sample(inbox(draw.stranger(), draw.anyone()), report(draw), stamp(draw))


@bad(DATA, REFUSED)
def receiver_that_nobody_knows(draw: Draw) -> Sample:
    return Sample(inbox(draw.stranger(), draw.stranger()), report(draw), stamp(draw))


@bad(DATA, REFUSED)
def medium_that_nobody_has(draw: Draw) -> Sample:
    key = inbox(draw.stranger(), draw.known.centre, medium=draw.choice(["backbone", "air", "\x1b[31m"]))
    return Sample(key, report(draw), stamp(draw))


@bad(DATA, REFUSED)
def broadcast_of_a_stranger(draw: Draw) -> Sample:
    return Sample(aloud(draw.stranger(), "doa", draw.choice([CELL, "x9_y9", "all"])), report(draw), stamp(draw))


@bad(DATA, REFUSED)
def key_that_is_none(draw: Draw) -> Sample:
    centre = draw.known.centre
    keys = [
        f"data/field/to/{centre}",
        f"data/field/to/{centre}/n000",
        f"data/field/to/{centre}/n000/doa/more/and/more",
        f"data/field/to/{centre}/\x1b[2J\x1b]0;pwned\x07/doa",
        f"data/field/to/{centre}/n0\n00/doa",
        f"data/field/to/{centre}/{'y' * 40_000}/doa",
        f"data/field/to/{centre}/\u202en000/doa",
        "data/field/to/*/n000/doa",
        f"data/field/to/{centre}/*/doa",
        f"data/field/to/{centre}/**",
        "data/**",
        "**",
    ]
    return Sample(draw.choice(keys), report(draw), stamp(draw))


@bad(DATA, REFUSED)
def deleted_frame(draw: Draw) -> Sample:
    return Sample(inbox(draw.node(), draw.known.centre), means=Means.DELETE)


# --- frames of the field, once more ----------------------------------------------------------------------------------


@bad(DATA, REFUSED)
def frame_once_more(draw: Draw) -> Sample | None:
    frames = frames_heard(draw)
    return draw.choice(frames) if frames else None


@bad(DATA, ALARM)
def frame_once_more_with_other_content(draw: Draw) -> Sample | None:
    frames = [sample for sample in frames_heard(draw) if sample.key.endswith("/doa")]
    return replace(draw.choice(frames), payload=report(draw)) if frames else None


def versioned(draw: Draw) -> tuple[Sample, Envelope] | None:
    """A frame of a process of the run, and its envelope."""
    heard = ((sample, Envelope.unpack(sample.attachment or b"")) for sample in frames_heard(draw))
    frames = [(sample, envelope) for sample, envelope in heard if envelope.version is not None]
    return draw.choice(frames) if frames else None


@bad(DATA, ALARM)
def frame_taken_back(draw: Draw) -> Sample | None:
    """In the name of its sender."""
    if (frame := versioned(draw)) is None:
        return None
    sample, envelope = frame
    version = (envelope.version or 0) + draw.choice([1, 2, 2**31])
    return replace(sample, payload=b"", attachment=replace(envelope, version=version).pack())


@bad(DATA, ALARM)
def frame_replaced(draw: Draw) -> Sample | None:
    """By another report, also without a version: as if that one were final."""
    frame = versioned(draw)
    if frame is None or not frame[0].key.endswith("/doa"):
        return None
    sample, envelope = frame
    version = draw.choice([(envelope.version or 0) + 1, None])
    return replace(sample, payload=report(draw), attachment=replace(envelope, version=version).pack())


@bad(DATA, REFUSED)
def frame_taken_back_by_a_stranger(draw: Draw) -> Sample | None:
    if (frame := versioned(draw)) is None:
        return None
    _, envelope = frame
    back = replace(envelope, version=(envelope.version or 0) + 1).pack()
    return Sample(inbox(draw.stranger(), draw.known.centre), b"", back)


@bad(DATA, EITHER)
def mutated_frame(draw: Draw) -> Sample | None:
    frames = frames_heard(draw)
    if not frames:
        return None
    frame = draw.choice(frames)
    if draw.random() < 0.5:
        return replace(frame, payload=draw.mutated(frame.payload))
    return replace(frame, attachment=draw.mutated(frame.attachment or b""))


# --- forgeries under names of the field -----------------------------------------------------------------------------


@bad(DATA, ALARM)
def forged_report(draw: Draw) -> Sample:
    return to_centre(draw, report(draw), stamp(draw, copy=draw.choice([0, 0, 7])))


@bad(DATA, ALARM)
def forged_report_of_the_past(draw: Draw) -> Sample:
    return to_centre(draw, report(draw), stamp(draw, draw.randrange(max(draw.known.now_ns, 1))))


@bad(DATA, ALARM)
def forged_threshold(draw: Draw) -> Sample:
    step = max(draw.known.now_ns // NS, 1)
    return Sample(
        inbox(draw.known.centre, draw.node(), "threshold"), encode(Threshold(step, draw.uniform(0, 150))), stamp(draw)
    )


@bad(DATA, ALARM)
def forged_track_by_radio(draw: Draw) -> Sample:
    """Of no sense, or of the target somewhere else; the centre does not take tracks."""
    belief = draw.choice([draw.junk(), struct.pack("<14f", 5000, -5000, 0, 0, 9, 0, 0, 0, 9, 0, 0, 1, 0, 1)])
    numbers = b"".join(draw.randrange(65536).to_bytes(2, "little") for _ in range(draw.randrange(9)))
    track = Track(draw.known.now_ns // 1000, draw.randrange(10**6), draw.randrange(256), 1, 4, belief, numbers)
    return to_centre_as_track(draw, encode(track))


@bad(DATA, ALARM)
def forged_time(draw: Draw) -> Sample:
    heard = (sample for sample in frames_heard(draw) if sample.payload)
    asked = [sample for sample in heard if sample.key.endswith("/sync-request")]
    request = msgpack.unpackb(draw.choice(asked).payload) if asked else [1, 2, 0, 0]
    wrong_us = draw.randrange(10**9)
    reply = SyncReply(request[2], request[3], wrong_us, wrong_us)
    return Sample(inbox(draw.known.centre, draw.node(), "sync-reply"), encode(reply), stamp(draw))


@bad(DATA, ALARM)
def forged_question_for_the_time(draw: Draw) -> Sample:
    request = SyncRequest(draw.randrange(65536), draw.randrange(10**9))
    return Sample(inbox(draw.node(), draw.known.centre, "sync-request"), encode(request), stamp(draw))


@bad(DATA, ALARM)
def forged_beacon(draw: Draw) -> Sample:
    """A node says that it is the best way, or none, or that its parent is whatever comes to mind."""
    parent = draw.choice([draw.anyone(), draw.stranger(), ""]).encode()
    route = Route(draw.randrange(65536), draw.choice([0.0, 1.0, draw.uniform(0, 100), NOWHERE]), 1, parent)
    return Sample(aloud(draw.node(), "route"), encode(route), stamp(draw))


@bad(DATA, ALARM)
def forged_hop(draw: Draw) -> Sample:
    """A message of somebody, or nobody, to anywhere, that has come any way and holds anything."""
    origin, to = (draw.choice([draw.anyone(), draw.stranger()]).encode() for _ in range(2))
    message = draw.choice([report(draw), draw.junk(), b""])
    hops, cost = draw.choice([0, 1, 63, 64, 255]), draw.choice([0.0, 1.0, NOWHERE])
    hop = Hop(origin, draw.randrange(65536), hops, cost, draw.choice([b"", to]), message)
    return Sample(inbox(draw.node(), draw.anyone(), "hop"), encode(hop), stamp(draw))


@bad(DATA, ALARM)
def forged_acknowledgement(draw: Draw) -> Sample | None:
    """Of a message that is under way, if one was heard."""
    heard = [sample for sample in frames_heard(draw) if sample.key.endswith("/hop") and sample.payload]
    if not heard:
        return None
    _, _, origin, number, *_ = msgpack.unpackb(draw.choice(heard).payload)
    return Sample(inbox(draw.node(), draw.node(), "hop-ack"), encode(HopAck(origin, number)), stamp(draw))
