"""Elections over a lossy radio: how often exactly one node leads, with relays and by suppression alone.

    python -m tests.elections [--tries 500]

prints the table, for the fields in ``FIELDS`` and losses from 0 to 50 % of all frames. Each node's clock and state are
its own; only frames connect them. A frame reaches each node in reach of its sender or not, as drawn by key, within
``FRAME_NS``. Collisions are left out, as in the link models.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from heapq import heappop, heappush
from math import hypot, log10
from typing import Any, Final

from trackfield.draw import normal, uniform
from trackfield.protocols.election import WEAKEST, Election, Race, Step, settling_ns
from trackfield.role import CancelTimer, Effect, Send, SetTimer

MS: Final = 1_000_000
FRAME_NS: Final = 6 * MS
"""The longest delay of a frame; 2 ms the shortest."""
HOP_NS: Final = 20 * MS
JITTER_NS: Final = 10 * MS
SETTLE_NS: Final = settling_ns(FRAME_NS, hop_ns=HOP_NS, jitter_ns=JITTER_NS)
ONSET_NS: Final = 20 * MS
"""Nodes sense the target within so long of each other."""
BURST_NS: Final = 100 * MS
"""For so long all frames on a link share their fate, in the column of bursts."""
STEP: Final = 5
LOSSES: Final = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5)
TRIES: Final = 500
Place = tuple[float, float]
Lost = Callable[[int, int, str, str], bool]


class Plain(Election):
    """Suppression alone: claims after the same back-off, no repeats, relays or answers."""

    def _schedule(self, race: Race, now: int, frames: int) -> Step:
        return race, ()


@dataclass(frozen=True)
class Field:
    """Who stands where; those named in ``deaf`` do not sense the target. Frames reach up to ``reach_m``.

    The target is at ``at(u, v)``, for two draws from (0, 1).
    """

    places: Mapping[str, Place]
    reach_m: float
    at: Callable[[float, float], Place]
    deaf: frozenset[str] = frozenset()

    def hearers(self) -> dict[str, tuple[str, ...]]:
        """Whom the frames of each node may reach."""
        return {one: tuple(other for other in self.places if self._near(one, other)) for one in self.places}

    def _near(self, one: str, other: str) -> bool:
        (x, y), (a, b) = self.places[one], self.places[other]
        return one != other and hypot(a - x, b - y) <= self.reach_m

    def key(self, seed: int, id: str) -> int:
        """How loud it hears the target: the level falls by 30 dB per factor of ten in distance, with 2 dB of noise.

        0 is the level at a metre, ``WEAKEST`` 80 dB less.
        """
        (x, y), (a, b) = self.places[id], self.at(uniform(seed, "target x"), uniform(seed, "target y"))
        lost_db = 30 * log10(max(hypot(a - x, b - y), 1.0)) + 2 * normal(seed, "level", id)
        return min(max(int(lost_db / 80 * WEAKEST), 0), WEAKEST)


def _row(xs: Iterable[float], y: float = 0.0, name: str = "n") -> dict[str, Place]:
    return {f"{name}{i:02d}": (x, y) for i, x in enumerate(xs)}


def _around(u: float, v: float) -> Place:
    return 20 + 60 * u, 15 + 30 * v


def _along(u: float, v: float) -> Place:
    return 110 * u, 5 + 20 * v


EARSHOT: Final = Field({f"n{i:02d}": (25.0 * (i % 4), 25.0 * (i // 4)) for i in range(12)}, reach_m=150.0, at=_around)
"""12 contenders in a grid, all in earshot of each other."""
LINE: Final = Field(_row(10.0 * i for i in range(12)), reach_m=60.0, at=_along)
"""12 contenders on a line of 110 m that hear 60 m: its ends are two hops apart."""
GROUPS: Final = Field(_row([*range(0, 25, 5), 55, 57, *range(90, 115, 5)]), reach_m=57.0, at=_along)
"""Two groups of five, of which nobody hears the other one, and two contenders between them that all hear."""
HOLE: Final = Field(
    _row([*range(0, 30, 5), *range(85, 115, 5)]) | {"r0": (52.0, 20.0), "r1": (55.0, 24.0), "r2": (58.0, 20.0)},
    reach_m=58.0,
    at=_along,
    deaf=frozenset({"r0", "r1", "r2"}),
)
"""Two groups of six that do not hear each other, a hole between them, and three nodes at its edge that hear most of
both, and sense nothing."""
ONE_RELAY: Final = Field({id: at for id, at in HOLE.places.items() if id not in ("r0", "r2")}, 58.0, _along, HOLE.deaf)
"""The same with a single node at the edge of the hole."""
PAIR: Final = Field(_row([0.0, 40.0]), reach_m=60.0, at=_along)
"""Two contenders, and nobody else."""
CHAIN: Final = Field(_row(25.0 * i for i in range(5)), reach_m=30.0, at=_along)
"""Five contenders of which each hears its neighbours only: four hops, more than ``SETTLE_NS`` is planned for."""
FIELDS: Final = {
    "12 in earshot": EARSHOT,
    "12 on a line, two hops": LINE,
    "two groups, two contenders between": GROUPS,
    "two groups, a hole, three relays": HOLE,
    "two groups, a hole, one relay": ONE_RELAY,
    "two contenders": PAIR,
    "a chain of five, four hops": CHAIN,
}
"""The first four are what elections are meant for; the others are harder."""


@dataclass
class Ended:
    """An election that is over: who leads, the true best one, frames by sender, when it was over (ns), each race."""

    heads: list[str]
    strongest: str
    frames: dict[str, int]
    over_ns: int
    races: dict[str, Race] = field(default_factory=dict)


class Air:
    """Nodes and the frames between them; ``lost(now, number, sender, receiver)`` says whether a frame is lost there."""

    def __init__(self, among: Field, seed: int, lost: Lost, kind: type[Election]) -> None:
        self.among, self.seed, self.lost = among, seed, lost
        self.nodes = {id: kind(id, seed, SETTLE_NS, HOP_NS, jitter_ns=JITTER_NS) for id in among.places}
        self.races = {id: Race() for id in among.places}
        self.timers = dict[tuple[str, str], int]()
        self.frames = dict.fromkeys(among.places, 0)
        self.hearers, self.sent, self.over_ns = among.hearers(), 0, 0
        self._due: list[tuple[int, int, str, str, Any]] = []
        self._order = 0

    def run(self, number: int = 1) -> Ended:
        """From the onset of the target until nothing is left to happen."""
        keys = {id: self.among.key(self.seed, id) for id in self.among.places if id not in self.among.deaf}
        for id in keys:
            self._push(int(ONSET_NS * uniform(self.seed, "onset", id)), id, "begin", number)
        while self._due:
            now, order, id, what, item = heappop(self._due)
            node, race = self.nodes[id], self.races[id]
            if what == "begin":
                self._after(now, id, node.begin(race, now, item, keys[id], STEP + 1))
            elif what == "frame":
                self._after(now, id, node.hear(race, now, item[1], item[0], STEP))
            elif self.timers.get((id, what)) == order:
                del self.timers[id, what]
                self._after(now, id, node.ring(race, now, what))
        heads = [id for id, race in self.races.items() if race.outcome == "won"]
        strongest = min((key, id) for id, key in keys.items())[1]
        return Ended(heads, strongest, self.frames, self.over_ns, self.races)

    def _push(self, at: int, id: str, what: str, item: Any) -> int:
        self._order += 1
        heappush(self._due, (at, self._order, id, what, item))
        return self._order

    def _after(self, now: int, id: str, step: tuple[Race, tuple[Effect, ...]]) -> None:
        if step[0].outcome and not self.races[id].outcome:
            self.over_ns = now
        self.races[id] = step[0]
        for effect in step[1]:
            match effect:
                case SetTimer(name, at):
                    self.timers[id, name] = self._push(at, id, name, None)
                case CancelTimer(name):
                    self.timers.pop((id, name), None)
                case Send(message):
                    self._send(now, id, message)

    def _send(self, now: int, id: str, message: Any) -> None:
        self.sent, self.frames[id] = self.sent + 1, self.frames[id] + 1
        for other in self.hearers[id]:
            if not self.lost(now, self.sent, id, other):
                delay = 2 * MS + int((FRAME_NS - 2 * MS) * uniform(self.seed, "delay", self.sent, other))
                self._push(now + delay, other, "frame", (id, message))


def elected(among: Field, loss: float, seed: int, kind: type[Election] = Election, burst_ns: int = 1) -> Ended:
    """One election in which each frame is lost at each hearer with probability ``loss``.

    With ``burst_ns`` all frames on a link, in this direction, have the same fate for so long, from the start on.
    """

    def lost(now: int, number: int, sender: str, receiver: str) -> bool:
        when = number if burst_ns == 1 else now // burst_ns
        return uniform(seed, "loss", when, sender, receiver) < loss

    return Air(among, seed, lost, kind).run()


@dataclass(frozen=True)
class Counted:
    """Of so many elections: with ``one`` head, ``split`` (two or more), with ``none``; heads that were the loudest.

    ``frames`` a node sent on average, and at most; when the last one was over (s).
    """

    tries: int
    one: int
    split: int
    none: int
    loudest: int
    frames: float
    most: int
    over_s: float


def counted(
    among: Field, loss: float, tries: int = TRIES, kind: type[Election] = Election, burst_ns: int = 1, first: int = 0
) -> Counted:
    """What came of elections with the seeds ``first``, ``first`` + 1, ..."""
    ends = [elected(among, loss, seed, kind, burst_ns) for seed in range(first, first + tries)]
    counts = [len(end.heads) for end in ends]
    sent = [frames for end in ends for frames in end.frames.values()]
    return Counted(
        tries,
        counts.count(1),
        sum(count > 1 for count in counts),
        counts.count(0),
        sum(end.heads == [end.strongest] for end in ends),
        sum(sent) / len(sent),
        max(sent),
        max(end.over_ns for end in ends) / 1e9,
    )


def rows(tries: int) -> Iterator[str]:
    """The table, as Markdown."""
    yield (
        "| field | frames lost | one head | the loudest | split | none | frames per node, most | over after | "
        "in bursts: one head | suppression alone: one head |"
    )
    yield f"|{' --- |' * 10}"
    for name, among in FIELDS.items():
        for loss in LOSSES:
            one, plain = counted(among, loss, tries), counted(among, loss, tries, Plain)
            bursts = counted(among, loss, tries, burst_ns=BURST_NS)
            shares = f"{one.one / tries:.1%} | {one.loudest / tries:.1%} | {one.split} | {one.none}"
            spent = f"{one.frames:.1f}, {one.most} | {one.over_s:.2f} s"
            yield f"| {name} | {loss:.0%} | {shares} | {spent} | {bursts.one / tries:.1%} | {plain.one / tries:.1%} |"


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--tries", type=int, default=TRIES)
    print("\n".join(rows(parser.parse_args().tries)))
