"""Who leads after whom: take-overs, leaders that come back, partitions, targets that are lost and found."""

from __future__ import annotations

import pytest

from tests.clustered import BEACON_NS, EAST, around, eastward, field_of
from tests.ether import DELAY_NS, ORIGIN_NS, Net
from tests.puppet import MS
from tests.test_master_stories import few, follows_well, used
from trackfield.protocols.association.admitting import MOST_SILENT
from trackfield.role import NS
from trackfield.wire.clusters import Doubt, Wake
from trackfield.wire.messages import Range

TIMEOUT = 4
"""Steps, as fields have it."""
TURN_NS = 2 * DELAY_NS


def begun(net: Net) -> list[tuple[str, int, int]]:
    """Who began to lead, in which term and when (ns after step 0)."""
    said = [(t, text.split()) for t, _, text in net.notes if " leads in term " in text]
    return [(words[0], int(words[4].strip(":")), t - ORIGIN_NS) for t, words in said]


def both_led(net: Net, first: int, last: int) -> list[int]:
    """The steps at whose end more than one led."""
    return [step for step in range(first, last + 1) if len(net.to_step(step).leaders()) > 1]


# --- a leader dies ---------------------------------------------------------------------------------------------------


def test_the_first_leader_is_the_nearest_and_all_know_it() -> None:
    net = field_of().to_step(0, MS)
    assert {id: net.state(id).held.term for id in ("m0", "m1", "m2")} == dict.fromkeys(("m0", "m1", "m2"), (1, "m0"))
    assert [net.state(id).phase.value for id in ("m0", "m1", "m2")] == ["leading", "following", "following"]


def test_without_a_prior_nobody_leads() -> None:
    net = field_of(prior=False).to_step(5)
    assert (net.leaders(), net.points, net.state("m0").phase.value) == ([], [], "idle")


def test_when_a_leader_dies_its_heir_takes_over_after_the_timeout_and_goes_on() -> None:
    net = field_of().to_step(10)
    net.kill("m0")
    net.to_step(20)
    last_ns = 10 * NS + BEACON_NS + DELAY_NS  # its last beacon was heard then
    assert begun(net)[1:] == [("m1", 2, last_ns + TIMEOUT * NS + TURN_NS)]  # the others do not know better
    assert [one.src for one in net.frames("doubt")] == ["m1", "m2"]
    assert net.frames("alive") == []
    assert follows_well(net, 15, 20, 1.0)
    assert [len(used(net, step)) for step in (15, 16, 17)] == [0, 4, 4]  # the slaves of the dead one are not asked
    assert [net.state(id).held.term for id in ("m1", "m2")] == [(2, "m1")] * 2


def test_if_the_heir_is_dead_too_the_next_takes_over_two_turns_later() -> None:
    net = field_of().to_step(10)
    net.kill("m0", "m1")
    net.to_step(30)
    last_ns = 10 * NS + BEACON_NS + DELAY_NS
    assert begun(net)[1:] == [("m2", 2, last_ns + TIMEOUT * NS + 3 * TURN_NS)]  # it asks once more
    assert follows_well(net, 18, 30, 10.0)
    assert all(used(net, step) for step in range(18, 31))


def test_one_that_cannot_hear_the_leader_at_all_does_not_take_over() -> None:
    net = field_of(before=lambda net: setattr(net, "reaches", lambda src, dst: {src, dst} != {"m0", "m2"}))
    net.to_step(20)
    assert begun(net)[0][0] == "m0"
    assert len(begun(net)) == 2  # the second is the hand-over
    assert not any("is silent" in text for *_, text in net.notes)


