"""Passes found in what is heard, and none where there is none."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.detectors import found, rms
from tests.sounds import NO_PASS, heard, no_pass, passing, read, straight
from trackfield.acoustics.fitting import Curve, fitted
from trackfield.acoustics.listener import DETECTORS, Listener
from trackfield.acoustics.microphone import Microphone
from trackfield.acoustics.signals import RATE
from trackfield.acoustics.sources import engine
from trackfield.world.path import Path as Course

DataFile = Callable[[str], Path]


def test_energies_on_a_curve_give_the_curve() -> None:
    t_s = np.arange(0.01, 8.0, 0.02)
    true = Curve(5.3, 0.8, 0.02, 0.001)
    earlier = Curve(1.0, 0.5, 0.01, 0.0).at(t_s)
    fit = fitted(t_s, true.at(t_s) + true.floor + earlier, earlier, Curve(5.0, 0.7, 0.01, 0.0005))
    assert fit is not None
    assert fit.curve == pytest.approx(true, rel=1e-3)
    assert fit.residual_db < 0.01
    assert fit.explained > 0.9999


def test_sds_of_a_fit_are_those_of_its_errors() -> None:
    """Gamma variates with 76 degrees of freedom, as 20 ms of noise have: the ratio's 95 % bounds for 200 draws."""
    rng = np.random.default_rng(1)
    t_s, true = np.arange(0.01, 8.0, 0.02), Curve(6.0, 1.2, 0.01, 0.001)
    power = true.at(t_s) + true.floor
    fits = [fitted(t_s, power * rng.chisquare(76, len(t_s)) / 76.0, 0.0 * t_s, true) for _ in range(200)]
    scores = np.array([(fit.curve.peak_s - true.peak_s) / fit.time_sd_s for fit in fits if fit is not None])
    assert len(scores) == 200
    assert 0.85 < rms(scores) < 1.15
    assert abs(scores.mean()) < 0.3


@given(st.lists(st.integers(1, 30_000), min_size=1, max_size=10))
@settings(max_examples=5)
def test_the_same_passes_whatever_the_pieces(sizes: list[int]) -> None:
    listener, told, at = Listener(), [], 0
    while at < len(PASS):
        told += listener.feed(PASS[at : at + sizes[0]])
        at, sizes = at + sizes[0], [*sizes[1:], sizes[0]]
    assert told == Listener().feed(PASS)
    assert len(told) == 1


PASS, PEAK_S = passing(5, 10.0, 15.0, 10.0, peak_s=6.0)


def test_a_pass_is_told_a_second_after_its_peak_and_not_before() -> None:
    listener = Listener()
    for first in range(0, len(PASS), 100):
        if told := listener.feed(PASS[first : first + 100]):
            (one,) = told
            assert one.known_s == pytest.approx((first + 100) / RATE, abs=0.101)
            assert 1.0 <= one.known_s - one.peak_s <= 1.2
            assert first / RATE - PEAK_S < 1.2
            return
    pytest.fail("no pass was told")


@pytest.mark.parametrize(("distance_m", "speed_m_s"), [(5.0, 13.4), (20.0, 13.4)])
def test_each_detector_errs_as_far_as_it_should(distance_m: float, speed_m_s: float) -> None:
    """Standard deviations in widths, at 10 dB: about .3, .13 and .015, more by the fit after one second."""
    argmax, smooth, fit = found(
        [partial(Listener, name) for name in DETECTORS], distance_m, speed_m_s, 10.0, range(100, 108)
    )
    assert fit.share == 1.0
    assert 0.1 < rms(argmax.errors) < 0.6
    assert 0.04 < rms(smooth.errors) < 0.26
    assert rms(fit.errors) < 0.06
    assert 0.3 < rms(fit.scores) < 2.5
    assert rms(fit.widths - 1.0) < 0.1
    assert rms(fit.strengths_db) < 0.6


@pytest.mark.parametrize(("distance_m", "speed_m_s"), [(3.0, 13.4), (20.0, 13.4), (30.0, 12.0)])
def test_at_3_db_each_pass_is_told_once(distance_m: float, speed_m_s: float) -> None:
    (fit,) = found([Listener], distance_m, speed_m_s, 3.0, range(200, 206))
    assert fit.share == 1.0
    assert rms(fit.errors) < 0.2
    assert fit.delays_s.max() < 2.0


@pytest.mark.parametrize("name", tuple(NO_PASS))
def test_of_what_is_no_pass_nothing_is_told(name: str) -> None:
    for seed in (1, 2):
        assert Listener().feed(no_pass(name, seed)) == []


def test_a_second_vehicle_is_told_from_the_first() -> None:
    first, second = straight(6.0, 14.0, 10.0), straight(8.0, -16.0, 15.0)
    both = Microphone([first, second], (0.0, 0.0), [engine(1, "a"), engine(1, "b")], seed=1, id="n", sound_m_s=340.0)
    told = Listener().feed(heard(both, 20.0))
    assert [one.peak_s for one in told] == pytest.approx([10.0 + 6.0 / 340.0, 15.0 + 8.0 / 340.0], abs=0.05)


def test_a_vehicle_that_stops_where_it_is_nearest_and_drives_on_gives_no_fast_pass() -> None:
    """Whatever is told while it stands is as uncertain as it is wide."""
    stopping = Course.of([(0.0, -80.0, 6.0, 12.0, 0.0), (12.0, -3.0, 6.0, 0.0, 0.0), (30.0, -3.0, 6.0, 0.0, 0.0)])
    there = Microphone([stopping], (0.0, 0.0), [engine(2, "a")], seed=2, id="n")
    assert all(one.width_s > 0.5 for one in Listener().feed(heard(there, 30.0)))


def test_before_and_after_a_recording_there_may_be_silence() -> None:
    (alone,) = Listener().feed(PASS)
    (among,) = Listener().feed(np.concatenate((np.zeros(40 * RATE), PASS, np.zeros(40 * RATE))))
    assert among.peak_s - 40.0 == pytest.approx(alone.peak_s, abs=0.01)
    assert among.width_s == pytest.approx(alone.width_s, rel=0.03)


def test_what_is_kept_does_not_grow() -> None:
    listener = Listener()
    for _ in range(4):
        listener.feed(np.random.default_rng(1).standard_normal(20 * RATE))
    assert {len(part) for part in listener.heard} == {1_500}
    assert len(listener.passes) <= 2


def test_louder_by_ten_decibels_is_stronger_by_ten() -> None:
    (one,), (louder,) = Listener().feed(PASS), Listener().feed(PASS * np.sqrt(10.0))
    assert louder.strength_db - one.strength_db == pytest.approx(10.0, abs=1e-6)
    assert louder.peak_s == pytest.approx(one.peak_s, abs=1e-6)


def test_another_rate_finds_the_same() -> None:
    (here,) = Listener().feed(PASS)
    (there,) = Listener(rate=8_000).feed(np.repeat(PASS, 2))
    assert there.peak_s == pytest.approx(here.peak_s, abs=0.01)
    with pytest.raises(ValueError, match="no multiple of 50"):
        Listener(rate=4_410)


@pytest.mark.parametrize(
    ("name", "peak_s"), [("car_20mph_2.5m_15C.wav", 4.56), ("car_28mph.wav", 2.68)], ids=["20 mph", "28 mph"]
)
def test_a_car_is_told_once_and_when(data_file: DataFile, name: str, peak_s: float) -> None:
    (one,) = Listener().feed(read(data_file(name)))
    assert one.peak_s == pytest.approx(peak_s, abs=0.15)
    assert one.known_s - one.peak_s <= 1.2
