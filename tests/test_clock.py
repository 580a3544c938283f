"""Local clocks: exact integers both ways."""

from __future__ import annotations

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from trackfield.link import Clock

NS = 1_000_000_000
times = st.integers(-(10**15), 10**18)
clocks = st.builds(Clock, st.integers(-(10**12), 10**12), st.integers(-NS + 1, 10 * NS))


def test_a_perfect_clock() -> None:
    assert Clock().local(123) == Clock().true(123) == 123


def test_offset_and_drift() -> None:
    slow = Clock(offset_ns=5_000_000, drift_ppb=-20_000)  # 5 ms ahead at first, loses 20 us a second
    assert slow.local(0) == 5_000_000
    assert slow.local(100 * NS) == 100 * NS + 5_000_000 - 2_000_000
    assert slow.true(slow.local(100 * NS)) == 100 * NS


@given(clocks, times)
def test_local_is_true_time_plus_offset_plus_drift(clock: Clock, t: int) -> None:
    assert clock.local(t) == t + clock.offset_ns + t * clock.drift_ppb // NS


@given(clocks, times)
@example(Clock(0, -NS + 1), 10**12)
@example(Clock(0, 1), NS - 1)
def test_true_is_the_first_instant_at_which_the_clock_shows_it(clock: Clock, shown: int) -> None:
    t = clock.true(shown)
    assert clock.local(t - 1) < shown <= clock.local(t)


@given(clocks, times, st.integers(0, 10**6))
def test_a_clock_never_turns_back(clock: Clock, t: int, later: int) -> None:
    assert clock.local(t) <= clock.local(t + later)
    assert clock.true(t) <= clock.true(t + later)


@given(st.builds(Clock, st.integers(-(10**12), 10**12), st.integers(0, 10**5)), times)
def test_a_fast_clock_is_inverted_exactly(clock: Clock, t: int) -> None:
    """It never shows the same reading twice, so no instant is lost on the way there and back."""
    assert clock.true(clock.local(t)) == t


@pytest.mark.parametrize("ppb", [-NS, -NS - 1])
def test_a_clock_must_run_forwards(ppb: int) -> None:
    with pytest.raises(ValueError, match="drift_ppb"):
        Clock(0, ppb)
