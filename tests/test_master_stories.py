"""Stories of masters: for each message of the protocol one in which it is lost, and what follows."""

from __future__ import annotations

import pytest

from head.leading import MOST_SILENT
from tests.clustered import BEACON_NS, DEADLINE_NS, EAST, HANDOVER_NS, SLOT_NS, around, field_of
from tests.ether import DELAY_NS, ORIGIN_NS, Net, Place
from tests.puppet import MS
from trackfield.protocols.association.admitting import MOST_SILENT as MOST_SILENT_SLAVE
from trackfield.role import NS
from trackfield.wire.clusters import Wake

HANDS = 17
"""At this step the target is nearer to the second master than to the first."""
PAIR: tuple[Place, ...] = ((0.0, 0.0), (199.0, 0.0), (199.0, 8.0))
"""Two masters that are nearer to the target from the step before that on: m2 a little more so than m1."""


def few(**options: object) -> Net:
    """A field of two slaves for each master, in which a leader asks the next one, too."""
    return field_of(EAST, around(EAST, 2), capacity=2, policy="merge_until_3", **options)  # type: ignore[arg-type]


def used(net: Net, step: int) -> tuple[str, ...]:
    """Whose reports the track of a step is from."""
    point = net.track(step)
    return () if point is None else point.sensors


def follows_well(net: Net, first: int, last: int, within_m: float = 1.0) -> bool:
    return all(net.error_m(step) < within_m for step in range(first, last + 1))


def test_nothing_is_lost() -> None:
    """The first leads, hands over when the second is nearer, and so on; each step has one track, of all four slaves."""
    net = field_of().to_step(60)
    terms = [(text.split()[0], text.split()[4]) for _, _, text in net.notes if " leads in term " in text]
    assert terms == [("m0", "1:"), ("m1", "2:"), ("m2", "3:")]
    assert follows_well(net, 1, 60, 0.1)
    assert all(len(used(net, step)) == 4 for step in range(1, 61))
    assert [point.step for _, _, point in net.points if _ != "base"] == list(range(1, 61))
    assert not [why for _, id, why in net.ignored if not id.startswith("s")]


# --- announce, solicit, roster ----------------------------------------------------------------------------------------


def test_a_master_whose_announcements_are_lost_does_not_set_the_clock_of_others() -> None:
    sync = {"exchanges": 1, "resync_ns": 60 * NS, "timeout_ns": 100 * MS, "seed": 1, "id": "any", "reference": "base"}

    def rules(net: Net) -> None:
        net.rule("announce", "m1", "m2")
        net.rule("announce", "base", "m2", count=3)

    asked = field_of(sync=sync).state("m2").references, field_of(sync=sync).to_step(0).state("m2").references
    assert asked == ((), ("base", "m0", "m1"))
    assert field_of(sync=sync, before=rules).to_step(0).state("m2").references == ("m0",)


def test_a_solicitation_that_is_lost_is_made_again_ten_windows_later() -> None:
    net = field_of(before=lambda net: net.rule("announce", None, "s00", count=20))
    net.rule("solicit", "s00", count=len(net.actors))
    net.run(40 * NS)
    first, second = (one.t_ns for one in net.frames("solicit", "s00"))
    assert 9 * NS < second - first < 11.6 * NS
    assert net.owner("s00") == "m0"


@pytest.mark.parametrize(("lost", "leader"), [(2, "m1"), (3, "m0")])
def test_a_master_whose_lists_are_lost_is_not_handed_the_track(lost: int, leader: str) -> None:
    """Told three times, it takes three losses; the others go on without it."""
    net = field_of(before=lambda net: net.rule("roster", "m1", "m0", count=lost)).to_step(25)
    assert net.leader() == leader
    assert follows_well(net, 1, 25)
    assert net.to_step(60).leader() == "m2"


# --- wake, report, no-target ------------------------------------------------------------------------------------------


