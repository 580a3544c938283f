"""A recorder that shows a run while it goes on: it serves the timeline to browsers and writes no file.

It is not part of the field. A browser that hangs holds up this recorder, never the one that writes the run folder. What
it shows is provisional: it may be taken back by processes after it was drawn.
"""

from __future__ import annotations

import signal
from threading import Event
from typing import Final

import zenoh

from launcher.record.journal import Telling
from launcher.record.listener import FLUSH_S, Listener
from launcher.records import LIVE, Plan
from launcher.timeline.timeline import Timeline
from trackfield.drivers.exchange.seal import Seal
from trackfield.drivers.session import open_session
from trackfield.plugins import give
from trackfield.wire import keys

LAG_S: Final = 1.0
"""How far it lags behind (wall time), so that what it shows is rarely taken back."""


class LiveRecorder(Listener):
    """Shows what it receives, at a port of this machine or the viewer at an address, until it is told to end."""

    def __init__(self, session: zenoh.Session, plan: Plan, to: int | str, seal: Seal) -> None:
        super().__init__(session, plan, seal, provisional=True)
        self.timeline = Timeline(to, plan.info)
        self.telling = Telling(plan, self.ledger, lambda: self.timeline)
        self.end = Event()
        self.listen(LIVE, keys.telemetry_of_all("event"))

    def run(self) -> None:
        """Show the run up to its end."""
        while not self.end.wait(FLUSH_S):
            self.pulse(self.telling, LAG_S)
        self.drain()
        self.telling.end()
        self.telling.show(lambda timeline: timeline.close())


def show(settings: str, plan: Plan, to: int | str, token: bytes) -> None:
    """The body of the process that shows a run, with these settings of its session; ``token`` is the run's secret."""
    give(plan.own_places, installed=True)
    session = open_session(settings)
    recorder = LiveRecorder(session, plan, to, Seal(token))
    signal.signal(signal.SIGTERM, lambda *_: recorder.end.set())
    recorder.run()
    session.close()  # type: ignore[no-untyped-call]
