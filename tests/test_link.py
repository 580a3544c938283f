"""Links: fates are pure, and distributed as their model says.

Statistical tests compare with the exact distribution. A right answer would fail one of them with probability
``SURE``, once and for all, since the draws do not change.
"""

from __future__ import annotations

import random
from dataclasses import astuple
from hashlib import blake2b
from typing import Any, Final

import pytest
from scipy.stats import binom, gamma, kstest

from tests.links import MS, PLACES, SURE, TRACE, S, likely
from trackfield.link import MIN_DELAY_NS, MODELS, Fate, Link, make_link
from trackfield.link.dwells import Dwells
from trackfield.link.fate import Transmission

FIXED: Final = {"model": "fixed", "loss": 0.05, "delay_ms": 5}
BURSTS: Final = {
    "model": "gilbert_elliott",
    "good_s": 50,
    "bad_s": 4,
    "loss_good": 0.02,
    "loss_bad": 0.9,
    "delay_ms": 20,
    "jitter_ms": 10,
}
RADIO: Final = {"model": "lognormal_prr", "radio": "802154-0dbm", "busy": 0.2, "ack": 2}
SPECS: Final[list[dict[str, Any]]] = [
    {"model": "ideal"},
    FIXED,
    BURSTS,
    RADIO,
    {"model": "csma154", "busy": 0.5, "ack": 2},
    {"model": "ethernet", "delay_ms": 2},
    {"model": "serial", "baud": 9600},
    TRACE,
]
KNOWN: Final = {
    "ideal": "0e880b09a3dc63b3",
    "fixed": "5584d7ad1c271440",
    "gilbert_elliott": "1c1efc3b049901d6",
    "lognormal_prr": "6658b80f7b44b123",
    "csma154": "d13011c9f7cbb42c",
    "ethernet": "adc5ebd491b1ff31",
    "serial": "6df3d5af21481109",
    "trace": "02ee69193056dc88",
}
"""What each model did to frames of the field when it was made: a digest of the fates."""
every_model = pytest.mark.parametrize("spec", SPECS, ids=lambda spec: spec["model"])

Frame = tuple[str, str, str, int, int, int]


def frames(n: int, seed: int = 0) -> list[Frame]:
    """Different frames between a few processes within an hour."""
    pick = random.Random(seed)
    names = ["n1", "n2", "n10", "fusion"]
    return list(
        {
            (
                *pick.sample(names, 2),
                pick.choice(["doa", "track"]),
                pick.randrange(3600 * S),
                pick.randrange(3),
                12,
            )
            for _ in range(n)
        }
    )


# --- every model ---


def test_every_model_is_tested_here() -> None:
    assert {spec["model"] for spec in SPECS} == set(MODELS)


@every_model
def test_the_order_of_asking_changes_nothing(spec: dict[str, Any]) -> None:
    """A receiver, the recorder and a replay ask in different orders, about different frames."""
    asked = frames(2000)
    link = make_link(spec, 3, PLACES)
    fates = {frame: link.fate(Transmission(*frame)) for frame in asked}
    random.Random(1).shuffle(asked)
    again, fresh = make_link(spec, 3, PLACES), make_link(spec, 3, PLACES)
    assert {frame: again.fate(Transmission(*frame)) for frame in asked} == fates
    assert {frame: link.fate(Transmission(*frame)) for frame in reversed(asked)} == fates
    assert fresh.fate(Transmission(*asked[0])) == fates[asked[0]]  # a process that hears a single frame


@every_model
def test_the_fates_of_the_radio_stay_what_they_were(spec: dict[str, Any]) -> None:
    link, asked = make_link(spec, 3, PLACES), [(*f, cast) for f in sorted(frames(300)) for cast in (False, True)]
    fates = [link.fate(Transmission(*frame)) for frame in asked]
    assert (
        blake2b(repr([astuple(fate)[:8] for fate in fates]).encode(), digest_size=8).hexdigest() == KNOWN[spec["model"]]
    )
    assert [link.fate(Transmission(*frame, medium="field")) for frame in asked] == fates


@every_model
def test_each_medium_has_fates_of_its_own(spec: dict[str, Any]) -> None:
    """In any order of asking, and the same where nothing is drawn."""
    asked, fates = frames(500), {}
    for media in (("field", "backbone"), ("backbone", "field")):
        link = make_link({**spec, "range_m": 1000.0}, 3, PLACES)
        fates[media] = {(f, medium): link.fate(Transmission(*f, medium=medium)) for f in asked for medium in media}
    one, other = fates.values()
    assert one == other
    drawn = spec["model"] not in ("ideal", "ethernet", "serial", "trace")
    assert any(one[frame, "field"] != one[frame, "backbone"] for frame in asked) == drawn