def deaf(lost: int, *kinds: str) -> Net:
    """The second master misses so many beacons of the first, what is shared, and all messages of these kinds."""
    net = field_of().to_step(8)
    net.rule("wake", "m0", "m1", count=lost)
    net.rule("share", "m0", "m1", count=lost // 2)
    for kind in kinds:
        net.rule(kind)
    return net.to_step(14)


def test_one_that_does_not_hear_the_leader_asks_the_others_and_waits_on() -> None:
    assert deaf(TIMEOUT - 1).frames("doubt") == []
    net = deaf(TIMEOUT)
    assert [(one.src, one.message) for one in net.frames("doubt")] == [("m1", Doubt(1, b"m0"))]
    assert {one.src for one in net.frames("alive", dst="m1")} == {"m0", "m2"}
    assert net.leaders() == ["m0"]
    assert not any("is silent" in text for *_, text in net.notes)


@pytest.mark.parametrize("kind", ["doubt", "alive"])
def test_if_the_question_or_the_answers_are_lost_it_takes_over_and_the_other_yields(kind: str) -> None:
    net = deaf(TIMEOUT, kind)
    assert any("m1 leads in term 2: m0 is silent" in text for *_, text in net.notes)
    assert any("yields to m1, term 2" in text for _, id, text in net.notes if id == "m0")
    assert len(net.leaders()) == 1
    assert follows_well(net, 1, 13)


# --- leaders that come back ------------------------------------------------------------------------------------------


def test_a_frozen_leader_that_thaws_yields() -> None:
    net = field_of().to_step(8)
    net.freeze("m0", ORIGIN_NS + 16 * NS + 300 * MS)
    assert both_led(net, 13, 15) == [13, 14, 15]  # one of them does nothing
    net.to_step(16)
    assert net.leaders() == ["m1"]
    assert any("yields to m1, term 2" in text for _, id, text in net.notes if id == "m0")
    assert follows_well(net, 16, 30) if net.to_step(30) else False
    # What it publishes late of the steps it slept through is of the lower term.
    assert {point.term for _, id, point in net.points if id == "m0"} == {1}


def test_a_leader_that_is_started_again_follows() -> None:
    net = field_of().to_step(8)
    net.kill("m0")
    net.to_step(9)
    net.start("m0")
    net.to_step(30)
    assert [one[:2] for one in begun(net)] == [("m0", 1), ("m1", 2)]
    assert net.state("m0").held.term == (2, "m1")
    assert set(net.state("m0").rosters) == {"m1", "m2"}  # of which it would hear nothing, as they do not change
    assert follows_well(net, 16, 30, 1.0)


@pytest.mark.parametrize("heals", [16, 25])
def test_after_a_partition_the_higher_term_wins_within_a_step(heals: int) -> None:
    """Cut off are the leader with its slaves; the other side takes over."""
    net = field_of(target=eastward(speed=2.0)).to_step(8)
    side = {"m0", "s00", "s01", "s02", "s03", "base"}
    net.reaches = lambda src, dst: (src in side) == (dst in side)
    net.to_step(heals - 1)
    assert net.leaders() == ["m0", "m1"]
    assert {net.state(id).held.term.number for id in ("m0", "m1")} == {1, 2}
    net.reaches = lambda src, dst: True
    net.to_step(heals)
    assert net.leaders() == ["m1"]
    net.to_step(heals + 10)
    assert len(net.leaders()) == 1
    assert follows_well(net, heals + 3, heals + 10, 1.0)


def test_who_yields_hands_on_the_reports_that_it_has_not_used() -> None:
    """Between the reports and the deadline it hears of a higher term."""
    net = field_of().to_step(8)
    net.freeze("m1", ORIGIN_NS + 9 * NS)
    net.run(ORIGIN_NS + 9 * NS + 200 * MS)
    net.inject("m0", Wake(5, b"m1", 10, 0, 0, b""), "m1")
    (told,) = net.run(net.t_ns + 50 * MS).frames("aggregate", "m0")
    assert (told.dst, told.message.number, told.message.step) == ("m1", 5, 9)
    assert used(net.to_step(9), 9) == ()
    assert sorted(net.actors["m0"].role.leading.read(told.message.reports)) == ["s00", "s01", "s02", "s03"]


def test_of_two_that_take_over_at_once_the_one_with_the_higher_id_leads() -> None:
    """They do not hear each other in time, as both turns come within the delay of a frame."""
    net = field_of().to_step(7)
    net.rule("share", "m0", "m2")  # m2 does not know the heir of step 8
    net.to_step(8)
    net.kill("m0")
    net.rule("wake", "m1", "m2", count=1)
    net.rule("share", "m1", "m2", count=1)
    net.rule("alive", "m1", "m2", count=1)
    net.to_step(16)
    assert [one[:2] for one in begun(net)][1:3] == [("m1", 2), ("m2", 2)]
    assert any("yields to m2, term 2" in text for _, id, text in net.notes if id == "m1")
    assert len(net.leaders()) == 1


# --- targets are lost and found --------------------------------------------------------------------------------------


def vanishing(at_s: float = 8.0, back_s: float = 1e9) -> Net:
    """A target that slaves sense up to 120 m away, by themselves; it is gone for a while, and comes back elsewhere."""

    def target(t_s: float) -> tuple[float, float] | None:
        if t_s < back_s:
            return (20.0 + 3.0 * t_s, 5.0) if t_s < at_s else None
        return 380.0, 5.0

    return field_of(target=target, prior=False, range_m=120.0, unasked=True, lost_m=10.0)


def test_a_target_that_is_lost_ends_the_term_and_nobody_takes_over() -> None:
    net = vanishing().to_step(60)
    assert follows_well(net, 3, 7)
    assert net.leaders() == []
    assert [one[0] for one in begun(net)] == ["m0"]
    (over,) = [text for *_, text in net.notes if "has lost the target" in text]
    number = begun(net)[0][1]
    assert f"term {number} is over" in over
    assert {net.state(id).held.term for id in ("m0", "m1", "m2")} == {(number, "")}
    assert all(net.state(id).phase.value == "idle" for id in ("m0", "m1", "m2"))
    assert all(net.state(id).phase.value == "asleep" for id in net.actors if id[0] == "s")


@pytest.mark.parametrize("missed", ["m1", "m2"])
def test_nobody_takes_over_either_who_missed_that_the_term_is_over(missed: str) -> None:
    net = vanishing().to_step(8)
    net.rule("share", "m0", missed)
    net.to_step(80)
    assert net.leaders() == []
    assert not any("is silent" in text for *_, text in net.notes)


def test_a_term_that_is_over_does_not_come_back_by_an_old_beacon() -> None:
    net = vanishing().to_step(60)
    number = net.state("m1").held.term.number
    net.inject("m1", Wake(number, b"m0", 61, 0, 0, b""), "m2")
    assert not net.state("m1").held.watched
    assert net.state("m1").phase.value == "idle"


def test_a_target_that_appears_is_claimed_by_the_master_whose_slave_senses_it() -> None:
    net = vanishing(8.0, 70.0).to_step(80)
    assert begun(net)[-1][:2] == ("m2", 1 + begun(net)[-2][1])
    assert begun(net)[-1][2] == 70 * NS + DELAY_NS  # with the first report
    assert net.leaders() == ["m2"]
    assert follows_well(net, 75, 80, 5.0)


def test_several_that_sense_it_at_once_claim_and_the_highest_stays() -> None:
    """Masters that have not heard each other yet: within two steps there is one."""
    net = field_of(target=lambda t: (100.0, 5.0) if t >= 5.0 else None, prior=False, unasked=True, range_m=150.0)
    net.to_step(8)
    assert len(begun(net)) >= 1
    assert len(net.leaders()) == 1
    assert follows_well(net.to_step(15), 10, 15, 5.0)


def test_reports_that_nobody_asked_for_are_ignored_unless_they_are_wanted() -> None:
    net = field_of().to_step(3)
    net.inject("m1", Range(3, 100.0), "s04")
    assert net.reasons("m1")[-1] == "not asked"
    net.inject("m1", Range(3, 100.0), "s00")
    assert net.reasons("m1")[-1] == "foreign"


def test_a_report_unasked_goes_to_the_leader() -> None:
    net = field_of(unasked=True).to_step(3)
    leads = net.frames("aggregate", dst="m0")
    assert {one.src for one in leads} == {"m1", "m2"}
    assert net.leaders() == ["m0"]
    assert any("s04" in used(net, step) for step in (1, 2, 3))


# --- clusters of few slaves ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("own", [0, 1, 2])
def test_with_too_few_slaves_the_next_are_asked_until_three_measure(own: int) -> None:
    slaves = [*around(EAST[:1], own), *around(EAST[1:], 2)]
    net = field_of(EAST, slaves, capacity=2, policy="merge_until_3").to_step(8)
    assert len(net.members("m0")) == own
    assert all(len(used(net, step)) >= 3 for step in range(2, 9))
    assert follows_well(net, 1, 8)
    asked = {one.dst for one in net.frames("merge") if one.message.steps}
    assert asked == ({"m1", "m2"} if own == 0 else {"m1"})


def test_the_closest_alone_goes_blind_with_no_slaves_of_its_own() -> None:
    """As in the paper: only the slaves of the leader measure, of which there are none."""
    net = field_of(EAST, around(EAST[1:]), capacity=4).to_step(8)
    assert net.leaders() == ["m0"]
    assert {used(net, step) for step in range(1, 9)} == {()}


def test_when_all_slaves_of_the_leader_have_died_others_measure() -> None:
    net = field_of(policy="merge_until_3").to_step(8)
    net.kill("s00", "s01", "s02", "s03")
    net.to_step(20)
    assert net.members("m0") == ()
    assert [len(used(net, step)) for step in range(9, 9 + MOST_SILENT)] == [0] * MOST_SILENT
    assert all(len(used(net, step)) >= 3 for step in range(9 + MOST_SILENT + 1, 21))
    assert follows_well(net, 15, 20)


def test_more_slaves_than_places_leave_the_rest_out() -> None:
    net = field_of(EAST, around(EAST, 6), capacity=3, policy="merge_until_3").to_step(30)
    assert follows_well(net, 1, 30)
    assert sum(not net.owner(id) for id in net.actors if id[0] == "s") == 9


def test_a_leader_whose_clock_has_jumped_is_blind_until_it_hands_over() -> None:
    """Half a second ahead it takes each step before there are reports, and predicts what it knew."""
    net = few().to_step(8)
    net.jump("m0", 500 * MS)
    net.to_step(40)
    assert [one[:2] for one in begun(net)] == [("m0", 1), ("m1", 2)]
    assert all(used(net, step) == () for step in range(10, 22))
    assert all(len(used(net, step)) == 4 for step in range(25, 41))
    assert follows_well(net, 26, 40)
