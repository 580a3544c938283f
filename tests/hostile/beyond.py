"""Frames for the processes beyond a gateway, and telemetry of theirs: from anybody, and whatever they can hold."""

from __future__ import annotations

from typing import Any, Final

from launcher.plan.prepare import load, planned
from launcher.records import Plan
from tests.camera_fields import HOPS
from tests.hostile import field, passes
from tests.hostile.frames import DATA, inbox, stamp
from tests.hostile.samples import ALARM, Bad, Draw, Known, Sample
from tests.hostile.tellings import TELEMETRY, event
from trackfield.drivers.engine.frames import Told
from trackfield.drivers.exchange.telemetry import pack
from trackfield.role import NS, Tell
from trackfield.wire import registry
from trackfield.wire.codec import encode
from trackfield.wire.passes import FixReport

HOSTS: Final = {
    "base": ("field", "backbone"),
    "hop1": ("backbone",),
    "camera-control": ("backbone", "serial"),
    "camera": ("serial",),
    "video": ("backbone",),
    "system": ("backbone",),
}
"""The lives that are attacked, with the media on which frames come to them."""
SETTINGS: Final = ("sensor.waveform=false", "architecture.interest_s=3600", "fusion.trackers=['ml']")
KINDS: Final = [one for one in registry.product_kinds() if 70 <= one.number <= 78]
TOPICS: Final = {
    "motion": 6, "aimed": 11, "camera": 1, "gateway": 5, "exposed": 2, "order": 4, "refused order": 2, "unheard-of": 3,
}  # fmt: skip
"""How many values each has."""
VALUES: Final = (0, 1, -1, 60, 10**9, 0.5, 1e308, float("nan"), float("inf"), "aimed", "ready", "ok", "\x1b[2J")
PACKETS: Final = ("883001ff", "88010001ff", "9041ff", "9051ff", "906002ff", "906141ff", "8121ff", "90ff", "ff", "")


def plan_of() -> Plan:
    """The packaged field with three hops; orders are given, too."""
    settings = [*SETTINGS, *(f"{key}={value!r}" for key, value in HOPS.items() if key != "backbone.extra_loss")]
    return planned(load("yang-ecpa", settings=[*settings, "camera.orders=[[1, 'stop', 'video']]"]), field.SPEED)


def known_of(plan: Plan) -> Known:
    """What a peer can find out about such a run."""
    nodes = tuple(place.id for place in plan.info.places if place.id != "base")
    return Known(nodes, "base", tuple(one.name for one in plan.processes), plan.info.trackers)


def value(draw: Draw, of: registry.Field, depth: int) -> Any:
    """Something that the field of a message can hold; what is of use most often."""
    if not isinstance(of, registry.Bytes):
        return passes.value(draw, of, depth)
    match of.name:
        case "origin" | "destination":
            return draw.choice([draw.anyone(), draw.anyone(), draw.stranger()]).encode()[: of.blob.most]
        case "packet":
            return draw.choice([bytes.fromhex(draw.choice(PACKETS)), draw.junk(of.blob.most)])
        case "mac":
            return draw.choice([b"", draw.randbytes(8)])
    return draw.choice([inside(draw, depth), draw.junk(40)])[: of.blob.most]


def inside(draw: Draw, depth: int) -> bytes:
    """A payload: a fix, or any other message."""
    fix = FixReport(draw.randrange(1000), draw.randint(1, 60), 0, passes.belief(draw), passes.raw(draw))
    return encode(draw.choice([fix, message(draw, depth - 1) if depth else passes.message(draw, 0)]))


def message(draw: Draw, depth: int = 2) -> Any:
    """Any of the kinds beyond a gateway, with others in it."""
    kind = draw.choice(KINDS)
    return kind.cls(*(value(draw, one, depth) for one in kind.fields))


def forged(draw: Draw) -> Sample:
    """Under a name of the field, to one of those who are beyond the gateway, on any of its media."""
    said, to = message(draw), draw.choice(sorted(HOSTS))
    key = inbox(draw.anyone(), to, registry.kind_of(said).name, draw.choice(HOSTS[to]))
    return Sample(key, encode(said), stamp(draw))


def told(draw: Draw) -> Sample:
    """Values of a topic: as many as it has, or others; numbers and words, or what is none of them."""
    topic = draw.choice(sorted(TOPICS))
    count = draw.choice([TOPICS[topic], TOPICS[topic], 0, 30])
    some = tuple(draw.value(1) if draw.random() < 0.02 else draw.choice(VALUES) for _ in range(count))
    t_ns = draw.known.now_ns
    name = draw.choice(sorted(HOSTS))
    return event(name, pack(Told((t_ns, 2, t_ns, "step"), Tell(topic, some))))


FORGED: Final = Bad("forged message beyond a gateway", DATA, ALARM, forged)
TOLD: Final = Bad("forged values of a topic", TELEMETRY, ALARM, told)
"""Not among ``ALL``: no run that is attacked as processes has such messages."""
AFTER_NS: Final = 5 * NS
