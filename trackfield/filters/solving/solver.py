"""Trackers that solve for the path of a target from the reports of an event (``trackfield/filters/passes``).

An event is a target that passes a cluster of sensors (``events.py``). When it is over its reports are solved for the
target's position and velocity, the *fix* (Yang et al., section 3). Between events the fix is predicted at constant
velocity, with more and more covariance; the next fix replaces it. Reports that give none say why, and the fix before
them stays.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Final, Literal, NamedTuple

import numpy as np

from trackfield.filters.belief import repaired
from trackfield.filters.gaussian import constant_velocity, predict, symmetric
from trackfield.filters.needs import PASSES
from trackfield.filters.parts import OWN
from trackfield.filters.passes.solve import solve
from trackfield.filters.passes.types import FEW, FIX, REASONS, Passes, Solved
from trackfield.filters.solving.events import Ended, Event, Events, Pass, mean_time_s, passes_of
from trackfield.filters.types import Estimate, Gaussian, Model, Reports
from trackfield.models.passing import distances
from trackfield.options import Within

PER_DB: Final = math.log(10.0) / 20.0
"""The natural logarithm of an amplitude, per dB."""
Seconds = Annotated[float, Within(0.1, 600)]


class Fix(NamedTuple):
    """What an event told: the ``belief`` (4,), predicted to the instant of the state, ``age_s`` after that ended."""

    belief: Gaussian
    age_s: float


class Closed(NamedTuple):
    """An event that ended in this step, ``passes`` are its reports, and what came of it.

    ``time_s``, relative to the step's instant, is when the target was nearest to the middle of the sensors; without a
    fix the mean of the reports' times. ``refused`` says why there is no fix; empty: there is one, of the reports that
    were ``used``.
    """

    time_s: float
    refused: str
    passes: tuple[Pass, ...]
    used: tuple[bool, ...]


class Solving(NamedTuple):
    """The state of a solver: its model, the event that is gathered, the last fix, what ended in this very step."""

    model: Model
    event: Event = Event()
    fix: Fix | None = None
    closed: Closed | None = None


@dataclass(frozen=True)
class Solver:
    """Solves for the target's path from the reports of each event, and predicts it from there.

    An event is over ``close_s`` after its last report if there are ``least``, at ``most`` reports, and when all sensors
    have reported; reports more than ``apart_s`` apart are of different events. Reports whose chi^2 is above ``gate``
    are not those of a pass. A fix is predicted for ``hold_s`` after its event ended.
    """

    needs: ClassVar[tuple[str, ...]] = ("one kind", PASSES)
    solver: ClassVar[Literal["cpa", "ecpa", "ml"]] = "ml"

    close_s: Seconds = 1.5
    most: Annotated[int, Within(3, 64)] = 8
    least: Annotated[int, Within(3, 64)] = 4
    apart_s: Seconds = 5.0
    hold_s: Seconds = 7.0
    gate: Annotated[float, Within(1, 1e6)] = 20.5

    def begin(self, model: Model) -> Solving:
        """The state before the first report."""
        return Solving(model)

    def init(self, prior: Gaussian, model: Model) -> Solving:
        """The state of belief ``prior``, which is taken for a fix."""
        return Solving(model, fix=Fix(Gaussian(prior.mean[:OWN], prior.covariance[:OWN, :OWN]), 0.0))

    def step(
        self, state: Solving, reports: Reports, dt: float, rng: np.random.Generator
    ) -> tuple[Solving, Estimate | None]:
        """Predict the fix, gather the reports, and solve for the path of an event that is over; no random draws."""
        model, fix, closed = state.model, self._held(state, dt), None
        events = Events(self.close_s, self.apart_s, self.least, self.most, model.sensors)
        gathered = events.step(
            state.event, passes_of(reports), dt, lambda passes: not self._solved(model, passes).reason
        )
        for ended in gathered.ended:
            outcome, found = self._solve(model, ended, dt)
            if found is not None or not ended.again:
                fix, closed = found or fix, outcome
        return Solving(model, gathered.event, fix, closed), None if fix is None else Estimate(*fix.belief)

    def closed(self, state: Solving) -> Closed | None:
        """The event that ended in the step that led to this state."""
        return state.closed

    def _held(self, state: Solving, dt: float) -> Fix | None:
        """The fix ``dt`` seconds later, unless it is too old."""
        if state.fix is None or state.fix.age_s + dt > self.hold_s:
            return None
        return Fix(predict(state.fix.belief, constant_velocity(dt, state.model.sigma_v)), state.fix.age_s + dt)

    def _solve(self, model: Model, ended: Ended, dt: float) -> tuple[Closed, Fix | None]:
        """The path of an event, predicted to the instant of its state; None if there is none."""
        passes = ended.passes
        found = self._solved(model, passes) if len(passes) >= self.least else None
        if found is None or found.reason:
            reason = REASONS[FEW if found is None else int(found.reason)]
            return Closed(mean_time_s(passes), reason, passes, (False,) * len(passes)), None
        time_s = float(found.time_s)
        belief = Gaussian(found.mean, repaired(symmetric(found.covariance)))
        closed = Closed(time_s, "", passes, tuple(found.used.tolist()))
        return closed, Fix(ahead(belief, -time_s, dt, model.sigma_v), 0.0)

    def _solved(self, model: Model, passes: tuple[Pass, ...]) -> Solved:
        """The solution; with the noise that the sensors say, if they do."""
        given = problem(passes, model)
        return self.solved(model, given)[1] if np.isnan(passes[0].time_sd_s) else self._once(model, given, self.gate)

    def solved(self, model: Model, given: Passes) -> tuple[Passes, Solved]:
        """The solutions of events (..., K), with the reports as they were taken.

        If the noise of times depends on the path, they are second ones, with that of the first. In the first ones all
        times have the noise of one distance, and far ones may be off by many of its deviations: so they count whatever
        their fit is.
        """
        noise = model.sensor.passes
        assert noise is not None
        if not (noise.distance_power or noise.speed_power):
            return given, self._once(model, given, self.gate)
        found = self._once(model, given, math.inf)
        fixed = found.reason == FIX
        if not fixed.any():
            return given, found
        away, speed = distances(found.mean, given.places), np.hypot(found.mean[..., 2], found.mean[..., 3])
        time_sd_s = noise.time_sd(away, speed[..., None], larger=np.maximum)
        given = given._replace(time_sd_s=np.where(fixed[..., None], time_sd_s, given.time_sd_s))
        again = self._once(model, given, self.gate)
        which = (fixed, fixed[..., None], fixed[..., None, None], fixed[..., None], fixed)
        both: tuple[tuple[Any, ...], tuple[Any, ...]] = again, found
        return given, Solved(*(np.where(*parts) for parts in zip(which, *both, strict=True)))

    def _once(self, model: Model, passes: Passes, gate: float) -> Solved:
        with np.errstate(all="ignore"):  # of reports that are refused
            return solve(self.solver, passes, sound_m_s=model.sensor.speed_m_s, gate=gate, least=self.least)


class Cpa(Solver):
    """Yang's original closest point of approach: exact for three sensors on one side of the path and one on the other.

    See ``Solver`` for the options.
    """

    solver: ClassVar[Literal["cpa", "ecpa", "ml"]] = "cpa"


class Ecpa(Solver):
    """Enhanced closest point of approach: sides by the slope of the times, the candidate nearest to it, a guard."""

    solver: ClassVar[Literal["cpa", "ecpa", "ml"]] = "ecpa"


class Ml(Solver):
    """Maximum likelihood over times, strengths and places of all reports of an event, one bad report left out."""


def ahead(belief: Gaussian, seconds: float, dt: float, sigma_v: float) -> Gaussian:
    """A belief so many ``seconds`` later, predicted step by step as others are; before its time in one step."""
    steps = max(math.floor(seconds / dt), 0)
    belief = predict(belief, constant_velocity(seconds - steps * dt, sigma_v))
    for _ in range(steps):
        belief = predict(belief, constant_velocity(dt, sigma_v))
    return belief


def problem(passes: tuple[Pass, ...], model: Model) -> Passes:
    """The reports of an event as the solvers take them (K,); their noise is what sensors say, or else the kind's."""
    noise = model.sensor.passes
    assert noise is not None
    numbers = np.array([one[1:] for one in passes], float)
    times, strength_db, _, time_sd_s, strength_sd_db = numbers[:, 2:].T
    return Passes(
        numbers[:, :2],
        times,
        np.exp(PER_DB * strength_db),
        np.where(np.isnan(time_sd_s), noise.time_sd_s, time_sd_s),
        np.where(np.isnan(strength_sd_db), noise.strength_sd, PER_DB * strength_sd_db),
        noise.place_sd_m,
    )
