"""What becomes of orders if frames are lost, come twice or late, or if a process dies: one story for each."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.controlled import CONTROL, KEY, PATIENCE_NS, SYSTEM, TICK_NS, VIDEO, Outside
from tests.ether import DELAY_NS
from tests.running import Run
from trackfield.protocols.orders import TRIES, order_for
from trackfield.role import NS
from trackfield.wire.outside import STOP

STOP_VIDEO = (1.0, "stop", VIDEO)
GIVEN_UP_NS = PATIENCE_NS * (2**TRIES - 1)


def test_nothing_is_lost() -> None:
    field = Outside(STOP_VIDEO, (2.0, "start", VIDEO)).until(1.5)
    assert field.answers() == [(1, "stop", VIDEO, "ok")]
    assert field.count(VIDEO) == -1
    assert field.count("base") == 15
    field.until(2.95)
    assert field.answers() == [(1, "stop", VIDEO, "ok"), (2, "start", VIDEO, "ok")]
    assert len(field.frames("order")) == len(field.frames("order-reply")) == 2
    assert field.count(VIDEO) == 10 + (2.95 * NS - (2 * NS + DELAY_NS)) // TICK_NS  # it had stored ten


@pytest.mark.parametrize("lost", ["order", "order-reply"])
def test_an_order_or_its_reply_is_lost(lost: str) -> None:
    """It is sent again, and done once: between the first and the second nothing is counted, or one life is."""
    field = Outside(STOP_VIDEO, (1.01, "start", VIDEO))
    field.rule(lost, count=1)
    field.until(3)
    assert field.answers() == [(1, "stop", VIDEO, "ok"), (2, "start", VIDEO, "ok")]
    assert [one.message.number for one in field.frames("order")] == [1, 1, 2]
    assert len(field.frames("order-reply")) == (2 if lost == "order" else 3)
    assert field.refused() == []


def test_an_order_and_the_reply_to_the_next_copy_are_lost() -> None:
    field = Outside(STOP_VIDEO)
    field.rule("order", count=1)
    field.rule("order-reply", count=1)
    field.until(1.0 + (GIVEN_UP_NS - 1) / NS)
    assert field.answers() == [(1, "stop", VIDEO, "ok")]
    assert len(field.frames("order")) == TRIES


@pytest.mark.parametrize(("lost", "stopped"), [("order", False), ("order-reply", True)])
def test_all_are_lost(lost: str, stopped: bool) -> None:
    """Nobody knows whether it was done; the next order tells."""
    field = Outside(STOP_VIDEO)
    rule = field.rule(lost)
    field.until(1.0 + (GIVEN_UP_NS + 1) / NS)
    assert field.answers() == [(1, "stop", VIDEO, "silent")]
    assert (field.count(VIDEO) == -1) == stopped
    field.rules.remove(rule)
    field.type("status video")
    field.until(4)
    assert field.lines() == [f"video {'stopped' if stopped else 'running'}"]


def test_an_order_comes_twice_and_its_copy_after_the_next_one() -> None:
    """The copy is refused, and that is no answer to anything."""
    field = Outside(STOP_VIDEO, (1.1, "start", VIDEO))
    field.rule("order", count=1, delays=(0, NS))
    field.until(4)
    assert field.answers() == [(1, "stop", VIDEO, "ok"), (2, "start", VIDEO, "ok")]
    assert field.refused() == [(VIDEO, SYSTEM, "old number")]
    assert field.count(VIDEO) > 0
    assert field.reasons(SYSTEM) == ["unexpected"]


def test_a_reply_comes_when_it_was_given_up() -> None:
    field = Outside(STOP_VIDEO)
    field.rule("order-reply", delays=(GIVEN_UP_NS,), count=1)
    field.rule("order-reply")
    field.until(4)
    assert field.answers() == [(1, "stop", VIDEO, "silent")]
    assert field.reasons(SYSTEM) == ["unexpected"]


def test_the_process_dies_before_its_order_comes_and_lives_again_for_the_next_copy() -> None:
    field = Outside(STOP_VIDEO).until(0.99)
    field.kill(VIDEO)
    field.until(1.0 + PATIENCE_NS / NS)
    field.start(VIDEO)
    field.until(3)
    assert field.answers() == [(1, "stop", VIDEO, "ok")]
    assert field.count(VIDEO) == -1


def test_the_process_dies_after_it_stopped_and_its_reply_is_lost() -> None:
    """Its next life knows the order, answers its copy, and stays stopped."""
    field = Outside(STOP_VIDEO)
    field.rule("order-reply", count=1)
    field.until(1.0 + 1.5 * DELAY_NS / NS)
    assert field.count(VIDEO) == -1
    field.kill(VIDEO)
    field.start(VIDEO)
    field.until(3)
    assert field.answers() == [(1, "stop", VIDEO, "ok")]
    assert field.refused() == []
    assert field.count(VIDEO) == -1


def test_who_was_started_again_refuses_what_was_overheard_before() -> None:
    field = Outside(STOP_VIDEO, (2.0, "start", VIDEO)).until(3)
    (overheard,) = [one.message for one in field.frames("order") if one.message.verb == STOP]
    field.kill(VIDEO)
    field.start(VIDEO)
    field.inject(VIDEO, overheard, SYSTEM)
    assert field.refused() == [(VIDEO, SYSTEM, "old number")]
    field.until(4)
    assert field.count(VIDEO) > 0


def test_system_control_dies_before_the_answer_comes() -> None:
    """Its next life orders again what it does not know to be done, by a number that is new."""
    field = Outside(STOP_VIDEO)
    field.until(1.0 + 0.5 * DELAY_NS / NS)
    field.kill(SYSTEM)
    field.until(1.5)
    field.start(SYSTEM)
    field.until(3)
    assert field.answers() == [(2, "stop", VIDEO, "ok")]
    assert field.refused() == []
    assert field.count(VIDEO) == -1


def test_system_control_was_away_when_an_order_was_planned() -> None:
    field = Outside(STOP_VIDEO, (9.0, "start", VIDEO)).until(0.5)
    field.kill(SYSTEM)
    field.until(5)
    field.start(SYSTEM)
    field.until(6)
    assert field.answers() == [(1, "stop", VIDEO, "ok")]
    field.until(10)
    assert field.answers()[1:] == [(2, "start", VIDEO, "ok")]


@pytest.mark.parametrize("hops", [1, 3])
def test_an_order_goes_over_hops_and_a_hop_that_is_stopped_still_hands_it_on(hops: int) -> None:
    field = Outside((1.0, "stop", "hop1"), (2.0, "stop", "base"), hops=hops).until(4)
    assert field.answers() == [(1, "stop", "hop1", "ok"), (2, "stop", "base", "ok")]
    assert field.count("hop1") == field.count("base") == -1
    assert len(field.frames("carried", src="hop1", dst="base")) == 1


def test_a_hop_is_down() -> None:
    """All beyond it are silent, those before it are not; when it is back, all answer."""
    field = Outside(hops=3).until(1)
    field.kill("hop2")
    field.type("status")
    field.until(2 + 2 * GIVEN_UP_NS / NS)
    assert sorted(field.lines()) == [
        "base silent", "camera-control running", "end", "hop1 silent", "hop2 silent", "hop3 running", "video running"
    ]  # fmt: skip
    field.start("hop2")
    field.type("#again status")
    field.until(20)
    again = [line.removeprefix("#again ") for line in field.lines() if line.startswith("#again ")]
    assert again[-1] == "end"
    assert sorted(again[:-1]) == sorted(f"{id} running" for id in field.managed)


def test_orders_to_many_go_at_once_and_those_to_one_after_each_other() -> None:
    field = Outside().until(1)
    for line in ("stop video", "start video", f"stop {CONTROL}", "status video"):
        field.type(line)
    assert [(one.dst, one.message.number) for one in field.frames("order")] == [(VIDEO, 1), (CONTROL, 2)]
    field.until(3)
    assert field.lines() == ["video stopped", f"{CONTROL} stopped", "video running", "video running"]


def test_a_forged_order_does_not_spoil_the_operators_own() -> None:
    """Its refusal goes to the operator, under whose name it came, and is no answer to the order that is on its way."""
    field = Outside(STOP_VIDEO)
    field.until(1.0 + DELAY_NS / 2 / NS)
    genuine = order_for(VIDEO, 1, STOP, bytes.fromhex(KEY))
    forged = order_for(VIDEO, 1, STOP, bytes(16))
    assert genuine != forged
    field.inject(VIDEO, forged, SYSTEM)
    field.until(3)
    assert field.answers() == [(1, "stop", VIDEO, "ok")]
    assert field.refused() == [(VIDEO, SYSTEM, "wrong authentication")]
    assert field.reasons(SYSTEM) == ["forged"]


def test_in_a_whole_field_what_is_stopped_does_not_work_and_what_is_started_again_does(tmp_path: Path) -> None:
    """A shot without video; the base and camera control live twice, and the rest is as if they had not."""
    orders = [[3, "stop", "video"], [8, "stop", "base"], [10, "start", "base"], [20, "start", "video"],
              [21, "stop", CONTROL], [24, "start", CONTROL]]  # fmt: skip
    settings = ("sensor.waveform=false", "backbone.loss=0", f"camera.orders={json.dumps(orders)}")
    given = [word for one in settings for word in ("--set", one)]
    run = Run(tmp_path / "run", "yang-ecpa", "--virtual", "--set", "backbone.model=fixed", *given)
    code, said = run.finish()
    assert code == 0, said
    told = json.loads((run.folder / "camera.json").read_text())
    assert [[one["verb"], one["id"], one["answer"]] for one in told["orders"]] == [[*one[1:], "ok"] for one in orders]
    shots = [one["shot"] for one in told["aims"] if one["outcome"] == "aimed"]
    assert shots[:2] == [1, 2]  # the second is by camera control's second life
    assert {one["shot"] for one in told["exposures"]} == set(shots[1:])
    assert run.metrics()["frames"]["by_role"].keys() >= {"sink", "gateway"}  # of roles inside of what takes orders
