"""What users' trackers hand on, and how they go on: as they say, or not at all; what is no belief is refused."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from tests.sensing import silence
from tests.zhai_field import MODEL
from trackfield.errors import RunFailed, ScenarioError
from trackfield.filters.belief import Belief, Believes, Modes, Particles, moments
from trackfield.filters.checked import checked
from trackfield.filters.rng import generator
from trackfield.filters.types import Estimate, Gaussian, Model, Reports
from trackfield.tracking.following import Following
from trackfield.tracking.smoothing import Foresees

WIDE = Gaussian(np.array([200.0, 200.0, 0.0, 0.0]), np.diag([900.0, 900.0, 25.0, 25.0]))


@dataclass(frozen=True)
class Plain:
    """A user's tracker that says where the target was at the start."""

    def init(self, prior: Gaussian, model: Model) -> Gaussian:
        return prior

    def step(self, state: Gaussian, reports: Reports, dt: float, rng: np.random.Generator) -> tuple[Gaussian, Estimate]:
        return state, Estimate(*state)


@dataclass(frozen=True)
class Knowing(Plain):
    """One that hands on ``given``."""

    given: Any = None

    def belief(self, state: Gaussian) -> Any:
        return self.given

    def resume(self, belief: Belief, model: Model) -> Gaussian:
        if isinstance(belief, Particles):
            raise IndexError("no particles here")
        return moments(belief)


class Moving(Knowing):
    """One that can be smoothed, too."""

    def motion(self, before: Any, after: Any, dt: float) -> Any:
        raise NotImplementedError


@pytest.mark.parametrize(
    ("tracker", "believes", "foresees"), [(Plain(), False, False), (Knowing(), True, False), (Moving(), True, True)]
)
def test_a_users_tracker_needs_neither_method_and_may_have_both(tracker: Any, believes: bool, foresees: bool) -> None:
    one = checked("mine", tracker, 4)
    assert (isinstance(one, Believes), isinstance(one, Foresees)) == (believes, foresees)
    following = Following(one, MODEL)
    state, estimate = following.step(following.resume(WIDE), silence(1), 1.0, generator(1, "x", 1))
    assert estimate is not None
    belief = following.belief(state)
    assert isinstance(belief, Gaussian)
    assert (belief.mean == WIDE.mean).all()


GOOD = (
    WIDE,
    Modes(np.array([0.5, 0.5]), np.zeros((2, 4)), np.tile(np.eye(4), (2, 1, 1))),
    Particles(np.ones(1), np.zeros((1, 4))),
)


@pytest.mark.parametrize("given_belief", GOOD)
def test_what_a_users_tracker_knows_is_handed_on(given_belief: Belief) -> None:
    following = Following(checked("mine", Knowing(given_belief), 4), MODEL)
    assert following.belief(following.begin(WIDE)) is given_belief


def broken(belief: Any, part: int, array: Any) -> Any:
    return type(belief)(*(array if i == part else one for i, one in enumerate(belief)))


@pytest.mark.parametrize(
    ("given_belief", "says"),
    [
        ((WIDE.mean, WIDE.covariance), "is a tuple; expected Gaussian, Modes, Particles or None"),
        (broken(WIDE, 0, np.zeros(5)), r"mean is of shape \(5,\); expected an array of shape \(4,\)"),
        (broken(WIDE, 1, np.eye(3)), r"covariance is of shape \(3, 3\); expected an array of shape \(4, 4\)"),
        (broken(WIDE, 1, np.full((4, 4), np.nan)), "covariance is not finite"),
        (broken(GOOD[1], 0, np.array([0.5, 0.6])), "weights are negative or sum to 1.1; expected 1"),
        (broken(GOOD[1], 0, np.array([1.5, -0.5])), "weights are negative or sum to 1; expected 1"),
        (broken(GOOD[1], 1, np.zeros((3, 4))), r"means is of shape \(3, 4\); expected an array of shape \(2, 4\)"),
        (broken(GOOD[1], 0, np.float64(1.0)), "weights is a float64; expected"),
        (Particles(np.empty(0), np.empty((0, 4))), "weights are negative or sum to 0; expected 1"),
        (broken(GOOD[2], 1, [[0.0] * 4]), "points is a list; expected an array"),
    ],
)
def test_what_is_no_belief_ends_the_run_with_the_trackers_name(given_belief: Any, says: str) -> None:
    following = Following(checked("mine", Knowing(given_belief), 4), MODEL)
    with pytest.raises(RunFailed, match=f"tracker 'mine': its belief:? ?{says}"):
        following.belief(following.begin(WIDE))


def test_an_error_of_its_own_says_where_it_was() -> None:
    following = Following(checked("mine", Knowing(), 4), MODEL)
    with pytest.raises(IndexError) as error:
        following.resume(GOOD[2])
    assert error.value.__notes__ == ["in tracker 'mine', as it resumed from Particles"]


@pytest.mark.parametrize(("has", "lacks"), [("belief", "resume"), ("resume", "belief")])
def test_one_method_without_the_other_is_an_error(has: str, lacks: str) -> None:
    half = type("Half", (Plain,), {has: lambda *_: None})
    with pytest.raises(ScenarioError, match=f"tracker 'mine': has a method {has} and no {lacks}; expected both or"):
        checked("mine", half(), 4)
