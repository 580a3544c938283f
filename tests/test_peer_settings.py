"""Runs in which any node may lead, with other settings: members that filter, heads that do not stick, radios."""

from __future__ import annotations

from typing import Any

import pytest

from head.peers.choice import by_distance
from tests.ether import ORIGIN_NS
from tests.peered import BASE, MANNERS, Field, Manner, field_of, grid
from tests.puppet import MS
from tests.test_peer_clocks import SYNC
from tests.test_peer_stories import square
from trackfield.role import NS


def elections(field: Field) -> int:
    return len([why for *_, why in field.begun() if why == "elected"])


@pytest.mark.parametrize(
    ("hands", "always_on"), [("gaussian", True), ("modes", False), ("modes", True), ("particles", False)]
)
@pytest.mark.parametrize("manner", MANNERS)
def test_whatever_is_handed_over_and_however_nodes_listen(manner: Manner, always_on: bool, hands: str) -> None:
    field = field_of(manner, hands=hands, always_on=always_on).to_step(25)
    assert field.follows_well(5, 25)
    assert elections(field) == 1
    assert len(field.begun()) >= 4


def test_a_head_that_does_not_stick_is_the_nearest_of_those_that_measure() -> None:
    field = field_of("location-central", sticky=False)
    for step in range(6, 26):
        field.to_step(step)
        head = field.header(field.leader())
        assert head.leads is not None
        bank = field.actors[BASE].role.bank
        x, y = field.target(float(step + 1)) or (0.0, 0.0)
        order = by_distance(bank, head.leads.chosen, [x, y])  # type: ignore[arg-type]
        assert field.leader() in order[:2]  # the nearest of those that listen
    assert elections(field) == 1
    sticky = field_of("location-central").to_step(25)
    assert len(field.begun()) >= len(sticky.begun())


@pytest.mark.parametrize("every", [1, 3])
@pytest.mark.parametrize("manner", MANNERS)
def test_a_base_over_a_tree_is_told_at_its_steps(manner: Manner, every: int) -> None:
    field = field_of(manner, base=BASE, base_every=every, always_on=True).to_step(20)
    kind = "result" if manner == "location-central" else "estimate"
    told = [one.message.step for one in field.frames(kind, dst=BASE, since=4)]
    assert told == [step for step in range(4, 21) if step % every == 1 % every]


@pytest.mark.parametrize("manner", MANNERS)
def test_clocks_that_are_off_are_set_before_the_first_step(manner: Manner) -> None:
    ahead = {f"n{number:02}": (number * 137 % 11 - 5) * 100 * MS for number in range(16)}
    field = field_of(manner, sync=SYNC, ahead_ns=ahead).to_step(25)
    assert field.follows_well(5, 25)
    assert elections(field) == 1
    assert all(abs((one.t_ns - ORIGIN_NS) % NS - 970 * MS) < MS for one in field.frames("poll"))


@pytest.mark.parametrize("reach_m", [65.0, 100.0])
@pytest.mark.parametrize("manner", MANNERS)
def test_radios_that_reach_a_little_farther_than_sensors(manner: Manner, reach_m: float) -> None:
    field = field_of(manner, grid(10), reach_m=reach_m).to_step(40)
    assert field.follows_well(5, 40)
    assert all(
        len({p.term for _, id, p in field.points if p.step == step and id != BASE}) == 1 for step in range(5, 41)
    )


# --- members that filter ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("local", ["product", "intersection"])
def test_members_that_filter_send_what_they_conclude(local: str) -> None:
    field = field_of("elected", local=local).to_step(30)
    assert elections(field) == 1
    assert field.follows_well(6, 30, 3.0)
    asked = [one.message for one in field.frames("local-estimate", since=6)]
    assert len(asked) > 25
    assert all(len(field.used(step)) >= 2 for step in range(6, 31))


def local_square(**settings: Any) -> Field:
    return square("elected", local="product", **settings)


def test_what_one_concludes_and_is_lost_is_missed_in_its_step_only() -> None:
    field = local_square()
    field.rule("local-estimate", "n02", count=1)
    field.to_step(8)
    assert [field.used(step) for step in (6, 7)] == [("n00", "n01", "n03"), ("n00", "n01", "n02", "n03")]
    assert field.follows_well(5, 8)


def test_one_that_missed_the_last_estimate_hears_it_again_with_the_poll_or_sends_its_reading() -> None:
    field = local_square()
    field.rule("estimate", "n00", "n02", count=1)
    field.to_step(6, 100 * MS)
    assert len(field.frames("local-estimate", "n02", since=6)) == 1  # it has heard that of step 5
    field.to_step(7, 500 * MS)
    assert len(field.frames("local-estimate", "n02", since=7)) == 1
    field.rule("estimate", "n00", "n02")
    field.to_step(10, 500 * MS)
    assert field.frames("local-estimate", "n02", since=9) == []
    assert len(field.frames("range", "n02", "n00", since=9)) == 2
    assert field.follows_well(5, 10)
    assert field.used(10) == ("n00", "n01", "n02", "n03")
