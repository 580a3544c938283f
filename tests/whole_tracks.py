"""Tracks smoothed as a whole: ``python -m tests.whole_tracks`` prints the tables of docs/tracking.md."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from launcher.record.metrics import run_metrics
from launcher.reproduce.kernels.draws import generators
from launcher.reproduce.papers.zhou.experiments import FILTERS, smoothed
from launcher.reproduce.papers.zhou.filters import Estimates
from launcher.reproduce.papers.zhou.setups import SETUPS, world
from tests import led_runs
from tests.simulated import simulated
from trackfield.filters.metrics import rmse
from trackfield.filters.types import Array
from trackfield.tracking.results import LEAST_SD

RUNS = range(100)
SEEDS = range(1, 13)
EVERY = (1, 2, 5, 10)


def of_two_sds(covariance: Array) -> Array:
    """Covariances (..., 4, 4) as of a ``result``: an sd of the position and one of the velocity, rounded as there."""
    variances = np.diagonal(covariance, axis1=-2, axis2=-1)
    position, velocity = (np.sqrt(variances[..., part].mean(axis=-1)) for part in (slice(0, 2), slice(2, 4)))
    sds = np.stack([position.round(1)] * 2 + [velocity.round(2)] * 2, axis=-1)
    return np.square(np.maximum(sds, LEAST_SD))[..., None] * np.eye(4)


def kernels() -> None:
    """Of setups of Zhou et al., a line for each of two filters: live, smoothed, and smoothed from two sds."""
    for setup, one in SETUPS.items():
        told = world(one, RUNS)
        for name in ("ukf", "gpf-ukf"):
            live = FILTERS[name](one.prior, told.reports, one.model, generators(RUNS, name))
            less = Estimates(live.mean, of_two_sds(live.covariance))
            means = (live.mean, smoothed(one, live), smoothed(one, less))
            errors = (rmse((mean - told.truth)[..., :2].reshape(-1, 2)) for mean in means)
            print(f"| {setup} | {name} | {' | '.join(f'{error:.3f}' for error in errors)} |")


def roles() -> None:
    """Of a field of masters, a line for each time between two words to the base: in the network, there, smoothed."""
    with TemporaryDirectory() as folder:
        for every in EVERY:
            found = []
            for seed in SEEDS:
                settings = ("fusion.smooth_rts=true", f"seed={seed}", f"architecture.base_every={every}")
                plan = led_runs.plan(Path(folder), *settings)
                by_name = run_metrics(plan, *simulated(plan))["trackers"]
                views = [by_name["ukf"]["views"][view] for view in ("in-network", "base")]
                found.append([one["rmse"]["position"] for one in (*views, by_name["ukf+rts"])])
            cells = " | ".join(f"{error:.2f}" for error in np.sqrt(np.square(found).mean(axis=0)))
            print(f"| {every} | {cells} |")


if __name__ == "__main__":
    kernels()
    print()
    roles()
