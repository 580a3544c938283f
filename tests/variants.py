"""Variants of the default tracker, which ``tests.readiness`` compares with it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Final, NamedTuple

import numpy as np

from trackfield.filters import imm
from trackfield.filters.belief import Belief, Modes
from trackfield.filters.fix import map_fix
from trackfield.filters.gaussian import Motion, constant_velocity
from trackfield.filters.imm_ukf import ImmUkf, ImmUkfState, _Plan, _Readings
from trackfield.filters.measurement import widened
from trackfield.filters.types import Array, Estimate, Gaussian, Model, Reports, Update
from trackfield.models import motion
from trackfield.models.unknowns import Unknown

Rows = tuple[tuple[float, ...], ...]

FORMER: Final[Rows] = ((0.97, 0.02, 0.01), (0.1, 0.88, 0.02), (0.0, 0.002, 0.998))
"""Switching with one quiet model: from and to quiet, manoeuvring, standing."""
NOW: Final[Rows] = tuple(map(tuple, ImmUkf()._switching.tolist()))


def one_quiet(enter: float = 0.02, leave: float = 0.1) -> Rows:
    """``FORMER`` with other chances that a manoeuvre begins and ends."""
    return ((0.99 - enter, enter, 0.01), (leave, 0.98 - leave, 0.02), FORMER[2])


def steady(stay: float = 0.995, back: float = 0.02, enter: float = 0.05) -> Rows:
    """``NOW`` with other chances to stay steady, to become steady again, and that a manoeuvre begins."""
    return ((stay, 1.0 - stay, 0.0, 0.0), (back, 0.99 - back - enter, enter, 0.01), *NOW[2:])


def tempers(calm: Rows, lively: Rows, change: float) -> Rows:
    """Two chains side by side, with a chance in each step to go to the other."""
    a, b = np.array(calm), np.array(lively)
    both = np.block([[a * (1.0 - change), a * change], [b * change, b * (1.0 - change)]])
    return tuple(map(tuple, both.tolist()))


@lru_cache(maxsize=256)
def motions(dt: float, unknowns: tuple[Unknown, ...], sds: tuple[float, ...]) -> Motion:
    """Nearly constant velocity with these accelerations (sd, m/s^2); a negative one stands for a target that stands."""
    still = Motion(np.array(motion.standing_transition()), np.array(motion.standing_noise(dt, 0.5)))
    models = [still if sd < 0.0 else constant_velocity(dt, sd) for sd in sds]
    return Motion(*(np.stack(each) for each in zip(*(widened(m, unknowns, dt) for m in models), strict=True)))


@dataclass(frozen=True)
class Variant(ImmUkf):
    """The default tracker with other models (``sds`` as of ``motions``) and other ``switching``."""

    sds: tuple[float, ...] = (0.1, 1.5, -1.0)
    switching: Rows = FORMER

    @property
    def _switching(self) -> Array:
        return np.array(self.switching)

    def _motions(self, dt: float, model: Model) -> Motion:
        return motions(dt, model.unknowns, self.sds)


FOUR: Final = (0.1, 0.1, 1.5, -1.0)


@dataclass(frozen=True)
class Shared(Variant):
    """One fix at the start for all models, from their common belief, in place of a fix for each."""

    def _plan(self, state: ImmUkfState, bank: imm.Bank, reports: Reports) -> _Plan:
        plan = super()._plan(state, bank, reports)
        if state.fixed:
            return plan
        readings = _Readings(bank, reports, state.model, self.robust)

        def take(which: Any) -> Update:
            (mean, covariance), _ = map_fix(imm.combined(bank), reports.only(which), state.model)
            m = len(bank.probability)
            return Update(
                Gaussian(np.tile(mean, (m, 1)), np.tile(covariance, (m, 1, 1))), readings.fix(which).log_evidence
            )

        return plan._replace(take=take)


@dataclass(frozen=True)
class Settled(Variant):
    """At the start the models are as probable as they are in the long run."""

    def init(self, prior: Gaussian, model: Model) -> ImmUkfState:
        state = super().init(prior, model)
        long = np.linalg.matrix_power(self._switching, 10_000)[0]
        return state._replace(bank=state.bank._replace(probability=long))


@dataclass(frozen=True)
class Fading(Variant):
    """With each step the past counts ``memory`` times as much (Sorenson & Sacks 1971)."""

    memory: float = 0.9

    def step(self, state: ImmUkfState, reports: Reports, dt: float, rng: Any) -> tuple[ImmUkfState, Estimate]:
        bank = state.bank._replace(covariance=state.bank.covariance / self.memory)
        return super().step(state._replace(bank=bank), reports, dt, rng)


class Learnt(NamedTuple):
    """A tracker's state, and what it has learnt so far."""

    state: ImmUkfState
    learnt: Any


@dataclass(frozen=True)
class Learning(Variant):
    """A tracker whose models and switching depend on what it has learnt."""

    def begun(self) -> Any:
        """Before the first step."""
        raise NotImplementedError

    def by(self, learnt: Any) -> Variant:
        """The tracker of the next step."""
        raise NotImplementedError

    def learn(self, learnt: Any, before: imm.Bank, after: imm.Bank, dt: float) -> Any:
        """After a step."""
        raise NotImplementedError

    def init(self, prior: Gaussian, model: Model) -> Any:
        return Learnt(super().init(prior, model), self.begun())

    def belief(self, state: Any) -> Modes:
        return super().belief(state.state)

    def resume(self, belief: Belief, model: Model) -> Any:
        return Learnt(Variant(sds=self.sds, switching=self.switching).resume(belief, model), self.begun())

    def motion(self, before: Any, after: Any, dt: float) -> Motion:
        return self.by(before.learnt).motion(before.state, after.state, dt)

    def step(self, state: Any, reports: Reports, dt: float, rng: Any) -> tuple[Any, Estimate]:
        after, estimate = self.by(state.learnt).step(state.state, reports, dt, rng)
        return Learnt(after, self.learn(state.learnt, state.state.bank, after.bank, dt)), estimate


