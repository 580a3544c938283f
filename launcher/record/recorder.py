"""The recorder process: receives all messages of a run over Zenoh and records them.

Settled events go to the timeline as the run goes on; tables and metrics are made at the end. It writes what it has
when it is told to finish, and also when it is terminated.
"""

from __future__ import annotations

import signal
import time
from pathlib import Path
from threading import Event
from typing import Any, Final

import msgpack
import zenoh
from zenoh.handlers import Callback

from launcher.record.journal import METRICS, Journal, Unplanned, summary, write_json
from launcher.record.listener import FLUSH_S, Listener
from launcher.record.samples import deaths_of
from launcher.records import RECORDER, Plan
from trackfield.drivers.intake import opened
from trackfield.drivers.seal import Seal
from trackfield.drivers.session import open_client
from trackfield.plugins import give
from trackfield.role import NS
from trackfield.wire import keys
from trackfield.wire.error import WireError

STATUS_S: Final = 0.5
FINALS_TIMEOUT_S: Final = 5.0


class Recorder(Listener):
    """Feeds the journal of a run folder, reports progress, and writes tables and metrics at the end."""

    def __init__(self, session: zenoh.Session, plan: Plan, folder: Path, seal: Seal) -> None:
        super().__init__(session, plan, seal)
        self.journal = Journal(plan, self.ledger, folder)
        self.deaths: list[Unplanned] = []
        self._finish = Event()
        self._held.append(session.declare_subscriber(keys.FINISH, Callback(self._on_finish, indirect=False)))
        self.listen(RECORDER, keys.ALL_TELEMETRY)

    def _on_finish(self, sample: zenoh.Sample) -> None:
        try:
            self.deaths = deaths_of(opened(sample, self.seal))
        except WireError as error:
            self._refusals.add(keys.FINISH, error)
            return
        self._finish.set()

    def terminate(self) -> None:
        """End the recording with what has arrived."""
        unheard = self.ledger.diaries.keys() - self.ledger.finals.keys()
        self.deaths = [(name, None, "not heard from again") for name in sorted(unheard)]
        self._finish.set()

    def run(self) -> None:
        """Record until told to finish, then write tables and metrics."""
        status_at = 0.0
        while not self._finish.wait(FLUSH_S):
            self.pulse(self.journal)
            if time.monotonic() >= status_at:
                status_at = time.monotonic() + STATUS_S
                self._report()
        self._await_finals()
        self.give_up()
        metrics = self.journal.close(self.deaths, messages=self.received)
        write_json(metrics, self.journal.folder / METRICS)

    def _report(self) -> None:
        key, status = keys.telemetry(RECORDER, "status"), msgpack.packb(self._status())
        self.session.put(key, status, attachment=self.seal.stamp(key, status))

    def _status(self) -> dict[str, Any]:
        return {"t_s": (max(self.now_ns() or 0, 0) - self.plan.origin_ns) / NS, **summary(self.journal)}

    def _await_finals(self) -> None:
        deadline = time.monotonic() + FINALS_TIMEOUT_S
        wanted = self.ledger.diaries.keys() - {name for name, *_ in self.deaths}
        self.drain()
        while wanted - set(self.ledger.finals) and time.monotonic() < deadline:
            time.sleep(0.02)
            self.drain()


def record(endpoint: str, plan: Plan, folder: Path, token: bytes) -> None:
    """The body of the recorder process; ``token`` is the run's secret."""
    give(plan.own_places, installed=True)
    session = open_client(endpoint, plan.run.run)
    recorder = Recorder(session, plan, folder, Seal(token))
    signal.signal(signal.SIGTERM, lambda *_: recorder.terminate())
    recorder.run()
    session.close()  # type: ignore[no-untyped-call]
