"""What devices draw, against the figures they are published with."""

from __future__ import annotations

import pytest

from trackfield.link import first_order
from trackfield.link.energy import DEVICES, NODE_UW, Power
from trackfield.link.radios import RADIOS

NJ, UJ = 10**6, 10**9
RADIO_OF = {"cc2420": "802154-0dbm", "cc2420-20dbm": "802154-20dbm", "sx1276": "lora868", "wifi11b": "wifi11b"}


def test_a_cc2420_sends_37_bytes_for_62_uj_and_receives_them_for_67() -> None:
    """On air for 1.184 ms, at 3 V; above what the node draws anyway."""
    cc2420, air_ns = DEVICES["cc2420"], 37 * 32_000
    assert (cc2420.send_uw - NODE_UW) * air_ns == pytest.approx(61.8 * UJ, rel=1e-3)
    assert (cc2420.receive_uw - NODE_UW) * air_ns == pytest.approx(66.8 * UJ, rel=1e-3)
    assert cc2420.sleep_uw == 1_400 + 6_000
    assert cc2420.listen_uw == cc2420.receive_uw


@pytest.mark.parametrize(
    ("name", "volts", "send_ma", "receive_ma"),
    [("cc2420", 3, 17.4, 18.8), ("cc2420-20dbm", 3, 17.4 + 100, 18.8 + 3.4), ("sx1276", 3.3, 44, 10.8)],
)
def test_a_node_draws_what_its_radio_draws_and_6_mw(name: str, volts: float, send_ma: float, receive_ma: float) -> None:
    device = DEVICES[name]
    assert device.send_uw == pytest.approx(volts * send_ma * 1000 + 6000)
    assert device.receive_uw == device.listen_uw == pytest.approx(volts * receive_ma * 1000 + 6000)


@pytest.mark.parametrize("device", DEVICES.values(), ids=DEVICES)
def test_sleep_is_worth_it_and_nothing_is_free(device: Power) -> None:
    assert 0 < 4 * device.sleep_uw < device.listen_uw <= device.receive_uw
    assert device.send_uw > 0
    assert (device.battery_fj, device.sample_fj) == (None, 0)


@pytest.mark.parametrize("name", DEVICES)
@pytest.mark.parametrize("size", [12, 20, 50])
def test_a_byte_takes_as_long_as_over_the_radio_of_that_device(name: str, size: int) -> None:
    """LoRa rounds up to whole blocks of five symbols, so a straight line comes within one of them."""
    device, radio = DEVICES[name], RADIOS[RADIO_OF[name]](9)
    air_ns = (size + device.overhead_bytes) * device.byte_ns
    block_ns = 5 * 4_096_000 if name == "sx1276" else 0
    assert abs(air_ns - radio.airtime_ns(size + radio.overhead_bytes)) <= block_ns


# --- first order ---


def test_the_first_order_model() -> None:
    """A packet of 2000 bits: 100 uJ in the electronics, and over 50 m as much as 50 uJ for the amplifier."""
    assert first_order.receive_fj(2000) == 100 * UJ
    assert first_order.send_fj(2000, 0) == 100 * UJ
    assert first_order.send_fj(2000, 50) == 150 * UJ
    assert first_order.send_fj(2000, 200) == 100 * UJ + 2000 * 2080 * NJ
    assert first_order.aggregate_fj(2000) == 10 * UJ


def test_both_amplifiers_meet_at_88_m() -> None:
    assert pytest.approx(87.7, abs=0.01) == first_order.D0_M
    near, at = first_order.send_fj(1000, first_order.D0_M * (1 - 1e-12)), first_order.send_fj(1000, first_order.D0_M)
    assert near == pytest.approx(at, rel=1e-9)
    slopes = [
        first_order.send_fj(1000, first_order.D0_M * factor) / first_order.send_fj(1000, first_order.D0_M)
        for factor in (0.99, 1.01)
    ]
    assert slopes[0] < 1 < slopes[1]
    assert slopes[1] - 1 > 1.5 * (1 - slopes[0])  # by d^4 it rises twice as fast as by d^2
