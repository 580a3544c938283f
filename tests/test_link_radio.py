"""Radios: path loss, reception, access to the channel, fragments, repeats and acknowledgements.

Statistical tests as in ``test_link``: against the exact distribution, wrong once in a million.
"""

from __future__ import annotations

from collections import Counter
from math import exp, log, sqrt
from pathlib import Path
from typing import Any, Final

import pytest
from scipy.integrate import quad
from scipy.stats import binom, kstest, norm

from tests.test_link import PLACES, SURE, TRACE, S, likely
from trackfield.link import Fate, make_link
from trackfield.link.access import Aloha
from trackfield.link.csma import Csma
from trackfield.link.dcf import Dcf
from trackfield.link.lognormal_prr import LognormalPrr
from trackfield.link.lora868 import NOISE_DBM, SENSITIVITY_DBM, Lora
from trackfield.link.radios import RADIOS, Radio
from trackfield.link.reception import cc2420, dsss_dbpsk, mica2
from trackfield.link.shadowing import CHANNELS
from trackfield.link.transfer import Transfer

US: Final = 1000
CC2420: Final = RADIOS["802154-0dbm"](9)
FRAME: Final = ("a", "b", "doa", 0, 0)


def within(n: int) -> float:
    """How far the mean of n values from [0, 1] may be from its expectation (Hoeffding)."""
    return sqrt(log(2 / SURE) / (2 * n))


def ring(distance_m: float, n: int) -> dict[str, tuple[float, float]]:
    """A centre, and n nodes that far from it."""
    return {"fusion": (0.0, 0.0)} | {f"n{i}": (distance_m, 0.0) for i in range(n)}


def radio_link(places: dict[str, tuple[float, float]] = PLACES, seed: int = 1, **keys: Any) -> LognormalPrr:
    link = make_link({"model": "lognormal_prr", **keys}, seed, places)
    assert isinstance(link, LognormalPrr)
    return link


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
        assert link.fate(src, dst, "doa", 0, 0, 12).cause == "radio"


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


# --- access to the channel ---


def delays_ms(busy: float, ack: int, n: int = 40_000) -> list[float]:
    link = make_link({"model": "csma154", "busy": busy, "ack": ack}, seed=1)
    fates = (link.fate("a", "b", "doa", i, 0, 20) for i in range(n))
    return sorted(fate.delay_ns / 1e6 for fate in fates if fate.cause is None)


def mean_ms(busy: float) -> float:
    """Mean delay of an acknowledged frame of 20 + 17 bytes that is not given up: a sum over the tries."""
    fixed_ms, total, waited = 0.192 + 37 * 0.032 + 0.192 + 11 * 0.032, 0.0, 0.0
    for k in range(5):
        waited += (2 ** min(3 + k, 5) - 1) / 2 * 0.32 + 0.128
        total += busy**k * (1 - busy) * (waited + fixed_ms)
    return total / (1 - busy**5)


def test_an_idle_channel() -> None:
    """Eight back-offs, equally likely; all else is fixed: 3.16 ms (2.05 to 4.29)."""
    delays, n = delays_ms(0, ack=1), 40_000
    assert mean_ms(0) == pytest.approx(3.16, abs=0.01)
    counts = Counter(delays)
    assert sorted(counts) == pytest.approx([2.048 + 0.32 * k for k in range(8)])
    assert all(likely(count, binom(n, 1 / 8)) for count in counts.values())


def test_a_busy_channel() -> None:
    delays, n = delays_ms(0.3, ack=1), 40_000
    assert mean_ms(0.3) == pytest.approx(4.49, abs=0.05)
    share = (sum(delays) / len(delays) - 2.048) / (max(delays) - 2.048)
    assert share == pytest.approx((mean_ms(0.3) - 2.048) / (max(delays) - 2.048), abs=within(len(delays)))
    assert delays[round(0.99 * len(delays))] == pytest.approx(18.4, abs=0.5)
    assert likely(n - len(delays), binom(n, 0.3**5))


def test_without_acknowledgement_the_frame_itself_is_all() -> None:
    assert min(delays_ms(0, ack=0, n=500)) == pytest.approx(0.128 + 0.192 + 37 * 0.032)


def test_a_channel_that_stays_busy_is_given_up() -> None:
    looked: list[tuple[str, int]] = []

    def draw(purpose: str, k: int) -> float:
        looked.append((purpose, k))
        return 0.5

    assert Csma().wait_ns(0, 0.9, draw) is None
    assert looked == [(purpose, k) for k in range(5) for purpose in ("backoff", "cca")]
    # 4 + 8 units, two looks, and the way to sending
    third = {("cca", 0): 0.1, ("cca", 1): 0.9}
    assert Csma().wait_ns(0, 0.2, lambda *key: third.get(key, 0.5)) == (12 * 320 + 2 * 128 + 192) * US


