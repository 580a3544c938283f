"""What trackers are given of a step's reports, and how a track starts from them, with kinds of a user's own."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import trackfield as tf
from tests.rangers import Distance, Ranger
from tests.sensing import arrays, model_of, registered, reports_of
from trackfield.filters.trackers import make_tracker
from trackfield.filters.types import Gaussian
from trackfield.tracking.bank import Bank
from trackfield.tracking.following import Following
from trackfield.wire.messages import Doa, Measurement

PLACES = (("a", 0.0, 0.0), ("b", 50.0, 0.0))
OWN = {"kind": "distance", "options": {}}


def bank(**sensing: Any) -> Bank:
    kinds = {"doa": ["a"], **{name: ["b"] for name in sensing if name != "doa"}} if len(sensing) > 1 else None
    return Bank(trackers=["ekf"], sensors=PLACES, step_ns=10**9, seed=1, sensing=sensing, kinds=kinds)


def test_arrays_report_bearings_and_levels_and_h_predicts_the_first() -> None:
    reports = bank(**arrays())._reports(1, {"a": Doa(1, 90.0, 60.0), "b": Doa(1, 45.0, 50.0)})
    assert reports.bearings == pytest.approx(np.radians([90.0, 45.0]))
    assert reports.levels == pytest.approx([60.0, 50.0])
    assert reports.values == pytest.approx(np.radians([[90.0], [45.0]]))
    assert reports.only(np.array([1])).values == pytest.approx(np.radians([[45.0]]))


def test_two_groups_of_arrays_have_all_their_bearings() -> None:
    two = bank(**arrays(), **{"doa-2": {"kind": "doa", "options": {}}})
    reports = two._reports(1, {"a": Doa(1, 90.0, 60.0), "b": Doa(1, 45.0, 50.0)})
    assert reports.bearings == pytest.approx(np.radians([90.0, 45.0]))


def test_of_sensors_without_bearings_they_are_not_a_number() -> None:
    """A distance, or the second of two numbers, is never taken for one."""
    with registered(distance=Distance, ranger=Ranger):
        one = bank(own=OWN)._reports(1, {"a": Measurement(1, (500,)), "b": Measurement(1, (300,))})
        two = bank(own={"kind": "ranger", "options": {}})._reports(1, {"a": Measurement(1, (500, 20))})
        mixed = bank(**arrays(), own=OWN)._reports(1, {"a": Doa(1, 90.0, 60.0), "b": Measurement(1, (300,))})
    assert one.values == pytest.approx(np.array([[5.0], [3.0]]))
    for reports in (one, two, mixed, one.only(np.array([0]))):
        assert reports.bearings.shape == reports.levels.shape == (len(reports),)
        assert np.isnan(reports.bearings).all() and np.isnan(reports.levels).all()


class Fixing(Distance):
    """Starts a track as it is told."""

    found: Any = None

    def fix(self, z: Any, at: Any, anywhere: Any) -> Any:
        assert len(z), "never called without readings"
        return self.found


def start(found: Any, readings: int = 3) -> Any:
    sensor = Fixing()
    object.__setattr__(sensor, "found", found)
    following: Following[Any] = Following(make_tracker("ekf"), model_of(sensor))
    reports = reports_of(np.zeros((readings, 2)), np.ones((readings, 1)))
    return following.step(following.begin(None), reports, 1.0, np.random.default_rng(1))[1]


def test_a_kinds_own_start_is_not_asked_for_without_readings() -> None:
    assert start(Gaussian(np.zeros(4), np.eye(4)), readings=0) is None
    assert start(Gaussian(np.zeros(4), np.eye(4))).mean.tolist() == [0.0] * 4
    assert start(None) is None


@pytest.mark.parametrize(
    ("found", "says"),
    [
        (Gaussian(np.zeros(2), np.eye(2)), r"mean is of shape \(2,\); expected an array of shape \(4,\)"),
        (Gaussian(np.zeros(4), np.eye(2)), r"covariance is of shape \(2, 2\); expected an array of shape \(4, 4\)"),
        (Gaussian(np.full(4, np.nan), np.eye(4)), "mean is not finite"),
        ((0.0, 0.0), " returned tuple; expected a Gaussian or None"),
    ],
)
def test_a_start_that_is_none_is_told_with_its_kind(found: Any, says: str) -> None:
    with pytest.raises(tf.RunFailed, match=rf"sensor 'own': fix.*{says}"):
        start(found)
