"""Fixes that a sink is told of: what they say of the target, and how their events ended, tracker by tracker."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from trackfield.filters.belief import Belief, dimension, moments
from trackfield.filters.measurement import STATE
from trackfield.filters.passes.types import REASONS
from trackfield.filters.types import Estimate, Reports
from trackfield.role import NS, TrackPoint
from trackfield.tracking.bank import Bank
from trackfield.tracking.following import Starts
from trackfield.tracking.plausible import plausible
from trackfield.tracking.points import track_point
from trackfield.tracking.stored import unpack
from trackfield.wire.passes import FixReport
from trackfield.wire.raw import Raw
from trackfield.wire.raw import unpack as unpack_raw

UNKNOWN: Final = "no fix"
"""Why there is none, where its head has another reason than those that are numbered."""
MOST_S: Final = 60.0
"""So far from the step of a fix the target was nearest to the middle of the sensors, at most."""


@dataclass(frozen=True, slots=True, eq=False)
class Fix:
    """What ``head`` told after ``step`` of its event with this ``number``; no ``beliefs``: no fix, for a ``reason``.

    ``raw`` are the reports that it had, of these ``sensors``.
    """

    head: str
    number: int
    step: int
    reason: int
    beliefs: Mapping[str, Belief]
    raw: tuple[Raw, ...]
    sensors: tuple[str, ...]

    def points(self, bank: Bank) -> list[TrackPoint]:
        """The points of the very step that it tells of, of the trackers that it has beliefs of."""
        reports = Reports(self.step, self.sensors, np.zeros((len(self.sensors), 2)), ())
        return [
            track_point(name, bank.target, bank.at_ns(self.step), reports, Estimate(*moments(belief)))
            for name, belief in self.beliefs.items()
            if name in bank.trackers and dimension(belief) in (STATE, bank.model.dimension)
        ]


class Ended(NamedTuple):
    """How an event ended for a tracker: at ``at_ns`` the target passed, and why there is no fix (empty: there is)."""

    at_ns: int
    refused: str


def read(message: FixReport, head: str, bank: Bank) -> Fix:
    """The fix of a message. Raises ``ValueError`` for one that says what cannot be."""
    known = unpack(message.belief).beliefs if message.belief else {}
    beliefs = {name: one for name, one in known.items() if one is not None}
    if not plausible(beliefs, bank.model):
        raise ValueError("a belief of a target that cannot be")
    raw, sensors = unpack_raw(message.raw), tuple(bank.positions)
    if any(one.number >= len(sensors) for one in raw):
        raise ValueError("a report of a sensor that is not of the field")
    heard = tuple(sensors[one.number] for one in raw)
    fix = Fix(head, message.number, message.step, message.reason, beliefs, raw, heard)
    if raw and any(abs(_early_s(fix, bank, beliefs.get(name))) > MOST_S for name in _solving(bank)):
        raise ValueError("an event at another time")
    return fix


def _solving(bank: Bank) -> Iterable[str]:
    """The trackers that say themselves when an event is over."""
    return (name for name, one in bank.trackers.items() if isinstance(one.following.tracker, Starts))


def ended_of(fix: Fix, bank: Bank) -> dict[str, Ended]:
    """How the event ended for each tracker that solves; nothing if it had no reports."""
    if not fix.raw:
        return {}
    why = (REASONS[fix.reason] if fix.reason < len(REASONS) else "") or UNKNOWN
    beliefs = {name: fix.beliefs.get(name) for name in _solving(bank)}
    return {
        name: Ended(bank.at_ns(fix.step) - round(_early_s(fix, bank, one) * NS), why if one is None else "")
        for name, one in beliefs.items()
    }


def _early_s(fix: Fix, bank: Bank, belief: Belief | None) -> float:
    """How long before the step the target was nearest to the middle of the sensors; without a fix, the mean time."""
    if belief is not None:
        mean = moments(belief).mean
        place, velocity = mean[:2], mean[2:4]
        middle = np.mean([bank.positions[id] for id in fix.sensors], axis=0)
        if velocity.any():
            return float((place - middle) @ velocity / (velocity @ velocity))
    return float(np.mean([one.early_s for one in fix.raw]))
