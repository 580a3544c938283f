"""Receives all messages of a run over Zenoh and keeps its ledger: what recorders, and readers of their log, share."""

from __future__ import annotations

import time
from collections import deque
from threading import Event
from typing import Any, Final

import zenoh

from launcher.record.journal import Telling, Unplanned
from launcher.record.kept.log import Entry, Log
from launcher.record.ledger import Ledger
from launcher.record.samples import MAX_EVENT, counts_of, deaths_of, event_of, final_of, life_of
from launcher.records import RECORDER, Plan
from trackfield.drivers.exchange.inbox import EARLY_NS, Inbox, bytes_of, frame_in, no_stamp, take_in
from trackfield.drivers.exchange.incoming import HORIZON_S
from trackfield.drivers.exchange.intake import Refusals, begun, nanoseconds
from trackfield.drivers.exchange.seal import Seal
from trackfield.drivers.exchange.versions import Versions
from trackfield.drivers.spec import role_factories
from trackfield.link.fate import FIELD
from trackfield.role import NS
from trackfield.wire import keys
from trackfield.wire.envelope import Envelope
from trackfield.wire.error import WireError
from trackfield.wire.keys import parse_telemetry

FLUSH_S: Final = 0.25
"""How often received samples are processed."""
SETTLE_S: Final = HORIZON_S + 1.0
"""How long (wall time) what a recorder writes can be taken back: a process can do so up to its horizon."""

MAX_WAITING: Final = 10_000
"""How many samples may wait until the life that they are from is announced."""
SLOWEST_NS: Final = 10 * NS
"""No radio takes longer for a frame with all its repeats."""
SILENT: Final = ("reached", "stored", "spent", "status")
"""Telemetry that is for others than a recorder."""


ARRIVED: Final = 2**63
"""A time of arrival later than all others: of what was accepted before."""

Arrived = tuple[int, str, bytes, bytes | None]
"""A sample: when it arrived (host's monotonic clock, ns), its key, payload and attachment."""


class Intake:
    """Feeds the ledger with samples, wherever they come from.

    ``deaths`` are the unplanned ones of which the launcher told at the end (None: it has not told). What a
    ``provisional`` ledger has handed on can still be undone.
    """

    def __init__(self, plan: Plan, *, provisional: bool = False) -> None:
        self.plan = plan
        self._factories = {p.id: p.factory for p in plan.processes}
        for factory in set(self._factories.values()):
            role_factories(factory)  # to know the message kinds that it defines
        away = {one.id for one in plan.aways}
        self.ledger = Ledger(plan.run, plan.processes, provisional=provisional, cut_off=away)
        self.deaths: list[Unplanned] | None = None
        self._start_ns: int | None = None
        self._versions = Versions(round(SETTLE_S * plan.run.speed * NS))
        self._early_ns = round(EARLY_NS * plan.run.speed)
        most = max(map(plan.run.queue, (FIELD, *plan.run.media)))
        self._backlog_ns = (most + 1) * SLOWEST_NS

    def take(self, key: str, payload: bytes, attachment: bytes | None, now_ns: int | None = None) -> None:
        """Enter a sample into the ledger. Raises ``WireError`` if it is none of a process of this run.

        ``now_ns`` is the emulated time at which it arrived (None: before the start, as far as that is known).
        """
        if key.startswith("data/"):
            self._data(key, payload, attachment, now_ns)
        elif key.startswith("telemetry/"):
            self._telemetry(key, payload, now_ns)
        elif key == keys.START:
            self._start_ns = begun(self._start_ns, payload)
        elif key == keys.END:
            self.ledger.end(nanoseconds(payload))
        elif key == keys.LIFE:
            self.ledger.life(life_of(payload, self._factories))
        elif key == keys.FINISH:
            self.deaths = deaths_of(payload)
        else:
            raise WireError("key", "nothing of a run")

    def _data(self, key: str, payload: bytes, attachment: bytes | None, now_ns: int | None) -> None:
        frame, envelope, _ = frame_in(key, payload, attachment, self._foreign)
        self.ledger.check(frame)
        if attachment is not None:  # else its receivers stamp it
            self._check_time(frame.sent_ns, now_ns)
            news, _ = self._versions.take(frame, envelope.version, now_ns or 0)
            if news:  # else its receivers count it as a duplicate
                self.ledger.sent(frame, envelope.version)
        if envelope.version is None:
            self.ledger.foreign.add(frame.src)

    def _check_time(self, t_ns: int, now_ns: int | None) -> None:
        """Raise ``WireError`` (``future``) for what cannot have happened yet.

        At the end of a run all processes also send the frames that wait for their radios.
        """
        end_ns = self.ledger.run.end_ns
        latest_ns = end_ns + self._backlog_ns if now_ns is not None and now_ns >= end_ns else now_ns
        if latest_ns is None or t_ns > max(latest_ns, (now_ns or 0) + self._early_ns):
            raise WireError("future", "later than now")

    def _foreign(self) -> Envelope:
        """In place of the envelope that a foreign device's frame does not have, where it may have none."""
        return Envelope(0) if self.plan.run.speed == 1 else no_stamp()

    def _telemetry(self, key: str, data: bytes, now_ns: int | None) -> None:
        process, what = parse_telemetry(key)
        if process == RECORDER:
            return
        self.ledger.check_life(process)
        if what == "event":
            event = event_of(data)
            self._check_time(event.key[0], now_ns)
            if event.key[0] > self.plan.run.end_ns:
                raise WireError("future", "after the end of the run")
            self.ledger.told(process, event)
        elif what == "counts":
            self.ledger.counts[process] = counts_of(data)
        elif what == "final":
            self.ledger.final(process, final_of(data))
        elif what not in SILENT:
            raise WireError("key", "no telemetry of a process")


