"""The paper's targets, live and smoothed: ``python -m tests.smoothing`` prints the table of docs/tracking.md."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from tests.zhai_field import MODEL, SCENARIOS, hear, prior_around
from trackfield.filters.metrics import rmse
from trackfield.filters.trackers import make_tracker
from trackfield.filters.types import Array, Tracker
from trackfield.tracking.following import Following
from trackfield.tracking.smoothing import Smoothing

SEEDS = range(20)
LAGS = (1, 3, 5, 10)


def rms_errors(tracker: Tracker[Any], scenario: str, seeds: Sequence[int], lag: int) -> tuple[float, float]:
    """Position error (m) of the live and of the smoothed track, over the steps that have both."""
    live, smoothed = zip(*(_errors(tracker, scenario, seed, lag) for seed in seeds), strict=True)
    return rmse(np.concatenate(live)), rmse(np.concatenate(smoothed))


def _errors(tracker: Tracker[Any], scenario: str, seed: int, lag: int) -> tuple[Array, Array]:
    """Errors (T - lag, 2) in a run of T steps, live and smoothed."""
    rng = np.random.default_rng(seed)
    truth = SCENARIOS[scenario](rng)
    one, live, smoothed = Smoothing(Following(tracker, MODEL), lag), [], []
    state = one.begin(prior_around(truth[0], rng))
    for step, target in enumerate(truth[1:], start=1):
        state, estimate, earlier = one.step(state, hear(target[:2], rng, step=step), 1.0, rng)
        assert estimate is not None
        live.append(estimate.mean[:2] - target[:2])
        if earlier is not None:
            smoothed.append(earlier.estimate.mean[:2] - truth[earlier.reports.step, :2])
    return np.array(live)[: len(smoothed)], np.array(smoothed)


def main() -> None:
    """A line for each tracker and target."""
    for name in ("imm-ukf", "fix-doa", "ekf"):
        for scenario in SCENARIOS:
            found = [rms_errors(make_tracker(name), scenario, SEEDS, lag) for lag in LAGS]
            cells = " | ".join(f"{smoothed:.2f}" for _, smoothed in found)
            print(f"| {name} | {scenario} | {found[0][0]:.2f} | {cells} |")


if __name__ == "__main__":
    main()
