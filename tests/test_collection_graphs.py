"""Trees over random links, in virtual time: who has a way reaches the base, nothing circles for ever."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace
from heapq import heappop, heappush
from itertools import permutations
from math import inf
from typing import Any

from hypothesis import example, given, settings
from hypothesis import strategies as st

from tests.protocols.chains import MS, acquainted
from tests.protocols.collection import BASE, Word
from trackfield.draw import uniform
from trackfield.drivers.engine.frames import Frame
from trackfield.drivers.spec import ProcessSpec, RunSpec
from trackfield.drivers.virtual import Virtual
from trackfield.link.fate import LOST, Fate, Transmission
from trackfield.protocols.collection.routes import HYSTERESIS
from trackfield.protocols.collection.traffic import MOST_HOPS, MOST_TRIES, MOST_TURNS
from trackfield.role import NS, Effect, Event, Received, Send, SetTimer, Started, Timer
from trackfield.wire.codec import decode

Shares = Mapping[tuple[str, str], float]
"""Of frames that arrive, by sender and receiver; links that are left out carry nothing."""
TALK_S, QUIET_S = 20, 60
"""Queues of seven processes that all go over one bad link take some twenty seconds."""
CROWDED: Shares = {
    **dict.fromkeys([("base", "n1"), ("base", "n5"), ("n2", "n5"), ("n4", "n1"), ("n4", "n2")], 0.9),
    **dict.fromkeys(
        [("base", "n2"), ("base", "n4"), ("n1", "n4"), ("n4", "base"), ("n5", "n1"), ("n5", "n2"), ("n5", "n3")], 0.7
    ),
    **dict.fromkeys([("n1", "n5"), ("n4", "n3"), ("n4", "n5")], 1.0),
}
"""All go over n4, and most hear the base, which does not hear them."""


@dataclass(frozen=True)
class Counting:
    """Tells the base a number every half second, for a while; the base keeps who sent what."""

    name: str
    until_s: int = TALK_S
    kinds = frozenset({"word"})

    def begin(self) -> tuple[tuple[str, int], ...]:
        return ()

    def handle(self, state: Any, event: Event) -> tuple[Any, tuple[Effect, ...]]:
        match event:
            case Started(now) if self.name != BASE:
                return state, (SetTimer("say", now + 3 * NS),)
            case Timer(now) if now < self.until_s * NS:
                return state, (Send(Word(now // (500 * MS)), BASE), SetTimer("say", now + 500 * MS))
            case Received(_, Word(number), sender):
                return (*state, (sender, number)), ()
        return state, ()


@dataclass(frozen=True)
class Graph:
    """A link whose frames arrive with these shares, 3 ms after they were sent."""

    shares: Shares
    seed: int

    def fate(self, frame: Transmission) -> Fate:
        share = self.shares.get((frame.src, frame.dst), 0.0)
        return Fate(None, 3 * MS) if uniform(self.seed, "graph", *frame.key) < share else LOST

    def reception(self, src: str, dst: str, *_: Any, **__: Any) -> float:
        return self.shares.get((src, dst), 0.0)


class Heard:
    """All frames of a run."""

    def __init__(self) -> None:
        self.frames: list[Frame] = []

    def sent(self, frame: Frame) -> None:
        self.frames.append(frame)

    def told(self, process: str, output: Any) -> None:
        """Nothing is kept of that."""

    def final(self, process: str, record: Any) -> None:
        """Nor of that."""


def live(shares: Shares, seed: int, seconds: int, until_s: int = TALK_S, **tree: Any) -> tuple[Virtual, Heard]:
    """A run of all processes that these links join."""
    ids = sorted({id for pair in shares for id in pair} | {BASE})
    processes = [
        ProcessSpec(
            id,
            "counting",
            "tests.test_collection_graphs:Counting",
            {"name": id, "until_s": until_s},
            cells=("c0",),
            tree={"base": BASE, "seed": seed, **tree},
        )
        for id in ids
    ]
    heard = Heard()
    run = Virtual(RunSpec("graph", seed, seconds * NS, {"model": "ideal"}), acquainted(processes), heard)
    run._link = Graph(shares, seed)
    run.run()
    return run, heard


def ways(shares: Shares) -> dict[str, float]:
    """The expected transmissions from each process to the base by the best way (Dijkstra), each with its answer."""
    costs, queue = dict[str, float](), [(0.0, BASE)]
    while queue:
        cost, id = heappop(queue)
        if id in costs:
            continue
        costs[id] = cost
        for (src, dst), share in shares.items():
            back = shares.get((dst, src), 0.0)
            if dst == id and src not in costs and share * back > 0.0:
                heappush(queue, (cost + 1 / (share * back), src))
    return costs


def graphs(*qualities: float, symmetric: bool = False) -> st.SearchStrategy[Shares]:
    """Links among some processes."""

    def made(count: int) -> st.SearchStrategy[Shares]:
        ids = [BASE, *(f"n{i}" for i in range(1, count))]
        pairs = [pair for pair in permutations(ids, 2) if not symmetric or pair[0] < pair[1]]
        shares = st.fixed_dictionaries({pair: st.sampled_from(qualities) for pair in pairs})
        return shares.map(lambda some: {**some, **{(b, a): p for (a, b), p in some.items()}} if symmetric else some)

    return st.integers(2, 8).flatmap(made)


@given(graphs(0.0, 0.0, 0.0, 0.7, 0.9, 1.0), st.integers(0, 1000))
@example(CROWDED, 203)
@settings(max_examples=12, deadline=None)
def test_all_who_have_a_way_reach_the_base_and_nothing_circles_for_ever(shares: Shares, seed: int) -> None:
    """Somebody of whom all 34 messages are lost on links this good would be a wonder."""
    run, heard = live(shares, seed, TALK_S + QUIET_S)
    came = Counter(sender for sender, _ in run.cores[BASE].state.role)
    assert set(came) == ways(shares).keys() - {BASE}
    assert len(set(run.cores[BASE].state.role)) == sum(came.values()), "each message came once"
    hops = [(frame, decode(frame.payload)) for frame in heard.frames if frame.kind == "hop"]
    times = Counter((hop.origin, hop.number) for _, hop in hops)
    assert max((hop.hops for _, hop in hops), default=0) < MOST_HOPS
    assert max(times.values(), default=0) <= MOST_HOPS * MOST_TRIES * MOST_TURNS
    connected = {id for id in run.cores if id in ways(shares)}
    late = [frame for frame, _ in hops if frame.sent_ns > (TALK_S + QUIET_S // 2) * NS and frame.src in connected]
    assert late == [], "after the last message is there, or given up, it is quiet"


@given(graphs(0.0, 0.0, 0.7, 1.0, symmetric=True), st.integers(0, 1000))
@settings(max_examples=12, deadline=None)
def test_ways_are_those_of_fewest_transmissions_up_to_the_hysteresis(shares: Shares, seed: int) -> None:
    """A process may keep a parent that is worse by the hysteresis, and so may those on its way.

    Shares are learned from some thirty beacons and tries, so a cost may be wrong by a half. Nothing is sent in the last
    seconds, so that nobody has just lost its parent.
    """
    run, _ = live(shares, seed, 60, until_s=50, most_ns=NS)
    for id, cost in ways(shares).items():
        found, at, hops = 0.0, id, 0
        while at != BASE and hops <= len(run.cores):
            parent = run.cores[at].state.tree.routes.parent
            found += 1 / max(shares.get((at, parent), 0.0) * shares.get((parent, at), 0.0), 1e-9) if parent else inf
            at, hops = parent or BASE, hops + 1
        assert found <= 1.5 * cost + HYSTERESIS * hops, (id, cost)


def test_a_dead_relay_is_replaced_within_a_second() -> None:
    """Of two relays side by side the one in use dies; the other is known, but has not been needed yet."""
    shares = {pair: 1.0 for one in ("a", "b") for pair in ((BASE, one), (one, BASE), ("far", one), (one, "far"))}
    run, _ = live(shares, 1, 10)
    first = run.cores["far"].state.tree.routes.parent
    ids = [BASE, "a", "b", "far"]
    tree = {"base": BASE, "seed": 1}
    processes = acquainted(
        [
            ProcessSpec(id, "c", "tests.test_collection_graphs:Counting", {"name": id}, cells=("c0",), tree=tree)
            for id in ids
        ]
    )
    mortal = [replace(p, kill_ns=10 * NS) if p.id == first else p for p in processes]
    run = Virtual(RunSpec("graph", 1, 20 * NS, {"model": "ideal"}), mortal, Heard())
    run._link = Graph(shares, 1)
    run.run()
    numbers = [number for sender, number in run.cores[BASE].state.role if sender == "far"]
    assert numbers == list(range(6, 40)), "no message of the twenty is lost, in their order"
