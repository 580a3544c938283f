"""A tracker that starts alone, gives a lost target up and starts again; with a prior it does not."""

import numpy as np
import pytest

from tests.sensing import silence, with_bearings
from tests.zhai_field import GRID, MODEL, SCENARIOS, hear, only, prior_around
from trackfield.filters.fix import first_fix
from trackfield.filters.trackers import make_tracker
from trackfield.filters.types import Estimate, of_bearings
from trackfield.models import doa
from trackfield.tracking.following import ANYWHERE, Following, doubts

NONE = silence()


def exactly(position, sensors):
    sensors = np.array(sensors, dtype=float)
    ids = tuple(f"n{i}" for i in range(len(sensors)))
    return of_bearings(0, ids, sensors, doa.measure(np.array(position), sensors), np.full(len(sensors), 60.0))


def following(name="imm-ukf"):
    return Following(make_tracker(name), MODEL)


def follow(name, path, rng, *, begin=None, heard=None):
    """States and estimates along positions (T, 2), one a second; ``heard`` may change the reports."""
    one = following(name)
    state, states, estimates = one.begin(begin), [], []
    for step, position in enumerate(path):
        reports = hear(position, rng, step=step)
        state, estimate = one.step(state, heard(step, reports) if heard else reports, 1.0, rng)
        states.append(state)
        estimates.append(estimate)
    return states, estimates


def off(estimate, position):
    return float(np.hypot(*(estimate.mean[:2] - position)))


def straight(n, start=(120.0, 130.0), velocity=(6.0, 5.0)):
    return np.array(start) + np.arange(n)[:, None] * np.array(velocity)


# --- the first fix ---


@pytest.mark.parametrize(
    "reports",
    [
        NONE,
        exactly((20.0, 30.0), [(0.0, 0.0)]),
        exactly((20.0, 30.0), [(0.0, 0.0), (0.0, 0.0)]),  # two sensors in one place
        exactly((20.0, 20.0), [(0.0, 0.0), (50.0, 50.0)]),  # between its sensors, on the line that joins them
        exactly((80.0, 80.0), [(0.0, 0.0), (50.0, 50.0)]),  # beyond them on that line
        exactly((20.0, 4000.0), [(0.0, 0.0), (50.0, 0.0)]),  # too far for its baseline
    ],
)
def test_bearings_that_leave_the_range_open_give_no_fix(reports):
    assert first_fix(reports, MODEL, ANYWHERE) is None
    state, estimate = following().step(following().begin(None), reports, 1.0, np.random.default_rng(0))
    assert estimate is None
    assert state.track is None


def test_two_bearings_that_cross_give_one():
    fix = first_fix(exactly((20.0, 30.0), [(0.0, 0.0), (50.0, 0.0)]), MODEL, ANYWHERE)
    assert fix.mean == pytest.approx([20.0, 30.0, 0.0, 0.0], abs=0.1)
    assert np.sqrt(np.diag(fix.covariance)[2:]) == pytest.approx([10.0, 10.0])  # any vehicle in town


@pytest.mark.parametrize("seed", range(5))
def test_the_first_fix_is_as_good_as_it_says(seed):
    rng, nees = np.random.default_rng(seed), []
    for position in rng.uniform(100.0, 400.0, (100, 2)):
        fix = first_fix(hear(position, rng), MODEL, ANYWHERE)
        if fix is not None:
            error = fix.mean[:2] - position
            nees.append(error @ np.linalg.inv(fix.covariance[:2, :2]) @ error)
    assert len(nees) > 80
    assert np.mean(nees) < 3.5


# --- starting and following ---


def test_the_track_starts_with_the_first_step_that_gives_a_fix():
    def heard(step, reports):
        return only(reports, range({0: 0, 1: 1}.get(step, len(reports))))

    _, estimates = follow("imm-ukf", straight(12), np.random.default_rng(1), heard=heard)
    assert estimates[:2] == [None, None]
    assert off(estimates[2], straight(12)[2]) < 6.0
    assert off(estimates[11], straight(12)[11]) < 4.0
    assert estimates[11].mean[2:] == pytest.approx([6.0, 5.0], abs=2.0)


@pytest.mark.parametrize("name", ["imm-ukf", "spcpf"])
@pytest.mark.parametrize("scenario", list(SCENARIOS))
def test_alone_is_as_good_as_with_a_prior_and_never_starts_anew(name, scenario):
    squares = []
    for seed in range(5):
        rng = np.random.default_rng(seed)
        truth = SCENARIOS[scenario](rng)
        states, estimates = follow(name, truth[1:, :2], rng)
        started = [i for i, state in enumerate(states) if state.track is not None and state.doubt == 0.0]
        assert started[0] == 0
        assert None not in estimates
        fresh = pytest.approx(10.0**2)  # the variance of a velocity of which nothing is known
        assert not any(estimates[i].covariance[2, 2] == fresh for i in range(1, len(estimates)))
        squares += [off(e, p[:2]) ** 2 for e, p in zip(estimates, truth[1:], strict=True)]
    band = {"imm-ukf": 2.1, "spcpf": 3.2}[name]
    assert np.sqrt(np.mean(squares)) < band


