"""Sums of time and energy, in whole numbers: by hand, and that nothing of them is ever lost."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from trackfield.drivers.engine.meter import NOTHING, Activity, Meter, Side, done, spent
from trackfield.drivers.engine.receiver import Windows
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
    assert Meter.new().at(10**9).activities["field"].energy_fj(DEVICES["cc2420"])["listen"] == 62_400 * 10**9


def test_what_all_did_together() -> None:
    assert Activity.total([Activity(1, 2, 3, 4, 5), Activity(10, 20, 30, 40, 50)]) == Activity(11, 22, 33, 44, 55)
    assert Activity.total([]) == NOTHING
    record = {"activity": {"field": [1, 2, 3, 4, 5], "backbone": [6, 0, 0, 0, 0]}, "inherited": {"field": [1] * 5}}
    assert done(record) == {"field": Activity(1, 2, 3, 4, 5), "backbone": Activity(6)}
    assert spent(record) == {"field": Activity(2, 3, 4, 5, 6), "backbone": Activity(6)}


def test_time_passes_listening_or_asleep() -> None:
    meter = Meter.new(since_ns=100).at(130).switched("field", False).at(170)
    asleep = Side(Activity(listen_ns=30, sleep_ns=40), opening=False, since_ns=130, before=True)
    assert meter == Meter({"field": asleep}, 170)
    assert meter.at(170) == meter


def test_what_is_sent_and_received_is_not_listened_or_slept() -> None:
    """The frame of 30 ns is counted when it leaves; only 30 ns later is there a moment to listen again."""
    meter = Meter.new().at(100).received("field", 5).sent("field", 100, 30).sensed()
    assert meter.activities["field"] == Activity(30, 5, 65, 0, 1)
    assert meter.since_ns == 100
    asleep = Meter.new().switched("field", False).sent("field", 0, 30)
    assert asleep.activities["field"] == Activity(send_ns=30, sleep_ns=-30)
    assert asleep.at(30).activities["field"] == Activity(send_ns=30)


def test_acknowledgements_are_heard_after_a_frame_and_sent_after_one() -> None:
    meter = Meter.new().at(100).sent("field", 100, 30, 8).at(200)
    assert meter.activities["field"] == Activity(30, 8, 162, 0)
    assert meter.received("field", 20, 8).activities["field"] == Activity(38, 28, 134, 0)


def test_a_radio_that_goes_to_sleep_while_it_sends_does_not_owe_it_to_its_listening() -> None:
    """It was on for 10 ns and then sent for 30, in which it was switched off: it slept for the last 60."""
    meter = Meter.new().at(10).sent("field", 10, 30).switched("field", False).at(100)
    assert meter.activities["field"] == Activity(send_ns=30, listen_ns=10, sleep_ns=60)
    awake = Meter.new().switched("field", False).at(10).sent("field", 10, 30).at(25).switched("field", True).at(100)
    assert awake.activities["field"] == Activity(send_ns=30, listen_ns=60, sleep_ns=10)


def test_a_frame_that_is_longer_than_a_window_was_heard_asleep_for_a_part() -> None:
    """A receiver that is on for the last 5 of 30 ns of a frame listened for no time at all, and not for -25 ns."""
    meter = Meter.new().switched("field", False).at(95).switched("field", True).at(100).received("field", 30)
    assert meter.activities["field"] == Activity(receive_ns=30, listen_ns=0, sleep_ns=70)


@pytest.mark.parametrize("third", [True, False])
def test_one_that_is_switched_several_times_in_a_frame_did_not_sleep_for_less_than_no_time(third: bool) -> None:
    """It listened for 10 of the 30 ns, slept for 10, and was switched again: 30 were received, none is left."""
    meter = Meter.new().at(10).switched("field", False).at(20).switched("field", third).at(30)
    assert meter.received("field", 30).activities["field"] == Activity(receive_ns=30)


def test_a_receiver_receives_one_frame_at_a_time() -> None:
    meter = Meter.new().at(100).received("field", 30).at(110).received("field", 30)
    assert meter.activities["field"] == Activity(receive_ns=40, listen_ns=70)
    sends = Meter.new().at(80).sent("field", 80, 15).at(100).received("field", 30)
    assert sends.activities["field"] == Activity(send_ns=15, receive_ns=5, listen_ns=80)


def test_windows_are_paid_for_without_an_event() -> None:
    """5 of every 100 ns, from 20 on."""
    meter = Meter.new(since_ns=0).switched("field", Windows(100, 5, 20)).at(1000)
    assert meter.activities["field"] == Activity(listen_ns=50, sleep_ns=950)
    assert meter.at(1023).activities["field"] == Activity(listen_ns=53, sleep_ns=970)
    sends = meter.sent("field", 1000, 22).at(1023)
    assert sends.activities["field"] == Activity(send_ns=22, listen_ns=51, sleep_ns=950)
    heard = meter.at(1050).received("field", 28)
    assert heard.activities["field"] == Activity(receive_ns=28, listen_ns=52, sleep_ns=970)


@pytest.mark.parametrize(("spent_ns", "left"), [(0, 10_000), (3333, 1), (3334, 0), (9999, 0)])
def test_what_is_left_is_never_less_than_nothing(spent_ns: int, left: int) -> None:
    assert Meter.new().at(spent_ns).left_fj({"field": POWER}) == left


def test_when_it_is_empty() -> None:
    assert Meter.new().falls_ns({"field": POWER}, 0) == 3334
    assert Meter.new(since_ns=50).switched("field", False).falls_ns({"field": POWER}, 0) == 10_050
    assert Meter.new().at(9999).falls_ns({"field": POWER}, 0) == 9999
    assert Meter.new().falls_ns({"field": DEVICES["cc2420"]}, 0) is None  # on mains


def test_each_medium_has_a_radio_of_its_own_and_all_draw_from_one_battery() -> None:
    """A wire that sleeps at 2 uW beside a radio that listens at 3: 5 fJ in a nanosecond."""
    wire = Power(11, 13, 17, 2)
    meter = Meter.new(("field", "backbone"), 100).switched("backbone", False).at(200).sent("backbone", 200, 10)
    assert meter.activities == {"field": Activity(listen_ns=100), "backbone": Activity(send_ns=10, sleep_ns=90)}
    powers = {"field": POWER, "backbone": wire}
    assert meter.left_fj(powers) == 10_000 - 300 - 110 - 180
    assert meter.falls_ns(powers, 0) == 200 + -(-9_410 // 5)
    assert meter.sent("serial", 200, 10) == meter.received("serial", 10) == meter.switched("serial", False) == meter
    heir = Meter.new(powers, 200, meter.activities)
    assert heir.left_fj(powers) == meter.left_fj(powers)


openings = st.one_of(
    st.booleans(),
    st.builds(
        lambda every, share, start: Windows(every, max(every * share // 100, 1), start),
        st.integers(1, 10**11),
        st.integers(1, 100),
        st.integers(0, 10**12),
    ),
)
steps = st.lists(
    st.one_of(
        st.tuples(st.just("pass"), st.integers(0, 10**12)),
        st.tuples(st.just("send"), st.integers(0, 10**9)),
        st.tuples(st.just("receive"), st.integers(0, 10**9)),
        st.tuples(st.just("switch"), openings),
    )
)


def played(meter: Meter, story: list[tuple[str, Any]]) -> Meter:
    """One radio sends one frame at a time."""
    free_ns = meter.since_ns
    for what, amount in story:
        if what == "pass":
            meter = meter.at(meter.since_ns + amount)
        elif what == "switch":
            meter = meter.switched("field", amount)
        elif what == "send":
            free_ns = max(free_ns, meter.since_ns)
            meter, free_ns = meter.sent("field", free_ns, amount), free_ns + amount
        else:
            meter = meter.received("field", min(amount, meter.since_ns))
    return meter


@given(steps, st.integers(0, 10**12))
def test_all_moments_add_up_to_the_time_that_passed(story: list[tuple[str, Any]], start: int) -> None:
    meter = played(Meter.new(since_ns=start), story)
    assert sum(meter.activities["field"][:4]) == meter.since_ns - start
    assert meter.activities["field"].send_ns == sum(amount for what, amount in story if what == "send")
    assert meter.activities["field"].receive_ns <= sum(amount for what, amount in story if what == "receive")


@given(steps)
def test_nothing_is_ever_negative_once_all_is_sent(story: list[tuple[str, Any]]) -> None:
    meter = played(Meter.new(), story)
    sent_ns = sum(amount for what, amount in story if what == "send")
    assert min(meter.at(meter.since_ns + sent_ns).activities["field"]) >= 0


@given(steps, st.integers(1, 10**18))
def test_it_is_empty_at_the_very_moment_that_was_foretold(story: list[tuple[str, Any]], battery_fj: int) -> None:
    power = Power(7, 5, 3, 1, battery_fj=battery_fj)
    meter = played(Meter.new(), story)
    at = meter.falls_ns({"field": power}, 0)
    assert at is not None
    assert meter.at(at).left_fj({"field": power}) == 0
    if at > meter.since_ns:
        assert meter.at(at - 1).left_fj({"field": power}) != 0
