"""How often the original and the enhanced algorithm find a path, and why the original fails (Yang et al., sec. 6.1)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from launcher.reproduce.kernels.study import Figures
from launcher.reproduce.papers.yang.scores import right
from launcher.reproduce.papers.yang.solved.solving import ECPA, enhanced, errors_of, figures_of
from launcher.reproduce.papers.yang.trials.field import Setup, Trials, trials
from launcher.reproduce.papers.yang.trials.sensitivity import C
from trackfield.filters.passes.ecpa import Differences
from trackfield.filters.passes.solve import solve_cpa
from trackfield.filters.passes.types import Solved
from trackfield.filters.types import Array

ASSUMED, ANY, UNREFERRED, BY_TIMES = "division assumed", "any nodes", "no reference", "located by times"
WITHOUT: Final = {
    ASSUMED: Differences(divides=False),
    ANY: Differences(selects=False),
    UNREFERRED: Differences(refers=False),
    BY_TIMES: Differences(by_strength=False),
}
"""ECPA without one of its four differences from the original algorithm (sec. 3.3.3). It assumes that the first node is
alone on one side of the path; it takes the first nodes that it may; it takes the first angle that gives r > 0; it
takes the r of the times."""
TOLD: Final = "division told"
"""ECPA that is told how the path divides the nodes."""


def success(setup: Setup, seeds: Sequence[int]) -> Figures:
    """How often the algorithms find a path, of these trials.

    ``cpa accepted``, ``cpa right`` and ``cpa reason`` of the original algorithm, which is told how the path divides the
    nodes; a reason is a number of ``trackfield.filters.passes.types.REASONS``. ``ecpa in hull``, and ``right NAME`` and
    the errors of ECPA, and of it without one of its differences. (R,) each.
    """
    trial = trials(setup, seeds)
    found = _original(trial)
    mean = enhanced(trial.passes, Differences())
    found |= {"ecpa in hull": _crosses(trial, mean).astype(float), **_figures(trial, ECPA, mean)}
    assumed = np.where(np.arange(setup.nodes) == 0, 1.0, -1.0) * np.ones((len(seeds), 1))
    for name, differences in WITHOUT.items():
        mean = enhanced(trial.passes, differences, assumed if name == ASSUMED else None)
        found |= _figures(trial, name, mean)
    return found | _figures(trial, TOLD, enhanced(trial.passes, Differences(divides=False), sides(trial)))


def _figures(trial: Trials, name: str, mean: Array) -> dict[str, Array]:
    errors = errors_of(trial, mean)
    good = right(errors.location_m, errors.heading_rad).astype(float)
    return {f"right {name}": good, **figures_of(name, errors)}


def _crosses(trial: Trials, mean: Array) -> Array:
    """Whether paths (R,) have nodes on both sides."""
    aside = sides_of(mean, trial.passes.places)
    return np.asarray((aside > 0).any(axis=-1) & (aside < 0).any(axis=-1))


def _original(trial: Trials) -> dict[str, Array]:
    original = cpa_fits(trial)
    errors = errors_of(trial, original.mean)
    return {
        "cpa accepted": (original.reason == 0).astype(float),
        "cpa right": right(errors.location_m, errors.heading_rad).astype(float),
        "cpa reason": original.reason.astype(float),
    }


def cpa_fits(trial: Trials) -> Solved:
    """What the original algorithm finds if it knows on which side of the path each node is."""
    return solve_cpa(trial.passes, sound_m_s=C, sides=sides(trial))


def sides(trial: Trials) -> Array:
    """(R, K): on which side of the true path each node is."""
    return sides_of(trial.truth, trial.places)


def sides_of(mean: Array, places: Array) -> Array:
    """(R, K): 1 for ``places`` (R, K, 2) on the right of a path through ``mean`` (R, 4), -1 for those on the left."""
    away, velocity = places - mean[:, None, :2], mean[:, None, 2:]
    return np.asarray(np.sign(away[..., 0] * velocity[..., 1] - away[..., 1] * velocity[..., 0]))
