"""What trackers hand on, and how they go on from what they are given."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.sensing import arrays, silence
from tests.zhai_field import MODEL, hear, s1, s3
from trackfield.filters import imm
from trackfield.filters.belief import Belief, Modes, Particles, dimension, form_of, moments, pack, unpack
from trackfield.filters.bootstrap import Bootstrap, BootstrapState
from trackfield.filters.imm_ukf import ImmUkf, ImmUkfState
from trackfield.filters.needs import unmet
from trackfield.filters.rng import generator
from trackfield.filters.trackers import TRACKERS, make_tracker
from trackfield.filters.types import Array, Estimate, Gaussian, Reports
from trackfield.tracking.bank import Bank
from trackfield.tracking.following import Followed, Following

NAMES = tuple(name for name, maker in TRACKERS.own.items() if not unmet(maker, MODEL.kinds))
START = 12
"""Steps of the life before."""
KEEPER = Bootstrap(keeps="particles")


def sent(belief: Belief) -> Belief:
    """As it arrives."""
    return unpack(form_of(belief), dimension(belief), pack(belief))


def heard(truth: Array, seed: int) -> list[Reports]:
    """Of each step; step 0 has no reports."""
    draw = np.random.default_rng([seed, 1])
    return [hear(place[:2], draw, step=step) for step, place in enumerate(truth)]


def step(following: Following[Any], state: Followed[Any], reports: Reports) -> tuple[Followed[Any], Estimate | None]:
    return following.step(state, reports, 1.0, generator(1, "x", reports.step))


def lived(following: Following[Any], reports: list[Reports], steps: int = START) -> Followed[Any]:
    """The state after these steps, which began without a prior."""
    state = following.begin(None)
    for k in range(1, steps + 1):
        state, _ = step(following, state, reports[k])
    assert state.track is not None
    return state


# --- what they hand on ---


MODES = ("imm-ukf", "mrbpf", "mrbpf-weightmass", "jm-rbpf")
"""Who hands on a Gaussian for each mode."""


@pytest.mark.parametrize("name", [name for name in NAMES if name not in (*MODES, "predict-only")])
def test_by_default_it_is_the_gaussian_of_the_estimate(name: str) -> None:
    reports = heard(s1(np.random.default_rng(1)), 1)
    following = Following(make_tracker(name), MODEL)
    state, estimate = step(following, lived(following, reports), reports[START + 1])
    belief = following.belief(state)
    assert isinstance(belief, Gaussian)
    assert estimate is not None
    assert (belief.mean == estimate.mean).all()
    assert (belief.covariance == estimate.covariance).all()


def test_without_a_track_nothing_is_known_and_with_a_prior_the_prior() -> None:
    following = Following(make_tracker("ekf"), MODEL)
    assert following.belief(following.begin(None)) is None
    prior = Gaussian(np.zeros(4), np.eye(4))
    assert following.belief(following.begin(prior)) is prior
    resumed = following.belief(following.resume(prior))
    assert resumed is prior


def test_a_track_that_has_just_begun_is_known_by_its_fix() -> None:
    reports = heard(s1(np.random.default_rng(1)), 1)
    following = Following(make_tracker("ekf"), MODEL)
    state, estimate = following.begin(None), None
    for one in reports[1:]:
        state, estimate = step(following, state, one)
        if estimate is not None:
            break
    assert state.new
    assert estimate is not None
    belief = following.belief(state)
    assert isinstance(belief, Gaussian)
    assert (belief.mean == estimate.mean).all()


# --- the default tracker: four modes ---


def test_its_modes_go_on_as_if_it_had_never_ended_but_for_rounding() -> None:
    """Over steps without reports: of those with reports the first is used by a fix."""
    following = Following(ImmUkf(), MODEL)
    state = lived(following, heard(s3(np.random.default_rng(2)), 2))
    belief = following.belief(state)
    assert isinstance(belief, Modes)
    assert belief.weights.shape == (4,)
    assert np.ptp(belief.weights) > 0.1  # its models are no longer equals
    after = following.resume(sent(belief))
    for k in range(START + 1, START + 4):
        (state, before), (after, again) = (step(following, one, silence(k)) for one in (state, after))
        assert before is not None
        assert again is not None
        assert again.mean == pytest.approx(before.mean, rel=1e-5, abs=1e-4)
        assert again.covariance == pytest.approx(before.covariance, rel=1e-3, abs=1e-4)


def test_it_suspects_no_sensor_any_more() -> None:
    tracker, reports = ImmUkf(), heard(s1(np.random.default_rng(1)), 1)
    following = Following(tracker, MODEL)
    state = lived(following, reports)
    wrong = reports[START + 1]
    wrong.bearings[0] += 2.0
    state, _ = step(following, state, wrong)
    assert state.track.suspicion
    belief = following.belief(state)
    assert belief is not None
    resumed = following.resume(belief).track
    assert isinstance(resumed, ImmUkfState)
    assert not resumed.suspicion


def test_other_beliefs_are_a_prior() -> None:
    rng = np.random.default_rng(3)
    tracker, points = ImmUkf(), rng.normal(size=(50, 4))
    for belief in (
        Gaussian(np.ones(4), np.eye(4)),
        Particles(np.full(50, 0.02), points),
        Modes(np.full(2, 0.5), points[:2], np.tile(np.eye(4), (2, 1, 1))),
    ):
        state, known = tracker.resume(belief, MODEL), moments(belief)
        assert imm.combined(state.bank).mean == pytest.approx(known.mean)
        assert imm.combined(state.bank).covariance == pytest.approx(known.covariance)
        assert np.ptp(state.bank.probability) == 0.0


def test_a_manoeuvre_that_the_pause_hid_does_not_throw_it_off() -> None:
    """s3 speeds up in the five steps after step 12; without a fix the error is 9 m when reports come again."""
    misses = []
    for seed in range(20):
        truth = s3(np.random.default_rng(seed))
        following, reports = Following(ImmUkf(), MODEL), heard(truth, seed)
        belief = following.belief(lived(following, reports))
        assert belief is not None
        state = following.resume(sent(belief))
        for k in range(START + 1, START + 6):
            state, _ = step(following, state, silence(k))
        _, estimate = step(following, state, reports[START + 6])
        assert estimate is not None
        misses.append(np.hypot(*(estimate.mean[:2] - truth[START + 6, :2])))
    assert np.sqrt(np.mean(np.square(misses))) < 4.0


# --- particles ---


@pytest.mark.parametrize("ess_share", [1.0, 0.3])
def test_particles_go_on_with_their_weights(ess_share: float) -> None:
    """The weights and points are those before but for rounding, so the next estimate is, too."""
    reports = heard(s1(np.random.default_rng(1)), 1)
    following = Following(Bootstrap(keeps="particles", ess_share=ess_share), MODEL)
    state = lived(following, reports)
    belief = following.belief(state)
    assert isinstance(belief, Particles)
    assert (belief.points == state.track.particles).all()
    weighted = state.track.weights is not None
    assert weighted is (ess_share < 1.0)
    assert bool(np.ptp(belief.weights) > 0.0) is weighted
    after = following.resume(sent(belief))
    (_, before), (_, again) = (step(following, one, reports[START + 1]) for one in (state, after))
    assert before is not None
    assert again is not None
    assert again.mean == pytest.approx(before.mean, rel=1e-5, abs=1e-4)
    assert again.covariance == pytest.approx(before.covariance, rel=1e-3, abs=1e-4)


def test_however_many_particles_it_is_given_it_soon_has_its_own_number() -> None:
    reports = heard(s1(np.random.default_rng(1)), 1)
    many, few = Following(KEEPER, MODEL), Following(Bootstrap(n=500), MODEL)
    belief = many.belief(lived(many, reports))
    assert belief is not None
    state, _ = step(few, few.resume(belief), silence(START + 1))
    assert len(state.track.particles) == 2000
    state, _ = step(few, state, reports[START + 2])
    assert len(state.track.particles) == 500


def test_it_has_no_particles_before_its_first_step() -> None:
    assert KEEPER.belief(KEEPER.init(Gaussian(np.zeros(4), np.eye(4)), MODEL)) is None
    resumed = KEEPER.resume(Gaussian(np.ones(4), np.eye(4)), MODEL)
    assert isinstance(resumed, BootstrapState)
    assert resumed.particles is None


# --- any tracker from any belief ---

WIDE = Gaussian(np.array([200.0, 200.0, 0.0, 0.0]), np.diag([900.0, 900.0, 25.0, 25.0]))


@pytest.mark.parametrize("name", NAMES)
def test_every_tracker_goes_on_from_every_form(name: str) -> None:
    rng = np.random.default_rng(4)
    places = rng.multivariate_normal(*WIDE, 300)
    forms = (WIDE, Particles(np.full(300, 1 / 300), places), Modes(np.ones(1), WIDE.mean[None], WIDE.covariance[None]))
    for belief in forms:
        following = Following(make_tracker(name), MODEL)
        state = following.resume(sent(belief))
        assert state.alone
        _, estimate = step(following, state, silence(5))
        assert estimate is not None
        assert estimate.mean[:2] == pytest.approx([200.0, 200.0], abs=8.0)
        assert np.sqrt(np.diag(estimate.covariance)[:2]) == pytest.approx([30.0, 30.0], rel=0.3)


numbers = st.one_of(
    st.floats(width=32, allow_nan=False, allow_infinity=False), st.sampled_from([0.0, 1e-45, 3.4e38, 1.0])
)


@settings(max_examples=150)
@given(st.sampled_from([*NAMES, "keeper"]), st.sampled_from([(1, 1), (2, 1), (2, 3), (3, 1), (3, 4)]), st.data())
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_no_belief_from_outside_crashes_a_tracker(name: str, form: tuple[int, int], data: st.DataObject) -> None:
    """Any finite numbers: the first estimates may be nonsense."""
    kind, many = form
    length = many * (14 if kind == 1 else 15 if kind == 2 else 5)
    drawn = np.array(data.draw(st.lists(numbers, min_size=length, max_size=length)), "<f4")
    try:
        belief = unpack(kind, 4, drawn.tobytes())
    except ValueError:
        return
    following = Following(KEEPER if name == "keeper" else make_tracker(name), MODEL)
    state = following.resume(belief)
    for k, reports in enumerate((silence(0), *heard(s1(np.random.default_rng(1)), 1)[1:4])):
        state, _ = step(following, state, reports)
        assert k < 4


def test_a_belief_of_another_dimension_is_a_reason_and_a_fresh_start() -> None:
    bank = Bank(trackers=("ekf", "ukf"), sensors=[("a", 0.0, 0.0)], step_ns=10**9, seed=1, sensing=arrays())
    wrong, right = Gaussian(np.zeros(5), np.eye(5)), Gaussian(np.zeros(4), np.eye(4))
    tracks, points, unusable = bank.resume({"ekf": wrong, "ukf": right}, 3, 5)
    assert [track.track is None for track in tracks] == [True, False]
    assert [point.tracker for point in points] == ["ukf"]
    assert unusable == ["the belief of ekf is of 5 numbers; expected 4"]
