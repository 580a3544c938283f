"""Members that filter: each concludes from the head's last estimate and its own reading, and the head combines that.

Zhou et al. (2011), section II, has children send estimates. All of them hold the head's estimate as their prior, so the
head must not count it more than once (``trackfield/tracking/combining.py``).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from immutables import Map

from head.beliefs import packed_beliefs
from head.peers.memory import Leadership
from trackfield.filters.belief import Belief, moments
from trackfield.filters.types import Gaussian
from trackfield.tracking.bank import Bank
from trackfield.tracking.collecting import Collected
from trackfield.tracking.combining import Way, combined
from trackfield.tracking.plausible import plausible
from trackfield.tracking.steps import Progress, Taken
from trackfield.tracking.stored import Stored, unpack


@dataclass(frozen=True)
class Local:
    """The part of a header that filters for its own sensor, and combines what others concluded, in this ``way``."""

    bank: Bank
    way: Way

    def conclude(self, known: Stored, step: int, sensor: str, report: Any) -> dict[str, Belief | None]:
        """What the trackers know after a step, from what was ``known`` before it and one reading."""
        resumed = self.bank.resume(known.beliefs, known.step, max(step - 1, known.step))
        return self.bank.beliefs(self.bank.advance(resumed.tracks, step, {sensor: report}).tracks)

    def packed(self, known: Stored, step: int, sensor: str, report: Any) -> bytes:
        """The same, as bytes."""
        return packed_beliefs(step, self.conclude(known, step, sensor, report))

    def take(self, leads: Leadership) -> Taken | None:
        """The next step from what members concluded, and from readings, of which the head does so itself.

        None: nobody concluded anything, or a tracker has no track.
        """
        step = leads.progress.step + 1
        before = self.bank.beliefs(leads.progress.tracks)
        if not leads.concluded or any(one is None for one in before.values()):
            return None
        known = Stored(step - 1, None, {name: moments(one) for name, one in before.items() if one is not None})
        found: dict[str, Mapping[str, Belief | None]] = {id: self._read(data) for id, data in leads.concluded.items()}
        readings = leads.progress.collected.ahead.get(step, Map())
        found |= {id: self.conclude(known, step, id, report) for id, report in readings.items() if id not in found}
        prior = self.bank.beliefs(self.bank.resume(known.beliefs, step - 1, step).tracks)
        beliefs = {name: self._combined(name, found, one) for name, one in prior.items() if one is not None}
        if len(beliefs) < len(before):
            return None
        told = self.bank.told(step, sorted(found), beliefs)
        return Taken(Progress(told.tracks, Collected(step)), told.points, tuple(told.points.values()))

    def _read(self, data: bytes) -> Mapping[str, Belief | None]:
        try:
            beliefs = unpack(data).beliefs
        except ValueError:
            return {}
        return beliefs if plausible(beliefs, self.bank.model) else {}

    def _combined(self, name: str, found: Mapping[str, Mapping[str, Belief | None]], prior: Belief) -> Gaussian:
        given = [one for each in found.values() if (one := each.get(name)) is not None]
        return combined(self.way, [moments(one) for one in given], moments(prior)).belief
