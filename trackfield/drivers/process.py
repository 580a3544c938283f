"""The process driver: one role as an operating-system process, fed by Zenoh and the clock.

The loop empties the inbox that Zenoh's thread fills, handles the due events, and sleeps until the next one.
Emulated time t is ``start + t / speed`` on the host's monotonic clock; a handler never sees that clock.
"""

from __future__ import annotations

import logging
import os
import signal
import time
from collections import deque
from collections.abc import Iterable
from threading import Event, Thread
from typing import Any, Final

import msgpack
import zenoh
from zenoh.handlers import Callback, FifoChannel

from trackfield.drivers.conditions import NEVER
from trackfield.drivers.core import Core
from trackfield.drivers.frames import RANK_TIMER, Arrival, Frame, Output, Refused, Sent, Told, Undone
from trackfield.drivers.heritage import PATIENCE_NS, Heritage
from trackfield.drivers.histogram import Histogram
from trackfield.drivers.join import join
from trackfield.drivers.spec import build_core, link_of
from trackfield.drivers.telemetry import pack
from trackfield.link.fate import Link
from trackfield.role import NEIGHBOURHOOD, Store
from trackfield.wire import keys
from trackfield.wire.codec import WireError
from trackfield.wire.envelope import Envelope

log = logging.getLogger(__name__)

HORIZON_S: Final = 5.0
"""How long (wall time) events can be undone; frames are tens of milliseconds out of order, unless a host stalls."""
SEEN: Final = 10_000
"""How many identities of frames are remembered to recognise duplicates."""
CHANNEL: Final = 100_000
"""Samples that wait in a channel before Zenoh's thread would block."""
REPEAT_NS: Final = 1_000_000_000
"""How often changed counters, and the end of the run, are reported (wall time)."""
HOLD_NS: Final = 40_000_000
"""How long a process that answers many requests holds its frames back (wall time): frames queue for the radio, and
their order depends on requests that this machine may deliver in another order."""
LINGER_NS: Final = 300_000_000
"""How long a process waits after a planned kill for frames that are still on their way (wall time)."""


Inbox = deque[tuple[int, zenoh.Sample]]
"""Samples and when (host's monotonic clock, ns) they arrived."""


def take_in(session: zenoh.Session, key: str, inbox: Inbox, wake: Event) -> Any:
    """Subscribe for a process that computes for long at a time; returns the subscriber.

    Meanwhile Zenoh's thread would have to wait for Python at every sample, and the router would drop the samples queued
    behind it. So it fills a channel of its own, and a thread here empties that at once whenever it runs.
    """
    subscriber = session.declare_subscriber(key, FifoChannel(CHANNEL))

    def empty() -> None:
        try:
            while True:
                sample: zenoh.Sample | None = subscriber.recv()
                while sample is not None:
                    inbox.append((time.monotonic_ns(), sample))
                    sample = subscriber.try_recv()
                wake.set()
        except zenoh.ZError:
            return  # the session was closed

    Thread(target=empty, name=key, daemon=True).start()
    return subscriber


class Seen:
    """The latest identities, to recognise duplicates."""

    def __init__(self) -> None:
        self._known: dict[tuple[Any, ...], None] = {}

    def again(self, identity: tuple[Any, ...]) -> bool:
        """Whether this identity was seen before; remembers it."""
        if identity in self._known:
            return True
        self._known[identity] = None
        if len(self._known) > SEEN:
            del self._known[next(iter(self._known))]
        return False


