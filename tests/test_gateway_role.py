"""A gateway, event by event: rules, subscriptions, the order and the bound of its queue."""

from __future__ import annotations

from dataclasses import replace

import pytest

from gateway.subscriptions import MOST
from tests.gatewayed import (
    ALL,
    LASTS_S,
    NO_MORE,
    PATIENCE_NS,
    WEST,
    Station,
    fix,
    gateway,
    miss,
    subscribed,
)
from trackfield.role import NS, CancelTimer, Received, State
from trackfield.wire.codec import decode, encode
from trackfield.wire.interests import Arrived
from trackfield.wire.messages import Doa
from trackfield.wire.outside import Item, ItemAck
from trackfield.wire.passes import FIXES, PASSES, CpaReport

# --- subscriptions ------------------------------------------------------------------------------------------------


def test_a_life_begins_with_nothing() -> None:
    one = Station()
    assert State("waiting") in one.effects
    assert one.counts == (0, 0, 0, 0, 0)
    assert one.timers == {}
    assert one.items == one.interests == []


def test_a_subscription_becomes_an_interest_of_the_sink_until_it_is_withdrawn() -> None:
    one = subscribed()
    (asked,) = one.interests
    assert (asked.sink, asked.task, asked.x_m, asked.y_m, asked.radius_m) == (b"base", FIXES, 50.0, 0.0, 200.0)
    assert asked.lasts_s > 0
    one.later(LASTS_S / 3).told(ALL)
    assert one.interests == []
    assert one.timers == {"expiry": one.now + round(LASTS_S * NS)}
    (gone,) = one.told(NO_MORE).interests
    assert (gone.number, gone.lasts_s) == (asked.number, 0.0)
    assert one.timers == {}


def test_a_subscription_expires_unless_it_is_renewed() -> None:
    one = subscribed().later(LASTS_S - 1).told(ALL).later(LASTS_S - 1)
    assert one.arrives(fix(1)).steps == [1]
    one = subscribed().later(LASTS_S - 1)
    (gone,) = one.rings().interests
    assert gone.lasts_s == 0.0
    assert one.arrives(fix(1)).counts == (0, 0, 0, 0, 1)


def test_what_comes_in_the_instant_in_which_a_subscription_expires_is_too_late() -> None:
    """Frames are handled before timers."""
    one = subscribed()
    one.now += round(LASTS_S * NS)
    assert one.arrives(fix(1)).counts == (0, 0, 0, 0, 1)
    full = Station()
    for i in range(MOST):
        full.told(ALL, f"s{i}")
    full.now += round(LASTS_S * NS)
    assert full.told(ALL, "late").ignored == ""


def test_another_region_takes_the_place_of_the_one_before() -> None:
    one = subscribed()
    (asked,) = one.interests
    (moved,) = one.told(WEST).interests
    assert (moved.number, moved.x_m, moved.radius_m) == (asked.number, 0.0, 10.0)
    assert one.arrives(fix(1), "n2").counts == (0, 0, 0, 0, 1)
    assert one.arrives(fix(2), "n1").steps == [2]


def test_each_subscriber_has_its_own_interest_and_gets_what_it_wants() -> None:
    one = Station().told(ALL, "control").told(WEST, "other")
    assert {wish.number for wish in one.state.wanted.known.values()} == {0, 1}
    assert [to for to, _ in one.arrives(fix(1), "n2").items] == ["control"]
    assert [to for to, _ in one.arrives(fix(2), "n1").items] == ["other"]
    assert one.counts == (3, 0, 0, 0, 0)
    one.told(NO_MORE, "control").told(ALL, "third")
    assert {key[0]: wish.number for key, wish in one.state.wanted.known.items()} == {"other": 1, "third": 0}


def test_who_may_not_subscribe_or_wants_another_class_is_refused_and_counted() -> None:
    one = Station(gateway(subscribers=["control"]))
    assert one.told(ALL, "stranger").counts == (0, 0, 1, 0, 0)
    assert one.ignored == "refused: not allowed to subscribe"
    assert one.told(replace(ALL, task=PASSES)).counts == (0, 0, 2, 0, 0)
    assert one.interests == []
    assert one.state.wanted.known == {}
    assert one.told(ALL).interests != []


