"""The trackers on the paper's three targets: within bands that were reached independently of this code."""

from functools import cache

import numpy as np
import pytest

from tests.zhai_field import GRID, SCENARIOS, errors, hear
from trackfield.filters.metrics import lost, nees, rmse
from trackfield.filters.trackers import make_tracker


@cache
def results(name, scenario, runs):
    return errors(make_tracker(name), scenario, range(runs))


@pytest.mark.parametrize(("scenario", "length"), [("s1", 61), ("s2", 76), ("s3", 41)])
def test_targets_move_as_the_paper_says(scenario, length):
    states = SCENARIOS[scenario](np.random.default_rng(0))
    assert states.shape == (length, 4)
    midway = (states[1:, 2:] + states[:-1, 2:]) / 2.0
    assert np.diff(states[:, :2], axis=0) == pytest.approx(midway, abs=0.5)  # places follow velocities
    heading = np.degrees(np.arctan2(states[:, 3], states[:, 2]))
    speed = np.hypot(states[:, 2], states[:, 3])
    if scenario == "s2":
        assert heading[[0, 20, 22, 24, 45, 49, 75]] == pytest.approx([8, 8, 53, 98, 98, 8, 8])
        assert speed[[0, 75]] == pytest.approx([8.0, 8.0])
        assert speed.max() == pytest.approx(10.0, abs=0.1)
    if scenario == "s3":
        assert heading == pytest.approx(np.full(41, 40.0))
        assert speed[[0, 20, 40]] == pytest.approx([1.0, 21.0, 1.0])


def test_sensors_are_awake_as_often_as_the_paper_says():
    """At 75 % about four sensors hear the target, on the paper's grid of 121."""
    assert len(GRID) == 121
    rng = np.random.default_rng(0)
    awake = [len(hear(state[:2], rng)) for _ in range(20) for state in SCENARIOS["s1"](rng)]
    assert np.mean(awake) == pytest.approx(4.0, abs=0.3)


@pytest.mark.parametrize(
    ("name", "scenario", "band"),
    [
        ("spcpf", "s1", 1.7),
        ("spcpf", "s2", 3.0),
        ("spcpf", "s3", 2.6),
        ("fix-imm-ukf", "s1", 1.15),
        ("fix-imm-ukf", "s2", 2.0),
        ("fix-imm-ukf", "s3", 1.95),
    ],
)
def test_position_error_is_within_its_band_and_no_run_is_lost(name, scenario, band):
    e, _ = results(name, scenario, 20)
    assert rmse(e[..., :2]) <= band
    assert not lost(e[..., :2]).any()


@pytest.mark.parametrize("name", ["spcpf", "fix-imm-ukf"])
def test_on_the_straight_target_errors_are_as_large_as_the_covariances_say(name):
    """NEES of 4 states on average; below it means that the tracker claims less than it knows."""
    mean = nees(*results(name, "s1", 20)).mean()
    assert 1.5 < mean < 4.5


def test_the_bootstrap_filter_fails_as_in_the_paper():
    """2000 particles of a wide prior and a quiet model: s1 is poor, and who turns or accelerates is lost."""
    e, _ = results("bootstrap", "s1", 40)
    per_run = np.sqrt(np.square(e[..., :2]).sum(axis=-1).mean(axis=-1))
    assert 4.5 <= np.median(per_run) <= 9.0
    for scenario in ("s2", "s3"):
        e, _ = results("bootstrap", scenario, 10)
        assert lost(e[..., :2]).mean() > 0.8


@pytest.mark.parametrize("name", ["spcpf", "fix-imm-ukf"])
def test_error_grows_with_the_noise_of_the_bearings(name):
    levels = [np.radians(sd) for sd in (0.3, 3.0, 30.0)]
    found = [rmse(errors(make_tracker(name), "s1", range(5), sigma_w=float(sd))[0][..., :2]) for sd in levels]
    assert 3.0 * found[0] < 2.0 * found[1] < found[2]
