"""A gateway and those that want its items, each story with one step that is lost."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st

from gateway.forwarder import Forwarder
from launcher.plan.architectures.outside.chain import Chain
from tests.ether import ORIGIN_NS
from tests.gatewayed import ALL, BASE, LASTS_S, Backbone, Taker, gateway
from tests.hearing import named, pentagon, sink_of
from tests.puppet import MS
from trackfield.host import Host
from trackfield.protocols.carried import Carried
from trackfield.role import NEIGHBOURHOOD, NS, Received, Send, Started, Timer
from trackfield.wire.codec import encode
from trackfield.wire.interests import Arrived, Data, Interest
from trackfield.wire.outside import ItemAck, Subscribe
from trackfield.wire.passes import FIXES, PASSES, CpaReport

CONTROL = "control"


def begun(**takers: Taker) -> Backbone:
    """A second after all have started."""
    return Backbone(None, **takers).wait(1)


def test_nothing_is_lost() -> None:
    net = begun()
    for step in (1, 2, 3):
        net.fixed(step)
    net.wait(1)
    assert net.takers[CONTROL].steps == [1, 2, 3]
    assert len(net.frames("item")) == len(net.frames("item-ack")) == 3
    assert net.tells[-1] == (0, 3, 0, 0, 0)


def test_an_item_is_lost() -> None:
    net = begun()
    net.rule("item", count=2)
    for step in (1, 2):
        net.fixed(step)
    net.wait(2)
    assert net.takers[CONTROL].steps == [1, 2]
    assert len(net.frames("item")) == 4
    assert net.tells[-1] == (0, 2, 0, 0, 0)


def test_an_acknowledgement_is_lost() -> None:
    net = begun()
    net.rule("item-ack", count=1)
    for step in (1, 2):
        net.fixed(step)
    net.wait(2)
    assert net.takers[CONTROL].steps == [1, 2]
    assert net.reasons(CONTROL) == ["repeated"]
    assert net.tells[-1] == (0, 2, 0, 0, 0)


def test_an_acknowledgement_comes_late_and_twice() -> None:
    net = begun()
    net.rule("item-ack", count=1, delays=(250 * MS, 300 * MS))
    for step in (1, 2):
        net.fixed(step)
    net.wait(2)
    assert net.takers[CONTROL].steps == [1, 2]
    assert set(net.reasons(BASE)) == {"outdated"}
    assert net.tells[-1] == (0, 2, 0, 0, 0)


def test_a_subscription_is_lost() -> None:
    net = Backbone()
    net.rule("subscribe", count=1)
    net.wait(1).fixed(1)
    net.wait(LASTS_S / 3).fixed(2)
    net.wait(1)
    assert net.takers[CONTROL].steps == [2]
    assert net.tells[-1] == (0, 1, 0, 0, 1)


def test_the_backbone_is_cut_and_back() -> None:
    """Seven fixes come meanwhile and four wait: the last ones, in their order."""
    net = begun()
    mend = net.cut(CONTROL)
    for step in range(1, 8):
        net.fixed(step)
        net.wait(5)
    assert net.takers[CONTROL].steps == []
    assert net.tells[-1] == (4, 0, 0, 3, 0)
    mend()
    net.wait(LASTS_S / 3)
    net.fixed(8)
    net.wait(1)
    assert net.takers[CONTROL].steps == [4, 5, 6, 7, 8]
    assert net.tells[-1] == (0, 5, 0, 3, 0)


def test_a_cut_outlasts_the_subscription() -> None:
    """What came under it is there after the cut; what came later is not, as nobody wanted it."""
    net = begun()
    mend = net.cut(CONTROL)
    net.fixed(1)
    net.wait(LASTS_S + 10)
    sent = len(net.frames("item"))
    net.fixed(2)
    net.wait(100)
    assert len(net.frames("item")) == sent
    mend()
    net.wait(LASTS_S / 3).fixed(3)
    net.wait(1)
    assert net.takers[CONTROL].steps == [1, 3]
    assert net.tells[-1] == (0, 2, 0, 0, 1)


def test_one_receiver_is_away_and_the_other_is_served() -> None:
    net = begun(control=Taker(), other=Taker())
    mend = net.cut("other")
    for step in (1, 2):
        net.fixed(step)
    net.wait(10)
    assert net.takers[CONTROL].steps == [1, 2]
    mend()
    net.wait(LASTS_S / 3)
    assert net.takers["other"].steps == [1, 2]


def test_nothing_comes_from_the_field_for_minutes() -> None:
    net = begun()
    net.wait(5 * LASTS_S).fixed(1)
    net.wait(1)
    assert net.takers[CONTROL].steps == [1]
    assert len([one for one in net.frames("interest") if not one.message.lasts_s]) == 0


def test_the_gateway_is_restarted_while_an_item_is_under_way() -> None:
    """What waited is lost; the next fix arrives without anybody subscribing anew, as one of another life."""
    net = begun()
    net.fixed(1)
    net.wait(1)
    mend = net.cut(CONTROL)
    net.fixed(2)
    net.wait(1)
    net.kill(BASE)
    mend()
    net.wait(2)
    net.start(BASE)
    asked = len(net.frames("subscribe"))
    net.fixed(3)
    net.wait(1)
    assert len(net.frames("subscribe")) == asked
    assert [step for step, _ in net.takers[CONTROL].came] == [1, 3]
    first, second = (life for _, life in net.takers[CONTROL].came)
    assert first != second
    assert net.tells[-1] == (0, 1, 0, 0, 0)


def test_the_receiver_is_restarted() -> None:
    """It subscribes anew, and has what waited at once."""
    net = begun()
    net.kill(CONTROL)
    for step in (1, 2):
        net.fixed(step)
    net.wait(20)
    net.start(CONTROL)
    net.wait(0.2)
    assert net.takers[CONTROL].steps == [1, 2]


def test_a_receiver_wants_no_more() -> None:
    net = begun()
    net.rule("item")
    net.fixed(1)
    net.inject(BASE, replace(ALL, lasts_s=0.0), CONTROL)
    net.wait(5)
    net.fixed(2)
    assert net.tells[-1] == (0, 0, 0, 0, 2)
    assert len(net.frames("item")) == 1


def test_strangers_ask_for_everything_and_acknowledge_everything() -> None:
    net = Backbone(gateway(subscribers=[CONTROL])).wait(1)
    net.rule("item", receiver=CONTROL, count=1)
    for i in range(100):
        net.inject(BASE, ALL, f"s{i}")
    net.fixed(1)
    (sent,) = net.frames("item")
    for i in range(100):
        net.inject(BASE, ItemAck(sent.message.number, sent.message.life), f"s{i}")
    net.wait(1)
    assert net.takers[CONTROL].steps == [1]
    assert net.tells[-1] == (0, 1, 100, 0, 0)


# --- over several hops --------------------------------------------------------------------------------------------

CHAIN = Chain([BASE, "hop1", "hop2"], [CONTROL])


def over_hops(fates: Iterator[list[int]], **changes: Any) -> Backbone:
    """A gateway and a receiver with two forwarding nodes between them.

    Each of ``fates`` is when (ms) the next frame arrives, later than usual: never, once, or twice.
    """
    net = Backbone(gateway(**changes))
    for id in ("hop1", "hop2"):
        net.add(id, Forwarder(), (0.0, 0.0))
    for id, actor in net.actors.items():
        hold_ns = 10 * MS if id in CHAIN.links[1:] else 0
        actor.role = Carried(actor.role, id=id, next=CHAIN.next(id), hold_ns=hold_ns)
    net._delays = lambda kind, src, dst: tuple(ms * MS for ms in next(fates, [0])) if src != dst else ()  # type: ignore[method-assign]
    for id in net.actors:
        net.start(id)
    return net.wait(1)


@given(
    fates=st.lists(st.lists(st.integers(0, 400), max_size=2), max_size=60),
    pauses=st.lists(st.integers(0, 500), min_size=1, max_size=8),
)
@settings(deadline=None)
def test_over_hops_that_lose_delay_and_repeat_frames_all_come_once_and_in_order(
    fates: list[list[int]], pauses: list[int]
) -> None:
    net = over_hops(iter([[0]] * 3 + fates), queue=8, patience_ns=400 * MS)
    assert net.state(BASE).role.wanted.subscribers == {CONTROL}
    for step, pause_ms in enumerate(pauses, 1):
        net.fixed(step)
        net.wait(pause_ms / 1000)
    net.wait(240)
    assert net.takers[CONTROL].steps == list(range(1, len(pauses) + 1))
    assert net.tells[-1] == (0, len(pauses), 0, 0, 0)


# --- with the sink, its other half --------------------------------------------------------------------------------

NODES = named(pentagon())


class Both:
    """The process of the base: a sink and a gateway. They have started, and the sink has asked for fixes."""

    def __init__(self) -> None:
        sink = sink_of(NODES, (0.0, -40.0))
        sink.gateway = True
        one = gateway(places=NODES)
        self.host = Host({"sink": sink, "gateway": one}, id=BASE)
        self.state, self.effects = self.host.handle(self.host.begin(), Started(0))
        self.rings("sink/ask", ORIGIN_NS)

    def rings(self, name: str, now: int) -> None:
        self.state, self.effects = self.host.handle(self.state, Timer(now, name))

    def comes(self, message: object, sender: str, medium: str, now: int = ORIGIN_NS + NS) -> Both:
        self.state, self.effects = self.host.handle(self.state, Received(now, message, sender, medium))  # type: ignore[arg-type]
        return self

    def sends(self, kind: type) -> list[Send]:
        return [one for one in self.effects if isinstance(one, Send) and isinstance(one.message, kind)]


def test_a_subscription_to_fixes_changes_nothing_in_the_field() -> None:
    both = Both().comes(Subscribe(FIXES, 0.0, 0.0, 10.0, 60.0), CONTROL, "backbone")
    assert [one for one in both.effects if isinstance(one, Send)] == []
    assert both.state.states["gateway"].wanted.subscribers == {CONTROL}
    assert list(both.state.states["sink"].spread.timed.own) == [0]
    assert both.state.states["sink"].wishes == {}


def test_the_sink_spreads_an_interest_in_another_class_until_it_is_withdrawn() -> None:
    both = Both()
    own = both.host.roles["sink"]
    state = both.state.states["sink"]
    wish = Interest(b"base", 5, 0, PASSES, 0.0, 0.0, 30.0, 0.0, 1.0, 0, 0)
    state, effects = own.handle(state, Received(ORIGIN_NS, wish, BASE))
    (sent,) = [one for one in effects if isinstance(one, Send)]
    assert sent.to == NEIGHBOURHOOD
    assert (sent.message.task, sent.message.radius_m, sent.message.lasts_s) == (PASSES, 30.0, 9.0)
    assert sent.message.number != 0
    assert len(state.spread.timed.own) == 2
    state, effects = own.handle(state, Received(ORIGIN_NS + 2 * NS, replace(wish, lasts_s=0.0), BASE))
    assert [one for one in effects if isinstance(one, Send)] == []
    assert list(state.spread.timed.own) == [0]


def test_what_neighbours_say_is_not_taken_from_the_backbone() -> None:
    both = Both()
    interest = Interest(b"n00", 5, 0, PASSES, 0.0, 0.0, 30.0, 0.0, 1.0, 0, 4)
    both.comes(interest, "n00", "backbone")
    assert both.state.states["sink"].spread.interests.known == {}
    both.comes(interest, "n00", "field")
    assert both.state.states["sink"].spread.interests.known


def test_what_is_no_fix_goes_to_the_gateway_which_refuses_it() -> None:
    both = Both().comes(Subscribe(FIXES, 0.0, 0.0, 100.0, 60.0), CONTROL, "backbone")
    report = Data(b"base", 0, b"n00", 0, 1, 0, encode(CpaReport(1, 0.5, 0, -20.0, 1.0)))
    both.comes(report, "n03", "field")
    assert both.state.states["gateway"].counts.refused == 1
    assert both.sends(Arrived) == []
