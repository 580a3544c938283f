"""Radios: path loss and reception, statistically as in ``test_link``."""

from __future__ import annotations

from collections import Counter
from math import exp, sqrt
from typing import Any

import pytest
from scipy.integrate import quad
from scipy.stats import binom, kstest, norm

from tests.links import SURE, likely, radio_link, ring, within
from trackfield.link.fate import Transmission
from trackfield.link.lora868 import NOISE_DBM, SENSITIVITY_DBM, Lora
from trackfield.link.reception import cc2420, dsss_dbpsk, mica2
from trackfield.link.shadowing import CHANNELS

# --- reception from signal to noise ---


@pytest.mark.parametrize(("snr_db", "prr"), [(-2, 0.21), (-1, 0.71), (0, 0.95), (1, 0.996)])
def test_a_cc2420_receives_a_frame_of_37_bytes(snr_db: float, prr: float) -> None:
    assert cc2420(snr_db, 37) == pytest.approx(prr, abs=0.005)


@pytest.mark.parametrize(("snr_db", "prr"), [(8, 0.24), (9, 0.67), (10, 0.92), (12, 0.999)])
def test_a_mica2_receives_a_frame_of_50_bytes(snr_db: float, prr: float) -> None:
    assert mica2(snr_db, 50) == pytest.approx(prr, abs=0.006)


def test_dsss_gains_22_from_spreading() -> None:
    """With an SNR of 1/22 each bit has the energy of the noise density: BER = exp(-1) / 2."""
    assert dsss_dbpsk(-13.4242268, 1) == pytest.approx((1 - exp(-1) / 2) ** 8, rel=1e-6)


@pytest.mark.parametrize("curve", [cc2420, mica2, dsss_dbpsk, Lora(7).prr, Lora(12).prr])
def test_more_signal_is_never_worse_and_a_longer_frame_never_better(curve: Any) -> None:
    shares = [curve(snr / 10, 40) for snr in range(-400, 400)]
    assert shares == sorted(shares)
    assert shares[0] < 1e-90
    assert shares[-1] == 1.0
    assert all(curve(snr / 10, 80) <= curve(snr / 10, 40) for snr in range(-400, 400))


def test_without_signal_a_bit_is_a_coin() -> None:
    assert cc2420(-300, 1) == pytest.approx(0.5**8)
    assert mica2(-300, 1) == pytest.approx(0.5**8)


# --- path loss and shadowing ---


@pytest.mark.parametrize(
    ("name", "distance_m", "loss_db"),
    [
        ("castalia", 1, 55),
        ("castalia", 0.1, 55),
        ("castalia", 0, 55),
        ("castalia", 100, 103),
        ("usc", 10, 102),
        ("petajajarvi", 1000, 128.95),
        ("petajajarvi", 10_000, 152.15),
    ],
)
def test_mean_path_loss(name: str, distance_m: float, loss_db: float) -> None:
    assert CHANNELS[name].mean_db(distance_m) == pytest.approx(loss_db)


@pytest.mark.parametrize(("name", "sd_db"), [("castalia", sqrt(17)), ("usc", 3.2), ("petajajarvi", 7.8)])
def test_shadowing_is_normal_over_the_links(name: str, sd_db: float) -> None:
    channel, places = CHANNELS[name], ring(100, 4000)
    excess = [channel.loss_db(1, places, id, "fusion") - channel.mean_db(100) for id in places if id != "fusion"]
    assert kstest(excess, norm(scale=sd_db).cdf).pvalue > SURE


def test_directions_of_a_link_differ_by_the_asymmetry_alone() -> None:
    places, names = ring(100, 4000), [f"n{i}" for i in range(4000)]
    castalia, usc = CHANNELS["castalia"], CHANNELS["usc"]
    both = [castalia.loss_db(1, places, id, "fusion") - castalia.loss_db(1, places, "fusion", id) for id in names]
    assert kstest(both, norm(scale=sqrt(2)).cdf).pvalue > SURE
    assert all(usc.loss_db(1, places, id, "fusion") == usc.loss_db(1, places, "fusion", id) for id in names[:50])