@pytest.mark.parametrize(("attempt", "window"), [(0, 32), (1, 64), (4, 512), (5, 1024), (6, 1024)])
def test_the_window_of_dcf_doubles(attempt: int, window: int) -> None:
    for share in (0.0001, 0.5, 0.9999):
        waited = Dcf().wait_ns(attempt, 0, lambda *_, share=share: share)
        assert waited == (50 + 20 * int(share * window)) * US
    assert Dcf().wait_ns(attempt, 0.75, lambda *_: 0.5) == (50 + 4 * 20 * window // 2) * US
    assert Dcf().granted(0.75) == 1


def test_wifi_repeats_until_it_is_acknowledged_unless_told_otherwise() -> None:
    assert RADIOS["wifi11b"](9).ack == 7
    fate = radio_link(radio="wifi11b").fate("n1", "fusion", "doa", 0, 0, 12)
    assert (fate.attempts, fate.bytes_on_air, fate.ack_bytes) == (1, 48, 14)
    assert (fate.delay_ns - (50 + 192 + 8 * 48 + 10 + 192 + 8 * 14) * US) % (20 * US) == 0
    assert radio_link(radio="wifi11b", ack=0).fate("n1", "fusion", "doa", 0, 0, 12).ack_bytes == 0


def test_aloha_does_not_look() -> None:
    assert Aloha().wait_ns(3, 0.9, lambda *_: 0.5) == 0
    assert Aloha().granted(0.9) == 1


# --- repeats and acknowledgements ---


def fates(there: float, back: float = 1.0, *, n: int = 5000, size: int = 12, **keys: Any) -> list[Fate]:
    """Fates of n frames over a radio that gets this share through, either way."""
    transfer = Transfer(1, CC2420, **keys)
    return [transfer.fate(("a", "b", "doa", i, 0), size, False, lambda _: there, lambda _: back) for i in range(n)]


@pytest.mark.parametrize("ack", [1, 2, 4])
@pytest.mark.parametrize("back", [1.0, 0.5, 0.0])
def test_reception_with_repeats(ack: int, back: float) -> None:
    """Arrives unless lost n times: 1 - (1 - p)^n, whether or not the acknowledgements come back."""
    p, found = 0.4, fates(0.4, back, ack=ack)
    arrived = sum(fate.cause is None for fate in found)
    assert likely(arrived, binom(len(found), 1 - (1 - p) ** ack))
    assert Transfer(1, CC2420, ack=ack).reception(12, lambda _: p) == pytest.approx(1 - (1 - p) ** ack)


def test_a_sender_repeats_until_it_is_told() -> None:
    found, n = fates(0.4, 0.5, ack=3), 5000
    attempts = Counter(fate.attempts for fate in found)
    told = 0.4 * 0.5
    assert attempts.keys() == {1, 2, 3}
    assert likely(attempts[1], binom(n, told))
    assert likely(attempts[2], binom(n, (1 - told) * told))
    assert all(fate.bytes_on_air == fate.attempts * 29 for fate in found)
    assert all((fate.ack_bytes > 0) == (fate.cause is None) for fate in found)
    assert {fate.ack_bytes for fate in found} == {0, 11, 22, 33}


def test_acknowledgements_that_never_come_back_cost_every_repeat() -> None:
    first = fates(1.0, 1.0, ack=3, n=200)
    for fate, unheard in zip(first, fates(1.0, 0.0, ack=3, n=200), strict=True):
        assert (fate.attempts, fate.ack_bytes) == (1, 11)
        assert (unheard.attempts, unheard.ack_bytes) == (3, 33)
        assert unheard.delay_ns == fate.delay_ns  # the first copy is the one that counts


def test_a_repeat_comes_after_the_patience_of_its_sender() -> None:
    """Arrived at the second attempt: two back-offs, two frames, a wait in vain and an acknowledgement."""
    found = [fate for fate in fates(0.5, ack=2) if fate.cause is None and fate.attempts == 2]
    assert len(found) > 1000
    least = 2 * (128 + 192 + 29 * 32) + 864 + 192 + 11 * 32
    steps = {(fate.delay_ns / US - least) / 320 for fate in found}
    assert steps == set(range(15))


def test_without_acknowledgement_a_frame_is_sent_once() -> None:
    found = fates(0.5, ack=0)
    assert {(fate.attempts, fate.bytes_on_air, fate.ack_bytes) for fate in found} == {(1, 29, 0)}
    assert likely(sum(fate.cause is None for fate in found), binom(len(found), 0.5))


def test_who_gives_up_the_channel_sends_nothing() -> None:
    found, n = fates(1.0, busy=0.9, ack=2), 5000
    given_up = [fate for fate in found if fate.attempts == 0]
    assert likely(len(given_up), binom(n, 0.9**5))
    assert set(given_up) == {Fate("radio", 0, 0, 0, 0)}


def test_a_broadcast_is_sent_once_for_all_and_never_acknowledged() -> None:
    link = make_link({"model": "csma154", "ack": 3}, seed=1)
    for i in range(50):
        heard = {link.fate("a", f"n{k}", "doa", i, 0, 12, broadcast=True) for k in range(5)}
        assert len(heard) == 1
        assert (fate := heard.pop()).attempts == 1
        assert fate.ack_bytes == 0
    assert len({link.fate("a", f"n{k}", "doa", 0, 0, 12).delay_ns for k in range(50)}) > 1


def test_hearers_of_a_broadcast_lose_it_independently() -> None:
    transfer, n = Transfer(1, CC2420), 4000
    lost = [[transfer.fate(("a", dst, "doa", i, 0), 12, True, lambda _: 0.5, lambda _: 0.5).cause for i in range(n)]
            for dst in "bc"]  # fmt: skip
    assert likely(sum(x != y for x, y in zip(*lost, strict=True)), binom(n, 0.5))


# --- fragments ---


@pytest.mark.parametrize(
    ("size", "frames"), [(0, [17]), (1, [18]), (116, [133]), (117, [133, 18]), (232, [133, 133]), (300, [133, 133, 85])]
)
def test_a_long_payload_is_split(size: int, frames: list[int]) -> None:
    asked: list[int] = []

    def prr(frame_bytes: int) -> float:
        asked.append(frame_bytes)
        return 1.0

    fate = Transfer(1, CC2420).fate(FRAME, size, False, prr, prr)
    assert asked == frames
    assert (fate.attempts, fate.bytes_on_air) == (len(frames), sum(frames))
    steps = (fate.delay_ns / US - len(frames) * (128 + 192) - sum(frames) * 32) / 320
    assert steps in range(7 * len(frames) + 1)


def test_each_fragment_has_a_fate_of_its_own() -> None:
    found = fates(0.7, size=300)
    assert likely(sum(fate.cause is None for fate in found), binom(len(found), 0.7**3))
    assert {fate.attempts for fate in found} == {3}
    assert Transfer(1, CC2420).reception(300, lambda _: 0.7) == pytest.approx(0.7**3)
    with_repeats = fates(0.7, size=300, ack=2)
    assert likely(sum(fate.cause is None for fate in with_repeats), binom(len(with_repeats), (1 - 0.3**2) ** 3))


@pytest.mark.parametrize("name", RADIOS)
def test_every_radio_is_complete(name: str) -> None:
    radio: Radio = RADIOS[name](9)
    assert radio.channel in CHANNELS
    assert radio.patience_ns >= radio.ack_ns > 0
    fate = radio_link(ring(1, 1), radio=name, ack=2).fate("n0", "fusion", "doa", 0, 0, radio.payload_bytes)
    assert (fate.cause, fate.attempts) == (None, 1)
    assert fate.bytes_on_air == radio.payload_bytes + radio.overhead_bytes


# --- trace ---


@pytest.mark.parametrize(
    ("t_s", "fate"),
    [
        (0, Fate(None, 2_500_000)),
        (9.999999999, Fate(None, 2_500_000)),
        (10, Fate("radio")),
        (20.499999999, Fate("radio")),
        (20.5, Fate(None, 1_000_000)),
        (1e6, Fate(None, 1_000_000)),
    ],
)
def test_the_last_line_at_or_before_holds(t_s: float, fate: Fate) -> None:
    assert make_link(TRACE, 1, PLACES).fate("n1", "fusion", "doa", round(t_s * S), 0, 12) == fate


def test_a_link_receives_nothing_before_its_first_line_or_without_one() -> None:
    link = make_link(TRACE, 1, PLACES)
    assert link.fate("n2", "fusion", "doa", 5 * S - 1, 0, 12) == Fate("radio")
    assert link.fate("n2", "fusion", "doa", 5 * S, 0, 12) == Fate(None, 40_000_000)
    assert link.fate("fusion", "n2", "doa", 5 * S, 0, 12) == Fate("radio")
    assert (link.reception("n1", "fusion", 12), link.reception("fusion", "n1", 12)) == (pytest.approx(2 / 3), 0)


def test_a_process_keeps_its_own_links_of_a_trace() -> None:
    mine = make_link(TRACE, 1, {"n2": (0.0, 0.0), "fusion": (0.0, 0.0)})
    assert mine.fate("n2", "fusion", "doa", 5 * S, 0, 12).cause is None
    assert mine.reception("n10", "n1", 12) == 0
    assert make_link(TRACE, seed=1).reception("n10", "n1", 12) == 1


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "no column src, dst, t_s, received, delay_ms"),
        ("src,dst,t_s,received\n", "no column delay_ms"),
        ("src,dst,t_s,received,delay_ms\na,b,soon,1,2\n", ":2: .*soon"),
        ("src,dst,t_s,received,delay_ms\na,b,0,1,2\na,b,-1,1,2\n", ":3: t_s"),
        ("src,dst,t_s,received,delay_ms\na,b,0,yes,2\n", ":2: received: 'yes' is not 0 or 1"),
        ("src,dst,t_s,received,delay_ms\na,b,0,1,nan\n", ":2: delay_ms"),
        ("src,dst,t_s,received,delay_ms\na,b,0\n", ":2: "),
    ],
)
def test_a_trace_that_cannot_be_used(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "trace.csv").write_text(text)
    with pytest.raises(ValueError, match=message):
        make_link({"model": "trace", "file": str(tmp_path / "trace.csv")}, seed=1)