def test_a_slave_that_misses_its_beacon_is_woken_by_the_next() -> None:
    net = field_of(before=lambda net: net.rule("wake", "m0", "s01", count=1)).to_step(3)
    assert [used(net, step) for step in (1, 2)] == [("s00", "s02", "s03"), ("s00", "s01", "s02", "s03")]
    helped = few(before=lambda net: net.rule("wake", "m1", "s02", count=1)).to_step(3)
    assert [used(helped, step) for step in (1, 2)] == [("s00", "s01", "s03"), ("s00", "s01", "s02", "s03")]
    # A helper says so once, and again only as one of its slaves was silent.
    assert [one.t_ns for one in helped.frames("wake", "m1")] == [ORIGIN_NS + BEACON_NS + k * NS for k in (0, 1)]


def test_a_report_that_is_lost_is_missed_in_its_step_only() -> None:
    net = field_of().to_step(2)
    net.rule("range", "s02", count=1)
    net.to_step(5)
    assert [used(net, step) for step in (3, 4)] == [("s00", "s01", "s03"), ("s00", "s01", "s02", "s03")]
    assert follows_well(net, 1, 4)


@pytest.mark.parametrize("lost", [MOST_SILENT_SLAVE - 1, MOST_SILENT_SLAVE])
def test_one_that_senses_no_target_says_so_or_is_taken_for_gone(lost: int) -> None:
    net = field_of(range_m=60.0, target=lambda t: (min(20.0 + 5.0 * t, 45.0), 5.0)).to_step(8)
    assert net.frames("no-target", "s00", since=8)  # it is 75 m away
    net.rule("no-target", "s00", "m0", count=lost)
    net.to_step(9 + lost)
    assert ("s00" in net.members("m0")) == (lost < MOST_SILENT_SLAVE)
    assert not [why for why in net.reasons("m0") if why != "foreign"]


# --- merge, aggregate -------------------------------------------------------------------------------------------------


def test_those_who_are_asked_send_what_their_slaves_report_after_their_slots() -> None:
    net = few().to_step(4)
    (merge,) = net.frames("merge", "m0", "m1")
    assert (merge.message.step, merge.message.steps, merge.message.slot) == (1, 10, 2)
    times = [one.t_ns for one in net.frames("aggregate", "m1", "m0")]
    assert times == [ORIGIN_NS + step * NS + 4 * SLOT_NS for step in (1, 2, 3, 4)]
    assert [used(net, step) for step in (1, 2, 3)] == [("s00", "s01", "s02", "s03")] * 3
    assert net.state("m1").phase.value == "helping"


def test_who_was_not_asked_as_the_message_was_lost_is_asked_again() -> None:
    net = few(before=lambda net: net.rule("merge", "m0", "m1", count=1)).to_step(4)
    assert [one.message.step for one in net.frames("merge", "m0", "m1")] == [1, 2]
    assert [len(used(net, step)) for step in (1, 2, 3)] == [2, 4, 4]


def test_what_is_lost_of_others_is_missed_in_its_step_and_they_are_asked_again() -> None:
    net = few().to_step(2)
    net.rule("aggregate", "m1", "m0", count=1)
    net.to_step(6)
    assert [len(used(net, step)) for step in (2, 3, 4, 5)] == [4, 2, 4, 4]
    assert [one.message.step for one in net.frames("merge", "m0", "m1")] == [1, 4]
    assert follows_well(net, 1, 6)


def test_one_that_is_silent_for_three_steps_is_left_alone_for_as_long_as_a_beacon_holds() -> None:
    net = few().to_step(2)
    net.rule("aggregate", "m1", "m0", count=MOST_SILENT)
    net.to_step(16)
    steps = [one.message.step for one in net.frames("merge", "m0", "m1") if one.message.steps]
    assert steps[:3] == [1, 4, 5]
    assert steps[3] == 4 + MOST_SILENT + 10
    others = [one.message.step for one in net.frames("merge", "m0", "m2") if one.message.steps]
    assert others[0] == 3 + MOST_SILENT + 1  # a step later somebody else is asked
    assert [len(used(net, step)) for step in (6, 7, 8)] == [2, 4, 4]
    assert net.frames("merge", "m0", "m1")[3].message.steps == 0


