"""Who leads after whom, where any node may: heads that lose the target, die or come back, partitions."""

from __future__ import annotations

from dataclasses import replace

import pytest

from tests.ether import DELAY_NS, ORIGIN_NS, Place
from tests.peered import (
    DEADLINE_NS,
    LEASE_NS,
    MANNERS,
    TURN_NS,
    WORD_NS,
    Field,
    Manner,
    eastward,
    field_of,
)
from tests.puppet import MS
from trackfield.role import NEIGHBOURHOOD, NS, Send
from trackfield.wire.clusters import Alive
from trackfield.wire.peers import LocalEstimate, Poll

# --- dissolve, lease --------------------------------------------------------------------------------------------------


def lost_and_sensed_elsewhere(manner: Manner) -> tuple[Field, str]:
    """The target is gone after step 10; from step 14 on it is at the node that was polled last, far from the head."""
    calm = field_of(manner, target=eastward(until=10.5)).to_step(13, 100 * MS)
    head = calm.leader()
    who = max((id for id in calm.leads(head).asked), key=lambda id: calm.apart_m(id, head))
    x, y = calm.actors[who].place

    def target(t_s: float) -> Place | None:
        return eastward(until=10.5)(t_s) if t_s < 13.5 else (x - 3.0 + t_s - 14.0, y + 3.0)

    field = field_of(manner, target=target).to_step(13, 100 * MS)
    assert field.leader() == head
    return field, who


@pytest.mark.parametrize("manner", MANNERS)
def test_a_head_that_lost_the_target_says_so_and_who_senses_one_contends_at_once(manner: Manner) -> None:
    field, who = lost_and_sensed_elsewhere(manner)
    field.to_step(20)
    dissolve = field.frames("dissolve")[0]
    assert dissolve.t_ns == ORIGIN_NS + 13 * NS + DEADLINE_NS  # the third step without a report
    assert dissolve.message.lost == 1
    elected = [(id, t) for t, (id, _, why) in zip(field.began_ns(), field.begun(), strict=True) if why == "elected"]
    assert elected[1][0] == who
    assert 14 * NS < elected[1][1] < 15 * NS
    assert field.follows_well(19, 20, 3.0)


def unheard(manner: Manner) -> tuple[Field, str, str, int]:
    """Nobody hears that the track is lost, and then the head dies: who will sense the target, and its last word, ns."""
    field, who = lost_and_sensed_elsewhere(manner)
    old = field.leader()
    field.rule("dissolve", old)
    field.to_step(13)
    field.kill(old)  # it would sense the target itself, and knows that its term is over
    return field, who, old, field.frames("poll", old)[-1].t_ns + DELAY_NS - ORIGIN_NS


def test_if_nobody_hears_that_the_lease_must_run_out_first() -> None:
    field, who, _, last_ns = unheard("elected")
    field.to_step(24)
    assert field.begun()[3] == (who, 4, "elected")
    assert last_ns + LEASE_NS < field.began_ns()[3] < last_ns + LEASE_NS + 2 * NS
    assert field.follows_well(19, 24, 15.0)  # it goes on with what was known of the place that the target left


def test_if_nobody_hears_that_one_that_was_polled_takes_over_with_the_last_result() -> None:
    field, _, old, _ = unheard("location-central")
    field.to_step(24)
    assert field.begun()[3][1:] == (4, f"{old} is silent")
    assert 0 <= field.began_ns()[3] - 13 * NS - WORD_NS - TURN_NS <= 2 * TURN_NS
    assert field.follows_well(22, 24, 3.0)


def killed(manner: Manner, *more: str) -> tuple[Field, str]:
    """The head dies in the middle of its term, at the end of step 8, and so do others."""
    field = field_of(manner).to_step(8)
    head = field.leader()
    field.kill(head, *more)
    return field, head


@pytest.mark.parametrize(("dead", "heir"), [((), "n04"), (("n04",), "n05"), (("n04", "n05"), "n03")])
def test_a_head_that_dies_is_succeeded_in_the_same_step_by_the_nearest_that_lives(
    dead: tuple[str, ...], heir: str
) -> None:
    field, head = killed("location-central", *dead)
    field.to_step(14)
    assert field.begun()[2] == (heir, 3, f"{head} is silent")
    assert field.began_ns()[2] == 9 * NS + WORD_NS + (1 + len(dead)) * TURN_NS
    assert field.track(9) is not None
    assert field.used(9) == ()
    assert all(len(field.used(step)) >= 2 for step in range(11, 15))
    assert field.follows_well(9, 14, 2.0)


def test_the_heirs_share_what_was_said_last() -> None:
    """It goes on with the last result, so it is off by no more than that and a step of motion."""
    field, _ = killed("location-central")
    field.to_step(9)
    point = field.track(9)
    assert point is not None
    assert (point.term, point.status) == (3, "coasting")
    assert field.error_m(9) < 1.0


def test_an_elected_head_that_dies_is_missed_when_its_lease_is_over() -> None:
    field, _ = killed("elected")
    field.to_step(16)
    last_ns = 8 * NS + 970 * MS + DELAY_NS
    at_ns = field.began_ns()[3]
    assert field.begun()[3][1:] == (4, "elected")
    assert last_ns + LEASE_NS < at_ns < last_ns + LEASE_NS + 2 * NS
    assert field.follows_well(13, 16, 2.0)
    assert len(field.leaders()) == 1


