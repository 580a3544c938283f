"""What is run: filters side by side on the readings of the same runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Final

import numpy as np

from launcher.reproduce.kernels.draws import generators
from launcher.reproduce.kernels.study import Experiment, Figures
from launcher.reproduce.kernels.turns import taken
from launcher.reproduce.papers.zhou.converted import converted
from launcher.reproduce.papers.zhou.filters import Estimates, Filter, bootstrap, gpf_ukf, particles, ukf
from launcher.reproduce.papers.zhou.setups import (
    DT,
    LINEAR,
    ORIGIN,
    OUTLIERS,
    PAPERLIKE,
    RSS,
    SETUPS,
    Setup,
    World,
    neighbours,
    world,
)
from trackfield.filters import rts
from trackfield.filters.bounds import information
from trackfield.filters.fa_upf import FaUpf
from trackfield.filters.gpf_ukf import GpfUkf
from trackfield.filters.measurement import jacobians, moving, noise_sd
from trackfield.filters.types import Array, Gaussian
from trackfield.filters.upf import Upf
from trackfield.filters.upf_paper import UpfPaper

N: Final = 100
"""The number of particles where no other is named (sec. III-B)."""
FILTERS: Final[Mapping[str, Filter]] = {
    "bootstrap-100": bootstrap(N),
    "upf-paper": particles(UpfPaper(N)),
    "upf": particles(Upf(N)),
    "fa-upf": particles(FaUpf(N)),
    "gpf-ukf": gpf_ukf(GpfUkf(N)),
    "ukf": ukf(),
    "bootstrap-1000": bootstrap(1000),
}
"""Those of the main table."""
UNGUARDED: Final[Mapping[str, Filter]] = {
    "upf, no restart": particles(Upf(N, reset=False)),
    "fa-upf, no restart": particles(FaUpf(N, reset=False)),
    "gpf-ukf, no restart": gpf_ukf(GpfUkf(N, reset=False)),
}
ROBUST: Final[Mapping[str, Filter]] = {
    "ukf": ukf(),
    "ukf, robust": ukf(robust=True),
    "gpf-ukf": FILTERS["gpf-ukf"],
    "gpf-ukf, no restart": UNGUARDED["gpf-ukf, no restart"],
    "gpf-ukf, robust": gpf_ukf(GpfUkf(N, robust=True)),
    "upf, robust": particles(Upf(N, robust=True)),
}
SWEEPS: Final[Mapping[str, tuple[Callable[[int], Filter], Sequence[int]]]] = {
    "bootstrap": (bootstrap, (50, 100, 200, 500, 1000, 2000, 5000)),
    "upf-paper": (lambda n: particles(UpfPaper(n)), (10, 20, 50, 100, 200, 500)),
    "upf": (lambda n: particles(Upf(n)), (10, 20, 50, 100, 200, 500)),
    "fa-upf": (lambda n: particles(FaUpf(n)), (10, 20, 50, 100, 200, 500)),
    "gpf-ukf": (lambda n: gpf_ukf(GpfUkf(n)), (10, 20, 50, 100, 200, 500)),
}
"""The numbers of particles that are tried of each filter."""
TIMED_RUNS: Final = 10
"""At once, where processor times are measured."""


def swept() -> dict[str, tuple[str, int]]:
    """The filters of the sweeps: (kind, number of particles) by name."""
    return {f"{kind}-{n}": (kind, n) for kind, (_, sizes) in SWEEPS.items() for n in sizes}


def main(setup: Setup, filters: Mapping[str, Filter], seeds: Sequence[int]) -> Figures:
    """These filters on a setup: ``errors``, ``nees`` and ``effective`` of each, and what the bound needs."""
    told = world(setup, seeds)
    found: dict[str, Array] = {"truth": told.truth}
    for name, one in filters.items():
        estimates = one(setup.prior, told.reports, setup.model, generators(seeds, name))
        found |= of_filter(name, estimates, told.truth)
        if name == "ukf":
            found["errors ukf, smoothed"] = smoothed(setup, estimates) - told.truth
    if not setup.origin:
        found |= {"information": informations(setup, told), "detecting": detecting(setup, seeds, told.truth)}
    return found


def of_filter(name: str, estimates: Estimates, truth: Array) -> dict[str, Array]:
    """Its figures (R, T, ...) by name."""
    errors = estimates.mean - truth
    found = {f"errors {name}": errors, f"nees {name}": nees(errors, estimates.covariance)}
    if estimates.effective is not None:
        found[f"effective {name}"] = estimates.effective
    return found


def nees(errors: Array, covariance: Array) -> Array:
    """The errors' squares in units of the covariance (...,), of ``errors`` (..., n); singular ones are made regular.

    By 1e-12 of their trace: then the figure is large, as the error is beyond what they allow.
    """
    n = errors.shape[-1]
    least = 1e-12 * np.trace(covariance, axis1=-2, axis2=-1)[..., None, None] + 1e-30
    found: Array = np.vecdot(errors, np.linalg.solve(covariance + least * np.eye(n), errors[..., None])[..., 0])
    return found


def smoothed(setup: Setup, estimates: Estimates) -> Array:
    """The means (R, T, 4) of a fixed-interval smoother over a filter's beliefs."""
    return rts.smooth(Gaussian(estimates.mean, estimates.covariance), moving(setup.model, DT)).mean


