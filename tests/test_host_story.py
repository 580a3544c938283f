"""A host under the drivers: it lives like the roles that it is made of."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from tests.puppet import MS, Puppet, arrival, caught_up, core_of, frames, run
from tests.test_core_battery import died_at, powered
from tests.test_ports import Echo
from tests.toys import Feedback, Reply, Request, mix
from trackfield.drivers.engine.core import Core
from trackfield.drivers.engine.frames import Frame, Output, Refused, Told, Undone
from trackfield.drivers.ports import Port
from trackfield.drivers.spec import ProcessSpec, RunSpec
from trackfield.drivers.virtual import Virtual
from trackfield.host import Host
from trackfield.role import (
    NEIGHBOURHOOD,
    NS,
    CancelTimer,
    ClockSet,
    Corrected,
    Effect,
    Event,
    Ignored,
    IllegalEvent,
    Note,
    Publish,
    Radio,
    Received,
    Role,
    Sample,
    Sampled,
    Send,
    SetTimer,
    Started,
    Store,
    Timer,
    TrackPoint,
    Write,
)
from trackfield.wire.messages import Doa

# --- a host is a role like any other ------------------------------------------------------------------------------


class Chain:
    """Answers whatever happens as its number decides, and counts it in."""

    def __init__(self, number: int, *, kinds: Iterable[str]) -> None:
        self.number, self.kinds = number, frozenset(kinds)

    def begin(self) -> int:
        return self.number

    def handle(self, state: int, event: Event) -> tuple[int, tuple[Effect, ...]]:
        chain = mix(state, event.message.chain if isinstance(event, Received) else len(type(event).__name__))
        choices: tuple[tuple[Effect, ...], ...] = (
            (Send(Reply(chain), "me"), Note(f"{chain}"), Sample("sound"), Send(Reply(1), "far")),
            (Send(Request(chain), frozenset({"me", "far"})), SetTimer("t", event.now + 3 * MS)),
            (Radio(False), SetTimer("t", event.now + 2 * MS)),
            (Radio(True), CancelTimer("t")),
            (Ignored("late"),) if isinstance(event, Received) else (),
            (Send(Request(chain), NEIGHBOURHOOD), SetTimer("u", event.now)) if isinstance(event, Received) else (),
        )
        return chain, choices[chain % len(choices)]


requests = st.lists(
    st.tuples(st.integers(1, 9), st.integers(0, 99), st.sampled_from("pqr")),
    max_size=12,
    unique_by=lambda request: (request[0], request[2]),
)


def life(role: Role[Any], calls: Sequence[tuple[int, int, str]]) -> tuple[Core, list[Output]]:
    """A life with these requests (due in ms, number, sender), handed over in this order and late."""
    core = core_of(role, sense=lambda _, t_ns: t_ns)
    outputs = run(core, 5 * MS)
    for t, number, src in calls:
        core.offer(arrival(t * MS, Request(number), src=src))
    outputs += caught_up(core)
    return core, outputs + run(core, 20 * MS)


@given(requests)
def test_a_host_of_one_role_lives_the_life_of_that_role(calls: list[tuple[int, int, str]]) -> None:
    """The same frames at the same times, the same account, and the same way to undo things."""
    role = Chain(1, kinds=["request"])
    (bare, said), (hosted, told) = life(role, calls), life(Host({"a": role}, id="me"), calls)
    assert hosted.state.states == {"a": bare.state}
    assert frames(told) == frames(said)
    assert hosted.tally == bare.tally
    assert (hosted.inversions, hosted.host_late) == (bare.inversions, bare.host_late)


@given(requests)
def test_a_host_is_pure(calls: list[tuple[int, int, str]]) -> None:
    """The same event in the same state gives the same answer, and leaves that state as it was.

    There are draws for which the chains read their sensor for ever; a hundred events are enough.
    """
    hosting = Host({"a": Chain(1, kinds=["request"]), "b": Chain(2, kinds=["request", "reply"])}, id="me")
    state = hosting.begin()
    to_come = [Started(0), *(Received(t, Request(number), src) for t, number, src in calls)]
    for _ in range(100):
        if not state.asked and not to_come:
            break
        event = Sampled(0, "sound", 1) if state.asked else to_come.pop(0)
        before = replace(state, states=dict(state.states))
        first, second = hosting.handle(state, event), hosting.handle(state, event)
        assert first == second
        assert state == before
        state = first[0]


class Keeper:
    """Answers requests as its number decides, stores it, and takes each for a correction of the clock."""

    kinds = frozenset({"request"})

    def begin(self) -> int:
        return 1

    def handle(self, state: int, event: Event) -> tuple[int, tuple[Effect, ...]]:
        if not isinstance(event, Received):
            return state, ()
        chain = mix(state, event.message.chain)
        if chain % 3 == 0:
            return chain, (Ignored("late"),)
        return chain, (Store(b"%d" % chain), Corrected(chain), Send(Reply(chain), frozenset({"me", "far"})))


class Follower:
    """Counts requests, messages of the keeper, its corrections and its own timers in, and stores its number, too."""

    kinds, follows = frozenset({"request", "reply"}), True

    def begin(self) -> int:
        return 2

    def handle(self, state: int, event: Event) -> tuple[int, tuple[Effect, ...]]:
        value = event.correction_ns if isinstance(event, ClockSet) else len(type(event).__name__)
        chain = mix(state, event.message.chain if isinstance(event, Received) else value)
        return chain, (Store(b"%d" % chain), *((SetTimer("t", event.now + 2 * MS),) if chain % 2 else ()))


@given(requests)
def test_several_roles_live_the_same_in_whatever_order_frames_come(
    calls: list[tuple[int, int, str]],
) -> None:
    """What each role stores and counts is undone and done again with the rest."""

    def hosting() -> Host:
        return Host({"keeper": Keeper(), "follower": Follower()}, id="me")

    late, _ = life(hosting(), calls)
    ordered = core_of(hosting())
    for t, number, src in calls:
        ordered.offer(arrival(t * MS, Request(number), src=src))
    run(ordered, 20 * MS)
    assert late.state == ordered.state
    assert (late.tally, late.life.stored) == (ordered.tally, ordered.life.stored)
    assert sum(delivered for delivered, _ in late.state.counts.values()) == 2 * len(calls)
    assert late.record(NS)["roles"] == ordered.record(NS)["roles"]


# --- the same story as in two processes ---------------------------------------------------------------------------


@dataclass(frozen=True)
class Sum:
    """What a role made of all that it heard, and the step it is at."""

    total: float = 0.0
    step: int = 0


class Teller:
    """Tells its centre something every second; what it says hangs on the reply to what it said before."""

    kinds = frozenset({"reply"})

    def begin(self) -> Sum:
        return Sum()

    def handle(self, state: Sum, event: Event) -> tuple[Sum, tuple[Effect, ...]]:
        match event:
            case Received(_, Reply(chain)):
                return replace(state, total=state.total + chain / 7), ()
            case Started() | Timer():
                step = state.step + 1
                report = Doa(step, (state.total * 13 + step) % 359, (state.total % 97) + 1 / 3)
                return replace(state, step=step), (Send(report, "centre"), SetTimer("step", step * NS))
        raise IllegalEvent(str(event))


class Centre:
    """Adds up what it is told, replies to it, and half a second later publishes and broadcasts where it is."""

    kinds = frozenset({"doa", "request"})

    def begin(self) -> Sum:
        return Sum()

    def handle(self, state: Sum, event: Event) -> tuple[Sum, tuple[Effect, ...]]:
        match event:
            case Started():
                return state, (SetTimer("step", NS // 2),)
            case Timer(now):
                state = replace(state, step=state.step + 1)
                point = TrackPoint(
                    "centre",
                    "t",
                    state.step * NS,
                    "tracking",
                    (state.total, 0.0, 0.0, 0.0),
                    (0.0,) * 16,
                    step=state.step,
                )
                broadcast = Send(Feedback(state.step, int(state.total)), NEIGHBOURHOOD)
                return state, (Publish(point), broadcast, SetTimer("step", now + NS))
            case Received(_, Doa(_, bearing_deg, level_db), sender):
                state = replace(state, total=(state.total + bearing_deg * level_db) % 9973)
                return state, (Send(Reply(int(state.total)), sender),)
            case Received(_, Request(chain), sender):
                state = replace(state, total=(state.total + chain) % 9973)
                return state, (Send(Reply(int(state.total)), sender),)
        raise IllegalEvent(str(event))


class Listener:
    """A distant role: hears the broadcasts, asks about each, and publishes what it was told."""

    kinds = frozenset({"feedback", "reply"})

    def begin(self) -> Sum:
        return Sum()

    def handle(self, state: Sum, event: Event) -> tuple[Sum, tuple[Effect, ...]]:
        match event:
            case Received(_, Feedback(step, chain)):
                return Sum(state.total + chain, step), (Send(Request(chain % 100), "centre"),)
            case Received(_, Reply(chain)):
                state = replace(state, total=state.total + 3 * chain)
                point = TrackPoint(
                    "listener",
                    "t",
                    state.step * NS,
                    "tracking",
                    (state.total, 0.0, 0.0, 0.0),
                    (0.0,) * 16,
                    step=state.step,
                )
                return state, (Publish(point),)
        return state, ()


def teller_and_centre() -> Host:
    return Host({"teller": Teller(), "centre": Centre()}, id="centre")


class Witness:
    """Sees all that is sent and told."""

    def __init__(self) -> None:
        self.frames: list[Frame] = []
        self.points: list[tuple[int, TrackPoint]] = []
        self.written: list[Write] = []

    def sent(self, frame: Frame) -> None:
        self.frames.append(frame)

    def told(self, process: str, output: Told | Refused | Undone) -> None:
        if isinstance(output, Told) and isinstance(output.effect, Publish):
            self.points.append((output.key[0], output.effect.estimate))
        if isinstance(output, Told) and isinstance(output.effect, Write):
            self.written.append(output.effect)

    def final(self, process: str, record: object) -> None:
        pass


def play(*processes: tuple[str, str]) -> tuple[Virtual, Witness]:
    """Ten seconds of these (id, role of this module) beside the listener, over an ideal link."""
    specs = [ProcessSpec(id, id, f"tests.test_host_story:{role}") for id, role in processes]
    specs.append(ProcessSpec("listener", "listener", "tests.test_host_story:Listener", cells=("c0",)))
    witness = Witness()
    virtual = Virtual(RunSpec("host", 1, 10 * NS, {"model": "ideal"}), specs, witness)
    virtual.run()
    return virtual, witness


def test_two_roles_in_one_process_tell_the_story_that_they_tell_in_two() -> None:
    """A teller and its centre under one roof, or a link of 1 ms apart, which nothing that they do hangs on.

    The states at the end, what is published when, and all frames from and to others are the same. Only the frames
    between the two are gone from the air.
    """
    together, one = play(("centre", "teller_and_centre"))
    apart, two = play(("teller", "Teller"), ("centre", "Centre"))
    hosted = together.cores["centre"].state.states
    assert hosted == {name: apart.cores[name].state for name in ("teller", "centre")}
    assert together.cores["listener"].state == apart.cores["listener"].state
    assert len(one.points) == 20
    assert one.points == two.points
    between = [f for f in two.frames if {f.src, f.to} == {"teller", "centre"}]
    assert len(between) == 20
    assert one.frames == [f for f in two.frames if f not in between]


# --- one battery --------------------------------------------------------------------------------------------------


def test_roles_share_one_battery() -> None:
    """Two that send a frame each empty it when one that sends both does; no timer of either rings after that."""
    send, wake = Send(Reply(1), "hub"), SetTimer("t", NS)

    def starting(*effects: Effect) -> Puppet:
        return Puppet(lambda event: effects if isinstance(event, Started) else ())

    one, two, half = (
        powered(300_000, role)
        for role in (
            starting(send, send, wake),
            Host({"a": starting(send, wake), "b": starting(send, wake)}, id="me"),
            starting(send, wake),
        )
    )
    assert died_at(run(one, NS)) == died_at(run(two, 2 * NS)) < (died_at(run(half, NS)) or 0)
    assert two.state.states == {"a": (Started(0),), "b": (Started(0),)}


# --- ports --------------------------------------------------------------------------------------------------------


def echo_and_listener() -> Host:
    return Host({"echo": Echo(), "listener": Listener()}, id="pair")


def test_devices_belong_to_a_role_by_the_name_of_their_port() -> None:
    """A recorded one, under a driver; the role knows it as its own."""
    ports = {"echo/tty": Port(((MS, b"ab"), (3 * MS, b"c")))}
    spec = ProcessSpec("pair", "pair", "tests.test_host_story:echo_and_listener", ports=ports)
    run_spec, witness = RunSpec("host", 1, NS, {"model": "ideal"}), Witness()
    virtual = Virtual(run_spec, [spec], witness)
    virtual.run()
    assert [(t, point.mean[0]) for t, point in witness.points] == [(MS, 2.0), (3 * MS, 3.0)]
    assert virtual.cores["pair"].state.states == {"echo": 3, "listener": Sum()}
    assert witness.written == [Write("echo/tty", b"ab\x02"), Write("echo/tty", b"c\x03")]
