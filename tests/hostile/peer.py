"""The peer itself: it joins a run's router, listens to all that is said, and puts bad samples there."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from random import Random
from threading import Event, Thread
from types import TracebackType
from typing import Any, Final, Self

import zenoh
from zenoh.handlers import Callback

from tests.hostile.samples import ALARM, Bad, Draw, Known, Means, Sample
from trackfield.drivers.session import open_client
from trackfield.role import NS
from trackfield.wire import Envelope, WireError

QUERY_S: Final = 0.2
"""How long it waits for answers to a question."""
MARGIN_NS: Final = 2 * NS
"""What comes later than this before the end of the run (emulated time) may be too late to be seen."""


class Attacker:
    """Does something bad from now on, as a context manager, in a thread of its own, until it is ``_over``."""

    def __init__(self) -> None:
        self._over = Event()
        self._thread = Thread(target=self._attack, daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._over.set()
        self._thread.join()

    def _attack(self) -> None:
        raise NotImplementedError


class Peer(Attacker):
    """Attacks a run from now on, as a context manager, with samples of these kinds, so many each second.

    ``put`` counts what was put while emulated time went on, by what was bad about it; ``alarming`` how many of those
    must raise the alarm, ``repeated`` how many were tokens at a key at which the peer had one: the router is not told.
    """

    def __init__(
        self,
        endpoint: str,
        run: str,
        known: Known,
        mix: Sequence[Bad],
        *,
        seed: int,
        speed: float,
        end_ns: int,
        rate: float,
    ) -> None:
        super().__init__()
        self.put: Counter[str] = Counter()
        self.alarming = 0
        self.total, self.repeated = 0, 0
        self._draw = Draw(seed)
        self._draw.known = self.known = known
        self._mix, self._speed, self._end_ns, self._rate = mix, speed, end_ns, rate
        self._offset: float | None = None
        self._tokens: list[tuple[str, Any]] = []
        self._session = self._open(endpoint, run)
        self._listeners = [
            self._session.declare_subscriber(key, Callback(self._on_sample, indirect=False)) for key in self._hears()
        ]

    def __exit__(self, *why: Any) -> None:
        super().__exit__(*why)
        with suppress(zenoh.ZError):
            self._session.close()  # type: ignore[no-untyped-call]

    def _open(self, endpoint: str, run: str) -> zenoh.Session:
        return open_client(endpoint, run)

    def _hears(self) -> tuple[str, ...]:
        return ("**",)

    def _on_sample(self, sample: zenoh.Sample) -> None:
        attachment = None if sample.attachment is None else sample.attachment.to_bytes()
        heard = Sample(str(sample.key_expr), sample.payload.to_bytes(), attachment)
        self.known.heard.append(heard)
        if heard.key.startswith("data/") and attachment is not None:
            with suppress(WireError):
                envelope = Envelope.unpack(attachment)
                self._offset = envelope.sent_ns - envelope.put_ns * self._speed

    def _attack(self) -> None:
        due = time.monotonic()
        while not self._over.is_set():
            if self._offset is not None:
                self.known.now_ns = max(round(time.monotonic_ns() * self._speed + self._offset), 0)
            one = self._draw.choice(self._mix).sample(self._draw)
            if one is not None:
                self.send(one)
            due = max(due + 1 / self._rate, time.monotonic() - 1.0)
            self._over.wait(due - time.monotonic())

    def send(self, sample: Sample) -> None:
        """Bring in one sample; what Zenoh itself refuses, and a router that is gone, are not counted."""
        try:
            self._bring(sample)
        except zenoh.ZError:
            return
        self.total += 1
        if self._offset is not None and self.known.now_ns < self._end_ns - MARGIN_NS:
            self.put[sample.what] += 1
            self.alarming += ALARM in sample.follows

    def _bring(self, sample: Sample) -> None:
        remote = zenoh.Locality.REMOTE  # its own listener hears the others alone
        match sample.means:
            case Means.PUT:
                self._session.put(
                    sample.key,
                    sample.payload,
                    attachment=sample.attachment,
                    allowed_destination=remote,
                    congestion_control=zenoh.CongestionControl.BLOCK,
                )
            case Means.DELETE:
                self._session.delete(sample.key, allowed_destination=remote)
            case Means.QUERY:
                self._session.get(sample.key, lambda _: None, payload=sample.payload, timeout=QUERY_S)
            case Means.TOKEN:
                if len(self._tokens) > 10:
                    self._tokens.pop(Random(len(sample.key)).randrange(10))[1].undeclare()
                self.repeated += sample.key in dict(self._tokens)
                self._tokens.append((sample.key, self._session.liveliness().declare_token(sample.key)))