class Listener(Intake):
    """Takes samples from Zenoh's thread; ``received`` counts them. ``log``, if there is one, gets those it accepts."""

    def __init__(
        self, session: zenoh.Session, plan: Plan, seal: Seal, log: Log | None = None, *, provisional: bool = False
    ) -> None:
        super().__init__(plan, provisional=provisional)
        self.session, self.seal, self.log = session, seal, log
        self.received = 0
        self._inbox: Inbox = deque()
        self._arrived = Event()
        self._refusals = Refusals()
        self._waiting: list[tuple[Arrived, WireError]] = []
        self._held: list[Any] = []

    def listen(self, name: str, *telemetry: str) -> None:
        """Receive all data and orders, and this telemetry, from now on; then declare the liveliness of ``name``."""
        for key in (keys.ALL_DATA, *telemetry, keys.START, keys.END, keys.LIFE):
            self._held.append(take_in(self.session, key, self._inbox, self._arrived))
        token = keys.live(name, self.seal.mark(keys.live(name)))
        self._held.append(self.session.liveliness().declare_token(token))

    def now_ns(self) -> int | None:
        """Emulated time now (None: before the start was ordered)."""
        return self._emulated_ns(time.monotonic_ns())

    def _emulated_ns(self, at_ns: int) -> int | None:
        return None if self._start_ns is None else round((at_ns - self._start_ns) * self.plan.run.speed)

    def pulse(self, telling: Telling, settle_s: float = SETTLE_S) -> None:
        """Process what arrived, and hand on what is so old (wall time); to be called every ``FLUSH_S``."""
        self.drain()
        if (now_ns := self.now_ns()) is not None:
            telling.settle(now_ns - round(settle_s * self.plan.run.speed * NS))

    def drain(self) -> None:
        """Process what arrived; what cannot be from a process of this run is refused and counted."""
        while self._inbox:
            arrived_ns, sample = self._inbox.popleft()
            self.received += 1
            key, payload, attachment = bytes_of(sample)
            try:
                if not key.startswith("data/"):
                    self.seal.check(key, payload, attachment)
                self._accept((arrived_ns, key, payload, attachment))
            except WireError as error:
                self._refuse((arrived_ns, key, payload, attachment), error)

    def _accept(self, arrived: Arrived) -> None:
        """Take a sample and log it; a seal has been checked and is of no use in the log."""
        arrived_ns, key, payload, attachment = arrived
        self.take(key, payload, attachment, self._emulated_ns(arrived_ns))
        if self.log:
            self.log.append(Entry(key, payload, attachment if key.startswith("data/") else None))
        if key in (keys.START, keys.LIFE):
            self._retry()

    def _refuse(self, arrived: Arrived, error: WireError) -> None:
        """Count a sample that is refused.

        One of an unknown life, or from before the start, may only have overtaken the order that tells of it.
        """
        waits = error.reason == "life" or (error.reason == "future" and self._start_ns is None)
        if waits and len(self._waiting) < MAX_WAITING and len(arrived[2]) <= MAX_EVENT:
            self._waiting.append((arrived, error))
            return
        self._refusals.add(arrived[1], error)
        self._count(arrived[1], error.reason)

    def _retry(self) -> None:
        waiting, self._waiting = self._waiting, []
        for arrived, _ in waiting:
            try:
                self._accept(arrived)
            except WireError as error:
                self._refuse(arrived, error)

    def give_up(self) -> None:
        """Refuse what still waits for such an order."""
        for (_, key, *_), error in self._waiting:
            self._count(key, error.reason)
        self._waiting.clear()

    def _count(self, key: str, reason: str) -> None:
        self.ledger.refuse(key, reason)
        if self.log:
            self.log.refused(key, reason)
