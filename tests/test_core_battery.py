"""Batteries: empty at an exact instant, by whatever a process did, and what came of it."""

from __future__ import annotations

from dataclasses import replace

import msgpack
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.puppet import MS, Puppet, arrival, caught_up, core_of, frames, run, script
from tests.toys import Reply, Request
from trackfield.drivers.engine.conditions import Conditions
from trackfield.drivers.engine.core import Core
from trackfield.drivers.engine.frames import RANK_BATTERY, Charge, Died, Output, Told, Undone
from trackfield.drivers.engine.meter import Activity, spent
from trackfield.drivers.exchange.intake import Refusals
from trackfield.drivers.exchange.seal import Seal
from trackfield.drivers.joining.heritage import Heritage
from trackfield.drivers.spec import ProcessSpec
from trackfield.link.energy import Power
from trackfield.role import NS, Effect, Radio, Received, Role, Sample, Sampled, Send, SetTimer, Started, Timer
from trackfield.wire.codec import encode

START = Started(0)
POWER = Power(send_uw=7, receive_uw=5, listen_uw=3, sleep_uw=1, sample_fj=1000, byte_ns=10, overhead_bytes=20)
"""A byte takes 10 ns, and so a reply of n bytes (n + 20) 10 ns of 7 fJ each."""
AIR_NS = (len(encode(Reply(1))) + 20) * 10


def powered(battery_fj: int | None, role: Role[object] | None = None, **conditions: object) -> Core:
    given = replace(Conditions(powers={"field": replace(POWER, battery_fj=battery_fj)}), **conditions)
    return core_of(role or Puppet(), sense=lambda name, t_ns: t_ns, conditions=given)


def at_start(*effects: Effect) -> Puppet:
    return Puppet(lambda event: effects if isinstance(event, Started) else ())


def died_at(outputs: list[Output]) -> int | None:
    deaths = [o.key for o in outputs if isinstance(o, Told) and isinstance(o.effect, Died)]
    assert all(key[1:] == (RANK_BATTERY,) for key in deaths)
    assert len(deaths) <= 1
    return deaths[0][0] if deaths else None


def charges(outputs: list[Output]) -> list[tuple[int, float]]:
    return [(o.key[0], o.effect.share) for o in outputs if isinstance(o, Told) and isinstance(o.effect, Charge)]


# --- when -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("battery", "at"), [(3000, 1000), (3001, 1001), (3002, 1001), (3003, 1001), (1, 1)])
def test_who_only_listens_lasts_for_the_battery_over_its_power(battery: int, at: int) -> None:
    """At 3 uW; a fraction of a nanosecond more is a nanosecond more."""
    core = powered(battery)
    assert died_at(run(core, NS)) == at
    assert core.next_key() is None


def test_who_sleeps_lasts_longer() -> None:
    assert died_at(run(powered(3000, at_start(Radio(False))), NS)) == 3000


def test_the_radio_counts_from_the_instant_at_which_it_is_switched() -> None:
    """1200 ns of listening, 3600 fJ; the other 400 fJ are enough for 400 ns of sleep."""
    role = script({START: (SetTimer("off", 1200),), Timer(1200, "off"): (Radio(False),)})
    assert died_at(run(powered(4000, role), NS)) == 1600


def test_a_wire_that_is_cut_saves_nothing() -> None:
    assert died_at(run(powered(3000, at_start(Radio(False, "backbone"))), NS)) == 1000