# --- hand-over --------------------------------------------------------------------------------------------------------


def test_a_hand_over_and_its_acknowledgement() -> None:
    net = field_of().to_step(HANDS)
    (over,), (ack,) = net.frames("hand-over"), net.frames("hand-over-ack")
    at_ns = ORIGIN_NS + HANDS * NS + DEADLINE_NS
    assert (over.t_ns, over.src, over.dst, over.message.number) == (at_ns, "m0", "m1", 2)
    assert (ack.t_ns, ack.src, ack.dst, ack.message.number) == (at_ns + DELAY_NS, "m1", "m0", 2)
    assert net.leader() == "m1"
    assert {one.src for one in net.frames("wake", since=HANDS)} == {"m0", "m1"}  # the old one says who leads


def test_a_hand_over_that_is_lost_goes_to_the_second_nominee() -> None:
    net = field_of(PAIR, around(PAIR)).to_step(HANDS - 2)
    net.rule("hand-over", "m0", "m2", count=1)
    net.to_step(HANDS)
    first, second = net.frames("hand-over")[:2]
    assert [(one.dst, one.message.number) for one in (first, second)] == [("m2", 2), ("m1", 3)]
    assert second.t_ns - first.t_ns == HANDOVER_NS
    assert follows_well(net.to_step(30), 1, 30)
    assert net.leader() == "m2"  # it is nearer, and answers when it is asked again


def test_without_a_second_nominee_it_goes_on_itself_and_tries_again_later() -> None:
    """The third master is farther from the target than the one that leads."""
    net = field_of().to_step(HANDS - 1)
    net.rule("hand-over", "m0", "m1", count=1)
    net.to_step(HANDS)
    assert net.leaders() == ["m0"]
    assert follows_well(net.to_step(30), 1, 30)
    assert [(one.dst, one.t_ns) for one in net.frames("hand-over")] == [
        ("m1", ORIGIN_NS + step * NS + DEADLINE_NS) for step in (HANDS, HANDS + 10)
    ]
    assert net.leader() == "m1"


@pytest.mark.parametrize("masters", [EAST, PAIR])
def test_a_dead_master_that_is_nearest_is_tried_again_and_again_while_others_track(masters: tuple[Place, ...]) -> None:
    dead = "m1" if masters is EAST else "m2"
    net = field_of(masters, around(masters)).to_step(10)
    net.kill(dead)
    net.to_step(35)
    assert follows_well(net, 1, 35, 10.0)
    assert len(net.leaders()) == 1
    blind = [step for step in range(HANDS, 36) if not used(net, step)]
    assert len(blind) <= 2
    assert len(net.frames("hand-over")) <= 6


def test_an_acknowledgement_that_is_lost() -> None:
    """Both lead for a while; the old one yields when it hears the new one."""
    net = field_of().to_step(HANDS - 1)
    net.rule("hand-over-ack", count=1)
    net.run(ORIGIN_NS + HANDS * NS + DEADLINE_NS + HANDOVER_NS + MS)
    assert net.leaders() == ["m0", "m1"]
    net.to_step(HANDS)
    assert net.leaders() == ["m1"]
    assert follows_well(net.to_step(30), 1, 30)
    assert any("yields to m1, term 2" in text for *_, text in net.notes)


def test_an_acknowledgement_that_is_lost_where_the_old_leader_still_speaks() -> None:
    """What it shares is of a term that is over: the new leader tells it so."""
    net = field_of(PAIR, around(PAIR)).to_step(HANDS - 2)
    net.rule("hand-over-ack", "m2", "m0", count=1)
    net.run(ORIGIN_NS + (HANDS - 1) * NS + DEADLINE_NS + 2 * DELAY_NS)
    assert [(one.src, one.message.number) for one in net.frames("alive", dst="m0")] == [("m2", 2)]
    assert net.leaders() == ["m2"]
    assert follows_well(net.to_step(30), 1, 30)
    assert len(net.frames("hand-over")) == 1


