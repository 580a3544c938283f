"""Camera control, event by event: items, fixes, delay, aims, the line to the camera, video and subscriptions."""

from __future__ import annotations

from math import hypot
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from camera.fixes import read
from camera.line import Driver, Line
from camera.memory import Memory, pack, unpack
from tests.camera_line import BAUD, MOUNT, WANTED, Joined, belief, control, fix, ignored, item
from trackfield.filters.belief import Modes, Particles
from trackfield.models.pointing import Direction, Mount, in_view, towards
from trackfield.role import NS, Event, IllegalEvent, Received, Send, Started, Store, Timer
from trackfield.wire.messages import SyncReply, SyncRequest
from trackfield.wire.outside import Capture, Captured, ItemAck, Subscribe, Visca
from trackfield.wire.passes import FixReport
from trackfield.wire.visca import pan_steps, tilt_steps

EAST = (5.0, 5.0, 13.4, 0.0)
"""A target that comes along from the left."""
BEGUN = ["883001ff", "883001ff", "88010001ff", "81090612ff"]
"""The first packets: the camera says meanwhile that it was switched on, so it is begun anew."""
SYNC = {"reference": "base", "exchanges": 1, "resync_ns": 30 * NS, "timeout_ns": NS // 10, "seed": 1, "id": "c"}


def joined(until_s: float = 11.3, **changes: Any) -> Joined:
    """Both are ready, and it is some time after step 20 (10 s)."""
    return Joined(control(**changes)).run(until_s)


# --- the start --------------------------------------------------------------------------------------------------------


def test_a_camera_is_given_its_address_cleared_and_asked_where_it_looks() -> None:
    both = joined(1.0)
    assert both.written() == BEGUN
    assert both.written("camera")[:2] == ["9038ff", "883002ff"]
    assert both.news == ["ready"]
    assert both.states_said == ["waiting"]


def test_it_subscribes_at_once_soon_again_and_then_each_third() -> None:
    both = joined(70.0)
    times = [at_ns / NS for at_ns, message, to in both.sent if isinstance(message, Subscribe) and to == "base"]
    assert times == [0.0, 1.0, 3.0, 7.0, 15.0, 31.0, 51.0]
    assert {message for _, message, _ in both.sent if isinstance(message, Subscribe)} == {Subscribe(**WANTED)}


# --- a fix ------------------------------------------------------------------------------------------------------------


def test_a_fix_is_acknowledged_and_aimed_at_with_its_measured_delay() -> None:
    both = joined()
    both.give(item(fix(20, *EAST, early_s=0.4), number=7, life=3))
    both.run(20.0)
    assert both.acks == [(7, 3)]
    [(shot, head, step, delay_s, cpa_ns, aim_ns, x_m, y_m, pan, tilt, outcome)] = both.told("aimed")
    assert (shot, head, step, outcome) == (1, "n000", 20, "aimed")
    assert (delay_s, cpa_ns) == (pytest.approx(11.3 - 9.6), 9_600_000_000)
    after_s = aim_ns / NS - 10.0
    assert (x_m, y_m) == (pytest.approx(5 + 13.4 * after_s, abs=1e-4), pytest.approx(5.0, abs=1e-6))
    assert Direction(pan, tilt) == pytest.approx(towards(Mount(**MOUNT), x_m, y_m), abs=1e-4)
    look = both.look(aim_ns)
    assert hypot(look.pan - pan, look.tilt - tilt) < 1.5, "it is there at that time, but for its vertical cycle"
    assert both.look(aim_ns + NS // 20) == pytest.approx((pan, tilt), abs=0.1)
    assert both.look(aim_ns - NS // 10) != pytest.approx((pan, tilt), abs=3.0), "and not long before"


def test_the_command_is_the_packet_of_the_manual_at_full_speed() -> None:
    both = joined()
    both.give(item(fix(20, *EAST)))
    pan, tilt = both.told("aimed")[0][8:10]
    digits = f"{pan_steps(pan) & 0xFFFF:04x}{tilt_steps(tilt) & 0xFFFF:04x}"
    assert both.written()[-1] == "810106021814" + "".join(f"0{digit}" for digit in digits) + "ff"


def test_without_prediction_it_looks_where_the_target_was_at_the_last_sensor() -> None:
    both = joined(predict=False)
    both.give(item(fix(20, *EAST, early_s=0.5)))
    x_m, y_m = both.told("aimed")[0][6:8]
    assert (x_m, y_m) == (pytest.approx(5.0 - 13.4 * 0.5, abs=1e-4), 5.0)


@pytest.mark.parametrize("predict", [True, False])
def test_what_it_cannot_turn_to_it_leaves(predict: bool) -> None:
    both = joined(predict=predict)
    both.give(item(fix(20, 30.0, -60.0, 0.0, -5.0)))
    assert both.outcomes == [(20, "out of reach")]
    assert both.told("aimed")[0][0] == 0
    assert both.written() == BEGUN
    assert not [one for _, one, _ in both.sent if isinstance(one, Capture)]


def test_beyond_its_reach_it_looks_as_far_as_it_can_if_that_is_enough() -> None:
    """A target that stands 110 degrees to the right is in a picture that reaches to 124.4."""
    both = joined()
    x, y = 30.0 + 40 * np.sin(np.radians(110)), -25.0 + 40 * np.cos(np.radians(110))
    both.give(item(fix(20, x, y, 0.0, 0.0)))
    [(shot, *_, aim_ns, x_m, y_m, pan, _, outcome)] = both.told("aimed")
    assert (shot, pan, outcome) == (1, 100.0, "aimed")
    both.run(20.0)
    assert in_view(Mount(**MOUNT), both.look(aim_ns + NS // 20), x_m, y_m)


def test_a_fix_that_is_too_old_says_nothing_of_where_the_target_is() -> None:
    both = joined(20.6)
    both.give(item(fix(20, *EAST)))
    assert both.outcomes == [(20, "out of reach")]
    assert both.notes[-1] == "the fix of event 0 of n000 is 10.6 s old"


@pytest.mark.parametrize("form", ["particles", "modes", "six numbers"])
def test_it_can_use_any_belief(form: str) -> None:
    mean = np.array(EAST)
    given_ = {
        "particles": Particles(np.full(2, 0.5), np.array([mean + 1, mean - 1])),
        "modes": Modes(np.array([1.0]), mean[None], np.eye(4)[None]),
        "six numbers": belief(*EAST)._replace(mean=np.array([*EAST, 1.0, 2.0]), covariance=np.eye(6)),
    }[form]
    both = joined()
    both.give(item(fix(20, known={"ml": given_, "ecpa": belief(0, 0, 1, 1)})))
    [(*_, aim_ns, x_m, y_m, _, _, outcome)] = both.told("aimed")
    assert outcome == "aimed"
    assert (x_m, y_m) == (pytest.approx(5 + 13.4 * (aim_ns / NS - 10), abs=1e-3), pytest.approx(5.0, abs=1e-5))


@pytest.mark.parametrize(
    ("message", "why"),
    [
        (fix(20, known={"ecpa": belief(*EAST)}), "no fix"),
        (FixReport(0, 20, 1, b"", b""), "no fix"),
        (fix(80, *EAST), "from the future"),
        (fix(20, known={"ml": belief(2e6, 0, 0, 0)}), "unusable fix"),
        (Captured(1, 1), "unexpected"),
        (b"", "unexpected"),
    ],
)
def test_what_is_of_no_use_is_acknowledged_and_counted(message: Any, why: str) -> None:
    both = joined()
    effects = both.give(item(message, number=9))
    assert list(ignored(effects)) == [why]
    assert (both.acks, both.outcomes) == ([(9, 0)], [])


def test_a_fix_before_its_clock_is_set_is_used_as_if_it_were_of_now() -> None:
    both = joined(1.0, sync=SYNC)
    both.give(item(fix(20, *EAST, early_s=0.4)))
    [(_, _, _, delay_s, *_, outcome)] = both.told("aimed")
    assert (delay_s, outcome) == (pytest.approx(0.4), "aimed")
    assert both.notes == ["a fix comes before its clock is set"]


def test_the_delay_is_by_its_corrected_clock() -> None:
    """Its clock is 10 s behind: 11.3 s by the reference is 1.3 s by its own."""
    both = joined(0.0, sync=SYNC)
    while not both.states["control"].time.known:
        both.run(both.now / NS + 0.01)
        if both.states["control"].time.waiting:
            asked = next(one for _, one, _ in reversed(both.sent) if isinstance(one, SyncRequest))
            time_us = both.now // 1000 + 10_000_000
            both.give(SyncReply(asked.exchange, asked.sent_us, time_us, time_us))
    both.run(1.3).give(item(fix(20, *EAST, early_s=0.4)))
    [(_, _, _, delay_s, cpa_ns, aim_ns, *_, outcome)] = both.told("aimed")
    assert (delay_s, cpa_ns, outcome) == (pytest.approx(11.3 - 9.6, abs=0.01), 9_600_000_000, "aimed")
    assert 11.3 < aim_ns / NS < 13.3
    assert both.notes == []


# --- memory -----------------------------------------------------------------------------------------------------------


def test_the_next_life_knows_what_came_and_who_is_waited_for() -> None:
    both = joined()
    both.give(item(fix(20, *EAST), number=7, life=3))
    again = unpack(both.stored)
    assert (again.items, again.fixes, again.shots) == (((3, 7),), (("n000", 0, 20),), 1)
    assert [one.key for one in again.waiting] == [("n000", 0, 20)]
    assert pack(again) == both.stored


@pytest.mark.parametrize("stored", [b"\xc1", b"\x90", b"\x95\x02\x90\x90\x00\x90", b"\x95\x01\x90\x90\xff\x90", b"x"])
def test_a_life_that_cannot_use_what_was_stored_says_so(stored: bytes) -> None:
    with pytest.raises(ValueError, match=r"shots|stores"):
        unpack(stored)
    role = control()
    _, effects = role.handle(role.begin(), Started(0, stored))
    assert any("cannot be used" in getattr(one, "text", "") for one in effects)
    assert [one.message.packet.hex() for one in effects if isinstance(one, Send)] == ["883001ff"]


def test_each_item_is_stored_with_its_acknowledgement() -> None:
    effects = joined().give(item(b"", number=9))
    assert sum(isinstance(one, Send) and isinstance(one.message, ItemAck) for one in effects) == 1
    assert [unpack(one.data).items for one in effects if isinstance(one, Store)] == [((0, 9),)]


# --- video ------------------------------------------------------------------------------------------------------------


def test_video_is_asked_for_once_if_it_answers_and_else_once_more() -> None:
    both = joined()
    both.give(item(fix(20, *EAST)))
    assert [one for _, one, _ in both.sent if isinstance(one, Capture)] == [Capture(1, 4.0)]
    both.run(15.0).give(Captured(1, 40), "video")
    both.run(30.0)
    assert sum(isinstance(one, Capture) for _, one, _ in both.sent) == 1
    silent = joined()
    silent.give(item(fix(20, *EAST)))
    silent.run(40.0)
    captures = [(at_ns / NS, one) for at_ns, one, _ in silent.sent if isinstance(one, Capture)]
    assert captures == [(11.3, Capture(1, 4.0)), (pytest.approx(15.8, abs=0.001), Capture(1, 4.0))]
    assert silent.notes[-1] == "no video of shot 1: video does not answer"


# --- the line ---------------------------------------------------------------------------------------------------------


def test_the_lead_is_what_the_line_and_the_camera_take() -> None:
    """15 bytes of 10 bits at 9600 baud are 15.6 ms; until one is measured an answer takes a vertical cycle."""
    driver = Driver("camera", BAUD)
    assert driver.lead_ns(Line(), 0) == 15_625_000 + 16_683_333
    assert driver.lead_ns(Line(acks_ns=(3, 1, 2)), 0) == 15_625_000 + 2
    assert driver.lead_ns(Line(acks_ns=(1,), running=1), 0) == 18_750_000 + 1, "a cancel goes first"
    assert driver.lead_ns(Line(acks_ns=(1,), free_ns=500), 100) == 15_625_000 + 401


def test_the_time_of_an_answer_is_measured() -> None:
    both = joined()
    both.give(item(fix(20, *EAST)))
    both.run(11.5)
    [took_ns] = both.states["control"].line.acks_ns
    sent_ns = next(at_ns for at_ns, who, packet in both.packets if who == "control" and len(packet) == 15)
    ack_ns = next(at_ns for at_ns, who, packet in both.packets if who == "camera" and packet == b"\x90\x41\xff")
    assert took_ns == ack_ns - sent_ns - 15_625_000


@given(st.binary(max_size=16), st.integers(0, 3))
def test_no_packet_of_a_camera_breaks_the_line(packet: bytes, turned: int) -> None:
    both = joined(1.0)
    for step in range(turned):
        both.give(item(fix(step, *EAST), number=step))
    state, effects = both.roles["control"].handle(
        both.states["control"], Received(both.now, Visca(packet), "camera", "serial")
    )
    assert state.line.due_ns is None or state.line.due_ns >= both.now
    assert all(isinstance(one, object) for one in effects)


def test_events_that_no_driver_gives_are_illegal() -> None:
    role = control()
    with pytest.raises(IllegalEvent):
        role.handle(Memory(), Timer(0, "other"))


@pytest.mark.parametrize(
    "event",
    [
        Received(0, item(fix(0, *EAST)), "stranger", "backbone"),
        Received(0, Visca(b"\x90\x38\xff"), "stranger", "serial"),
        Received(0, Captured(1, 1), "stranger", "backbone"),
    ],
)
def test_strangers_are_not_listened_to(event: Event) -> None:
    role = control()
    state, effects = role.handle(Memory(said="waiting"), event)
    assert (state, list(ignored(effects))) == (Memory(said="waiting"), ["foreign"])


def test_fixes_of_one_target_are_told_from_those_of_others() -> None:
    settings = control().settings

    def target(step: int, *state: float, head: str = "a", number: int = 0) -> Any:
        return read(item(fix(step, *state, number=number), head=head), settings, 0)

    first = target(20, 0.0, 0.0, 13.4, 0.0)
    assert first.same(target(22, 13.4, 0.5, 13.0, 0.2, head="b")), "a second later where it should be"
    assert target(22, 13.4, 0.5, 13.0, 0.2, head="b").same(first)
    assert not first.same(target(22, 13.4, 30.0, 13.4, 0.0, head="b")), "30 m beside it"
    assert not first.same(target(20, 0.0, 0.0, -13.4, 0.0, head="b")), "it comes towards it"
    assert first.same(target(21, 0.0, 99.0, 13.4, 0.0)), "the same event, as its head judges it now"
    assert not first.same(target(200, 0.0, 0.0, 13.4, 0.0)), "a number that a restarted head gives again"
