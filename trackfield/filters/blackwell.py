"""What the Rao-Blackwellised trackers have in common: a start, a step around a pure function, beliefs, motion.

The pure function is ``advance``; all arrays that it takes and returns may have leading axes of runs.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from math import radians
from typing import Annotated, ClassVar, Literal, NamedTuple

import numpy as np

from trackfield.filters.belief import Belief, Modes, moments
from trackfield.filters.gaussian import Motion
from trackfield.filters.needs import POSITIONS
from trackfield.filters.particles import Particles
from trackfield.filters.rao_blackwell import Cloud, Draws, Start, begin, by_mode, foreseen
from trackfield.filters.turning import STRAIGHT, Turns, evenly_spread, left_and_right
from trackfield.filters.types import Estimate, Gaussian, Model, Reports
from trackfield.options import Within

Chance = Annotated[float, Within(0, 0.5)]
Degrees = Annotated[float, Within(0, 180)]


class BlackwellState(NamedTuple):
    """``cloud`` is None before the first step: then there is only the prior, one Gaussian or one for each mode."""

    model: Model
    prior: Modes
    cloud: Cloud | None


@dataclass(frozen=True)
class Blackwell(ABC):
    """Rao-Blackwellised particle filter: positions in ``particles``, their velocities by Kalman filters.

    ``q`` (m^2/s^3) is the density of the acceleration's noise; 0: that of ``sigma_v``, held over a step. After
    ``silent`` steps without reports the particles start anew around the loudest sensors; 0: never.
    ``robust``: the weights know that readings may be outliers.
    """

    needs: ClassVar[tuple[str, ...]] = (POSITIONS,)

    particles: Particles = 500
    q: Annotated[float, Within(0, 1e6)] = 0.0
    silent: Annotated[int, Within(0, 10_000)] = 0
    robust: bool = False

    @property
    def turns(self) -> Turns:
        """The modes of motion that it knows."""
        return STRAIGHT

    @property
    def stratified(self) -> bool:
        """Whether modes are drawn evenly over the particles."""
        return True

    @abstractmethod
    def advance(
        self, cloud: Cloud, reports: Reports, model: Model, dt: float, draws: Draws, again: Draws
    ) -> tuple[Cloud, Gaussian]:
        """The particles ``dt`` seconds later, and the belief before they are resampled.

        ``again`` are the draws of a filter that draws twice (``looks``); the same object for any other.
        """

    looks: ClassVar[int] = 1
    """How many times it draws in a step."""

    def density(self, model: Model, dt: float) -> float:
        """m^2/s^3 of the acceleration's noise: after ``dt`` seconds the velocity's variance is that times ``dt``."""
        return self.q or model.sigma_v**2 * dt

    def init(self, prior: Gaussian, model: Model) -> BlackwellState:
        """The state of belief ``prior``; particles are drawn in the first step."""
        return BlackwellState(model, one(prior), None)

    def step(
        self, state: BlackwellState, reports: Reports, dt: float, rng: np.random.Generator
    ) -> tuple[BlackwellState, Estimate]:
        """Move, weight by the readings, resample; without reports move only."""
        model, prior, cloud = state
        if cloud is None:
            cloud = begin(prior, self.start(rng, model), self.turns)
        draws = [self.draws(rng, model) for _ in range(self.looks)]
        cloud, posterior = self.advance(cloud, reports, model, dt, draws[0], draws[-1])
        return BlackwellState(model, prior, cloud), Estimate(*posterior, cloud.points[:, :2])

    def start(self, rng: np.random.Generator, model: Model) -> Start:
        """The random numbers of a start."""
        n = self.particles
        return Start(rng.random(), rng.random(n), rng.standard_normal((n, model.dimension - 1)))

    def draws(self, rng: np.random.Generator, model: Model) -> Draws:
        """The random numbers of a step, or of one look of it."""
        n, turns, modes = self.particles, self.turns, np.zeros(self.particles)
        if len(turns.rates) > 1:
            modes = evenly_spread(n, rng) if self.stratified else rng.random(n)
        rates = rng.random(n) if turns.most else np.zeros(n)
        return Draws(modes, rates, rng.standard_normal((n, model.dimension - 2)), rng.random())

    def belief(self, state: BlackwellState) -> Belief | None:
        """A Gaussian for each of its modes; None if it has one mode only: its estimate says it."""
        if len(self.turns.rates) == 1:
            return None
        if state.cloud is None:
            return state.prior if len(state.prior.weights) > 1 else None
        return by_mode(state.cloud)

    def resume(self, belief: Belief, model: Model) -> BlackwellState:
        """As many modes as it has are those of its own; of any other belief it takes mean and covariance."""
        if isinstance(belief, Modes) and len(belief.weights) == len(self.turns.rates):
            return BlackwellState(model, belief, None)
        return self.init(moments(belief), model)

    def motion(self, before: BlackwellState, after: BlackwellState, dt: float) -> Motion:
        """The motion between two states, ``dt`` seconds apart, with the rates that particles had after it."""
        assert after.cloud is not None
        then = before.prior.means[0] if before.cloud is None else before.cloud.points.mean(axis=0)
        return foreseen(then, after.cloud.rate, after.model, dt, self.density(after.model, dt))


@dataclass(frozen=True)
class Turning(Blackwell):
    """The same with three modes: straight ahead, ``left_deg_s`` to the left, ``right_deg_s`` to the right.

    ``enter`` is the chance in a step that either turn begins, ``leave`` that it ends, ``swap`` that it changes sides.
    ``draw`` says how modes are drawn: evenly over the particles, or for each by itself.
    """

    left_deg_s: Degrees = 30.0
    right_deg_s: Degrees = 30.0
    enter: Chance = 0.1
    leave: Chance = 0.4
    swap: Chance = 0.1
    draw: Literal["stratified", "multinomial"] = "stratified"

    @property
    def turns(self) -> Turns:
        """See ``Blackwell``."""
        return left_and_right(radians(self.left_deg_s), radians(self.right_deg_s), self.enter, self.leave, self.swap)

    @property
    def stratified(self) -> bool:
        """See ``Blackwell``."""
        return self.draw == "stratified"


def one(prior: Gaussian) -> Modes:
    """A Gaussian (..., n) as the only one of a mixture."""
    return Modes(np.ones((*prior.mean.shape[:-1], 1)), prior.mean[..., None, :], prior.covariance[..., None, :, :])
