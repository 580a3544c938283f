"""The lives of a gateway, what is stored for the next one, and whatever else may come: bound and order hold."""

from __future__ import annotations

import msgpack
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gateway.subscriptions import MOST
from tests.ether import ORIGIN_NS
from tests.gatewayed import (
    ALL,
    BASE,
    LASTS_S,
    NO_MORE,
    PATIENCE_NS,
    PLACES,
    WEST,
    Station,
    fix,
    gateway,
    miss,
    subscribed,
)
from trackfield.role import NS, IllegalEvent, Received, SetTimer, Store, Tell, Timer
from trackfield.wire.codec import decode
from trackfield.wire.interests import Arrived
from trackfield.wire.passes import FIXES

# --- lives --------------------------------------------------------------------------------------------------------


def test_a_next_life_knows_its_subscribers_but_not_what_waited() -> None:
    before = subscribed().told(WEST, "other").arrives(fix(1)).later(10.0)
    one = Station(now=before.now, stored=before.stored)
    assert [asked.radius_m for asked in one.interests] == [200.0, 10.0]
    assert one.counts == (0, 0, 0, 0, 0)
    assert one.timers == {"expiry": ORIGIN_NS + round(LASTS_S * NS)}
    assert [(to, item.number, item.life) for to, item in one.arrives(fix(2)).items] == [
        ("control", 1, 10), ("other", 2, 10),
    ]  # fmt: skip


def test_a_next_life_forgets_subscriptions_that_expired_while_it_was_away() -> None:
    before = subscribed()
    one = Station(now=before.now + round(LASTS_S * NS), stored=before.stored)
    assert one.interests == []
    assert one.timers == {}
    assert one.arrives(fix(1)).counts == (0, 0, 0, 0, 1)


def test_lives_differ_even_if_they_begin_in_the_same_step() -> None:
    first = subscribed()
    second = Station(now=first.now + 1, stored=first.stored)
    third = Station(now=first.now + 2, stored=second.stored)
    lives = [one.arrives(fix(1)).items[0][1].life for one in (first, second, third)]
    assert lives[0] != lives[1] != lives[2]


def test_a_life_that_begins_before_the_field_does_has_a_number() -> None:
    one = Station(now=0).told(ALL).arrives(fix(1))
    assert one.items[0][1].life == 65536 - ORIGIN_NS // NS


@pytest.mark.parametrize(
    "stored",
    [
        b"?",
        b"\xc1",
        msgpack.packb((1, 2, 3)),
        msgpack.packb((0, None)),
        msgpack.packb((0, [[1, 2, 3]])),
        msgpack.packb((0, [["no id", 2, 0, 0.0, 0.0, 1.0, 10**12]])),
        msgpack.packb((0, [["control", 2, 0, 0.0, 0.0, 1.0, float("inf")]])),
    ],
)
def test_what_was_stored_badly_is_forgotten(stored: bytes) -> None:
    one = Station(stored=stored)
    assert "cannot be used" in one.note
    assert one.told(ALL).arrives(fix(1)).steps == [1]


def test_what_is_stored_is_short() -> None:
    one = Station()
    for i in range(MOST):
        one.told(ALL, f"s{i}")
    assert len(one.stored) < 1000
    one.arrives(fix(1))
    assert not any(isinstance(effect, Store) for effect in one.effects)


def test_a_timer_that_it_did_not_set_is_the_drivers_fault() -> None:
    for name in ("item:control", "item:", "step"):
        with pytest.raises(IllegalEvent):
            subscribed().give(Timer(ORIGIN_NS, name))


# --- whatever comes -----------------------------------------------------------------------------------------------

EVENTS = st.lists(
    st.one_of(
        st.tuples(st.just("fix"), st.sampled_from(["n1", "n2"])),
        st.tuples(st.just("miss"), st.sampled_from(["n1", "n2"])),
        st.tuples(st.just("ack"), st.sampled_from(["control", "other"])),
        st.tuples(st.just("all"), st.sampled_from(["control", "other"])),
        st.tuples(st.just("west"), st.sampled_from(["control", "other"])),
        st.tuples(st.just("no more"), st.sampled_from(["control", "other"])),
        st.tuples(st.just("ring"), st.just("")),
        st.tuples(st.just("later"), st.just("")),
        st.tuples(st.just("restart"), st.just("")),
    ),
    max_size=60,
)


@given(events=EVENTS, room=st.integers(1, 5))
def test_the_bound_and_the_order_hold_whatever_happens(events: list[tuple[str, str]], room: int) -> None:
    """What was sent first was queued first, no more wait than there is room for, and every message is accounted for."""
    one = Station(gateway(queue=room, passes=["fixes", "misses"]))
    passed = dict[str, list[int]]()
    queued = withdrawn = unwanted = 0
    for step, (what, who) in enumerate(events):
        waiting = sum(item.to == who for item in one.state.queue.items)
        match what:
            case "fix" | "miss":
                wanting = one.state.wanted.wanting(FIXES, PLACES[who])
                queued, unwanted = queued + len(wanting), unwanted + (not wanting)
                one.arrives(fix(step) if what == "fix" else miss(step), who)
            case "ack" if first := one.state.queue.first(who):
                one.acked(who)
                passed.setdefault(who, []).append(decode(first.item.message).step)
            case "all" | "west" | "no more":
                withdrawn += waiting if what == "no more" and (who, FIXES) in one.state.wanted.known else 0
                one.told({"all": ALL, "west": WEST, "no more": NO_MORE}[what], who)
            case "ring" if one.timers:
                one.rings()
            case "later":
                one.later(LASTS_S / 2)
            case "restart":
                one = Station(one.role, one.now + NS, one.stored)
                queued = withdrawn = unwanted = 0
                passed.clear()
        items, under, counts = one.state.queue.items, one.state.queue.under, one.state.counts
        assert len(items) <= room
        assert under.keys() == {item.to for item in items} & one.state.wanted.subscribers
        assert one.timers.keys() - {"expiry"} == {f"item:{to}" for to in under}
        assert all(steps == sorted(set(steps)) for steps in passed.values())
        assert counts.passed == sum(map(len, passed.values()))
        assert counts.unwanted == unwanted + withdrawn
        assert queued == counts.passed + counts.dropped + withdrawn + len(items)


@given(data=st.binary(max_size=60), origin=st.binary(max_size=32))
def test_any_bytes_out_of_the_field_are_refused_or_passed(data: bytes, origin: bytes) -> None:
    one = subscribed()
    one.give(Received(one.now, Arrived(origin, data), BASE))
    assert one.counts == (0, 0, 1, 0, 0)
    assert not one.items


def test_what_it_tells_is_a_topic_of_five_whole_numbers() -> None:
    one = subscribed().arrives(fix(1))
    (tell,) = [effect for effect in one.effects if isinstance(effect, Tell)]
    assert tell == Tell("gateway", (1, 0, 0, 0, 0))
    assert SetTimer("item:control", one.now + PATIENCE_NS) in one.effects
