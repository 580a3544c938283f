"""Frames of fields that hear targets pass: interests, data and fixes of anybody, with anything that they can hold."""

from __future__ import annotations

import struct
from dataclasses import replace
from typing import Any, Final

import msgpack

from launcher.plan.prepare import load, planned
from launcher.records import Plan
from tests.hostile import field
from tests.hostile.frames import DATA, aloud, inbox, stamp
from tests.hostile.samples import ALARM, Bad, Draw, Known, Sample
from trackfield.tracking.stored import VERSION
from trackfield.wire import registry
from trackfield.wire.codec import decode, encode
from trackfield.wire.interests import Data, Interest
from trackfield.wire.passes import FixReport
from trackfield.wire.raw import Raw, pack

LIVES: Final = ("base", "n000", "n001")
SETTINGS: Final = ("sensor.waveform=false", "architecture.interest_s=3600")
KINDS: Final = [one for one in registry.product_kinds() if 60 <= one.number <= 67]


def plan_of(heads: str) -> Plan:
    """The packaged field, with such heads."""
    return planned(load("yang-ecpa", settings=[*SETTINGS, f"architecture.heads={heads}"]), field.SPEED)


def known_of(plan: Plan) -> Known:
    """What a peer can find out about such a run."""
    nodes = tuple(place.id for place in plan.info.places if place.id != "base")
    return Known(nodes, "base", tuple(one.name for one in plan.processes), plan.info.trackers)


def belief(draw: Draw) -> bytes:
    """Of a target anywhere, over a state of one to six numbers."""
    n = draw.randint(1, 6)
    size = draw.choice([1e-20, 1.0, 20.0, 1e7, 1e30])
    mean = [draw.uniform(-size, size) for _ in range(n)]
    triangle = [draw.choice([0.1, 1.0, size]) if i == j else 0.0 for i in range(n) for j in range(i, n)]
    known = struct.pack(f"<{n + len(triangle)}f", *mean, *triangle)
    told: bytes = msgpack.packb([VERSION, 5, None, {draw.choice(["ml", "ecpa", "other"]): (1, n, known)}])
    return told


def raw(draw: Draw) -> bytes:
    """Of sensors of the field, or one more."""
    rows = [Raw(draw.randint(0, 5), draw.uniform(0, 6.5), draw.uniform(-300, 300), draw.choice([0.0, 1.0]))] * 4
    return draw.choice([pack(rows), draw.junk(60)])


def value(draw: Draw, of: registry.Field, depth: int) -> Any:
    """Something that the field of a message can hold; small numbers, which are of use, most often."""
    if not isinstance(of, registry.Bytes):
        low, high = of.scaled.low, of.scaled.high
        if of.integral:
            return draw.choice([draw.randint(int(low), min(int(high), 4)), int(low), int(high)])
        return draw.choice([draw.uniform(low, high), max(low, 0.0), high, 30.0 if high >= 30.0 else high])
    match of.name:
        case "sink" | "origin":
            return draw.choice([draw.anyone(), draw.anyone(), draw.stranger()]).encode()[: of.blob.most]
        case "belief":
            return belief(draw)
        case "raw":
            return raw(draw)
    return encode(message(draw, depth - 1)) if depth else draw.junk(40)


def message(draw: Draw, depth: int = 1) -> Any:
    """Any of them; data has another one in it."""
    kind = draw.choice(KINDS)
    while not depth and any(isinstance(one, registry.Bytes) and one.name == "message" for one in kind.fields):
        kind = draw.choice(KINDS)
    return kind.cls(*(value(draw, one, depth) for one in kind.fields))


def answering(draw: Draw) -> Any:
    """Data with a fix for an interest that was heard, or what may be the next refresh of that."""
    heard = [one for one in draw.known.heard_below("data/") if one.payload and one.key.endswith("/interest")]
    wanted = [asked for one in heard if isinstance(asked := decode(one.payload), Interest)]
    if not wanted:
        return message(draw)
    asked = draw.choice(wanted)
    if draw.random() < 0.5:
        return replace(asked, refresh=(asked.refresh + 1) % 65536, hops=draw.choice([0, 1, 3, 255]))
    fix = FixReport(draw.randrange(1000), draw.randint(1, 5), 0, belief(draw), raw(draw))
    return Data(asked.sink, asked.number, draw.node().encode(), draw.randrange(1000), 0, 1, encode(fix))


def forged(draw: Draw) -> Sample:
    """Under a name of the field, to all or to one of them."""
    said = draw.choice([message, answering])(draw)
    name = registry.kind_of(said).name
    key = draw.choice([aloud(draw.anyone(), name), inbox(draw.anyone(), draw.choice(LIVES), name)])
    return Sample(key, encode(said), stamp(draw))


FORGED: Final = Bad("forged message of a field that hears", DATA, ALARM, forged)
"""Not among ``ALL``: no run that is attacked as processes has such messages."""