@pytest.mark.parametrize("name", ["imm-ukf", "spcpf", "bootstrap"])
def test_a_target_that_jumps_is_found_again(name):
    path = np.concatenate((straight(15), straight(15, start=(400.0, 120.0), velocity=(-6.0, 5.0))))
    _, estimates = follow(name, path, np.random.default_rng(3))
    assert off(estimates[14], path[14]) < 10.0
    assert min(off(e, path[15 + i]) for i, e in enumerate(estimates[15:19]) if e) < 10.0
    assert off(estimates[29], path[29]) < 10.0


@pytest.mark.parametrize("speed_sd", [0.5, 10.0])
def test_a_track_begins_with_the_speed_that_targets_have(speed_sd):
    one = Following(make_tracker("ekf"), MODEL, speed_sd=speed_sd)
    _, estimate = one.step(one.begin(None), hear(np.array((120.0, 130.0)), np.random.default_rng(1)), 1.0, None)
    assert estimate.covariance[2:, 2:] == pytest.approx(np.eye(2) * speed_sd**2, rel=0.01, abs=0.01)


def test_with_a_prior_a_lost_target_stays_lost():
    """As in the paper, whose bootstrap filter loses the target for good."""
    path = np.concatenate((straight(15), straight(15, start=(400.0, 120.0), velocity=(-6.0, 5.0))))
    rng = np.random.default_rng(3)
    prior = prior_around(np.array([114.0, 125.0, 6.0, 5.0]), rng)
    states, estimates = follow("bootstrap", path, rng, begin=prior)
    assert None not in estimates
    assert off(estimates[29], path[29]) > 50.0
    assert not states[-1].alone


def test_with_a_prior_the_estimates_are_the_bare_trackers():
    truth, tracker = SCENARIOS["s1"](np.random.default_rng(0)), make_tracker("spcpf")
    prior = prior_around(truth[0], np.random.default_rng(1))
    _, estimates = follow("spcpf", truth[1:20, :2], np.random.default_rng(2), begin=prior)
    state, rng = tracker.init(prior, MODEL), np.random.default_rng(2)
    for step, position in enumerate(truth[1:20, :2]):
        state, estimate = tracker.step(state, hear(position, rng, step=step), 1.0, rng)
        assert np.array_equal(estimate.mean, estimates[step].mean)


def test_one_sensor_that_points_anywhere_does_not_end_a_track():
    def heard(step, reports):
        bearings = reports.bearings.copy()
        if step > 5 and step % 4 == 0:
            bearings[0] += 2.5
        return with_bearings(reports, bearings)

    states, _ = follow("imm-ukf", straight(40), np.random.default_rng(4), heard=heard)
    assert all(state.track is not None for state in states)
    assert states[-1].doubt < 14.0


def test_silence_is_coasted_through_and_a_long_one_ends_the_track():
    def heard(step, reports):
        return NONE if step >= 10 else reports

    _, estimates = follow("imm-ukf", straight(300), np.random.default_rng(5), heard=heard)
    assert off(estimates[13], straight(14)[13]) < 25.0
    ended = estimates.index(None)
    assert ended > 15
    assert set(estimates[ended:]) == {None}  # it waits for reports
    sd = np.sqrt(np.linalg.eigvalsh(estimates[ended - 1].covariance[:2, :2])[-1])
    assert sd == pytest.approx(50.0, rel=0.2)  # when its own sd says that the target may be lost


def test_the_track_comes_back_after_silence():
    path = straight(60, velocity=(4.0, 3.0))

    def heard(step, reports):
        return NONE if 10 <= step < 40 else reports

    _, estimates = follow("imm-ukf", path, np.random.default_rng(6), heard=heard)
    assert off(estimates[45], path[45]) < 8.0


# --- doubt ---


def estimate_at(position, sd=1.0):
    return Estimate(np.array([*position, 0.0, 0.0]), np.diag([sd**2, sd**2, 1.0, 1.0]))


def test_bearings_that_agree_take_doubt_away_and_others_add_a_bounded_amount():
    here = (120.0, 130.0)
    reports = exactly(here, GRID[[24, 25, 36]])
    assert doubts(MODEL, estimate_at(here), reports) < -3.0
    away = doubts(MODEL, estimate_at((300.0, 20.0)), reports)
    assert away == pytest.approx(3.0 * np.log(20.0), rel=0.01)  # each is clutter with probability 1/20
    assert doubts(MODEL, estimate_at(here), NONE) == 0.0


def test_what_an_estimate_admits_not_to_know_is_not_held_against_it():
    reports = exactly((135.0, 130.0), GRID[[24, 25, 36]])
    sure, unsure = (doubts(MODEL, estimate_at((120.0, 130.0), sd), reports) for sd in (1.0, 12.0))
    assert unsure < sure - 3.0


def test_a_step_is_a_function_of_its_arguments():
    one, reports = following("spcpf"), hear(np.array([220.0, 130.0]), np.random.default_rng(0))
    state, _ = one.step(one.begin(None), reports, 1.0, np.random.default_rng(1))
    later = [one.step(state, reports, 1.0, np.random.default_rng(2)) for _ in range(2)]
    assert np.array_equal(later[0][1].mean, later[1][1].mean)
    assert np.array_equal(later[0][0].track.cloud.particles, later[1][0].track.cloud.particles)
