"""The places of a run whose processes start elsewhere: offered to all that ask, and had by the first that is there.

A process claims a place, joins under the name that it was offered, declares its liveliness token and has its place
confirmed. Only the token, which shows the ticket of its join, takes the place; the rest is forgotten at once.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Collection
from typing import Any, Final

import zenoh
from zenoh.handlers import Callback

from launcher.processes.alarms import Alarms
from launcher.processes.places.claims import Claims
from launcher.processes.places.desk import Desk
from launcher.processes.places.slices import Slices, own_version
from launcher.processes.registry import Registry
from launcher.records import Plan
from trackfield.drivers.exchange.intake import printable
from trackfield.drivers.exchange.seal import Seal
from trackfield.drivers.joining.credentials import plain
from trackfield.drivers.session import Credentials
from trackfield.drivers.spec import ProcessSpec
from trackfield.wire import keys
from trackfield.wire.error import WireError

LEAD_S: Final = 1.0
"""From a join while emulated time runs to the beginning of the new life, of which the recorder has to know by then."""
TICKET_S: Final = 15.0
"""How long a process that joined may take until its token is there; less than a cut connection keeps a place."""

PLACE: Final = 2
"""Where in a claim the place is that is wanted."""
TAKEN: Final = "{} is taken: a process lives there"
OURS: Final = "{} is no place to have: the launcher starts that process"


class OpenRegistry(Registry):
    """A registry that gives the places of ``guests`` (ids), in a secured run each with the certificate that
    ``credentials`` has for its id, and those of ``certified`` slices; ``births`` has each new life with the name of the
    life before it.
    """

    def __init__(
        self,
        plan: Plan,
        seal: Seal,
        alarms: Alarms,
        guests: Collection[str],
        credentials: Callable[[str], Credentials] | None = None,
        certified: int | None = None,
    ) -> None:
        super().__init__(plan, seal, alarms)
        self._credentials = credentials
        self.births: deque[tuple[str, ProcessSpec]] = deque()
        places = [p for p in plan.processes if p.id in guests]
        self._claims = Claims({p.name: p.role for p in places})
        self._places = {p.name: p.name for p in places}  # of each life: that of the first one in it
        self._latest = dict(self._places)  # of each place: the life that it has now
        self._offers: dict[str, str] = {}  # the place of each life that does not exist yet
        self._came_ns: dict[str, int] = {}
        told = {"scenario": plan.info.scenario, "own": sorted(plan.own_places), "restart": plan.restart}
        shared = [life for life in plan.in_slices if life.id in guests]
        desk = Desk(shared, own_version(), certified)
        self.slices = Slices(plan, desk, seal, alarms, told, credentials)

    def _more(self, session: zenoh.Session) -> list[Any]:
        claim, confirm = (keys.asked_by_all(question) for question in (keys.CLAIM, keys.CONFIRM))
        return [
            session.declare_queryable(claim, Callback(self._on_own_claim, indirect=False)),
            session.declare_queryable(confirm, Callback(self._on_confirm, indirect=False)),
            *self.slices.declare(session, self.reply, self._slice_told),
        ]

    def _slice_told(self) -> dict[str, Any]:
        """What a slice has to know of the run as it is now."""
        return {"start_ns": self.start_ns, "end_ns": self.run.end_ns, "speed": self.run.speed}

    def _on_claim(self, query: zenoh.Query) -> None:
        self.reply(query, 3, self._enrol)

    def _on_own_claim(self, query: zenoh.Query) -> None:
        self.reply(query, 3, self._claim, about=PLACE)

    def _on_confirm(self, query: zenoh.Query) -> None:
        self.reply(query, 3, self._confirm)

    def _enrol(self, role: str, host: str, place: str) -> dict[str, Any]:
        """A place for a process that may have no certificate of its own yet."""
        told = self._claim(role, host, place)
        return told if self._credentials is None else told | plain(self._credentials(keys.id_of(told["name"])))

    def _claim(self, role: str, host: str, place: str) -> dict[str, Any]:
        return {"name": self._offer(role, printable(host), place)}

    def _confirm(self, name: str, ticket: str, host: str) -> dict[str, Any]:
        return {"live": self._confirmed(name, ticket, printable(host))}

    def _now_ns(self, at_ns: int) -> int:
        """Emulated time at this monotonic time."""
        assert self.start_ns is not None
        return round((at_ns - self.start_ns) * self.run.speed)

    def _offer(self, role: str, host: str, place: str) -> str:
        """The name to join under, for a process of this role on this host. Raises ``LookupError`` if there is none.

        While emulated time runs, a process that takes a place after another is a new life.
        """
        if self.start_ns is not None and self._now_ns(time.monotonic_ns()) >= self.run.end_ns:
            raise LookupError("the run is over")
        with self._lock:
            if place in self._lives and place not in self._places:
                raise LookupError(OURS.format(place))
            offered = self._claims.offer(role, host, time.monotonic(), place)
            if offered is None:
                raise LookupError(TAKEN.format(place) if place else f"every place of a {role} is taken")
            name = self._latest[offered]
            if self.start_ns is not None and self._claims.had(offered):
                name = self._following(name, 0).name
                self._offers[name] = offered
            return name

    def _is_guest(self, name: str) -> bool:
        """Whether a process with this name has, or was offered, a place that is given; under the lock."""
        return name in self._places or name in self._offers

    def _life(self, name: str, now_ns: int) -> ProcessSpec:
        with self._lock:
            if not self._is_guest(name):
                return super()._life(name, now_ns)
            return self._life_here(name, now_ns)

    def _life_here(self, name: str, given_ns: int) -> ProcessSpec:
        """The life of a process that joined under this name then. Raises ``LookupError``; under the lock."""
        if name in self.live:
            raise LookupError(TAKEN.format(name))
        place = self._offers.get(name) or self._places.get(name)
        if place is None:
            raise LookupError(f"no process {printable(name)} in this run")
        last = self._latest[place]
        if self.start_ns is None or not self._claims.had(place):
            if name == last:
                return self._lives[name]
        elif last not in self.live:
            soon_ns = max(self._now_ns(given_ns), 0) + round(LEAD_S * self.run.speed * 1e9)
            life = self._following(last, max(soon_ns, self._lives[last].start_ns))
            if life.name == name:
                return life
        raise LookupError(f"{name} is no place to have now: claim one")

    def _admit(self, name: str, given_ns: int) -> bool:
        if not self._is_guest(name):
            return super()._admit(name, given_ns)
        if not self._in_time(given_ns):
            return False
        try:
            life = self._life_here(name, given_ns)
        except LookupError:
            return False
        if self._has_begun(life):
            return False
        if name not in self._lives:
            place = self._offers.pop(name)
            before, self._latest[place], self._places[name] = self._latest[place], name, place
            self.births.append((before, self.next_life(before, life.start_ns)))
        self._came_ns[name] = time.monotonic_ns()
        return True

    def _has_begun(self, life: ProcessSpec) -> bool:
        """Whether a life that nobody knows of should have begun by now."""
        return life.name not in self._lives and self._now_ns(time.monotonic_ns()) >= life.start_ns

    @staticmethod
    def _in_time(given_ns: int) -> bool:
        return time.monotonic_ns() - given_ns < TICKET_S * 1e9

    def _was_late(self, name: str, given_ns: int) -> bool:
        """One that took too long, or joined before another came: it is told when it asks for its confirmation."""
        if not self._is_guest(name):
            return False
        return name not in self.live or (self._in_time(given_ns) and given_ns <= self._came_ns.get(name, given_ns))

    def _here(self, name: str) -> None:
        if name == self._latest.get(place := self._places.get(name, "")):
            self._claims.came(place, time.monotonic())

    def _left(self, name: str) -> None:
        if name == self._latest.get(place := self._places.get(name, "")):
            self._claims.went(place, time.monotonic())

    def _confirmed(self, name: str, ticket: str, host: str) -> bool:
        """Whether a process has its place: False if it was not seen yet. Raises ``LookupError`` if another has it."""
        with self._lock:
            try:
                given_ns = self._tickets.given_ns(name, ticket)
            except WireError as error:
                raise LookupError(str(error)) from None
            if self._holds.get(name) == ticket:
                if name in self.live:
                    self.hosts[name] = host
                    self._claims.known(self._places[name], host)
                return name in self.live
            life = self._life_here(name, given_ns)
            if not self._in_time(given_ns) or self._has_begun(life):
                raise LookupError(f"it took too long to start as {name}")
            return False