def test_shadowing_of_one_medium_says_nothing_of_another() -> None:
    """The difference of two that are independent varies twice as much as either."""
    channel, places = CHANNELS["castalia"], ring(100, 4000)
    field, other = (
        [channel.loss_db(1, places, id, "fusion", medium=medium) for id in places if id != "fusion"]
        for medium in ("field", "backbone")
    )
    assert kstest([a - b for a, b in zip(field, other, strict=True)], norm(scale=sqrt(2 * 17)).cdf).pvalue > SURE
    ways = [channel.loss_db(1, places, *ends, medium="backbone") for ends in (("n1", "fusion"), ("fusion", "n1"))]
    assert 0 < abs(ways[0] - ways[1]) < 8  # 5 sigma of the two directions; the pair's own draw is the same


def test_shadowing_is_frozen_and_belongs_to_the_seed() -> None:
    links = [radio_link(seed=seed) for seed in (1, 1, 2)]
    first, again, other = ([link.snr_db(id, "fusion") for id in ("n1", "n2", "n10")] for link in links)
    assert first == again
    assert not set(first) & set(other)


@pytest.mark.parametrize(("distance_m", "mean"), [(30, 1.00), (50, 0.91), (80, 0.57), (100, 0.34)])
def test_mean_reception_over_castalias_channel(distance_m: float, mean: float) -> None:
    """0 dBm, noise -100 dBm, 37 bytes: the integral over the shadowing, and the mean over 6000 links."""
    n, channel = 6000, CHANNELS["castalia"]
    snr_db, sd_db = 100 - channel.mean_db(distance_m), sqrt(17)
    exact = quad(lambda z: norm.pdf(z) * cc2420(snr_db + sd_db * z, 37), -8, 8, limit=200)[0]
    assert exact == pytest.approx(mean, abs=0.015)
    link = radio_link(ring(distance_m, n), radio="802154-0dbm")
    assert sum(link.reception(f"n{i}", "fusion", 20) for i in range(n)) / n == pytest.approx(exact, abs=within(n))


def test_power_and_noise_move_the_signal_by_as_much() -> None:
    plain = radio_link(radio="802154-0dbm")
    snr_db = plain.snr_db("n2", "fusion")
    assert radio_link(radio="802154-20dbm").snr_db("n2", "fusion") == pytest.approx(snr_db + 20)
    assert radio_link(radio="802154-0dbm", tx_dbm=-7.0).snr_db("n2", "fusion") == pytest.approx(snr_db - 7)
    assert radio_link(radio="802154-0dbm", noise_dbm=-95.0).snr_db("n2", "fusion") == pytest.approx(snr_db - 5)
    assert plain.prr("n2", "fusion", 37) == cc2420(snr_db, 37)


def test_who_stands_nowhere_is_out_of_range() -> None:
    link = radio_link()
    for src, dst in (("stranger", "fusion"), ("fusion", "stranger")):
        assert link.reception(src, dst, 12) == 0
        assert link.fate(Transmission(src, dst, "doa", 0, 0, 12)).cause == "radio"


# --- LoRa ---


@pytest.mark.parametrize(
    ("sf", "frame_bytes", "ms"), [(7, 23, 61.696), (10, 23, 370.688), (11, 23, 823.296), (12, 23, 1482.752)]
)
def test_time_on_air_of_lora(sf: int, frame_bytes: int, ms: float) -> None:
    """The figures that LoRaWAN's calculators give for a payload of 10 bytes."""
    assert Lora(sf).airtime_ns(frame_bytes) / 1e6 == pytest.approx(ms)


def test_the_shortest_lora_frame_has_eight_symbols_after_its_preamble() -> None:
    assert Lora(12).airtime_ns(0) == round(20.25 * 32.768e6)


@pytest.mark.parametrize(("sf", "range_m"), [(7, 2200), (9, 4000), (12, 8900)])
def test_mean_range_of_lora(sf: int, range_m: float) -> None:
    """At 14 dBm the mean signal falls to the sensitivity there; so half the links at that distance work."""
    reach_m = 1000 * 10 ** ((14 - SENSITIVITY_DBM[sf] - 128.95) / 23.2)
    assert reach_m == pytest.approx(range_m, rel=0.02)
    n = 2000
    link = radio_link(ring(reach_m, n), radio="lora868", sf=sf)
    shares = Counter(link.reception(f"n{i}", "fusion", 12) for i in range(n))
    assert shares.keys() == {0.0, 1.0}
    assert likely(shares[1.0], binom(n, 0.5))


def test_lora_hears_down_to_its_sensitivity() -> None:
    for sf, sensitivity_dbm in SENSITIVITY_DBM.items():
        assert Lora(sf).prr(sensitivity_dbm - NOISE_DBM, 20) == 1
        assert Lora(sf).prr(sensitivity_dbm - NOISE_DBM - 0.001, 20) == 0
