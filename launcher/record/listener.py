"""Receives all messages of a run over Zenoh and keeps its ledger: the common part of all recorders, dead ones too."""

from __future__ import annotations

import logging
import time
from collections import deque
from functools import lru_cache
from threading import Event
from typing import Any, Final

import msgpack
import zenoh

from launcher.record.journal import Telling, Unplanned
from launcher.record.kept.log import Entry, Log
from launcher.record.ledger import Ledger
from launcher.records import RECORDER, Plan
from trackfield.drivers.frames import Frame
from trackfield.drivers.process import Inbox, Seen, take_in
from trackfield.drivers.spec import ProcessSpec, role_factory
from trackfield.drivers.telemetry import unpack
from trackfield.role import NEIGHBOURHOOD, NS
from trackfield.wire import keys
from trackfield.wire.codec import WireError
from trackfield.wire.envelope import Envelope

log = logging.getLogger(__name__)

FLUSH_S: Final = 0.25
"""How often received samples are processed."""
SETTLE_S: Final = 1.0
"""How far the timeline lags behind (wall time), so that what it shows is rarely undone."""

_parsed = lru_cache(maxsize=10_000)(keys.parse)
"""Cached: a run uses few keys, again and again."""


class Intake:
    """Feeds the ledger with samples, wherever they come from.

    ``deaths`` are the unplanned ones of which the launcher told at the end (None: it has not told).
    """

    def __init__(self, plan: Plan) -> None:
        self.plan = plan
        for factory in {p.factory for p in plan.processes}:
            role_factory(factory)  # to know the message kinds that it defines
        self.ledger = Ledger(plan.run, plan.processes)
        self.deaths: list[Unplanned] | None = None
        self._start_ns: int | None = None
        self._seen = Seen()

    def take(self, key: str, payload: bytes, attachment: bytes | None = None) -> None:
        """Parse a sample and hand it to the ledger. Raises ``ValueError`` (``WireError``) for one that is refused."""
        if key.startswith("data/"):
            self._data(key, payload, attachment)
        elif key.startswith("telemetry/"):
            self._telemetry(key, payload)
        elif key == keys.START:
            self._start_ns = int(payload)
        elif key == keys.END:
            self.ledger.end(int(payload))
        elif key == keys.LIFE:
            self.ledger.life(ProcessSpec.from_plain(msgpack.unpackb(payload)))
        elif key == keys.FINISH:
            self.deaths = msgpack.unpackb(payload, use_list=False)

    def _data(self, key: str, payload: bytes, attachment: bytes | None) -> None:
        address = _parsed(key)
        if attachment is None:
            raise WireError("envelope", "a foreign frame has none; its receivers stamp it")
        e, to = Envelope.unpack(attachment), address.to or NEIGHBOURHOOD
        frame = Frame(address.src, e.incarnation, address.kind, e.sent_ns, e.copy, to, address.medium, payload)
        if self._seen.again(frame.identity):
            return  # its receivers count it as a duplicate
        self.ledger.sent(frame)

    def _telemetry(self, key: str, data: bytes) -> None:
        _, process, what = key.split("/")
        if process == RECORDER:
            return
        if what == "event":
            self.ledger.told(process, unpack(data))
        elif what == "counts":
            self.ledger.counts[process] = msgpack.unpackb(data)
        elif what == "final":
            self.ledger.final(process, msgpack.unpackb(data, strict_map_key=False))


class Listener(Intake):
    """Takes samples from Zenoh's thread; ``received`` counts them. ``log``, if there is one, gets the accepted ones."""

    def __init__(self, session: zenoh.Session, plan: Plan, log: Log | None = None) -> None:
        super().__init__(plan)
        self.session, self.log = session, log
        self.received = 0
        self._inbox: Inbox = deque()
        self._arrived = Event()
        self._held: list[Any] = []

    def listen(self, name: str, *telemetry: str) -> None:
        """Receive all data and orders, and this telemetry, from now on; then declare the liveliness of ``name``."""
        for key in (keys.ALL_DATA, *telemetry, keys.START, keys.END, keys.LIFE):
            self._held.append(take_in(self.session, key, self._inbox, self._arrived))
        self._held.append(self.session.liveliness().declare_token(keys.live(name)))

    def now_ns(self) -> int | None:
        """Emulated time now (None: before the start was ordered)."""
        if self._start_ns is None:
            return None
        return round((time.monotonic_ns() - self._start_ns) * self.plan.run.speed)

    def pulse(self, telling: Telling) -> None:
        """Process what arrived, and hand on what is settled; to be called every ``FLUSH_S``."""
        self.drain()
        if (now_ns := self.now_ns()) is not None:
            telling.settle(now_ns - round(SETTLE_S * self.plan.run.speed * NS))

    def drain(self) -> None:
        """Process what arrived."""
        while self._inbox:
            _, sample = self._inbox.popleft()
            key, attachment = str(sample.key_expr), sample.attachment
            entry = Entry(key, sample.payload.to_bytes(), None if attachment is None else attachment.to_bytes())
            self.received += 1
            try:
                self.take(*entry)
            except (WireError, ValueError) as error:
                log.warning("ignored a sample on %s: %s", key, error)
                continue
            if self.log:
                self.log.append(entry)
