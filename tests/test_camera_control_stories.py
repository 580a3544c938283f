"""Camera control and its camera when something goes wrong: a story for each step that is lost, late or twice."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from tests.camera_line import MOUNT, Joined, Lose, control, fix, ignored, item
from trackfield.models.pointing import Mount, in_view
from trackfield.role import NS, Tell
from trackfield.wire.outside import Capture, Visca

EAST = (5.0, 5.0, 13.4, 0.0)
"""Comes along from the left, 30 m ahead of the camera."""
FAR = (-10.0, 5.0, 13.4, 0.0)
"""The same, 15 m behind the first."""
RIGHT = (80.0, 5.0, -6.0, 0.0)
"""Another one, which comes from the right."""
AWAY = (-60.0, -20.0, 3.0, 0.0)
"""Far to the left: it takes a second to turn there."""
SIDES = ((-60.0, 3.0), (-10.0, 13.4), (25.0, 0.0), (40.0, -13.4), (100.0, -5.0))
"""Where targets come from, and how fast they are to the east."""
TURNS = "8101060218"


def ready(lose: Lose = lambda who, packet, count: False, until_s: float = 11.3, **changes: Any) -> Joined:
    """Some time after step 20, which was at 10 s."""
    return Joined(control(**changes), lose).run(until_s)


def turns(both: Joined) -> list[str]:
    """The commands to turn, and to cancel."""
    return [packet for packet in both.written() if packet.startswith((TURNS, "812"))]


def seen(both: Joined, state: tuple[float, ...], shot: int = -1) -> bool:
    """Whether the target of the last shot, or of the given one, was in the picture at the time for which it is aimed.

    Its ``state`` is that at 10 s.
    """
    aims = [values for values in both.told("aimed") if values[0]]
    at_ns = (aims[-1] if shot < 0 else aims[shot - 1])[5]
    x, y, vx, vy = state
    age_s = at_ns / NS - 10.0
    return in_view(Mount(**MOUNT), both.look(at_ns), x + vx * age_s, y + vy * age_s)


# --- items ------------------------------------------------------------------------------------------------------------


def test_an_acknowledgement_is_lost() -> None:
    """The gateway sends the item again: it is acknowledged again, and nothing else happens."""
    both = ready()
    both.give(item(fix(20, *EAST), number=4))
    before = both.run(12.0).written()
    assert list(ignored(both.give(item(fix(20, *EAST), number=4)))) == ["repeated"]
    assert (both.acks, both.outcomes, both.written()) == ([(4, 0), (4, 0)], [(20, "aimed")], before)


def test_the_gateway_begins_a_new_life_and_sends_the_same_fix_again() -> None:
    both = ready()
    both.give(item(fix(20, *EAST), number=4, life=0))
    both.run(11.5).give(item(fix(20, *EAST), number=4, life=23))
    assert (both.acks, both.outcomes) == ([(4, 0), (4, 23)], [(20, "aimed"), (20, "repeated")])
    assert len(turns(both)) == 1


@pytest.mark.parametrize("first", [EAST, FAR])
def test_a_newer_fix_of_the_same_target_replaces_the_older(first: tuple[float, ...]) -> None:
    """The next head sees it half a second later; the turn that goes on is cancelled."""
    both = ready()
    both.give(item(fix(20, *first), number=1))
    x, y, vx, vy = first
    both.run(11.4).give(item(fix(21, x + vx / 2 + 1.0, y, vx, vy, number=5), number=2, head="n007"))
    both.run(14.0)
    assert both.outcomes == [(20, "aimed"), (21, "aimed")]
    assert [len(one) for one in turns(both)] == [30, 6, 30]
    assert both.written("camera").count("906104ff") == 1
    assert seen(both, (first[0] + 1.0, *first[1:]))
    assert both.news == ["ready", "moving", "moving", "there"]


def test_an_older_fix_of_the_same_target_comes_late() -> None:
    both = ready(until_s=11.8)
    both.give(item(fix(21, 5 + 6.7, 5.0, 13.4, 0.0), number=2))
    both.run(12.0).give(item(fix(20, *EAST, number=3), number=1, head="n009"))
    assert both.outcomes == [(21, "aimed"), (20, "superseded")]
    assert len(turns(both)) == 1


# --- replies ----------------------------------------------------------------------------------------------------------


def drop(packet: str, times: int = 1, who: str = "camera") -> Lose:
    """Loses a packet that begins so, the first times that it is sent."""
    lost = list[int]()

    def lose(by: str, data: bytes, count: int) -> bool:
        if by != who or not data.hex().startswith(packet) or len(lost) >= times:
            return False
        lost.append(count)
        return True

    return lose


BEGINNING = (
    ("control", "8830"),
    ("camera", "883002"),
    ("control", "880100"),
    ("camera", "880100"),
    ("control", "810906"),
    ("camera", "9050"),
)


@pytest.mark.parametrize(("who", "packet"), BEGINNING)
@pytest.mark.parametrize("times", [1, 2])
def test_a_packet_of_the_beginning_is_lost(who: str, packet: str, times: int) -> None:
    both = ready(drop(packet, times, who), 1.0)
    assert both.news == ["ready"]
    both.run(11.3).give(item(fix(20, *EAST)))
    assert both.run(14.0).news == ["ready", "moving", "there"]


@pytest.mark.parametrize("times", [1, 2])
def test_a_command_is_lost(times: int) -> None:
    """After 100 ms it is sent again; the aim is late by as much."""
    both = ready(drop(TURNS, times, "control"))
    both.give(item(fix(20, *EAST)))
    both.run(14.0)
    assert turns(both) == [turns(both)[0]] * (1 + times)
    sent = [at_ns for at_ns, _, packet in both.packets if packet.hex().startswith(TURNS)]
    assert sent[1] - sent[0] == NS // 10 + 15_625_000
    assert both.news == ["ready", "moving", "there"]
    assert seen(both, EAST)


@pytest.mark.parametrize("times", [1, 2])
def test_the_answer_to_a_command_is_lost(times: int) -> None:
    """It turns all the same. Told a third time it has no socket left: what it holds is cancelled first."""
    both = ready(drop("904", times))
    both.give(item(fix(20, *AWAY)))
    both.run(15.0)
    assert [len(one) for one in turns(both)] == [30, 30] if times == 1 else [30, 30, 30, 6, 6, 30]
    assert both.news == ["ready", "moving", "there"]
    assert seen(both, AWAY)
    assert both.states["control"].line.acks_ns == (), (
        "an answer to a repeated command says nothing of how long it takes"
    )


def test_the_end_of_a_turn_is_not_told() -> None:
    """It asks where the camera looks, a second after it should be there."""
    both = ready(drop("9051"))
    both.give(item(fix(20, *EAST)))
    both.run(16.0)
    assert both.news == ["ready", "moving", "there"]
    assert both.written()[-1] == "81090612ff"
    assert seen(both, EAST)


def test_the_answer_to_a_cancel_is_lost() -> None:
    both = ready(drop("906104"))
    both.give(item(fix(20, *FAR), number=1))
    both.run(11.4).give(item(fix(21, -3.0, 5.0, 13.4, 0.0), number=2))
    both.run(15.0)
    assert both.news == ["ready", "moving", "moving", "there"]
    assert seen(both, (-9.7, 5.0, 13.4, 0.0))


def test_a_cancel_is_lost() -> None:
    """The camera takes the new turn, but goes on with the old one: as that is not cancelled, it is once more."""
    both = ready(drop("8121", who="control"))
    both.give(item(fix(20, *AWAY), number=1))
    both.run(11.5).give(item(fix(21, 25.0, 5.0, 0.0, 0.0, number=1), number=2, head="n007"))
    both.run(11.65)
    assert [len(one) for one in turns(both)] == [30, 6, 30, 6]
    both.run(12.2)
    assert both.news == ["ready", "moving", "moving", "there"]
    assert both.look(both.now) == pytest.approx(both.told("aimed")[1][8:10], abs=0.1)


def test_a_turn_that_was_told_twice_is_cancelled_in_both_sockets() -> None:
    both = ready(drop("904"))
    both.give(item(fix(20, *AWAY), number=1))
    both.run(11.6).give(item(fix(21, 25.0, 5.0, 0.0, 0.0, number=1), number=2, head="n007"))
    both.run(12.4)
    assert [len(one) for one in turns(both)] == [30, 30, 6, 6, 30]
    assert both.look(both.now) == pytest.approx(both.told("aimed")[1][8:10], abs=0.1)


def test_both_sockets_are_taken_for_a_while() -> None:
    """Whatever holds them is cancelled; it waits, and tries again."""

    def lose(who: str, packet: bytes, count: int) -> bool:
        return who == "control" and packet.hex().startswith(TURNS) and count <= 3

    both = ready(lose)
    both.give(item(fix(20, *EAST)))
    for _ in range(3):
        both.run(both.now / NS + 0.03)
        both.give(_visca("906003ff"), "camera", "serial")
        both.run(both.now / NS + 0.03)
    both.run(15.0)
    assert [len(one) for one in turns(both)] == [30, 6, 6] * 3 + [30]
    assert both.news == ["ready", "moving", "there"]
    assert seen(both, EAST)


def _visca(packet: str) -> Any:
    return Visca(bytes.fromhex(packet))


@pytest.mark.parametrize("error", ["906041ff", "906141ff", "906002ff"])
def test_a_camera_that_will_not_turn_is_told_three_times_and_asked_where_it_looks(error: str) -> None:
    both = ready(lambda who, packet, count: who == "control" and packet.hex().startswith(TURNS))
    both.give(item(fix(20, *EAST)))
    for _ in range(3):
        both.run(both.now / NS + 0.03).give(_visca(error), "camera", "serial")
        both.run(both.now / NS + 0.03)
    assert both.news == ["ready", "failed", "ready"]
    assert "the camera failed: " in both.notes[0]
    assert both.told("aimed")[-1][0] == 2, "and then told anew, from where it looks"


def test_it_does_not_try_for_ever() -> None:
    """After three failures the target is given up; the camera is not lost, it answers."""
    both = ready(lambda who, packet, count: who == "control" and packet.hex().startswith(TURNS), shot_s=60.0)
    both.give(item(fix(20, 25.0, 5.0, 0.5, 0.0)))
    for _ in range(60):
        both.run(both.now / NS + 0.03)
        if both.states["control"].line.pending is not None:
            both.give(_visca("906141ff"), "camera", "serial")
    assert both.news.count("failed") == 3
    assert both.told("aimed")[-1][0] == 3
    assert both.states_said[-1] == "waiting"


# --- the camera goes away ---------------------------------------------------------------------------------------------


def test_a_camera_that_is_unplugged_is_lost_after_three_tries_and_found_again() -> None:
    both = ready()
    both.plugged = False
    both.give(item(fix(20, *EAST)))
    both.run(11.9)
    assert [len(one) for one in turns(both)] == [30] * 3
    assert (both.news, both.states_said[-1]) == (["ready", "lost"], "lost")
    assert both.notes == ["camera lost: it does not answer"]
    both.run(14.2)
    probes = [at_ns for at_ns, who, packet in both.packets if who == "control" and packet == b"\x88\x30\x01\xff"]
    assert [after - before for before, after in pairwise(probes[2:])] == [NS]
    both.plugged = True
    both.run(18.0)
    assert both.news == ["ready", "lost", "ready", "moving", "there"]
    assert both.outcomes == [(20, "aimed"), (20, "aimed")]
    assert seen(both, EAST)


def test_a_fix_that_comes_while_the_camera_is_lost_is_aimed_at_when_it_is_back() -> None:
    both = Joined()
    both.plugged = False
    both.run(11.3)
    assert both.news == ["lost"]
    both.give(item(fix(20, *FAR), number=1))
    both.run(11.8).give(item(fix(21, -3.3, 5.0, 13.4, 0.0, number=1), number=2))
    assert both.outcomes == [(20, "camera lost"), (21, "camera lost")]
    assert not [one for _, one, _ in both.sent if isinstance(one, Capture)]
    both.plugged = True
    both.run(16.0)
    assert both.outcomes[2:] == [(21, "aimed")], "the newest alone"
    assert seen(both, FAR)


def test_what_is_too_old_when_the_camera_is_back_is_left() -> None:
    both = ready()
    both.plugged = False
    both.give(item(fix(20, *EAST)))
    both.run(21.0)
    both.plugged = True
    both.run(25.0)
    assert both.news == ["ready", "lost", "ready"]
    assert both.outcomes == [(20, "aimed"), (20, "out of reach")]
    assert both.states_said[-1] == "waiting"


def test_a_camera_that_loses_its_power_is_begun_anew_and_aimed_again() -> None:
    both = ready()
    both.give(item(fix(20, *FAR)))
    both.run(11.5).power_cycle()
    both.run(16.0)
    assert both.news == ["ready", "moving", "ready", "moving", "there"]
    assert both.outcomes == [(20, "aimed"), (20, "aimed")]
    assert seen(both, FAR)


# --- two targets ------------------------------------------------------------------------------------------------------


def test_a_target_that_comes_later_waits_until_the_first_has_left_the_picture() -> None:
    both = ready()
    both.give(item(fix(20, *EAST), number=1))
    both.run(11.35).give(item(fix(20, *RIGHT, number=1), number=2, head="n007"))
    assert both.outcomes == [(20, "aimed"), (20, "later")]
    assert both.notes == ["event 1 of n007 waits: event 0 of n000 is nearer in time"]
    both.run(19.0)
    assert both.outcomes == [(20, "aimed"), (20, "later"), (20, "aimed")]
    assert both.notes[1] == "event 1 of n007 has waited, and is aimed at now"
    assert seen(both, EAST, shot=1)
    assert seen(both, RIGHT, shot=2)
    first, second = (values for values in both.told("aimed") if values[0])
    x = EAST[0] + EAST[2] * (second[5] / NS - 10.0)
    assert not in_view(Mount(**MOUNT), both.look(first[5] + NS), EAST[0] + EAST[2] * (first[5] / NS - 9.0), 5.0)
    assert second[5] > first[5]
    assert x > 30.0
    assert [len(one) for one in turns(both)] == [30, 30], "nothing is cancelled"


def test_a_target_that_is_nearer_in_time_wins_and_the_other_waits() -> None:
    """The first is met after a long turn; the second is where the camera almost looks already."""
    both = ready()
    both.give(item(fix(20, *AWAY), number=1))
    both.run(11.35).give(item(fix(20, 31.0, 5.0, 1.0, 0.0, number=1), number=2, head="n007"))
    assert both.outcomes == [(20, "aimed"), (20, "aimed")]
    assert both.told("aimed")[1][5] < both.told("aimed")[0][5]
    assert both.notes == ["event 1 of n007 is nearer in time than event 0 of n000, which waits"]
    both.run(19.0)
    assert [len(one) for one in turns(both)] == [30, 6, 30, 30], "the first turn is cancelled"
    assert both.notes[1] == "event 0 of n000 has waited, and is aimed at now"
    assert seen(both, (31.0, 5.0, 1.0, 0.0), shot=2)
    assert seen(both, AWAY, shot=3)
    assert both.states_said == ["waiting", "aiming", "watching", "aiming", "watching", "waiting"]
    told = [
        at_ns for at_ns, who, one in both.said if who == "control" and isinstance(one, Tell) and one.topic == "aimed"
    ]
    assert told[2] - both.told("aimed")[1][5] == pytest.approx(NS, abs=1), "a second after its aim the other's turn"


def test_who_waits_is_left_if_it_has_gone_meanwhile() -> None:
    both = ready()
    both.give(item(fix(20, *EAST), number=1))
    both.run(11.35).give(item(fix(20, 75.0, -20.0, 0.0, -11.0, number=1), number=2, head="n007"))
    both.run(25.0)
    assert both.outcomes == [(20, "aimed"), (20, "later")]
    assert both.states_said[-1] == "waiting"


# --- control goes away ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("after_s", [0.01, 0.1, 0.5, 1.5])
def test_control_is_restarted_in_mid_pass(after_s: float) -> None:
    """The line is begun anew, which stops the camera; the target that was waited for is aimed at again."""
    both = ready()
    both.give(item(fix(20, *FAR), number=4))
    both.run(11.3 + after_s).restart()
    both.run(18.0)
    assert both.outcomes == [(20, "aimed"), (20, "aimed")]
    assert [values[0] for values in both.told("aimed")] == [1, 2], "shots of different lives have different numbers"
    assert seen(both, FAR)
    both.give(item(fix(20, *FAR), number=4))
    assert both.acks == [(4, 0), (4, 0)], "what it knows from before its death it does not take for new"
    assert len(both.outcomes) == 2


def test_control_is_dead_when_an_item_comes_and_gets_it_when_it_is_back() -> None:
    both = ready()
    both.restart()
    both.run(11.5).give(item(fix(20, *EAST), number=4))
    both.run(14.0)
    assert both.outcomes == [(20, "aimed")]
    assert seen(both, EAST)


def test_a_fix_comes_while_the_line_begins() -> None:
    """It is kept, and aimed at as soon as the camera can be told."""
    both = ready()
    both.restart()
    both.run(11.301).give(item(fix(20, *EAST), number=4))
    assert both.outcomes == []
    both.run(14.0)
    assert both.outcomes == [(20, "aimed")]
    assert seen(both, EAST)


# --- a bad line -------------------------------------------------------------------------------------------------------


@settings(deadline=None)
@example([False] * 9 + [True] * 4, [])
@given(
    st.lists(st.booleans(), max_size=60), st.lists(st.tuples(st.sampled_from(SIDES), st.floats(0.0, 0.6)), max_size=5)
)
def test_after_any_losses_it_knows_where_the_camera_looks(lost: list[bool], given_: list[tuple[Any, float]]) -> None:
    """Packets of both sides are lost as drawn, while fixes of different targets come; then no more are."""
    losses, bad = iter(lost), [True]
    both = Joined(control(), lambda who, packet, count: bad[0] and next(losses, False)).run(2.0)
    for number, ((x, speed), after_s) in enumerate(given_):
        step = both.now * 2 // NS
        both.give(item(fix(step, x, 5.0, speed, 0.0, number=number), number=number, head=f"n{number:03}"))
        both.run(both.now / NS + after_s)
    both.run(both.now / NS + 20.0)
    line = both.states["control"].line
    assert line.free
    assert line.running is None
    assert line.look(both.now) == pytest.approx(both.look(both.now), abs=0.1)
    bad[0] = False
    step = both.now * 2 // NS
    both.give(item(fix(step, *EAST, number=99), number=99))
    both.run(both.now / NS + 2.5)
    assert both.outcomes[-1] == (step, "aimed")
    assert both.look(both.now) == pytest.approx(both.told("aimed")[-1][8:10], abs=0.1)
