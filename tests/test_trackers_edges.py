"""What every tracker must bear: silence, one sensor, angles across their cut, crowds; and being replayed."""

import inspect
import os
import subprocess
import sys

import numpy as np
import pytest

from tests.sensing import silence, with_bearings
from tests.zhai_field import GRID, MODEL, P0, hear, only
from trackfield.errors import ScenarioError
from trackfield.filters.needs import unmet
from trackfield.filters.rng import generator
from trackfield.filters.trackers import TRACKERS, make_tracker
from trackfield.filters.types import Gaussian, of_bearings

NAMES = sorted(name for name in TRACKERS if not unmet(TRACKERS[name], MODEL.kinds))
HEARING = [name for name in NAMES if name != "predict-only"]
TURNING = {"mrbpf": 500, "mrbpf-weightmass": 500, "jm-rbpf": 500}
DRAWING = {
    **{"bootstrap": 2000, "fa-upf": 200, "fix-doa": 200, "gpf-ukf": 100, "spcpf": 200, "upf": 200, "upf-paper": 100},
    **{"rbpf": 500, **TURNING},
}
START = Gaussian(np.array([200.0, 130.0, 6.0, 5.0]), P0 / 16.0)
NONE = silence()


def run(name, heard, *, prior=START, model=MODEL, dt=1.0, seed=0):
    """All estimates for a list of reports."""
    tracker, estimates = make_tracker(name), []
    state = tracker.init(prior, model)
    for step, reports in enumerate(heard):
        state, estimate = tracker.step(state, reports, dt, generator(seed, name, step))
        estimates.append(estimate)
    return estimates


def sound(estimate):
    eigenvalues = np.linalg.eigvalsh(estimate.covariance)
    return (
        np.isfinite(estimate.mean).all()
        and np.isfinite(estimate.covariance).all()
        and np.allclose(estimate.covariance, estimate.covariance.T)
        and eigenvalues.min() > -1e-9 * eigenvalues.max()
    )


def walk(n, rng, **kwargs):
    return [hear(np.array([206.0, 135.0]) + step * np.array([6.0, 5.0]), rng, **kwargs) for step in range(n)]


# --- by name ---


def test_trackers_have_the_papers_sizes():
    theirs = ["fa-upf", "gpf-ukf", "upf", "upf-paper"]
    ours = ["bootstrap", "ekf", "fix-doa", "imm-ukf", "predict-only", "spcpf", "ukf"]
    assert set(NAMES) >= {*ours, *theirs}
    assert {"rbpf", *TURNING} <= set(NAMES)
    assert make_tracker("spcpf").particles == 200
    assert make_tracker("spcpf").nominals == 15
    assert make_tracker("spcpf").weights == "paper"
    assert make_tracker("bootstrap").n == 2000


@pytest.mark.parametrize(
    ("wrong", "right"),
    [("spfpc", "'spcpf'"), ("imm-ufk", "'imm-ukf'"), ("zzz", "one of bootstrap, cpa, ecpa, ekf, fa-upf")],
)
def test_an_unknown_name_gets_the_nearest(wrong, right):
    with pytest.raises(ScenarioError, match=f"unknown tracker '{wrong}'.*{right}"):
        make_tracker(wrong)


# --- reports of all kinds ---


OPTIONS = [(name, option) for name in sorted(TRACKERS) for option in inspect.signature(TRACKERS[name]).parameters]


@pytest.mark.parametrize(("name", "option"), OPTIONS)
def test_each_option_is_checked_also_those_that_a_tracker_inherits(name, option):
    for wrong in ("nonsense", -1, float("nan"), 1e300):
        with pytest.raises(ScenarioError, match=rf"^(?s:.*){option}: is .*; expected "):
            make_tracker(name, {option: wrong})


@pytest.mark.parametrize("name", NAMES)
def test_without_reports_a_tracker_predicts(name):
    first, *_, last = run(name, [NONE] * 8)
    where = START.mean[:2] + 8.0 * START.mean[2:]
    if name not in ("imm-ukf", *TURNING):  # silence rules out neither that it stands nor that it turns
        wanders = 2.0 if name == "upf-paper" else 1.0  # it draws all of its particles anew in each step
        assert last.mean[:2] == pytest.approx(where, abs=2.5 * wanders)
    assert np.trace(last.covariance[:2, :2]) > np.trace(first.covariance[:2, :2])
    assert sound(last)


