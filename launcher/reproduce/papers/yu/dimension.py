"""What it saves to keep velocities out of the particles: errors and times by their number (bare filters)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, Final

import numpy as np

from launcher.reproduce.kernels import scores
from launcher.reproduce.kernels.study import Experiment, Found
from launcher.reproduce.kernels.turns import taken
from launcher.reproduce.papers.yu.experiments import JM, followed
from launcher.reproduce.papers.yu.runs import PLAIN, Case, reports_of
from launcher.reproduce.papers.yu.truth import drawn
from launcher.reproduce.tables import Claim, aligned, plain, verdict, with_interval
from trackfield.filters.bootstrap import Bootstrap
from trackfield.filters.jm_rbpf import JmRbpf
from trackfield.filters.rng import generator
from trackfield.filters.types import Gaussian, Reports

NUMBERS: Final = (100, 200, 500, 1000, 2000)
BATCH: Final = 5000
"""Runs that are done at once have so many particles together."""
MOST: Final = 100
STEPS: Final = 30
"""Of each timed call; with four sensors that all hear the target."""
REDUCED: Final = "jm-rbpf"
GENERIC: Final = "bootstrap with modes"
TIMED: Final = "bootstrap"
"""The tracker whose time is taken: it samples all five numbers of the state, and no mode."""


def name_of(filter: str, n: int) -> str:
    """The name of an experiment, or of a time."""
    return f"{filter}, {n} particles"


def tracker(n: int) -> JmRbpf:
    """That of the study with so many particles."""
    return JmRbpf(particles=n, q=JM.q, silent=JM.silent, turn="known", left_deg_s=45.0, right_deg_s=22.5)


EXPERIMENTS: Final = {
    name_of(filter, n): Experiment(
        partial(followed, Case(tracker(n), draws_velocities=filter == GENERIC)), max(1, BATCH // n), MOST
    )
    for filter in (REDUCED, GENERIC)
    for n in NUMBERS
}


def times() -> Mapping[str, Sequence[float]]:
    """Processor time (s) of a step, by filter and number of particles."""
    prior, reports = _inputs()
    calls: dict[str, Callable[[], object]] = {}
    for n in NUMBERS:
        calls[name_of(REDUCED, n)] = partial(_steps, tracker(n), prior, reports)
        calls[name_of(TIMED, n)] = partial(_steps, Bootstrap(n=n), prior, reports)
    return {name: [one / STEPS for one in some] for name, some in taken(calls).items()}


def _inputs() -> tuple[Gaussian, list[Reports]]:
    told = drawn(PLAIN, [1])
    found = []
    for t in range(STEPS):
        near = np.argsort(np.linalg.norm(told.places[0] - told.path[0, t + 1, :2], axis=-1))[None, :4]
        some = reports_of(told, t, near)
        readings = tuple(one._replace(values=one.values[0]) for one in some.readings)
        found.append(Reports(t + 1, tuple("abcd"), some.positions[0], readings))
    return Gaussian(told.prior.mean[0], told.prior.covariance[0]), found


def _steps(filter: Any, prior: Gaussian, reports: Sequence[Reports]) -> None:
    rng, state = generator(1, "times"), filter.init(prior, PLAIN.model)
    for one in reports:
        state, _ = filter.step(state, one, 1.0, rng)


def table(found: Found) -> str:
    """A row for each number of particles."""
    rows = []
    for n in NUMBERS:
        reduced, generic = (found.figures[name_of(filter, n)]["errors"] for filter in (REDUCED, GENERIC))
        slow, fast = (min(found.times.get(name_of(filter, n), (np.nan,))) for filter in (REDUCED, TIMED))
        rows.append(
            [
                f"{n}",
                *(with_interval(scores.rmse(one)) for one in (reduced, generic)),
                with_interval(scores.ratio(generic, reduced)),
                *(plain(1e3 * one) for one in (slow, fast)),
                f"{slow / fast:.2f}",
            ]
        )
    header = (
        *("particles", f"{REDUCED}, m", f"{GENERIC}, m", "ratio of errors"),
        *(f"{REDUCED}, ms a step", f"{TIMED}, ms a step", "ratio of times"),
    )
    return aligned(header, rows) + f"\n\n{equal(found)}"


def equal(found: Found) -> str:
    """With how many particles the generic filter errs no more than the reduced one, by the figures themselves."""
    errors = {
        filter: [scores.rmse(found.figures[name_of(filter, n)]["errors"]).value for n in NUMBERS]
        for filter in (REDUCED, GENERIC)
    }
    said = []
    for n, error in zip(NUMBERS, errors[REDUCED], strict=True):
        enough = [m for m, other in zip(NUMBERS, errors[GENERIC], strict=True) if other <= error]
        said.append(f"{n}: {min(enough) if enough else f'more than {NUMBERS[-1]}'}")
    return f"So many particles {GENERIC} takes to err no more than {REDUCED} with: {'; '.join(said)}."


WORSE: Final = 1.05
COMPARED: Final = 500


def claim(found: Found) -> Claim:
    """What is said for keeping velocities out of the particles."""
    reduced, generic = (found.figures[name_of(filter, COMPARED)]["errors"] for filter in (REDUCED, GENERIC))
    over = scores.ratio(generic, reduced)
    return Claim(
        "Fewer numbers in a particle do with fewer particles (Rao-Blackwell)",
        f"with {COMPARED} particles the error with velocities in them is more than 5 % above that without",
        f"ratio {with_interval(over)}; {equal(found)}",
        verdict(over.above(WORSE)),
    )