@every_model
def test_every_frame_takes_a_millisecond_at_least(spec: dict[str, Any]) -> None:
    if "delay_ms" in spec:
        spec = {**spec, "delay_ms": 0}
    fates = [make_link(spec, 1, PLACES).fate(Transmission(*frame)) for frame in frames(500)]
    assert min(fate.delay_ns for fate in fates if fate.cause is None) >= MIN_DELAY_NS == MS


@pytest.mark.parametrize("spec", [FIXED, BURSTS], ids=lambda spec: spec["model"])
@pytest.mark.parametrize("changed", ["seed", "src", "dst", "kind", "sent_ns", "copy", "medium"])
def test_each_part_of_the_identity_matters(spec: dict[str, Any], changed: str) -> None:
    """Two frames that differ in one part are lost independently: at p = 1/2, in half of all cases."""
    spec = {**spec, "loss": 0.5} if spec["model"] == "fixed" else {**spec, "loss_good": 0.5, "loss_bad": 0.5}
    one, other = make_link(spec, seed=1), make_link(spec, seed=2 if changed == "seed" else 1)
    n = 2000
    differ = 0
    for i in range(n):
        frame = {"src": "a", "dst": "b", "kind": "doa", "sent_ns": i * S, "copy": 0, "medium": "field"}
        change = {"src": "b", "dst": "a", "kind": "track", "sent_ns": i * S + 1, "copy": 1, "medium": "backbone"}
        twin = frame if changed == "seed" else {**frame, changed: change[changed]}
        differ += one.fate(Transmission(**frame, size=12)).cause != other.fate(Transmission(**twin, size=12)).cause
    assert likely(differ, binom(n, 0.5))


@pytest.mark.parametrize("spec", [s for s in SPECS if s not in (BURSTS, TRACE)], ids=lambda spec: spec["model"])
def test_the_expected_reception_is_what_frames_meet(spec: dict[str, Any]) -> None:
    link, n = make_link(spec, 1, PLACES), 3000
    for src, dst in (("n1", "fusion"), ("fusion", "n1"), ("n2", "fusion"), ("n10", "n1")):
        arrived = sum(link.fate(Transmission(src, dst, "doa", i * S, 0, 12)).cause is None for i in range(n))
        assert likely(arrived, binom(n, link.reception(src, dst, 12)))


def test_the_expected_reception_of_bursts_is_stationary() -> None:
    assert make_link(BURSTS, seed=1).reception("a", "b", 12) == pytest.approx(1 - (4 * 0.9 + 50 * 0.02) / 54)


@every_model
def test_beyond_its_range_a_link_carries_nothing(spec: dict[str, Any]) -> None:
    places = {"a": (0.0, 0.0), "b": (60.0, 80.0), "c": (60.0, 80.001)}
    free, ending = make_link(spec, 1, places), make_link({**spec, "range_m": 100.0}, 1, places)
    for i in range(100):
        near, far, unknown = (("a", dst, "doa", i * S, 0, 12) for dst in ("b", "c", "stranger"))
        assert ending.fate(Transmission(*near)) == free.fate(Transmission(*near))
        assert ending.fate(Transmission(*far)).cause == ending.fate(Transmission(*unknown)).cause == "radio"
        assert ending.fate(Transmission(*far)).attempts == free.fate(Transmission(*far)).attempts
    assert ending.reception("a", "b", 12) == free.reception("a", "b", 12)
    assert ending.reception("a", "c", 12) == 0.0


