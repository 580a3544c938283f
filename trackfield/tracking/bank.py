"""Trackers side by side on the same reports, step by step (Zhai et al., Fig. 2: fusion at the centre)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import nan, radians
from typing import Any, NamedTuple

import numpy as np

from trackfield.filters.belief import Belief, dimension
from trackfield.filters.measurement import OfSensor
from trackfield.filters.metrics import LOST_M
from trackfield.filters.rng import generator
from trackfield.filters.trackers import make_tracker
from trackfield.filters.types import Estimate, Gaussian, Model, Reports
from trackfield.role import NS, TrackPoint
from trackfield.sensing.kinds import make_sensor
from trackfield.tracking.following import Following
from trackfield.tracking.points import track_point
from trackfield.tracking.smoothing import Earlier, Smoothing, lagged_name
from trackfield.wire.messages import Doa, Measurement

Heard = Mapping[str, Any]
"""The reports of one step (``Doa`` or ``Measurement``), by sensor."""


class Advanced(NamedTuple):
    """After a step: the trackers' states, the step's points by tracker, and smoothed points of an earlier step."""

    tracks: tuple[Any, ...]
    points: dict[str, TrackPoint]
    earlier: list[TrackPoint]


class Resumed(NamedTuple):
    """After a pause: the trackers' states, the points of those that have a track, and why beliefs cannot be used."""

    tracks: tuple[Any, ...]
    points: list[TrackPoint]
    unusable: list[str]


class Bank:
    """Trackers that get the reports of ``sensors`` (id, x m, y m); step k is at ``origin_ns`` + k ``step_ns``.

    ``trackers`` are names; without a ``prior`` (mean and sd of x, y, vx, vy at the start) they start from the first
    reports. ``options`` are those of single trackers, ``sigma_v`` (m/s^2) is for those that have one motion model; a
    track that began without a prior is given up if its sd exceeds ``lost_m``. All randomness is keyed by ``seed``, the
    tracker and the step, and by ``draws``, which differs between processes that track. Each track is also smoothed over
    ``smooth_lag`` steps, unless that is 0. Reports are bearings with noise of sd ``doa_sd_deg``, or those of a user's
    ``sensor`` (the arguments of ``make_sensor``). ``target`` is the id of the target.
    """

    def __init__(
        self,
        *,
        trackers: Sequence[str],
        sensors: Sequence[tuple[str, float, float]],
        step_ns: int,
        seed: int,
        origin_ns: int = 0,
        doa_sd_deg: float = nan,
        prior: Mapping[str, Sequence[float]] | None = None,
        target: str = "target",
        sigma_v: float = 0.1,
        smooth_lag: int = 0,
        lost_m: float = LOST_M,
        options: Mapping[str, Mapping[str, Any]] | None = None,
        sensor: Mapping[str, Any] | None = None,
        draws: Sequence[str] = (),
    ) -> None:
        self.step_ns, self.origin_ns, self.seed, self.target, self.draws = step_ns, origin_ns, seed, target, draws
        self.positions = {id: (x, y) for id, x, y in sensors}
        self.sensor = None if sensor is None else make_sensor(**sensor)
        own = None if self.sensor is None else OfSensor(self.sensor)
        self.kind = "doa" if own is None else "measurement"
        model, options = Model(radians(doa_sd_deg), sigma_v, own), options or {}
        made = {name: make_tracker(name, options.get(name)) for name in trackers}
        self.trackers = {name: Smoothing(Following(one, model, lost_m), smooth_lag) for name, one in made.items()}
        self.prior = (
            None
            if prior is None
            else Gaussian(np.array(prior["mean"], float), np.diag(np.square(np.array(prior["sd"], float))))
        )

    def at_ns(self, step: int) -> int:
        """The time (ns) of a step."""
        return self.origin_ns + step * self.step_ns

    def step_at(self, t_ns: int) -> int:
        """The latest step at this time; below 0 before the first."""
        return (t_ns - self.origin_ns) // self.step_ns

    def takes(self, report: Doa | Measurement) -> bool:
        """Whether the report is of the kind that this field's sensors send."""
        if self.sensor is None:
            return isinstance(report, Doa)
        return isinstance(report, Measurement) and len(report.values) == len(self.sensor.resolution)

    def begin(self, *, prior: bool) -> tuple[Any, ...]:
        """The trackers' states before the first report, with the prior or waiting for reports."""
        return tuple(tracker.begin(self.prior if prior else None) for tracker in self.trackers.values())

    def beliefs(self, tracks: tuple[Any, ...]) -> dict[str, Belief | None]:
        """What each tracker knows of the target; None while it has no track."""
        return {name: one.belief(track) for (name, one), track in zip(self.trackers.items(), tracks, strict=True)}

    def resume(self, beliefs: Mapping[str, Belief | None], since: int, until: int) -> Resumed:
        """Each tracker from its belief about the step ``since``, predicted without reports to the step ``until``.

        A tracker without one, or with one of a state unlike its own, waits for reports.
        """
        tracks, points, unusable = [], list[TrackPoint](), list[str]()
        for name, tracker in self.trackers.items():
            belief, estimate, n = beliefs.get(name), None, tracker.following.model.dimension
            if belief is not None and dimension(belief) != n:
                unusable.append(f"the belief of {name} is of {dimension(belief)} numbers; expected {n}")
                belief = None
            track = tracker.begin(None) if belief is None else tracker.resume(belief)
            for step in range(since + 1, until + 1):
                if track.track is None:
                    break
                track, estimate, _ = self._step(name, track, self._reports(step, {}))
            tracks.append(track)
            if estimate is not None:
                points.append(self._point(name, self._reports(until, {}), estimate))
        return Resumed(tuple(tracks), points, unusable)

    def advance(self, tracks: tuple[Any, ...], step: int, heard: Heard) -> Advanced:
        """All trackers take the reports of a step."""
        reports, advanced, points, smoothed = self._reports(step, heard), [], {}, []
        for (name, tracker), track in zip(self.trackers.items(), tracks, strict=True):
            after, estimate, earlier = self._step(name, track, reports)
            advanced.append(after)
            points[name] = self._point(name, reports, estimate)
            if earlier is not None:
                smoothed.append(self._point(lagged_name(name, tracker.lag), *earlier, tracker.lag))
        return Advanced(tuple(advanced), points, smoothed)

    def _step(self, name: str, track: Any, reports: Reports) -> tuple[Any, Estimate | None, Earlier | None]:
        rng = generator(self.seed, *self.draws, name, reports.step)
        return self.trackers[name].step(track, reports, self.step_ns / NS, rng)

    def _point(self, name: str, reports: Reports, estimate: Estimate | None, lag: int = 0) -> TrackPoint:
        return track_point(name, self.target, self.at_ns(reports.step), reports, estimate, lag)

    def _reports(self, step: int, heard: Heard) -> Reports:
        ids = tuple(sorted(heard))
        positions = np.array([self.positions[id] for id in ids], float).reshape(-1, 2)
        if self.sensor is None:
            bearings = np.radians([heard[id].bearing_deg for id in ids])
            return Reports(step, ids, positions, bearings, np.array([heard[id].level_db for id in ids], float))
        steps = np.array([heard[id].values for id in ids], float).reshape(-1, len(self.sensor.resolution))
        nothing = np.full(len(ids), nan)
        return Reports(step, ids, positions, nothing, nothing, steps * np.array(self.sensor.resolution))
