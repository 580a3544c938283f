"""Bad telemetry: what a process would tell the recorder and the launcher."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Final

import msgpack

from tests.hostile.samples import ALARM, REFUSED, Draw, Means, Sample, bad
from trackfield.drivers.engine.frames import Charge, Died, Frame, Overflowed, Queued, Refused, Told, Undone
from trackfield.drivers.exchange.telemetry import pack
from trackfield.role import NS, Corrected, Note, Publish, Radio, State, Tell, TrackPoint
from trackfield.wire import keys

TELEMETRY = "telemetry"
TYPES: Final = (
    "state", "radio", "note", "tell", "corrected", "died", "charge", "queued", "publish", "overflowed", "refused",
    "undone",
)  # fmt: skip
COVARIANCE: Final = (9.0, 0, 0, 0, 0, 9.0, 0, 0, 0, 0, 1.0, 0, 0, 0, 0, 1.0)


def event(name: str, payload: bytes) -> Sample:
    return Sample(f"telemetry/{name}/event", payload)


def plausible(draw: Draw) -> Told | Refused | Undone:
    """An event that a process might tell of just now."""
    t_ns = draw.known.now_ns
    some: list[tuple[Any, ...]] = [(t_ns, 2, t_ns, "step"), (t_ns, 0, "start"), (t_ns, 3)]
    key = draw.choice(some)
    frame = Frame(draw.node(), 0, "doa", t_ns, 0, draw.known.centre, "field", b"\x95\x01\x01\x01\x01\x01")
    effects: list[Any] = [
        State(draw.choice(["asleep", "tracking", "\x1b[31mred"])),
        Radio(draw.random() < 0.5),
        Note("\x1b[2J all is well"),
        Tell(draw.choice(["motion", "aimed", "\x1b[31m"]), (draw.choice([0, 1e308, "x" * 500]),) * draw.randrange(9)),
        Corrected(draw.randrange(10**9)),
        Died("battery"),
        Charge(draw.random()),
        Queued("doa", t_ns, draw.randrange(NS), 3),
        Overflowed(frame),
        Publish(point(draw)),
    ]
    if draw.random() < 0.7:
        return Told(key, draw.choice(effects))
    return Refused(frame.key(t_ns), "late") if draw.random() < 0.5 else Undone(key)


def point(draw: Draw) -> TrackPoint:
    """A place of the target, miles away."""
    step = max(draw.known.now_ns // NS, 1)
    mean = (5000.0, -5000.0, 0.0, 0.0)
    tracker = draw.choice([*draw.known.trackers, "unheard-of"])
    return TrackPoint(tracker, "target", step * NS, "tracking", mean, COVARIANCE, (draw.node(),), step=step)


@bad(TELEMETRY, REFUSED)
def event_that_is_none(draw: Draw) -> Sample:
    values = [5, [], ["state"], ["publish", [], 1], "x", None, {"state": 1}, [None, None], draw.value()]
    return event(draw.anyone(), draw.choice([msgpack.packb(draw.choice(values)), draw.junk()]))


@bad(TELEMETRY, REFUSED)
def event_of_wrong_types(draw: Draw) -> Sample:
    """Of a known type, with a value in it that is none of its own."""
    kind = draw.choice(TYPES)
    key: Any = draw.choice([5, None, "key", {}, ["x"], [None, 2], [1.5, 0, "a"], [2**64 - 1, "a"], [[], {}]])
    return event(draw.anyone(), msgpack.packb([kind, key, *(draw.value(1) for _ in range(draw.randint(0, 12)))]))


@bad(TELEMETRY, REFUSED)
def event_with_a_wrong_value(draw: Draw) -> Sample:
    """The key is right, a value is not."""
    t_ns = draw.known.now_ns
    key = [t_ns, 2, t_ns, "step"]
    wrong: dict[str, list[Any]] = {
        "state": [5, None],
        "radio": ["on", 7],
        "note": [{"a": 1}],
        "tell": ["aimed", draw.choice([5, None, "values", [None], [[1]], [{"a": 1}], [2**64 - 1]])],
        "corrected": ["soon"],
        "died": [[1]],
        "charge": ["full"],
        "queued": ["doa", "now", "long", None],
        "publish": [7, "target", "now", "tracking", [1, 2], "none", 5, "x", None, "s"],
        "overflowed": ["n000", "a", "doa", None, 0, "fusion", "air", 5],
        "refused": [{"why": 1}],
    }
    kind = draw.choice(sorted(wrong))
    return event(draw.anyone(), msgpack.packb([kind, key, *wrong[kind]]))


@bad(TELEMETRY, REFUSED)
def event_of_a_stranger(draw: Draw) -> Sample:
    name = draw.choice([draw.stranger(), f"{draw.node()}~77", "recorder", "live"])
    return event(name, pack(plausible(draw)))


@bad(TELEMETRY, REFUSED | ALARM)
def forged_event(draw: Draw) -> Sample:
    return event(draw.anyone(), pack(plausible(draw)))


@bad(TELEMETRY, REFUSED | ALARM)
def forged_track(draw: Draw) -> Sample:
    t_ns = draw.known.now_ns
    return event(draw.known.centre, pack(Told((t_ns, 2, t_ns, "step"), Publish(point(draw)))))


@bad(TELEMETRY, REFUSED | ALARM)
def forged_undoing(draw: Draw) -> Sample:
    return event(draw.known.centre, pack(Undone((draw.randrange(max(draw.known.now_ns, 1)), 0, "start"))))


@bad(TELEMETRY, REFUSED | ALARM)
def mutated_telemetry(draw: Draw) -> Sample | None:
    heard = draw.known.heard_below("telemetry/")
    if not heard:
        return None
    sample = draw.choice(heard)
    return replace(sample, payload=draw.mutated(sample.payload))


@bad(TELEMETRY, REFUSED)
def bad_counts(draw: Draw) -> Sample:
    values = [5, None, {"delivered": "many"}, {"delivered": 10**9}, {1: 2}, {"delivered": -1}, [], draw.value()]
    name = draw.choice([draw.anyone(), draw.stranger()])
    return Sample(f"telemetry/{name}/counts", draw.choice([msgpack.packb(draw.choice(values)), draw.junk()]))


@bad(TELEMETRY, REFUSED)
def bad_final_record(draw: Draw) -> Sample:
    values = [
        5,
        None,
        [],
        {},
        {"delivered": "all"},
        {"sent": None},
        {"slip": 3},
        {"stored": 5, "spent": {}},
        {"roles": {"node": {"delivered": -1}}},
        {"roles": {"node": {"lost": 1}}},
        {"roles": ["node"]},
        draw.value(),
    ]
    name = draw.choice([draw.anyone(), *draw.known.lives])
    return Sample(f"telemetry/{name}/final", draw.choice([msgpack.packb(draw.choice(values)), draw.junk()]))


@bad(TELEMETRY, REFUSED)
def final_record_of_a_stranger(draw: Draw) -> Sample:
    record = {"delivered": 3, "sent": 10**6, "asleep": 0, "slip": {1: 2}, "latency": {}, "stored": b"", "cpu_s": 0.1}
    return Sample(f"telemetry/{draw.stranger()}/final", msgpack.packb(record))


@bad(TELEMETRY, REFUSED | ALARM)
def forged_final_record(draw: Draw) -> Sample | None:
    """One that was heard, under the name of a process that lives."""
    finals = [sample for sample in draw.known.heard_below("telemetry/") if sample.key.endswith("/final")]
    return replace(draw.choice(finals), key=keys.telemetry(draw.node(), "final")) if finals else None


@bad(TELEMETRY, REFUSED)
def bytes_to_inherit(draw: Draw) -> Sample:
    name = draw.choice([draw.anyone(), draw.stranger()])
    return Sample(f"telemetry/{name}/stored", draw.junk(5000))


@bad(TELEMETRY, REFUSED)
def end_that_was_not_reached(draw: Draw) -> Sample:
    return Sample(f"telemetry/{draw.choice([draw.anyone(), draw.stranger()])}/reached", draw.choice([b"", draw.junk()]))


@bad(TELEMETRY, REFUSED)
def status_of_the_recorder(draw: Draw) -> Sample:
    escape = "\x1b[2J\x1b[31m"
    status = {"t_s": 1e9, "sent": 5, "outcomes": {escape: 3}, "states": {escape: 1}, "errors": {escape: 2.0}}
    wrong: list[Any] = [5, None, [], {}, {"t_s": "late"}, {**status, "errors": {"a": "b"}}, {**status, "outcomes": 3}]
    value = draw.choice([status, status, *wrong, draw.value()])
    return Sample("telemetry/recorder/status", draw.choice([msgpack.packb(value), draw.junk()]))


@bad(TELEMETRY, REFUSED)
def telemetry_that_is_none(draw: Draw) -> Sample:
    name = draw.anyone()
    what = [
        f"telemetry/{name}/opinion",
        f"telemetry/{name}/event/more",
        f"telemetry/{name}",
        "telemetry/\x1b[2J\x1b]0;pwned\x07/event",
        "telemetry/a\nb/final",
        f"telemetry/{'z' * 40_000}/event",
        "telemetry/*/event",
        "telemetry/*/final",
        "telemetry/*/reached",
        "telemetry/*/stored",
        "telemetry/*/spent",
        "telemetry/**",
    ]
    return Sample(draw.choice(what), draw.choice([pack(plausible(draw)), draw.junk(), b"\x05"]))


@bad(TELEMETRY, REFUSED)
def deleted_telemetry(draw: Draw) -> Sample:
    what = draw.choice(["event", "final", "counts", "stored", "spent", "reached", "status"])
    return Sample(f"telemetry/{draw.choice([draw.anyone(), 'recorder'])}/{what}", means=Means.DELETE)
