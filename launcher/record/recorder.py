"""The recorder process: receives all messages of a run over Zenoh and records them.

What it accepts goes to a log on disk as it comes, and to the timeline when it is settled, that is, when nobody can take
it back any more; tables and metrics are made at the end, from the same samples. It writes what it has when it is told
to finish, and also when it is terminated: by the launcher, or by the kernel because the launcher died. Then it is the
last process of the run, and its metrics say so.
"""

from __future__ import annotations

import logging
import os
import shutil
import signal
import time
from pathlib import Path
from threading import Event
from typing import Any, Final

import msgpack
import zenoh
from zenoh.handlers import Callback

from launcher.files import patiently
from launcher.record.journal import METRICS, Journal, summary, write_json
from launcher.record.kept.log import Log
from launcher.record.kept.recovery import settled_until
from launcher.record.listener import FLUSH_S, Listener
from launcher.record.metrics import LAUNCHER_DIED, Metrics, cut_off, ended_because
from launcher.record.samples import deaths_of
from launcher.records import RECORDER, Plan
from trackfield.drivers.exchange.intake import opened
from trackfield.drivers.exchange.seal import Seal
from trackfield.drivers.session import open_session
from trackfield.errors import RunFailed
from trackfield.plugins import give
from trackfield.role import NS
from trackfield.wire import keys
from trackfield.wire.error import WireError

log = logging.getLogger(__name__)

STATUS_S: Final = 0.5
FINALS_TIMEOUT_S: Final = 5.0


class Recorder(Listener):
    """Logs what it accepts, feeds the journal of a run folder, reports progress, and writes all tables at the end.

    ``orphaned`` says that the launcher died.
    """

    def __init__(self, session: zenoh.Session, plan: Plan, folder: Path, seal: Seal) -> None:
        self.log: Log = Log(folder)
        super().__init__(session, plan, seal, self.log)
        self.journal = Journal(plan, self.ledger, folder)
        self.journal.show(lambda _: None)  # it takes a while, so before anything happens
        self.orphaned = False
        self._told: bytes | None = None
        self._finish = Event()
        self._parent = os.getppid()
        self._held.append(session.declare_subscriber(keys.FINISH, Callback(self._on_finish, indirect=False)))
        self.listen(RECORDER, keys.ALL_TELEMETRY)

    def _on_finish(self, sample: zenoh.Sample) -> None:
        try:
            told = opened(sample, self.seal)
            deaths_of(told)
        except WireError as error:
            self._refusals.add(keys.FINISH, error)
            return
        self._told = told
        self._finish.set()

    def terminate(self) -> None:
        """End the recording with what has arrived."""
        self.orphaned = os.getppid() != self._parent
        self._finish.set()

    def run(self) -> None:
        """Record until told to finish, then write tables and metrics. Raises ``RunFailed`` if the disk is full."""
        status_at = 0.0
        while not self._finish.wait(FLUSH_S):
            self.pulse(self.journal)
            self.log.flush(self.now_ns())
            if time.monotonic() >= status_at:
                status_at = time.monotonic() + STATUS_S
                self._report()
        self._hear_the_last()
        self.give_up()
        self.log.flush(self.now_ns())
        if self.orphaned and self.now_ns() is None:
            self.log.remove()  # the run had not begun
        else:
            self._write()

    def _report(self) -> None:
        key, status = keys.telemetry(RECORDER, "status"), msgpack.packb(self._status())
        self.session.put(key, status, attachment=self.seal.stamp(key, status))

    def _status(self) -> dict[str, Any]:
        now_ns = max(self.now_ns() or 0, 0)
        return {"t_s": (now_ns - self.plan.origin_ns) / NS, **summary(self.journal, now_ns)}

    def _hear_the_last(self) -> None:
        """Await final records, or, terminated, note who has not sent one."""
        now_ns = self.now_ns()
        if self._told is not None:
            self._accept((time.monotonic_ns(), keys.FINISH, self._told, None))
            self._await_finals()
            if self.now_ns() is None:  # it was never started
                self.ledger.end(0)
            return
        self.drain()
        self.ledger.end(settled_until(self.plan, now_ns or 0))
        if not self.orphaned:
            unheard = self.ledger.diaries.keys() - self.ledger.finals.keys()
            self.deaths = [(name, None, "not heard from again") for name in sorted(unheard)]

    def _await_finals(self) -> None:
        deadline = time.monotonic() + FINALS_TIMEOUT_S
        wanted = self.ledger.diaries.keys() - {name for name, *_ in self.deaths or ()}
        self.drain()
        while wanted - set(self.ledger.finals) and time.monotonic() < deadline:
            time.sleep(0.02)
            self.drain()

    def _write(self) -> None:
        """Write tables and metrics, then the timeline; whoever dies now has the log."""
        metrics = self._tables()
        metrics = (metrics if self._told is not None else cut_off(metrics)) | ended_because(LAUNCHER_DIED)
        metrics["driver"] = "processes"
        metrics["recorder"]["complaints"] += self._outages()
        self._write_metrics(metrics)
        if failure := self.journal.draw():
            log.error("%s", failure, exc_info=self.journal.error)
            metrics["recorder"]["complaints"].append(f"{failure}; trackfield recover draws it")
            self._write_metrics(metrics)
        else:
            self.log.remove()

    def _tables(self) -> Metrics:
        """Write the tables; if the disk is full, the log and they come before the timeline."""
        try:
            return self.journal.tables(self.deaths or (), messages=self.received)
        except RunFailed:
            self.journal.make_room()
            self.log.flush(self.now_ns())
            return self.journal.tables(self.deaths or (), messages=self.received)

    def _write_metrics(self, metrics: Metrics) -> None:
        file = self.journal.folder / METRICS
        patiently(lambda: write_json(metrics, file), str(file))

    def _outages(self) -> list[str]:
        """When the disk did not take what was recorded, in words; nothing was lost by that."""
        origin_ns, end_ns = self.plan.origin_ns, self.ledger.run.end_ns
        said = []
        for since, until, why in self.log.outages:
            over = "the end" if until is None or until >= end_ns else f"{(until - origin_ns) / NS:.1f} s"
            said.append(
                f"the disk took nothing from {(since - origin_ns) / NS:.1f} s to {over} ({why}); nothing was lost"
            )
        return said


def record(settings: str, plan: Plan, folder: Path, token: bytes, sockets: str = "") -> None:
    """The body of the recorder process, with these settings of its session: ``token`` is the run's secret, ``sockets``
    a folder to remove if the launcher cannot.
    """
    give(plan.own_places, installed=True)
    session = open_session(settings)
    recorder = Recorder(session, plan, folder, Seal(token))
    signal.signal(signal.SIGTERM, lambda *_: recorder.terminate())
    try:
        recorder.run()
    except RunFailed as error:
        log.error("%s", error)  # the launcher makes them from the log, if it can
    if recorder.orphaned and sockets:
        shutil.rmtree(sockets, ignore_errors=True)
    session.close()  # type: ignore[no-untyped-call]
