"""Every way to find a path from the reports of an event, on the same trials: what is left of it are its errors."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Final

import numpy as np

from launcher.reproduce.kernels.study import Figures
from launcher.reproduce.papers.yang.solved.rivals import ekf_fit, node_fit
from launcher.reproduce.papers.yang.trials.field import Setup, Trials, trials
from launcher.reproduce.papers.yang.trials.sensitivity import C
from trackfield.filters.passes.bounds import Errors, bound_errors, line_errors
from trackfield.filters.passes.ecpa import Differences, ecpa
from trackfield.filters.passes.geometry import state
from trackfield.filters.passes.solve import solve
from trackfield.filters.passes.types import FIX, Passes, event_of
from trackfield.filters.types import Array

ECPA, ECPA_ALL, PLANE, ML = "ecpa", "ecpa, all strengths", "plane", "ml"
NODE_FIT, EKF = "kalman, places", "ekf"
BOUND: Final = "bound"


def errors_of(trial: Trials, mean: Array) -> Errors:
    """Of states (R, 4); NaN where there is none."""
    return line_errors(mean, trial.truth, trial.places.mean(axis=-2))


def figures_of(name: str, errors: Errors) -> dict[str, Array]:
    """They by name: ``location NAME`` (m), ``speed NAME`` (m/s) and ``heading NAME`` (rad), (R,) each."""
    return {
        f"location {name}": errors.location_m,
        f"speed {name}": errors.speed_m_s,
        f"heading {name}": errors.heading_rad,
    }


def compared(setup: Setup, seeds: Sequence[int]) -> Figures:
    """The errors of all ``SOLVERS`` on the trials of a setup, and the bound on them."""
    trial = trials(setup, seeds)
    found = figures_of(BOUND, bound_errors(trial.truth, trial.passes, sound_m_s=C))
    for name, solver in SOLVERS.items():
        found |= figures_of(name, errors_of(trial, solver(trial.passes)))
    return found


def by(name: str) -> Callable[[Passes], Array]:
    """The solver of this name as trackers use it: it refuses what may be no pass, and knows its covariance."""
    return lambda passes: solve(name, passes, sound_m_s=C).mean


def enhanced(passes: Passes, differences: Differences, sides: Array | None = None, *, location: str = "pair") -> Array:
    """States (R, 4) of ECPA, with some of its ``differences`` from the original, or told the ``sides`` (R, K).

    The algorithm alone, as published: whatever it finds, and no covariance.
    """
    event = event_of(passes)
    with np.errstate(all="ignore"):  # nodes that do not report are at no place
        line, reason = ecpa(event, C, location=location, differences=differences, sides=sides)
    mean = state(line)
    mean[:, :2] += event.centroid
    return np.where(reason[:, None] == FIX, mean, np.nan)


SOLVERS: Final[Mapping[str, Callable[[Passes], Array]]] = {
    ECPA: lambda passes: enhanced(passes, Differences()),
    ECPA_ALL: lambda passes: enhanced(passes, Differences(), location="all"),
    PLANE: by(PLANE),
    ML: by(ML),
    NODE_FIT: node_fit,
    EKF: ekf_fit,
}
"""From reports to states (R, 4), by name."""
