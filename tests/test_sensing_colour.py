"""Shadowing that changes slowly, or never: its variance, its correlation in time, and what it belongs to."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import pytest

from tests.rangers import Ranger
from tests.sensing import registered
from trackfield.filters.types import Array
from trackfield.models.noise import Colour
from trackfield.sensing.complete import Kind
from trackfield.sensing.kinds import make_sensor
from trackfield.sensing.rss import Rss
from trackfield.world.path import Path
from trackfield.world.placed import Placed
from trackfield.world.scene import Scene

NS: Final = 1_000_000_000
STILL: Final = Scene((Path.of([(0.0, 30.0, 0.0, 0.0, 0.0), (1000.0, 30.0, 0.0, 0.0, 0.0)]),))
SLOW_S: Final = 8.0
SENSORS: Final = 4000
LAGS: Final = (0.0, SLOW_S / 2.0, SLOW_S, 2.0 * SLOW_S)
MARGIN: Final = 4.5 / SENSORS**0.5
"""4.5 standard errors of a correlation: each of these fails with a probability of 7e-6 if the code is right."""


def sensor(number: int, slow: float, fixed: float, *, seed: int = 1, incarnation: int = 0) -> Placed:
    kind = Kind("rss", Rss(slow=slow, slow_s=SLOW_S, fixed=fixed))
    return Placed(f"n{number}", (0.0, 0.0), STILL, ((0, 1000 * NS),), kind, {}, 0.0, seed, incarnation)


def noise(one: Placed, t_s: float) -> float:
    """The noise of a reading, in its standard deviations."""
    reading = one.sample(round(t_s * NS))
    assert reading is not None
    return (reading.values[0] + 40.0 + 30.0 * float(np.log10(30.0))) / 4.0


def noises(slow: float, fixed: float, times_s: tuple[float, ...]) -> Array:
    """(sensors, times)"""
    return np.array([[noise(sensor(i, slow, fixed), t) for t in times_s] for i in range(SENSORS)])


def common(lag: float) -> float:
    """The correlation of what is slow, ``lag`` times ``slow_s`` apart: the mean over where an interval begins."""
    p = (np.arange(100_000) + 0.5) / 100_000
    q = p + lag
    size = np.hypot(1.0 - p, p)
    inside, after = q - np.floor(q), np.floor(q)
    other = np.hypot(1.0 - inside, inside)
    same = ((1.0 - p) * (1.0 - inside) + p * inside) / (size * other)
    following = p * (1.0 - inside) / (size * other)
    return float(np.where(after == 0, same, np.where(after == 1, following, 0.0)).mean())


def test_what_the_correlation_is() -> None:
    """Half an interval apart most of it is common; at a whole one the integral of p (1 - p) / (p^2 + (1 - p)^2)."""
    exact = [1.0, np.pi / 4.0 - 0.5, 0.0]
    assert [common(lag) for lag in (0.0, 1.0, 2.0)] == pytest.approx(exact, abs=1e-6)
    assert 0.7 < common(0.5) < 0.8


@pytest.mark.parametrize(("slow", "fixed"), [(1.0, 0.0), (0.5, 0.3), (0.0, 1.0), (0.0, 0.0)])
def test_its_variance_is_one_and_its_correlation_as_it_should_be(slow: float, fixed: float) -> None:
    start = 3.7
    found = noises(slow, fixed, tuple(start + lag for lag in LAGS))
    assert found.var(axis=0) == pytest.approx(1.0, abs=4.5 * (2.0 / SENSORS) ** 0.5)
    assert found.mean(axis=0) == pytest.approx(0.0, abs=MARGIN)
    for k, lag in enumerate(LAGS[1:], start=1):
        exact = slow * common(lag / SLOW_S) + fixed
        assert np.mean(found[:, 0] * found[:, k]) == pytest.approx(exact, abs=4.5 * (2.0 / SENSORS) ** 0.5), lag


def test_sensors_and_seeds_have_nothing_in_common() -> None:
    one, other = (np.array([noise(sensor(i, 0.5, 0.5, seed=seed), 5.0) for i in range(SENSORS)]) for seed in (1, 2))
    assert abs(np.mean(one * other)) < MARGIN
    assert abs(np.mean(one[1:] * one[:-1])) < MARGIN


def test_a_node_that_starts_again_has_the_surroundings_that_it_had() -> None:
    before, after = (sensor(7, 0.7, 0.3, incarnation=life) for life in (0, 1))
    for t in (5.0, 9.1):  # but for rounding, nothing is its own
        assert noise(before, t) == pytest.approx(noise(after, t), abs=1e-6)
    first, second = (
        np.array([noise(sensor(i, 0.4, 0.3, incarnation=life), 5.0) for i in range(SENSORS)]) for life in (0, 1)
    )
    assert (first != second).all()
    assert np.mean(first * second) == pytest.approx(0.7, abs=4.5 * (2.0 / SENSORS) ** 0.5)


FIXED: Final = Colour(slow=0.0, slow_s=1.0, fixed=1.0)


@dataclass(frozen=True)
class Coloured(Ranger):
    """A user's kind, whose readings have two numbers."""

    colour: Colour | None = FIXED


def test_a_users_kind_has_it_for_each_of_its_numbers() -> None:
    """With a fixed part alone, each number is off by a constant of its own."""
    with registered(coloured=Coloured):
        kind = make_sensor("coloured", {})
    one = Placed("n1", (0.0, 0.0), STILL, ((0, 1000 * NS),), kind, {}, 0.0, 1)
    read = {reading.values for t in range(5) if (reading := one.sample(t * NS))}
    assert len(read) == 1
    ((away, east),) = read
    assert (away - 30.0) / 0.5 != pytest.approx((east - 30.0) / 2.0)
    white = Placed("n1", (0.0, 0.0), STILL, ((0, 1000 * NS),), Kind("white", Coloured(colour=None)), {}, 0.0, 1)
    other = {reading.values for t in range(5) if (reading := white.sample(t * NS))}
    assert len(other) == 5


def test_it_goes_from_one_reading_to_the_next_without_a_jump() -> None:
    one = sensor(3, 1.0, 0.0)
    steps = np.array([noise(one, 0.01 * k) for k in range(8000)])
    assert np.abs(np.diff(steps)).max() < 0.05
    assert steps.std() > 0.3


def test_a_pause_of_a_node_does_not_shift_it() -> None:
    one = sensor(3, 0.6, 0.2)
    alone = noise(one, 40.0)
    for t in range(20):
        noise(one, float(t))
    assert noise(one, 40.0) == alone == noise(replace(one), 40.0)
