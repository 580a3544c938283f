"""A user's tracker, whose estimates are checked before they are used."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final, Generic, TypeVar

import numpy as np

from trackfield.errors import RunFailed, ScenarioError
from trackfield.filters.belief import Belief, Modes, Particles
from trackfield.filters.gaussian import Motion
from trackfield.filters.types import Array, Estimate, Gaussian, Model, Reports, Tracker

S = TypeVar("S")

STATE: Final = 4
"""The numbers of a state without unknowns."""
_SHARES: Final = 1e-6
"""How far from 1 the sum of weights may be."""


@dataclass(frozen=True)
class Checked(Generic[S]):
    """``tracker``, with checks that its estimates are finite and of ``n`` numbers, and errors that name it.

    ``step`` raises ``RunFailed`` if they are not, and passes the tracker's own errors on with a note.
    """

    name: str
    tracker: Tracker[S]
    n: int

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
        _check(estimate.mean, (self.n,), f"{where}: mean")
        _check(estimate.covariance, (self.n, self.n), f"{where}: covariance")
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
            _check(matrix, (self.n, self.n), f"tracker '{self.name}': {what} of its motion")
        return Motion(F, Q)


class CheckedBelieves(Checked[S]):
    """The same for a tracker with the methods ``belief`` and ``resume``."""

    def belief(self, state: S) -> Belief | None:
        """See ``trackfield.filters.belief.Believes``; raises ``RunFailed`` for what is no belief."""
        believes: Any = self.tracker
        one = believes.belief(state)
        if one is not None:
            _check_belief(one, self.n, f"tracker '{self.name}': its belief")
        return one  # type: ignore[no-any-return]

    def resume(self, belief: Belief, model: Model) -> S:
        """See ``trackfield.filters.belief.Believes``."""
        believes: Any = self.tracker
        try:
            return believes.resume(belief, model)  # type: ignore[no-any-return]
        except Exception as error:
            error.add_note(f"in tracker '{self.name}', as it resumed from {type(belief).__name__}")
            raise


class CheckedForeseesBelieves(CheckedForesees[S], CheckedBelieves[S]):
    """The same for a tracker with all of these methods."""


def checked(name: str, tracker: Tracker[S], n: int) -> Checked[S]:
    """The tracker with its estimates of ``n`` numbers checked, under this name in messages.

    Raises ``ScenarioError`` for a tracker that has one of ``belief`` and ``resume`` without the other.
    """
    foresees, (believes, resumes) = hasattr(tracker, "motion"), (hasattr(tracker, at) for at in ("belief", "resume"))
    if believes is not resumes:
        has, lacks = ("belief", "resume") if believes else ("resume", "belief")
        raise ScenarioError(f"has a method {has} and no {lacks}", key=f"tracker '{name}'", expected="both or neither")
    kinds = {(False, False): Checked, (True, False): CheckedForesees, (False, True): CheckedBelieves}
    return kinds.get((foresees, believes), CheckedForeseesBelieves)(name, tracker, n)


def started(kind: str, fix: object, unknowns: int) -> Gaussian:
    """The start that a kind's ``fix`` returned. Raises ``RunFailed`` unless it is a belief over a state of the kind."""
    what = f"sensor '{kind}': fix"
    if not isinstance(fix, Gaussian):
        raise RunFailed(f"{what} returned {type(fix).__name__}; expected a Gaussian or None")
    n = STATE + unknowns if np.shape(fix.mean) == (STATE + unknowns,) else STATE
    _check(fix.mean, (n,), f"{what}: mean")
    _check(fix.covariance, (n, n), f"{what}: covariance")
    return fix


def _check_belief(belief: object, n: int, what: str) -> None:
    if not isinstance(belief, Gaussian | Modes | Particles):
        raise RunFailed(f"{what} is a {type(belief).__name__}; expected Gaussian, Modes, Particles or None")
    many = () if isinstance(belief, Gaussian) else np.shape(belief[0])[:1] or (1,)
    shapes = {"mean": (n,), "means": (*many, n), "points": (*many, n), "weights": many}
    for part, array in zip(belief._fields, belief, strict=True):
        _check(array, shapes.get(part, (*many, n, n)), f"{what}: {part}")
    if many and ((belief[0] < 0.0).any() or abs(belief[0].sum() - 1.0) > _SHARES):
        raise RunFailed(f"{what}: weights are negative or sum to {belief[0].sum():.6g}; expected 1")


def _check(array: Array, shape: tuple[int, ...], what: str) -> None:
    if not isinstance(array, np.ndarray) or array.shape != shape:
        given = f"of shape {array.shape}" if isinstance(array, np.ndarray) else f"a {type(array).__name__}"
        raise RunFailed(f"{what} is {given}; expected an array of shape {shape}")
    if not np.isfinite(array).all():
        raise RunFailed(f"{what} is not finite: {np.array2string(array, precision=3, threshold=16)}")
