"""How slaves find masters, frame by frame: who is asked, what if a frame is lost, who comes and goes."""

from __future__ import annotations

from itertools import pairwise

import pytest

from launcher.reproduce.papers.ozfidan.field import NOBODY, associated
from tests.clustered import ANNOUNCE_NS, ASSOCIATION, EAST, TURN_NS, around, field_of
from tests.ether import DELAY_NS, ORIGIN_NS, Net
from tests.puppet import MS
from trackfield.filters.rng import generator
from trackfield.protocols.association.joining import NO_PLACE
from trackfield.role import NS
from trackfield.wire.clusters import Admit, Announce, Join

MET = ORIGIN_NS - NS
"""All have a master by then who find one."""
LONELY = [(0.0, 0.0), (10.0, 0.0), (20.0, 0.0)]
"""Three slaves near the first of the masters."""


def joins(net: Net, slave: str) -> list[str]:
    """Whom a slave asked for a place, in order."""
    return [one.dst for one in net.frames("join", slave)]


# --- as the paper has it ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(30))
def test_without_losses_each_has_the_master_that_the_paper_gives_it(seed: int) -> None:
    """Table I: the nearest that has a place left, in the order of the slaves' numbers."""
    rng = generator(seed, "association")
    many, of, capacity = int(rng.integers(1, 8)), int(rng.integers(1, 31)), int(rng.integers(1, 6))
    masters, slaves = (rng.integers(0, 1000, (n, 2)).astype(float) for n in (many, of))
    net = field_of([*map(tuple, masters)], [*map(tuple, slaves)], prior=False, capacity=capacity).run(MET)
    expected = ["" if i == NOBODY else f"m{i}" for i in associated(masters, slaves, capacity)]
    assert [net.owner(f"s{i:02}") for i in range(of)] == expected
    for number in range(many):
        assert net.members(f"m{number}") == tuple(f"s{i:02}" for i, m in enumerate(expected) if m == f"m{number}")


def test_it_asks_in_its_turn_and_answers_are_for_all_to_hear() -> None:
    net = field_of(EAST, LONELY).run(MET)
    asked = [(one.src, one.dst, one.t_ns) for one in net.frames("join")]
    assert asked == [(f"s{i:02}", "m0", ANNOUNCE_NS + i * TURN_NS) for i in range(3)]
    answers = [(one.src, one.dst, one.t_ns, one.message) for one in net.frames("admit")]
    expected = [("m0", "*", at + DELAY_NS, Admit(i, i, 4 - i)) for i, (*_, at) in enumerate(asked)]
    assert answers == expected


def test_masters_announce_themselves_five_times_and_tell_each_other_their_lists_three_times() -> None:
    net = field_of(EAST, LONELY).run(MET)
    for number, (x, y) in enumerate(EAST):
        told = [one.message for one in net.frames("announce", f"m{number}")]
        assert told == [Announce(i, 5, 5, x, y) for i in range(1, 6)]
        assert len(net.frames("roster", f"m{number}")) == 3
    assert all(one.t_ns < ANNOUNCE_NS for one in net.frames("announce"))
    assert all(one.t_ns >= ASSOCIATION["setup_ns"] for one in net.frames("roster"))
    assert dict(net.state("m2").rosters) == {"m0": ("s00", "s01", "s02"), "m1": ()}


# --- frames are lost -------------------------------------------------------------------------------------------------


def test_a_master_whose_announcements_are_lost_is_not_known() -> None:
    net = field_of(before=lambda net: net.rule("announce", "m0", "s00")).run(MET)
    assert (net.owner("s00"), net.owner("s01")) == ("m1", "m0")


@pytest.mark.parametrize(("lost", "master"), [(2, "m0"), (3, "m1")])
def test_a_master_that_is_heard_less_than_half_of_the_time_is_not_asked(lost: int, master: str) -> None:
    net = field_of(before=lambda net: net.rule("announce", "m0", "s00", count=lost)).run(MET)
    assert net.owner("s00") == master