def test_so_many_subscriptions_are_kept_and_more_are_refused() -> None:
    one = Station()
    for i in range(3000):
        one.told(ALL, f"s{i}")
    assert len(one.state.wanted.known) == MOST
    assert one.counts == (0, 0, 3000 - MOST, 0, 0)
    assert one.ignored == "refused: too many subscriptions"
    assert one.told(ALL, "s0").ignored == ""
    one.told(NO_MORE, "s3").told(ALL, "s99")
    assert one.ignored == ""
    assert one.later(LASTS_S).told(ALL, "s100").ignored == ""


def test_absurd_subscriptions_are_of_no_use_and_do_no_harm() -> None:
    one = Station()
    assert one.told(NO_MORE).ignored == "no such subscription"
    assert one.told(replace(ALL, radius_m=0.0, x_m=1e5, y_m=-1e5)).ignored == ""
    assert one.arrives(fix(1)).counts == (0, 0, 0, 0, 1)
    one.give(Received(one.now, ALL, "n1", "field"))
    assert one.ignored == "unexpected"


# --- rules --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("message", "why"),
    [
        (miss(1), "an event without a fix"),
        (CpaReport(1, 0.5, 0, -20.0, 1.0), "no fix"),
        (Doa(1, 90.0, 60.0), "no fix"),
        (Item(1, 0, FIXES, b"n1", encode(fix(1))), "no fix"),
        (b"", "malformed"),
        (b"\xc1 garbage", "malformed"),
    ],
)
def test_what_the_rules_do_not_name_is_refused_and_counted(message: object, why: str) -> None:
    one = subscribed().arrives(message)
    assert one.ignored == f"refused: {why}"
    assert one.counts == (0, 0, 1, 0, 0)
    assert one.items == []


def test_rules_may_name_events_without_a_fix_instead() -> None:
    one = subscribed(passes=["misses"])
    assert one.arrives(fix(1)).ignored == "refused: a fix"
    assert one.arrives(miss(2)).steps == [2]


def test_rules_may_name_heads() -> None:
    one = subscribed(heads=["n2"])
    assert one.arrives(fix(1), "n1").ignored == "refused: its origin may not"
    assert one.arrives(fix(2), "n2").steps == [2]
    for nobody in ("n9", "", "no id", "x" * 32):
        assert subscribed().arrives(fix(1), nobody).counts == (0, 0, 1, 0, 0)


def test_rules_come_before_subscriptions() -> None:
    assert Station().arrives(miss(1)).counts == (0, 0, 1, 0, 0)
    assert Station().arrives(fix(1)).counts == (0, 0, 0, 0, 1)


def test_only_the_sink_of_its_process_hands_over_what_came() -> None:
    one = subscribed()
    for sender, medium in (("n1", "field"), ("control", "backbone"), ("stranger", "backbone")):
        one.give(Received(one.now, Arrived(b"n1", encode(fix(1))), sender, medium))  # type: ignore[arg-type]
        assert one.ignored == "unexpected"
        assert one.counts == ()
        assert one.items == []


# --- the queue ----------------------------------------------------------------------------------------------------


def test_an_item_has_the_message_its_origin_and_its_class() -> None:
    ((to, item),) = subscribed().arrives(fix(7)).items
    assert to == "control"
    assert item == Item(1, 0, FIXES, b"n1", encode(fix(7)))


def test_one_item_is_under_way_at_a_time_and_they_keep_their_order() -> None:
    one = subscribed()
    assert one.arrives(fix(1)).steps == [1]
    assert one.shown == "sending"
    assert one.arrives(fix(2)).steps == one.arrives(fix(3)).steps == []
    assert one.acked().steps == [2]
    assert one.acked().steps == [3]
    assert one.acked().counts == (0, 3, 0, 0, 0)
    assert one.shown == "waiting"
    assert list(one.timers) == ["expiry"]


