"""The frames of a process on their way in: parsed, told from those seen before, given their fate, and handed over."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import zenoh

from trackfield.drivers.engine.core import Core
from trackfield.drivers.engine.frames import Arrival, Frame
from trackfield.drivers.exchange.inbox import EARLY_NS, bytes_of, frame_in, no_stamp
from trackfield.drivers.exchange.intake import Refusals
from trackfield.drivers.exchange.versions import Digest, Versions
from trackfield.drivers.spec import ProcessSpec
from trackfield.link.fate import Link
from trackfield.wire.envelope import Envelope
from trackfield.wire.error import WireError

HORIZON_S: Final = 5.0
"""How long (wall time) events can be undone; frames are tens of milliseconds out of order, unless a host stalls."""


class Incoming:
    """Hands frames to the core, and takes back what it handed over if a later version says so.

    ``counts`` are those of frames that did not come that far, ``came`` counts the samples from the run's processes,
    ``heard`` are the frames that were handed over, of those that came with an envelope. ``latest_ns`` is when (wall
    time) something came last that concerns this life.
    """

    def __init__(self, spec: ProcessSpec, link: Link, core: Core, wall: Callable[[int], int]) -> None:
        self.spec, self.core = spec, core
        self.counts = {"radio": 0, "partition": 0, "duplicate": 0, "foreign": 0}
        self.came, self.heard, self.latest_ns = 0, Digest(), 0
        self._link, self._wall = link, wall
        self._versions = Versions(round(HORIZON_S * 1e9))
        self._strange = Refusals()

    def take(
        self, sample: zenoh.Sample, arrived_ns: int, end_ns: int, stamp: Callable[[], Envelope] = no_stamp
    ) -> Envelope | None:
        """Take in a sample that arrived then (wall time) in a run that ends at ``end_ns``; its envelope if it is news.

        ``stamp`` makes an envelope for a foreign device's frame that came without one.
        """
        try:
            frame, envelope, cell = frame_in(*bytes_of(sample), stamp)
            if not self.spec.gets(frame.medium, frame.to, frame.src, cell):
                return None
            self.came += envelope.version is not None
            if not self.spec.hears(frame.medium, frame.to, frame.src, cell):
                return None
            if frame.src not in self.spec.peers and not frame.broadcast:
                raise WireError("sender", "not from a process whose frames may come here")
            if self._wall(frame.sent_ns) > arrived_ns + EARLY_NS:
                raise WireError("future", "sent later than now")
            news, before = self._versions.take(frame, envelope.version, arrived_ns)
        except WireError as error:
            self._strange.add(sample.key_expr, error)
            return None
        if not news:
            self.counts["duplicate"] += before is not None  # else a later version has come already
            return None
        foreign = sample.attachment is None
        self.counts["foreign"] += foreign
        if frame.sent_ns < end_ns:  # else never due in this run, whatever its fate
            old = self._arrival(before.frame, before.version, -1) if before is not None else None
            new = self._arrival(frame, envelope.version, 1) if frame.payload else None
            self._withdraw(old)
            self._offer(new, counted=not foreign)
            if old is not None or new is not None:
                self.latest_ns = arrived_ns
        return envelope

    def heard_until(self, end_ns: int) -> Digest:
        """The frames that were handed over and were due before this time (true)."""
        heard = self.heard
        for one in self.core.waiting():
            if isinstance(one, Arrival) and one.due_ns >= end_ns:
                heard = heard.minus(one.frame, one.version)
        return heard

    def _withdraw(self, arrival: Arrival | None) -> None:
        if arrival is not None and self.core.withdraw(arrival):
            self.heard = self.heard.minus(arrival.frame, arrival.version)

    def _offer(self, arrival: Arrival | None, *, counted: bool) -> None:
        if arrival is not None and self.core.offer(arrival) and counted:
            self.heard = self.heard.plus(arrival.frame, arrival.version)

    def _arrival(self, frame: Frame, version: int | None, count: int) -> Arrival | None:
        """The frame as it is due here, in this life; None if it is not, and then its cause is counted so often."""
        fate = frame.fate(self._link, self.spec.id)
        if fate.cause is not None:
            self.counts[fate.cause] += count
            return None
        due = frame.sent_ns + fate.delay_ns
        return Arrival(due, frame, fate, version) if self.core.owns(due) else None
