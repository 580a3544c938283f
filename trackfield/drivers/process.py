"""The process driver: one role as an operating-system process, fed by Zenoh and the clock.

The loop empties the inbox that Zenoh's thread fills, handles the due events, and sleeps until the next one.
Emulated time t is ``start + t / speed`` on the host's monotonic clock; a handler never sees that clock.
"""

from __future__ import annotations

import logging
import os
import signal
import time
from bisect import insort
from collections import deque
from collections.abc import Iterable
from operator import itemgetter
from threading import Event
from typing import Any, Final

import msgpack
import zenoh
from zenoh.handlers import Callback

from trackfield.drivers.conditions import NEVER
from trackfield.drivers.core import Core
from trackfield.drivers.frames import RANK_TIMER, Arrival, Frame, Output, Refused, Sent, Told, Undone
from trackfield.drivers.heritage import PATIENCE_NS, Heritage
from trackfield.drivers.histogram import Histogram
from trackfield.drivers.inbox import EARLY_NS, Inbox, Seen, bytes_of, frame_in, no_stamp, take_in
from trackfield.drivers.intake import Refusals, begun, nanoseconds, opened
from trackfield.drivers.join import confirm, join, token
from trackfield.drivers.seal import Seal
from trackfield.drivers.spec import build_core, link_of
from trackfield.drivers.telemetry import pack
from trackfield.link.fate import Link
from trackfield.role import Store
from trackfield.wire import keys
from trackfield.wire.envelope import Envelope
from trackfield.wire.error import WireError

log = logging.getLogger(__name__)

HORIZON_S: Final = 5.0
"""How long (wall time) events can be undone; frames are tens of milliseconds out of order, unless a host stalls."""
REPEAT_NS: Final = 1_000_000_000
"""How often changed counters, and the end of the run, are reported (wall time)."""
HOLD_NS: Final = 40_000_000
"""How long a process that answers many requests holds its frames back (wall time): frames queue for the radio, and
their order depends on requests that this machine may deliver in another order."""
LINGER_NS: Final = 300_000_000
"""How long a process waits after a planned kill for frames that are still on their way (wall time)."""
ORDER_BYTES: Final = 64
"""The longest order to a process."""


