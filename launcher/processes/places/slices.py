"""What the launcher tells those who start a share of a field on another host, and how it sees them live."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from importlib.metadata import version
from threading import Lock
from typing import Any, Final

import zenoh
from zenoh.handlers import Callback

from launcher.processes.alarms import TOKENS, Alarms
from launcher.processes.places.desk import TAKEN, Desk, Lost, Question, facts
from launcher.processes.places.tickets import LENGTH, Tickets
from launcher.records import Plan
from trackfield.drivers.exchange.inbox import EARLY_NS
from trackfield.drivers.exchange.intake import printable
from trackfield.drivers.exchange.seal import Seal
from trackfield.drivers.hostclock import host_id
from trackfield.drivers.joining.credentials import plain
from trackfield.drivers.session import Credentials
from trackfield.errors import ScenarioError
from trackfield.role import NS
from trackfield.wire import VERSION, keys
from trackfield.wire.error import WireError

JOIN: Final = "join"
CONFIRM: Final = "confirm"
LEAVE: Final = "leave"
"""What a slice says: that it asks for processes, whether it has them now that its token is there, and goodbye."""
LIVE: Final = "live"
"""The key of the answer to ``CONFIRM``."""
DEADLINE: Final = "deadline_ns"
PART: Final = 4
"""A clock may be off by the shortest deadline of a run, divided by this."""

Reply = Callable[[zenoh.Query, int, Callable[..., dict[str, Any]]], None]
Facts = Callable[[], dict[str, Any]]


def own_version() -> str:
    """The version of Trackfield here, and that of its messages."""
    return f"{version('trackfield')} (wire {VERSION})"


def bears_ns(plan: Plan) -> int:
    """By how much a clock may be off (ns of wall time): a quarter of the shortest deadline, and little enough that no
    frame seems to be from the future.
    """
    found = [found for life in plan.processes for found in _deadlines(life.config)]
    shortest_ns = min(filter(None, [*found, round(plan.deadline_s * NS)]), default=plan.step_ns)
    return min(round(shortest_ns / plan.run.speed), 2 * EARLY_NS) // PART


def _deadlines(config: Mapping[str, Any]) -> Iterator[int]:
    for name, value in config.items():
        if name == DEADLINE:
            yield value
        elif isinstance(value, Mapping):
            yield from _deadlines(value)


class Slices:
    """Answers slices and watches their tokens. ``told`` is what all have to know of the run, ``credentials`` has their
    certificates if it is secured.

    ``lost`` are those by number that are gone, ``replaced`` those in whose place another has come.
    """

    def __init__(
        self,
        plan: Plan,
        desk: Desk,
        seal: Seal,
        alarms: Alarms,
        told: Mapping[str, Any],
        credentials: Callable[[str], Credentials] | None = None,
    ) -> None:
        self.desk, self.lost, self.replaced = desk, dict[int, Lost](), deque[Lost]()
        self._seal, self._alarms = seal, alarms
        self._told, self._credentials = told, credentials
        self._bears_ns = bears_ns(plan)
        self._tickets, self._lock = Tickets(), Lock()

    def declare(self, session: zenoh.Session, reply: Reply, clock: Facts) -> list[Any]:
        """Answer and listen, as long as what this returns is kept.

        ``clock`` tells what else they have to know, as it is now: when the run started (``start_ns``, or None) and
        ends, and how fast it is (``speed``).
        """
        self._reply, self._clock = reply, clock
        tokens = f"{keys.SLICE}/**"
        return [
            session.declare_queryable(keys.SLICE, Callback(self._on_question, indirect=False)),
            session.declare_queryable(keys.CLOCK, Callback(self._on_clock, indirect=False)),
            session.liveliness().declare_subscriber(tokens, Callback(self._on_token, indirect=False), history=True),
        ]

    # --- Zenoh's threads ------------------------------------------------------------------------------------------

    def _on_clock(self, query: zenoh.Query) -> None:
        now_ns = time.monotonic_ns()
        self._reply(query, 0, lambda: {"host": host_id(), "now_ns": now_ns, "most_ns": self._bears_ns})

    def _on_question(self, query: zenoh.Query) -> None:
        with self._lock:
            self._reply(query, 6, self._answer)

    def _answer(self, word: str, which: str, of: str, host: str, version: str, ticket: str) -> dict[str, Any]:
        if word == JOIN:
            return self._join(Question(which, of, printable(host), printable(version)))
        number, count = _number(which), _number(of)
        self._given(number, count, ticket)
        if word == LEAVE:
            self.desk.leaves(number, ticket)
        why = self.desk.confirm(number, count, ticket, printable(host))
        return {TAKEN: why} if why else {LIVE: self.desk.lives_there(number, ticket)}

    def _given(self, number: int, of: int, ticket: str) -> None:
        """Raise ``LookupError`` for a ticket that was not given for this slice."""
        try:
            self._tickets.given_ns(keys.slice_token(number, of), ticket)
        except WireError as error:
            raise LookupError(str(error)) from None

    def _join(self, asked: Question) -> dict[str, Any]:
        found = self.desk.offer(asked, time.monotonic())
        if isinstance(found, str):
            return {TAKEN: found}
        (number, of), clock = found, self._clock()
        start_ns = clock["start_ns"]
        now_ns = None if start_ns is None else round((time.monotonic_ns() - start_ns) * clock["speed"])
        return {
            "number": number,
            "of": of,
            "ticket": self._tickets.give(keys.slice_token(number, of), time.monotonic_ns()),
            **facts(self.desk.lives(number, of, now_ns)),
            **self._told,
            **clock,
            **self._certificate(number),
        }

    def _certificate(self, number: int) -> dict[str, str]:
        """That of a slice, if the run is secured."""
        if self._credentials is None:
            return {}
        try:
            return plain(self._credentials(keys.slice_name(number)))
        except ScenarioError as error:  # it has expired, or somebody changed the folder
            raise LookupError(str(error)) from None

    def _on_token(self, sample: zenoh.Sample) -> None:
        number, of, mark = _parts(str(sample.key_expr))
        ticket = mark[:LENGTH]
        try:
            self._given(number, of, ticket)
            known = mark == ticket + self._seal.mark(keys.slice_token(number, of, ticket))
        except LookupError:
            known = False
        there = sample.kind == zenoh.SampleKind.PUT
        with self._lock:
            if known and there:
                self._came(number, of, ticket)
            elif known:
                self._went(number, ticket)
            elif there:
                self._alarms.add(TOKENS)

    def _came(self, number: int, of: int, ticket: str) -> None:
        if self.desk.came(number, of, ticket, time.monotonic()):
            lost = self.lost.pop(number, None)
            if lost and lost.ticket != ticket:  # else it is back
                self.replaced.append(lost)

    def _went(self, number: int, ticket: str) -> None:
        if self.desk.went(number, ticket, time.monotonic()):
            self.lost[number] = self.desk.lost(number, time.monotonic_ns())


def _parts(key: str) -> tuple[int, int, str]:
    """Which slice of how many shows this token, and its mark; 0 for what is no number."""
    number, _, rest = key.removeprefix(f"{keys.SLICE}/").partition("/")
    of, _, mark = rest.partition("/")
    return _number(number), _number(of), mark


def _number(text: str) -> int:
    return int(text) if text.isascii() and text.isdigit() and len(text) < 7 else 0
