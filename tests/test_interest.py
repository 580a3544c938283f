"""Directed diffusion by stories: which message is lost, who dies, and what arrives all the same."""

from __future__ import annotations

import pytest

from tests.diffusing import CHAIN, DIAMOND, REACH_M, TASK, Field, asked, hops, way
from tests.puppet import MS

# --- nothing is lost -------------------------------------------------------------------------------------------------


def test_an_interest_spreads_and_data_comes_back() -> None:
    field = asked()
    assert [one.hops for id in "abc" for one in field.known(id)] == [1, 2, 3]
    assert [one.src for one in field.frames("interest")] == ["base", "a", "b", "c"]
    field.tell("c", 7)
    field.wait(1)
    assert field.got("base", "c") == [7]
    assert hops(field) == [("c", "b"), ("b", "a"), ("a", "base")]


def test_the_path_of_the_first_empty_message_is_reinforced() -> None:
    field = asked().wait(1)
    assert way(field) == ["c", "b", "a", "base"]
    origins = {one.message.origin for one in field.frames("data")}
    assert origins == {b"b", b"c"}, "who hears the sink itself needs no path"
    field.wait(10)
    again = {one.message.origin for one in field.frames("data") if one.t_ns > 2000 * MS}
    assert not again, "who has a path looks for no other"


def test_an_empty_message_only_goes_where_the_sink_may_be_reached() -> None:
    """``d`` is a dead end: it is further from the base than ``c``, which hands on no message for it."""
    field = asked({**CHAIN, "d": (120.0, 0.0), "e": (90.0, 30.0)}).wait(2)
    spread = [(one.src, one.message.origin) for one in field.frames("data")]
    assert ("b", b"c") in spread
    assert not [one for one in spread if one[0] == "d" and one[1] != b"d"]


def test_only_those_in_the_region_are_asked() -> None:
    field = Field(CHAIN, REACH_M)
    field.ask("base", x_m=90.0, radius_m=20.0)
    field.wait(1)
    assert [field.tell(id, 1) for id in "abc"] == [0, 0, 1]


def test_only_data_of_the_class_is_wanted() -> None:
    field = Field(CHAIN, REACH_M)
    field.ask("base", task=TASK + 1)
    assert not field.wait(1).known("a")


def test_an_interest_makes_no_more_hops_than_it_may() -> None:
    field = Field(CHAIN, REACH_M)
    field.ask("base", most_hops=2)
    field.wait(1)
    assert [len(field.known(id)) for id in "abc"] == [1, 1, 0]


def test_a_sink_in_the_region_is_a_source_of_its_own() -> None:
    field = asked()
    assert [(one.sink, one.hops) for one in field.known("base")] == [("base", 0)]
    field.tell("base", 3)
    assert field.got("base", "base") == [3]
    assert not hops(field)


def test_two_sinks_are_told_apart() -> None:
    field = asked()
    field.ask("c", number=1)
    field.wait(1)
    assert sorted(one.sink for one in field.known("b")) == ["base", "c"]
    field.tell("b", 5)
    field.wait(1)
    assert field.got("base", "b") == field.got("c", "b") == [5]


def test_two_interests_of_a_sink_are_two() -> None:
    field = asked()
    field.ask("base", number=2)
    assert field.wait(1).tell("c", 5) == 2
    assert field.wait(1).got("base") == [5, 5]


def test_an_interest_that_changes_is_the_new_one_at_once() -> None:
    field = asked()
    field.ask("base", x_m=0.0, radius_m=10.0)
    assert not field.wait(1).known("c")


# --- interests are lost ----------------------------------------------------------------------------------------------


def test_an_interest_comes_with_the_next_refresh_if_a_copy_is_lost() -> None:
    field = Field(CHAIN, REACH_M)
    field.rule("interest", "a", "b", count=1)
    field.ask("base")
    assert not field.wait(2.9).known("b")
    assert field.wait(0.4).known("b")


def test_an_interest_comes_by_another_neighbour_if_a_copy_is_lost() -> None:
    field = Field(DIAMOND, REACH_M, sources=())
    field.rule("interest", "a", "c")
    field.ask("base")
    field.wait(1)
    field.tell("c", 1)
    assert field.wait(1).got("base") == [1]
    assert hops(field) == [("c", "b"), ("b", "base")]


@pytest.mark.parametrize(("lost", "gone_s"), [(1, ()), (2, (7, 8, 9)), (3, (7, 8, 9, 10, 11, 12))])
def test_a_gradient_expires_when_two_refreshes_are_missed(lost: int, gone_s: tuple[int, ...]) -> None:
    """A copy came within .2 s; refreshes follow every 3 s, and the second is missed .75 s after it was due."""
    field = Field(CHAIN, REACH_M)
    field.ask("base")
    field.wait(0.2).rule("interest", "b", "c", count=lost)
    seen = dict[int, int]()
    for second in range(1, 14):
        field.run(second * 1000 * MS)
        seen[second] = field.tell("c", second)
    assert seen == {second: second not in gone_s for second in range(1, 14)}
    field.wait(1)
    assert field.got("base") == [second for second in range(1, 14) if second not in gone_s]


def test_when_a_sink_dies_all_forget_what_it_wanted() -> None:
    field = asked()
    field.kill("base")
    assert field.run(6500 * MS).known("c")
    field.run(7000 * MS)
    assert not any(field.known(id) for id in "abc")
    assert not any(field.tell(id, 1) for id in "abc")


def test_what_is_withdrawn_is_forgotten() -> None:
    field = asked()
    field.ask("base", number=2)
    field.wait(1).withdraw("base", 1)
    field.tell("c", 1)
    assert field.wait(1).got("base") == [1], "only under the interest that still holds"
    assert "outdated" in field.reasons("base")
    field.wait(6)
    assert [one.number for one in field.known("c")] == [2]


def test_a_partition_heals() -> None:
    field = asked()
    field.kill("b")
    field.run(8000 * MS)
    assert not field.tell("c", 1)
    field.start("b")
    field.run(10_000 * MS)
    assert field.tell("c", 2)
    field.wait(1)
    assert field.got("base") == [2]


def test_an_old_copy_does_not_bring_an_interest_back() -> None:
    field = asked()
    (old, *_) = field.frames("interest", "b")
    field.run(4000 * MS)
    before = field.state("c")
    field.inject("c", old.message, "b")
    assert field.state("c") == before
    assert field.reasons("c")[-1] == "outdated"
