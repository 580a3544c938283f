"""Radios: fragments, repeats and acknowledgements, and what they cost."""

from __future__ import annotations

from collections import Counter
from typing import Any, Final

import pytest
from scipy.stats import binom

from tests.links import MS, PLACES, TRACE, US, S, likely, radio_link, ring
from trackfield.link import Fate, make_link
from trackfield.link.fate import Transmission
from trackfield.link.lora868 import Lora
from trackfield.link.radios import RADIOS, Radio
from trackfield.link.shadowing import CHANNELS
from trackfield.link.transfer import Transfer

CC2420: Final = RADIOS["802154-0dbm"](9)
FRAME: Final = ("a", "b", "doa", 0, 0)


# --- repeats and acknowledgements ---


def fates(there: float, back: float = 1.0, *, n: int = 5000, size: int = 12, **keys: Any) -> list[Fate]:
    """Fates of n frames over a radio that gets this share through, either way."""
    transfer = Transfer(1, CC2420, **keys)
    return [transfer.fate(Transmission("a", "b", "doa", i, 0, size), lambda _: there, lambda _: back) for i in range(n)]


@pytest.mark.parametrize("ack", [1, 2, 4])
@pytest.mark.parametrize("back", [1.0, 0.5, 0.0])
def test_reception_with_repeats(ack: int, back: float) -> None:
    """Arrives unless lost n times: 1 - (1 - p)^n, whether or not the acknowledgements come back."""
    p, found = 0.4, fates(0.4, back, ack=ack)
    arrived = sum(fate.cause is None for fate in found)
    assert likely(arrived, binom(len(found), 1 - (1 - p) ** ack))
    assert Transfer(1, CC2420, ack=ack).reception(12, None, lambda _: p) == pytest.approx(1 - (1 - p) ** ack)


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
    # its radio was taken all the same, by five looks and up to 7 + 15 + 31 + 31 + 31 units of back-off
    assert {Fate("radio", 0, 0, 0, 0, fate.busy_ns) for fate in given_up} == set(given_up)
    waits = {(fate.busy_ns / US - 5 * 128) / 320 for fate in given_up}
    assert waits <= set(range(7 + 15 + 31 + 31 + 31 + 1))
    assert len(waits) > 80


@pytest.mark.parametrize("model", [{"model": "csma154"}, {"model": "lognormal_prr", "radio": "802154-0dbm"}], ids=str)
def test_kinds_are_acknowledged_each_in_its_own_way(model: dict[str, Any]) -> None:
    """A link with ``acks`` treats each kind as a link does whose ``ack`` that is."""
    link = make_link({**model, "ack": 2, "acks": {"doa": 0, "track": 5}}, 1, PLACES)
    for kind, ack in (("doa", 0), ("track", 5), ("sync-request", 2)):
        alike = make_link({**model, "ack": ack}, 1, PLACES)
        for dst in ("n2", "fusion"):
            for i in range(200):
                frame = ("n1", dst, kind, i, 0, 12)
                assert link.fate(Transmission(*frame)) == alike.fate(Transmission(*frame))
                assert link.fate(Transmission(*frame, broadcast=True)) == alike.fate(
                    Transmission(*frame, broadcast=True)
                )
            assert link.reception("n1", dst, 12, kind) == alike.reception("n1", dst, 12)
    assert link.reception("n1", "n2", 12) == link.reception("n1", "n2", 12, "sync-request")


def test_acknowledging_one_kind_helps_that_kind() -> None:
    transfer = Transfer(1, CC2420, acks={"track": 3})
    found = {
        kind: [transfer.fate(Transmission("a", "b", kind, i, 0, 12), lambda _: 0.4, lambda _: 1.0) for i in range(5000)]
        for kind in ("doa", "track")
    }
    for kind, share, attempts in (("doa", 0.4, {1}), ("track", 1 - 0.6**3, {1, 2, 3})):
        assert likely(sum(fate.cause is None for fate in found[kind]), binom(5000, share))
        assert {fate.attempts for fate in found[kind]} == attempts
        assert transfer.reception(12, kind, lambda _: 0.4) == pytest.approx(share)


def test_a_broadcast_is_sent_once_for_all_and_never_acknowledged() -> None:
    link = make_link({"model": "csma154", "ack": 3}, seed=1)
    for i in range(50):
        heard = {link.fate(Transmission("a", f"n{k}", "doa", i, 0, 12, broadcast=True)) for k in range(5)}
        assert len(heard) == 1
        assert (fate := heard.pop()).attempts == 1
        assert fate.ack_bytes == 0
    assert len({link.fate(Transmission("a", f"n{k}", "doa", 0, 0, 12)).delay_ns for k in range(50)}) > 1


def test_hearers_of_a_broadcast_lose_it_independently() -> None:
    transfer, n = Transfer(1, CC2420), 4000
    frames = [[Transmission("a", dst, "doa", i, 0, 12, broadcast=True) for i in range(n)] for dst in "bc"]
    lost = [[transfer.fate(one, lambda _: 0.5, lambda _: 0.5).cause for one in some] for some in frames]
    assert likely(sum(x != y for x, y in zip(*lost, strict=True)), binom(n, 0.5))


# --- what a frame costs its sender ---


@pytest.mark.parametrize("size", [12, 300])
def test_without_acknowledgement_a_radio_is_free_again_when_the_last_bit_is_out(size: int) -> None:
    for fate in fates(1.0, size=size, n=500):
        assert fate.delay_ns == max(fate.busy_ns, MS)
        assert fate.air_ns == 32 * US * fate.bytes_on_air
        assert (fate.busy_ns - fate.air_ns - fate.attempts * (128 + 192) * US) % (320 * US) == 0