class Process:
    """One process of the field: declares itself, waits for the start, runs to the end, and sends its final record.

    Its role is made by ``factory``. Orders and answers count if they have the run's ``seal``.
    """

    def __init__(self, session: zenoh.Session, name: str, factory: str, seal: Seal) -> None:
        self.session, self.name = session, name
        self._seal, self._refused, self._strange, self._forged = seal, Refusals(), Refusals(), Refusals()
        self._inbox: Inbox = deque()
        self._wake, self._stop = Event(), Event()
        self._start_ns: int | None = None
        self._end_ns = NEVER
        self._held = [session.declare_subscriber(keys.ORDERS, Callback(self._on_order, indirect=False))]
        joined = join(session, name, factory, seal, self._forged)
        self.spec, self._speed = joined.process, joined.run.speed
        self._end_ns = min(self._end_ns, joined.run.end_ns)
        self._link: Link = link_of(joined.run, joined.process.places)
        horizon_ns = round(HORIZON_S * joined.run.speed * 1e9)
        self.core: Core = build_core(joined.run, joined.process, self._link, horizon_ns=horizon_ns)
        self._counts = {"radio": 0, "partition": 0, "duplicate": 0, "foreign": 0}
        self._seen, self._seq, self._told = Seen(), 0, 0
        self._counts_ns, self._reached_ns, self._replay_ns = NEVER, 0, 0
        self._slip, self._latency = Histogram(), Histogram()
        self.core.recall = self._recall
        self._outbox: list[tuple[int, Frame]] = []
        self._heritage = Heritage(session, self.spec, joined.stored, self._wake.set, seal, self._refused)
        for key in self._inboxes():
            self._held.append(
                take_in(session, key, self._inbox, self._wake)
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
        cells = [keys.neighbourhood(medium, cell) for medium in media for cell in self.spec.cells]
        return [keys.inbox(medium, id) for medium in media] + cells

    def _waits_for_heritage(self) -> bool:
        """Whether this life starts within the run and the heritage is not known yet."""
        return not self.core.life.started and not self._heritage.known and self.spec.start_ns < self._end_ns

    # --- Zenoh's thread: append and wake, nothing else ------------------------------------------------------------

    def _on_data(self, sample: zenoh.Sample) -> None:
        self._inbox.append((time.monotonic_ns(), sample))
        self._wake.set()

    def _on_order(self, sample: zenoh.Sample) -> None:
        key = str(sample.key_expr)
        try:
            self._obey(key, opened(sample, self._seal, ORDER_BYTES))
        except WireError as error:
            self._refused.add(key, error)
        self._wake.set()

    def _obey(self, key: str, order: bytes) -> None:
        """Follow an order of the launcher; the start cannot be changed, and the end only comes sooner."""
        if key == keys.START:
            self._start_ns = begun(self._start_ns, order)
        elif key == keys.END:
            self._end_ns = min(self._end_ns, nanoseconds(order))
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
            now = time.monotonic_ns()
            if now >= self._killed_ns():
                self._close()
                os.kill(os.getpid(), signal.SIGKILL)  # a planned kill
            self._wake.wait(max(self._work(now) - now, 0) / 1e9)
        self._close()

    def _killed_ns(self) -> int:
        """When (wall) a planned kill ends this process: after frames that were still on their way have arrived."""
        kill_ns = self.core.conditions.kill_ns
        return NEVER if kill_ns == NEVER else self._wall(kill_ns) + LINGER_NS

    def _work(self, now: int) -> int:
        """Handle at most one thing that is due; returns when (wall) the next may be."""
        if self._outbox and self._outbox[0][0] <= now:
            self._transmit(self._outbox.pop(0)[1])
            return now
        key = self.core.next_key()
        due = NEVER if key is None or key[0] >= self._end_ns else self._wall(key[0])
        if due < NEVER and self._waits_for_heritage():
            due = max(due, self._wall(self.spec.start_ns) + PATIENCE_NS)
        if self.core.behind:
            # Replays take at most a quarter of the time, but a timer's outputs do not wait for them.
            if now < self._replay_ns and (now < due or (key is not None and key[1] != RANK_TIMER)):
                return min(self._replay_ns, self._next_ns(now))
            self._release(self.core.catch_up())
            after = time.monotonic_ns()
            self._replay_ns = after + 3 * (after - now)
        elif now < due:
            return min(due, self._next_ns(now), self._killed_ns())
        else:
            self._slip.add(now - due)
            self._handle_next()
        return now

    def _next_ns(self, now: int) -> int:
        """When (wall) to send a held frame or report again, after reporting what is due."""
        held = self._outbox[0][0] if self._outbox else NEVER
        return min(held, self._report(now))

    def _handle_next(self) -> None:
        if not self.core.life.started:
            self.core.inherit(self._heritage.stored, self._heritage.spent)
        self._release(self.core.handle_next())

    def _report(self, now: int) -> int:
        """Report changed counters, and the end when it is reached; returns when (wall) to do so again."""
        if now >= self._counts_ns:
            self._counts_ns = NEVER
            self._say("counts", msgpack.packb({**self._counts, **self.core.tally}), must=False)
        end = NEVER if self._waits_for_heritage() else self._wall(self._end_ns)
        if now >= max(end, self._reached_ns):
            self._reached_ns = now + REPEAT_NS
            self._say("reached", b"")
        return min(self._counts_ns, max(end, self._reached_ns))

    def _wall(self, t_ns: int) -> int:
        assert self._start_ns is not None
        return self._start_ns + round(t_ns / self._speed)

    def _drain(self) -> None:
        while self._inbox:
            self._accept(*self._inbox.popleft())

    def _close(self) -> None:
        """Handle the rest of the run, send the final record, and leave."""
        if self._start_ns is not None:
            self._drain()
            self._release(self.core.catch_up())
        while self._start_ns is not None and (key := self.core.next_key()) is not None and key[0] < self._end_ns:
            self._handle_next()
        for _, frame in self._outbox:
            self._transmit(frame)
        self._say("final", msgpack.packb(self.record()))
        self.session.close()  # type: ignore[no-untyped-call]

    def _say(self, what: str, data: bytes, *, must: bool = True) -> None:
        """Telemetry, that ``must`` arrive or may be lost."""
        key = keys.telemetry(self.name, what)
        care = zenoh.CongestionControl.BLOCK if must else zenoh.CongestionControl.DROP
        self.session.put(key, data, attachment=self._seal.stamp(key, data), congestion_control=care)

    def record(self) -> dict[str, Any]:
        """The counters of this life, for the recorder's cross-check."""
        return {
            **self.core.record(self._end_ns),
            **self._counts,
            "forged": self._forged.total,
            "sent": self._seq,
            "told": self._told,
            "slip": dict(self._slip.counts),
            "latency": dict(self._latency.counts),
            "cpu_s": time.process_time(),
        }

    # --- frames in and out ----------------------------------------------------------------------------------------

    def _accept(self, arrived_ns: int, sample: zenoh.Sample) -> None:
        self._counts_ns = min(self._counts_ns, arrived_ns + REPEAT_NS)
        try:
            frame, envelope, cell = frame_in(*bytes_of(sample), lambda: self._stamped(arrived_ns))
            if not self.spec.hears(frame.medium, frame.to, frame.src, cell):
                return
            if frame.src not in self.spec.peers and not frame.broadcast:
                raise WireError("sender", "not from a process whose frames may come here")
            if self._wall(frame.sent_ns) > arrived_ns + EARLY_NS:
                raise WireError("future", "sent later than now")
            if self._seen.again(frame):
                self._counts["duplicate"] += 1
                return
        except WireError as error:
            self._strange.add(sample.key_expr, error)
            return
        if envelope.put_ns:
            self._latency.add(arrived_ns - envelope.put_ns)
        self._receive(frame)

    def _stamped(self, arrived_ns: int) -> Envelope:
        """The envelope of a foreign device's frame that came without one."""
        if self._speed != 1 or self._start_ns is None:
            return no_stamp()
        self._counts["foreign"] += 1
        return Envelope(max(arrived_ns - self._start_ns, 0), 0, 0, 0, 0)

    def _receive(self, frame: Frame) -> None:
        if frame.sent_ns >= self._end_ns:
            return  # never due in this run, whatever its fate
        fate = frame.fate(self._link, self.spec.id)
        if fate.cause is not None:
            self._counts[fate.cause] += 1
            return
        due = frame.sent_ns + fate.delay_ns
        if self.core.owns(due):
            self.core.offer(Arrival(due, frame, fate))

    def _release(self, outputs: Iterable[Output]) -> None:
        for output in outputs:
            if isinstance(output, Sent):
                self._hold(output.frame)
            elif isinstance(output, Told) and isinstance(output.effect, Store):
                self._say("stored", output.effect.data)
            elif isinstance(output, Told | Refused | Undone):
                self._told += 1
                self._say("event", pack(output), must=False)
            else:
                log.warning("no device is attached to port %s", output.port)

    def _hold(self, frame: Frame) -> None:
        """Transmit a frame when it leaves; one that waits for the radio is not there yet."""
        now = time.monotonic_ns()
        leaves = max(now + (HOLD_NS if self.spec.sink else 0), self._wall(frame.sent_ns))
        if leaves > now:
            insort(self._outbox, (leaves, frame), key=itemgetter(0))
        else:
            self._transmit(frame)

    def _recall(self, frame: Frame) -> bool:
        """Withdraw a frame that is still held back."""
        held = [entry for entry in self._outbox if entry[1] != frame]
        found, self._outbox = len(held) < len(self._outbox), held
        return found

    def _transmit(self, frame: Frame) -> None:
        envelope = Envelope(frame.sent_ns, frame.incarnation, frame.copy, self._seq, time.monotonic_ns())
        self._seq += 1
        to_all = (frame.medium, self.spec.cell, frame.src, frame.kind)
        to_one = (frame.medium, frame.to, frame.src, frame.kind)
        self.session.put(
            keys.broadcast(*to_all) if frame.broadcast else keys.unicast(*to_one),
            frame.payload,
            attachment=envelope.pack(),
            congestion_control=zenoh.CongestionControl.DROP,
        )
