"""Who sends what to whom on which medium, and what each process knows of others because of it."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

from launcher.plan.architectures import Built, Process
from launcher.plan.hardware import sync_of
from launcher.plan.messages import longest
from launcher.plan.reach import Neighbours, cells_of, neighbours
from launcher.records import Flow
from trackfield.drivers.spec import ProcessSpec, RunSpec, links_of, places_of, powers_of
from trackfield.link.fate import FIELD
from trackfield.role import NEIGHBOURHOOD
from trackfield.wire.keys import Medium
from trackfield.wire.registry import kind_of_class

Pair = tuple[str, str]
Way = tuple[str, Medium, bool, bool]
"""A kind of message, its medium, whether it is for all in reach, and whether it goes over a tree."""


def connected(
    built: Built, processes: Sequence[ProcessSpec], tracking: Mapping[str, Any], run: RunSpec
) -> tuple[tuple[ProcessSpec, ...], tuple[Flow, ...]]:
    """The processes, with their peers and the cells to which they listen, and the links that they use.

    Raises ``ScenarioError`` if too many of them are in reach of each other.
    """
    near = _Near(built, processes, run)
    sent = {kind for process in built.processes if process.senses for kind in _reports(built, process)}
    flows = tuple(
        Flow(longest(kind, tracking, run.end_ns), tuple(pairs), kind in sent, medium, all_, over_tree)
        for (kind, medium, all_, over_tree), pairs in _pairs(built, near).items()
        if pairs
    )
    return near.tuned(_acquainted(processes, flows)), flows


def _reports(built: Built, process: Process) -> Collection[str]:
    """The kinds of messages in which a process with a sensor reports; another of its roles may send others."""
    if not process.roles and built.schedule is None:
        return [kind for kind, ids in process.sends.items() if NEIGHBOURHOOD not in ids]
    return process.sends.keys() & {kind_of_class(one.sensing.message).name for one in built.site.sections.values()}


class _Near:
    """Those who send to all in reach of them, and those who take it, by medium."""

    def __init__(self, built: Built, processes: Sequence[ProcessSpec], run: RunSpec) -> None:
        self._takes = {process.id: frozenset(process.hears) for process in built.processes}
        self._senders: defaultdict[Medium, set[str]] = defaultdict(set)
        self._reach: dict[Medium, Neighbours] = {}
        self._cells: dict[str, str] = {}
        for process in built.processes:
            for kind, ids in process.sends.items():
                if NEIGHBOURHOOD in ids:
                    self._senders[process.over.get(kind, FIELD)].add(process.id)
        for medium, senders in self._senders.items():
            concerned = [p for p in processes if medium in p.media and (p.id in senders or self._takes[p.id])]
            link = links_of(run, concerned)[medium]
            self._reach[medium] = neighbours(concerned, link, medium)
            if medium == FIELD:
                self._cells = cells_of(concerned, link)

    def takers(self, src: str, kind: str, medium: Medium) -> Iterator[str]:
        """Those in reach of ``src`` that take this kind of message."""
        return (dst for dst in self._reach[medium][src] if kind in self._takes[dst])

    def tuned(self, processes: Sequence[ProcessSpec]) -> tuple[ProcessSpec, ...]:
        """The same processes with their own cells and those to which they listen."""
        if not self._cells:
            return tuple(processes)
        return tuple(replace(p, cell=self._cells.get(p.id, p.cell), cells=self._tuned_to(p.id)) for p in processes)

    def _tuned_to(self, id: str) -> tuple[str, ...]:
        near = self._reach[FIELD].get(id, ()) if self._takes[id] else ()
        return tuple(sorted({self._cells[other] for other in near if other in self._senders[FIELD]}))


def _pairs(built: Built, near: _Near) -> dict[Way, dict[Pair, None]]:
    """Who sends to whom, by kind of message: first what sensors send, then what sets clocks, then all else."""
    pairs: dict[Way, dict[Pair, None]] = defaultdict(dict)
    senders = sorted(built.processes, key=lambda process: not process.senses)
    asking = [process for process in senders if process.asks and sync_of(built.site.scenario, process.id, process.asks)]
    bases = {process.id: process.base for process in built.processes}
    for process in filter(lambda one: one.senses, senders):
        _enter(pairs, process, near, bases)
    for process in asking:
        medium = process.asks_over
        over_tree = "sync-request" not in process.direct and _over_tree(bases, process.id, process.asks, medium)
        pairs["sync-request", medium, False, over_tree][process.id, process.asks] = None
        pairs["sync-reply", medium, False, over_tree][process.asks, process.id] = None
    for process in filter(lambda one: not one.senses, senders):
        _enter(pairs, process, near, bases)
    return pairs


def _over_tree(bases: Mapping[str, str], src: str, dst: str, medium: Medium) -> bool:
    """Whether messages between these go over a tree."""
    return medium == FIELD and bases[src] == bases[dst] in (src, dst)


def _enter(pairs: dict[Way, dict[Pair, None]], process: Process, near: _Near, bases: Mapping[str, str]) -> None:
    for kind, ids in process.sends.items():
        medium = process.over.get(kind, FIELD)
        for id in ids:
            if id == NEIGHBOURHOOD:
                for taker in near.takers(process.id, kind, medium):
                    pairs[kind, medium, True, False][process.id, taker] = None
            else:
                over_tree = _over_tree(bases, process.id, id, medium)
                pairs[kind, medium, False, over_tree][process.id, id] = None


def _acquainted(processes: Sequence[ProcessSpec], flows: Sequence[Flow]) -> tuple[ProcessSpec, ...]:
    """The same processes, with the places and powers of those whom they hear and to whom they send."""
    by_id, peers = {process.id: process for process in processes}, defaultdict[str, dict[str, None]](dict)
    for flow in flows:
        for src, dst in () if flow.over_tree else flow.pairs:
            peers[src][dst] = peers[dst][src] = None
    known = ((process, [by_id[id] for id in peers.get(process.id, ())]) for process in processes)
    return tuple(
        replace(process, peers=places_of(others), tx_dbms={**powers_of(others), **process.tx_dbms})
        for process, others in known
    )
