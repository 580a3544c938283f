"""A role in a tree: what is its own stays its own, what it sends to the base goes over others."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import pytest

from trackfield.drivers.engine.core import Core
from trackfield.drivers.engine.frames import Arrival, Frame, Sent
from trackfield.drivers.spec import ProcessSpec, RunSpec, build_core, links_of, role_of
from trackfield.host import Host
from trackfield.link.fate import Fate
from trackfield.protocols.collected import Collected
from trackfield.role import (
    NEIGHBOURHOOD,
    NS,
    ClockSet,
    Effect,
    Event,
    Ignored,
    Late,
    Note,
    PortRead,
    Radio,
    Received,
    Sample,
    Sampled,
    Send,
    SetTimer,
    Started,
    Store,
    Timer,
    Write,
)
from trackfield.wire import Doa, SyncReply, Threshold, Track, encode, kind_name
from trackfield.wire.messages import Hop, HopAck, Route

REPORT = Doa(1, 90.0, 60.0)


@dataclass(frozen=True)
class Scripted:
    """Does at each event what it is told to, and keeps the events."""

    effects: tuple[Effect, ...] = ()
    kinds: frozenset[str] = frozenset({"threshold", "doa"})
    follows: bool = True

    def begin(self) -> tuple[Event, ...]:
        return ()

    def handle(self, state: tuple[Event, ...], event: Event) -> tuple[tuple[Event, ...], tuple[Effect, ...]]:
        return (*state, event), () if isinstance(event, Started) else self.effects


def made(*effects: Effect, id: str = "me", **arguments: Any) -> Collected:
    return Collected(Scripted(effects), id=id, base="base", seed=1, **arguments)


def lived(one: Any, *events: Event) -> tuple[Any, list[Effect]]:
    """The state after these events since its start, and all effects but the beacons of the start."""
    state, _ = one.handle(one.begin(), Started(0, b"kept"))
    effects: list[Effect] = []
    for event in events:
        state, more = one.handle(state, event)
        effects += more
    return state, effects


def joined(one: Any, *events: Event) -> tuple[Any, list[Effect]]:
    """The same, after the base was heard."""
    return lived(one, Received(1, Route(1, 0.0, 0, b""), "base"), *events)


def test_what_is_the_role_s_own_passes() -> None:
    effects = (
        SetTimer("step", 5),
        Sample("sound"),
        Store(b"mine"),
        Write("line", b"x"),
        Note("so"),
        Radio(False, "backbone"),
    )
    events = (Timer(2, "step"), Sampled(3, "sound", None), PortRead(4, "line", b"y"), ClockSet(5, 6))
    state, asked = lived(made(*effects), *events)
    assert state.role == (Started(0, b"kept"), *events)
    assert asked == [*effects] * 4
    assert made().follows


def test_its_receiver_is_on_for_others() -> None:
    assert lived(made(Radio(False)), Timer(2, "step"))[1] == []


def test_messages_to_the_base_go_over_the_tree_and_others_do_not() -> None:
    near = (Send(REPORT, NEIGHBOURHOOD), Send(REPORT, "other"), Send(REPORT, "base", "backbone"))
    assert joined(made(*near), Timer(2, "step"))[1][-3:] == list(near)
    sent = [
        e for e in joined(made(Send(REPORT, frozenset({"base", "other"}))), Timer(2, "step"))[1] if isinstance(e, Send)
    ]
    over, direct = sent
    assert (type(over.message), over.to, over.message.message) == (Hop, "base", encode(REPORT))
    assert (direct.message, direct.to) == (REPORT, frozenset({"other"}))
    assert Send(REPORT, "base") in joined(made(Send(REPORT, "base"), direct=["doa"]), Timer(2, "step"))[1]


def test_the_tree_has_timers_of_its_own() -> None:
    one = made(Send(REPORT, "base"))
    state, asked = joined(one, Timer(2, "beacon"))
    names = {effect.name for effect in asked if isinstance(effect, SetTimer)}
    assert names <= {"tree:beacon", "tree:patience"}
    assert "tree:patience" in names
    assert state.role[-1] == Timer(2, "beacon"), "one of this name is the role's"
    state, _ = one.handle(state, Timer(NS, "tree:patience"))
    assert state.role[-1] == Timer(2, "beacon")


def test_the_base_gets_messages_from_whoever_sent_them_first_and_answers_there() -> None:
    base = made(Send(Threshold(1, 50.0), frozenset({"far", "near"})), id="base")
    hops = [Received(n, Hop(id, n, 1, 2.0, b"", encode(REPORT)), "relay") for n, id in enumerate((b"near", b"far"), 1)]
    state, effects = lived(base, *hops)
    assert state.role[1:] == (Received(1, REPORT, "near"), Received(2, REPORT, "far"))
    answers = [e for e in effects if isinstance(e, Send) and isinstance(e.message, Hop)]
    assert [(one.message.to, one.to) for one in answers] == [(b"near", "relay")], "one after the other"
    assert len(state.tree.traffic.queue) == 3
    state, effects = lived(base, hops[0], Received(3, HopAck(b"base", answers[0].message.number), "relay"))
    assert not state.tree.traffic.queue
    assert any(isinstance(e, Note) and "no way to far" in e.text for e in effects)


def test_what_the_role_ignores_or_says_is_late_is_so() -> None:
    came = Received(1, Hop(b"far", 1, 0, 2.0, b"", encode(REPORT)), "far")
    for verdict in (Ignored("outdated"), Late()):
        assert verdict in lived(made(verdict, id="base"), came)[1]
    other = Received(1, Hop(b"far", 1, 0, 2.0, b"", encode(SyncReply(1, 2, 3, 4))), "far")
    state, effects = lived(made(id="base"), other)
    assert Ignored("unexpected") in effects
    assert len(state.role) == 1


def test_a_neighbour_s_own_messages_and_the_tree_s_are_told_apart() -> None:
    state, _ = lived(made(), Received(1, Route(1, 0.0, 0, b""), "base"), Received(2, Threshold(1, 50.0), "other"))
    assert state.role[1:] == (Received(2, Threshold(1, 50.0), "other"),)
    assert made().kinds == {"threshold", "doa", "route", "hop", "hop-ack"}


def test_a_host_of_several_roles_may_be_in_a_tree() -> None:
    host = Host({"a": Scripted((SetTimer("t", 9),)), "b": Scripted((Send(REPORT, "base"),))}, id="me")
    state, asked = joined(Collected(host, id="me", base="base", seed=1), Timer(2, "a/t"), Timer(3, "b/t"))
    assert SetTimer("a/t", 9) in asked
    assert [e.to for e in asked if isinstance(e, Send)] == ["base"]
    assert state.role.states["a"][1:] == (Timer(2, "t"),)


def test_the_frames_of_each_role_are_counted_in_a_tree_too() -> None:
    spec = ProcessSpec(
        "base", "both", "a=tests.test_collected:Scripted,b=tests.test_collected:Scripted", {"a": {}, "b": {}},
        tree={"base": "base", "seed": 1},
    )  # fmt: skip
    assert isinstance(role_of(spec), Collected)
    assert role_of(ProcessSpec.from_plain(spec.plain(), spec.factory)).kinds == role_of(spec).kinds
    run = RunSpec("r", 1, NS, {"model": "ideal"})
    core: Core = build_core(run, spec, links_of(run, [spec])["field"])
    core.handle_next()
    payload = encode(Hop(b"far", 1, 0, 1.0, b"", encode(REPORT)))
    core.offer(Arrival(5, Frame("far", 0, "hop", 1, 0, "base", "field", payload), Fate(None, 4)))
    (ack,) = [one for one in core.handle_next() if isinstance(one, Sent)]
    assert ack.frame.kind == "hop-ack"
    assert core.record(NS)["roles"] == {name: {"delivered": 1, "ignored": 0} for name in ("a", "b")}


@pytest.mark.parametrize("message", [Track(1, 0, 0, 1, 4, bytes(1024), bytes(2048)), REPORT])
def test_a_message_of_any_length_goes_over_a_hop(message: Any) -> None:
    sent = [e.message for e in joined(made(Send(message, "base")), Timer(2, "t"))[1] if isinstance(e, Send)]
    assert kind_name(sent[0]) == "hop"
    assert len(encode(sent[0])) <= 4096
