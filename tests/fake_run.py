"""A made-up but plausible run for a ``Timeline``: a grid of sensors, a target on an arc, a lossy radio."""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from launcher.records import BATTERY, SENSES, TRACKS, FieldInfo, MessageRow, Place, Truth
from launcher.timeline.timeline import Timeline
from trackfield.role import NS, TrackPoint

TRACKERS = ("imm-ukf", "spcpf")
NODE, CENTRE = frozenset({SENSES, BATTERY}), frozenset({TRACKS})
HEARING_M = 95.0
DEADLINE_NS = 300_000_000

PHASES = {4: "tracking", 40: "coasting", 43: "tracking"}

Call = tuple[int, str, tuple[Any, ...]]


def info(side: int = 11, steps: int = 60, gaps: tuple[tuple[float, float], ...] = ()) -> FieldInfo:
    """``side`` x ``side`` sensors on a grid of 50 m, a fusion centre amid them, a path of 4 points a step."""
    half = 25.0 * (side - 1)
    sensors = [
        Place(f"n{row * side + column:03}", "node", 50.0 * column - half, 50.0 * row - half, NODE)
        for row in range(side)
        for column in range(side)
    ]
    return FieldInfo(
        run="fake-1",
        scenario="fake",
        layers={place.id: "rays" for place in sensors},
        places=(*sensors, Place("fusion", "fusion", 0.0, 0.0, CENTRE)),
        truths=(Truth("target", tuple((t / 4, *where(t / 4, half)) for t in range(4 * steps + 1)), gaps),),
        trackers=TRACKERS,
        end_s=float(steps + 1),
        marks=((12.0, "n005", "freeze until 18 s"),),
        receptions=tuple(
            link
            for place in sensors
            for share in [1 / (1 + (math.hypot(place.x, place.y) / 260) ** 8)]
            for link in ((place.id, "fusion", share), ("fusion", place.id, share**0.5))
        ),
    )


def where(t: float, half: float = 250.0) -> tuple[float, float]:
    """The target: an arc around the middle that opens slowly, at about 20 m/s for a field of half 250 m."""
    angle = -2.5 + 0.085 * t
    radius = half * (0.5 + 0.35 * t / 60)
    return radius * math.sin(angle), 0.85 * radius * math.cos(angle)


def calls(field: FieldInfo, seed: int = 1) -> Iterator[Call]:
    """(time, method, arguments) of the run, in order of time."""
    rng = random.Random(seed)
    found: list[Call] = [
        (0, "state", (0, place.id, "asleep" if place.role == "node" else "waiting")) for place in field.places
    ]
    heard: set[str] = set()
    awake: set[str] = set()
    for step, (t, x, y) in enumerate(field.truths[0].points[4::4], 1):
        now = round(t * NS)
        for place in field.places:
            if place.role != "node":
                continue
            distance = math.dist((place.x, place.y), (x, y))
            found += _states(now, place.id, distance, heard, awake)
            if distance < HEARING_M:
                found.append(_report(now, place, (x, y), rng))
                found += _telemetry(now, step, place.id, rng)
        done = now + DEADLINE_NS
        if step in PHASES:
            found.append((done, "state", (done, "fusion", PHASES[step])))
        found += [(done, "estimate", (_point(name, step, (x, y), rng), (x, y))) for name in TRACKERS]
    found += _misfortunes(field)
    found.append((0, "note", (0, "fusion", "two trackers on the same reports")))
    return iter(sorted(found, key=lambda call: call[0]))


def play(timeline: Timeline, events: Iterator[Call], flush_ns: int = NS // 4) -> None:
    """Makes the calls, with a flush every so often in emulated time; the caller closes."""
    due = flush_ns
    for t_ns, method, arguments in events:
        while t_ns >= due:
            timeline.flush()
            due += flush_ns
        function: Callable[..., None] = getattr(timeline, method)
        function(*arguments)


def _states(now: int, name: str, distance: float, heard: set[str], awake: set[str]) -> Iterator[Call]:
    reports, wakes = distance < HEARING_M, distance < HEARING_M + 40
    if reports != (name in heard) or wakes != (name in awake):
        state = "reporting" if reports else "awake" if wakes else "asleep"
        yield now, "state", (now, name, state)
    for group, member in ((heard, reports), (awake, wakes)):
        (group.add if member else group.discard)(name)


def _telemetry(now: int, step: int, name: str, rng: random.Random) -> Iterator[Call]:
    """A sensor that reports empties its battery, one that stands further along the more; its clock is set."""
    yield now, "battery", (now, name, max(0.0, 1 - 0.04 * step * rng.random()))
    yield now, "clock_error", (now, name, rng.gauss(0, 3))
    yield now, "queue", (now, name, rng.choice((1, 1, 2, 5)))


def _misfortunes(field: FieldInfo) -> Iterator[Call]:
    """A fault that was planned as such, and two deaths; one of the dead is started again."""
    sensors = [place.id for place in field.places if place.role == "node"]
    for t_s, name, why in ((15, sensors[0], "battery empty"), (25, sensors[-1], "killed")):
        yield t_s * NS, "death", (t_s * NS, name, why)
    yield 18 * NS, "fault", (18 * NS, "n005", "freeze ends")
    yield 45 * NS, "state", (45 * NS, sensors[-1], "asleep")


def _report(now: int, place: Place, target: tuple[float, float], rng: random.Random) -> Call:
    bearing = math.degrees(math.atan2(target[0] - place.x, target[1] - place.y)) + rng.gauss(0, 3)
    delay = round(rng.uniform(4e6, 9e6)) + round(rng.expovariate(1 / 4e6))
    fate = rng.random()
    outcome = "radio" if fate < 0.12 else "late" if fate < 0.15 else "delivered"
    if outcome == "late":
        delay += DEADLINE_NS
    lost = outcome == "radio"
    row = MessageRow(
        kind="doa",
        src=place.id,
        dst="fusion",
        medium="field",
        sent_ns=now,
        due_ns=None if lost else now + delay,
        outcome=outcome,
        bytes=14,
        text=f"DOA {bearing % 360:.1f}° I={rng.uniform(0.4, 3):.2f}",
        values=(bearing % 360, 60.0),
        local_ns=now + 2_000_000,
    )
    return now if lost else now + delay, "message", (row,)


def _point(tracker: str, step: int, truth: tuple[float, float], rng: random.Random) -> TrackPoint:
    if step < 4:
        return TrackPoint(tracker, "target", step * NS, "waiting", step=step)
    sd = 2.0 if tracker == "spcpf" else 3.0
    turn = math.radians(25 + 3 * step)
    axes = np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]]) * (2.4 * sd, sd)
    covariance = np.zeros((4, 4))
    covariance[:2, :2] = axes @ axes.T
    covariance[2:, 2:] = np.eye(2)
    mean = np.array(truth) + axes @ (rng.gauss(0, 1), rng.gauss(0, 1))
    particles = b""
    if tracker == "spcpf":
        cloud = np.array([[rng.gauss(0, 1), rng.gauss(0, 1)] for _ in range(200)])
        particles = (mean + cloud @ axes.T).astype("<f4").tobytes()
    return TrackPoint(
        tracker,
        "target",
        step * NS,
        "tracking",
        (*map(float, mean), 10.0, 0.0),
        tuple(map(float, covariance.ravel())),
        tuple(f"n{i:03}" for i in range(9)),
        particles=particles,
        step=step,
    )