def informations(setup: Setup, told: World) -> Array:
    """What the readings of each step tell about the true state, (R, T, 4, 4)."""
    found = []
    for step, some in enumerate(told.reports):
        truth = told.truth[:, step]
        found.append(information(jacobians(setup.model, truth, some), noise_sd(setup.model, some)))
    return np.stack(found, axis=1)


def detecting(setup: Setup, seeds: Sequence[int], truth: Array) -> Array:
    """How many nodes have the target in their range (R, T)."""
    apart = neighbours(setup, seeds, truth[..., :2]) - truth[..., None, :2]
    return np.asarray((np.linalg.norm(apart, axis=-1) <= setup.sense_m).sum(axis=-1), float)


def rss(setup: Setup, seeds: Sequence[int]) -> Figures:
    """Levels as they are, and as distances."""
    told, rngs = world(setup, seeds), generators(seeds, "rss")
    found: dict[str, Array] = {"information": informations(setup, told)}
    for name in ("ukf", "gpf-ukf", "upf"):
        found |= of_filter(name, FILTERS[name](setup.prior, told.reports, setup.model, rngs), told.truth)
    for name, unbiased in (("ukf, distances", False), ("ukf, distances without bias", True)):
        readings, model = converted(told, setup.model, unbiased=unbiased)
        found |= of_filter(name, ukf()(setup.prior, readings, model, rngs), told.truth)
    return found


def sweep(setup: Setup, seeds: Sequence[int]) -> Figures:
    """All numbers of particles: ``errors`` alone."""
    told = world(setup, seeds)
    found = {}
    for name, (kind, n) in swept().items():
        estimates = SWEEPS[kind][0](n)(setup.prior, told.reports, setup.model, generators(seeds, name))
        found[f"errors {name}"] = (estimates.mean - told.truth)[..., :2]
    return found


EXPERIMENTS: Final[Mapping[str, Experiment]] = {
    **{name: Experiment(partial(main, setup, {**FILTERS, **UNGUARDED})) for name, setup in SETUPS.items()},
    "linear": Experiment(partial(main, LINEAR, FILTERS)),
    "origin": Experiment(partial(main, ORIGIN, FILTERS)),
    "outliers": Experiment(partial(main, OUTLIERS, ROBUST)),
    **{name: Experiment(partial(rss, setup)) for name, setup in RSS.items()},
    **{f"{name}, particles": Experiment(partial(sweep, setup), batch=10, most=100) for name, setup in SETUPS.items()},
}


def times() -> dict[str, list[float]]:
    """Processor time (s) of a step of one run, of each filter in a batch of runs."""
    seeds = range(1, TIMED_RUNS + 1)
    told, prior, model = world(PAPERLIKE, seeds), PAPERLIKE.prior, PAPERLIKE.model
    filters = {"ukf": ukf()} | {name: SWEEPS[kind][0](n) for name, (kind, n) in swept().items()}
    contenders = {
        name: partial(one, prior, told.reports, model, generators(seeds, name)) for name, one in filters.items()
    }
    steps = PAPERLIKE.steps * TIMED_RUNS
    return {name: [one / steps for one in some] for name, some in taken(contenders, repeats=5).items()}
