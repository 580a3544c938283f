"""A process in a collection tree, event by event: frames that are lost, neighbours that die, costs that are old."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import pytest

from trackfield.protocols.collection.piece import Collection, Step
from trackfield.protocols.collection.routes import HYSTERESIS
from trackfield.role import (
    NEIGHBOURHOOD,
    NS,
    CancelTimer,
    Event,
    Ignored,
    IllegalEvent,
    Note,
    Received,
    Send,
    SetTimer,
    Started,
    Timer,
)
from trackfield.wire import Doa, Threshold, Track, encode
from trackfield.wire.messages import NOWHERE, Hop, HopAck, Route

MS = 1_000_000
REPORT = Doa(1, 2.0, 3.0)


@dataclass
class Station:
    """A process under test: its state, its time, and all that it sent."""

    piece: Collection
    now: int = 0
    tree: Any = None
    sent: list[Send] = field(default_factory=list)
    timers: dict[str, int] = field(default_factory=dict)
    arrived: list[Received] = field(default_factory=list)
    said: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.tree = self.piece.begin()
        self.gets(Started(0))

    def gets(self, event: Event) -> list[Any]:
        """Handle an event; returns the messages that it sent."""
        return self.does(self.piece.handle(self.tree, event))

    def does(self, step: Step) -> list[Any]:
        self.tree = step.tree
        self.arrived += [step.arrived] if step.arrived else []
        for effect in step.effects:
            match effect:
                case SetTimer(name, at):
                    self.timers[name] = at
                case CancelTimer(name):
                    self.timers.pop(name, None)
                case Note(text) | Ignored(text):
                    self.said.append(text)
        sent = [effect for effect in step.effects if isinstance(effect, Send)]
        self.sent += sent
        return [send.message for send in sent]

    def hears(self, message: Any, sender: str) -> list[Any]:
        self.now += MS
        return self.gets(Received(self.now, message, sender))

    def sends(self, message: Any, to: str = "") -> list[Any]:
        return self.does(self.piece.send(self.tree, self.now, message, to))

    def waits(self, timer: str) -> list[Any]:
        """Until this timer is due; others are not looked at."""
        self.now = self.timers.pop(timer)
        return self.gets(Timer(self.now, timer))

    @property
    def parent(self) -> str:
        return self.tree.routes.parent

    @property
    def to(self) -> str:
        """To whom it last sent a message."""
        return next(send.to for send in reversed(self.sent) if isinstance(send.message, Hop))


def station(id: str = "me", **arguments: Any) -> Station:
    return Station(Collection(**{"id": id, "base": "base", "seed": 1, **arguments}))


def route(number: int, cost: float, parent: str = "", pull: int = 0) -> Route:
    return Route(number, cost, pull, parent.encode())


def know(
    one: Station, neighbour: str, cost: float, *, numbers: Iterable[int] = range(10, 13), parent: str = ""
) -> None:
    """Beacons of a neighbour on a link that has lost none."""
    for number in numbers:
        one.hears(route(number, cost, parent), neighbour)


def settled(*costs: tuple[str, float], **arguments: Any) -> Station:
    """A process that knows these neighbours well."""
    one = station(**arguments)
    for neighbour, cost in costs:
        know(one, neighbour, cost)
    return one


def up(origin: str, number: int, *, hops: int = 0, cost: float = 9.0, message: Any = REPORT) -> Hop:
    return Hop(origin.encode(), number, hops, cost, b"", encode(message))


def report(step: int) -> Doa:
    return Doa(step, 90.0, 60.0)


def track(at_us: int, tracker: int = 0) -> Track:
    return Track(at_us, 0, tracker, 1, 4, bytes(56), b"")


# --- beacons and the choice of a parent -------------------------------------------------------------------------------


def test_the_base_says_that_it_costs_nothing_and_others_add_their_link() -> None:
    base = station("base")
    assert base.waits("beacon")[0].cost == 0.0
    one = settled(("base", 0.0))
    assert one.parent == "base"
    beacon = one.waits("beacon")[0]
    assert (beacon.cost, beacon.parent, beacon.pull) == (1.0, b"base", 0)
    assert one.sent[-1].to == NEIGHBOURHOOD


def test_beacons_come_at_longer_and_longer_intervals_and_soon_again_if_there_is_news() -> None:
    base, times = station("base", least_ns=NS, most_ns=8 * NS), [0]
    for _ in range(8):
        base.waits("beacon")
        times.append(base.now)
    gaps = [later - earlier for earlier, later in pairwise(times)]
    for gap, interval_s in zip(gaps, [1, 2, 4, 8, 8, 8, 8, 8], strict=True):
        assert interval_s / 2 <= gap / NS <= interval_s
    base.hears(route(5, NOWHERE, pull=1), "n1")
    assert base.timers["beacon"] - base.now <= NS
    soon = base.timers["beacon"]
    base.hears(route(5, NOWHERE, pull=1), "n2")
    assert base.timers["beacon"] == soon, "who asks again does not put it off"


def test_a_process_without_a_way_asks_and_one_without_a_way_has_no_answer() -> None:
    one = station()
    assert one.waits("beacon")[0].pull == 1
    one.waits("beacon")
    before = one.timers["beacon"]
    one.hears(route(1, NOWHERE, pull=1), "other")
    assert one.timers["beacon"] == before
    assert one.parent == ""


def test_the_parent_is_where_the_cost_is_least_and_stays_unless_another_is_much_better() -> None:
    one = settled(("a", 3.0), ("b", 2.0))
    assert one.parent == "a", "better by less than the hysteresis"
    know(one, "c", 3.0 - HYSTERESIS)
    assert one.parent == "c"


def test_missed_beacons_make_a_link_costly() -> None:
    one = station()
    know(one, "near", 1.0, numbers=[10, 11, 12])
    know(one, "far", 0.0, numbers=[10, 12, 14, 16, 18, 20])
    assert one.tree.routes.links["near"].etx == 1.0
    assert one.tree.routes.links["far"].etx > 2.0
    assert one.parent == "near"


def test_a_link_in_one_direction_only_is_given_up_however_well_its_beacons_are_heard() -> None:
    one = settled(("deaf", 0.0), ("far", 4.0))
    tried = []
    for turn in range(12):
        know(one, "deaf", 0.0, numbers=range(13 + 3 * turn, 16 + 3 * turn))
        one.sends(report(turn))
        tried.append(one.to)
        while one.to == "deaf":
            one.waits("patience")
        one.hears(HopAck(b"me", one.tree.traffic.queue[0].number), "far")
    assert tried[0] == "deaf"
    assert tried[-6:].count("deaf") <= 2, "it may have become better, so it is tried now and then"
    assert one.tree.routes.links["deaf"].inward == 1.0


def test_a_neighbour_that_was_restarted_is_known_anew() -> None:
    one = settled(("a", 1.0))
    one.hears(route(40_000, 1.0), "a")
    assert one.tree.routes.links["a"].windows == 0


def test_a_child_is_no_parent() -> None:
    one = settled(("a", 5.0))
    know(one, "child", 1.0, parent="me")
    assert one.parent == "a"


def test_a_way_that_costs_too_much_is_none() -> None:
    assert settled(("a", 130.0)).parent == ""


# --- messages, and what is lost ---------------------------------------------------------------------------------------


def test_a_message_goes_to_the_parent_until_it_is_acknowledged_and_the_next_follows() -> None:
    one = settled(("a", 1.0))
    (first,) = one.sends(report(1))
    assert one.sends(report(2)) == []
    assert (first.origin, first.hops, first.cost, first.message) == (b"me", 0, 2.0, encode(report(1)))
    (second,) = one.hears(HopAck(first.origin, first.number), "a")
    assert (second.number - first.number, second.message) == (1, encode(report(2)))
    one.hears(HopAck(second.origin, second.number), "a")
    assert "patience" not in one.timers
    assert one.tree.traffic.queue == ()


def test_a_lost_message_is_sent_again_and_the_link_is_worse_for_it() -> None:
    one = settled(("a", 1.0))
    first = one.sends(report(1))
    assert one.waits("patience") == first
    one.hears(HopAck(b"me", first[0].number), "a")
    for step in range(2, 6):
        (hop,) = one.sends(report(step))
        one.hears(HopAck(b"me", hop.number), "a")
    link = one.tree.routes.links["a"]
    assert link.success == pytest.approx((1 + 4 / 5) / 2), "as good as its beacons, and one try of five failed"


def test_an_acknowledgement_of_something_else_is_ignored() -> None:
    one = settled(("a", 1.0), ("b", 2.0))
    (hop,) = one.sends(report(1))
    one.hears(HopAck(b"me", hop.number + 1), "a")
    one.hears(HopAck(b"me", hop.number), "b")
    assert one.said == ["outdated", "outdated"]
    assert len(one.tree.traffic.queue) == 1


def test_a_lost_acknowledgement_makes_a_duplicate_which_is_acknowledged_and_goes_nowhere() -> None:
    one = settled(("a", 1.0))
    came = up("child", 7)
    ack, handed_on = one.hears(came, "child")
    assert (ack, one.to) == (HopAck(b"child", 7), "a")
    assert (handed_on.origin, handed_on.number, handed_on.hops) == (b"child", 7, 1)
    assert one.hears(came, "child") == [HopAck(b"child", 7)]
    assert one.said == ["repeated"]


def test_three_lost_tries_lose_the_parent_and_the_next_best_gets_the_message_at_once() -> None:
    one = settled(("a", 1.0), ("b", 4.0))
    one.sends(report(1))
    assert [one.waits("patience") and one.to for _ in range(3)] == ["a", "a", "b"]
    assert one.parent == "b"
    assert one.said == ["a does not answer: the way to base leads over b"]
    assert one.waits("beacon")[0].pull == 1, "the lost one may have been unlucky"
    assert one.waits("beacon")[0].pull == 0
    know(one, "a", 0.0, numbers=range(13, 16))
    assert one.parent == "a", "it is heard again, and is much better"


def test_a_message_that_nobody_takes_is_given_up_and_the_next_has_its_turn() -> None:
    one = settled(("a", 1.0), ("b", 2.0), ("c", 3.0), ("d", 4.0))
    one.sends(report(1))
    one.sends(report(2))
    for _ in range(8):
        assert one.waits("patience")[0].message == encode(report(1))
    assert one.waits("patience")[0].message == encode(report(2))
    assert one.to == "d"
    assert one.said[-1].endswith("is dropped: 3 neighbours do not answer")
    assert one.tree.traffic.dropped == 1


def test_a_process_whose_way_is_gone_keeps_the_newest_and_sends_them_when_there_is_one() -> None:
    one = settled(("a", 1.0), queue=4)
    for step in range(1, 4):
        one.sends(report(step))
    for _ in range(3):
        one.waits("patience")
    assert one.parent == ""
    for step in range(4, 7):
        assert one.sends(report(step)) == []
    assert one.waits("beacon")[0].pull == 1
    (hop,) = one.hears(route(13, 1.0), "a")
    assert hop.message == encode(report(3)), "of 6 the 4 newest"
    assert sum("4 wait already" in text for text in one.said) == 2


def test_a_full_queue_drops_the_oldest_that_is_not_under_way() -> None:
    one = settled(("a", 1.0), queue=3)
    for step in range(1, 6):
        one.sends(report(step))
    left = [waiting.message for waiting in one.tree.traffic.queue]
    assert left == [encode(report(step)) for step in (1, 4, 5)]
    assert one.tree.traffic.dropped == 2


def test_a_newer_track_replaces_one_that_waits_but_not_one_of_another_tracker_or_under_way() -> None:
    one = settled(("a", 1.0))
    for message in (track(1), track(2), track(2, tracker=1), track(3), report(1), track(4)):
        one.sends(message)
    left = [waiting.message for waiting in one.tree.traffic.queue]
    assert left == [encode(message) for message in (track(1), track(4), track(2, tracker=1), report(1))]
    assert sum("a newer one replaces it" in text for text in one.said) == 2


# --- loops ------------------------------------------------------------------------------------------------------------


def test_a_message_from_somebody_no_further_away_is_a_loop_and_is_told() -> None:
    one = settled(("a", 1.0), ("b", 4.0))
    for _ in range(6):
        one.waits("beacon")
    calm = one.timers["beacon"]
    one.hears(up("far", 1, cost=2.5), "child")
    assert one.timers["beacon"] == calm, "its child is further away"
    assert one.to == "a"
    assert one.hears(up("far", 2, cost=1.5), "a") == [HopAck(b"far", 2)]
    assert one.parent == "b", "the one to which it sent sends to it"
    assert one.timers["beacon"] < calm
    (again,) = one.waits("patience")
    assert (again.number, one.to) == (1, "b"), "what was under way to the old one"


def test_a_message_that_comes_round_goes_on_by_the_way_that_holds_now_but_not_for_ever() -> None:
    one = settled(("a", 1.0))
    _, hop = one.hears(up("far", 1), "child")
    one.hears(HopAck(b"far", 1), "a")
    _, again = one.hears(up("far", 1, hops=3), "child")
    assert (hop.hops, again.hops) == (1, 4)
    one.hears(HopAck(b"far", 1), "a")
    assert one.hears(up("far", 1, hops=63), "child") == [HopAck(b"far", 1)]
    assert one.said == ["too many hops"]


# --- the base, and answers --------------------------------------------------------------------------------------------


def test_the_base_gets_each_message_once_from_its_origin() -> None:
    base = station("base")
    assert base.hears(up("far", 1, hops=2), "a") == [HopAck(b"far", 1)]
    assert base.hears(up("far", 1, hops=4), "b") == [HopAck(b"far", 1)]
    (got,) = base.arrived
    assert (got.message, got.sender, got.now) == (Doa(1, 2.0, 3.0), "far", MS)
    assert base.said == ["repeated"]


def test_an_answer_takes_the_way_back_with_the_same_tries() -> None:
    base, relay, far = station("base"), settled(("base", 0.0), id="relay"), settled(("relay", 1.0), id="far")
    (hop,) = far.sends(report(1))
    _, hop = relay.hears(hop, "far")
    base.hears(hop, "relay")
    (answer,) = base.sends(Threshold(1, 50.0), "far")
    assert base.to == "relay"
    assert base.waits("patience") == [answer]
    relay.hears(HopAck(b"far", hop.number), "base")
    ack, on = relay.hears(answer, "base")
    assert (ack, relay.to) == (HopAck(b"base", answer.number), "far")
    assert far.hears(on, "relay") == [HopAck(b"base", answer.number)]
    assert [(got.message, got.sender) for got in far.arrived] == [(Threshold(1, 50.0), "base")]
    assert far.hears(on, "relay") == [HopAck(b"base", answer.number)]
    assert len(far.arrived) == 1


def test_an_answer_to_somebody_unknown_or_gone_is_dropped_and_others_go() -> None:
    base = station("base")
    base.hears(up("far", 1), "a")
    base.hears(up("near", 1), "b")
    base.sends(Threshold(1, 50.0), "nobody")
    assert base.said == [f"message {base.tree.traffic.number - 1} of base is dropped: no way to nobody is known"]
    base.sends(Threshold(1, 50.0), "far")
    base.sends(Threshold(1, 50.0), "near")
    assert [base.waits("patience") and base.to for _ in range(3)] == ["a", "a", "b"]
    assert base.said[-1].endswith("no way to far is known")


def test_an_announcement_tells_the_base_where_a_process_is() -> None:
    one, base = settled(("base", 0.0), announces=True), station("base")
    (hop,) = one.waits("announce")
    base.hears(hop, "me")
    assert base.arrived == []
    assert base.sends(Threshold(1, 50.0), "me")


# --- what is no use ---------------------------------------------------------------------------------------------------


def test_what_cannot_be_is_ignored_or_refused() -> None:
    base = station("base")
    base.hears(up("base", 1), "a")
    base.hears(Hop(b"far", 2, 0, 1.0, b"", b"\x00"), "a")
    base.hears(Hop(b"\xff" * 32, 2, 0, 1.0, b"", b""), "a")
    base.hears(Hop(b"far", 3, 0, 1.0, b"no id", b""), "a")
    base.hears(up("far", 4), "base")
    assert base.said == ["unexpected", "malformed", "key", "key", "unexpected"]
    assert base.arrived == []
    with pytest.raises(IllegalEvent, match="no timer 'other'"):
        base.gets(Timer(MS, "other"))
    with pytest.raises(IllegalEvent, match="no timer 'patience'"):
        base.gets(Timer(MS, "patience"))


def test_a_restarted_process_numbers_its_messages_anew() -> None:
    numbers = set()
    for start in range(5):
        one = Collection(id="me", base="base", seed=1)
        tree = one.handle(one.begin(), Started(start * NS)).tree
        numbers.add(tree.traffic.number)
    assert len(numbers) == 5
