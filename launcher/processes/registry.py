"""The places of a run and the processes that are alive: answers all that ask at ``control/join``, early or late."""

from __future__ import annotations

import time
from collections import deque
from contextlib import suppress
from dataclasses import asdict, replace
from threading import Lock
from typing import Any, Final

import zenoh
from zenoh.handlers import Callback

from launcher.processes.alarms import TOKENS, Alarms
from launcher.processes.claims import Claims
from launcher.records import LIVE, RECORDER, Plan
from trackfield.drivers.ask import REFUSED, answer
from trackfield.drivers.intake import opened, printable, read, unpacked
from trackfield.drivers.seal import Seal
from trackfield.drivers.spec import ProcessSpec
from trackfield.wire import keys
from trackfield.wire.error import WireError
from trackfield.wire.keys import check_id

LEAD_S: Final = 0.5
"""From giving a place again to the beginning of its next life, of which the recorder has to know by then."""
REFRESH_TIMEOUT_S: Final = 2.0


class Registry:
    """The lives of a run by name, planned ones and those added during the run.

    ``run`` is common to all, ``start_ns`` the host's monotonic time at which emulated time began (None: not yet),
    ``live`` the names of those that are alive as Zenoh sees it, ``arrivals`` how often one joined or returned.
    An ``open`` registry also gives places to processes that do not ask for one by name: ``hosts`` has the host of each
    by name, and ``births`` has each new life with the name of the life before it.
    """

    def __init__(self, plan: Plan, seal: Seal, alarms: Alarms, *, open: bool = False) -> None:
        self.run, self._seal, self._alarms = plan.run, seal, alarms
        self.start_ns: int | None = None
        self.live: set[str] = set()
        self.arrivals = 0
        self._lives = {p.name: p for p in plan.processes}
        self._stored: dict[str, bytes] = {}
        self._unplanned: set[str] = set()
        self._claims = Claims({p.name: p.role for p in plan.processes}) if open else None
        self._places = {p.name: p.name for p in plan.processes}  # of each life: that of the first one in it
        self._latest = dict(self._places)  # of each place: the life that it has now
        self._lock = Lock()
        self.births: deque[tuple[str, ProcessSpec]] = deque()
        self.hosts: dict[str, str] = {}

    def declare(self, session: zenoh.Session) -> None:
        """Answer and listen from now on, for as long as the session is open."""
        self._held = [
            session.declare_queryable(keys.JOIN, Callback(self._answer, indirect=False)),
            session.declare_queryable(keys.CLAIM, Callback(self._on_claim, indirect=False)),
            session.declare_subscriber(keys.telemetry_of_all("stored"), Callback(self._on_stored, indirect=False)),
            session.liveliness().declare_subscriber(
                keys.ALL_LIVE, Callback(self._on_live, indirect=False), history=True
            ),
            # last: processes that see it may ask at once
            session.liveliness().declare_token(keys.launcher(session.info.zid())),
        ]

    def end(self, end_ns: int) -> None:
        """The run ends early, at this emulated time; processes that join later are told so."""
        self.run = replace(self.run, end_ns=end_ns)

    def next_life(self, name: str, start_ns: int) -> ProcessSpec:
        """The life after the life ``name``, from this emulated time to the planned end of that one."""
        last = self._lives[name]
        incarnation = 1 + max(p.incarnation for p in self._lives.values() if p.id == last.id)
        life = replace(last, incarnation=incarnation, start_ns=start_ns)
        self._lives[life.name] = life
        self._unplanned.add(life.name)
        return life

    def claim(self, role: str, host: str) -> str | None:
        """The name to join under for a process on this host, None if all places of the role are taken.

        While emulated time runs, a process that takes a place after another is a new life. Raises ``LookupError`` where
        there is no place to give, now or later.
        """
        if self._claims is None:
            raise LookupError("the launcher starts all processes of this run itself: name the place to take with --id")
        now_ns = self._now_ns()
        if now_ns is not None and now_ns >= self.run.end_ns:
            raise LookupError("the run is over")
        with self._lock:
            taken = self._claims.take(role, host, time.monotonic())
            if taken is None:
                return None
            place, again = taken
            name = self._latest[place]
            if again and now_ns is not None:
                life = self.next_life(name, max(now_ns, 0) + round(LEAD_S * self.run.speed * 1e9))
                self.births.append((name, life))
                name = self._latest[place] = life.name
                self._places[name] = place
            self.hosts[name] = host
            return name

    def refresh(self, session: zenoh.Session) -> None:
        """Ask which processes are alive: notice of their end is lost while the launcher itself is out of reach."""
        known = set(self.live)
        replies = [reply.ok for reply in session.liveliness().get(keys.ALL_LIVE, timeout=REFRESH_TIMEOUT_S)]
        there = {self._named(token.key_expr) for token in replies if token}
        if there and None not in replies:
            for name in known - there:
                self._seen(name, there=False)

    def _now_ns(self) -> int | None:
        return None if self.start_ns is None else round((time.monotonic_ns() - self.start_ns) * self.run.speed)

    # --- Zenoh's threads ------------------------------------------------------------------------------------------

    def _answer(self, query: zenoh.Query) -> None:
        name = query.payload.to_bytes().decode(errors="replace") if query.payload else ""
        life = self._lives.get(name)
        if life is None:
            told: dict[str, Any] = {REFUSED: f"no process {printable(name)} in this run"}
        else:
            told = {
                "run": asdict(self.run),
                "process": life.plain(),
                "start_ns": self.start_ns,
                "stored": self._stored.get(life.id, b"") if name in self._unplanned else None,
            }
        answer(query, told, self._seal)

    def _on_stored(self, sample: zenoh.Sample) -> None:
        with suppress(WireError):  # the recorder counts it
            name, _ = keys.parse_telemetry(str(sample.key_expr))
            stored = opened(sample, self._seal)
            if name in self._lives:
                self._stored[keys.id_of(name)] = stored

    def _on_live(self, sample: zenoh.Sample) -> None:
        if name := self._named(sample.key_expr):
            self._seen(name, there=sample.kind == zenoh.SampleKind.PUT)

    def _named(self, token: zenoh.KeyExpr) -> str | None:
        """The life that this token is of; None, and counted, if no process of the run has declared it."""
        name = str(token).partition("/")[2].partition("/")[0]
        if name in self._lives or name in (RECORDER, LIVE):
            live = keys.live(name)
            if str(token) == keys.live(name, self._seal.mark(live)):
                return name
        self._alarms.add(TOKENS)
        return None

    def _seen(self, name: str, *, there: bool) -> None:
        with self._lock:
            if self._claims is not None and name == self._latest.get(place := self._places.get(name, "")):
                self._claims.seen(place, live=there, now=time.monotonic())
        if there:
            self.live.add(name)
            self.arrivals += 1
        else:
            self.live.discard(name)

    def _on_claim(self, query: zenoh.Query) -> None:
        try:
            role, host = read(_claimed, query.payload.to_bytes() if query.payload else b"")
            name = self.claim(role, host)
            told = {"name": name} if name else {REFUSED: f"every place of a {role} is taken"}
        except (LookupError, WireError) as error:
            told = {REFUSED: str(error)}
        answer(query, told, self._seal)


def _claimed(question: bytes) -> tuple[str, str]:
    """Role and host of a process that asks for a place."""
    role, host = unpacked(question, 1000)
    return check_id(role), printable(host) if isinstance(host, str) else ""