def test_an_acknowledgement_that_is_lost_and_a_second_nominee() -> None:
    """It is asked in a higher term, and the first one yields to it."""
    net = field_of(PAIR, around(PAIR)).to_step(HANDS - 2)
    net.rule("hand-over-ack", "m2", "m0", count=1)
    net.rule("alive", "m2", "m0", count=1)  # by which the new leader answers what the old one shares
    net.to_step(HANDS - 1)
    assert net.leaders() == ["m1"]
    assert any("m2 leads in term 2" in text for *_, text in net.notes)
    assert any("yields to m1, term 3" in text for _, id, text in net.notes if id == "m2")
    assert follows_well(net.to_step(30), 1, 30)
    assert net.leaders() == ["m2"]


def test_a_hand_over_that_comes_twice_is_acknowledged_twice_and_one_leads() -> None:
    net = field_of().to_step(HANDS - 1)
    net.rule("hand-over", count=1, delays=(0, 30 * MS))
    net.to_step(HANDS)
    assert len(net.frames("hand-over-ack")) == 2
    assert net.leaders() == ["m1"]
    assert "outdated" in net.reasons("m0")
    assert follows_well(net.to_step(30), 1, 30)


def test_a_hand_over_that_comes_late_is_outdated_if_another_leads_by_then() -> None:
    net = field_of(PAIR, around(PAIR)).to_step(HANDS - 2)
    net.rule("hand-over", "m0", "m2", count=1, delays=(580 * MS,))
    net.to_step(HANDS)
    assert "outdated" in net.reasons("m2")
    assert follows_well(net.to_step(30), 1, 30)
    assert len(net.leaders()) == 1


def test_a_hand_over_that_comes_late_is_taken_if_nobody_else_leads() -> None:
    net = field_of().to_step(HANDS - 1)
    net.rule("hand-over", count=1, delays=(400 * MS,))
    net.to_step(HANDS)
    assert net.leaders() == ["m1"]
    assert follows_well(net.to_step(30), 1, 30)


def test_who_helped_stops_when_another_leads_that_did_not_ask_it() -> None:
    net = few().to_step(4)
    assert net.state("m1").wanted.leader == "m0"
    net.inject("m1", Wake(2, b"m2", 5, 0, 0, b""), "m2")
    net.kill("m0")
    net.to_step(7)
    assert net.frames("aggregate", "m1", since=5) == []
    assert net.frames("range", "s02", since=6) == []  # its slaves are told so by the next beacon
    assert net.state("m1").phase.value == "following"


# --- share, led-track -------------------------------------------------------------------------------------------------


def test_who_missed_what_was_shared_takes_over_with_an_older_belief() -> None:
    net = field_of().to_step(4)
    net.rule("share")
    net.to_step(8)
    assert {net.state(id).known.step for id in ("m1", "m2")} == {4}
    net.kill("m0")
    net.to_step(16)
    assert net.leader() == "m1"
    assert follows_well(net, 13, 16, 5.0)


def test_the_base_predicts_what_it_is_not_told() -> None:
    """It publishes when the leader does, so it knows of the step before, or of the last one that it was told of."""
    net = field_of().to_step(4)
    net.rule("led-track", count=3)
    net.run(ORIGIN_NS + 7 * NS + DEADLINE_NS + 2 * DELAY_NS)
    assert net.state("base").told.step == 4
    net.to_step(12)
    for step in range(2, 13):
        point = net.track(step, "base")
        assert point is not None
        assert (point.status, point.origin, point.term) == ("coasting", "m0", 1)
        assert abs(point.mean[0] - (20.0 + 5.0 * step)) < 1.0
    spreads = [net.track(step, "base").covariance[0] for step in (5, 6, 7, 8, 9)]  # type: ignore[union-attr]
    assert spreads[0] < spreads[1] < spreads[2] < spreads[3] > spreads[4]
