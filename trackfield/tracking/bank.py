"""Trackers side by side on the same reports, step by step (Zhai et al., Fig. 2: fusion at the centre)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from trackfield.filters.belief import Belief, dimension, moments
from trackfield.filters.gaussian import predict
from trackfield.filters.measurement import STATE, extended, moving
from trackfield.filters.metrics import LOST_M
from trackfield.filters.rng import generator
from trackfield.filters.solving.solver import Closed
from trackfield.filters.trackers import make_tracker
from trackfield.filters.types import Array, Estimate, Gaussian, Model, Readings, Reports
from trackfield.role import NS, TrackPoint
from trackfield.sensing.complete import Kind
from trackfield.sensing.kinds import make_sensor
from trackfield.tracking.following import SPEED_SD, Following
from trackfield.tracking.points import track_point
from trackfield.tracking.selection import informations
from trackfield.tracking.smoothing import Earlier, Filtered, Foresees, Smoothing, lagged_name
from trackfield.wire.registry import kind_of_class

Heard = Mapping[str, Any]
"""The reports of one step, by sensor."""


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
    track that began without a prior, with ``speed_sd`` (m/s) as that of its velocity, is given up if the sd of its
    position exceeds ``lost_m``. They take the noise of readings to be ``assumed_noise`` times what it is. All
    randomness is keyed by ``seed``, the tracker and the step, and by ``draws``, which differs between processes that
    track. Each track is also smoothed over ``smooth_lag`` steps, unless that is 0. ``sensing`` has the arguments of
    ``make_sensor`` for each kind of sensing by name; of several, ``kinds`` says which sensors are of which. ``target``
    is the id of the target.
    """

    def __init__(
        self,
        *,
        trackers: Sequence[str],
        sensors: Sequence[tuple[str, float, float]],
        step_ns: int,
        seed: int,
        sensing: Mapping[str, Mapping[str, Any]],
        kinds: Mapping[str, Sequence[str]] | None = None,
        origin_ns: int = 0,
        prior: Mapping[str, Sequence[float]] | None = None,
        target: str = "target",
        sigma_v: float = 0.1,
        smooth_lag: int = 0,
        lost_m: float = LOST_M,
        speed_sd: float = SPEED_SD,
        assumed_noise: float = 1.0,
        options: Mapping[str, Mapping[str, Any]] | None = None,
        draws: Sequence[str] = (),
    ) -> None:
        self.step_ns, self.origin_ns, self.seed, self.target, self.draws = step_ns, origin_ns, seed, target, draws
        self.positions = {id: (x, y) for id, x, y in sensors}
        self.sensing = {name: make_sensor(**arguments).assumed(assumed_noise) for name, arguments in sensing.items()}
        self.m = next(iter(self.sensing.values())).m if len(self.sensing) == 1 else None
        self.directional = all(kind.bearings for kind in self.sensing.values())
        self.kind_of = {id: name for name, ids in (kinds or {}).items() for id in ids}
        self.messages = frozenset(kind_of_class(one.message).name for one in self.sensing.values())
        self.model, options = Model(self.sensing, sigma_v, len(self.positions)), options or {}
        made = {name: make_tracker(name, options.get(name), self.model.dimension) for name in trackers}
        follow = partial(Following, model=self.model, lost_m=lost_m, speed_sd=speed_sd)
        self.trackers = {name: Smoothing(follow(one), smooth_lag) for name, one in made.items()}
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

    def takes(self, report: Any, sender: str) -> bool:
        """Whether it is a report of the kind that this sensor is of; of any kind, if the sensor is unknown."""
        if sender in self.positions:
            return self.kind(sender).takes(report)
        return any(kind.takes(report) for kind in self.sensing.values())

    def possible(self, report: Any, sender: str) -> bool:
        """Whether a target anywhere may have been read as this report, which it takes, says."""
        kind = self.kind(sender)
        return kind.possible(kind.corrected(kind.values(report), sender))

    def begin(self, *, prior: bool) -> tuple[Any, ...]:
        """The trackers' states before the first report, with the prior or waiting for reports."""
        return tuple(tracker.begin(self.prior if prior else None) for tracker in self.trackers.values())

    def beliefs(self, tracks: tuple[Any, ...]) -> dict[str, Belief | None]:
        """What each tracker knows of the target; None while it has no track."""
        return {name: one.belief(track) for (name, one), track in zip(self.trackers.items(), tracks, strict=True)}

    def ahead(self, tracks: tuple[Any, ...]) -> tuple[Gaussian, Gaussian] | None:
        """What the first tracker knows, and that predicted to the next step; None while it has no track."""
        belief = next(iter(self.beliefs(tracks).values()))
        if belief is None:
            return None
        now = extended(moments(belief), self.model.unknowns)
        return now, predict(now, moving(self.model, self.step_ns / NS))

    def information(self, sensors: Sequence[str], state: Array) -> Array:
        """D (K, n, n) of a reading of each of these sensors about a state (n,)."""
        ids, readings = list[str](), list[Readings]()
        for name, kind in self.sensing.items():
            mine = [id for id in sensors if not self.kind_of or self.kind_of[id] == name]
            ids += mine
            readings.append(Readings(name, np.zeros((len(mine), kind.m)), np.zeros(len(mine)) if kind.timed else None))
        positions = np.array([self.positions[id] for id in ids], float).reshape(-1, 2)
        reports = Reports(0, tuple(ids), positions, tuple(readings), self.m, self.directional)
        found = dict(zip(ids, informations(self.model, state, reports), strict=True))
        return np.array([found[id] for id in sensors]).reshape(-1, len(state), len(state))

    def resume(self, beliefs: Mapping[str, Belief | None], since: int, until: int) -> Resumed:
        """Each tracker from its belief about the step ``since``, predicted without reports to the step ``until``.

        A tracker without one, or with one of a state unlike its own, waits for reports.
        """
        tracks, points, unusable = [], list[TrackPoint](), list[str]()
        for name, tracker in self.trackers.items():
            belief, estimate, n = beliefs.get(name), None, tracker.following.model.dimension
            if belief is not None and dimension(belief) not in (STATE, n):
                expected = STATE if n == STATE else f"{STATE} or {n}"
                unusable.append(f"the belief of {name} is of {dimension(belief)} numbers; expected {expected}")
                belief = None
            track = tracker.begin(None) if belief is None else tracker.resume(belief)
            for step in range(since + 1, until + 1):
                if not track.known:
                    break
                track, estimate, _ = self._step(name, track, self._reports(step, {}))
            tracks.append(track)
            if estimate is not None:
                points.append(self._point(name, self._reports(until, {}), estimate))
        return Resumed(tuple(tracks), points, unusable)

    def coasted(self, name: str, belief: Belief, since: int, until: int) -> Iterator[Filtered]:
        """What a tracker makes of its belief about the step ``since`` without reports, step by step to ``until``.

        Each with the motion that led there, if the tracker provides it. It ends where the track is given up.
        """
        following = self.trackers[name].following
        tracker, state, dt = following.tracker, following.resume(belief), self.step_ns / NS
        for step in range(since + 1, until + 1):
            reports, before = self._reports(step, {}), state.track
            state, estimate = following.step(state, reports, dt, generator(self.seed, *self.draws, name, step))
            if estimate is None:
                return
            motion = tracker.motion(before, state.track, dt) if isinstance(tracker, Foresees) else None
            yield Filtered(reports, Gaussian(estimate.mean, estimate.covariance), motion)

    def advance(self, tracks: tuple[Any, ...], step: int, heard: Heard) -> Advanced:
        """All trackers take the reports of a step."""
        reports, advanced, points, smoothed = self._reports(step, heard), [], {}, []
        for (name, tracker), track in zip(self.trackers.items(), tracks, strict=True):
            after, estimate, earlier = self._step(name, track, reports)
            advanced.append(after)
            points[name] = self._event(self._point(name, reports, estimate), tracker.closed(after))
            if earlier is not None:
                smoothed.append(self._point(lagged_name(name, tracker.lag), *earlier, tracker.lag))
        return Advanced(tuple(advanced), points, smoothed)

    def told(self, step: int, sensors: Sequence[str], beliefs: Mapping[str, Gaussian]) -> Advanced:
        """All trackers go on from these beliefs about a step, which were made of the reports of some sensors."""
        reports = Reports(step, tuple(sensors), np.zeros((len(sensors), 2)), ())
        tracks = self.resume(beliefs, step, step).tracks
        points = {name: self._point(name, reports, Estimate(*belief)) for name, belief in beliefs.items()}
        return Advanced(tracks, points, [])

    def _step(self, name: str, track: Any, reports: Reports) -> tuple[Any, Estimate | None, Earlier | None]:
        rng = generator(self.seed, *self.draws, name, reports.step)
        return self.trackers[name].step(track, reports, self.step_ns / NS, rng)

    def _point(self, name: str, reports: Reports, estimate: Estimate | None, lag: int = 0) -> TrackPoint:
        return track_point(name, self.target, self.at_ns(reports.step), reports, estimate, lag)

    def closed(self, tracks: tuple[Any, ...]) -> dict[str, Closed]:
        """The events that ended in the step that led to these states, with their reports, by tracker."""
        found = {name: one.closed(track) for (name, one), track in zip(self.trackers.items(), tracks, strict=True)}
        return {name: closed for name, closed in found.items() if closed is not None}

    def _event(self, point: TrackPoint, closed: Closed | None) -> TrackPoint:
        """The point with what came of an event that ended in its step."""
        if closed is None:
            return point
        event_ns = point.at_ns + round(closed.time_s * NS)
        status = "tracking" if point.mean and not closed.refused else point.status
        return replace(point, status=status, event_ns=event_ns, refused=closed.refused)

    def kind(self, sensor: str) -> Kind:
        """The kind of sensing of a sensor."""
        return self.sensing[self.kind_of[sensor]] if self.kind_of else next(iter(self.sensing.values()))

    def _reports(self, step: int, heard: Heard) -> Reports:
        """The reports of a step, kind by kind."""
        ids, readings = list[str](), list[Readings]()
        for name, kind in self.sensing.items():
            mine = sorted(id for id in heard if self.kind_of[id] == name) if self.kind_of else sorted(heard)
            read = [kind.corrected(kind.values(heard[id]), id) for id in mine]
            values = np.array(read, float).reshape(-1, kind.n)
            ids += mine
            early_s = np.array([kind.early_s(heard[id]) for id in mine]) if kind.timed else None
            readings.append(Readings(name, kind.z(values), early_s))
        positions = np.array([self.positions[id] for id in ids], float).reshape(-1, 2)
        return Reports(step, tuple(ids), positions, tuple(readings), self.m, self.directional)
