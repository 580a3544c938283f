"""Directed diffusion over random fields: what arrives, by how many messages, and how soon.

    python -m tests.diffusion [--fields 20]

prints a table for losses of 0, 10 and 30 % of all frames on each link, with all relays alive and with five of them
killed. A field is ``NODES`` processes at random in a square of ``SIDE_M``, with a radio that reaches ``REACH_M``; those
that are not connected are left out, and how many are is printed, too, also for radios that reach less far. One process
is the sink, and wants data of all. After two refreshes each of the others makes ``REPORTS`` reports, at random within
``SPAN_S``. Relays are killed in the middle of that time, at once; counted then are the reports after that of those that
live and are connected with the sink. A report is lost, too, if its process knows of no interest then. A frame reaches
each process in reach of its sender or not, as drawn by key, after 2 to 6 ms. Collisions are left out, as in the link
models.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping
from math import dist
from statistics import mean, median
from typing import Final, NamedTuple

from tests.diffusing import Field, Place
from tests.ether import DELAY_NS
from tests.puppet import MS
from trackfield.draw import uniform
from trackfield.role import NS

NODES: Final = 25
SIDE_M: Final = 100.0
REACH_M: Final = 40.0
REACHES_M: Final = (20.0, 25.0, 30.0, 35.0, 40.0)
LOSSES: Final = (0.0, 0.1, 0.3)
KILLED: Final = 5
REPORTS: Final = 5
SETTLED_S: Final = 8.0
SPAN_S: Final = 20.0
FIELDS: Final = 20
DRAWS: Final = 2000
"""Fields of which is counted how many are connected."""
SINK: Final = "n00"


def places(seed: int) -> dict[str, Place]:
    """Who stands where."""
    ids = [f"n{i:02d}" for i in range(NODES)]
    return {id: (SIDE_M * uniform(seed, "x", id), SIDE_M * uniform(seed, "y", id)) for id in ids}


def hops_to_sink(at: Mapping[str, Place], reach_m: float) -> dict[str, int]:
    """How many hops each process is from the sink, of those that are connected with it."""
    found, rim = {SINK: 0}, [SINK]
    for one in rim:
        near = [id for id in at if id not in found and dist(at[id], at[one]) <= reach_m]
        found |= dict.fromkeys(near, found[one] + 1)
        rim += near
    return found


def connected(at: Mapping[str, Place], reach_m: float) -> bool:
    """Whether all processes are connected."""
    return len(hops_to_sink(at, reach_m)) == len(at)


def fields() -> Iterator[tuple[int, dict[str, Place]]]:
    """Connected fields, and their seeds."""
    seed = 0
    while True:
        if connected(at := places(seed), REACH_M):
            yield seed, at
        seed += 1


class Lossy(Field):
    """A field whose frames are lost with the probability ``loss``, and take 2 to 6 ms."""

    def __init__(self, at: Mapping[str, Place], reach_m: float, loss: float, seed: int) -> None:
        self.loss, self.seed, self.tries = loss, seed, 0
        super().__init__(at, reach_m, seed=seed)

    def _delays(self, kind: str, src: str, dst: str) -> tuple[int, ...]:
        self.tries += 1
        if not self.reaches(src, dst) or uniform(self.seed, "loss", self.tries) < self.loss:
            return ()
        return (int((2 + 4 * uniform(self.seed, "delay", self.tries)) * MS) - DELAY_NS,)


class Report(NamedTuple):
    """A report: whose, which, when it was sent, by how many hops it could arrive; when it did (None: it did not)."""

    origin: str
    step: int
    at_ns: int
    hops: int
    came_ns: int | None = None


class Seen(NamedTuple):
    """The reports of a field, frames that carried them or were sent for it, floods, and all other frames."""

    reports: list[Report]
    frames: int
    floods: int
    upkeep: int


def run(seed: int, at: Mapping[str, Place], loss: float, killed: int) -> Seen:
    """One field."""
    field = Lossy(at, REACH_M, loss, seed)
    field.ask(SINK)
    ids = [id for id in at if id != SINK]
    times = sorted((uniform(seed, "told", id, i), id, i) for id in ids for i in range(REPORTS))
    left, sent, since = dict(at), list[Report](), 0
    for share, id, i in times:
        at_ns = int((SETTLED_S + SPAN_S * share) * NS)
        if killed and share > 0.5 and len(left) == len(at):
            dead = sorted(ids, key=lambda one: uniform(seed, "killed", one))[:killed]
            field.kill(*dead)
            left = {one: place for one, place in at.items() if one not in dead}
            sent, since = [], at_ns
        hops = hops_to_sink(left, REACH_M)
        field.run(at_ns)
        if id in left:
            field.tell(id, i)
            sent += [Report(id, i, at_ns, hops[id])] if id in hops else []
    field.wait(5)
    came = {(one.sender, one.message.step): one.now for one in reversed(field.actors[SINK].role.arrived)}
    reports = [one._replace(came_ns=came.get((one.origin, one.step))) for one in sent]
    data = [one for one in field.frames("data") if one.message.message]
    carried = [*data, *field.frames("data-ack"), *field.frames("reinforce")]
    floods = sum(text.endswith("is spread: no neighbour takes it") for t_ns, _, text in field.notes if t_ns >= since)
    frames = sum(one.t_ns >= since for one in carried)
    return Seen(reports, frames, floods, len(field.sent) - len(carried))


def row(name: str, seen: list[Seen]) -> str:
    """A line of the table; the upkeep is frames without reports, of a process in a minute."""
    reports = [one for field in seen for one in field.reports]
    came = [(one.came_ns - one.at_ns, one.hops) for one in reports if one.came_ns is not None]
    delays = sorted(ns / hops / MS for ns, hops in came)
    late = delays[int(0.95 * (len(delays) - 1))]
    frames, floods = sum(one.frames for one in seen), sum(one.floods for one in seen)
    upkeep = sum(one.upkeep for one in seen) / len(seen) / NODES / ((SETTLED_S + SPAN_S + 5) / 60)
    share, hops = 100 * len(came) / len(reports), mean(one.hops for one in reports)
    cells = f"{share:.2f} %", f"{hops:.2f}", f"{frames / len(reports):.1f}", f"{100 * floods / len(reports):.1f}"
    return " | ".join((f"| {name}", *cells, f"{median(delays):.0f} ms", f"{late:.0f} ms", f"{upkeep:.0f} |"))


def table(count: int) -> Iterator[str]:
    """The table, line by line."""
    yield "| loss | killed | arrived | hops | frames a report | floods in 100 | a hop, median | 95 % | upkeep |"
    yield "| --- | --- | --- | --- | --- | --- | --- | --- | --- |"
    for killed in (0, KILLED):
        for loss in LOSSES:
            seen = [run(seed, at, loss, killed) for (seed, at), _ in zip(fields(), range(count), strict=False)]
            yield row(f"{100 * loss:.0f} % | {killed}", seen)


def main() -> None:
    """Print it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--fields", type=int, default=FIELDS)
    count = parser.parse_args().fields
    for reach_m in REACHES_M:
        whole = sum(connected(places(seed), reach_m) for seed in range(DRAWS))
        print(f"radio {reach_m:.0f} m: {whole} of {DRAWS} fields are connected", flush=True)
    for line in table(count):
        print(line, flush=True)


if __name__ == "__main__":
    main()
