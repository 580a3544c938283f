"""Radios: fragments, repeats and acknowledgements, and what they cost."""

from __future__ import annotations

from collections import Counter
from typing import Any, Final

import pytest
from scipy.stats import binom

from tests.links import US, likely, radio_link, ring
from trackfield.link import Fate, make_link
from trackfield.link.radios import RADIOS, Radio
from trackfield.link.shadowing import CHANNELS
from trackfield.link.transfer import Transfer

CC2420: Final = RADIOS["802154-0dbm"](9)
FRAME: Final = ("a", "b", "doa", 0, 0)


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