def test_sending_takes_the_difference_to_listening() -> None:
    """On the air it draws 4 uW more than it would have drawn anyway."""
    assert died_at(run(powered(300_000, at_start(Send(Reply(1), "hub"))), NS)) == -(-(300_000 - 4 * AIR_NS) // 3)


def test_hearing_takes_the_difference_to_listening() -> None:
    core = powered(300_000)
    core.offer(arrival(MS // 50, Request(1)))
    air_ns = (len(encode(Request(1))) + 20) * 10
    assert died_at(run(core, NS)) == -(-(300_000 - 2 * air_ns) // 3)


def test_what_is_on_a_wire_costs_nothing() -> None:
    core = powered(300_000, at_start(Send(Reply(1), "hub", "backbone")))
    core.offer(arrival(MS // 50, Request(1), medium="backbone"))
    assert died_at(run(core, NS)) == 100_000
    assert core.tally == {"delivered": 1}


def test_each_reading_of_a_sensor_costs() -> None:
    assert died_at(run(powered(6000, at_start(Sample("sound"), Sample("sound"), Sample("sound"))), NS)) == 1000


def test_a_frame_that_is_not_heard_costs_nothing() -> None:
    for conditions, outcome in (({"freezes": ((10, 30),)}, "frozen"), ({}, "asleep")):
        core = powered(300_000, at_start(*([] if conditions else [Radio(False)])), **conditions)
        core.offer(arrival(20, Request(1)))
        assert died_at(run(core, NS)) == (100_000 if conditions else 300_000)
        assert core.tally == {outcome: 1}


def test_on_mains_nothing_is_ever_empty() -> None:
    core = core_of(Puppet(), conditions=Conditions(powers={"field": POWER}))
    assert run(core, 10**15) == []
    assert core.next_key() is None


def test_a_device_that_draws_nothing_while_it_sleeps_does_so_for_ever() -> None:
    core = core_of(at_start(Radio(False)), conditions=Conditions(powers={"field": Power(1, 1, 1, 0, battery_fj=5)}))
    run(core, NS)
    assert core.next_key() is None


# --- the order of that instant ----------------------------------------------------------------------------------------


def test_all_that_is_due_at_that_instant_happens_first() -> None:
    """Empty at 1 us: a frame and a timer of 1 us come before, those of 1 us and 1 ns never."""
    free = replace(POWER, receive_uw=3, battery_fj=3000)
    core = core_of(at_start(SetTimer("a", 1000), SetTimer("b", 1001)), conditions=Conditions(powers={"field": free}))
    for due in (1000, 1001):
        core.offer(arrival(due, Request(1)))
    assert died_at(run(core, NS)) == 1000
    assert core.state == (START, Received(1000, Request(1), "peer"), Timer(1000, "a"))
    assert core.tally == {"delivered": 1}


def test_a_frame_that_takes_more_than_there_is_leaves_and_is_the_last_one() -> None:
    role = script({START: (SetTimer("a", 900), SetTimer("b", 901)), Timer(900, "a"): (Send(Reply(1), "hub"),)})
    core = powered(3000, role)
    outputs = run(core, NS)
    assert [frame.sent_ns for frame in frames(outputs)] == [900]
    assert died_at(outputs) == 900
    assert core.state == (START, Timer(900, "a"))
    assert charges(outputs)[-1] == (900, 0.0)


def test_nothing_happens_afterwards() -> None:
    core = powered(3000, at_start(SetTimer("a", 5000)))
    run(core, 1000)
    core.offer(arrival(2000, Request(1)))
    core.offer(arrival(MS, Request(1)))
    assert run(core, NS) == []
    assert (core.state, core.tally) == ((START,), {})
    assert core.record(NS)["activity"] == {"field": [0, 0, 1000, 0, 0]}
    assert core.record(NS)["metered_ns"] == 1000


def test_a_battery_may_be_empty_while_a_process_stands_still() -> None:
    core = powered(3000, at_start(SetTimer("a", 900)), freezes=((800, 2000),))
    assert died_at(run(core, NS)) == 1000
    assert core.state == (START,)


# --- what is told -----------------------------------------------------------------------------------------------------


def test_the_charge_is_told_with_events_that_take_a_per_cent_or_more_and_at_each_tenth() -> None:
    """Of 3000 fJ: after 10 ns 99 % are left, after 19 ns 98.1 and so more than 98; each 100 ns take a tenth."""
    core = powered(3000, at_start(*(SetTimer(f"{t}", t) for t in (9, 10, 19, 20, 500, 501))))
    outputs = run(core, NS)
    tenths = [(t, (1000 - t) / 1000) for t in range(100, 1001, 100)]
    assert charges(outputs) == [(10, 0.99), (20, 0.98), *tenths]
    assert [type(o.effect) for o in outputs[-2:] if isinstance(o, Told)] == [Died, Charge]


# --- lives of one battery ---------------------------------------------------------------------------------------------


def test_the_battery_goes_on_where_the_life_before_left_it() -> None:
    """1000 ns of listening and a reading in the first life; of 6000 fJ 2000 are left for the second."""
    first = powered(6000, at_start(Sample("sound")), kill_ns=1000)
    run(first, NS)
    heir = powered(6000, start_ns=5000)
    heir.inherit(b"", spent(first.record(NS)))
    outputs = run(heir, NS)
    assert charges(outputs)[0] == (5000, 0.34)  # 33 and a third
    assert died_at(outputs) == 5667
    assert heir.record(NS)["activity"] == {"field": [0, 0, 667, 0, 0]}
    assert heir.record(NS)["inherited"] == {"field": [0, 0, 1000, 0, 1]}
    assert spent(heir.record(NS)) == {"field": Activity(listen_ns=1667, samples=1)}


def test_what_was_taken_from_the_battery_is_known_at_any_time() -> None:
    """It goes on where the lives before left it, and is of no interest on mains."""
    core = powered(6000, at_start(Sample("sound")))
    core.inherit(b"", {"field": Activity(listen_ns=50)})
    run(core, 400)
    assert core.spent(700) == {"field": [0, 0, 750, 0, 1]}
    assert powered(None).spent(700) is None


@pytest.mark.parametrize(
    ("spent", "taken", "refused"),
    [
        (msgpack.packb({"field": [0, 0, 750, 0, 1]}), {"field": Activity(listen_ns=750, samples=1)}, 0),
        (b"", {}, 0),
        (msgpack.packb({"field": [0, 0, 7.5, 0, 1]}), {}, 1),
        (msgpack.packb({"field": [0] * 6}), {}, 1),
        (msgpack.packb([3]), {}, 1),
        (bytes(9), {}, 1),
    ],
)
def test_a_life_takes_over_what_one_that_died_unplanned_had_told(
    spent: bytes, taken: dict[str, Activity], refused: int
) -> None:
    complaints = Refusals()
    spec = ProcessSpec("a", "toy", "none", incarnation=1)
    heritage = Heritage(None, spec, (b"kept", spent), lambda: None, Seal(b""), complaints)  # type: ignore[arg-type]
    assert (heritage.known, heritage.stored, heritage.spent) == (True, b"kept", taken)
    assert complaints.total == refused


def test_on_an_empty_battery_nothing_starts() -> None:
    """It was empty in the first life; the restart that was planned for later finds nothing to run on."""
    heir = powered(3000, at_start(Send(Reply(1), "hub"), SetTimer("a", 9000)), start_ns=5000)
    heir.inherit(b"kept", {"field": Activity(listen_ns=1000)})
    heir.offer(arrival(5000, Request(1)))
    outputs = run(heir, NS)
    assert outputs == [Told((5000, 0, "start"), Died("battery")), Told((5000, 0, "start"), Charge(0.0))]
    assert (heir.state, heir.tally) == ((), {})
    assert heir.next_key() is None
    assert heir.record(NS)["metered_ns"] == 0
    assert heir.record(NS)["stored"] == b"kept"


# --- undone -----------------------------------------------------------------------------------------------------------


def test_a_late_frame_makes_it_die_earlier() -> None:
    """It heard a frame at 99 us and was empty soon after; one of 10 us turns up, and took what was left."""
    core = powered(300_000)
    core.offer(arrival(99_000, Request(2)))
    air_ns = (len(encode(Request(1))) + 20) * 10
    alone, both = (-(-(300_000 - n * 2 * air_ns) // 3) for n in (1, 2))
    assert 99_000 < both < alone
    assert died_at(run(core, NS)) == alone
    core.offer(arrival(10_000, Request(1)))
    outputs = caught_up(core)
    assert any(isinstance(output, Undone) for output in outputs)
    assert died_at(outputs) == both
    assert core.life.over
    assert core.tally == {"delivered": 2}


def test_a_late_frame_lets_it_live_longer() -> None:
    """The call of 500 ns told it to sleep: it lives to see 1200 ns, and sleeps through what comes at 1250."""
    core = powered(3000, script({Received(500, Request(1), "peer"): (Radio(False), SetTimer("a", 1200))}))
    core.conditions = replace(core.conditions, powers={"field": replace(core.conditions.powers["field"], receive_uw=3)})
    run(core, NS)
    assert core.life.over
    for t in (1250, 2001):
        core.offer(arrival(t, Request(2)))
    assert run(core, NS) == []
    core.offer(arrival(500, Request(1)))
    outputs = caught_up(core) + run(core, NS)
    # All 1500 fJ of the first 500 ns, and those of hearing on after the radio is off, 2 uW more than it draws then.
    air_ns = (len(encode(Request(1))) + 20) * 10
    assert air_ns < 500
    assert died_at(outputs) == 2000
    assert core.state == (START, Received(500, Request(1), "peer"), Timer(1200, "a"))
    assert core.tally == {"delivered": 1, "asleep": 1}


# --- all that a process does adds up ----------------------------------------------------------------------------------

deeds = st.lists(
    st.tuples(st.integers(0, 2000), st.sampled_from(["send", "hear", "sample", "on", "off", "wire"])), max_size=12
)


@given(deeds, st.integers(2000, 5000))
def test_every_moment_is_sent_received_listened_or_slept(story: list[tuple[int, str]], end: int) -> None:
    """Whatever it did, the times add up to that for which it lived, and the readings are all there."""
    effects = {"send": Send(Reply(1), "hub"), "sample": Sample("sound"), "on": Radio(True), "off": Radio(False),
               "wire": Send(Reply(1), "hub", "backbone")}  # fmt: skip

    def react(event: object) -> list[Effect]:
        if isinstance(event, Started):
            return [SetTimer(f"{i}", t) for i, (t, deed) in enumerate(story) if deed != "hear"]
        return [effects[story[int(event.name)][1]]] if isinstance(event, Timer) else []

    core = core_of(Puppet(react), sense=lambda *_: 0, conditions=Conditions(powers={"field": POWER}))
    for copy, (t, deed) in enumerate(story):
        if deed == "hear":
            core.offer(arrival(t, Request(1), copy=copy))
    run(core, 2000)
    record = core.record(end)
    activity = Activity(*record["activity"]["field"])
    assert sum(activity[:4]) == end == record["metered_ns"]
    assert activity.samples == sum(deed == "sample" for _, deed in story)
    assert activity.send_ns == AIR_NS * sum(deed == "send" for _, deed in story)
    assert activity.receive_ns <= (len(encode(Request(1))) + 20) * 10 * sum(deed == "hear" for _, deed in story)
    assert all(isinstance(event, Started | Timer | Received | Sampled) for event in core.state)
