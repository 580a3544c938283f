"""What a node that follows knows of the target, and its place among those that would take over."""

from __future__ import annotations

from head.peers.choice import by_distance
from head.peers.memory import Memory
from head.peers.settings import Settings
from trackfield.filters.belief import moments
from trackfield.role import NS
from trackfield.tracking.bank import Bank
from trackfield.tracking.plausible import plausible
from trackfield.tracking.stored import Stored, unpack


def stored_of(settings: Settings, bank: Bank, memory: Memory, now: int) -> Stored | None:
    """What it knows of the target at local time ``now`` (ns), if it is fresh, and of no step to come."""
    try:
        stored = None if memory.known is None else unpack(memory.known.beliefs)
    except ValueError:
        return None
    latest = bank.step_at(memory.time.corrected(now)) + 1
    fresh = stored is not None and latest - settings.expiry_steps <= stored.step <= latest
    return stored if stored is not None and fresh and plausible(stored.beliefs, bank.model) else None


def rank_of(settings: Settings, bank: Bank, memory: Memory, now: int) -> int | None:
    """Its place among those that measured last, by distance to where the target should be; None: it is in none."""
    stored = stored_of(settings, bank, memory, now)
    known = None if stored is None else next(iter(stored.beliefs.values()), None)
    if stored is None or known is None:
        return None
    mean = moments(known).mean
    seconds = (memory.time.corrected(now) - bank.at_ns(stored.step)) / NS
    living = [id for id in memory.polled.ids if id != memory.held.term.leader and id in bank.positions]
    order = by_distance(bank, living, mean[:2] + mean[2:4] * seconds)
    return order.index(settings.id) if settings.id in order else None
