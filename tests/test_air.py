"""What radios do to each other: exact small cases, and what must hold for any frames."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Final

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from launcher.plan.air import Air, Due, air_of
from launcher.plan.transmissions import Clashes, Near, Sent
from tests.links import MS, S, radio_link
from trackfield.link import make_link
from trackfield.link.fate import Link, Transmission
from trackfield.link.lora868 import Lora
from trackfield.link.media import Media
from trackfield.link.partitioned import Partitioned
from trackfield.link.radios import RADIOS
from trackfield.link.signals import Signals

PLACES: Final = {"a": (0.0, 0.0), "b": (400.0, 0.0), "hub": (200.0, 100.0)}
LORA: Final = {"model": "lognormal_prr", "radio": "lora868", "sf": 7}
AIR_NS: Final = Lora(7).airtime_ns(20 + 13)


def frame(src: str, sent_ns: int, dst: str = "hub", *, broadcast: bool = False, copy: int = 0) -> Transmission:
    return Transmission(src, dst, "doa", sent_ns, copy, 20, broadcast)


def levelled(ahead_db: float) -> Link:
    """A LoRa link on which a is so much stronger than b at the hub."""
    plain = radio_link(PLACES, radio="lora868", sf=7)
    off_db = plain.snr_db("a", "hub") - plain.snr_db("b", "hub")
    return make_link(LORA, 1, PLACES, {"a": plain.tx_dbm - off_db + ahead_db, "b": plain.tx_dbm})


def judged(link: Link, *frames: Transmission, end_ns: int = 10 * S, delivered: bool = True) -> Air:
    found = air_of(link, PLACES, frames, [Due(n, f.dst, delivered) for n, f in enumerate(frames)], end_ns)
    assert found is not None
    return found


# --- by hand ---


def test_two_that_touch_do_not_overlap_and_a_nanosecond_more_does() -> None:
    apart = judged(levelled(0.0), frame("a", S), frame("b", S + AIR_NS))
    assert (apart.expected, apart.overlapped, apart.spared) == (2, 0, 0.0)
    met = judged(levelled(0.0), frame("a", S), frame("b", S + AIR_NS - 1))
    assert (met.overlapped, met.captured, met.spared) == (2, 0, 2.0)


@pytest.mark.parametrize(("ahead_db", "saved"), [(5.9, 0), (6.1, 1), (-6.1, 1), (-5.9, 0)])
def test_capture_takes_six_decibels(ahead_db: float, saved: int) -> None:
    met = judged(levelled(ahead_db), frame("a", S), frame("b", S + AIR_NS // 2))
    assert (met.overlapped, met.captured, met.spared) == (2, saved, 2.0 - saved)


def test_capture_is_from_all_others_together() -> None:
    """7 dB above one that is 7 dB above each of two others: 4 dB above both."""
    places = {**PLACES, "c": (0.0, 300.0)}
    plain = radio_link(places, radio="lora868", sf=7)
    level = {id: plain.snr_db(id, "hub") for id in ("a", "b", "c")}
    powers = {id: plain.tx_dbm + level["b"] - level[id] + (7.0 if id == "a" else 0.0) for id in level}
    link = make_link(LORA, 1, places, powers)
    frames = [frame("a", S), frame("b", S + MS), frame("c", S + 2 * MS)]
    one, two = (air_of(link, places, some, [Due(0, "hub", True)], 10 * S) for some in (frames[:2], frames))
    assert one is not None
    assert two is not None
    assert (one.captured, two.captured) == (1, 0)


def test_one_that_sends_is_deaf() -> None:
    there, back = frame("a", S), frame("hub", S + MS, "a")
    met = judged(levelled(0.0), there, back)
    assert (met.overlapped, met.deaf, met.spared) == (0, 2, 2.0)
    assert judged(levelled(0.0), there, replace_sent(back, S + AIR_NS)).deaf == 0


def replace_sent(one: Transmission, sent_ns: int) -> Transmission:
    return one._replace(sent_ns=sent_ns)


def test_what_is_lost_anyway_is_not_spared() -> None:
    met = judged(levelled(0.0), frame("a", S), frame("b", S), delivered=False)
    assert (met.overlapped, met.spared) == (2, 0.0)


def test_use_is_the_union_of_all_that_is_heard() -> None:
    """Two overlap by half; a third comes in another second."""
    found = judged(levelled(0.0), frame("a", S), frame("b", S + AIR_NS // 2), frame("a", 5 * S))
    (use,) = found.uses
    both = AIR_NS // 2 + AIR_NS
    assert use.mean == pytest.approx((both + AIR_NS) / (10 * S))
    assert use.peak == pytest.approx(both / S)
    assert S - S <= use.peak_ns <= S


def test_the_busiest_second_is_any_second() -> None:
    """Four frames around a whole second are in one window."""
    frames = [frame("a", 2 * S - 2 * AIR_NS + n * AIR_NS) for n in range(4)]
    (use,) = judged(levelled(0.0), *frames).uses
    assert use.peak == pytest.approx(4 * AIR_NS / S)


def test_a_signal_too_weak_to_disturb_is_none() -> None:
    far = {**PLACES, "b": (90_000.0, 0.0)}
    link = make_link(LORA, 1, far)
    signals = Signals.of(link, "field")
    assert signals is not None
    assert signals.db("b", "hub") is None
    assert signals.reach_m < 90_000
    found = air_of(link, far, [frame("a", S), frame("b", S)], [Due(0, "hub", True)], 10 * S)
    assert found is not None
    assert found.overlapped == 0


def test_links_without_a_radio_have_no_air() -> None:
    for link in (make_link({"model": "fixed"}, 1), make_link({"model": "serial"}, 1), Media({})):
        assert air_of(link, PLACES, [frame("a", S)], [Due(0, "hub", True)], S) is None


# --- what is on the air ---


@pytest.mark.parametrize("ack", [0, 3])
@pytest.mark.parametrize("radio", ["802154-0dbm", "mica2", "wifi11b", "lora868"])
def test_transmissions_are_those_of_the_fate(radio: str, ack: int) -> None:
    places = {"a": (0.0, 0.0), "hub": (60.0, 0.0)}
    link = Partitioned(Media({"field": radio_link(places, radio=radio, ack=ack, busy=0.3)}), [(0, S, ["a"], None)])
    signals = Signals.of(link, "field")
    assert signals is not None
    for n in range(300):
        one = Transmission("a", "hub", "doa", n * 10 * MS, 0, n)
        fate, seen = link.fate(one), signals.on_air(one)
        data, answers = ([x for x in seen if x.answer is answer] for answer in (False, True))
        assert len(data) == fate.attempts
        assert sum(x.end_ns - x.begin_ns for x in data) == fate.air_ns
        assert sum(x.end_ns - x.begin_ns for x in answers) == fate.ack_air_ns
        assert all(x.end_ns <= fate.busy_ns for x in seen)
        assert all(first.end_ns <= then.begin_ns for first, then in pairwise(seen))
        if fate.cause is None:
            assert {x.part for x in data if x.heard} == {x.part for x in data}
            assert fate.span_ns == fate.delay_ns - next(x for x in data if x.heard).begin_ns or fate.delay_ns == MS


def test_strengths_pass_through_wrappers_and_end_with_the_range() -> None:
    plain = radio_link(PLACES, radio="lora868", sf=7)
    wrapped = make_link({**LORA, "range_m": 250.0, "burst_loss": 0.1}, 1, PLACES)
    signals = Signals.of(wrapped, "field")
    assert signals is not None
    assert signals.db("a", "hub") == plain.snr_db("a", "hub")
    assert signals.db("a", "b") is None
    assert signals.reach_m == 250.0


# --- carrier sense ---


def carrier(offset_ns: int, b: tuple[float, float] = (20.0, 0.0)) -> int:
    """How many pairs meet if b sends so long after a, and both listen first."""
    places = {"a": (0.0, 0.0), "b": b, "hub": (10.0, 0.0)}
    link = make_link({"model": "lognormal_prr", "radio": "802154-0dbm"}, 1, places)
    signals = Signals.of(link, "field")
    assert signals is not None
    frames = [frame("a", S), frame("b", 2 * S)]
    firsts = [one.sent_ns + signals.on_air(one)[0].begin_ns for one in frames]
    sent = Sent.of(signals, frames, [0, 1])
    later = sent.sender == 1
    shift = firsts[0] + offset_ns - firsts[1]
    moved = {name: getattr(sent, name) + shift * later for name in ("begin", "end", "opened")}
    orders = {"by_begin": moved["begin"].argsort(), "by_end": moved["end"].argsort()}
    sent = replace(sent, **moved, **orders)
    blind_ns = RADIOS["802154-0dbm"](9).access.blind_ns
    assert blind_ns is not None
    return len(Clashes.of(sent, Near(signals, places, sent), blind_ns).others) // 2


def test_listening_keeps_apart_who_hears_the_other_in_time() -> None:
    assert carrier(0) == 1
    assert carrier(191_999) == 1
    assert carrier(192_000) == 0
    assert carrier(-191_999) == 1
    assert carrier(-192_000) == 0
    assert carrier(500_000, b=(3000.0, 0.0)) == 1  # hidden


def test_repeats_are_hit_as_often_as_all_are() -> None:
    """Both first tries meet, each frame has two more: 2 frames, a share of all transmissions that were hit, squared."""
    places = {"a": (0.0, 0.0), "b": (20.0, 0.0), "hub": (10.0, 0.0)}
    link = make_link({"model": "lognormal_prr", "radio": "802154-0dbm", "ack": 3}, 1, places)
    signals = Signals.of(link, "field")
    assert signals is not None
    n, m = next(
        (n, m)
        for n in range(400)
        for m in range(400)
        if (first := signals.on_air(frame("a", n * S))[0].begin_ns)
        == signals.on_air(frame("b", n * S + m))[0].begin_ns + m
        and first
    )
    frames = [frame("a", n * S), frame("b", n * S + m), *(frame("a", (500 + k) * S) for k in range(6))]
    found = air_of(link, places, frames, [Due(k, "hub", True) for k in range(8)], 1000 * S)
    assert found is not None
    level = [signals.db(id, "hub") or 0.0 for id in ("a", "b")]
    hit = 2 - (abs(level[0] - level[1]) >= 6.0)
    assert found.spared == pytest.approx(hit * (hit / 8) ** 2)


# --- any frames ---

TIMES = st.lists(st.tuples(st.sampled_from("ab"), st.integers(0, 40), st.booleans()), min_size=1, max_size=30)


@settings(max_examples=60, deadline=None)
@given(TIMES, st.randoms(use_true_random=False), st.sampled_from(["lora868", "802154-0dbm"]))
def test_figures_do_not_depend_on_the_order_of_frames(times: list[tuple[str, int, bool]], random, radio: str) -> None:  # type: ignore[no-untyped-def]
    link = make_link({"model": "lognormal_prr", "radio": radio, "ack": 2}, 1, PLACES)
    frames = [
        frame(src, S + slot * MS, "*" if broadcast else "hub", broadcast=broadcast, copy=n)
        for n, (src, slot, broadcast) in enumerate(times)
    ]
    found = []
    for _ in range(2):
        dues = [Due(n, "hub", True) for n in range(len(frames))]
        shuffled = random.sample(range(len(frames)), len(frames))
        place = {old: new for new, old in enumerate(shuffled)}
        dues = [Due(place[due.frame], due.hearer, frames[due.frame].copy % 2 == 0) for due in dues]
        found.append(air_of(link, PLACES, [frames[n] for n in shuffled], dues, 10 * S))
    assert found[0] == found[1]
    assert found[0] is not None
    assert found[0].captured <= found[0].overlapped <= found[0].expected
    assert found[0].spared <= found[0].expected


@settings(max_examples=60, deadline=None)
@given(st.lists(st.integers(0, 500), min_size=2, max_size=25, unique=True))
def test_overlaps_are_those_of_all_pairs(slots: list[int]) -> None:
    """Sums over sorted beginnings and ends find what a look at each pair finds."""
    frames = [frame("ab"[n % 2], S + slot * MS) for n, slot in enumerate(slots)]
    found = judged(levelled(0.0), *frames)
    over = [any(a.src != b.src and abs(a.sent_ns - b.sent_ns) < AIR_NS for b in frames) for a in frames]
    assert found.overlapped == sum(over)
