"""Radios: how they come to the channel, and what that takes."""

from __future__ import annotations

from collections import Counter

import pytest
from scipy.stats import binom

from tests.links import US, likely, radio_link, within
from trackfield.link import make_link
from trackfield.link.access import Aloha
from trackfield.link.csma import Csma
from trackfield.link.dcf import Dcf
from trackfield.link.fate import Transmission
from trackfield.link.radios import RADIOS


def delays_ms(busy: float, ack: int, n: int = 40_000) -> list[float]:
    link = make_link({"model": "csma154", "busy": busy, "ack": ack}, seed=1)
    fates = (link.fate(Transmission("a", "b", "doa", i, 0, 20)) for i in range(n))
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

    assert Csma().wait_ns(0, 0.9, draw) == ((4 + 8 + 3 * 16) * 320 * US + 5 * 128 * US, False)
    assert looked == [(purpose, k) for k in range(5) for purpose in ("backoff", "cca")]
    # 4 + 8 units, two looks, and the way to sending
    third = {("cca", 0): 0.1, ("cca", 1): 0.9}
    assert Csma().wait_ns(0, 0.2, lambda *key: third.get(key, 0.5)) == ((12 * 320 + 2 * 128 + 192) * US, True)


@pytest.mark.parametrize(("attempt", "window"), [(0, 32), (1, 64), (4, 512), (5, 1024), (6, 1024)])
def test_the_window_of_dcf_doubles(attempt: int, window: int) -> None:
    for share in (0.0001, 0.5, 0.9999):
        waited = Dcf().wait_ns(attempt, 0, lambda *_, share=share: share)
        assert waited == ((50 + 20 * int(share * window)) * US, True)
    assert Dcf().wait_ns(attempt, 0.75, lambda *_: 0.5) == ((50 + 4 * 20 * window // 2) * US, True)
    assert Dcf().granted(0.75) == 1


def test_wifi_repeats_until_it_is_acknowledged_unless_told_otherwise() -> None:
    assert RADIOS["wifi11b"](9).ack == 7
    fate = radio_link(radio="wifi11b").fate(Transmission("n1", "fusion", "doa", 0, 0, 12))
    assert (fate.attempts, fate.bytes_on_air, fate.ack_bytes) == (1, 48, 14)
    assert (fate.delay_ns - (50 + 192 + 8 * 48 + 10 + 192 + 8 * 14) * US) % (20 * US) == 0
    assert radio_link(radio="wifi11b", ack=0).fate(Transmission("n1", "fusion", "doa", 0, 0, 12)).ack_bytes == 0


def test_aloha_does_not_look() -> None:
    assert Aloha().wait_ns(3, 0.9, lambda *_: 0.5) == (0, True)
    assert Aloha().granted(0.9) == 1
