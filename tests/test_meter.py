"""Sums of time and energy, in whole numbers: by hand, and that nothing of them is ever lost."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from trackfield.drivers.engine.meter import NOTHING, Activity, Meter, spent
from trackfield.link.energy import CAUSES, DEVICES, Power

POWER = Power(send_uw=7, receive_uw=5, listen_uw=3, sleep_uw=1, sample_fj=1000, battery_fj=10_000)


def test_energy_is_power_times_time_by_cause() -> None:
    """uW times ns are fJ."""
    assert Activity(10, 20, 30, 40, 2).energy_fj(POWER) == {
        "send": 70, "receive": 100, "listen": 90, "sleep": 40, "sense": 2000,
    }  # fmt: skip
    assert tuple(NOTHING.energy_fj(POWER)) == CAUSES


def test_a_second_of_listening_on_a_cc2420() -> None:
    """62.4 mW with the node's 6 mW: so many mJ, which are 1e12 fJ each."""
    assert Meter().at(10**9).activity.energy_fj(DEVICES["cc2420"])["listen"] == 62_400 * 10**9


def test_what_all_did_together() -> None:
    assert Activity.total([Activity(1, 2, 3, 4, 5), Activity(10, 20, 30, 40, 50)]) == Activity(11, 22, 33, 44, 55)
    assert Activity.total([]) == NOTHING
    assert spent({"activity": [1, 2, 3, 4, 5], "inherited": [1, 1, 1, 1, 1]}) == Activity(2, 3, 4, 5, 6)


def test_time_passes_listening_or_asleep() -> None:
    meter = Meter(since_ns=100).at(130)._replace(on=False).at(170)
    assert meter == Meter(Activity(listen_ns=30, sleep_ns=40), 170, on=False)
    assert meter.at(170) == meter


def test_what_is_sent_and_received_is_not_listened_or_slept() -> None:
    """The frame of 30 ns is counted when it leaves; only 30 ns later is there a moment to listen again."""
    meter = Meter().at(100).used(send_ns=30, receive_ns=5, samples=1)
    assert meter.activity == Activity(30, 5, 65, 0, 1)
    assert meter.since_ns == 100
    asleep = Meter(on=False).used(send_ns=30)
    assert asleep.activity == Activity(send_ns=30, sleep_ns=-30)
    assert asleep.at(30).activity == Activity(send_ns=30)


@pytest.mark.parametrize(("spent_ns", "left"), [(0, 10_000), (3333, 1), (3334, 0), (9999, 0)])
def test_what_is_left_is_never_less_than_nothing(spent_ns: int, left: int) -> None:
    assert Meter().at(spent_ns).left_fj(POWER) == left


def test_when_it_is_empty() -> None:
    assert Meter().falls_ns(POWER, 0) == 3334
    assert Meter(since_ns=50, on=False).falls_ns(POWER, 0) == 10_050
    assert Meter().at(9999).falls_ns(POWER, 0) == 9999
    assert Meter().falls_ns(DEVICES["cc2420"], 0) is None  # on mains


steps = st.lists(
    st.one_of(
        st.tuples(st.just("pass"), st.integers(0, 10**12)),
        st.tuples(st.just("send"), st.integers(0, 10**9)),
        st.tuples(st.just("receive"), st.integers(0, 10**9)),
        st.tuples(st.just("switch"), st.booleans()),
    )
)


def played(meter: Meter, story: list[tuple[str, int]]) -> Meter:
    for what, amount in story:
        if what == "pass":
            meter = meter.at(meter.since_ns + amount)
        elif what == "switch":
            meter = meter._replace(on=bool(amount))
        else:
            meter = meter.used(**{f"{what}_ns": amount})
    return meter


@given(steps, st.integers(0, 10**12))
def test_all_moments_add_up_to_the_time_that_passed(story: list[tuple[str, int]], start: int) -> None:
    meter = played(Meter(since_ns=start), story)
    assert sum(meter.activity[:4]) == meter.since_ns - start
    assert meter.activity.send_ns == sum(amount for what, amount in story if what == "send")
    assert meter.activity.receive_ns == sum(amount for what, amount in story if what == "receive")


@given(steps, st.integers(1, 10**18))
def test_it_is_empty_at_the_very_moment_that_was_foretold(story: list[tuple[str, int]], battery_fj: int) -> None:
    power = Power(7, 5, 3, 1, battery_fj=battery_fj)
    meter = played(Meter(), story)
    at = meter.falls_ns(power, 0)
    assert at is not None
    assert meter.at(at).left_fj(power) == 0
    if at > meter.since_ns:
        assert meter.at(at - 1).left_fj(power) != 0