@pytest.mark.parametrize("back", [1.0, 0.0])
def test_a_radio_waits_for_acknowledgements(back: float) -> None:
    """Told, it waits as long as the acknowledgement takes; in vain, the whole patience, after each attempt."""
    for fate in fates(0.5, back, ack=3):
        told = back == 1 and fate.cause is None
        fixed = fate.attempts * (128 + 192) + (fate.attempts - told) * 864 + told * (192 + 11 * 32)
        assert ((fate.busy_ns - fate.air_ns) / US - fixed) / 320 in range(7 * fate.attempts + 1)
        assert fate.air_ns == fate.attempts * 29 * 32 * US
        assert fate.ack_air_ns == 32 * US * fate.ack_bytes
        assert fate.busy_ns == fate.delay_ns or not told


def test_lora_takes_its_radio_for_seconds() -> None:
    link = radio_link(ring(1000, 1), radio="lora868", sf=12, ack=1)
    fate = link.fate(Transmission("n0", "fusion", "doa", 0, 0, 10))
    frame_ns, ack_ns = 1_482_752_000, Lora(12).airtime_ns(13)
    assert (fate.cause, fate.air_ns, fate.ack_air_ns) == (None, frame_ns, ack_ns)
    assert fate.busy_ns == fate.delay_ns == frame_ns + MS + ack_ns


def costs(fate: Fate) -> tuple[int, ...]:
    return fate.attempts, fate.bytes_on_air, fate.busy_ns, fate.air_ns


@pytest.mark.parametrize("medium", ["field", "backbone"])
@pytest.mark.parametrize("range_m", [None, 60.0])
@pytest.mark.parametrize(
    "spec",
    [
        {"model": "csma154", "busy": 0.8, "ack": 3},
        {"model": "lognormal_prr", "radio": "802154-0dbm", "busy": 0.8, "ack": 3},
        {"model": "lognormal_prr", "radio": "wifi11b", "busy": 0.5},
        {"model": "fixed", "loss": 0.5},
        {"model": "gilbert_elliott", "good_s": 1, "bad_s": 1},
        TRACE,
    ],
    ids=str,
)
def test_a_broadcast_costs_its_sender_the_same_whoever_hears_it(
    spec: dict[str, Any], range_m: float | None, medium: str
) -> None:
    """Its sender asks about nobody in particular, and knows nobody's place but its own."""
    spec = spec if range_m is None else {**spec, "range_m": range_m}
    link, alone = make_link(spec, 1, PLACES), make_link(spec, 1, {"n1": PLACES["n1"]})
    for i in range(200):
        frame = ("track", i * MS, 0, 300, True, medium)
        asked = alone.fate(Transmission("n1", "*", *frame))
        assert {costs(link.fate(Transmission("n1", dst, *frame))) for dst in ("n2", "n10", "fusion", "*")} == {
            costs(asked)
        }


def test_a_model_without_a_radio_takes_none() -> None:
    for spec in (
        {"model": "ideal"},
        {"model": "fixed", "loss": 0.5},
        {"model": "gilbert_elliott", "good_s": 1, "bad_s": 1},
        TRACE,
    ):
        assert {
            costs(make_link(spec, 1, PLACES).fate(Transmission("n1", "fusion", "doa", i * S, 0, 12))) for i in range(50)
        } == {(1, 0, 0, 0)}


# --- fragments ---


@pytest.mark.parametrize(
    ("size", "frames"), [(0, [17]), (1, [18]), (116, [133]), (117, [133, 18]), (232, [133, 133]), (300, [133, 133, 85])]
)
def test_a_long_payload_is_split(size: int, frames: list[int]) -> None:
    asked: list[int] = []

    def prr(frame_bytes: int) -> float:
        asked.append(frame_bytes)
        return 1.0

    fate = Transfer(1, CC2420).fate(Transmission(*FRAME, size), prr, prr)
    assert asked == frames
    assert (fate.attempts, fate.bytes_on_air) == (len(frames), sum(frames))
    steps = (fate.delay_ns / US - len(frames) * (128 + 192) - sum(frames) * 32) / 320
    assert steps in range(7 * len(frames) + 1)


def test_each_fragment_has_a_fate_of_its_own() -> None:
    found = fates(0.7, size=300)
    assert likely(sum(fate.cause is None for fate in found), binom(len(found), 0.7**3))
    assert {fate.attempts for fate in found} == {3}
    assert Transfer(1, CC2420).reception(300, None, lambda _: 0.7) == pytest.approx(0.7**3)
    with_repeats = fates(0.7, size=300, ack=2)
    assert likely(sum(fate.cause is None for fate in with_repeats), binom(len(with_repeats), (1 - 0.3**2) ** 3))


@pytest.mark.parametrize("name", RADIOS)
def test_every_radio_is_complete(name: str) -> None:
    radio: Radio = RADIOS[name](9)
    assert radio.channel in CHANNELS
    assert radio.patience_ns >= radio.ack_ns > 0
    fate = radio_link(ring(1, 1), radio=name, ack=2).fate(
        Transmission("n0", "fusion", "doa", 0, 0, radio.payload_bytes)
    )
    assert (fate.cause, fate.attempts) == (None, 1)
    assert fate.bytes_on_air == radio.payload_bytes + radio.overhead_bytes
