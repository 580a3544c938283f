"""Every tracker with every kind of sensing, on one field and one target: the tables of docs/trackers.md.

    python -m tests.matrix [--runs 30] [--alone] [--trackers imm-ukf ukf] [--fields range rss]

25 sensors 60 m apart, of one kind or of two in turn; the target crosses the field in 40 s, its acceleration random with
the sd that the trackers expect. Tracks start from a prior that is right (sd 5 m and 1 m/s), or ``--alone`` from reports
alone, and count from step 10 on. The bound is that of this path, its reports, and this start. Run r has the seed r.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final, NamedTuple

import numpy as np

from trackfield.filters.bounds import position_sd, trajectory_crlb
from trackfield.filters.gaussian import Motion
from trackfield.filters.measurement import STATE, expected, extended, moving, noise_sd, sensing_information
from trackfield.filters.metrics import effective_count, nees, nees_band
from trackfield.filters.needs import NEEDS, needs_of, unmet
from trackfield.filters.trackers import TRACKERS, make_tracker
from trackfield.filters.types import Array, Gaussian, Model, Readings, Reports
from trackfield.models import motion
from trackfield.models.sound import level_db
from trackfield.sensing.doa import Doa
from trackfield.sensing.kinds import make_sensor
from trackfield.tracking.following import ANYWHERE, Following

PLACES: Final = np.array([(60.0 * column, 60.0 * row) for row in range(5) for column in range(5)])
STEPS: Final = 40
FAR: Final = 20.0
SETTLED: Final = 10
"""The first step that counts."""
PRIOR: Final = np.diag([25.0, 25.0, 1.0, 1.0])
START: Final = np.array([20.0, 35.0, 5.0, 4.0])
FIELDS: Final[Mapping[str, tuple[str, ...]]] = {
    "doa": ("doa",),
    "range": ("range",),
    "rss": ("rss",),
    "energy": ("energy",),
    "doa and range": ("doa", "range"),
    "rss and energy": ("rss", "energy"),
}
"""The kinds of each field, sensor by sensor in turn."""
OPTIONS: Final[Mapping[str, Mapping[str, Any]]] = {
    "doa": {"threshold": 0.69},
    "range": {"range_m": 150.0},
    "rss": {"range_m": 150.0},
}
"""All sense the target as far as energies are: 150 m."""


@dataclass(frozen=True)
class Field:
    """Sensors of these kinds, with ``options`` by kind.

    A share ``outliers`` of their numbers is off by up to ``FAR`` sds of the noise, to either side.
    """

    kinds: tuple[str, ...]
    options: Mapping[str, Mapping[str, Any]]
    outliers: float = 0.0

    @cached_property
    def model(self) -> Model:
        """What trackers know."""
        return Model({kind: make_sensor(kind, dict(self.options.get(kind, {}))) for kind in self.kinds}, 0.1)

    def truth(self, rng: np.random.Generator, start: Array = START) -> Array:
        """States (STEPS + 1, 4 + u), the unknowns drawn from what is known of them."""
        F, Q = moving(self.model, 1.0)
        begin = extended(Gaussian(start, np.zeros((STATE, STATE))), self.model.unknowns)
        states = [begin.mean + np.sqrt(np.diag(begin.covariance)) * rng.standard_normal(len(begin.mean))]
        gain = np.array(motion.noise_gain(1.0)) * self.model.sigma_v
        walks = np.sqrt(np.diag(Q)[STATE:])
        for _ in range(STEPS):
            kick = np.append(gain @ rng.standard_normal(2), walks * rng.standard_normal(len(walks)))
            states.append(F @ states[-1] + kick)
        return np.array(states)

    def heard(self, state: Array, step: int, rng: np.random.Generator) -> Reports:
        """The reports of a step, of all sensors that are near enough."""
        away, sensors, readings = np.hypot(*(PLACES - state[:2]).T), [], []
        for rank, (name, kind) in enumerate(self.model.kinds.items()):
            its = np.arange(len(PLACES)) % len(self.kinds) == rank
            near = np.flatnonzero(its & (away <= kind.report_m))  # type: ignore[attr-defined]
            sensors.append(near)
            values = np.zeros((len(near), 2 if isinstance(kind.own, Doa) else kind.m))  # type: ignore[attr-defined]
            if isinstance(kind.own, Doa):  # type: ignore[attr-defined]
                values[:, 1] = level_db(away[near], kind.own.level_db, kind.own.alpha, xp=np)  # type: ignore[attr-defined]
            readings.append(Readings(name, values))
        which = np.concatenate(sensors)
        one = self.model.sensor if len(self.kinds) == 1 else None
        ids = tuple(f"n{k:03d}" for k in which)
        blank = Reports(step, ids, PLACES[which], tuple(readings), one and one.m, bool(one and one.bearings))
        z = expected(self.model, state, blank)
        sd = noise_sd(self.model, blank, state)
        z = z + sd * rng.standard_normal(len(z))
        if self.outliers:
            z += np.where(rng.random(len(z)) < self.outliers, sd * rng.uniform(-FAR, FAR, len(z)), 0.0)
        first = 0
        for each in readings:
            m = self.model.kinds[each.kind].m
            each.values[:, :m] = z[first : first + len(each.values) * m].reshape(-1, m)
            first += len(each.values) * m
        return blank

    def bound(self, truth: Array, heard: Sequence[Reports], start: Array) -> Array:
        """(STEPS, 4 + u, 4 + u) along a path, when ``start`` (4, 4) is the covariance before it."""
        prior = extended(Gaussian(truth[0, :STATE], start), self.model.unknowns).covariance
        told = np.array([sensing_information(self.model, x, r) for x, r in zip(truth[1:], heard, strict=True)])
        return trajectory_crlb(prior, Motion(*moving(self.model, 1.0)), told)


class Cell(NamedTuple):
    """A tracker's errors (R, T, 4) from ``SETTLED`` on, its covariances, the bounds (R, T) m, and us for a step.

    Errors are NaN where it has no track.
    """

    errors: Array
    covariances: Array
    bounds: Array
    us: float

    @property
    def error_m(self) -> float:
        """Position error, rms over runs and steps."""
        return float(np.sqrt(np.nanmean(np.square(self.errors[..., :2]).sum(axis=-1))))

    @property
    def ratio(self) -> float:
        """Of the error to the bound, both rms."""
        return self.error_m / float(np.sqrt(np.square(self.bounds).mean()))

    @property
    def tracked(self) -> float:
        """The share of steps with a track."""
        return float(np.isfinite(self.errors[..., 0]).mean())

    @property
    def nees(self) -> Array:
        """(R, T) of (x, y, vx, vy), NaN where there is no track."""
        found = np.full(self.errors.shape[:2], np.nan)
        known = np.isfinite(self.errors[..., 0])
        found[known] = nees(self.errors[known], self.covariances[known])
        return found

    @property
    def band(self) -> tuple[float, float]:
        """Where the mean NEES lies with 95 % if covariances are right; successive steps are not independent."""
        runs = [one[np.isfinite(one)] for one in self.nees]
        return nees_band(STATE, sum(effective_count(one) for one in runs if len(one)))


def truth_of(of: Field, seed: int) -> Array:
    """The path (STEPS + 1, 4 + u) of this run."""
    return of.truth(np.random.default_rng(seed))


def field(name: str, outliers: float = 0.0, **options: Mapping[str, Any]) -> Field:
    """One of ``FIELDS``; options of its kinds are given by kind."""
    return Field(FIELDS[name], {**OPTIONS, **options}, outliers)


def cell(name: str, of: Field, runs: range, *, alone: bool = True, options: Mapping[str, Any] | None = None) -> Cell:
    """A tracker on a field; ``alone`` it starts from reports, otherwise from a prior."""
    errors, covariances, bounds, spent = [], [], [], 0.0
    for seed in runs:
        rng = np.random.default_rng(seed)
        truth = of.truth(rng)
        heard = [of.heard(state, step, rng) for step, state in enumerate(truth[1:], start=1)]
        prior = Gaussian(truth[0, :STATE] + np.sqrt(np.diag(PRIOR)) * rng.standard_normal(STATE), PRIOR)
        following = Following(make_tracker(name, options, of.model.dimension), of.model)
        state, means, spreads, begun = following.begin(None if alone else prior), [], [], time.process_time()
        for reports in heard:
            state, estimate = following.step(state, reports, 1.0, rng)
            means.append(np.full(STATE, np.nan) if estimate is None else estimate.mean[:STATE])
            spreads.append(np.eye(STATE) if estimate is None else estimate.covariance[:STATE, :STATE])
        spent += time.process_time() - begun
        errors.append((np.array(means) - truth[1:, :STATE])[SETTLED - 1 :])
        covariances.append(np.array(spreads)[SETTLED - 1 :])
        bounds.append(position_sd(of.bound(truth, heard, ANYWHERE if alone else PRIOR))[SETTLED - 1 :])
    us = spent / (len(runs) * STEPS) * 1e6
    return Cell(np.array(errors), np.array(covariances), np.array(bounds), us)


def refused(name: str, of: Field) -> str:
    """Which of its needs a tracker does not find on this field; empty if it can work."""
    kinds = of.model.kinds
    assert bool(unmet(TRACKERS[name], kinds)) != all(NEEDS[need].met(kinds) for need in needs_of(TRACKERS[name]))
    return next((need for need in needs_of(TRACKERS[name]) if not NEEDS[need].met(kinds)), "")


def takers() -> list[str]:
    """The trackers that can work on any of the fields."""
    return [name for name in TRACKERS.own if not all(refused(name, field(one)) for one in FIELDS)]


def words(name: str, of: Field, runs: range, *, alone: bool) -> tuple[str, str, str]:
    """Error over bound, NEES with its band, cost of a step; in place of these what a tracker that is refused needs."""
    if why := refused(name, of):
        return f"({why})", "", ""
    one = cell(name, of, runs, alone=alone)
    (low, high), mean = one.band, float(np.nanmean(one.nees))
    lost = "" if one.tracked == 1.0 else f", {one.tracked:.0%} of steps"
    said = f"{mean:.2f}" if mean < 100.0 else f"{mean:.0f}" if mean < 1000.0 else "over 1,000"
    return f"{one.ratio:.2f}{lost}", f"{said} ({low:.2f} to {high:.2f})", f"{one.us:,.0f}"


def main() -> None:
    """A table each for errors, NEES and costs: a row for each tracker, a column for each field."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=30)
    parser.add_argument("--alone", action="store_true")
    parser.add_argument("--trackers", nargs="*", default=takers())
    parser.add_argument("--fields", nargs="*", default=list(FIELDS), choices=list(FIELDS))
    given = parser.parse_args()
    rows = {
        name: [words(name, field(one), range(given.runs), alone=given.alone) for one in given.fields]
        for name in given.trackers
    }
    heads = ("Position error over the bound", "NEES, and its 95 % band", "Microseconds for a step")
    for which, head in enumerate(heads):
        print(f"{head}:\n\n| tracker | {' | '.join(given.fields)} |\n| --- |{' ---: |' * len(given.fields)}")
        for name, cells in rows.items():
            print(f"| `{name}` | {' | '.join(one[which] for one in cells)} |")
        print()


if __name__ == "__main__":
    main()
