"""Whom nodes of which any may lead ask for the time, and when their clocks are set first (``node/keeping.py``)."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import hypot
from typing import Any, Final

from launcher.plan.forecast.masters.association import GOOD
from launcher.records import Flow, Passing, Plan, Polls
from trackfield.draw import uniform
from trackfield.drivers.spec import link_of
from trackfield.link.fate import Link
from trackfield.wire.registry import kind_of

SYNCS: Final = ("sync-request", "sync-reply")
PAUSES: Final = 3
"""Rounds that fail begin after so many times their length, on average."""
ANSWERS: Final = 0.2
"""Of a round of exchanges one or more succeed, as a rule, if this share of them does."""
MOST_ROUNDS: Final = 20
"""So many rounds are followed of a node that nobody answers."""
KEEPERS: Final = ("member", "ear")
"""The roles that set the clock of their process."""
_REPEATED: Final = frozenset({"lognormal_prr", "csma154"})
"""Link models whose radios repeat what is not acknowledged."""


def cast_of(plan: Plan, kinds: Collection[str]) -> Link:
    """The links of a plan as they are for messages of these kinds to all in reach: nothing of them is repeated."""
    link = dict(plan.run.link)
    if link["model"] not in _REPEATED:
        return link_of(plan.run, plan.processes, cut=False)
    once = {**link, "acks": {**link.get("acks", {}), **dict.fromkeys(kinds, 0)}}
    return link_of(replace(plan.run, link=once), plan.processes, cut=False)


@dataclass(frozen=True)
class Clock:
    """The ``rounds`` of a node before its clock is set, each (ns, whom it asks, whether that one answers).

    ``sync`` are the fields of its ``Rounds``.
    """

    sync: Mapping[str, Any]
    rounds: Sequence[tuple[int, str, bool]]

    @property
    def reference(self) -> str:
        """Who sets it."""
        return self.rounds[-1][1]

    @property
    def lasts_ns(self) -> int:
        """How long a round takes."""
        return int(self.sync["exchanges"] * self.sync["timeout_ns"])

    @property
    def set_ns(self) -> int:
        """When it is set first; never, if nobody ever answers."""
        return self.rounds[-1][0] + self.lasts_ns


@dataclass(frozen=True)
class Clocks:
    """The clocks of a plan, by its schedule ``polls``.

    ``link`` and ``cast`` are the links for single processes and for all in reach.
    """

    plan: Plan
    polls: Polls | Passing
    link: Link
    cast: Link
    sizes: Mapping[str, int]

    def all(self) -> dict[str, Clock]:
        """Those that are set, by the id of their node."""
        away, found = self._away(), dict[str, Clock]()
        heard: dict[str, list[str]] = {id: [] for id in away}
        for src, dst in self._announced():
            if away[src] < away[dst]:
                heard[dst].append(src)
        members = {p.id: _keeper(p.config) for p in self.plan.processes if not p.incarnation}
        ready = {self.polls.base: 0}
        for id in sorted((id for id in heard if members.get(id, {}).get("sync")), key=lambda id: (away[id], id)):
            clock = self._clock(id, members[id], self._order(id, heard[id], away), ready)
            found[id] = clock
            if clock.rounds[-1][2]:
                ready[id] = clock.set_ns
        return found

    def _away(self) -> dict[str, float]:
        """How far from the base all are, m."""
        base = next(place for place in self.plan.info.places if place.id == self.polls.base)
        return {place.id: hypot(place.x - base.x, place.y - base.y) for place in self.plan.info.places}

    def _announced(self) -> Iterator[tuple[str, str]]:
        flows = (flow for flow in self.plan.flows if kind_of(flow.message).name == "announce")
        return (pair for flow in flows for pair in flow.pairs if pair[1] != self.polls.base)

    def _order(self, id: str, heard: Sequence[str], away: Mapping[str, float]) -> list[str]:
        """Whom it asks, one after the other: those that it hears each time first, of these the nearest to the base."""
        shares = {src: self.cast.reception(src, id, self.sizes["announce"], "announce") for src in heard}
        well = GOOD ** (1 / self.polls.announcements)
        some = 1 - GOOD ** (1 / self.polls.announcements)
        order = sorted(shares, key=lambda src: (shares[src] < well, away[src], src))
        return [src for src in order if shares[src] >= some] or [self.polls.base]

    def _clock(self, id: str, member: Mapping[str, Any], order: Sequence[str], ready: Mapping[str, int]) -> Clock:
        sync, keeping, rounds = member["sync"], member["keeping"], list[tuple[int, str, bool]]()
        now = keeping["start_ns"] + int(keeping["spread_ns"] * uniform(sync["seed"], id, "clock"))
        lasts_ns = sync["exchanges"] * sync["timeout_ns"]
        for number in range(MOST_ROUNDS):
            to = order[number % len(order)]
            knows = to in ready and ready[to] <= now + lasts_ns - sync["timeout_ns"]
            rounds.append((now, to, knows and self._answers(id, to)))
            if rounds[-1][2] or now > self.plan.run.end_ns:
                break
            now += PAUSES * lasts_ns
        return Clock(sync, rounds)

    def _answers(self, id: str, to: str) -> bool:
        there = self.link.reception(id, to, self.sizes["sync-request"], "sync-request")
        return there * self.link.reception(to, id, self.sizes["sync-reply"], "sync-reply") >= ANSWERS


def _keeper(config: Mapping[str, Any]) -> Mapping[str, Any]:
    """The arguments of the role that sets the clock, of those of a process."""
    found: Mapping[str, Any] = next((config[name] for name in KEEPERS if name in config), {})
    return found


def asking(flow: Flow, clocks: Mapping[str, Clock]) -> Flow | None:
    """The links by which these clocks are set, of a flow of such messages; None if there are none."""
    asked = tuple((id, clock.reference) for id, clock in clocks.items())
    pairs = asked if kind_of(flow.message).name == "sync-request" else tuple((b, a) for a, b in asked)
    return replace(flow, pairs=pairs) if pairs else None
