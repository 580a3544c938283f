"""The default tracker with every kind of sensing: how far from the bound, and what it does with bad readings."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any, Final

import numpy as np
import pytest

from launcher.plan.extensions import own_places
from tests.matrix import FIELDS, START, STEPS, Cell, cell, field
from tests.rangers import Ranger
from tests.sensing import model_of, reports_of
from trackfield.errors import ScenarioError
from trackfield.filters import imm
from trackfield.filters.belief import Modes, dimension
from trackfield.filters.imm_ukf import ImmUkf, ImmUkfState
from trackfield.filters.trackers import TRACKERS, make_tracker
from trackfield.filters.types import Array, Estimate, Gaussian, Readings, Reports
from trackfield.scenario import Scenario
from trackfield.tracking.following import Following

WORST: Final = {
    "doa": 1.25,
    "range": 1.25,
    "rss": 1.45,
    "energy": 1.35,
    "doa and range": 1.2,
    "rss and energy": 1.35,
}
"""Errors over the bound that would be too large; docs/trackers.md has what they are."""


def test_the_former_name_means_the_same() -> None:
    assert TRACKERS["fix-imm-ukf"] is TRACKERS["imm-ukf"] is ImmUkf
    assert isinstance(make_tracker("fix-imm-ukf"), ImmUkf)  # not one of a user's, which are checked at each step
    assert own_places(Scenario.load("bus").set("fusion.trackers", ["fix-imm-ukf"])) == {}


def test_the_former_name_is_neither_listed_nor_free() -> None:
    assert "fix-imm-ukf" in TRACKERS
    assert "fix-imm-ukf" not in list(TRACKERS)
    with pytest.raises(ScenarioError, match="of Trackfield's own"):
        TRACKERS.register("fix-imm-ukf", ImmUkf)


@cache
def of(name: str) -> Cell:
    return cell("imm-ukf", field(name), range(12))


@pytest.mark.parametrize("name", FIELDS)
def test_it_is_near_the_bound_and_not_overconfident(name: str) -> None:
    """It expects manoeuvres that this target does not make, so it is underconfident: docs/tracking.md."""
    found = of(name)
    assert found.tracked == 1.0
    assert 0.9 < found.ratio < WORST[name]
    assert 1.5 < found.nees.mean() < found.band[1]


def test_two_kinds_are_better_than_the_coarser_of_them() -> None:
    assert of("doa and range").error_m < of("doa").error_m
    assert of("rss and energy").error_m < of("rss").error_m


# --- stories on one path ---

Spoil = Callable[[int, Reports], Reports]


@dataclass(frozen=True)
class Told:
    """The truth (STEPS + 1, n), and by step the estimate and the tracker's state; None without a track."""

    truth: Array
    estimates: list[Estimate | None]
    states: list[ImmUkfState | None]

    def errors(self, first: int = 10) -> Array:
        """Position errors (m) from this step on, infinite without a track."""
        pairs = list(zip(self.estimates, self.truth[1:], strict=True))[first - 1 :]
        return np.array([np.inf if e is None else np.hypot(*(e.mean - x)[:2]) for e, x in pairs])


def told(name: str, seed: int, spoil: Spoil = lambda step, reports: reports, **options: Any) -> Told:
    """A track that begins with the first reports."""
    of, rng = field(name), np.random.default_rng(seed)
    truth = of.truth(rng)
    following = Following(ImmUkf(**options), of.model)
    state, estimates, states = following.begin(None), [], []
    for step, x in enumerate(truth[1:], start=1):
        state, estimate = following.step(state, spoil(step, of.heard(x, step, rng)), 1.0, rng)
        estimates.append(estimate)
        states.append(state.track)
    return Told(truth, estimates, states)


