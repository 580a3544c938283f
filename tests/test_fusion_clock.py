"""A fusion centre whose clock is off: it asks another process for the time, and takes its steps at corrected time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import dist, sqrt
from statistics import fmean
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fusion.memory import Memory, Phase
from fusion.role import Fusion
from launcher.record.tables import TrackRow
from tests.puppet import MS, blind, frames
from tests.simulated import simulated, spcpf
from tests.test_fusion_restart import lived
from tests.test_fusion_role import DEADLINE, PRIOR, SENSORS, centre, deadline, play, points, report
from trackfield.draw import uniform
from trackfield.drivers.engine.conditions import Conditions
from trackfield.drivers.engine.core import Core
from trackfield.drivers.engine.frames import Arrival, Frame, Told
from trackfield.drivers.spec import ProcessSpec
from trackfield.link.clock import Clock
from trackfield.role import (
    NS,
    Corrected,
    Effect,
    Ignored,
    IllegalEvent,
    Publish,
    Received,
    Role,
    Send,
    SetTimer,
    Started,
    State,
    Timer,
    TrackPoint,
)
from trackfield.wire.codec import decode, encode
from trackfield.wire.messages import SyncReply, SyncRequest

SYNC: dict[str, Any] = {
    "reference": "root", "exchanges": 2, "resync_ns": 20 * NS, "timeout_ns": 200 * MS, "seed": 1, "id": "fusion"
}  # fmt: skip
FIRST_NS = int(NS * uniform(1, "fusion", "sync", "start"))
OVER_NS = FIRST_NS + 400 * MS
"""After its start: the end of the first round."""


def answered(exchange: int, sent_ns: int, ahead: int) -> Received:
    came = (sent_ns + 5 * MS + ahead) // 1000
    return Received(sent_ns + 10 * MS, SyncReply(exchange, sent_ns // 1000, came, came), "root")


def first_round(start_ns: int = 0, *, ahead: int | None) -> list[Timer | Received]:
    """Its first round after a start at that local time; the reference is ``ahead``, or does not answer."""
    slots = [start_ns + FIRST_NS + slot * 200 * MS for slot in range(3)]
    first, second, over = (Timer(slot, "sync") for slot in slots)
    if ahead is None:
        return [first, second, over]
    return [first, answered(1, slots[0], ahead), second, answered(2, slots[1], ahead), over]


def shifted(events: list[Received], by_ns: int) -> list[Received]:
    return [replace(event, now=event.now + by_ns) for event in events]


def steps_of(effects: list[Effect]) -> list[int | None]:
    return [point.step for point in points(effects)]


# --- event by event -----------------------------------------------------------------------------------------------


def test_it_begins_when_its_first_round_is_over_and_sets_deadlines_by_its_own_clock() -> None:
    fusion = centre(sync=SYNC)
    assert fusion.kinds == {"doa", "sync-request", "sync-reply"}
    memory, effects = fusion.handle(fusion.begin(), Started(0))
    assert effects == (SetTimer("sync", FIRST_NS), State("waiting"))
    *round_, over = first_round(ahead=-30 * MS)
    memory, asked = play(fusion, memory, round_)
    assert [effect.to for effect in asked if isinstance(effect, Send)] == ["root", "root"]
    assert not [effect for effect in asked if isinstance(effect, SetTimer) and effect.name != "sync"]
    memory, effects = fusion.handle(memory, over)
    ahead = memory.time.correction_ns
    assert abs(ahead + 30 * MS) < 1000
    assert effects == (
        Corrected(ahead),
        SetTimer("sync", OVER_NS + 20 * NS),
        SetTimer("deadline", NS + DEADLINE - ahead),
    )


@pytest.mark.parametrize("ahead_ns", [-3600 * NS, -2 * NS, 2 * NS, 3600 * NS])
def test_reports_that_come_before_it_knows_the_time_wait_and_no_step_is_missed(ahead_ns: int) -> None:
    """Its clock is far off at the start; it has the prior of the run, and the same tracks as a centre that is right."""
    right, wrong = centre(prior=PRIOR), centre(prior=PRIOR, sync=SYNC)
    heard = [report(1, id) for id, _, _ in SENSORS]
    _, expected = play(right, right.begin(), [Started(0), *heard, deadline(1)])
    *round_, over = first_round(-ahead_ns, ahead=ahead_ns)
    memory, before = play(wrong, wrong.begin(), [Started(-ahead_ns), *round_, *shifted(heard, -ahead_ns)])
    assert not points(before)
    memory, effects = wrong.handle(memory, over)
    due = effects[-1]
    assert isinstance(due, SetTimer)
    _, found = play(wrong, memory, [Timer(due.at, due.name)])
    assert points(found) == points(expected)
    assert [point.reports for point in points(found)] == [4]


def test_what_is_early_and_of_no_use_is_left_out_in_silence() -> None:
    fusion = centre(sync=SYNC)
    *round_, over = first_round(ahead=0)
    early = [report(1, "n0"), report(1, "n0"), report(1, "n9"), report(60, "n1"), report(1, "n1")]
    memory, effects = play(fusion, fusion.begin(), [Started(0), *round_, *early, over])
    assert not [effect for effect in effects if isinstance(effect, Ignored)]
    _, effects = play(fusion, memory, [deadline(1)])
    assert [point.sensors for point in points(effects)] == [("n0", "n1")]


def test_without_any_answer_it_begins_by_its_own_clock_and_asks_again() -> None:
    fusion = centre(sync=SYNC)
    memory, effects = play(fusion, fusion.begin(), [Started(0), *first_round(ahead=None)])
    assert effects[-1] == SetTimer("deadline", NS + DEADLINE)
    again = effects[-2]
    assert isinstance(again, SetTimer)
    assert (again.name, OVER_NS < again.at < OVER_NS + 2 * NS) == ("sync", True)
    _, effects = play(fusion, memory, [deadline(1)])
    assert steps_of(effects) == [1]


def test_a_correction_moves_its_deadline_and_repeats_no_step() -> None:
    """After step 3 it learns that its clock is 1.5 s ahead: it waits for step 4."""
    fusion = centre(sync=SYNC)
    memory, effects = play(fusion, fusion.begin(), [Started(0), *first_round(ahead=0), *map(deadline, (1, 2, 3))])
    assert steps_of(effects) == [1, 2, 3]
    memory = later_round(fusion, memory, at=3500 * MS, ahead=-1500 * MS)
    memory, effects = play(fusion, memory, [Timer(4 * NS + DEADLINE + 1500 * MS, "deadline")])
    assert steps_of(effects) == [4]


def later_round(fusion: Fusion, memory: Memory, *, at: int, ahead: int) -> Memory:
    """The state after a round that begins at that local time."""
    memory, _ = play(fusion, memory, [Timer(at, "sync")])
    memory, _ = play(fusion, memory, [answered(memory.time.asked, at, ahead)])
    memory, _ = play(fusion, memory, [Timer(at + 200 * MS, "sync")])
    return play(fusion, memory, [Timer(at + 400 * MS, "sync")])[0]


def test_where_time_jumps_ahead_it_takes_the_overdue_steps_one_by_one() -> None:
    fusion = centre(sync=SYNC)
    memory, _ = play(fusion, fusion.begin(), [Started(0), *first_round(ahead=0), deadline(1)])
    memory = later_round(fusion, memory, at=1500 * MS, ahead=4 * NS)
    now, taken = 1900 * MS, list[int | None]()
    while True:
        memory, effects = fusion.handle(memory, Timer(now, "deadline"))
        taken += steps_of(list(effects))
        due = effects[-1]
        assert isinstance(due, SetTimer)
        if due.at > now:
            break
    assert (taken, due.at) == ([2, 3, 4, 5], pytest.approx(6 * NS + DEADLINE - 4 * NS, abs=1000))


def test_it_tells_its_corrected_time_once_it_knows_it() -> None:
    fusion = centre(sync=SYNC)
    asked = Received(5 * NS, SyncRequest(7, -42), "n3")
    memory, _ = play(fusion, fusion.begin(), [Started(0)])
    assert fusion.handle(memory, asked) == (memory, (Ignored("not synchronised"),))
    memory, _ = play(fusion, memory, first_round(ahead=2 * NS))
    after, (answer,) = fusion.handle(memory, asked)
    assert after is memory
    assert isinstance(answer, Send)
    assert answer.to == "n3"
    assert answer.message.came_us == answer.message.left_us == pytest.approx(7_000_000, abs=1)


def test_a_life_that_goes_on_from_stored_bytes_waits_for_the_time_too() -> None:
    """Stored at step 5; the next life starts at 7.6 s of true time, with a clock that is 100 s ahead."""
    kept, fusion = lived(centre(), 5), centre(sync=SYNC)
    start = 107_600 * MS
    memory, effects = play(fusion, fusion.begin(), [Started(start, kept), *first_round(start, ahead=-100 * NS)])
    assert steps_of(effects) == [7]
    assert memory.phase is Phase.COASTING
    assert effects[-2] == SetTimer("deadline", pytest.approx(8 * NS + DEADLINE + 100 * NS, abs=1000))


def test_after_the_last_step_that_a_report_can_have_there_is_no_deadline() -> None:
    """Neither in a long life, nor if it is told an absurd time: it does not step through the years."""
    fusion = centre("predict-only", sync=SYNC)
    memory, effects = play(fusion, fusion.begin(), [Started(65533 * NS), *first_round(65533 * NS, ahead=0)])
    for step in (65533, 65534):
        assert isinstance(effects[-1], SetTimer)
        assert effects[-1].at // NS == step
        memory, effects = play(fusion, memory, [deadline(step)])
    memory, effects = play(fusion, memory, [deadline(65535)])
    assert steps_of(effects) == [65535]
    assert not [effect for effect in effects if isinstance(effect, SetTimer)]

    memory, effects = play(fusion, fusion.begin(), [Started(0), *first_round(ahead=10**18 - 5 * NS)])
    assert [effect.name for effect in effects if isinstance(effect, SetTimer)] == ["sync"] * 4


@pytest.mark.parametrize("event", [Timer(NS, "deadline"), Started(0), Timer(0, "nap")])
def test_a_broken_driver_is_told_so(event: Timer | Started) -> None:
    """Before its first round is over there is no deadline; a root never asks."""
    fusion = centre(sync=SYNC)
    memory, _ = fusion.handle(fusion.begin(), Started(0))
    with pytest.raises(IllegalEvent):
        fusion.handle(memory, event)
    root = centre()
    memory, _ = root.handle(root.begin(), Started(0))
    with pytest.raises(IllegalEvent):
        root.handle(memory, Timer(NS, "sync"))


# --- whole lives --------------------------------------------------------------------------------------------------


def live(
    clock: Clock,
    seconds: int,
    *,
    lost: Callable[[int], bool] = lambda _: False,
    jumps: tuple[tuple[int, int], ...] = (),
    role: Role[Any] | None = None,
) -> list[tuple[int, TrackPoint]]:
    """What a centre with this clock publishes, and when (true time); its root answers, unless a request is ``lost``."""
    role, given = role or centre("predict-only", prior=PRIOR, sync=SYNC), Conditions(jumps=jumps)
    core = Core(role, owner="fusion", clock=clock, sense=blind, conditions=given)
    published, asked = list[tuple[int, TrackPoint]](), 0
    while (key := core.next_key()) is not None and key[0] <= seconds * NS:
        outputs = core.handle_next()
        told = [o.effect for o in outputs if isinstance(o, Told)]
        published += [(key[0], effect.estimate) for effect in told if isinstance(effect, Publish)]
        for request in frames(outputs):
            asked += 1
            if not lost(asked):
                core.offer(answer_of(request))
    return published


def answer_of(request: Frame) -> Arrival:
    asked, came = decode(request.payload), request.sent_ns + 5 * MS
    reply = encode(SyncReply(asked.exchange, asked.sent_us, came // 1000, came // 1000))
    return Arrival(came + 5 * MS, Frame("root", 0, "sync-reply", came, 0, "fusion", "field", reply))


@settings(max_examples=60, deadline=None)
@given(st.integers(-100_000, 100_000), st.integers(-200_000, 200_000), st.sets(st.integers(3, 30)))
def test_whatever_its_clock_it_takes_each_step_once_and_in_time(offset_ms: int, drift_ppb: int, lost: set[int]) -> None:
    published = live(Clock(offset_ms * MS + 123_457, drift_ppb), 60, lost=lost.__contains__)
    assert [point.step for _, point in published] == list(range(1, 60))
    for t, point in published[1:]:
        assert abs(t - (point.at_ns + DEADLINE)) < 15 * MS  # 200 ppm for a minute in which every request is lost


@pytest.mark.parametrize("jump_ms", [-7500, -40, 40, 7500])
def test_a_clock_that_jumps_costs_no_step(jump_ms: int) -> None:
    """At 25 s; its next round is at 41 s. Until then it takes steps too early or too late."""
    published = live(Clock(), 60, jumps=((25 * NS, jump_ms * MS),))
    assert [point.step for _, point in published] == list(range(1, 60))
    late = [(t - point.at_ns - DEADLINE) / MS for t, point in published]
    assert max(map(abs, late[1:24] + late[50:])) < 1
    assert max(late, key=abs) == pytest.approx(-jump_ms, abs=1)


# --- a whole field ------------------------------------------------------------------------------------------------


def test_a_centre_that_asks_another_process_tracks_as_well_as_one_whose_clock_is_right() -> None:
    """The centre is of stratum 1, and the nodes, which ask it, of stratum 2."""
    plan = spcpf(1, ["link.model=ideal", "run.setup_s=8", "clock.offset_ms=50", "clock.drift_ppm=20"])
    centre, *nodes = plan.processes
    config = {**centre.config, "sync": {**SYNC, "exchanges": 8}}
    clock = {"offset_ns": 250 * MS, "drift_ppb": 15_000}
    root = ProcessSpec("root", "keeper", "tests.test_timesync_strata:Keeper")
    peers = {**centre.peers, "root": (0.0, 0.0)}
    asking = replace(centre, config=config, clock=clock, peers=peers)
    ledger, found = simulated(replace(plan, processes=(asking, *nodes, root)))
    _, right = simulated(plan)
    assert ledger.sent_by["root"] > 8
    assert max(map(abs, ledger.clock_errors.values())) < MS
    assert [row.point.step for row in found] == [row.point.step for row in right]
    found, right = found[:59], right[:59]  # after step 60 the target is gone
    assert [row.point.sensors for row in found] == [row.point.sensors for row in right]
    assert rms_error(found) < 1.2 * rms_error(right) < 2.0


def rms_error(rows: list[TrackRow]) -> float:
    """Of the positions (m)."""
    squares = [dist(row.point.mean[:2], row.truth[:2]) ** 2 for row in rows if row.truth]
    return sqrt(fmean(squares))
