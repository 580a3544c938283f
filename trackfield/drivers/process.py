"""The process driver: one role as an operating-system process, fed by Zenoh and the clock.

The loop empties the inbox that Zenoh's thread fills, handles the due events, and sleeps until the next one.
Emulated time t is ``start + t / speed`` on the run's clock (``hostclock.py``); a handler never sees that clock.
"""

from __future__ import annotations

import os
import signal
import time
from collections import deque
from collections.abc import Iterable
from functools import partial
from itertools import count
from threading import Event
from typing import Any, Final

import msgpack
import zenoh
from zenoh.handlers import Callback

from trackfield.drivers.devices import Devices
from trackfield.drivers.engine.conditions import NEVER
from trackfield.drivers.engine.core import Core
from trackfield.drivers.engine.frames import Frame, Output, PortInput, Refused, Sent, TakenBack, Told, Undone
from trackfield.drivers.exchange.caution import Caution
from trackfield.drivers.exchange.histogram import Histogram
from trackfield.drivers.exchange.inbox import Inbox, no_stamp, take_in
from trackfield.drivers.exchange.incoming import HORIZON_S, Incoming
from trackfield.drivers.exchange.intake import Refusals, begun, nanoseconds, opened
from trackfield.drivers.exchange.outgoing import Outgoing
from trackfield.drivers.exchange.seal import Seal
from trackfield.drivers.exchange.telemetry import pack
from trackfield.drivers.hostclock import HostClock
from trackfield.drivers.joining.heritage import PATIENCE_NS, Heritage
from trackfield.drivers.joining.join import confirm, join, token
from trackfield.drivers.spec import build_core, link_of
from trackfield.role import Store, Write
from trackfield.wire import keys
from trackfield.wire.envelope import Envelope
from trackfield.wire.error import WireError

REPEAT_NS: Final = 1_000_000_000
"""How often changed counters, and the end of the run, are reported (wall time)."""
SPENT_NS: Final = 5_000_000_000
"""How often one on a battery says how much it has taken from it (wall time)."""
LINGER_NS: Final = 300_000_000
"""A process that was killed as planned ends when it has heard nothing for so long (wall time)."""
LINGER_LATE: Final = 4
"""And so many times as long as it waits because things come late."""
HORIZON_NS: Final = round(HORIZON_S * 1e9)
"""It ends after so long in any case (wall time)."""
FROM_DEVICES: Final = 2**31
"""The numbers from which inputs are counted that no plan knows: after all others of their instant."""
LAST_WAVE: Final = 2**62
"""The number of what a process says as it ends, after all questions."""
ORDER_BYTES: Final = 64
"""The longest order to a process."""


