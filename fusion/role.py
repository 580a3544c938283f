"""The fusion centre: collects the reports of a step until its deadline, fuses them, and publishes the track.

Several trackers may run side by side on the same reports (Zhai et al., Fig. 2: fusion at the centre).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from math import radians
from typing import Any, Final, Literal

import numpy as np
from immutables import Map

from trackfield.filters.following import Following
from trackfield.filters.rng import generator
from trackfield.filters.trackers import make_tracker
from trackfield.filters.types import Estimate, Gaussian, Model, Reports
from trackfield.role import (
    NS,
    Effect,
    Event,
    Ignored,
    IllegalEvent,
    Publish,
    Received,
    SetTimer,
    Started,
    State,
    Timer,
    TrackPoint,
    Transitions,
    check_transition,
)
from trackfield.wire.messages import Doa

MAX_PARTICLES: Final = 200
"""How many particles of a tracker are published, at most."""


class Phase(Enum):
    """What the first tracker is doing: no track yet, following, or following without any report."""

    NEW = "new"
    WAITING = "waiting"
    TRACKING = "tracking"
    COASTING = "coasting"


_RUNNING: Final = frozenset({Phase.WAITING, Phase.TRACKING, Phase.COASTING})

TRANSITIONS: Final[Transitions] = {
    (Phase.NEW, Started): frozenset({Phase.WAITING}),
    **{(phase, Timer): _RUNNING for phase in _RUNNING},
    **{(phase, Received): frozenset({phase}) for phase in _RUNNING},
}


@dataclass(frozen=True, slots=True, eq=False)
class Memory:
    """The centre's state: ``heard`` maps a step to the reports that came for it, ``fused`` is the last step done."""

    phase: Phase
    tracks: tuple[Any, ...]
    fused: int = 0
    heard: Map[int, Map[str, Doa]] = field(default_factory=Map)


class Fusion:
    """Fuses the reports of ``sensors`` (id, x m, y m) each ``step_ns``, ``deadline_ns`` after the step's instant.

    ``trackers`` are named; ``prior`` (mean and sd of x, y, vx, vy at the start) may be absent, then they start
    from the first reports. All randomness is keyed by ``seed``, the tracker and the step.
    """

    kinds = frozenset({"doa"})

    def __init__(
        self,
        *,
        trackers: Sequence[str],
        sensors: Sequence[tuple[str, float, float]],
        step_ns: int,
        deadline_ns: int,
        doa_sd_deg: float,
        seed: int,
        prior: Mapping[str, Sequence[float]] | None = None,
        target: str = "target",
    ) -> None:
        self.step_ns, self.deadline_ns, self.seed, self.target = step_ns, deadline_ns, seed, target
        self.positions = {id: (x, y) for id, x, y in sensors}
        model = Model(sigma_w=radians(doa_sd_deg))
        self.trackers = {name: Following(make_tracker(name), model) for name in trackers}
        self.prior = (
            None
            if prior is None
            else Gaussian(np.array(prior["mean"], float), np.diag(np.square(np.array(prior["sd"], float))))
        )

    def begin(self) -> Memory:
        """Every tracker with its prior, or waiting for reports."""
        return Memory(Phase.NEW, tuple(t.begin(self.prior) for t in self.trackers.values()))

    def handle(self, state: Memory, event: Event) -> tuple[Memory, tuple[Effect, ...]]:
        """See ``trackfield.role.Role``."""
        after, effects = self._react(state, event)
        check_transition(TRANSITIONS, state.phase, event, after.phase)
        if after.phase is not state.phase:
            effects = (*effects, State(after.phase.value))
        return after, effects

    def _react(self, memory: Memory, event: Event) -> tuple[Memory, tuple[Effect, ...]]:
        match event:
            case Started():
                return replace(memory, phase=Phase.WAITING), (self._deadline(1),)
            case Received(now, Doa() as report, sender):
                return self._collect(memory, now, report, sender)
            case Received():
                return memory, (Ignored("unexpected"),)
            case Timer():
                return self._fuse(memory)
        raise IllegalEvent(f"a fusion centre has no use for {event}")

    def _deadline(self, step: int) -> SetTimer:
        return SetTimer("deadline", step * self.step_ns + self.deadline_ns)

    def _collect(self, memory: Memory, now: int, report: Doa, sender: str) -> tuple[Memory, tuple[Effect, ...]]:
        reports = memory.heard.get(report.step, Map())
        if report.step <= memory.fused:
            return memory, (Ignored("late"),)
        if sender not in self.positions:
            return memory, (Ignored("unknown sensor"),)
        if report.step > now // self.step_ns + 1:
            return memory, (Ignored("from the future"),)
        if sender in reports:
            return memory, (Ignored("repeated"),)
        return replace(memory, heard=memory.heard.set(report.step, reports.set(sender, report))), ()

    def _fuse(self, memory: Memory) -> tuple[Memory, tuple[Effect, ...]]:
        step = memory.fused + 1
        reports = self._reports(step, memory.heard.get(step, Map()))
        heard = memory.heard.delete(step) if step in memory.heard else memory.heard
        tracks, points = [], []
        for (name, tracker), track in zip(self.trackers.items(), memory.tracks, strict=True):
            rng = generator(self.seed, name, step)
            after, estimate = tracker.step(track, reports, self.step_ns / NS, rng)
            tracks.append(after)
            points.append(self._point(name, reports, estimate))
        phase = Phase(points[0].status)
        done = replace(memory, phase=phase, tracks=tuple(tracks), fused=step, heard=heard)
        return done, (*(Publish(point) for point in points), self._deadline(step + 1))

    def _reports(self, step: int, heard: Mapping[str, Doa]) -> Reports:
        ids = tuple(sorted(heard))
        return Reports(
            step,
            ids,
            np.array([self.positions[id] for id in ids], float).reshape(-1, 2),
            np.radians([heard[id].bearing_deg for id in ids]),
            np.array([heard[id].level_db for id in ids], float),
        )

    def _point(self, tracker: str, reports: Reports, estimate: Estimate | None) -> TrackPoint:
        if estimate is None:
            return TrackPoint(tracker, self.target, reports.step, "waiting", reports=len(reports))
        status: Literal["tracking", "coasting"] = "tracking" if len(reports) else "coasting"
        particles = b""
        if estimate.particles is not None:
            thin = estimate.particles[:: -(-len(estimate.particles) // MAX_PARTICLES)]
            particles = thin.astype("<f4").tobytes()
        mean, covariance = estimate.mean.tolist(), estimate.covariance.ravel().tolist()
        return TrackPoint(
            tracker,
            self.target,
            reports.step,
            status,
            tuple(mean),
            tuple(covariance),
            len(reports),
            particles,
        )
