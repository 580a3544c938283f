"""What is run: policies with both filters on the same targets, sweeps of the field, sleepers that seldom listen."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Final

import numpy as np

from launcher.reproduce.kernels.study import Experiment, Figures
from launcher.reproduce.papers.ozfidan.counts import counts, counts_of_all
from launcher.reproduce.papers.ozfidan.field import NOBODY, Q, Setup, T, drawn
from launcher.reproduce.papers.ozfidan.scheduling import POLICIES
from launcher.reproduce.papers.ozfidan.tracks import ALWAYS, Tracks, Waking, followed
from trackfield.filters.gaussian import Motion, constant_velocity
from trackfield.filters.types import Array

PAPER: Final = Setup()
"""Sec. IV."""
PAPERS_POLICY: Final = "closest"
FALLBACK: Final = "merge_until_3"
BOTH: Final = ("ukf", "pf")
FAR_M: Final = 100.0
"""A run with an error above this at some time has lost the target for a while."""
FEW: Final = 20
"""The most runs of ``all``, whose particle filter is slow."""
SOME: Final = 50
"""The most runs of each field that is swept."""

SWEEPS: Final[Mapping[str, tuple[Callable[[int], Setup], Sequence[int]]]] = {
    "masters": (lambda n: replace(PAPER, masters=n), (16, 36, 64, 100, 144)),
    "slaves": (lambda n: replace(PAPER, slaves=n), (128, 256, 384, 512)),
    "capacity": (lambda n: replace(PAPER, capacity=n), (3, 4, 5, 7, 10)),
}
SWEPT: Final[Mapping[str, Setup]] = {f"{what} {n}": make(n) for what, (make, sizes) in SWEEPS.items() for n in sizes}
DETECTION: Final = "detection up to 3 km"
NEAR: Final = replace(PAPER, detect_m=3000.0)
SCALED: Final = "UKF of the paper"
SCALED_STRICT: Final = f"{SCALED}, {PAPERS_POLICY}"
HOUSE: Final = "sigma_v"
HOUSE_MOTION: Final = constant_velocity(T, (Q / T) ** 0.5)
"""An acceleration that is held over a step, of the same effect on the velocity (``fusion.sigma_v``)."""
RARELY: Final = "woken every 10 steps"
LINGERING: Final = "awake for 10 steps"
WAKINGS: Final[Mapping[str, Waking]] = {LINGERING: Waking(1, 10), RARELY: Waking(10, 10)}


def policy(setup: Setup, name: str, runs: Sequence[int]) -> Figures:
    """Both filters: the figures of each, and whether they have the ``same leader`` and the ``same set``, (R,)."""
    tracks = {kind: followed(setup, name, kind, runs) for kind in BOTH}
    ukf, pf = tracks["ukf"], tracks["pf"]
    found = {f"{kind} {what}": some for kind in BOTH for what, some in figures(setup, tracks[kind], runs).items()}
    same = {
        "same leader": (ukf.leader == pf.leader).mean(axis=1),
        "same set": (ukf.awake == pf.awake).all(axis=-1).mean(axis=1),
    }
    return found | same


def alone(
    setup: Setup,
    runs: Sequence[int],
    *,
    name: str = FALLBACK,
    kind: str = "ukf",
    waking: Waking = ALWAYS,
    expected: Motion | None = None,
) -> Figures:
    """The figures of a UKF, with a policy of this name."""
    some = figures(setup, followed(setup, name, kind, runs, waking=waking, expected=expected), runs)
    return {f"ukf {what}": each for what, each in some.items()}


def figures(setup: Setup, tracks: Tracks, runs: Sequence[int]) -> dict[str, Array]:
    """``errors`` (R, T, 2), ``bound`` (R, T), ``silent`` and ``orphans`` (R,), and the counts (``counts``).

    Those with ``all`` before their names are of no scheduling in the same runs.
    """
    truth = drawn(setup, runs)
    found = {
        "errors": tracks.errors[..., :2],
        "bound": tracks.bound,
        "silent": tracks.silent.mean(axis=1),
        "orphans": (truth.owner == NOBODY).sum(axis=1).astype(float),
    }
    unscheduled = {f"all {what}": some for what, some in counts_of_all(setup, truth).items()}
    return {**found, **counts(setup, truth, tracks), **unscheduled}


EXPERIMENTS: Final[Mapping[str, Experiment]] = {
    "all": Experiment(partial(policy, PAPER, "all"), batch=5, most=FEW),
    **{name: Experiment(partial(policy, PAPER, name)) for name in POLICIES if name != "all"},
    SCALED: Experiment(partial(alone, PAPER, kind="scaled")),
    SCALED_STRICT: Experiment(partial(alone, PAPER, kind="scaled", name=PAPERS_POLICY)),
    HOUSE: Experiment(partial(alone, PAPER, expected=HOUSE_MOTION)),
    **{name: Experiment(partial(alone, PAPER, waking=waking)) for name, waking in WAKINGS.items()},
    DETECTION: Experiment(partial(alone, NEAR)),
    **{name: Experiment(partial(alone, setup), batch=10, most=SOME) for name, setup in SWEPT.items()},
}


def each_rms(values: Array) -> Array:
    """The root mean square (R,) over the steps of errors (R, T, 2), or of a bound (R, T)."""
    squares = np.square(values)
    return np.asarray(np.sqrt((squares.sum(axis=-1) if values.ndim == 3 else squares).mean(axis=1)))
