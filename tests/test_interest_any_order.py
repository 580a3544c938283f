"""Directed diffusion whatever comes: frames in any order, lost, repeated, malformed, by peers that mean no good."""

from __future__ import annotations

from typing import Any, Final

from hypothesis import example, given, settings
from hypothesis import strategies as st

from tests.diffusing import REPORT, Field, Station, interest
from tests.puppet import MS
from trackfield.protocols.interest import interests, paths, timed, traffic
from trackfield.protocols.interest.piece import TIMERS
from trackfield.protocols.interest.timed import PATIENCE
from trackfield.wire.interests import Data, DataAck, Reinforce

# --- any frames -------------------------------------------------------------------------------------------------------

ids = st.sampled_from([b"a", b"b", b"c", b"me", b"base", b"?"])
neighbours = st.sampled_from("abcd")
numbers, few = st.integers(0, 2), st.integers(0, 3)
serials = st.integers(0, 12)
hops = st.one_of(few, st.just(63), st.just(255))
frames = st.one_of(
    st.builds(
        interest,
        ids,
        numbers,
        st.integers(65530, 65535) | few,
        interval_s=st.sampled_from([0.0, 1.0]),
        lasts_s=st.sampled_from([0.0, 0.3, 9.0]),
        hops=hops,
        most_hops=hops,
    ),
    st.builds(Data, ids, numbers, ids, serials, hops, hops, st.sampled_from([b"", REPORT, b"\xc1"])),
    st.builds(Reinforce, ids, numbers, ids),
    st.builds(DataAck, ids, serials),
)
steps = st.lists(
    st.one_of(
        st.tuples(st.just("frame"), frames, neighbours),
        st.tuples(st.just("acknowledge"), neighbours),
        st.tuples(st.just("wait"), st.sampled_from([1, 30, 80, 500, 3000, 9000])),
        st.tuples(st.just("ask"), numbers),
        st.tuples(st.just("withdraw"), numbers),
        st.tuples(st.just("tell")),
    ),
    max_size=60,
)


def check(station: Station) -> None:
    """Its state is bounded, its timers are those that the state asks for, and nothing came twice."""
    state = station.state
    assert len(state.interests.known) <= interests.MOST_INTERESTS
    assert all(len(entry.gradients) <= interests.MOST_GRADIENTS for entry in state.interests.known.values())
    assert len(state.traffic.queue) <= station.queue
    assert len(state.traffic.seen) <= traffic.MOST_ORIGINS
    assert all(len(seen) <= traffic.REMEMBERED for seen in state.traffic.seen.values())
    assert max(len(state.paths.onward), len(state.paths.came), len(state.paths.silent)) <= paths.MOST_FLOWS
    assert len(state.timed.due) <= timed.MOST_DUE
    assert len(state.timed.paced) <= interests.MOST_INTERESTS
    assert {name: at for name, at in station.timers.items() if name != PATIENCE} == state.timed.alarms()
    assert (PATIENCE in station.timers) == bool(state.traffic.next)
    assert set(station.timers) <= TIMERS
    assert bool(state.traffic.queue) == bool(state.traffic.next), "what waits is under way"


@settings(max_examples=200)
@given(steps)
@example([("frame", interest(), "a"), ("tell",), ("tell",), ("wait", 9000), ("acknowledge", "a")])
def test_whatever_comes_its_state_is_sound(steps: list[tuple[Any, ...]]) -> None:
    station, came = Station(), set[tuple[bytes, int]]()
    for what, *rest in steps:
        before = len(station.arrived)
        match what, rest:
            case "frame", (message, sender):
                station.hears(message, sender)
                if len(station.arrived) > before:
                    assert (message.origin, message.serial) not in came, "it arrived twice"
                    came.add((message.origin, message.serial))
            case "acknowledge", (sender,):
                first = (*station.state.traffic.queue, traffic.Parcel(("base", 1), "x", 0, 0, b""))[0]
                station.hears(DataAck(first.origin.encode(), first.serial), sender)
            case "wait", (ms,):
                station.until(station.now + ms * MS)
            case "ask", (number,):
                station.asks(number)
            case "withdraw", (number,):
                station.does(station.piece.withdraw(station.state, number))
            case "tell", ():
                station.tells()
        check(station)


# --- any field --------------------------------------------------------------------------------------------------------

GRID: Final = {f"n{i}": (30.0 * (i % 3), 30.0 * (i // 3)) for i in range(9)}
fates = st.lists(st.sampled_from([(), (), (0,), (0,), (0,), (40 * MS,), (0, 3 * MS), (10 * MS, 90 * MS)]), max_size=400)
turns = st.lists(st.tuples(st.sampled_from(["kill", "start"]), st.sampled_from(["n3", "n4", "n5"])), max_size=4)


class Fated(Field):
    """A grid of nine, three by three, whose first frames have these fates; after them nothing is lost."""

    def __init__(self, fates: list[tuple[int, ...]]) -> None:
        self.fates = fates
        super().__init__(GRID, 35.0)

    def _delays(self, kind: str, src: str, dst: str) -> tuple[int, ...]:
        if not self.reaches(src, dst):
            return ()
        return self.fates.pop() if self.fates else (0,)


@settings(max_examples=40)
@given(fates, turns)
def test_reports_arrive_once_or_not_at_all_and_all_do_in_the_end(
    fates: list[tuple[int, ...]], turns: list[tuple[str, str]]
) -> None:
    field = Fated(fates)
    field.ask("n0")
    field.wait(1)
    for step, (what, id) in enumerate([*turns, *[("start", id) for id in ("n3", "n4", "n5")]]):
        if what == "kill":
            field.kill(id)
        elif not field.actors[id].alive:
            field.start(id)
        for one in GRID:
            if field.actors[one].alive:
                field.tell(one, step)
        field.wait(1)
    field.fates.clear()
    field.wait(8)
    got = [(one.sender, one.message.step) for one in field.actors["n0"].role.arrived]
    assert len(got) == len(set(got))
    for one in GRID:
        assert field.tell(one, 100) == 1
    field.wait(2)
    assert sorted(one.sender for one in field.actors["n0"].role.arrived if one.message.step == 100) == sorted(GRID)
