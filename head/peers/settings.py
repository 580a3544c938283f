"""What a header is told: its peers, when it does what in a step, how it chooses."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from trackfield.tracking.combining import Way
from trackfield.wire.peers import MOST_KEY


@dataclass(frozen=True)
class Times:
    """When a header does what, ns, as planned from the radio.

    Polls leave at ``beacon_ns`` after the instant of a step, with preambles that are ``preamble_ns`` longer. After
    ``handover_ns`` without an acknowledgement a hand-over has failed. By ``word_ns`` after the instant of a step those
    that were polled have heard of their head; the turns of those that take over are ``turn_ns`` each, those of what
    members conclude ``slot_ns``. A head that is silent for ``lease_ns`` has lost its lease. Nodes announce themselves
    before ``announce_ns``, one after the other, by their numbers, of which there are ``nodes``.
    """

    beacon_ns: int
    preamble_ns: int
    handover_ns: int
    word_ns: int
    turn_ns: int
    slot_ns: int
    lease_ns: int
    announce_ns: int
    nodes: int


@dataclass(frozen=True)
class Settings:
    """How the header of process ``id`` works; ``numbers`` are those of itself and all that may be its peers.

    It has ``count`` sensors measure: the nearest to where the target will be, or if ``joins`` those that leave the
    smallest covariance, of the ones that say they sense the target. It leads on while it is one of them (if ``sticky``;
    else while it is the nearest of them), or if ``keep_within_m`` is set while it is so near to the target. What it
    says to all in reach goes to the ``base`` over a tree, too, every ``base_every`` steps (empty: there is no tree). If
    ``takes_over``, those that it polled take over from a head that is silent; else only an election follows. If
    ``short``, it says where the target is, else all that its trackers know. Beliefs are handed over in the form
    ``hands``: "gaussian", the Gaussians of single "modes", or "particles". If ``local``, its members filter, and what
    they conclude is combined by "product" or "intersection".

    Without a track it has ``search`` sensors measure, if that is more. A track without a report for ``silent_steps`` is
    lost. A claim, and what a node says of sensing a target, holds for ``expiry_steps``. From ``quiet_db`` to
    ``loud_db`` is how loud targets are where they are sensed. ``always_on``: no receiver ever sleeps. ``beyond`` are
    sensors out of reach (id, x m, y m), for the log alone.
    """

    id: str
    number: int
    numbers: Mapping[str, int]
    times: Times
    base: str = ""
    count: int = 4
    search: int = 0
    joins: bool = False
    sticky: bool = True
    keep_within_m: float | None = None
    takes_over: bool = True
    short: bool = True
    hands: str = "modes"
    local: Way | None = None
    base_every: int = 1
    silent_steps: int = 3
    expiry_steps: int = 10
    announcements: int = 3
    quiet_db: float = 0.0
    loud_db: float = 0.0
    always_on: bool = False
    beyond: tuple[tuple[str, float, float], ...] = ()

    @property
    def searching(self) -> int:
        """How many sensors measure while it has no track."""
        return max(self.count, self.search)

    def key(self, db: float) -> int:
        """The key of an election: 0 for the loudest."""
        if self.loud_db <= self.quiet_db:
            return 0
        share = (self.loud_db - db) / (self.loud_db - self.quiet_db)
        return round(MOST_KEY * min(max(share, 0.0), 1.0))