class Process:
    """One process of the field: declares itself, waits for the start, runs to the end, and sends its final record."""

    def __init__(self, session: zenoh.Session, name: str) -> None:
        self.session, self.name = session, name
        self._inbox: Inbox = deque()
        self._wake, self._stop = Event(), Event()
        self._start_ns: int | None = None
        self._held = [session.declare_subscriber(keys.ORDERS, Callback(self._on_order, indirect=False))]
        joined = join(session, name)
        self.spec, self._end_ns, self._speed = joined.process, joined.run.end_ns, joined.run.speed
        self._link: Link = link_of(joined.run, joined.process.places)
        horizon_ns = round(HORIZON_S * joined.run.speed * 1e9)
        self.core: Core = build_core(joined.run, joined.process, self._link, horizon_ns=horizon_ns)
        self._counts = {"radio": 0, "partition": 0, "duplicate": 0, "foreign": 0, "malformed": 0}
        self._seen, self._seq = Seen(), 0
        self._counts_ns, self._reached_ns, self._replay_ns = NEVER, 0, 0
        self._slip, self._latency = Histogram(), Histogram()
        self.core.recall = self._recall
        self._outbox: list[tuple[int, Frame]] = []
        self._heritage = Heritage(session, self.spec, joined.stored, self._wake.set)
        for key in self._inboxes():
            self._held.append(
                take_in(session, key, self._inbox, self._wake)
                if self.spec.sink
                else session.declare_subscriber(key, Callback(self._on_data, indirect=False))
            )
        if joined.start_ns is not None:
            self._start_ns = joined.start_ns
        self._token = session.liveliness().declare_token(keys.live(name))

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
        if key == keys.START:
            self._start_ns = int(sample.payload.to_string())
        elif key == keys.END:  # the run ends early, at this emulated time
            self._end_ns = int(sample.payload.to_string())
        elif key == keys.STOP:
            self._stop.set()
        self._wake.set()

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
                return self._replay_ns
            self._release(self.core.catch_up())
            after = time.monotonic_ns()
            self._replay_ns = after + 3 * (after - now)
        elif now < due:
            held = self._outbox[0][0] if self._outbox else NEVER
            return min(due, held, self._report(now), self._killed_ns())
        else:
            self._slip.add(now - due)
            self._handle_next()
        return now

    def _handle_next(self) -> None:
        if not self.core.life.started:
            self.core.inherit(self._heritage.stored, self._heritage.spent)
        self._release(self.core.handle_next())

    def _report(self, now: int) -> int:
        """Report changed counters, and the end when it is reached; returns when (wall) to do so again."""
        if now >= self._counts_ns:
            self._counts_ns = NEVER
            counts = msgpack.packb({**self._counts, **self.core.tally})
            self.session.put(keys.telemetry(self.name, "counts"), counts)
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
        self._drain()
        self._release(self.core.catch_up())
        while self._start_ns is not None and (key := self.core.next_key()) is not None and key[0] < self._end_ns:
            self._handle_next()
        for _, frame in self._outbox:
            self._transmit(frame)
        self._say("final", msgpack.packb(self.record()))
        self.session.close()  # type: ignore[no-untyped-call]

    def _say(self, what: str, data: bytes) -> None:
        """Telemetry that must arrive."""
        key = keys.telemetry(self.name, what)
        self.session.put(key, data, congestion_control=zenoh.CongestionControl.BLOCK)

    def record(self) -> dict[str, Any]:
        """The counters of this life, for the recorder's cross-check."""
        return {
            **self.core.record(self._end_ns),
            **self._counts,
            "sent": self._seq,
            "slip": dict(self._slip.counts),
            "latency": dict(self._latency.counts),
            "cpu_s": time.process_time(),
        }

    # --- frames in and out ----------------------------------------------------------------------------------------

    def _accept(self, arrived_ns: int, sample: zenoh.Sample) -> None:
        self._counts_ns = min(self._counts_ns, arrived_ns + REPEAT_NS)
        try:
            address = keys.parse(str(sample.key_expr))
            envelope = self._envelope(arrived_ns, sample)
        except WireError as error:
            self._counts["malformed"] += 1
            log.warning("ignored a frame on %s: %s", sample.key_expr, error)
            return
        frame = Frame(
            address.src,
            envelope.incarnation,
            address.kind,
            envelope.sent_ns,
            envelope.copy,
            address.to or NEIGHBOURHOOD,
            address.medium,
            sample.payload.to_bytes(),
        )
        if not self.spec.hears(frame.medium, frame.to, frame.src, address.cell or ""):
            return
        if self._seen.again(frame.identity):
            self._counts["duplicate"] += 1
            return
        if envelope.put_ns:
            self._latency.add(arrived_ns - envelope.put_ns)
        self._receive(frame)

    def _envelope(self, arrived_ns: int, sample: zenoh.Sample) -> Envelope:
        """The frame's envelope; a foreign device's frame has none and is stamped on arrival."""
        if sample.attachment is not None:
            return Envelope.unpack(sample.attachment.to_bytes())
        if self._speed != 1 or self._start_ns is None:
            raise WireError("envelope")
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
            if isinstance(output, Sent) and self.spec.sink:
                self._outbox.append((time.monotonic_ns() + HOLD_NS, output.frame))
            elif isinstance(output, Sent):
                self._transmit(output.frame)
            elif isinstance(output, Told) and isinstance(output.effect, Store):
                self._say("stored", output.effect.data)
            elif isinstance(output, Told | Refused | Undone):
                self.session.put(keys.telemetry(self.name, "event"), pack(output))
            else:
                log.warning("no device is attached to port %s", output.port)

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
