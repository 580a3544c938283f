"""Trackers on reports of passes: how near to the bound, and whether their covariances are right; who is refused.

The field is that of docs/trackers.md, in fewer runs. Over 12 runs the ratio of rms errors has an sd of about 0.15.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from tests.passing_field import DT, FIELDS, PRIOR, TIMES, Cell, Field, cell, refused
from trackfield.filters.gaussian import Gaussian
from trackfield.filters.needs import unmet
from trackfield.filters.rng import generator
from trackfield.filters.trackers import NOT_ROBUST, TRACKERS, make_tracker
from trackfield.filters.types import Readings, Reports
from trackfield.sensing.kinds import make_sensor
from trackfield.tracking.following import Following, doubts

RUNS = range(12)


@cache
def found(name: str, field: str, *, alone: bool) -> Cell:
    return cell(name, Field(FIELDS[field]), RUNS, alone=alone)


@pytest.mark.parametrize("field", ["level known", "level unknown", TIMES])
@pytest.mark.parametrize("name", ["ukf", "gpf-ukf"])
def test_from_a_prior_filters_reach_the_bound(name: str, field: str) -> None:
    one = found(name, field, alone=False)
    assert one.tracked == 1.0
    assert 0.6 < one.ratio < 1.5


@pytest.mark.parametrize("field", ["level known", "level unknown"])
@pytest.mark.parametrize("name", ["ukf", "ekf", "gpf-ukf", "imm-ukf"])
def test_from_reports_alone_they_start_with_the_first_event(name: str, field: str) -> None:
    """All have a track when the first cluster lies behind the target."""
    one = found(name, field, alone=True)
    assert one.tracked == 1.0
    assert 0.6 < one.ratio < 1.5


@pytest.mark.parametrize(("field", "alone"), [("level known", False), ("level unknown", True), (TIMES, False)])
def test_a_ukf_is_as_sure_as_it_should_be(field: str, alone: bool) -> None:
    one = found("ukf", field, alone=alone)
    low, high = one.band
    assert 0.8 * low < float(np.nanmean(one.nees)) < 1.25 * high


def test_a_bootstrap_filter_takes_times() -> None:
    """With the precise strengths besides its particles are too few (docs/trackers.md)."""
    assert found("bootstrap", TIMES, alone=False).ratio < 1.5


def test_the_likeliest_path_is_near_the_bound_and_as_sure_as_it_should_be() -> None:
    """It forgets the events before the last, and knows no level; docs/trackers.md has 1.5 times the bound."""
    one = found("ml", "level unknown", alone=True)
    assert one.tracked > 0.75
    assert 1.0 < one.ratio < 2.2
    low, high = one.band
    assert 0.6 * low < float(np.nanmean(one.nees)) < 1.4 * high


def test_filters_that_go_on_from_event_to_event_know_more_than_the_last_one_tells() -> None:
    assert found("ukf", "level unknown", alone=True).ratio < 0.8 * found("ml", "level unknown", alone=True).ratio


# --- who is refused ---


@pytest.mark.parametrize("range_m", [10.0, 50.0, 500.0])
def test_trackers_that_move_particles_first_need_readings_of_positions(range_m: float) -> None:
    """A pass depends on the velocity, however near the sensors are."""
    kinds = {"cpa": make_sensor("cpa", {"range_m": range_m})}
    for name in ("rbpf", "mrbpf", "mrbpf-weightmass", "jm-rbpf"):
        assert unmet(TRACKERS[name], kinds) == (
            "takes readings that do not depend on the target's velocity, and the sensors are of kind cpa"
        )


def test_solvers_take_reports_of_passes_alone() -> None:
    doa, cpa = make_sensor("doa", {}), make_sensor("cpa", {})
    for name in ("cpa", "ecpa", "ml"):
        assert unmet(TRACKERS[name], {"cpa": cpa}) is None
        assert unmet(TRACKERS[name], {"doa": doa}) == "takes reports of passes only, and the sensors are of kind doa"
        both = unmet(TRACKERS[name], {"doa": doa, "cpa": cpa})
        assert both == "takes sensors of one kind only, and the sensors are of kind doa, cpa"
        assert name in NOT_ROBUST


def test_all_others_take_them() -> None:
    able = {name for name in TRACKERS.own if not refused(name, Field({}))}
    assert able >= {"ukf", "ekf", "imm-ukf", "gpf-ukf", "bootstrap", "upf", "fa-upf", "cpa", "ecpa", "ml"}
    assert "spcpf" not in able
    assert not refused("spcpf", Field({"use_strength": False}))


# --- reports that are not the target's ---


def test_reports_from_anywhere_raise_doubts_and_those_of_the_target_do_not() -> None:
    of = Field(FIELDS["level known"])
    run = of.run(3)
    following = Following(make_tracker("ukf"), of.model)
    state, sums = following.begin(Gaussian(run.truth[0], PRIOR)), []
    rng = np.random.default_rng(1)
    for reports in run.heard:
        state, estimate = following.step(state, reports, DT, generator(1, "ukf", reports.step))
        assert estimate is not None
        values = np.stack(
            (-rng.uniform(0.0, 6.5, len(reports)), rng.uniform(25.0, 60.0, len(reports)), np.ones(len(reports))),
            axis=-1,
        )
        false = Reports(reports.step, reports.sensors, reports.positions, (Readings("cpa", values),), 2)
        sums.append((doubts(of.model, estimate, reports), doubts(of.model, estimate, false)))
    theirs, others = np.sum(sums, axis=0)
    assert theirs < -10.0
    assert others > 10.0


def test_an_outlier_does_not_throw_a_robust_filter_off() -> None:
    """One time of a pass is 1 s off, ten standard deviations."""
    of = Field(FIELDS[TIMES])
    run = of.run(4)
    (wrong,) = (k for k, one in enumerate(run.heard) if one is next(one for one in run.heard[20:] if len(one)))
    off = {}
    for robust in (False, True):
        following = Following(make_tracker("ukf", {"robust": robust}), of.model)
        state = following.begin(Gaussian(run.truth[0], PRIOR))
        for k, reports in enumerate(run.heard[: wrong + 1]):
            if k == wrong:
                reports.readings[0].values[0, 0] += 1.0
            state, estimate = following.step(state, reports, DT, generator(1, "ukf", reports.step))
            if k == wrong:
                reports.readings[0].values[0, 0] -= 1.0
        assert estimate is not None
        off[robust] = float(np.hypot(*(estimate.mean[:2] - run.truth[wrong + 1, :2])))
    assert off[True] < 0.7 * off[False]
