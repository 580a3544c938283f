"""Which neighbour is the way to the base: beacons, and the choice of a parent.

As in CTP (Gnawali, Fonseca, Jamieson, Moss, Levis 2009, "Collection tree protocol"): each process tells by beacons what
it costs to send to the base through it. The intervals of its beacons double from a short one to a long one (Trickle,
RFC 6206, without suppression), and are short again as soon as others should know: it found its first way, lost its
parent or its way, noticed a loop, its cost changed by much, or somebody asked. The parent is the neighbour through
which the cost is least; another has to be better by ``HYSTERESIS`` to replace it. A neighbour whose own parent this
process is, is none. A process without a way asks in all its beacons, one that lost its parent once: who did not answer
may have been unlucky.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Final

from trackfield.draw import bits, uniform
from trackfield.protocols.collection.links import Link
from trackfield.role import NEIGHBOURHOOD, Effect, Note, Send, SetTimer
from trackfield.wire.messages import NOWHERE, Route

HYSTERESIS: Final = 1.5
"""In transmissions, as in CTP and MRHOF (RFC 6719, section 5)."""
NEWS: Final = 2.0
"""A cost that changed by so many transmissions is told soon, as in CTP."""
MOST_COST: Final = 128.0
"""A way that costs more is none: where no base is left, costs count up in circles, and this ends it."""
NUMBERS: Final = 1 << 16


@dataclass(frozen=True, slots=True)
class Routes:
    """What a process knows of its neighbours: their ``links`` by id, and the ``parent`` among them (empty: no way).

    ``told`` is the cost in its last beacon, ``number`` that of the next, which ``pulls`` if a parent was lost since;
    ``interval_ns`` is the present interval.
    """

    links: Mapping[str, Link] = field(default_factory=dict)
    parent: str = ""
    told: float = NOWHERE
    number: int = 0
    interval_ns: int = 0
    pulls: bool = False


Step = tuple[Routes, tuple[Effect, ...]]


@dataclass(frozen=True, slots=True)
class Router:
    """How process ``id`` finds its way to the ``base``: beacons every ``least_ns`` to ``most_ns``."""

    id: str
    base: str
    seed: int
    least_ns: int
    most_ns: int

    def cost(self, routes: Routes) -> float:
        """The expected transmissions of a message from here to the base; 0 for that itself."""
        if self.id == self.base:
            return 0.0
        return routes.links[routes.parent].total if routes.parent else NOWHERE

    def start(self, routes: Routes, now: int) -> Step:
        """The first beacon comes soon. Its number is drawn: a process that was restarted is a new neighbour."""
        number = bits(self.seed, self.id, "route", "first", now) % NUMBERS
        return self._soon(replace(routes, number=number), now)

    def tell(self, routes: Routes, now: int) -> Step:
        """A beacon is due; the next interval is longer."""
        cost = self.cost(routes)
        pull = self.id != self.base and (routes.pulls or not routes.parent)
        beacon = Route(routes.number, cost, int(pull), routes.parent.encode())
        interval_ns = min(2 * routes.interval_ns, self.most_ns)
        number = (routes.number + 1) % NUMBERS
        after = replace(routes, told=cost, number=number, interval_ns=interval_ns, pulls=False)
        return after, (Send(beacon, NEIGHBOURHOOD), self._timer(after, now))

    def hear(self, routes: Routes, now: int, route: Route, sender: str) -> Step:
        """A neighbour's beacon."""
        known = routes.links.get(sender)
        link = Link.first(route) if known is None else known.beacon(route)
        after, effects = self._chosen(self._with(routes, sender, link), now)
        if route.pull and self.cost(after) < NOWHERE:
            after, more = self._soon(after, now)
            return after, (*effects, *more)
        return after, effects

    def tried(self, routes: Routes, now: int, neighbour: str, *, acked: bool) -> Step:
        """A neighbour acknowledged a message, or did not in time."""
        link = routes.links.get(neighbour)
        if link is None:
            return routes, ()
        return self._chosen(self._with(routes, neighbour, link.trial(acked=acked)), now)

    def lose(self, routes: Routes, now: int, neighbour: str) -> Step:
        """A neighbour did not acknowledge a message: it is not used until it is heard again."""
        link = routes.links.get(neighbour)
        if link is None:
            return routes, ()
        after, effects = self._chosen(self._with(replace(routes, pulls=True), neighbour, link.failed()), now)
        after, more = self._soon(after, now)
        over = f"over {after.parent}" if after.parent else "nowhere"
        return after, (Note(f"{neighbour} does not answer: the way to {self.base} leads {over}"), *effects, *more)

    def child(self, routes: Routes, now: int, sender: str, cost: float) -> Step:
        """A neighbour sent a message for the base, so this process is its parent.

        If it is no further from the base, there is a loop: it, or others, may have an old cost of this process.
        """
        loop = cost <= self.cost(routes)
        known = routes.links.get(sender)
        if known is not None and self.id != self.base:
            routes = self._with(routes, sender, replace(known, cost=cost, parent=self.id))
        after, effects = self._chosen(routes, now)
        if not loop:
            return after, effects
        after, more = self._soon(after, now)
        return after, (*effects, *more)

    # --- the choice -----------------------------------------------------------------------------------------------

    def _with(self, routes: Routes, neighbour: str, link: Link) -> Routes:
        return replace(routes, links={**routes.links, neighbour: link})

    def _chosen(self, routes: Routes, now: int) -> Step:
        """The parent is chosen again; what others should know is told soon."""
        if self.id == self.base:
            return routes, ()
        before, after = routes.parent, replace(routes, parent=self._best(routes))
        news = (after.parent == "") != (before == "") or abs(self.cost(after) - after.told) >= NEWS
        return self._soon(after, now) if news else (after, ())

    def _best(self, routes: Routes) -> str:
        costs = {id: link.total for id, link in routes.links.items() if self._leads(link)}
        if not costs:
            return ""
        least = min(costs, key=lambda id: (costs[id], id))
        present = costs.get(routes.parent)
        return routes.parent if present is not None and present < costs[least] + HYSTERESIS else least

    def _leads(self, link: Link) -> bool:
        """Whether messages to the base may go to this neighbour."""
        return link.usable and link.parent != self.id and link.total <= MOST_COST

    # --- beacons --------------------------------------------------------------------------------------------------

    def _soon(self, routes: Routes, now: int) -> Step:
        """The shortest interval begins, if it is not the present one."""
        if routes.interval_ns == self.least_ns:
            return routes, ()
        after = replace(routes, interval_ns=self.least_ns)
        return after, (self._timer(after, now),)

    def _timer(self, routes: Routes, now: int) -> SetTimer:
        """The next beacon, in the second half of the interval."""
        share = 0.5 + 0.5 * uniform(self.seed, self.id, "route", routes.number, routes.interval_ns)
        return SetTimer("beacon", now + int(share * routes.interval_ns))