@pytest.mark.parametrize("name", HEARING)
def test_a_gap_in_the_reports_is_bridged(name):
    heard = walk(25, np.random.default_rng(1))
    heard[10:14] = [NONE] * 4
    estimates = run(name, heard, model=MODEL)
    truth = np.array([206.0, 135.0]) + 24.0 * np.array([6.0, 5.0])
    assert np.hypot(*(estimates[-1].mean[:2] - truth)) < 6.0


@pytest.mark.parametrize("name", HEARING)
def test_a_single_sensor_turns_the_estimate_towards_its_bearing(name):
    truth, sensor = np.array([206.0, 135.0]), GRID[[26]]  # at (200, 100), 35 m away
    heard = of_bearings(0, ("n026",), sensor, np.array([np.arctan2(*(truth - sensor[0]))]), np.array([55.0]))
    (estimate,) = run(name, [heard])
    across = np.array([truth[1] - sensor[0, 1], sensor[0, 0] - truth[0]]) / np.hypot(*(truth - sensor[0]))
    assert sound(estimate)
    assert across @ (estimate.mean[:2] - truth) == pytest.approx(0.0, abs=2.5)
    assert across @ estimate.covariance[:2, :2] @ across < 2.5**2


@pytest.mark.parametrize("name", HEARING)
def test_one_sensor_at_a_time_keeps_the_track(name):
    rng = np.random.default_rng(2)
    heard = [only(reports, [step % len(reports)]) for step, reports in enumerate(walk(25, rng))]
    estimates = run(name, heard, prior=Gaussian(START.mean, np.diag([4.0, 4.0, 0.25, 0.25])))
    truth = np.array([206.0, 135.0]) + 24.0 * np.array([6.0, 5.0])
    assert np.hypot(*(estimates[-1].mean[:2] - truth)) < 12.0
    assert all(map(sound, estimates))


@pytest.mark.parametrize("name", HEARING)
def test_south_of_all_sensors_is_as_good_as_north(name):
    """The bearing jumps between pi and -pi south of a sensor."""
    rng, n = np.random.default_rng(3), 20
    sensors = np.stack((np.linspace(0.0, 150.0, 7), np.zeros(7)), axis=-1)
    finals = []
    for side in (1.0, -1.0):
        path = np.stack((10.0 + 6.0 * np.arange(n), np.full(n, side * 20.0)), axis=-1)
        prior = Gaussian(np.array([4.0, side * 20.0, 6.0, 0.0]), P0 / 100.0)
        finals.append([run(name, [hear(p, rng, sensors=sensors) for p in path], prior=prior)[-1], path[-1]])
    for estimate, truth in finals:
        assert np.hypot(*(estimate.mean[:2] - truth)) < 4.0


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("turns", [1.0, -3.0])
def test_whole_turns_in_a_bearing_change_nothing(name, turns):
    heard = walk(3, np.random.default_rng(4))
    turned = [with_bearings(reports, reports.bearings + turns * 2.0 * np.pi) for reports in heard]
    for plain, other in zip(run(name, heard), run(name, turned), strict=True):
        assert other.mean == pytest.approx(plain.mean, rel=1e-6)


@pytest.mark.parametrize("name", HEARING)
def test_a_target_on_top_of_a_sensor(name):
    rng = np.random.default_rng(5)
    prior = Gaussian(np.array([200.0, 150.0, 0.0, 0.0]), np.diag([25.0, 25.0, 1.0, 1.0]))
    estimates = run(name, [hear(np.array([200.0, 150.0]), rng) for _ in range(10)], prior=prior)
    assert all(map(sound, estimates))
    assert np.hypot(*(estimates[-1].mean[:2] - [200.0, 150.0])) < 5.0


@pytest.mark.parametrize("name", ["ekf", "fix-doa", "imm-ukf", "spcpf", "ukf"])
def test_a_thousand_sensors_at_once(name):
    rng = np.random.default_rng(6)
    sensors, truth = rng.uniform(0.0, 500.0, (1000, 2)), np.array([206.0, 135.0])
    bearings = np.arctan2(*(truth - sensors).T) + MODEL.sigma_w * rng.standard_normal(1000)
    heard = of_bearings(0, tuple(map(str, range(1000))), sensors, bearings, np.full(1000, 50.0))
    estimates = run(name, [heard, NONE])
    assert np.hypot(*(estimates[0].mean[:2] - truth)) < {"spcpf": 8.0}.get(name, 0.6)
    assert all(map(sound, estimates))


