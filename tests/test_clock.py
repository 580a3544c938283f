"""Local clocks: exact integers both ways."""

from __future__ import annotations

from fractions import Fraction

import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

from trackfield.link import Clock

NS = 1_000_000_000
HOUR = 3600 * NS
YEAR = 8766 * HOUR
times = st.integers(-(10**15), 10**18)
offsets = st.integers(-(10**12), 10**12)
steady = st.builds(Clock, offsets, st.integers(-NS + 1, 10 * NS))
ramped = st.builds(Clock, offsets, st.integers(-(10**6), 10**6), st.integers(-110_000, 110_000).filter(bool))
clocks = steady | ramped


def test_a_perfect_clock() -> None:
    assert Clock().local(123) == Clock().true(123) == 123


def test_offset_and_drift() -> None:
    slow = Clock(offset_ns=5_000_000, drift_ppb=-20_000)  # 5 ms ahead at first, loses 20 us a second
    assert slow.local(0) == 5_000_000
    assert slow.local(100 * NS) == 100 * NS + 5_000_000 - 2_000_000
    assert slow.true(slow.local(100 * NS)) == 100 * NS


@given(steady, times)
def test_local_is_true_time_plus_offset_plus_drift(clock: Clock, t: int) -> None:
    assert clock.local(t) == t + clock.offset_ns + t * clock.drift_ppb // NS


@given(clocks, times)
@example(Clock(0, -NS + 1), 10**12)
@example(Clock(0, 1), NS - 1)
@example(Clock(0, 0, 1), 10**18)
@example(Clock(0, 0, -110_000), YEAR)
@example(Clock(0, 0, 110_000), -YEAR)
@example(Clock(-7, -1_000_000, -113_000), YEAR + 1)
def test_true_is_the_first_instant_at_which_the_clock_shows_it(clock: Clock, shown: int) -> None:
    t = clock.true(shown)
    assert clock.local(t - 1) < shown <= clock.local(t)


@given(clocks, times, st.integers(0, 10**6))
def test_a_clock_never_turns_back(clock: Clock, t: int, later: int) -> None:
    assert clock.local(t) <= clock.local(t + later)
    assert clock.true(t) <= clock.true(t + later)


@given(st.builds(Clock, offsets, st.integers(0, 10**5), st.integers(0, 10**4)), st.integers(0, 10**18))
def test_a_fast_clock_is_inverted_exactly(clock: Clock, t: int) -> None:
    """It never shows the same reading twice, so no instant is lost on the way there and back."""
    assert clock.true(clock.local(t)) == t


@pytest.mark.parametrize("ppb", [-NS, -NS - 1])
def test_a_clock_must_run_forwards(ppb: int) -> None:
    with pytest.raises(ValueError, match="drift_ppb"):
        Clock(0, ppb)


# --- a ramp ---


def test_a_drift_that_grows_by_1_ppm_in_an_hour_has_gained_1800_us_by_then() -> None:
    """The mean drift of the hour is 0.5 ppm; in two hours it gains four times as much."""
    clock = Clock(ramp_ppb_per_h=1000)
    assert clock.local(HOUR) == HOUR + 1_800_000
    assert clock.local(2 * HOUR) == 2 * HOUR + 7_200_000
    assert clock.local(-HOUR) == -HOUR + 1_800_000  # it was losing before
    assert Clock(5, 2000, -1000).local(2 * HOUR) == 2 * HOUR + 5 + 2 * 7_200_000 - 7_200_000


@given(ramped, st.integers(-YEAR, YEAR))
def test_local_with_a_ramp_is_the_integral_of_the_drift(clock: Clock, t: int) -> None:
    drift = Fraction(clock.drift_ppb, NS)
    ramp = Fraction(clock.ramp_ppb_per_h, NS * HOUR)
    exact = t + drift * t + ramp * t * t / 2
    assert clock.local(t) == exact.__floor__() + clock.offset_ns


@given(ramped, st.integers(0, 10**17), st.sampled_from([-1, 1]))
def test_after_a_year_the_drift_stays(clock: Clock, later: int, side: int) -> None:
    """So that a clock is never turned back, however far one looks."""
    end = side * YEAR
    drift_ppb = clock.drift_ppb + side * 8766 * clock.ramp_ppb_per_h
    gained = clock.local(end + side * later) - clock.local(end)
    assert abs(gained - side * later - Fraction(side * later * drift_ppb, NS)) < 1


@given(offsets, st.integers(-(10**6), 10**6), times)
def test_a_ramp_of_nothing_changes_nothing(offset: int, drift: int, t: int) -> None:
    assert Clock(offset, drift, 0) == Clock(offset, drift)
    assume(abs(t) < 10**15)
    assert abs(Clock(offset, drift, 1).local(t) - Clock(offset, drift).local(t)) <= t * t // (2 * NS * HOUR) + 1


@pytest.mark.parametrize("ramp", [-114_078, 114_078, 10**9])
def test_a_ramp_must_not_turn_a_clock_back_within_a_year(ramp: int) -> None:
    with pytest.raises(ValueError, match="ramp_ppb_per_h"):
        Clock(0, 0, ramp)


@pytest.mark.parametrize("ramp", [-114_077, 114_077])
def test_the_steepest_ramp(ramp: int) -> None:
    clock = Clock(0, 0, ramp)
    assert clock.local(-YEAR) < clock.local(-YEAR + HOUR) < clock.local(YEAR - HOUR) < clock.local(YEAR)


# --- a jump ---


@given(clocks, st.integers(-(10**12), 10**12), times)
def test_a_jump_shows_at_any_time(clock: Clock, by: int, t: int) -> None:
    jumped = clock.jumped(by)
    assert jumped.local(t) == clock.local(t) + by
    assert jumped.true(t + by) == clock.true(t)
    assert jumped.jumped(-by) == clock
