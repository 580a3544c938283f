"""Receivers that listen now and then: no events, and the same as if timers switched them on and off."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.puppet import MS, Puppet, arrival, core_of, run
from tests.toys import Reply, Request
from trackfield.drivers.engine.conditions import Conditions
from trackfield.drivers.engine.core import Core
from trackfield.drivers.engine.meter import Activity
from trackfield.link.clock import Clock
from trackfield.link.energy import DEVICES, Power
from trackfield.link.fate import Fate
from trackfield.role import NS, Effect, Event, IllegalEvent, Listen, Radio, Received, Send, SetTimer, Started, Timer

POWER = Power(7, 5, 3, 1, battery_fj=10**15)
EVERY, OPEN = 2 * NS, 5 * MS


def doing(*effects: Effect) -> Puppet:
    return Puppet(lambda event: list(effects) if isinstance(event, Started) else [])


def activity(core: Core, end_ns: int) -> Activity:
    return Activity(*core.record(end_ns)["activity"]["field"])


@dataclass
class Switching:
    """The same by timers."""

    every: int
    opened: int
    first: int
    kinds = frozenset({"request"})

    def begin(self) -> int:
        return 0

    def handle(self, state: int, event: Event) -> tuple[int, tuple[Effect, ...]]:
        match event:
            case Started():
                return 0, (Radio(False), SetTimer("on", self.first))
            case Timer(now, "on"):
                return state + 1, (Radio(True), SetTimer("off", now + self.opened), SetTimer("on", now + self.every))
            case Timer():
                return state + 1, (Radio(False),)
        return state, ()


def test_a_thousand_who_sleep_but_for_5_ms_in_2_s_cost_no_events() -> None:
    cores = [core_of(doing(Listen(EVERY, OPEN, i * MS)), horizon_ns=0) for i in range(1000)]
    for core in cores:
        core.handle_next()
        assert core.next_key() is None
        assert activity(core, 3600 * NS) == Activity(0, 0, 1800 * OPEN, 3600 * NS - 1800 * OPEN, 0)


def test_with_a_battery_they_cost_a_tenth_of_its_charge_each() -> None:
    power = Power(7, 5, 3, 1, battery_fj=10**12)
    core = core_of(doing(Listen(100 * MS, 5 * MS, 0)), conditions=Conditions(powers={"field": power}))
    run(core, 10**15)
    assert core.life.over
    assert 10 < len(core.state) + 12 < 16  # its start, and each tenth told
    left = core.life.meter.left_fj({"field": power})
    assert left == 0


@given(st.integers(2, 50), st.data())
def test_it_is_what_timers_would_do(every_ms: int, data: Any) -> None:
    opened = data.draw(st.integers(1, every_ms - 1)) * MS
    first = data.draw(st.integers(0, 30)) * MS
    end = data.draw(st.integers(0, 1000)) * MS
    by_timers = core_of(Switching(every_ms * MS, opened, first))
    run(by_timers, end)
    in_windows = core_of(doing(Listen(every_ms * MS, opened, first)))
    run(in_windows, end)
    assert activity(in_windows, end) == activity(by_timers, end)


def heard(core: Core) -> int:
    return sum(isinstance(event, Received) for event in core.state)


@pytest.mark.parametrize(
    ("begins_ms", "preamble_ms", "there"),
    [(100, 0, True), (104, 0, True), (105, 0, False), (99, 0, False), (97, 3, True), (96, 3, False), (1, 100, True)],
)
def test_what_begins_in_a_window_is_heard_to_its_end(begins_ms: int, preamble_ms: int, there: bool) -> None:
    """Windows of 5 ms at 100, 200, ...; a frame of 30 ms after its preamble, of which 1 ms is enough."""
    span = (30 + preamble_ms) * MS
    fate = Fate(None, span, busy_ns=span, air_ns=span, span_ns=span)
    core = core_of(doing(Listen(100 * MS, 5 * MS, 100 * MS, MS)), conditions=Conditions(powers={"field": POWER}))
    came = arrival(begins_ms * MS + span, Request(1))
    core.offer(replace(came, fate=fate, frame=replace(came.frame, preamble_ns=preamble_ms * MS)))
    run(core, 400 * MS)
    assert (heard(core), core.tally) == ((1, {"delivered": 1}) if there else (0, {"asleep": 1}))
    if there:
        from_ms = max(begins_ms, 100)
        listened = (from_ms - 100) + 5 * 2  # in the first window before the frame, and in two more
        received = begins_ms + 30 + preamble_ms - from_ms
        assert activity(core, 400 * MS) == Activity(0, received * MS, listened * MS, (400 - listened - received) * MS)


def test_windows_are_those_of_its_own_clock() -> None:
    """Half a second ahead, and fast by 100 ppm: by true time they come sooner."""
    clock = Clock(offset_ns=500 * MS, drift_ppb=100_000)
    core = core_of(doing(Listen(EVERY, OPEN, 2500 * MS)), clock=clock)
    core.handle_next()
    windows = core.life.receivers["field"].opening
    assert not isinstance(windows, bool)
    assert windows.from_ns == clock.true(2500 * MS) < 2 * NS
    assert EVERY - 201_000 < windows.every_ns < EVERY - 199_000


def test_the_sender_pays_for_a_longer_preamble_and_its_frame_carries_it() -> None:
    given = Conditions(powers={"field": POWER}, cost=lambda frame: Fate(None, air_ns=frame.preamble_ns + 10, busy_ns=1))
    core = core_of(doing(Send(Reply(1), "hub", preamble_ns=3 * MS)), conditions=given)
    (sent, *_) = [o for o in core.handle_next() if hasattr(o, "frame")]
    assert sent.frame.preamble_ns == 3 * MS
    assert activity(core, NS).send_ns == 3 * MS + 10


@pytest.mark.parametrize("wrong", [(0, 0, 0), (10, 0, 0), (10, 11, 0), (10, 5, 0, -1), (10, 5, 0, 0, -1)])
def test_windows_that_cannot_be_are_a_fault_of_the_role(wrong: tuple[int, ...]) -> None:
    with pytest.raises(IllegalEvent, match="has no windows"):
        core_of(doing(Listen(*wrong))).handle_next()


def test_on_ends_the_windows_and_off_too() -> None:
    def react(event: Event) -> list[Effect]:
        match event:
            case Started():
                return [Listen(100 * MS, 5 * MS, 0), SetTimer("on", 200 * MS), SetTimer("off", 250 * MS)]
            case Timer(name=name):
                return [Radio(name == "on")]
        return []

    core = core_of(Puppet(react), conditions=Conditions(powers={"field": DEVICES["cc2420"]}))
    run(core, 400 * MS)
    assert activity(core, 400 * MS) == Activity(listen_ns=60 * MS, sleep_ns=340 * MS)
