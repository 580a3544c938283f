"""Beliefs over a state with an unknown of the sensing: of five numbers, or of the four that others know."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tests.test_filters_resuming import sent
from tests.test_own_trackers_resuming import Knowing, broken
from trackfield.errors import RunFailed
from trackfield.filters.belief import Belief, Modes, Particles, dimension
from trackfield.filters.bootstrap import Bootstrap
from trackfield.filters.checked import checked
from trackfield.filters.trackers import make_tracker
from trackfield.filters.types import Array, Gaussian, Model, Reports
from trackfield.models.unknowns import Unknown
from trackfield.sensing.complete import Kind
from trackfield.sensing.kinds import SENSORS
from trackfield.tracking.bank import Bank
from trackfield.tracking.following import Following


class Ruler:
    """Measures x and y with an error that is the same for both: the unknown."""

    range_m = 100.0
    sd = (1.0, 1.0)
    resolution = (0.01, 0.01)
    unknowns = (Unknown("error", sd=2.0, mean=0.5),)

    def simulate(self, target: Any, position: Any, normals: Any) -> Any:
        raise NotImplementedError

    def h(self, states: Array, positions: Array) -> Array:
        return (states[..., None, :2] + states[..., None, 4:5]) * np.ones((len(positions), 1))

    def jacobian(self, states: Array, positions: Array) -> Array:
        slopes = np.array([[1.0, 0.0, 0.0, 0.0, 1.0], [0.0, 1.0, 0.0, 0.0, 1.0]])
        return np.broadcast_to(slopes, (*states.shape[:-1], len(positions), 2, 5))


MODEL = Model({"ruler": Kind("ruler", Ruler())}, 0.1)
FOUR = Gaussian(np.array([1.0, 2.0, 3.0, 4.0]), np.diag([4.0, 4.0, 1.0, 1.0]))
FIVE = Gaussian(np.array([1.0, 2.0, 3.0, 4.0, -1.0]), np.diag([4.0, 4.0, 1.0, 1.0, 0.25]) + 0.01)
SILENCE = Reports(1, (), np.empty((0, 2)), ())


@pytest.mark.parametrize("name", ["ekf", "ukf", "bootstrap", "predict-only"])
def test_all_five_numbers_travel(name: str) -> None:
    following = Following(make_tracker(name), MODEL)
    state, _ = following.step(following.begin(FIVE), SILENCE, 1.0, np.random.default_rng(1))
    belief = following.belief(state)
    assert isinstance(belief, Gaussian)
    assert dimension(belief) == 5
    resumed = following.resume(sent(belief))
    again = following.belief(resumed)
    assert isinstance(again, Gaussian)
    assert again.mean == pytest.approx(belief.mean, rel=1e-6)
    assert again.covariance == pytest.approx(belief.covariance, rel=1e-5, abs=1e-6)
    _, estimate = following.step(resumed, SILENCE, 1.0, np.random.default_rng(1))
    assert estimate is not None
    assert estimate.mean.shape == (5,)


def test_particles_too() -> None:
    following = Following(Bootstrap(keeps="particles"), MODEL)
    state, _ = following.step(following.begin(FIVE), SILENCE, 1.0, np.random.default_rng(1))
    belief = following.belief(state)
    assert isinstance(belief, Particles)
    assert belief.points.shape == (2000, 5)
    _, estimate = following.step(following.resume(sent(belief)), SILENCE, 1.0, np.random.default_rng(2))
    assert estimate is not None
    assert estimate.mean[4] == pytest.approx(-1.0, abs=0.1)


@pytest.mark.parametrize(
    "belief", [FOUR, Modes(np.ones(1), FOUR.mean[None], FOUR.covariance[None]), Particles(np.ones(1), FOUR.mean[None])]
)
@pytest.mark.parametrize("tracker", [make_tracker("ekf"), Bootstrap(keeps="particles")])
def test_to_four_numbers_what_is_known_of_the_unknown_at_the_start_is_added(belief: Belief, tracker: Any) -> None:
    following = Following(tracker, MODEL)
    state = following.resume(belief)
    assert state.known is not None
    assert state.known.mean.tolist() == [1.0, 2.0, 3.0, 4.0, 0.5]
    assert state.known.covariance[4].tolist() == [0.0, 0.0, 0.0, 0.0, 4.0]
    _, estimate = following.step(state, SILENCE, 1.0, np.random.default_rng(1))
    assert estimate is not None
    assert estimate.mean[4] == pytest.approx(0.5, abs=0.2)


def test_neither_four_nor_five_is_a_reason_and_a_fresh_start(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(SENSORS.registered, "ruler", Ruler)
    sensing = {"ruler": {"kind": "ruler", "options": {}}}
    bank = Bank(trackers=("ekf", "ukf", "bootstrap"), sensors=[("a", 0.0, 0.0)], step_ns=10**9, seed=1, sensing=sensing)
    six = Gaussian(np.zeros(6), np.eye(6))
    tracks, points, unusable = bank.resume({"ekf": six, "ukf": FOUR, "bootstrap": FIVE}, 3, 5)
    assert [track.track is None for track in tracks] == [True, False, False]
    assert [point.tracker for point in points] == ["ukf", "bootstrap"]
    assert unusable == ["the belief of ekf is of 6 numbers; expected 4 or 5"]


def test_a_users_tracker_may_hand_on_five_that_fit() -> None:
    following = Following(checked("mine", Knowing(FIVE), 5), MODEL)
    assert following.belief(following.begin(FOUR)) is FIVE
    with pytest.raises(RunFailed, match=r"its belief: mean is of shape \(4,\); expected .* \(5,\)"):
        checked("mine", Knowing(broken(FIVE, 0, FOUR.mean)), 5).belief(FOUR)  # type: ignore[attr-defined]
