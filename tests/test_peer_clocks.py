"""Clocks of nodes of which any may lead: set by those nearer to the base, jumping, and after a restart."""

from __future__ import annotations

from typing import Any

import pytest

from tests.ether import ORIGIN_NS
from tests.peered import BASE, MANNERS, SLOT_NS, WAKEUP, Manner, field_of, grid, member_of
from tests.puppet import MS
from tests.test_peer_stories import square
from trackfield.role import NS, Note, Started

SYNC = {"reference": BASE, "exchanges": 1, "resync_ns": 5 * NS, "timeout_ns": 100 * MS, "seed": 1}


@pytest.mark.parametrize("by_ns", [-400 * MS, 400 * MS, -3 * NS, 3 * NS])
@pytest.mark.parametrize("manner", MANNERS)
def test_the_clock_of_one_that_measures_jumps(manner: Manner, by_ns: int) -> None:
    field = square(manner, sync=SYNC)
    field.jump("n02", by_ns)
    field.to_step(16)
    assert field.follows_well(5, 16)
    assert len(field.leaders()) == 1
    assert "n02" in field.used(16)


@pytest.mark.parametrize("by_ns", [-400 * MS, 400 * MS, -3 * NS, 3 * NS])
@pytest.mark.parametrize("manner", MANNERS)
def test_the_clock_of_the_head_jumps(manner: Manner, by_ns: int) -> None:
    field = square(manner, sync=SYNC)
    field.jump("n00", by_ns)
    field.to_step(20)
    assert len(field.leaders()) == 1
    assert field.follows_well(16, 20)
    assert all(len(field.used(step)) >= 3 for step in range(18, 21))


@pytest.mark.parametrize("ahead_ns", [-300 * MS, 700 * MS])
def test_after_its_clock_was_set_it_listens_and_measures_by_the_right_time(ahead_ns: int) -> None:
    field = field_of("location-central", grid(2), sync=SYNC, ahead_ns={"n03": ahead_ns}).to_step(12)
    receiver: Any = field.actors["n03"].receiver.opening if field.header("n03").phase.value != "polled" else None
    reports = [one.t_ns for one in field.frames("range", "n03", since=2)]
    assert reports
    slots = {(t - ORIGIN_NS) % NS for t in reports}
    assert all(min(slot % SLOT_NS, SLOT_NS - slot % SLOT_NS) <= MS for slot in slots)
    assert max(slots) <= 4 * SLOT_NS
    if receiver is not None and not isinstance(receiver, bool):
        assert abs((receiver.from_ns - WAKEUP["from_ns"]) % NS) <= MS


def test_after_a_restart_it_asks_those_for_the_time_that_it_asked_before() -> None:
    """It has heard of them at the start only, and the base is out of reach."""
    field = field_of("location-central", grid(3), sync=SYNC, ahead_ns={"n05": 300 * MS}).to_step(3)
    before = field.member("n05").kept.references
    assert BASE not in before
    field.kill("n05")
    field.cut([BASE], ["n04", "n05"])
    field.start("n05")
    field.to_step(9)
    assert set(field.member("n05").kept.references) == set(before)
    assert abs(field.member("n05").time.correction_ns + 300 * MS) < MS


@pytest.mark.parametrize(
    "stored", [b"\xc1", b"\x01", b"\xa1x", b"\x91\x01", b"\x91\xa1 ", b"\x91\xc0", b"\x81\xa1x\x01"]
)
def test_stored_bytes_that_name_nobody_are_noted(stored: bytes) -> None:
    member = member_of(3, (30.0, 30.0), sync={**SYNC, "id": "n03"})
    state, effects = member.handle(member.begin(), Started(0, stored))
    assert any(isinstance(one, Note) and "cannot be used" in one.text for one in effects)
    assert state.kept.references == ()