def wrong(reports: Reports, which: int, of: str) -> Reports:
    """The same, but the reading of this report is what a sensor of its kind reads of a target that is elsewhere."""
    model, found, first = field(of).model, [], 0
    for one in reports.readings:
        values = one.values.copy()
        if first <= which < first + len(values):
            place = reports.positions[which]
            # most of its range away in the direction where the sensor does not have it, or right beside it
            aside = np.array([0.0, 5.0 if one.kind != "doa" else -5.0])
            far = np.append(place + aside, np.zeros(model.dimension - 2))
            if model.unknowns:
                far[-1] = model.unknowns[0].mean
            kind = model.kinds[one.kind]
            columns = far if kind.unknowns else far[:4]
            values[which - first, : kind.m] = kind.h(columns, place[None])[0]
        found.append(Readings(one.kind, values))
        first += len(values)
    return Reports(reports.step, reports.sensors, reports.positions, tuple(found), reports.m, reports.directional)


def farthest(reports: Reports, x: Array) -> int:
    return int(np.hypot(*(reports.positions - x[:2]).T).argmax())


@pytest.mark.parametrize("name", FIELDS)
def test_a_wild_reading_in_every_other_step_costs_little(name: str) -> None:
    """Of the sensor farthest from the target; without its gate the tracker is led astray."""
    errors = {True: [], False: [], None: []}
    for seed in range(4):
        truth = field(name).truth(np.random.default_rng(seed))

        def spoil(step: int, reports: Reports, truth: Array = truth) -> Reports:
            return wrong(reports, farthest(reports, truth[step]), name) if step % 2 and step > 3 else reports

        for gate in (True, False):
            errors[gate].append(told(name, seed, spoil, gate=gate).errors())
        errors[None].append(told(name, seed).errors())
    gated, plain, clean = (float(np.sqrt(np.square(errors[which]).mean())) for which in (True, False, None))
    assert gated < 1.35 * clean
    assert plain > 1.5 * gated


@pytest.mark.parametrize("name", ["range", "rss", "energy", "doa and range"])
def test_a_sensor_that_is_wrong_again_and_again_is_suspected(name: str) -> None:
    bad = "n008"

    def spoil(step: int, reports: Reports) -> Reports:
        return wrong(reports, reports.sensors.index(bad), name) if step > 3 and bad in reports.sensors else reports

    for seed in range(3):
        one = told(name, seed, spoil)
        state = one.states[12]
        assert state is not None
        assert state.suspicion[bad] > 0.5 > max(p for id, p in state.suspicion.items() if id != bad)
        assert one.errors().max() < 20.0


@pytest.mark.parametrize("name", FIELDS)
def test_a_start_with_a_wild_reading_is_put_right(name: str) -> None:
    def spoil(step: int, reports: Reports) -> Reports:
        return wrong(reports, farthest(reports, START), name) if step <= 3 else reports

    for seed in range(3):
        one = told(name, seed, spoil)
        clean = told(name, seed)
        assert np.sqrt(np.square(one.errors(15)).mean()) < 1.5 * np.sqrt(np.square(clean.errors(15)).mean()) + 0.5


@pytest.mark.parametrize("name", FIELDS)
def test_a_target_that_jumps_is_found_again(name: str) -> None:
    """At step 20 it is 100 m elsewhere: the tracker goes there, or the track starts anew."""
    of, aside = field(name), np.array([60.0, -80.0])
    rng = np.random.default_rng(3)
    truth = of.truth(rng)
    truth[20:, :2] += aside
    following = Following(ImmUkf(), of.model)
    state = following.begin(None)
    errors = []
    for step, x in enumerate(truth[1:], start=1):
        state, estimate = following.step(state, of.heard(x, step, rng), 1.0, rng)
        errors.append(np.inf if estimate is None else np.hypot(*(estimate.mean - x)[:2]))
    assert errors[18] < 20.0
    assert max(errors[27:]) < 25.0


@pytest.mark.parametrize("name", ["range", "rss", "energy"])
def test_one_wild_reading_counts_for_nothing(name: str) -> None:
    """The estimate is bit for bit that of the others alone."""
    of, rng = field(name), np.random.default_rng(5)
    truth = of.truth(rng)
    tracker = ImmUkf()
    spread = np.append([9.0, 9.0, 1.0, 1.0], [0.01] * (len(truth[0]) - 4))
    state = tracker.init(Gaussian(truth[0], np.diag(spread)), of.model)
    for step in range(1, 12):
        state, _ = tracker.step(state, of.heard(truth[step], step, rng), 1.0, rng)
    heard = of.heard(truth[12], 12, rng)
    k = farthest(heard, truth[12])
    _, spoilt = tracker.step(state, wrong(heard, k, name), 1.0, rng)
    _, alone = tracker.step(state, heard.only(np.delete(np.arange(len(heard)), k)), 1.0, rng)
    assert np.array_equal(spoilt.mean, alone.mean)
    assert np.array_equal(spoilt.covariance, alone.covariance)