@pytest.mark.parametrize(
    ("spec", "message"),
    [
        ({"model": "carrier pigeon"}, "carrier pigeon"),
        ({}, "not one of ideal, fixed, gilbert_elliott"),
        ({"model": "ideal", "loss": 0.1}, "loss"),
        ({"model": "fixed", "los": 0.1}, "los"),
        ({"model": "fixed", "loss": -0.1}, "loss"),
        ({"model": "fixed", "loss": 1.1}, "loss"),
        ({"model": "fixed", "loss": float("nan")}, "loss"),
        ({"model": "fixed", "loss": "much"}, "fixed"),
        ({"model": "fixed", "delay_ms": -1}, "delay_ms"),
        ({"model": "fixed", "delay_ms": float("inf")}, "delay_ms"),
        ({"model": "gilbert_elliott", "good_s": 1}, "bad_s"),
        ({"model": "gilbert_elliott", "good_s": 0, "bad_s": 1}, "good_s"),
        ({"model": "gilbert_elliott", "good_s": 1, "bad_s": -1}, "bad_s"),
        ({**BURSTS, "loss_bad": 2}, "loss_bad"),
        ({**BURSTS, "loss_good": -1}, "loss_good"),
        ({**BURSTS, "jitter_ms": -1}, "jitter_ms"),
        ({**RADIO, "radio": "walkie-talkie"}, "walkie-talkie.* is not one of 802154-0dbm"),
        ({**RADIO, "channel": "ether"}, "ether.* is not one of castalia"),
        ({**RADIO, "radio": "lora868", "sf": 6}, "sf"),
        ({**RADIO, "busy": 1}, "busy"),
        ({**RADIO, "busy": -0.1}, "busy"),
        ({**RADIO, "ack": -1}, "ack: -1"),
        ({**RADIO, "acks": {"doa": 2, "track": -1}}, "acks.track: -1"),
        ({"model": "fixed", "acks": {}}, "acks"),
        ({"model": "csma154", "busy": 1.5}, "busy"),
        ({"model": "ethernet", "delay_ms": -1}, "delay_ms"),
        ({"model": "ethernet", "loss": 0.1}, "loss"),
        ({"model": "trace"}, "file"),
        ({"model": "trace", "file": "/no/such.csv"}, "cannot be read"),
    ],
    ids=str,
)
def test_bad_specifications(spec: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make_link(spec, seed=1)


# --- ideal and fixed ---


def test_ideal_loses_nothing_and_takes_a_millisecond() -> None:
    link = make_link({"model": "ideal"}, seed=1)
    assert {link.fate(Transmission(*frame)) for frame in frames(1000)} == {Fate(None, MS)}


@pytest.mark.parametrize(("loss", "fate"), [(0, Fate(None, 5 * MS)), (1, Fate("radio"))])
def test_fixed_at_its_ends(loss: float, fate: Fate) -> None:
    link = make_link({**FIXED, "loss": loss}, seed=1)
    assert {link.fate(Transmission(*frame)) for frame in frames(1000)} == {fate}


@pytest.mark.parametrize("loss", [0.001, 0.05, 0.5])
def test_fixed_loses_its_share(loss: float) -> None:
    link, asked = make_link({**FIXED, "loss": loss}, seed=1), frames(20_000)
    lost = sum(link.fate(Transmission(*frame)).cause == "radio" for frame in asked)
    assert likely(lost, binom(len(asked), loss))


# --- Gilbert-Elliott ---


def bursts(seed: int, good_s: float, bad_s: float, **parameters: float) -> tuple[Link, Dwells]:
    """A link, and its states."""
    spec = {"model": "gilbert_elliott", "good_s": good_s, "bad_s": bad_s, **parameters}
    return make_link(spec, seed), Dwells(seed, good_s, bad_s)


def test_all_kinds_suffer_the_same_burst() -> None:
    link, dwells = bursts(6, good_s=1, bad_s=1)
    for i in range(500):
        causes = {
            link.fate(Transmission("a", "b", kind, i * S, copy, 12)).cause
            for kind in ("doa", "sync")
            for copy in (0, 1)
        }
        assert causes == ({"radio"} if dwells.bad("a", "b", i * S) else {None})


def test_losses_in_each_state() -> None:
    (link, dwells), tally = bursts(7, good_s=2, bad_s=1, loss_good=0.1, loss_bad=0.7), {True: [0, 0], False: [0, 0]}
    for i in range(20_000):
        frame = (f"n{i}", "b", "doa", i * MS, 0, 12)
        state = tally[dwells.bad(*frame[:2], frame[3])]
        state[0] += 1
        state[1] += link.fate(Transmission(*frame)).cause == "radio"
    assert likely(tally[False][1], binom(tally[False][0], 0.1))
    assert likely(tally[True][1], binom(tally[True][0], 0.7))
    assert likely(tally[True][0], binom(20_000, 1 / 3))


def test_jitter_is_exponential() -> None:
    link, _ = bursts(8, good_s=1e9, bad_s=1e-9, delay_ms=20, jitter_ms=10)
    delays = [link.fate(Transmission("a", "b", "doa", i, 0, 12)).delay_ns / MS - 20 for i in range(10_000)]
    assert min(delays) >= 0
    assert kstest(delays, "expon", args=(0, 10)).pvalue > SURE
    assert gamma(len(delays), scale=10).ppf(SURE) < sum(delays) < gamma(len(delays), scale=10).isf(SURE)


def test_without_jitter_the_delay_is_constant() -> None:
    link, _ = bursts(9, good_s=1e9, bad_s=1e-9, delay_ms=20)
    assert {link.fate(Transmission(*frame)).delay_ns for frame in frames(200)} == {20 * MS}


def test_delay_and_loss_are_drawn_apart() -> None:
    """Were both read off one number, the frames that get through would have other delays."""
    spec = {**BURSTS, "loss_good": 0.5, "loss_bad": 0.5}
    fates = [make_link(spec, seed=1).fate(Transmission("a", "b", "doa", i, 0, 12)) for i in range(4000)]
    delays = [fate.delay_ns / MS - 20 for fate in fates if fate.cause is None]
    assert kstest(delays, "expon", args=(0, 10)).pvalue > SURE
