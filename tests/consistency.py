"""How far off the trackers are on the paper's three targets, and whether their covariances say so.

    python -m tests.consistency [--runs 400]

prints the tables of docs/tracking.md. Lossless links, the paper's prior; seeds 0, 1, ...
"""

from __future__ import annotations

import argparse

import numpy as np

from tests.zhai_field import MODEL, SCENARIOS, errors
from trackfield.filters.fix import map_fix
from trackfield.filters.metrics import Lost, effective_count, nees, nees_band, rmse
from trackfield.filters.needs import unmet
from trackfield.filters.single_model import SingleState, Ukf
from trackfield.filters.trackers import TRACKERS
from trackfield.filters.types import Array, Estimate, Gaussian, Model, Reports


class FixUkf(Ukf):
    """The default tracker with the motion model of s1 alone: a fix from the first bearings, then a UKF."""

    def step(
        self, state: SingleState, reports: Reports, dt: float, rng: np.random.Generator
    ) -> tuple[SingleState, Estimate]:
        first = reports.step == 1  # there are reports in the first step of each target
        return (_Fix() if first else super()).step(state, reports, dt, rng)


class _Fix(Ukf):
    def _take(self, belief: Gaussian, reports: Reports, model: Model) -> Gaussian:
        return map_fix(belief, reports, model).posterior


def table_of_errors(runs: int) -> None:
    """Position error in m: pooled over runs and steps, (the median run's), and the share of runs that were lost."""
    print("| tracker | s1 | s2 | s3 |\n| --- | --- | --- | --- |")
    able = {name: make for name, make in TRACKERS.items() if not unmet(make, MODEL.kinds)}
    for name, make in {**able, "one model": FixUkf}.items():
        cells = [_errors(*errors(make(), scenario, range(runs))) for scenario in SCENARIOS]
        print(f"| `{name}` | {' | '.join(cells)} |")


def _errors(e: Array, _: Array) -> str:
    per_run = np.sqrt(np.square(e[..., :2]).sum(axis=-1).mean(axis=-1))
    return f"{rmse(e[..., :2]):.2f} ({np.median(per_run):.2f}), {Lost().holds(e[..., :2]).mean():.0%}"


def table_of_consistency(runs: int) -> None:
    low, high = nees_band(4, runs)
    print(f"95 % band of the mean of {runs} runs at one step: {low:.2f} to {high:.2f}\n")
    print("| tracker | target | NEES | position | velocity | steps in band | runs in their band |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    rows = [(name, TRACKERS[name](), scenario) for name in ("imm-ukf", "spcpf", "fix-doa") for scenario in SCENARIOS]
    for name, tracker, scenario in [*rows, ("one model", FixUkf(), "s1")]:
        print(f"| `{name}` | {scenario} | {_consistency(*errors(tracker, scenario, range(runs)))} |")


def likeness(runs: int) -> None:
    """How alike the NEES of successive steps are, for the tracker that is right."""
    values = nees(*errors(FixUkf(), "s1", range(runs)))
    apart = values - values.mean()
    successive = (apart[:, 1:] * apart[:, :-1]).mean() / np.square(apart).mean()
    worth = np.mean([effective_count(run) for run in values])
    low, high = nees_band(4, values.shape[1])
    inside = ((low < values.mean(axis=1)) & (values.mean(axis=1) < high)).mean()
    print(f"one model, s1: correlation of successive steps {successive:.2f}; {values.shape[1]} are worth {worth:.0f};")
    print(f"runs in the band of independent steps, {low:.2f} to {high:.2f}: {inside:.0%}")


def _consistency(e: Array, P: Array) -> str:
    values = nees(e, P)
    at_steps, of_runs, (low, high) = values.mean(axis=0), values.mean(axis=1), nees_band(4, len(values))
    bands = np.array([nees_band(4, effective_count(run)) for run in values])
    steps = ((low < at_steps) & (at_steps < high)).mean()
    runs = ((bands[:, 0] < of_runs) & (of_runs < bands[:, 1])).mean()
    position, velocity = (nees(e[..., part], P[..., part, part]).mean() for part in (slice(0, 2), slice(2, 4)))
    return f"{values.mean():.2f} | {position:.2f} | {velocity:.2f} | {steps:.0%} | {runs:.0%}"


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=400)
    arguments = parser.parse_args()
    table_of_errors(arguments.runs)
    print()
    table_of_consistency(arguments.runs)
    print()
    likeness(arguments.runs)