# --- unknowns, beliefs, users' own kinds ---


def test_what_the_target_emits_is_found_as_well_as_it_says() -> None:
    """The tracker's fifth number: its error in units of its sd over 12 paths, 10 steps apart."""
    squares = []
    for seed in range(12):
        one = told("energy", seed)
        for step in (20, 30, 40):
            estimate = one.estimates[step - 1]
            assert estimate is not None
            assert estimate.mean.shape == (5,)
            error = estimate.mean[4] - one.truth[step, 4]
            squares.append(error**2 / estimate.covariance[4, 4])
    assert 0.4 < np.mean(squares) < 1.8


def test_its_belief_has_the_unknowns_and_goes_on() -> None:
    one = told("energy", 1)
    tracker, state = ImmUkf(), one.states[-1]
    assert state is not None
    belief = tracker.belief(state)
    assert isinstance(belief, Modes)
    assert dimension(belief) == 5
    resumed = tracker.resume(belief, state.model)
    assert imm.combined(resumed.bank).mean == pytest.approx(imm.combined(state.bank).mean)
    F, Q = tracker.motion(state, state, 1.0)
    assert F.shape == Q.shape == (5, 5)
    assert F[4] == pytest.approx([0.0, 0.0, 0.0, 0.0, 1.0])


PLACES: Final = np.array([[0.0, 0.0], [80.0, 0.0], [0.0, 80.0], [80.0, 80.0]])


@dataclass(frozen=True)
class Knowing(Ranger):
    """Readings of two numbers, of which it knows how they are distributed if they are not of the target."""

    def log_clutter(self, z: Array, at: Array) -> Array:
        return np.full(len(z), -2.0 * np.log(100.0))


def accepted(sensor: Any) -> tuple[Array, Array, float]:
    """Means with one reading of four wild, and without it; how much more its sensor is suspected than others."""
    model, rng, tracker = model_of(sensor), np.random.default_rng(2), ImmUkf()
    x = np.array([35.0, 30.0, 2.0, 1.0])
    state = tracker.init(Gaussian(x, np.diag([4.0, 4.0, 1.0, 1.0])), model)
    noise = np.array(sensor.sd)

    def heard(x: Array) -> Reports:
        return reports_of(PLACES, sensor.h(x, PLACES) + noise * rng.standard_normal((4, 2)))

    for _ in range(6):
        x = x + np.array([2.0, 1.0, 0.0, 0.0])
        state, _ = tracker.step(state, heard(x), 1.0, rng)
    last = heard(x + np.array([2.0, 1.0, 0.0, 0.0]))
    wild = last.readings[0].values.copy()
    wild[2] += [0.0, 60.0]
    after, spoilt = tracker.step(state, reports_of(PLACES, wild), 1.0, rng)
    _, alone = tracker.step(state, last.only(np.array([0, 1, 3])), 1.0, rng)
    return spoilt.mean, alone.mean, after.suspicion["n2"] / max(p for id, p in after.suspicion.items() if id != "n2")


def test_readings_of_several_numbers_are_left_out_together() -> None:
    spoilt, alone, suspected = accepted(Knowing())
    assert np.array_equal(spoilt, alone)
    assert suspected > 10.0


def test_readings_that_may_come_from_anywhere_nobody_knows_are_always_used() -> None:
    spoilt, alone, suspected = accepted(Ranger())
    assert not np.allclose(spoilt, alone, atol=0.1)
    assert suspected == pytest.approx(1.0)


def test_a_path_is_as_long_as_it_says() -> None:
    assert field("energy").truth(np.random.default_rng(0)).shape == (STEPS + 1, 5)