@pytest.mark.parametrize(("kind", "ends"), [("join", ("s00", "m0")), ("admit", ("m0", "s00"))])
def test_it_asks_up_to_three_times_and_then_the_next(kind: str, ends: tuple[str, str]) -> None:
    for lost, asked in ((1, ["m0"] * 2), (2, ["m0"] * 3), (3, ["m0", "m0", "m0", "m1"])):
        net = field_of(EAST, LONELY[:1], before=lambda net, lost=lost: net.rule(kind, *ends, count=lost))  # type: ignore[misc]
        net.run(MET)
        assert joins(net, "s00") == asked
        assert net.owner("s00") == asked[-1]
        times = [one.t_ns for one in net.frames("join", "s00")]
        assert {later - before for before, later in pairwise(times)} <= {70 * MS}


def test_whose_answer_was_lost_gets_the_same_place_again() -> None:
    net = field_of(before=lambda net: net.rule("admit", "m0", "s00", count=1)).run(MET)
    assert [one.message for one in net.frames("admit", "m0")[:2]] == [Admit(0, 0, 4)] * 2
    assert net.members("m0") == ("s00", "s01", "s02", "s03")
    assert net.state("s00").search.place == 0


def test_an_answer_that_comes_when_it_asks_another_is_not_taken() -> None:
    """The first master has it in its list, too, until it finds that it is silent."""
    net = field_of(before=lambda net: net.rule("admit", "m0", "s00", delays=(190 * MS,))).run(MET)
    assert net.owner("s00") == "m1"
    assert "outdated" in net.reasons("s00")


def test_an_overheard_answer_that_is_lost_costs_a_question() -> None:
    """Without it a slave does not know that the list is full: it asks, is refused, and asks the next."""
    net = field_of(EAST, LONELY, capacity=2, before=lambda net: net.rule("admit", "m0", "s02", count=2)).run(MET)
    assert joins(net, "s02") == ["m0", "m1"]
    assert net.frames("admit", "m0")[-1].message == Admit(2, NO_PLACE, 0)
    heard = field_of(EAST, LONELY, capacity=2).run(MET)
    assert joins(heard, "s02") == ["m1"]


def test_an_orphan_in_reach_of_nobody() -> None:
    net = field_of(before=lambda net: net.rule("announce", None, "s00")).run(MET)
    assert (net.owner("s00"), joins(net, "s00")) == ("", [])
    assert net.state("s00").phase.value == "orphan"


# --- too few places --------------------------------------------------------------------------------------------------


def test_those_for_whom_there_is_no_place_sleep_and_ask_again_every_ten_windows() -> None:
    net = field_of(EAST[:1], around(EAST[:1], 6), capacity=4).run(120 * NS)
    for orphan in ("s04", "s05"):
        assert net.state(orphan).phase.value == "orphan"
        assert net.actors[orphan].receiver.opening is False
        times = [one.t_ns for one in net.frames("solicit", orphan)]
        assert len(times) >= 10
        # Again after 10 s, more or less, and after the answers that it waits for.
        assert all(9 * NS <= later - before <= 11 * NS + 570 * MS for before, later in pairwise(times))


def test_an_orphan_takes_a_place_that_becomes_free() -> None:
    net = field_of(EAST[:1], around(EAST[:1], 5), capacity=4).to_step(0)
    assert net.owner("s04") == ""
    net.kill("s01")
    net.to_step(30)
    assert net.members("m0") == ("s00", "s02", "s03", "s04")
    assert net.state("s04").search.place == 1
    assert net.frames("announce", "m0")[-1].message == Announce(0, 0, 1, 0.0, 0.0)


def test_masters_for_one_slave_each() -> None:
    net = field_of(EAST, LONELY, capacity=1).run(MET)
    assert [net.owner(f"s{i:02}") for i in range(3)] == ["m0", "m1", "m2"]


# --- members come and go ---------------------------------------------------------------------------------------------


def test_a_report_renews_a_place() -> None:
    net = field_of().to_step(5)
    assert net.state("m0").members.list["s00"].heard == ORIGIN_NS + 5 * NS + DELAY_NS
    assert net.state("m1").members.list["s04"].heard < ORIGIN_NS