def test_only_its_receivers_acknowledgement_of_this_item_and_life_counts() -> None:
    one = subscribed().told(ALL, "other").arrives(fix(1))
    number = one.items[0][1].number
    before = one.state
    for ack, sender in (
        (ItemAck(number + 5, 0), "control"),
        (ItemAck(number, 1), "control"),
        (ItemAck(number, 0), "other"),
        (ItemAck(number, 0), "stranger"),
    ):
        assert one.told(ack, sender).ignored == "outdated"
        assert one.state == before
    one.give(Received(one.now, ItemAck(number, 0), "control", "field"))
    assert one.ignored == "unexpected"
    assert one.told(ItemAck(number, 0)).counts == (1, 1, 0, 0, 0)
    assert one.told(ItemAck(number, 0)).ignored == "outdated"


def test_an_item_is_sent_again_at_longer_and_longer_intervals() -> None:
    one = subscribed().arrives(fix(1))
    first, waits, sent_ns = one.items, list[int](), one.now
    for _ in range(6):
        assert one.rings().items == first
        waits.append(one.now - sent_ns)
        sent_ns = one.now
    assert waits == [PATIENCE_NS * times for times in (1, 2, 4, 8, 8, 8)]
    one.arrives(fix(2)).acked()
    assert one.timers["item:control"] == one.now + PATIENCE_NS


def test_a_sign_of_life_brings_it_at_once() -> None:
    one = subscribed().arrives(fix(1)).later(10.0)
    assert one.told(ALL).steps == [1]
    assert one.timers["item:control"] == one.now + PATIENCE_NS
    one = subscribed().arrives(fix(1))
    assert one.told(ALL).steps == []


def test_of_more_than_fit_the_oldest_fix_is_dropped_even_if_it_is_under_way() -> None:
    one = subscribed()
    for step in range(1, 5):
        one.arrives(fix(step))
    assert one.queued == [1, 2, 3, 4]
    assert one.arrives(fix(5)).counts == (4, 0, 0, 1, 0)
    assert one.queued == [2, 3, 4, 5]
    assert one.steps == [2]
    assert one.told(ItemAck(1, 0)).ignored == "outdated"
    assert [one.acked().steps for _ in range(4)] == [[3], [4], [5], []]


def test_events_without_a_fix_are_kept_rather_than_fixes() -> None:
    one = subscribed(passes=["fixes", "misses"])
    for message in (miss(1), fix(2), miss(3), fix(4), miss(5)):
        one.arrives(message)
    assert one.queued == [1, 3, 4, 5]
    assert one.arrives(miss(6)).steps == []
    assert one.queued == [1, 3, 5, 6]
    assert one.arrives(fix(7)).steps == [3]
    assert one.queued == [3, 5, 6, 7]


def test_the_bound_is_of_all_receivers_together() -> None:
    one = subscribed().told(ALL, "other")
    for step in (1, 2, 3):
        one.arrives(fix(step))
    assert [(one.to, decode(one.item.message).step) for one in one.state.queue.items] == [
        ("control", 2), ("other", 2), ("control", 3), ("other", 3),
    ]  # fmt: skip
    assert one.state.counts.dropped == 2


def test_what_a_receiver_no_longer_wants_is_given_up_and_counted() -> None:
    one = subscribed().told(ALL, "other").arrives(fix(1)).arrives(fix(2))
    assert one.told(NO_MORE).counts == (2, 0, 0, 0, 2)
    assert CancelTimer("item:control") in one.effects
    assert [one.acked("other").steps for _ in range(2)] == [[2], []]


def test_what_waits_when_a_subscription_expires_goes_on_when_its_subscriber_is_back() -> None:
    one = subscribed().arrives(fix(1)).arrives(fix(2)).later(LASTS_S)
    assert one.timers == {}
    assert one.state.phase == "waiting"
    assert one.arrives(fix(3)).counts == (2, 0, 0, 0, 1)
    assert one.told(ALL).steps == [1]
    assert one.acked().steps == [2]


def test_an_acknowledgement_that_comes_after_the_subscription_expired_counts() -> None:
    one = subscribed().arrives(fix(1)).later(LASTS_S)
    assert one.acked().counts == (0, 1, 0, 0, 0)
