"""A user's tracker, whose estimates are checked before they are used."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final, Generic, TypeVar

import numpy as np

from trackfield.errors import RunFailed
from trackfield.filters.gaussian import Motion
from trackfield.filters.types import Array, Estimate, Gaussian, Model, Reports, Tracker

S = TypeVar("S")

_SHAPES: Final = {"mean": (4,), "covariance": (4, 4)}


@dataclass(frozen=True)
class Checked(Generic[S]):
    """``tracker``, with checks that its estimates are finite and of the right shapes, and errors that name it.

    ``step`` raises ``RunFailed`` if they are not, and passes the tracker's own errors on with a note.
    """

    name: str
    tracker: Tracker[S]

    def init(self, prior: Gaussian, model: Model) -> S:
        """See ``Tracker``."""
        return self.tracker.init(prior, model)

    def step(self, state: S, reports: Reports, dt: float, rng: np.random.Generator) -> tuple[S, Estimate]:
        """See ``Tracker``."""
        where = f"tracker '{self.name}', step {reports.step}"
        try:
            after, estimate = self.tracker.step(state, reports, dt, rng)
        except Exception as error:
            error.add_note(f"in {where}, {len(reports)} reports")
            raise
        if not isinstance(estimate, Estimate):
            raise RunFailed(f"{where}: step returned {type(estimate).__name__}; expected a state and an Estimate")
        for what, shape in _SHAPES.items():
            _check(getattr(estimate, what), shape, f"{where}: {what}")
        if estimate.particles is not None:
            _check(estimate.particles, (len(estimate.particles), 2), f"{where}: particles")
        return after, estimate


class CheckedForesees(Checked[S]):
    """The same for a tracker with a method ``motion``, so that its track can be smoothed."""

    def motion(self, before: Any, after: Any, dt: float) -> Motion:
        """See ``trackfield.tracking.smoothing.Foresees``."""
        foresees: Any = self.tracker
        F, Q = foresees.motion(before, after, dt)
        for what, matrix in (("F", F), ("Q", Q)):
            _check(matrix, (4, 4), f"tracker '{self.name}': {what} of its motion")
        return Motion(F, Q)


def checked(name: str, tracker: Tracker[S]) -> Checked[S]:
    """The tracker with its estimates checked, under this name in messages."""
    return CheckedForesees(name, tracker) if hasattr(tracker, "motion") else Checked(name, tracker)


def _check(array: Array, shape: tuple[int, ...], what: str) -> None:
    if not isinstance(array, np.ndarray) or array.shape != shape:
        given = f"of shape {array.shape}" if isinstance(array, np.ndarray) else f"a {type(array).__name__}"
        raise RunFailed(f"{what} is {given}; expected an array of shape {shape}")
    if not np.isfinite(array).all():
        raise RunFailed(f"{what} is not finite: {np.array2string(array, precision=3, threshold=16)}")
