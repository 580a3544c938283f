"""The places of a run and the processes that are alive: answers all that ask at ``control/join``, early or late."""

from __future__ import annotations

import time
from collections import deque
from dataclasses import asdict, replace
from threading import Lock
from typing import Final

import msgpack
import zenoh
from zenoh.handlers import Callback

from launcher.processes.claims import Claims
from launcher.records import Plan
from trackfield.drivers.spec import ProcessSpec
from trackfield.wire import keys

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

    def __init__(self, plan: Plan, *, open: bool = False) -> None:
        self.run = plan.run
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
            session.liveliness().declare_token(keys.LAUNCHER),  # last: processes that see it may ask at once
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
        there = {_name(token.key_expr) for token in replies if token}
        if there and None not in replies:
            for name in known - there:
                self._seen(name, there=False)

    def _now_ns(self) -> int | None:
        return None if self.start_ns is None else round((time.monotonic_ns() - self.start_ns) * self.run.speed)

    # --- Zenoh's threads ------------------------------------------------------------------------------------------

    def _answer(self, query: zenoh.Query) -> None:
        name = query.payload.to_string() if query.payload else ""
        life = self._lives.get(name)
        if life is None:
            query.reply_err(f"no process {name!r} in this run")
            return
        answer = {
            "run": asdict(self.run),
            "process": life.plain(),
            "start_ns": self.start_ns,
            "stored": self._stored.get(life.id, b"") if name in self._unplanned else None,
        }
        query.reply(query.key_expr, msgpack.packb(answer))

    def _on_stored(self, sample: zenoh.Sample) -> None:
        name = str(sample.key_expr).split("/")[1]
        self._stored[keys.id_of(name)] = sample.payload.to_bytes()

    def _on_live(self, sample: zenoh.Sample) -> None:
        self._seen(_name(sample.key_expr), there=sample.kind == zenoh.SampleKind.PUT)

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
            role, host = msgpack.unpackb(query.payload.to_bytes() if query.payload else b"")
            name = self.claim(str(role), str(host))
        except (LookupError, ValueError, TypeError) as error:
            query.reply_err(str(error))
            return
        if name is None:
            query.reply_err(f"every place of a {role} is taken")
        else:
            query.reply(query.key_expr, name)


def _name(token: zenoh.KeyExpr) -> str:
    return str(token).rpartition("/")[2]