def test_a_member_that_does_not_report_for_five_steps_has_left_and_others_are_told() -> None:
    net = field_of().to_step(3)
    net.kill("s01")
    net.to_step(7)
    assert net.state("m0").members.list["s01"].silent == 4
    net.to_step(10)
    assert net.members("m0") == ("s00", "s02", "s03")
    assert net.state("m2").rosters["m0"] == ("s00", "s02", "s03")
    assert len(net.frames("roster", "m0", since=1)) == 3


def test_a_report_after_four_silent_steps_keeps_the_place() -> None:
    net = field_of().to_step(3)
    net.rule("range", "s01", "m0", count=4)
    net.to_step(20)
    assert "s01" in net.members("m0")
    assert net.state("m0").members.list["s01"].silent == 0


def test_it_renews_its_place_before_it_is_forgotten() -> None:
    net = field_of(joining={"renew_ns": 5 * NS}).to_step(30)
    asked = [one.t_ns for one in net.frames("join", "s11")]
    assert all(4.5 * NS <= later - before <= 5.5 * NS + 40 * MS for before, later in pairwise(asked))
    assert net.state("m2").members.list["s11"].heard >= ORIGIN_NS + 24 * NS


def test_one_whose_master_died_finds_another() -> None:
    net = field_of(joining={"renew_ns": 5 * NS}).to_step(3)
    net.kill("m2")
    net.to_step(12)
    assert net.owner("s08") == "m1"
    assert joins(net, "s08").count("m2") >= 3
    # It has room for one more; the others of m2 are with m0, or nowhere.
    assert sorted(net.owner(f"s{i:02}") for i in range(8, 12)) == ["", "", "m0", "m1"]


def test_who_has_not_been_heard_of_for_long_makes_room_though_it_was_not_told_to_report() -> None:
    """The slaves of a master far from the target are told nothing; those that died must not keep others out."""
    rules = {"joining": {"renew_ns": 5 * NS}, "association": {"keep_ns": 15 * NS}}
    net = field_of(EAST[:1], LONELY, capacity=2, target=lambda _: None, prior=False, **rules)  # type: ignore[arg-type]
    net.to_step(0)
    assert (net.members("m0"), net.owner("s02")) == (("s00", "s01"), "")
    net.kill("s00")
    net.to_step(10)
    assert net.owner("s02") == ""
    net.to_step(40)
    assert (net.members("m0"), net.owner("s02")) == (("s01", "s02"), "m0")


def test_a_master_that_is_started_again_keeps_its_list() -> None:
    net = field_of().to_step(3)
    places = {id: one.place for id, one in net.state("m1").members.list.items()}
    net.kill("m1")
    net.to_step(6)
    net.start("m1")
    assert {id: one.place for id, one in net.state("m1").members.list.items()} == places
    net.to_step(10)
    assert len(net.frames("roster", "m1", since=6)) == 3
    assert net.frames("announce", "m1", since=1) == []


@pytest.mark.parametrize("stored", [b"", b"\xc1", b"\x93\x01\x02\x03", b"\x93\x01\xc4\x00\x90"])
def test_a_list_that_cannot_be_read_is_left(stored: bytes) -> None:
    net = field_of().to_step(3)
    net.kill("m1")
    net.actors["m1"].stored = stored
    net.start("m1")
    assert net.members("m1") == ()
    assert any("cannot be used" in text for _, id, text in net.notes if id == "m1") == bool(stored)


@pytest.mark.parametrize(("message", "reason"), [(Join(5), "unknown sensor"), (Join(99), "unknown sensor")])
def test_a_number_that_is_another_ones_is_refused(message: Join, reason: str) -> None:
    net = field_of().run(MET)
    net.inject("m0", message, "s04")
    net.inject("m0", message, "nobody")
    assert net.reasons("m0")[-2:] == [reason, reason]
    assert net.members("m0") == ("s00", "s01", "s02", "s03")
