"""Whole tracks through several clusters: one curved path for all raw reports of the events that a target caused.

A base is told of fixes, each of a straight path past one cluster, with the reports that they are from. When the track
has ended, it solves for each event again, and then for one spline through all of them
(``trackfield/filters/passes/hermite.py``). It has a point at each step between the first report and the last.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any, Final, NamedTuple

import numpy as np

from fusion.fixes import Fix
from trackfield.filters.passes.hermite import Spline, hermite
from trackfield.filters.passes.types import Passes, Solved
from trackfield.filters.solving.solver import PER_DB, Solver
from trackfield.filters.types import Array, Estimate, Reports
from trackfield.role import NS, TrackPoint
from trackfield.tracking.bank import Bank
from trackfield.tracking.points import track_point
from trackfield.tracking.smoothing import spline_name
from trackfield.wire.passes import MOST_RAW

MOST: Final = 64
"""So many events of a track are kept at most, the last ones."""
SAME_NS: Final = NS // 10
"""Two reports of a sensor that are less than this apart are one, as two heads told of it."""


class Heard(NamedTuple):
    """An event as it was told: by which ``head`` after which ``step``; of each report the sensor, time, dB, width."""

    head: str
    step: int
    rows: tuple[tuple[str, int, float, float], ...]

    @classmethod
    def of(cls, fix: Fix, bank: Bank) -> Heard:
        """The event of a fix."""
        told = zip(fix.sensors, fix.raw, strict=True)
        at_ns = bank.at_ns(fix.step)
        rows = ((id, at_ns - round(one.early_s * NS), one.strength_db, one.width_s) for id, one in told)
        return cls(fix.head, fix.step, tuple(rows))

    @property
    def at_ns(self) -> int:
        """The mean time of its reports."""
        return sum(at_ns for _, at_ns, *_ in self.rows) // len(self.rows)

    def shares(self, other: Heard) -> bool:
        """Whether it has a report of another event."""
        return any(
            id == sensor and abs(at_ns - time_ns) < SAME_NS
            for id, at_ns, *_ in self.rows
            for sensor, time_ns, *_ in other.rows
        )


Kept = tuple[Heard, ...]


class Splines:
    """Finds the whole tracks of those trackers of a bank that solve for passes."""

    def __init__(self, bank: Bank) -> None:
        self.bank = bank
        found = {name: one.following.tracker for name, one in bank.trackers.items()}
        self.solvers = {name: one for name, one in found.items() if isinstance(one, Solver)}

    def learn(self, kept: Kept, fix: Fix) -> Kept:
        """With a further event; of two that share reports the one with more counts, of equal ones the later."""
        if not fix.raw or not fix.beliefs:
            return kept
        heard = Heard.of(fix, self.bank)
        others = [one for one in kept if heard.shares(one)]
        if any(len(one.rows) > len(heard.rows) for one in others):
            return kept
        kept = (*(one for one in kept if one not in others), heard)
        return tuple(sorted(kept, key=lambda one: one.at_ns))[-MOST:]

    def ended(self, kept: Kept, live: Iterable[TrackPoint]) -> bool:
        """Whether none of its trackers has a ``live`` point any more."""
        return bool(kept) and {point.tracker for point in live}.isdisjoint(self.solvers)

    def points(self, kept: Kept, now: int) -> list[TrackPoint]:
        """The whole tracks, published at the step ``now``; none through a single event."""
        return [point for name, solver in self.solvers.items() for point in self._points(name, solver, kept, now)]

    def _points(self, name: str, solver: Solver, kept: Kept, now: int) -> Iterator[TrackPoint]:
        if len(kept) < 2:
            return
        sound_m_s, epoch_ns = self.bank.model.sensor.speed_m_s, kept[0].at_ns
        passes, solved = solver.solved(self.bank.model, self.passes(kept, epoch_ns))
        reports: tuple[Any, ...] = passes[:-1]
        fixes: tuple[Any, ...] = solved
        for which in _tracks(solved):
            some = Passes(*(part[which] for part in reports))._replace(place_sd_m=passes.place_sd_m)
            spline = hermite(some, Solved(*(part[which] for part in fixes)), sound_m_s=sound_m_s)
            if spline.converged:
                yield from self._along(spline_name(name), spline, [kept[i] for i in which], epoch_ns, now)

    def _along(
        self, name: str, spline: Spline, events: Sequence[Heard], epoch_ns: int, now: int
    ) -> Iterator[TrackPoint]:
        """The points of the steps from the first report of some events to the last."""
        times = [at_ns for one in events for _, at_ns, *_ in one.rows]
        first, last = self.bank.step_at(min(times)) + 1, self.bank.step_at(max(times))
        steps = np.arange(first, last + 1)
        at_s = np.array([self.bank.at_ns(int(step)) - epoch_ns for step in steps]) / NS
        covariances = _covariances(spline, at_s)
        for step, mean, covariance in zip(steps.tolist(), spline.at(at_s), covariances, strict=True):
            owner = next((one for one in reversed(events) if one.at_ns <= self.bank.at_ns(step)), events[0])
            reports = Reports(step, (), np.zeros((0, 2)), ())
            estimate, at_ns = Estimate(mean, covariance), self.bank.at_ns(step)
            point = track_point(name, self.bank.target, at_ns, reports, estimate, now - step)
            yield replace(point, status="tracking", term=owner.step, origin=owner.head)

    def passes(self, kept: Kept, epoch_ns: int) -> Passes:
        """The reports of some events, (E, K), times (s) after ``epoch_ns``."""
        noise = self.bank.model.sensor.passes
        assert noise is not None
        numbers = np.full((len(kept), MOST_RAW, 4), np.nan)
        for event, heard in enumerate(kept):
            for i, (id, at_ns, strength_db, _) in enumerate(heard.rows):
                x, y = self.bank.positions[id]
                numbers[event, i] = x, y, (at_ns - epoch_ns) / NS, strength_db
        known = np.where(np.isfinite(numbers[..., 2]), 1.0, np.nan)
        return Passes(
            numbers[..., :2],
            numbers[..., 2],
            np.exp(PER_DB * numbers[..., 3]),
            noise.time_sd_s * known,
            noise.strength_sd * known,
            noise.place_sd_m,
        )


def _tracks(solved: Solved) -> Iterator[list[int]]:
    """The events with a fix that follow each other on the path of one target, those of two at least.

    The straight way from one to the next is ahead of the one, and behind the other.
    """
    track = list[int]()
    for i in np.flatnonzero(solved.reason == 0).tolist():
        if track:
            (before, after), way = solved.mean[[track[-1], i], 2:], solved.mean[i, :2] - solved.mean[track[-1], :2]
            if solved.time_s[i] <= solved.time_s[track[-1]] or way @ before <= 0.0 or way @ after <= 0.0:
                if len(track) > 1:
                    yield track
                track = []
        track.append(i)
    if len(track) > 1:
        yield track


def _covariances(spline: Spline, at_s: Array) -> Array:
    """Of the states at these times (M, 4, 4), with the knots (E, 4) as independent of each other."""
    basis = np.eye(spline.states.size).reshape(-1, *spline.states.shape)
    times = np.broadcast_to(spline.times_s, (len(basis), len(spline.times_s)))
    unit = Spline(times, basis, spline.covariance, spline.converged)
    J = unit.at(np.broadcast_to(at_s, (len(basis), len(at_s))))  # (4 E, M, 4): the state is linear in the knots
    J = J.reshape(*spline.states.shape, len(at_s), 4)
    found: Array = np.einsum("eima,eij,ejmb->mab", J, spline.covariance, J)
    return found
