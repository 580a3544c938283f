"""One of the roles of a process sets its clock, and the others go by it: event by event, and in whole lives."""

from __future__ import annotations

from collections.abc import Sequence

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fusion.memory import Phase
from node.role import Node
from tests.puppet import MS, frames
from tests.test_fusion_clock import SYNC, live, shifted, steps_of
from tests.test_fusion_restart import lived
from tests.test_fusion_role import DEADLINE, PRIOR, SENSORS, centre, deadline, play, points, report
from tests.test_node_sync import Life
from tests.test_timesync import ROUNDS
from trackfield.host import Host
from trackfield.link.clock import Clock
from trackfield.protocols.timesync import SPREAD_NS, Rounds, TimeSync
from trackfield.role import (
    NS,
    CancelTimer,
    ClockSet,
    Corrected,
    Ignored,
    IllegalEvent,
    Received,
    Sample,
    Sampled,
    SetTimer,
    Started,
    State,
    Timer,
)
from trackfield.wire.messages import SyncRequest

FOLLOWS = {"follows_ns": 2 * NS}


# --- a node -------------------------------------------------------------------------------------------------------


def follower() -> Node:
    return Node(step_ns=NS, threshold_db=52.5, centre="fusion", sync=FOLLOWS)


def test_a_node_that_follows_asks_nobody_and_sets_its_timers_anew_after_each_correction() -> None:
    """At 2.5 s by its clock it learns that it is 2.6 s; later, asleep, that it is another time."""
    node = follower()
    assert (node.kinds, node.follows) == (frozenset(), True)
    state, _ = node.handle(node.begin(), Started(0))
    state, effects = node.handle(state, Sampled(0, "wake-up", NS // 2))
    assert effects == (SetTimer("step", NS),)
    state, _ = node.handle(state, Sampled(NS, "sound", None))
    state, effects = node.handle(state, ClockSet(2500 * MS, 100 * MS))
    assert effects == (CancelTimer("sync"), Sample("wake-up"))
    state, effects = node.handle(state, Sampled(2500 * MS, "wake-up", 2500 * MS))
    assert effects == (SetTimer("step", 2900 * MS),)
    _, effects = node.handle(state, Sampled(2500 * MS, "wake-up", None))
    assert effects == ()


def test_a_node_whose_clock_is_right_is_given_no_correction() -> None:
    node = Node(step_ns=NS, centre="fusion")
    state, _ = node.handle(node.begin(), Started(0))
    with pytest.raises(IllegalEvent):
        node.handle(state, ClockSet(0, 5))


def hosted_node() -> Host:
    return Host({"asker": TimeSync(ROUNDS), "node": follower()}, id="n007")


@settings(max_examples=50, deadline=None)
@given(st.integers(-5000, 5000), st.integers(-200_000, 200_000))
def test_whatever_its_clock_a_node_reports_at_the_right_times(offset_ms: int, drift_ppb: int) -> None:
    """After its first round its clock is right to what it drifts in a minute, 12 ms."""
    life = Life(hosted_node(), Clock(offset_ms * MS, drift_ppb), [(20_500 * MS, 150 * NS)]).live(151 * NS)
    assert [step for _, step in life.reports] == list(range(21, 151))[: len(life.reports)]
    assert len(life.reports) in (129, 130)
    for t, step in life.reports:
        assert abs(t - step * NS) < 62 * 200_000
    assert {frame.kind for frame in frames(life.outputs)} == {"doa", "sync-request"}


# --- a centre -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("ahead_ns", [-3600 * NS, -2 * NS, 2 * NS, 3600 * NS])
def test_a_centre_that_follows_waits_for_the_time_and_misses_no_step(ahead_ns: int) -> None:
    """The same tracks as a centre whose clock is right."""
    right, wrong = centre(prior=PRIOR), centre(prior=PRIOR, sync=FOLLOWS)
    heard = [report(1, id) for id, _, _ in SENSORS]
    _, expected = play(right, right.begin(), [Started(0), *heard, deadline(1)])
    memory, before = play(wrong, wrong.begin(), [Started(-ahead_ns), *shifted(heard, -ahead_ns)])
    assert before == [SetTimer("sync", 2 * NS - ahead_ns), State("waiting")]
    memory, effects = wrong.handle(memory, ClockSet(NS // 2 - ahead_ns, ahead_ns))
    due = SetTimer("deadline", NS + DEADLINE - ahead_ns)
    assert effects == (CancelTimer("sync"), due)
    _, found = play(wrong, memory, [Timer(due.at, due.name)])
    assert points(found) == points(expected)


def test_a_centre_that_follows_begins_by_its_own_clock_if_no_time_comes() -> None:
    """And moves its deadline when one comes."""
    fusion = centre(sync=FOLLOWS)
    memory, effects = play(fusion, fusion.begin(), [Started(0), Timer(2 * NS, "sync"), deadline(1)])
    assert steps_of(effects) == [1]
    memory, effects = fusion.handle(memory, ClockSet(NS, -1500 * MS))  # type: ignore[assignment]
    assert effects == (SetTimer("deadline", 2 * NS + DEADLINE + 1500 * MS),)


def test_a_centre_that_goes_on_from_stored_bytes_waits_for_the_time_too() -> None:
    """Stored at step 5; the next life starts at 7.6 s of true time, with a clock that is 100 s ahead."""
    fusion, start = centre(sync=FOLLOWS), 107_600 * MS
    memory, effects = play(fusion, fusion.begin(), [Started(start, lived(centre(), 5)), ClockSet(start, -100 * NS)])
    assert (steps_of(effects), memory.phase) == ([7], Phase.COASTING)


def test_a_centre_that_follows_leaves_it_to_the_other_role_to_tell_the_time() -> None:
    fusion = centre(sync=FOLLOWS)
    memory, _ = play(fusion, fusion.begin(), [Started(0), ClockSet(0, 0)])
    assert fusion.kinds == {"doa"}
    assert fusion.handle(memory, Received(5, SyncRequest(7, -42), "n3")) == (memory, (Ignored("unexpected"),))


def hosted_centre(names: Sequence[str]) -> Host:
    wait = SPREAD_NS + SYNC["exchanges"] * SYNC["timeout_ns"]
    fusion = centre("predict-only", prior=PRIOR, sync={"follows_ns": wait})
    roles = {"asker": TimeSync(Rounds(**SYNC)), "fusion": fusion}
    return Host({name: roles[name] for name in names}, id="fusion")


@settings(max_examples=40, deadline=None)
@given(
    st.integers(-100_000, 100_000),
    st.integers(-200_000, 200_000),
    st.sets(st.integers(3, 30)),
    st.permutations(["asker", "fusion"]),
)
def test_whatever_its_clock_a_centre_takes_each_step_once_and_in_time(
    offset_ms: int, drift_ppb: int, lost: set[int], names: list[str]
) -> None:
    """As one that asks itself does (``test_fusion_clock.py``), whichever role comes first."""
    clock = Clock(offset_ms * MS + 123_457, drift_ppb)
    published = live(clock, 60, lost=lost.__contains__, role=hosted_centre(names))
    assert [point.step for _, point in published] == list(range(1, 60))
    for t, point in published[1:]:
        assert abs(t - (point.at_ns + DEADLINE)) < 15 * MS


def test_a_correction_is_told_once_whoever_uses_it() -> None:
    """One each minute of the node's life, and none of the follower's."""
    life = Life(hosted_node(), Clock(40 * MS), [(0, 150 * NS)]).live(150 * NS)
    assert len([*life.told(Corrected)]) == 3
