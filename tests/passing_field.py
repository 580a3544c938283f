"""Every tracker on reports of passes, in a field of three clusters: the tables of docs/trackers.md.

    python -m tests.passing_field [--runs 30] [--alone] [--trackers ml ukf]

Clusters of five sensors, as in Yang et al. (2009), stand 60 m apart in a row. A target passes through all of them at
about 30 mph, its acceleration random with the sd that the trackers expect. A sensor reports with the first step, of
0.5 s, that is 1 s after it heard the target loudest. Tracks start from a prior that is right (sds 5 m and 1 m/s), or
``--alone`` from reports, which takes strengths. The bound is that of the path, its reports and the start. Run r has the
seed r.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final, NamedTuple

import numpy as np

from tests.passes import PENTAGON
from trackfield.filters.bounds import position_sd, trajectory_crlb
from trackfield.filters.gaussian import Motion
from trackfield.filters.measurement import STATE, extended, moving, sensing_information
from trackfield.filters.metrics import effective_count, nees, nees_band
from trackfield.filters.needs import NEEDS, PASSES, needs_of
from trackfield.filters.rng import generator
from trackfield.filters.trackers import TRACKERS, make_tracker
from trackfield.filters.types import Array, Estimate, Gaussian, Model, Readings, Reports
from trackfield.models import motion
from trackfield.sensing.kinds import make_sensor
from trackfield.tracking.following import ANYWHERE, Following

CLUSTERS: Final = 3
PLACES: Final = np.concatenate([20.0 * PENTAGON + (60.0 * k, 0.0) for k in range(CLUSTERS)])
DT: Final = 0.5
STEPS: Final = 36
SETTLED: Final = 18
"""The first step that counts: the first cluster lies behind the target."""
SPEED: Final = 13.4
NEAREST_M: Final = 2.0
"""No sensor is nearer to the path, as in Yang et al. (2009)."""
PRIOR: Final = np.diag([25.0, 25.0, 1.0, 1.0])
KNOWN_S: Final = 1.0
LEVEL_DB: Final = 60.0
TIMES: Final = "times alone"
FIELDS: Final[Mapping[str, Mapping[str, Any]]] = {
    "level known": {},
    "level unknown": {"source_sd_db": 6.0},
    TIMES: {"use_strength": False},
}
"""What is known of how loud the target is: its level (dB at 1 m), the sd of that, or strengths are not used."""


class Run(NamedTuple):
    """``truth`` (STEPS + 1, 4) at the steps, and the reports of steps 1 to STEPS."""

    truth: Array
    heard: list[Reports]


@dataclass(frozen=True)
class Field:
    """Sensors whose kind ``cpa`` has these ``options``."""

    options: Mapping[str, Any]

    @cached_property
    def model(self) -> Model:
        """What trackers know."""
        kind = make_sensor("cpa", {"range_m": 60.0, "source_db": LEVEL_DB, **self.options})
        return Model({"cpa": kind}, 0.1, len(PLACES))

    def run(self, seed: int) -> Run:
        """The path of a run, and its reports."""
        rng = np.random.default_rng(seed)
        away = np.zeros(1)
        while away.min() < NEAREST_M:
            heading = rng.uniform(-0.08, 0.08)
            start = np.array([-35.0, rng.uniform(-9.0, 9.0), SPEED * np.cos(heading), SPEED * np.sin(heading)])
            kicks = self.model.sigma_v * rng.standard_normal((STEPS, 2))
            truth = _path(start, kicks)
            times, away, speeds = _passes(truth, kicks)
        level_db = LEVEL_DB + self.options.get("source_sd_db", 0.0) * rng.standard_normal()
        noise = rng.standard_normal((3, len(PLACES)))
        values = np.stack(
            (
                times + away / 340.0 + 0.1 * noise[0],
                level_db - 20.0 * np.log10(away) + 20.0 / np.log(10.0) * 0.1 * noise[1],
                away / speeds * (1.0 + 0.05 * noise[2]),
            ),
            axis=-1,
        )
        steps = np.ceil((times + away / 340.0 + KNOWN_S) / DT).astype(int)
        return Run(truth, [self._reports(step, values, np.flatnonzero(steps == step)) for step in range(1, STEPS + 1)])

    def _reports(self, step: int, values: Array, which: Any) -> Reports:
        ids = tuple(f"n{k:02d}" for k in which)
        told = values[which] - np.array([step * DT, 0.0, 0.0])
        return Reports(step, ids, PLACES[which], (Readings("cpa", told),), self.model.sensor.m)

    def bound(self, run: Run, start: Array) -> Array:
        """(STEPS, 4 + u, 4 + u) along a path, when ``start`` (4, 4) is the covariance before it."""
        unknowns = self.model.unknowns
        prior = extended(Gaussian(run.truth[0], start), unknowns).covariance
        states = np.concatenate((run.truth, np.full((STEPS + 1, len(unknowns)), LEVEL_DB)), axis=1)
        told = np.array([sensing_information(self.model, x, r) for x, r in zip(states[1:], run.heard, strict=True)])
        return trajectory_crlb(prior, Motion(*moving(self.model, DT)), told)


def _path(start: Array, kicks: Array) -> Array:
    """States (STEPS + 1, 4) under accelerations (STEPS, 2), each held for a step."""
    F, gain = np.array(motion.transition(DT)), np.array(motion.noise_gain(DT))
    states = [start]
    for kick in kicks:
        states.append(F @ states[-1] + gain @ kick)
    return np.array(states)


def _passes(truth: Array, kicks: Array) -> tuple[Array, Array, Array]:
    """When (s) the target passed each sensor, at which distance (m) and speed (m/s), to a millisecond."""
    within = np.arange(0.0, DT, 0.001)[:, None, None]
    places = truth[:-1, :2] + truth[:-1, 2:] * within + 0.5 * kicks * within**2
    flat = places.swapaxes(0, 1).reshape(-1, 2)
    away = np.linalg.norm(flat[:, None] - PLACES, axis=-1)
    nearest = away.argmin(axis=0)
    speeds = np.linalg.norm(truth[nearest // len(within), 2:], axis=-1)
    return nearest * 0.001, away.min(axis=0), speeds


class Cell(NamedTuple):
    """Errors (R, T, 4) of a tracker from ``SETTLED`` on, NaN without a track, its covariances, bounds (R, T) m, us."""

    errors: Array
    covariances: Array
    bounds: Array
    us: float

    @property
    def ratio(self) -> float:
        """Of the position error to the bound, both rms."""
        known = np.isfinite(self.errors[..., 0])
        square = np.square(self.errors[..., :2]).sum(axis=-1)
        return float(np.sqrt(square[known].mean() / np.square(self.bounds[known]).mean()))

    @property
    def tracked(self) -> float:
        """The share of steps with a track."""
        return float(np.isfinite(self.errors[..., 0]).mean())

    @property
    def nees(self) -> Array:
        """(R, T), NaN where there is no track."""
        found = np.full(self.errors.shape[:2], np.nan)
        known = np.isfinite(self.errors[..., 0])
        found[known] = nees(self.errors[known], self.covariances[known])
        return found

    @property
    def band(self) -> tuple[float, float]:
        """Where the mean NEES lies with 95 % if covariances are right."""
        runs = [one[np.isfinite(one)] for one in self.nees]
        return nees_band(STATE, sum(effective_count(one) for one in runs if len(one)))


def followed(
    name: str, of: Field, run: Run, prior: Gaussian | None, options: Mapping[str, Any] | None = None
) -> list[Estimate | None]:
    """The estimates of a tracker, step by step."""
    following = Following(make_tracker(name, options, of.model.dimension), of.model)
    state, found = following.begin(prior), list[Estimate | None]()
    for reports in run.heard:
        state, estimate = following.step(state, reports, DT, generator(1, name, reports.step))
        found.append(estimate)
    return found


def cell(name: str, of: Field, runs: Sequence[int], *, alone: bool, options: Mapping[str, Any] | None = None) -> Cell:
    """A tracker on a field; ``alone`` it starts from reports, otherwise from a prior."""
    errors, covariances, bounds, spent = [], [], [], 0.0
    for seed in runs:
        run, rng = of.run(seed), np.random.default_rng((seed, 1))
        prior = Gaussian(run.truth[0] + np.sqrt(np.diag(PRIOR)) * rng.standard_normal(STATE), PRIOR)
        begun = time.process_time()
        found = followed(name, of, run, None if alone else prior, options)
        spent += time.process_time() - begun
        means = [np.full(STATE, np.nan) if one is None else one.mean[:STATE] for one in found]
        spreads = [np.eye(STATE) if one is None else one.covariance[:STATE, :STATE] for one in found]
        errors.append((np.array(means) - run.truth[1:])[SETTLED - 1 :])
        covariances.append(np.array(spreads)[SETTLED - 1 :])
        bounds.append(position_sd(of.bound(run, ANYWHERE if alone else PRIOR))[SETTLED - 1 :])
    us = spent / (len(runs) * STEPS) * 1e6
    return Cell(np.array(errors), np.array(covariances), np.array(bounds), us)


def refused(name: str, of: Field) -> str:
    """Which of its needs a tracker does not find on this field, or what it takes besides; empty if it can work."""
    needs = needs_of(TRACKERS[name])
    if PASSES in needs and of.model.sensor.m == 1:
        return "uses strengths"
    return next((need for need in needs if not NEEDS[need].met(of.model.kinds)), "")


def words(name: str, of: Field, runs: Sequence[int], *, alone: bool) -> tuple[str, str, str]:
    """Error over bound, NEES with its band, cost of a step; in place of these why a tracker is refused."""
    if why := refused(name, of):
        return f"({why})", "", ""
    one = cell(name, of, runs, alone=alone)
    (low, high), mean = one.band, float(np.nanmean(one.nees))
    lost = "" if one.tracked == 1.0 else f", {one.tracked:.0%} of steps"
    said = f"{mean:.2f}" if mean < 100.0 else f"{mean:.0f}" if mean < 1000.0 else "over 1,000"
    return f"{one.ratio:.2f}{lost}", f"{said} ({low:.2f} to {high:.2f})", f"{one.us:,.0f}"


HEADS: Final = ("Position error over the bound", "NEES, and its 95 % band", "Microseconds for a step")


def main() -> None:
    """Tables for errors, NEES and costs: a row for each tracker, a column for each field."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=30)
    parser.add_argument("--alone", action="store_true")
    parser.add_argument("--trackers", nargs="*", default=list(TRACKERS.own))
    given = parser.parse_args()
    fields = {name: Field(options) for name, options in FIELDS.items() if not (given.alone and name == TIMES)}
    rows = {
        name: [words(name, one, range(given.runs), alone=given.alone) for one in fields.values()]
        for name in given.trackers
    }
    for which, head in enumerate(HEADS):
        print(f"{head}:\n\n| tracker | {' | '.join(fields)} |\n| --- |{' ---: |' * len(fields)}")
        for name, cells in rows.items():
            if which == 0 or any(one[which] for one in cells):
                print(f"| `{name}` | {' | '.join(one[which] for one in cells)} |")
        print()


if __name__ == "__main__":
    main()