# --- two heads --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("manner", MANNERS)
def test_a_partition_that_heals(manner: Manner) -> None:
    """Both rows of nodes have a head of their own; within two steps after that one yields, by its term."""
    field = field_of(manner).to_step(4)
    whole = field.reaches
    field.cut([id for id in field.nodes if int(id[1:]) % 2 == 0], [id for id in field.nodes if int(id[1:]) % 2])
    field.to_step(12)
    heads = field.leaders()
    assert len(heads) == 2
    terms = {id: field.header(id).held.term for id in heads}
    field.reaches = whole
    field.to_step(14)
    assert len(field.leaders()) == 1
    assert field.header(field.leader()).held.term >= max(terms.values())
    assert any("yields to" in text for t, _, text in field.notes if t > ORIGIN_NS + 12 * NS)
    assert field.follows_well(14, 20, 2.0) if field.to_step(20) else False
    assert len({field.header(id).held.term for id in field.leads(field.leader()).asked}) == 1


@pytest.mark.parametrize("manner", MANNERS)
def test_a_head_that_was_frozen_yields(manner: Manner) -> None:
    field = field_of(manner).to_step(8)
    head = field.leader()
    field.freeze(head, ORIGIN_NS + 14 * NS + 300 * MS)
    field.to_step(16)
    assert head not in field.leaders()
    assert len(field.leaders()) == 1
    assert field.follows_well(15, 20, 2.0) if field.to_step(20) else False


@pytest.mark.parametrize("manner", MANNERS)
def test_a_head_that_is_started_again_follows_the_next_one(manner: Manner) -> None:
    field, head = killed(manner)
    field.to_step(8, 1000 * MS)
    field.start(head)
    assert field.header(head).held.term == (field.begun()[-1][1], "")
    field.to_step(16)
    assert len(field.leaders()) == 1
    numbers = [number for _, number, _ in field.begun()]
    assert numbers == sorted(set(numbers))  # no term has two leaders
    assert field.follows_well(13, 16, 2.0)


# --- space ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("manner", MANNERS)
def test_children_out_of_reach_of_the_head_bring_no_second_head(manner: Manner) -> None:
    """Some that sense the target hear those that measure, but not the head: told that it lives, they contend no more.

    A head that is far from the target knows none that are nearer, so another one is elected there, and it yields.
    """
    field = field_of(manner, reach_m=45.0).to_step(13)
    assert len(field.leaders()) == 1
    began = len(field.begun())
    told = len(field.frames("alive"))
    for step in range(14, 30):
        assert len(field.to_step(step).leaders()) == 1
    assert all(why.endswith("hands over") for *_, why in field.begun()[began:])
    assert len(field.frames("alive")) > told if manner == "location-central" else True
    assert field.follows_well(3, 29, 3.0)


RING: tuple[Place, ...] = ((0.0, 0.0), (30.0, 0.0), (30.0, 30.0), (30.0, 60.0), (0.0, 60.0))
"""Nodes around a hole: the first and the last hear each other only over all between them."""


@pytest.mark.parametrize("manner", MANNERS)
def test_a_claim_is_relayed_around_a_hole(manner: Manner) -> None:
    """The target is sensed at both ends, which do not hear each other: one of them is elected."""
    field = field_of(manner, RING, target=lambda _: (-5.0, 28.0), reach_m=32.0, always_on=True).to_step(1)
    ends = {"n00", "n04"}
    assert {id for id in field.nodes if field.reading(id) is not None} >= ends
    assert not field.reaches("n00", "n04")
    assert field.begun() == [("n00", 1, "elected")]
    races = [field.header(id).race for id in field.nodes]
    assert {(race.number, race.best.id if race.best else "") for race in races} == {(1, "n00")}
    assert field.header("n04").race.outcome == "joined"


@pytest.mark.parametrize("manner", MANNERS)
def test_a_head_that_yields_says_what_it_knows(manner: Manner) -> None:
    """One that leads in a higher term without a track goes on with that; one that has a track does not."""
    field = field_of(manner).to_step(8)
    old = field.leader()
    new = next(id for id in field.nodes if id != old)
    header = field.actors[new].role.roles["header"]
    number, now = field.header(old).held.term.number + 5, field.local(new)
    yielded, effects = (
        field.actors[old]
        .role.roles["header"]
        .following.word(field.header(old), field.local(old), Poll(number, 9, b""), new)
    )
    (given,) = (one.message for one in effects if isinstance(one, Send) and isinstance(one.message, LocalEstimate))
    assert (yielded.leads, given.number, given.step) == (None, number, field.leads(old).progress.step)
    blind, _ = header.following._lead(field.header(new), now, number, None, 8, "it senses a target")
    assert header.bank.ahead(blind.leads.progress.tracks) is None
    sees, _ = header.leading.concluded(blind, now, given, old)
    known = header.bank.ahead(sees.leads.progress.tracks)
    assert known is not None
    assert abs(known[0].mean[0] - field.points[-1][2].mean[0]) < 6.0
    assert header.leading.concluded(sees, now, given, old)[0] == sees
    for useless in (replace(given, beliefs=b"no belief"), replace(given, number=number - 1), replace(given, step=60)):
        assert header.leading.concluded(blind, now, useless, old)[0] == blind


@pytest.mark.parametrize("manner", MANNERS)
def test_a_head_that_yields_to_one_that_it_did_not_hear_says_so_to_all(manner: Manner) -> None:
    """That one may be out of reach; whoever told of it is near."""
    field = field_of(manner).to_step(8)
    old = field.leader()
    told = Alive(field.header(old).held.term.number + 5, b"n99")
    following = field.actors[old].role.roles["header"].following
    yielded, effects = following.vouched(field.header(old), field.local(old), told, "n01")
    assert yielded.leads is None
    given = [one for one in effects if isinstance(one, Send) and isinstance(one.message, LocalEstimate)]
    assert [(one.to, one.message.number) for one in given] == [(NEIGHBOURHOOD, told.number)]
