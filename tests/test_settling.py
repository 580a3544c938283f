"""Whether a field has settled: two waves of answers in which nothing is under way, and nobody is behind."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from typing import Any

import msgpack
import pytest

from launcher.processes import patience
from launcher.processes.settling import Answer, Settling, answer_of
from trackfield.drivers.process import LAST_WAVE
from trackfield.drivers.spec import ProcessSpec
from trackfield.role import NEIGHBOURHOOD
from trackfield.wire.error import WireError

HUB, ONE, TWO = (ProcessSpec(id, "toy", "", cells=("c0",)) for id in ("hub", "t00", "t01"))


@pytest.fixture(autouse=True)
def _impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(patience, "SETTLE_S", 0.3)
    monkeypatch.setattr(patience, "WAVE_S", 0.001)


class Field:
    """Processes that answer each wave by what they have put and got, which a test changes at some of the waves."""

    def __init__(self, *lives: ProcessSpec) -> None:
        self.all = {life.name: life for life in lives}
        self.lives = dict(self.all)
        self.settling = Settling(self.all)
        self.puts: dict[str, dict[str, int]] = {life.name: {} for life in lives}
        self.came: dict[str, int] = dict.fromkeys(self.all, 0)
        self.behind: set[str] = set()
        self.waves: list[int] = []
        self.deeds: dict[int, Callable[[], object]] = {}

    def last_word(self, name: str) -> None:
        """It ends, and answers for the last time."""
        self.settling.take(name, Answer(LAST_WAVE, self.came[name], dict(self.puts[name])))
        del self.lives[name]

    def settle(self) -> set[str]:
        return self.settling.wait(lambda: self.lives, self._ask)

    def _ask(self, wave: int) -> None:
        self.waves.append(wave)
        self.deeds.get(wave, lambda: None)()
        for name in self.lives.keys() - self.behind:
            self.settling.take(name, Answer(wave, self.came[name], dict(self.puts[name])))


def sent(field: Field, name: str, to: str, count: int, hearers: Iterable[str] = ()) -> None:
    """It puts so many, which come to all of the hearers at once."""
    field.puts[name][to] = field.puts[name].get(to, 0) + count
    for hearer in hearers:
        field.came[hearer] += count


def test_a_field_in_which_all_came_settles_in_two_waves() -> None:
    """One is not enough: what came is only known to have come before all told what they put if it was told before."""
    field = Field(HUB, ONE, TWO)
    sent(field, "t00", "hub", 3, ["hub"])
    sent(field, "hub", "t00", 2, ["t00"])
    sent(field, "hub", NEIGHBOURHOOD, 5, ["t00", "t01"])
    assert field.settle() == set()
    assert field.waves == [1, 2]


def test_what_is_put_between_two_waves_begins_again() -> None:
    """It came and was answered at once: puts and receipts match in the second wave, but not with those of the first."""
    field = Field(HUB, ONE)

    def talk() -> None:
        sent(field, "t00", "hub", 1, ["hub"])
        sent(field, "hub", "t00", 1, ["t00"])

    field.deeds = {2: talk, 3: talk}
    assert field.settle() == set()
    assert field.waves == [1, 2, 3, 4]


def test_a_put_under_way_is_waited_for() -> None:
    field = Field(HUB, ONE)
    sent(field, "t00", "hub", 3, ["hub"])
    sent(field, "t00", "hub", 1)
    field.deeds = {5: lambda: field.came.update(hub=4)}
    assert field.settle() == set()
    assert field.waves[-1] == 6


def test_a_put_that_never_comes_is_waited_for_a_while_and_told() -> None:
    field = Field(HUB, ONE, TWO)
    sent(field, "t00", "hub", 1)
    assert field.settle() == {"hub"}


def test_a_process_that_is_behind_is_waited_for() -> None:
    """It does not answer, and what it said of an earlier wave does not count for the present one."""
    field = Field(HUB, ONE)
    field.deeds = {2: lambda: field.behind.add("t00")}
    assert field.settle() == {"t00"}
    assert field.waves == [1, 2]


def test_one_that_never_answered_has_not_settled() -> None:
    field = Field(HUB, ONE)
    field.behind = {"hub", "t00"}
    assert field.settle() == {"hub", "t00"}


# --- broadcasts -------------------------------------------------------------------------------------------------------


def test_broadcasts_count_for_those_who_listen_to_their_cell() -> None:
    """Of t01, in a cell of its own, hub hears all and t00 nothing; what hub says goes to t00, not to itself."""
    far = replace(TWO, cell="c1", cells=("c1",))
    field = Field(replace(HUB, cells=("c0", "c1")), ONE, far)
    sent(field, "t01", NEIGHBOURHOOD, 7, ["hub"])
    sent(field, "hub", NEIGHBOURHOOD, 2, ["t00"])
    assert field.settle() == set()
    sent(field, "t01", NEIGHBOURHOOD, 1)
    assert field.settle() == {"hub"}


def test_nobody_waits_for_its_own_broadcasts_or_those_of_its_other_lives() -> None:
    before, after = replace(ONE, kill_ns=5), replace(ONE, incarnation=1, start_ns=5)
    field = Field(HUB, before, after)
    sent(field, "t00", NEIGHBOURHOOD, 3, ["hub"])
    sent(field, "t00~1", NEIGHBOURHOOD, 4, ["hub"])
    field.last_word("t00")
    assert field.settle() == set()
    assert field.waves == [1, 2]


# --- deaths -----------------------------------------------------------------------------------------------------------


def test_what_a_killed_life_has_put_is_waited_for() -> None:
    field = Field(HUB, ONE)
    sent(field, "t00", "hub", 2, ["hub"])
    sent(field, "t00", "hub", 1)
    field.last_word("t00")
    assert field.settle() == {"hub"}
    field.deeds = {field.waves[-1] + 2: lambda: field.came.update(hub=3)}
    assert field.settle() == set()


def test_what_a_killed_life_has_broadcast_is_waited_for_too() -> None:
    """What came of it stands for nothing that others have put."""
    field = Field(HUB, ONE, TWO)
    sent(field, "t00", NEIGHBOURHOOD, 2, ["hub", "t01"])
    field.last_word("t00")
    sent(field, "t01", "hub", 1)
    assert field.settle() == {"hub"}


def test_what_was_put_for_those_who_died_is_not_waited_for() -> None:
    field = Field(HUB, ONE, TWO)
    sent(field, "hub", "t00", 4)
    sent(field, "hub", NEIGHBOURHOOD, 2, ["t01"])
    field.last_word("t00")
    assert field.settle() == set()


def test_one_that_dies_meanwhile_is_not_waited_for() -> None:
    field = Field(HUB, ONE)
    field.behind = {"t00"}
    field.deeds = {1: lambda: field.lives.pop("t00")}
    assert field.settle() == set()


def test_an_empty_field_has_settled() -> None:
    assert Field().settle() == set()


# --- what lives say ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "said",
    [b"", b"\xc1", 1, [], [1, 2, {}], [1, 2, {}, True, 3], ["1", 2, {}, True], [1, 2.0, {}, True], [True, 2, {}, True],
     [1, 2, [], True], [1, 2, {}, 1], [1, 2, {1: 1}, True], [1, 2, {"hub": "1"}, True], [1, 2, {"hub": None}, True]],
)  # fmt: skip
def test_what_is_no_answer_is_refused(said: Any) -> None:
    with pytest.raises(WireError):
        answer_of(said if isinstance(said, bytes) else msgpack.packb(said))


def test_an_answer_is_read() -> None:
    puts: Mapping[str, int] = {"hub": 3, NEIGHBOURHOOD: 1}
    assert answer_of(msgpack.packb([7, 5, puts, True])) == Answer(7, 5, puts, behind=True)