@dataclass(frozen=True)
class Adaptive(Learning):
    """The acceleration of the quiet model is that of the last ``window`` steps (Myers & Tapley 1976).

    By how much its velocity changed in each, squared, less what the change of its variance explains.
    """

    window: int = 10

    def begun(self) -> Any:
        return ()

    def by(self, learnt: Any) -> Variant:
        found = float(np.mean(learnt)) if len(learnt) == self.window else self.sds[0] ** 2
        sd = round(float(np.sqrt(np.clip(found, 0.05**2, self.sds[-2] ** 2))), 2)
        return Variant(sds=(sd, *self.sds[1:]), switching=self.switching)

    def learn(self, learnt: Any, before: imm.Bank, after: imm.Bank, dt: float) -> Any:
        changed = np.square(after.mean[0, 2:4] - before.mean[0, 2:4])
        variance = (before.covariance - after.covariance)[0, [2, 3], [2, 3]]
        return (*learnt, float((changed - variance).mean()) / dt**2)[-self.window :]


@dataclass(frozen=True)
class Counting(Learning):
    """Switching is learnt: the given one counts like ``worth`` steps, and each step adds the expected transitions.

    The quasi-Bayesian estimate of Jilkov & Li (2004).
    """

    worth: float = 50.0

    def begun(self) -> Any:
        return np.array(self.switching) * self.worth

    def by(self, learnt: Any) -> Variant:
        rows = learnt / learnt.sum(axis=1, keepdims=True)
        return Variant(sds=self.sds, switching=tuple(map(tuple, rows.tolist())))

    def learn(self, learnt: Any, before: imm.Bank, after: imm.Bank, dt: float) -> Any:
        joint = before.probability[:, None] * (learnt / learnt.sum(axis=1, keepdims=True))
        return learnt + joint * (after.probability / joint.sum(axis=0))


CALM: Final[Rows] = ((0.995, 0.004, 0.001), (0.1, 0.88, 0.02), (0.0, 0.002, 0.998))
LIVELY: Final[Rows] = ((0.92, 0.06, 0.02), (0.08, 0.9, 0.02), (0.0, 0.004, 0.996))

THREE_MOVE: Final[Rows] = (
    (0.96, 0.03, 0.005, 0.005),
    (0.05, 0.89, 0.05, 0.01),
    (0.02, 0.08, 0.88, 0.02),
    (0.0, 0.001, 0.001, 0.998),
)

VARIANTS: Final[Mapping[str, ImmUkf]] = {
    "`imm-ukf`": ImmUkf(),
    "one quiet model": Variant(),
    "- quiet 0.05 m/s^2": Variant(sds=(0.05, 1.5, -1.0)),
    "- quiet 0.2": Variant(sds=(0.2, 1.5, -1.0)),
    "- quiet 0.3": Variant(sds=(0.3, 1.5, -1.0)),
    "- manoeuvres of 1 m/s^2": Variant(sds=(0.1, 1.0, -1.0)),
    "- manoeuvres of 2": Variant(sds=(0.1, 2.0, -1.0)),
    "- manoeuvres begin at 0.01 a step": Variant(switching=one_quiet(0.01)),
    "- begin at 0.05": Variant(switching=one_quiet(0.05)),
    "- manoeuvres end at 0.2 a step": Variant(switching=one_quiet(leave=0.2)),
    "- none stands": Variant(sds=(0.1, 1.5), switching=((0.98, 0.02), (0.1, 0.9))),
    "- another of 0.5, manoeuvres of 2": Variant(
        sds=(0.1, 0.5, 2.0, -1.0),
        switching=(
            (0.96, 0.03, 0.005, 0.005),
            (0.05, 0.89, 0.05, 0.01),
            (0.02, 0.08, 0.88, 0.02),
            (0, 0.001, 0.001, 0.998),
        ),
    ),
    "- adaptive noise": Adaptive(),
    "- fading memory": Fading(),
    "- switching learnt": Counting(),
    "- two chains, calm and lively": Variant(sds=(0.1, 1.5, -1.0) * 2, switching=tempers(CALM, LIVELY, 0.002)),
    "- one fix for all models": Shared(),
    "- started as in the long run": Settled(),
    "- `robust`": Variant(robust=True),
    "- no `gate`": Variant(gate=False),
    "- steady for 100 steps": Variant(sds=FOUR, switching=steady(0.99)),
    "- for 500": Variant(sds=FOUR, switching=steady(0.998)),
    "- steady again at 0.01 a step": Variant(sds=FOUR, switching=steady(back=0.01)),
    "- steady again at 0.05": Variant(sds=FOUR, switching=steady(back=0.05)),
    "- begin at 0.1 a step": Variant(sds=FOUR, switching=steady(enter=0.1)),
    "- begin at 0.025": Variant(sds=FOUR, switching=steady(enter=0.025)),
    "- with adaptive noise": Adaptive(sds=FOUR, switching=NOW),
    "- with `robust`": Variant(sds=FOUR, switching=NOW, robust=True),
}
