"""From which load on the link models flatter a field: they against a simulation in which frames collide.

    python -m tests.crowding

prints the tables of docs/scenarios.md (a minute). The same reports of the same nodes to one hub go through the link
model, where each frame has its fate alone, and through a simulation that shares nothing with it but places, signal
strengths and reception curves: its senders listen to each other or do not, its frames collide unless one captures the
hub, and a radio that sends is deaf.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from heapq import heappop, heappush
from itertools import count, pairwise
from math import cos, log, sin, sqrt, tau
from random import Random
from typing import Any, Final, NamedTuple

from launcher.plan.air import CAPTURE_DB, Due, air_of
from trackfield.link import make_link
from trackfield.link.csma import Csma
from trackfield.link.fate import Transmission
from trackfield.link.lognormal_prr import LognormalPrr

NODES: Final = 40
SIZE: Final = 12
HUB: Final = "hub"
S: Final = 1_000_000_000


class Case(NamedTuple):
    """Nodes in a disc of this radius (m) around their hub, under this link."""

    name: str
    radius_m: float
    link: dict[str, Any]


CC2420: Final = {"model": "lognormal_prr", "radio": "802154-0dbm"}
CASES: Final = (
    Case("LoRa, SF9", 500.0, {"model": "lognormal_prr", "radio": "lora868", "sf": 9}),
    Case("802.15.4, all hear each other", 10.0, CC2420),
    Case("802.15.4, hidden nodes", 60.0, CC2420),
    Case("the same, `ack = 3`", 60.0, {**CC2420, "ack": 3}),
)
LOADS: Final = (0.005, 0.01, 0.02, 0.03, 0.05, 0.07, 0.1, 0.15, 0.2, 0.3, 0.5)
AT_ONCE: Final = (2, 3, 4, 6, 8, 12, 16, 24, 32)


class Report(NamedTuple):
    """A report of this node, made at this instant (ns)."""

    at_ns: int
    node: str


@dataclass
class Sending:
    """A transmission of the simulation."""

    begin_ns: int
    end_ns: int
    src: str


@dataclass
class Simulation:
    """An event-driven simulation of CSMA or ALOHA with collisions, capture and half duplex.

    ``got`` counts the reports that the hub received, ``met`` the first transmissions that overlapped another there.
    """

    link: LognormalPrr
    random: Random
    tries: int
    got: int = 0
    met: int = 0
    _air: list[Sending] = field(default_factory=list)
    _events: list[tuple[int, int, Any]] = field(default_factory=list)
    _order: Any = field(default_factory=count)
    _waiting: dict[str, list[Any]] = field(default_factory=dict)
    _db: dict[tuple[str, str], float] = field(default_factory=dict)

    def run(self, reports: Sequence[Report]) -> None:
        """Send all of these."""
        for report in reports:
            self._at(report.at_ns, lambda now, node=report.node: self._made(now, node))
        while self._events:
            now, _, event = heappop(self._events)
            event(now)

    def _at(self, t_ns: int, event: Any) -> None:
        heappush(self._events, (t_ns, next(self._order), event))

    def _made(self, now: int, node: str) -> None:
        """A node sends one report after the other."""
        queue = self._waiting.setdefault(node, [])
        queue.append(None)
        if len(queue) == 1:
            self._begin(now, node, 1, False)

    def _done(self, now: int, node: str, heard: bool) -> None:
        self.got += heard
        queue = self._waiting[node]
        queue.pop()
        if queue:
            self._begin(now, node, 1, False)

    def _begin(self, now: int, node: str, attempt: int, heard: bool) -> None:
        access = self.link.radio.access
        if isinstance(access, Csma):
            self._back_off(now, node, attempt, heard, access, 0)
        else:
            self._send(now, node, attempt, heard)

    def _back_off(self, now: int, node: str, attempt: int, heard: bool, csma: Csma, k: int) -> None:
        units = self.random.randrange(2 ** min(csma.be_min + k, csma.be_max))
        looks_ns = now + units * csma.unit_ns

        def look(then: int) -> None:
            if not self._busy(node, looks_ns, then):
                self._at(then + csma.turnaround_ns, lambda t: self._send(t, node, attempt, heard))
            elif k + 1 < csma.tries:
                self._back_off(then, node, attempt, heard, csma, k + 1)
            else:
                self._done(then, node, heard)

        self._at(looks_ns + csma.cca_ns, look)

    def _send(self, now: int, node: str, attempt: int, heard: bool) -> None:
        radio = self.link.radio
        mine = Sending(now, now + radio.airtime_ns(SIZE + radio.overhead_bytes), node)
        self._air.append(mine)
        self._at(mine.end_ns, lambda then: self._sent(then, mine, attempt, heard))

    def _sent(self, now: int, mine: Sending, attempt: int, heard: bool) -> None:
        """The hub got it, or not; if it acknowledges, the node waits for that."""
        radio, node = self.link.radio, mine.src
        others = self._others(mine)
        self.met += attempt == 1 and any(self._level(one.src, HUB) >= self.link.least_db for one in others)
        got = self._gets(mine, HUB, others, SIZE + radio.overhead_bytes)
        heard = heard or got
        if self.tries == 0:
            self._done(now, node, heard)
        elif got:
            answer = Sending(now + radio.turnaround_ns, now + radio.ack_ns, HUB)
            self._at(answer.begin_ns, lambda _: self._air.append(answer))
            self._at(answer.end_ns, lambda then: self._answered(then, answer, node, attempt))
        else:
            self._at(now + radio.patience_ns, lambda then: self._again(then, node, attempt, heard))

    def _answered(self, now: int, answer: Sending, node: str, attempt: int) -> None:
        if self._gets(answer, node, self._others(answer), self.link.radio.ack_bytes):
            self._done(now, node, True)
        else:
            self._again(now, node, attempt, True)

    def _again(self, now: int, node: str, attempt: int, heard: bool) -> None:
        if attempt < self.tries:
            self._begin(now, node, attempt + 1, heard)
        else:
            self._done(now, node, heard)

    def _others(self, mine: Sending) -> list[Sending]:
        """What overlaps it, of those that began before it ended."""
        longest_ns = 2 * (mine.end_ns - mine.begin_ns) + 10_000_000
        self._air = [one for one in self._air if one.end_ns > mine.end_ns - longest_ns]
        return [
            one for one in self._air if one is not mine and one.end_ns > mine.begin_ns and one.begin_ns < mine.end_ns
        ]

    def _gets(self, mine: Sending, hearer: str, others: Sequence[Sending], size: int) -> bool:
        if any(one.src == hearer for one in others):
            return False
        level = self._level(mine.src, hearer)
        theirs = [10 ** (db / 10) for one in others if (db := self._level(one.src, hearer)) >= self.link.least_db]
        if theirs and 10 ** (level / 10) < 10 ** (CAPTURE_DB / 10) * sum(theirs):
            return False
        return self.random.random() < self.link.radio.prr(level, size)

    def _busy(self, node: str, begin_ns: int, end_ns: int) -> bool:
        return any(
            one.begin_ns < end_ns and one.end_ns > begin_ns and self._level(one.src, node) >= self.link.least_db
            for one in self._air
        )

    def _level(self, src: str, dst: str) -> float:
        if (src, dst) not in self._db:
            self._db[src, dst] = self.link.snr_db(src, dst)
        return self._db[src, dst]


class Point(NamedTuple):
    """Shares of the reports: delivered by the model and by the simulation, overlapped in both, spared by the model."""

    model: float
    simulated: float
    overlapped: float
    met: float
    spared: float


def placed(case: Case, nodes: int, seed: int) -> dict[str, tuple[float, float]]:
    """A hub, and nodes spread evenly over the disc."""
    random = Random(seed)
    polar = ((case.radius_m * sqrt(random.random()), tau * random.random()) for _ in range(nodes))
    return {HUB: (0.0, 0.0)} | {f"n{k}": (r * cos(a), r * sin(a)) for k, (r, a) in enumerate(polar)}


def compared(case: Case, nodes: int, reports: Sequence[Report], seed: int) -> Point:
    """The same reports by the model and by the simulation."""
    places = placed(case, nodes, seed)
    link = make_link(case.link, seed, places)
    assert isinstance(link, LognormalPrr)
    frames, dues, free_ns = list[Transmission](), list[Due](), dict[str, int]()
    for number, report in enumerate(reports):
        leaves_ns = max(report.at_ns, free_ns.get(report.node, 0))
        frame = Transmission(report.node, HUB, "doa", leaves_ns, 0, SIZE)
        fate = link.fate(frame)
        free_ns[report.node] = leaves_ns + fate.busy_ns
        frames.append(frame)
        dues.append(Due(number, HUB, fate.cause is None))
    air = air_of(link, places, frames, dues, max(free_ns.values()))
    assert air is not None
    simulation = Simulation(link, Random(seed), int(case.link.get("ack", 0)))
    simulation.run(reports)
    n = len(reports)
    delivered = sum(due.delivered for due in dues)
    return Point(delivered / n, simulation.got / n, air.overlapped / n, simulation.met / n, air.spared / n)


def at_random(case: Case, load: float, reports: int, seed: int) -> list[Report]:
    """Reports at random instants, whose frames alone are on air for this share of the time."""
    link = make_link(case.link, 1, placed(case, 1, 1))
    assert isinstance(link, LognormalPrr)
    random, t_ns = Random(seed), 0.0
    every_ns = link.radio.airtime_ns(SIZE + link.radio.overhead_bytes) / load
    found = []
    for _ in range(reports):
        t_ns -= every_ns * log(1.0 - random.random())
        found.append(Report(round(t_ns), f"n{random.randrange(NODES)}"))
    return found


def at_once(nodes: int, reports: int) -> list[Report]:
    """Reports of all nodes at the same instant, again and again."""
    return [Report((k + 1) * 2 * S, f"n{n}") for k in range(reports // nodes) for n in range(nodes)]


def mean(points: Sequence[Point]) -> Point:
    """Of several fields."""
    return Point(*(sum(column) / len(points) for column in zip(*points, strict=True)))


def of_load(case: Case, load: float, *, fields: int = 8, reports: int = 1500) -> Point:
    """Under a load at random instants, over several fields."""
    return mean([compared(case, NODES, at_random(case, load, reports, seed), seed) for seed in range(1, fields + 1)])


def of_number(case: Case, nodes: int, *, fields: int = 20, reports: int = 600) -> Point:
    """With so many nodes that report at once."""
    return mean([compared(case, nodes, at_once(nodes, reports), seed) for seed in range(1, fields + 1)])


def exceeds(xs: Sequence[float], points: Sequence[Point], off: float) -> float | None:
    """From where on the model delivers so much more, by straight lines between the points."""
    gaps = [point.model - point.simulated for point in points]
    if gaps[0] >= off:
        return xs[0]
    for (x, gap), (y, more) in pairwise(zip(xs, gaps, strict=True)):
        if gap < off <= more:
            return x + (y - x) * (off - gap) / (more - gap)
    return None


def _row(first: str, point: Point) -> str:
    gap = point.model - point.simulated
    shares = (point.model, point.simulated, gap, point.spared, point.overlapped, point.met)
    return f"| {first} | {' | '.join(f'{100 * share:.1f} %' for share in shares)} |"


def _found(xs: Sequence[float], points: Sequence[Point], off: float, form: str) -> str:
    at = exceeds(xs, points, off)
    return "-" if at is None else format(at, form)


HEAD: Final = (
    "| {} | model delivers | simulation delivers | difference | `spared_share` | `overlapped_share` | simulated |\n"
    "| --- | --- | --- | --- | --- | --- | --- |"
)


def main() -> None:
    """Print the tables."""
    for case in CASES:
        print(f"\n{case.name}, at random instants\n\n{HEAD.format('load')}")
        points = []
        for load in LOADS:
            points.append(of_load(case, load))
            print(_row(f"{100 * load:g} %", points[-1]), flush=True)
        print(*(f"{off:.0%} off from a load of {_found(LOADS, points, off, '.1%')}" for off in (0.05, 0.1)), sep="; ")
    for case in CASES[1:]:
        print(f"\n{case.name}, all at once\n\n{HEAD.format('nodes')}")
        points = []
        for nodes in AT_ONCE:
            points.append(of_number(case, nodes))
            print(_row(str(nodes), points[-1]), flush=True)
        print(*(f"{off:.0%} off from {_found(AT_ONCE, points, off, '.1f')} nodes on" for off in (0.05, 0.1)), sep="; ")


if __name__ == "__main__":
    main()
