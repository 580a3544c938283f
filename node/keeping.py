"""How a node among peers sets its clock: it asks one that is nearer to the base, whose clock is the reference.

So the strata of the clocks (``trackfield/protocols/timesync.py``) go from the base outwards, hop by hop. A node asks
one that it hears well, by the announcements at the start; if that one does not answer, it asks the next. Once the field
is set up, receivers sleep: then requests leave in the windows in which the one that is asked listens.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import hypot
from typing import Any

import msgpack
from immutables import Map

from trackfield.draw import uniform
from trackfield.protocols.timesync import Rounds, Timekeeping, TimeSync
from trackfield.protocols.wakeup import Wakeup
from trackfield.role import Corrected, Effect, Ignored, Note, Received, Send, SetTimer, Started, Timer
from trackfield.wire.clusters import Announce
from trackfield.wire.keys import check_id
from trackfield.wire.messages import SyncRequest


@dataclass(frozen=True, slots=True)
class Kept:
    """What a node knows of the time.

    ``near`` are those that announced themselves: how often, and how far from the base they stand (m).
    ``references`` may set its clock, the one that it asks first; ``settled`` once the field is set up.
    """

    time: Timekeeping = field(default_factory=Timekeeping)
    near: Map[str, tuple[int, float]] = field(default_factory=Map)
    references: tuple[str, ...] = ()
    settled: bool = False


Step = tuple[Kept, tuple[Effect, ...]]


@dataclass(frozen=True)
class Keeping:
    """The part of node ``id``, which stands ``away_m`` from the ``base`` at (``base_x_m``, ``base_y_m``).

    ``sync`` are the fields of its ``Rounds``; None: its clock is right. Nodes begin to ask after ``start_ns``, spread
    over ``spread_ns``; at ``settled_ns`` the field is set up. ``wakeup`` are the windows of all nodes from then on,
    None if receivers are always on.
    """

    id: str
    base: str
    base_x_m: float
    base_y_m: float
    away_m: float
    start_ns: int
    spread_ns: int
    settled_ns: int
    sync: Mapping[str, Any] | None = None
    wakeup: Wakeup | None = None

    @property
    def kinds(self) -> frozenset[str]:
        """The messages that it takes."""
        return TimeSync.of(self.sync).kinds | ({"announce"} if self.sync else set())

    def start(self, kept: Kept, now: int, stored: bytes = b"") -> Step:
        """A life begins; one that begins later than the field asks at once, whom the one before it asked last."""
        kept, notes = self._restored(kept, stored)
        settles = (SetTimer("settled", self.settled_ns),) if now < self.settled_ns else ()
        kept = replace(kept, settled=not settles)
        if self.sync is None:
            time, effects = TimeSync().handle(kept.time, Started(now))
            return replace(kept, time=time), (*notes, *settles, *effects)
        at = self.start_ns + int(self.spread_ns * uniform(self.sync["seed"], self.id, "clock"))
        return kept, (*notes, *settles, SetTimer("clock", max(now, at)))

    @staticmethod
    def pack(kept: Kept) -> bytes:
        """What its next life needs: nodes announce themselves at the start only."""
        packed: bytes = msgpack.packb(kept.references)
        return packed

    def _restored(self, kept: Kept, stored: bytes) -> Step:
        if not stored:
            return kept, ()
        try:
            found = msgpack.unpackb(stored)
            if not isinstance(found, list):
                raise TypeError("not a list of ids")
            references = tuple(check_id(id) for id in found)
        except (ValueError, TypeError, OverflowError, msgpack.UnpackException) as error:
            return kept, (Note(f"What an earlier life stored cannot be used: {error}"),)
        return replace(kept, references=references), ()

    def hear(self, kept: Kept, message: Announce, sender: str) -> Kept:
        """A node or the base announces itself, which all do before the field is set up."""
        if kept.settled:
            return kept
        times, _ = kept.near.get(sender, (0, 0.0))
        away_m = hypot(message.x_m - self.base_x_m, message.y_m - self.base_y_m)
        return replace(kept, near=kept.near.set(sender, (times + 1, away_m)))

    def ring(self, kept: Kept, now: int, timer: str) -> Step:
        """One of the timers "clock" and "settled"."""
        if timer == "settled":
            return replace(kept, settled=True), ()
        kept = replace(kept, references=self._references(kept))
        time, effects = self._with(kept).handle(kept.time, Started(now))
        soon = (SetTimer("sync", now) if isinstance(one, SetTimer) else one for one in effects)
        return replace(kept, time=time), tuple(soon)

    def handle(self, kept: Kept, event: Received | Timer) -> Step:
        """Ask for the time, or tell it; one that does not answer is replaced by the next."""
        if self.sync is not None and not kept.references:
            return kept, (Ignored("not synchronised"),) if isinstance(event, Received) else ()
        time, effects = self._with(kept).handle(kept.time, event)
        if kept.time.in_round and not time.in_round and not any(isinstance(one, Corrected) for one in effects):
            first, *others = kept.references
            kept = replace(kept, references=(*others, first))
        return replace(kept, time=time), tuple(self._timed(kept, time, one) for one in effects)

    def _timed(self, kept: Kept, time: Timekeeping, effect: Effect) -> Effect:
        """Requests leave in the windows of those that sleep."""
        if self.wakeup is None or not kept.settled:
            return effect
        match effect:
            case SetTimer("sync", at) if not (time.waiting or time.best):
                return replace(effect, at=self.wakeup.send_at(at, time.correction_ns))
            case Send(message=SyncRequest()):
                return replace(effect, preamble_ns=self.wakeup.preamble_ns)
        return effect

    def _with(self, kept: Kept) -> TimeSync:
        if self.sync is None:
            return TimeSync()
        return TimeSync(Rounds(**{**self.sync, "reference": (kept.references or (self.base,))[0]}))

    def _references(self, kept: Kept) -> tuple[str, ...]:
        """Those that it hears best, and of these the ones nearest to the base first; none that is farther from it."""
        nearer = {id: (-times, away_m, id) for id, (times, away_m) in kept.near.items() if away_m < self.away_m}
        return tuple(sorted(nearer, key=lambda id: nearer[id])) or kept.references or (self.base,)
