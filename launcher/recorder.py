"""The recorder process: hears all of a run over Zenoh and writes it down.

Settled events go to the timeline as the run goes on; tables and metrics are made at the end. It writes what it has
when it is told to finish, and just as well when it is terminated.
"""

from __future__ import annotations

import logging
import signal
import time
from collections import deque
from pathlib import Path
from threading import Event
from typing import Any, Final

import msgpack
import zenoh
from zenoh.handlers import Callback

from launcher.ledger import Ledger
from launcher.records import RECORDER, Plan
from launcher.result import METRICS, Journal, summary, write_json
from trackfield.drivers.frames import Frame
from trackfield.drivers.process import Inbox, Seen, take_in
from trackfield.drivers.session import open_client
from trackfield.drivers.spec import ProcessSpec, role_factory
from trackfield.drivers.telemetry import unpack
from trackfield.role import NEIGHBOURHOOD, NS
from trackfield.wire import keys
from trackfield.wire.codec import WireError
from trackfield.wire.envelope import Envelope

log = logging.getLogger(__name__)

FLUSH_S: Final = 0.25
STATUS_S: Final = 0.5
SETTLE_S: Final = 1.0
"""How far the timeline stays behind (wall time), so that what it shows is rarely undone."""
FINALS_TIMEOUT_S: Final = 5.0


class Recorder:
    """Takes samples from Zenoh's thread, feeds ledger and timeline, and closes the books."""

    def __init__(self, session: zenoh.Session, plan: Plan, folder: Path) -> None:
        self.session, self.plan = session, plan
        for factory in {p.factory for p in plan.processes}:
            role_factory(factory)  # to know the message kinds that it defines
        self.ledger = Ledger(plan.run, plan.processes)
        self.journal = Journal(plan, self.ledger, folder)
        self.deaths: list[tuple[str, float | None, str]] = []
        self._inbox: Inbox = deque()
        self._arrived, self._finish = Event(), Event()
        self._start_ns: int | None = None
        self._seen = Seen()
        self._received = 0
        self._held = [
            take_in(session, key, self._inbox, self._arrived)
            for key in (keys.ALL_DATA, keys.ALL_TELEMETRY, keys.START, keys.END, keys.LIFE)
        ]
        self._held.append(session.declare_subscriber(keys.FINISH, Callback(self._on_finish, indirect=False)))
        self._held.append(session.liveliness().declare_token(keys.live(RECORDER)))

    def _on_finish(self, sample: zenoh.Sample) -> None:
        self.deaths = msgpack.unpackb(sample.payload.to_bytes(), use_list=False)
        self._finish.set()

    def terminate(self) -> None:
        """Close the books with what there is."""
        unheard = self.ledger.diaries.keys() - self.ledger.finals.keys()
        self.deaths = [(name, None, "not heard of again") for name in sorted(unheard)]
        self._finish.set()

    def run(self) -> None:
        """Record until told to finish, then close the books."""
        status_at = 0.0
        while not self._finish.wait(FLUSH_S):
            self._drain()
            if self._start_ns is not None:
                until = self._now_ns() - round(SETTLE_S * self.plan.run.speed * NS)
                self.journal.settle(until)
            if time.monotonic() >= status_at:
                status_at = time.monotonic() + STATUS_S
                self.session.put(keys.telemetry(RECORDER, "status"), msgpack.packb(self._status()))
        self._await_finals()
        metrics = self.journal.close(self.deaths, messages=self._received)
        write_json(metrics, self.journal.folder / METRICS)

    def _now_ns(self) -> int:
        assert self._start_ns is not None
        return round((time.monotonic_ns() - self._start_ns) * self.plan.run.speed)

    def _status(self) -> dict[str, Any]:
        t = 0.0 if self._start_ns is None else max(self._now_ns(), 0) / NS
        return {"t_s": t, **summary(self.journal)}

    def _await_finals(self) -> None:
        deadline = time.monotonic() + FINALS_TIMEOUT_S
        wanted = self.ledger.diaries.keys() - {name for name, *_ in self.deaths}
        self._drain()
        while wanted - set(self.ledger.finals) and time.monotonic() < deadline:
            time.sleep(0.02)
            self._drain()

    # --- samples --------------------------------------------------------------------------------------------------

    def _drain(self) -> None:
        while self._inbox:
            _, sample = self._inbox.popleft()
            key = str(sample.key_expr)
            self._received += 1
            try:
                if key.startswith("data/"):
                    self._data(key, sample)
                elif key.startswith("telemetry/"):
                    self._telemetry(key, sample.payload.to_bytes())
                elif key == keys.START:
                    self._start_ns = int(sample.payload.to_string())
                elif key == keys.END:
                    self.ledger.end(int(sample.payload.to_string()))
                elif key == keys.LIFE:
                    self.ledger.life(ProcessSpec.from_plain(msgpack.unpackb(sample.payload.to_bytes())))
            except (WireError, ValueError) as error:
                log.warning("ignored a sample on %s: %s", key, error)

    def _data(self, key: str, sample: zenoh.Sample) -> None:
        address = keys.parse(key)
        if sample.attachment is None:
            raise WireError("envelope", "a foreign frame has none; its receivers stamp it")
        e = Envelope.unpack(sample.attachment.to_bytes())
        to, payload = address.to or NEIGHBOURHOOD, sample.payload.to_bytes()
        frame = Frame(address.src, e.incarnation, address.kind, e.sent_ns, e.copy, to, address.medium, payload)
        if self._seen.again(frame.identity):
            return  # its hearers count it as a duplicate
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


def record(endpoint: str, plan: Plan, folder: Path) -> None:
    """The life of the recorder process."""
    session = open_client(endpoint, plan.run.run)
    recorder = Recorder(session, plan, folder)
    signal.signal(signal.SIGTERM, lambda *_: recorder.terminate())
    recorder.run()
    session.close()  # type: ignore[no-untyped-call]
