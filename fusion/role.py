"""The fusion centre: collects the reports of a step until its deadline, fuses them, and publishes the track.

Several trackers may run side by side on the same reports (Zhai et al., Fig. 2: fusion at the centre).

A report that comes after its deadline but is not too old is taken in by going back: at the next deadline the
trackers start again from their states before its step, and every step since is fused and published anew.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import dist, nan, radians
from typing import Any, Final

import numpy as np
from immutables import Map

from fusion.memory import TRANSITIONS, Heard, Memory, Past, Phase
from fusion.points import track_point
from fusion.smoothing import Smoothing, lagged_name
from fusion.stored import Stored, pack, unpack
from fusion.threshold import Controller, expected_place, position_sd
from trackfield.filters.following import Following
from trackfield.filters.measurement import OfSensor
from trackfield.filters.metrics import LOST_M
from trackfield.filters.rng import generator
from trackfield.filters.trackers import make_tracker
from trackfield.filters.types import Gaussian, Model, Reports
from trackfield.role import (
    NS,
    Effect,
    Event,
    Ignored,
    IllegalEvent,
    Late,
    Note,
    Publish,
    Received,
    Send,
    SetTimer,
    Started,
    State,
    Store,
    Timer,
    TrackPoint,
    check_transition,
)
from trackfield.wire.messages import Doa, Measurement, SyncReply, SyncRequest, Threshold
from trackfield.world.sensors import make_sensor

_LAST_STEP: Final = 65535
"""As far as a message counts."""


class Fusion:
    """Fuses the reports of ``sensors`` (id, x m, y m) each ``step_ns``, ``deadline_ns`` after the step's instant.

    ``trackers`` are named; ``prior`` (mean and sd of x, y, vx, vy at the start) may be absent, then they start
    from the first reports. ``options`` are those of single trackers, ``places`` (``module:attribute``) say where those
    are that are not our own, ``sigma_v`` (m/s^2) is for those that have one motion model; a track less certain than
    ``lost_m`` is given up if it began without a prior. All randomness is keyed by ``seed``, the tracker and the step.
    Reports that are up to ``max_age_ns`` old count after their deadline too. Each track is smoothed over
    ``smooth_lag`` steps, too, unless that is 0. With ``threshold`` (the fields of ``Controller``) the centre commands
    the sensors' threshold. Its clock is the reference for sensors that ask for the time. Reports are bearings with
    noise of sd ``doa_sd_deg``, or those of a user's ``sensor`` (the arguments of ``make_sensor``).
    """

    def __init__(
        self,
        *,
        trackers: Sequence[str],
        sensors: Sequence[tuple[str, float, float]],
        step_ns: int,
        deadline_ns: int,
        seed: int,
        doa_sd_deg: float = nan,
        prior: Mapping[str, Sequence[float]] | None = None,
        target: str = "target",
        max_age_ns: int = 0,
        threshold: Mapping[str, float] | None = None,
        sigma_v: float = 0.1,
        smooth_lag: int = 0,
        lost_m: float = LOST_M,
        options: Mapping[str, Mapping[str, Any]] | None = None,
        places: Mapping[str, str] | None = None,
        sensor: Mapping[str, Any] | None = None,
    ) -> None:
        self.step_ns, self.deadline_ns, self.seed, self.target = step_ns, deadline_ns, seed, target
        self.max_age_ns = max_age_ns
        self.positions = {id: (x, y) for id, x, y in sensors}
        self.sensor = None if sensor is None else make_sensor(**sensor)
        own = None if self.sensor is None else OfSensor(self.sensor)
        self.kinds = frozenset({"doa" if own is None else "measurement", "sync-request"})
        model, options = Model(radians(doa_sd_deg), sigma_v, own), options or {}
        made = {name: make_tracker(name, options.get(name), places) for name in trackers}
        self.trackers = {name: Smoothing(Following(one, model, lost_m), smooth_lag) for name, one in made.items()}
        self.controller = None if threshold is None else Controller(**threshold)
        self.prior = (
            None
            if prior is None
            else Gaussian(np.array(prior["mean"], float), np.diag(np.square(np.array(prior["sd"], float))))
        )

    def begin(self) -> Memory:
        """Every tracker with its prior, or waiting for reports."""
        return self._waiting(self.prior)

    def handle(self, state: Memory, event: Event) -> tuple[Memory, tuple[Effect, ...]]:
        """See ``trackfield.role.Role``."""
        after, effects = self._react(state, event)
        check_transition(TRANSITIONS, state.phase, event, after.phase)
        if after.phase is not state.phase:
            effects = (*effects, State(after.phase.value))
        return after, effects

    def _react(self, memory: Memory, event: Event) -> tuple[Memory, tuple[Effect, ...]]:
        match event:
            case Started(now, stored):
                return self._start(memory, now, stored)
            case Received(now, Doa() | Measurement() as report, sender) if self._takes(report):
                return self._collect(memory, now, report, sender)
            case Received(now, SyncRequest(exchange, sent_us), sender):
                return memory, (Send(SyncReply(exchange, sent_us, now // 1000, now // 1000), sender),)
            case Received():
                return memory, (Ignored("unexpected"),)
            case Timer(now):
                return self._fuse(memory, now)
        raise IllegalEvent(f"a fusion centre has no use for {event}")

    def _deadline(self, step: int) -> SetTimer:
        return SetTimer("deadline", step * self.step_ns + self.deadline_ns)

    # --- the start of a life ---

    def _waiting(self, prior: Gaussian | None) -> Memory:
        level = self.controller.start_db if self.controller else None
        return Memory(Phase.NEW, tuple(t.begin(prior) for t in self.trackers.values()), threshold_db=level)

    def _start(self, memory: Memory, now: int, kept: bytes) -> tuple[Memory, tuple[Effect, ...]]:
        fused = max((now - self.deadline_ns) // self.step_ns, 0)
        begun = memory if fused == 0 else self._waiting(None)  # a prior is about the start of the run
        fresh = replace(begun, phase=Phase.WAITING, fused=fused)
        if not kept:
            return fresh, (self._deadline(fused + 1),)
        try:
            stored = unpack(kept)
            if stored.step > now // self.step_ns + 1:
                raise ValueError(f"step {stored.step} is still to come")
        except ValueError as error:
            return fresh, (Note(f"What an earlier life stored is of no use: {error}"), self._deadline(fused + 1))
        return self._resume(fresh, stored)

    def _resume(self, fresh: Memory, stored: Stored) -> tuple[Memory, tuple[Effect, ...]]:
        """Each tracker from its belief, without reports over the steps that were missed."""
        fused = max(fresh.fused, stored.step)
        tracks, points = [], []
        for name, tracker in self.trackers.items():
            belief, estimate = stored.beliefs.get(name), None
            track = tracker.begin(None) if belief is None else tracker.resume(belief)
            for step in range(stored.step + 1, fused + 1):
                if track.track is None:
                    break
                nothing, rng = self._reports(step, Map()), generator(self.seed, name, step)
                track, estimate, _ = tracker.step(track, nothing, self.step_ns / NS, rng)
            tracks.append(track)
            if estimate is not None:
                points.append(track_point(name, self.target, self._reports(fused, Map()), estimate))
        phase = Phase.WAITING if tracks[0].track is None else Phase.COASTING
        level = self._level(stored.threshold_db)
        resumed = replace(fresh, phase=phase, tracks=tuple(tracks), fused=fused, threshold_db=level)
        return resumed, (*map(Publish, points), self._deadline(fused + 1))

    def _level(self, stored_db: float | None) -> float | None:
        if self.controller is None:
            return None
        return self.controller.start_db if stored_db is None else self.controller.bounded(stored_db)

    # --- reports ---

    def _takes(self, report: Doa | Measurement) -> bool:
        """Whether it is one of this field's sensors' kind."""
        if self.sensor is None:
            return isinstance(report, Doa)
        return isinstance(report, Measurement) and len(report.values) == len(self.sensor.resolution)

    def _collect(
        self, memory: Memory, now: int, report: Doa | Measurement, sender: str
    ) -> tuple[Memory, tuple[Effect, ...]]:
        step = report.step
        past = memory.past.get(step)
        late = step <= memory.fused
        if late and (past is None or now - step * self.step_ns > self.max_age_ns):
            return memory, (Ignored("late"),)
        if sender not in self.positions:
            return memory, (Ignored("unknown sensor"),)
        if step > now // self.step_ns + 1:
            return memory, (Ignored("from the future"),)
        reports = past.heard if past else memory.heard.get(step, Map())
        if sender in reports:
            return memory, (Ignored("repeated"),)
        reports = reports.set(sender, report)
        if past is None:
            return replace(memory, heard=memory.heard.set(step, reports)), ()
        stale = step if memory.stale is None else min(step, memory.stale)
        return replace(memory, past=memory.past.set(step, Past(past.tracks, reports)), stale=stale), (Late(),)

    # --- deadlines ---

    def _fuse(self, memory: Memory, now: int) -> tuple[Memory, tuple[Effect, ...]]:
        step = memory.fused + 1
        memory, published = self._replay(memory)
        heard = memory.heard.get(step, Map())
        past = self._recent(memory.past.set(step, Past(memory.tracks, heard)), now)
        tracks, points, earlier = self._advance(memory.tracks, step, heard)
        first = next(iter(points.values()))
        level, command = self._command(memory.threshold_db, first)
        after = replace(
            memory,
            phase=Phase(first.status),
            tracks=tracks,
            fused=step,
            heard=memory.heard.delete(step) if step in memory.heard else memory.heard,
            past=past,
            threshold_db=level,
        )
        publish = map(Publish, (*published, *points.values(), *earlier))
        return after, (*publish, *command, Store(pack(step, level, points)), self._deadline(step + 1))

    def _replay(self, memory: Memory) -> tuple[Memory, list[TrackPoint]]:
        """All steps since the oldest that got a late report, fused again, and their points."""
        if memory.stale is None:
            return memory, []
        past, published = memory.past, list[TrackPoint]()
        tracks = past[memory.stale].tracks
        for step in range(memory.stale, memory.fused + 1):
            heard = past[step].heard
            past = past.set(step, Past(tracks, heard))
            tracks, points, earlier = self._advance(tracks, step, heard)
            published += (*points.values(), *earlier)
        return replace(memory, tracks=tracks, past=past, stale=None), published

    def _recent(self, past: Map[int, Past], now: int) -> Map[int, Past]:
        for step in sorted(past):
            if now - step * self.step_ns <= self.max_age_ns:
                break
            past = past.delete(step)
        return past

    def _advance(
        self, tracks: tuple[Any, ...], step: int, heard: Heard
    ) -> tuple[tuple[Any, ...], dict[str, TrackPoint], list[TrackPoint]]:
        """The trackers' states after a step, its points by tracker, and what is now smoothed of an earlier step: the
        same whenever it is computed."""
        reports, advanced, points, smoothed = self._reports(step, heard), [], {}, []
        for (name, tracker), track in zip(self.trackers.items(), tracks, strict=True):
            after, estimate, earlier = tracker.step(track, reports, self.step_ns / NS, generator(self.seed, name, step))
            advanced.append(after)
            points[name] = track_point(name, self.target, reports, estimate)
            if earlier is not None:
                lag = tracker.lag
                smoothed.append(track_point(lagged_name(name, lag), self.target, *earlier, lag))
        return tuple(advanced), points, smoothed

    def _reports(self, step: int, heard: Heard) -> Reports:
        ids = tuple(sorted(heard))
        positions = np.array([self.positions[id] for id in ids], float).reshape(-1, 2)
        if self.sensor is None:
            bearings = np.radians([heard[id].bearing_deg for id in ids])
            return Reports(step, ids, positions, bearings, np.array([heard[id].level_db for id in ids], float))
        steps = np.array([heard[id].values for id in ids], float).reshape(-1, len(self.sensor.resolution))
        nothing = np.full(len(ids), nan)
        return Reports(step, ids, positions, nothing, nothing, steps * np.array(self.sensor.resolution))

    def _command(self, level_db: float | None, point: TrackPoint) -> tuple[float | None, tuple[Send, ...]]:
        """The threshold for the step after ``point``, and the message to those who are about to hear the target."""
        if self.controller is None or level_db is None or not point.mean:
            return level_db, ()
        level = self.controller.adjusted(level_db, position_sd(point))
        place, reach = expected_place(point, self.step_ns / NS), self.controller.reach_m
        near = frozenset(id for id, position in self.positions.items() if dist(position, place) <= reach)
        if not near or point.step >= _LAST_STEP:
            return level, ()
        return level, (Send(Threshold(point.step + 1, level), near),)
