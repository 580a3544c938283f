"""Fixes beside the true passes: which target each is of, how far it is off, how late it came."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import degrees
from typing import NamedTuple

import numpy as np

from launcher.plan.forecast.hearing.events import APART_NS, Event, Report, events_in, reports_of
from launcher.record.figures.passes.ended import Ended
from launcher.record.tables import TrackRow
from launcher.records import Plan
from trackfield.filters.passes.bounds import line_errors
from trackfield.role import NS
from trackfield.sensing.cpa import KNOWN_NS


class Errors(NamedTuple):
    """How far a fix is off: between the points of both lines nearest to the middle of its sensors, speed, heading."""

    location_m: float
    speed_m_s: float
    heading_deg: float


class Fix(NamedTuple):
    """An event that ended with a fix, beside the truth.

    ``target`` is the one that passed most of its sensors; empty: none did, and the fix is false. ``after_s`` is the
    time from the last of these passes to the fix. ``base_s`` is that to the base's first point that is made of it.
    """

    ended: Ended
    target: str = ""
    errors: Errors | None = None
    after_s: float | None = None
    base_s: float | None = None


@dataclass(frozen=True)
class Truth:
    """The true passes of a run."""

    plan: Plan

    @cached_property
    def events(self) -> Sequence[Event]:
        """How often a target passed a cluster, and which sensors noticed, as far as that follows from the paths."""
        return events_in(self.plan) if self.known else []

    @property
    def known(self) -> bool:
        """Whether anybody knows where targets were, and when sensors are to report them."""
        return bool(self.plan.paths) and self.plan.by_themselves

    @cached_property
    def _reports(self) -> Mapping[str, Sequence[Report]]:
        found: dict[str, list[Report]] = {}
        for one in reports_of(self.plan) if self.known else ():
            found.setdefault(one.id, []).append(one)
        return found

    @cached_property
    def _targets(self) -> Sequence[str]:
        return list(self.plan.paths)

    def fix(self, ended: Ended, told: Sequence[TrackRow] = ()) -> Fix:
        """A fix beside the truth; ``told`` are the base's points."""
        passed = self._passed(ended)
        counted = Counter(self._targets[one.target] for one in passed)
        if not counted:
            return Fix(ended)
        target = max(counted, key=lambda id: (counted[id], id))
        last_ns = max(one.at_ns for one in passed if self._targets[one.target] == target) - KNOWN_NS
        base_ns = min((row.told_ns for row in told if _made_of(row, ended)), default=None)
        return Fix(
            ended,
            target,
            self._errors(ended, target),
            (ended.row.told_ns - last_ns) / NS,
            None if base_ns is None else (base_ns - last_ns) / NS,
        )

    def _passed(self, ended: Ended) -> list[Report]:
        """The reports that true passes gave rise to, of the sensors of an event, at its time."""
        return [
            one
            for id in ended.sensors
            for one in self._reports.get(id, ())
            if abs(one.at_ns - KNOWN_NS - ended.event_ns) <= APART_NS
        ]

    def _errors(self, ended: Ended, target: str) -> Errors | None:
        truth, point = self.plan.paths[target].at(ended.event_ns / NS), ended.row.point
        if truth is None or not ended.row.has_track:
            return None
        places = {place.id: (place.x, place.y) for place in self.plan.info.places}
        middle = np.mean([places[id] for id in ended.sensors if id in places], axis=0)
        location_m, speed_m_s, heading_rad = line_errors(np.array(point.mean[:4]), np.array(truth), middle)
        return Errors(float(location_m), float(speed_m_s), degrees(float(heading_rad)))


def _made_of(row: TrackRow, ended: Ended) -> bool:
    """Whether a point of the base is a head's fix, predicted."""
    fix, point = ended.row.point, row.point
    return (point.tracker, point.origin, point.term) == (fix.tracker, fix.source, fix.step) and row.has_track