class Process:
    """One process of the field: declares itself, waits for the start, runs to the end, and sends its final record.

    Its role is made by ``factory``. Orders, which come on the key expression ``orders``, and answers count if they have
    the run's ``seal``. ``clock`` is the run's clock on this host; if not given, this is the launcher's host.
    """

    def __init__(
        self,
        session: zenoh.Session,
        name: str,
        factory: str,
        seal: Seal,
        orders: str = keys.ORDERS,
        clock: HostClock | None = None,
    ) -> None:
        self.session, self.name = session, name
        self._now_ns = (clock or HostClock()).now_ns
        self._seal, self._refused, self._forged = seal, Refusals(), Refusals()
        self._inbox: Inbox = deque()
        self._wake, self._stop = Event(), Event()
        self._start_ns: int | None = None
        self._end_ns = NEVER
        self._held = [session.declare_subscriber(orders, Callback(self._on_order, indirect=False))]
        joined = join(session, name, factory, seal, self._forged)
        self.spec, self._speed = joined.process, joined.run.speed
        self._end_ns = min(self._end_ns, joined.run.end_ns)
        link = link_of(joined.run, [joined.process])
        horizon_ns = round(HORIZON_S * joined.run.speed * 1e9)
        self.core: Core = build_core(joined.run, joined.process, link, horizon_ns=horizon_ns)
        self._incoming = Incoming(self.spec, link, self.core, self._wall)
        self._outgoing = Outgoing(self._put)
        self._at_ports: deque[tuple[int, str, bytes]] = deque()
        self._devices = Devices(self.spec.ports, self._on_port)
        self._port_inputs = count(FROM_DEVICES)
        self._told, self._stored = 0, b""
        self._counts_ns, self._spent_ns, self._reached_ns = NEVER, NEVER, 0
        self._wave = self._said_wave = 0
        self._slip, self._latency, self._lag = Histogram(), Histogram(), Histogram()
        self._caution = Caution()
        self._heritage = Heritage(session, self.spec, joined.left, self._wake.set, seal, self._refused)
        for key in self._inboxes():
            self._held.append(
                take_in(session, key, self._inbox, self._wake, self._now_ns)
                if self.spec.sink
                else session.declare_subscriber(key, Callback(self._on_data, indirect=False))
            )
        if joined.start_ns is not None:
            self._start_ns = joined.start_ns
        self._ticket = joined.ticket
        self._token = session.liveliness().declare_token(token(name, joined.ticket, seal))

    def confirm(self, host: str) -> None:
        """Wait until the launcher has seen this process, which was started elsewhere, on ``host``.

        Raises ``JoinError`` if another has the place: two may have asked for it at once.
        """
        confirm(self.session, self.name, self._ticket, host, self._seal, self._forged)

    def _inboxes(self) -> list[str]:
        id, media = self.spec.id, self.spec.media
        cells = [keys.neighbourhood(medium, cell) for medium in media for cell in self.spec.cells_in(medium)]
        return [keys.inbox(medium, id) for medium in media] + cells

    def _waits_for_heritage(self) -> bool:
        """Whether this life starts within the run and the heritage is not known yet."""
        return not self.core.life.started and not self._heritage.known and self.spec.start_ns < self._end_ns

    # --- Zenoh's thread: append and wake, nothing else ------------------------------------------------------------

    def _on_data(self, sample: zenoh.Sample) -> None:
        self._inbox.append((self._now_ns(), sample))
        self._wake.set()

    def _on_port(self, port: str, data: bytes) -> None:
        self._at_ports.append((self._now_ns(), port, data))
        self._wake.set()

    def _on_order(self, sample: zenoh.Sample) -> None:
        key = str(sample.key_expr)
        try:
            self._obey(keys.order_of(key), opened(sample, self._seal, ORDER_BYTES))
        except WireError as error:
            self._refused.add(key, error)
        self._wake.set()

    def _obey(self, key: str, order: bytes) -> None:
        """Follow an order of the launcher; the start cannot be changed, and the end only comes sooner."""
        if key == keys.START:
            self._start_ns = begun(self._start_ns, order)
        elif key == keys.END:
            self._end_ns = min(self._end_ns, nanoseconds(order))
        elif key == keys.SETTLE:
            self._wave = nanoseconds(order)
        elif key == keys.STOP:
            self._stop.set()
        elif key != keys.FINISH:
            raise WireError("key", "no order to a process")

    # --- the loop -------------------------------------------------------------------------------------------------

    def run(self) -> None:
        """Run until the launcher says stop."""
        while self._start_ns is None and not self._stop.is_set():
            self._wake.wait()
            self._wake.clear()
        while not self._stop.is_set():
            self._wake.clear()
            self._drain()
            now = self._now_ns()
            if now >= self._killed_ns():
                self._close()
                os.kill(os.getpid(), signal.SIGKILL)  # a planned kill
            self._wake.wait(max(self._work(now) - now, 0) / 1e9)
        self._close()

    def _killed_ns(self) -> int:
        """When (wall) a planned kill ends this process: once no more frames come that it may have to undo."""
        kill_ns = self.core.conditions.kill_ns
        if kill_ns == NEVER:
            return NEVER
        killed, latest = self._wall(kill_ns), self._incoming.latest_ns
        return min(max(killed, latest) + LINGER_NS + LINGER_LATE * self._caution.at(latest), killed + HORIZON_NS)

    def _work(self, now: int) -> int:
        """Handle at most one thing that is due; returns when (wall) the next may be."""
        report_ns = self._report(now)
        self._devices.release(now, self.core.forgotten_ns)
        if self._outgoing.release(now):
            return now
        key = self.core.next_key()
        due = NEVER if key is None or key[0] >= self._end_ns else self._wall(key[0])
        if due < NEVER and self._waits_for_heritage():
            due = max(due, self._wall(self.spec.start_ns) + PATIENCE_NS)
        if self.core.behind:
            lag = now - self._wall(self.core.doubtful_ns)
            self._lag.add(lag)
            self._caution.learn(lag, now)
            self._release(self.core.catch_up())
        elif now < (after := due + self._caution.at(now)):
            return min(after, report_ns, self._outgoing.next_ns(NEVER), self._devices.next_ns(NEVER), self._killed_ns())
        else:
            if key is not None and key > self.core.front:
                self._slip.add(now - due)
            self._handle_next()
        return now

    def _handle_next(self) -> None:
        if not self.core.life.started:
            self.core.inherit(self._heritage.stored, self._heritage.spent)
            self._devices.open()
            self._spent_ns = 0
        self._release(self.core.handle_next())

    def _report(self, now: int) -> int:
        """Report changed counters, and the end when it is reached; returns when (wall) to do so again."""
        if now >= self._counts_ns:
            self._counts_ns = NEVER
            self._say("counts", msgpack.packb({**self._incoming.counts, **self.core.tally}), must=False)
        if now >= self._spent_ns:
            self._say_spent(now)
        end = self._wall(self._end_ns)
        if now >= end and (now >= self._reached_ns or self._wave > self._said_wave):
            self._reached_ns = now + REPEAT_NS
            self._said_wave = self._wave
            self._say_reached(self._wave)
        return min(self._counts_ns, self._spent_ns, max(end, self._reached_ns))

    def _say_spent(self, now: int) -> None:
        """Say what was taken from the battery so far, for another process that may have to take this one's place."""
        assert self._start_ns is not None
        spent = self.core.spent(min(round((now - self._start_ns) * self._speed), self._end_ns))
        self._spent_ns = NEVER if spent is None else now + SPENT_NS
        if spent is not None:
            self._say("spent", msgpack.packb(spent), must=False)

    def _say_reached(self, wave: int) -> None:
        """Say that it is the end, how many samples came and were put, by receiver, and whether it has more to do."""
        key = self.core.next_key()
        behind = self.core.behind or (key is not None and key[0] < self._end_ns)
        self._say("reached", msgpack.packb([wave, self._incoming.came, self._outgoing.puts, behind]))

    def _wall(self, t_ns: int) -> int:
        assert self._start_ns is not None
        return self._start_ns + round(t_ns / self._speed)

    def _drain(self) -> None:
        while self._inbox:
            arrived_ns, sample = self._inbox.popleft()
            self._counts_ns = min(self._counts_ns, arrived_ns + REPEAT_NS)
            envelope = self._incoming.take(sample, arrived_ns, self._end_ns, partial(self._stamped, arrived_ns))
            if envelope is not None and envelope.put_ns:
                self._latency.add(arrived_ns - envelope.put_ns)
        while self._at_ports:
            arrived_ns, port, data = self._at_ports.popleft()
            due_ns = round((arrived_ns - (self._start_ns or arrived_ns)) * self._speed)
            if self.core.owns(due_ns):
                self.core.offer(PortInput(due_ns, next(self._port_inputs), port, data))

    def _stamped(self, arrived_ns: int) -> Envelope:
        """The envelope of a foreign device's frame that came without one."""
        if self._speed != 1 or self._start_ns is None:
            return no_stamp()
        return Envelope(max(arrived_ns - self._start_ns, 0))

    def _close(self) -> None:
        """Handle the rest of the run, send the final record, and leave."""
        if self._start_ns is not None:
            self._drain()
            self._release(self.core.catch_up())
        while self._start_ns is not None and (key := self.core.next_key()) is not None and key[0] < self._end_ns:
            self._handle_next()
        self._outgoing.flush()
        self._devices.release(NEVER, self.core.forgotten_ns)  # nothing is undone any more
        self._devices.close()
        self._say_reached(LAST_WAVE)
        self._say("final", msgpack.packb(self.record()))
        self.session.close()  # type: ignore[no-untyped-call]

    def record(self) -> dict[str, Any]:
        """The counters of this life, for the recorder's cross-check."""
        out, heard = self._outgoing, self._incoming.heard_until(self._end_ns)
        return {
            **self.core.record(self._end_ns),
            **self._incoming.counts,
            "forged": self._forged.total,
            "sent": out.live.size,
            "sent_hash": out.live.total,
            "puts": out.seq,
            "retractions": out.retractions,
            "heard": heard.size,
            "heard_hash": heard.total,
            "told": self._told,
            "unwritten": self._devices.lost,
            "slip": dict(self._slip.counts),
            "lag": dict(self._lag.counts),
            "latency": dict(self._latency.counts),
            "cpu_s": time.process_time(),
        }

    # --- what leaves ----------------------------------------------------------------------------------------------

    def _release(self, outputs: Iterable[Output]) -> None:
        """Send frames, take them back, and tell."""
        for output in outputs:
            if isinstance(output, Sent):
                self._outgoing.send(output.frame, self._wall(output.frame.sent_ns), self._now_ns())
            elif isinstance(output, TakenBack):
                self._outgoing.take_back(output.frame)
            elif not (isinstance(output, Told) and isinstance(output.effect, Store)):
                self._told += 1
                self._say("event", pack(output), must=False)
                self._write(output)
        key = self.core.next_key()
        self.core.host_late += self._devices.mistaken(NEVER if key is None else key[0])
        self._outgoing.forget(self.core.forgotten_ns)
        if self.core.life.stored != self._stored:  # also if what had been stored is undone
            self._stored = self.core.life.stored
            self._say("stored", self._stored)

    def _write(self, output: Told | Refused | Undone) -> None:
        """Write to devices what an event wrote to their ports."""
        if isinstance(output, Undone):
            self._devices.undo(output.key)
        elif isinstance(output, Told) and isinstance(output.effect, Write):
            self._devices.write(output.key, output.effect, self._wall(output.key[0]))

    def _put(self, frame: Frame, version: int) -> None:
        seq = self._outgoing.seq
        times = self._now_ns(), version, frame.preamble_ns
        envelope = Envelope(frame.sent_ns, frame.incarnation, frame.copy, seq, *times)
        to_all = (frame.medium, self.spec.cell_in(frame.medium), frame.src, frame.kind)
        to_one = (frame.medium, frame.to, frame.src, frame.kind)
        self.session.put(
            keys.broadcast(*to_all) if frame.broadcast else keys.unicast(*to_one),
            frame.payload,
            attachment=envelope.pack(),
            congestion_control=zenoh.CongestionControl.DROP,
        )

    def _say(self, what: str, data: bytes, *, must: bool = True) -> None:
        """Telemetry, that ``must`` arrive or may be lost."""
        key = keys.telemetry(self.name, what)
        care = zenoh.CongestionControl.BLOCK if must else zenoh.CongestionControl.DROP
        self.session.put(key, data, attachment=self._seal.stamp(key, data), congestion_control=care)