@pytest.mark.parametrize("name", NAMES)
def test_a_certain_prior(name):
    """A singular covariance: of the target's place all is known."""
    prior = Gaussian(START.mean, np.diag([0.0, 0.0, 1.0, 1.0]))
    estimates = run(name, walk(5, np.random.default_rng(7)), prior=prior)
    assert all(map(sound, estimates))
    assert np.hypot(*(estimates[-1].mean[:2] - [230.0, 155.0])) < 5.0


@pytest.mark.parametrize("name", NAMES)
def test_steps_may_be_longer_than_a_second(name):
    rng = np.random.default_rng(8)
    path = np.array([206.0, 135.0]) + 4.0 * np.arange(8)[:, None] * np.array([6.0, 5.0])
    prior = Gaussian(np.array([182.0, 115.0, 6.0, 5.0]), np.diag([9.0, 9.0, 0.25, 0.25]))
    estimates = run(name, [hear(p, rng) for p in path], prior=prior, dt=4.0)
    assert np.hypot(*(estimates[-1].mean[:2] - path[-1])) < 6.0


# --- purity ---


def frozen(reports):
    for array in (reports.positions, reports.bearings, reports.levels):
        array.flags.writeable = False
    return reports


def freeze(value):
    """Make every array in a state read-only."""
    if isinstance(value, np.ndarray):
        value.flags.writeable = False
    elif isinstance(value, tuple):
        for part in value:
            freeze(part)


@pytest.mark.parametrize("name", NAMES)
def test_nobody_writes_into_states_or_reports_and_a_replay_is_exact(name):
    """A driver may go back to an old state and handle the same reports again."""
    tracker = make_tracker(name)
    heard = [frozen(reports) for reports in walk(6, np.random.default_rng(9))]
    heard[3] = NONE

    def replay(state, first):
        states, means = [state], []
        for step in range(first, 6):
            freeze(states[-1])
            state, estimate = tracker.step(states[-1], heard[step], 1.0, generator(1, step))
            states.append(state)
            means.append(estimate.mean)
        return states, means

    states, means = replay(tracker.init(START, MODEL), 0)
    for first in range(6):
        _, again = replay(states[first], first)
        assert np.array_equal(again, means[first:])


@pytest.mark.parametrize("name", DRAWING)
def test_another_seed_gives_another_track(name):
    heard = walk(5, np.random.default_rng(10))
    assert not np.array_equal(run(name, heard, seed=1)[-1].mean, run(name, heard, seed=2)[-1].mean)


@pytest.mark.parametrize("name", NAMES)
def test_particles_are_positions_and_fit_a_track_point(name):
    (estimate,) = run(name, [walk(1, np.random.default_rng(11))[0]])
    if name not in DRAWING:
        assert estimate.particles is None
    else:
        assert estimate.particles.shape == (DRAWING[name], 2)
        assert estimate.particles.mean(axis=0) == pytest.approx(estimate.mean[:2], abs=3.0)


SCRIPT = """
import sys
import numpy as np
from tests.sensing import silence, with_bearings
from tests.zhai_field import SCENARIOS, follow
from trackfield.filters.trackers import make_tracker
for name in sys.argv[1:]:
    rng = np.random.default_rng(5)
    for estimate in follow(make_tracker(name), SCENARIOS["s2"](rng)[:25], rng):
        sys.stdout.write(estimate.mean.tobytes().hex() + estimate.covariance.tobytes().hex())
"""


def test_processes_agree_to_the_bit_whatever_their_threads():
    answers = {
        subprocess.run(
            [sys.executable, "-c", SCRIPT, *NAMES],
            env={**os.environ, "OPENBLAS_NUM_THREADS": threads, "PYTHONPATH": os.pathsep.join(sys.path)},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for threads in ("1", "2", "8")
    }
    assert len(answers) == 1
    assert len(answers.pop()) == len(NAMES) * 24 * 20 * 16  # 20 numbers of 8 bytes, two digits each
