"""A city bus without any prior: stops, departures, turns, lost reports; recorded, and made up here."""

import numpy as np
import pytest

from tests.zhai_field import MODEL, hear, only
from trackfield.filters.metrics import rmse
from trackfield.filters.rng import generator
from trackfield.filters.trackers import make_tracker
from trackfield.tracking.following import Following
from trackfield.world.tracks import read_track

BURST, RECOVERY, LOSS_IN_BURST = 0.045, 0.5, 0.9  # 7.4 % of reports lost in the long run, in bursts


def field_along(path):
    """Nodes (K, 2) on a 50 m grid, within 150 m of the path."""
    low, high = np.floor(path.min(axis=0) / 50.0) * 50.0 - 150.0, path.max(axis=0) + 150.0
    axes = [np.arange(a, b + 1.0, 50.0) for a, b in zip(low, high, strict=True)]
    grid = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
    return grid[np.linalg.norm(grid[:, None] - path, axis=-1).min(axis=1) <= 150.0]


class Bursts:
    """Each sensor's reports are lost in bursts (Gilbert & Elliott)."""

    def __init__(self, rng):
        self.rng, self.bad = rng, {}

    def pass_on(self, reports):
        kept = []
        for i, sensor in enumerate(reports.sensors):
            stays = self.rng.random() < (1.0 - RECOVERY if self.bad.get(sensor) else BURST)
            self.bad[sensor] = stays
            if not (stays and self.rng.random() < LOSS_IN_BURST):
                kept.append(i)
        return only(reports, kept)


def follow(path, seed, name="imm-ukf"):
    """Means (T, 4) along the path, one a second; nan while there is no track."""
    one = Following(make_tracker(name), MODEL)
    state, field, bursts, means = one.begin(None), field_along(path), Bursts(generator(seed, "loss")), []
    for step, position in enumerate(path):
        reports = bursts.pass_on(hear(position, generator(seed, "bearing", step), step=step, sensors=field))
        state, estimate = one.step(state, reports, 1.0, generator(seed, name, step))
        means.append(np.full(4, np.nan) if estimate is None else estimate.mean)
    return np.array(means)


def recorded(file, start, end):
    path = read_track(file, start, end)
    return np.array([path.at(float(t))[:2] for t in np.arange(np.ceil(path.start_s), path.end_s)])


def assert_followed(path, seeds, name, band):
    errors = []
    for seed in seeds:
        error = follow(path, seed, name)[:, :2] - path
        assert np.isfinite(error[3:]).all()  # it starts at once and never waits again
        assert np.linalg.norm(error[-1]) < 10.0
        errors.append(error[np.isfinite(error[:, 0])])
    assert rmse(np.concatenate(errors)) < band


@pytest.mark.parametrize("window", [("07:50:00", "07:53:00"), ("07:58:00", "08:01:00"), ("08:07:00", "08:10:00")])
@pytest.mark.parametrize(("name", "band"), [("imm-ukf", 2.5), ("spcpf", 3.0)])
def test_a_recorded_bus_is_followed(data_file, window, name, band):
    assert_followed(recorded(data_file("bus_304.gpx"), *window), range(3), name, band)


def assert_no_false_speed(path, seeds):
    for seed in seeds:
        speed = np.hypot(*follow(path, seed)[10:, 2:].T)
        assert speed.max() < 1.0


def test_a_recorded_bus_that_is_parked_has_no_speed(data_file):
    assert_no_false_speed(recorded(data_file("bus_304.gpx"), "07:46:00", "07:49:00"), range(4))


def test_a_parked_bus_has_no_speed_wherever_it_stands():
    """On top of a sensor, beside one, between them; its receiver's position creeps by 5 m in two minutes."""
    creep = np.linspace(0.0, 5.0, 120)[:, None] * np.array([0.6, -0.8])
    for seed, place in enumerate([(0.0, 0.0), (1.5, 0.0), (25.0, 25.0), (25.0, 0.0), (12.0, 31.0)]):
        assert_no_false_speed(np.array(place) + creep, [seed])


def stop_and_go():
    """Positions (T, 2): 30 s at a stop, off at 1.2 m/s^2, round a corner at 9.6 m/s, and to the next stop."""
    t = np.arange(0.0, 95.0, 0.01)
    speed = 1.2 * (np.clip(t - 30.0, 0.0, 8.0) - np.clip(t - 70.0, 0.0, 8.0))
    heading = np.radians(20.0 + 90.0 * np.clip((t - 50.0) / 6.0, 0.0, 1.0))
    steps = 0.01 * speed[:, None] * np.stack((np.sin(heading), np.cos(heading)), axis=-1)
    return np.cumsum(steps, axis=0)[::100]


def test_a_bus_leaves_its_stop_and_the_track_with_it():
    path = stop_and_go()
    assert_followed(path, range(4), "imm-ukf", 2.0)
    for seed in range(4):
        error = np.linalg.norm(follow(path, seed)[:, :2] - path, axis=-1)
        assert error[30:40].max() < 8.0  # it is not left standing
        speed = np.hypot(*follow(path, seed)[:, 2:].T)
        assert speed[42:48].mean() == pytest.approx(9.6, abs=1.0)
        assert speed[88:].mean() < 1.0
