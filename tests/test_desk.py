"""Who gets which slice of a field: those that ask, show a token, and go."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import msgpack
import pytest
from hypothesis import given
from hypothesis import strategies as st
from setproctitle import getproctitle

from launcher.plan.prepare import load, planned
from launcher.processes.alarms import Alarms
from launcher.processes.places.claims import GRACE_S
from launcher.processes.places.desk import KEPT, Desk, Question, facts
from launcher.processes.places.slices import Slices, bears_ns, own_version
from launcher.processes.preload import preload_of
from launcher.slices import member
from launcher.slices.asking import Asking, Given, Share, TakenError, _life, _sensor
from launcher.slices.roles import ROLES, factory, own_places
from tests.running import until
from trackfield.drivers.exchange.seal import Seal
from trackfield.drivers.joining.ask import RefusedError
from trackfield.drivers.joining.claim import claim
from trackfield.drivers.session import open_client, open_router
from trackfield.drivers.spec import ProcessSpec
from trackfield.errors import ScenarioError
from trackfield.wire import keys

FIELD = [ProcessSpec(f"n{i}", "node", "node.role:Node", x=10.0 * i) for i in range(6)]


def asked(which: str = "1", of: str = "2", host: str = "a", version: str = "1") -> Question:
    return Question(which, of, host, version)


def desk(certified: int | None = None) -> Desk:
    return Desk(FIELD, "1", certified)


def test_a_number_is_given_to_the_first_host_that_shows_its_token() -> None:
    """Both ask, and neither keeps the other out by that."""
    it = desk()
    assert it.offer(asked(host="a"), 0) == it.offer(asked(host="b"), 0) == (1, 2)
    assert [life.id for life in it.lives(1, 2, None)] == ["n0", "n1", "n2"]
    assert it.came(1, 2, "b's", 1)
    assert not it.came(1, 2, "a's", 1)
    assert it.confirm(1, 2, "b's", "b") == ""
    assert it.lives_there(1, "b's")
    assert not it.lives_there(1, "a's")
    assert it.confirm(1, 2, "a's", "a") == it.offer(asked(host="a"), 1) == "slice 1/2 is taken: b has it"


def test_engines_that_count_from_0_and_from_1_have_the_same_slices() -> None:
    it = desk()
    assert [it.offer(asked(which), 0) for which in ("0", "1", "2")] == [(2, 2), (1, 2), (2, 2)]


def test_auto_gives_what_is_free_and_a_host_its_own_again() -> None:
    it = desk()
    first, second = (it.offer(asked("auto", host=host), 0) for host in "ab")
    assert (first, second) == ((1, 2), (2, 2))
    for number, host in ((1, "a"), (2, "b")):
        assert it.came(number, 2, host, 0)
        it.confirm(number, 2, host, host)
    assert it.offer(asked("auto", host="c"), 1) == "all 2 slices are taken"
    for number, host in ((1, "a"), (2, "b")):
        assert it.went(number, host, 2)
    assert it.offer(asked("auto", host="b"), 3) == (2, 2)
    assert it.offer(asked("auto", host="c"), 3) == "all 2 slices are taken"
    assert it.offer(asked("auto", host="c"), 3 + GRACE_S) == (1, 2)


def test_the_first_slice_says_how_many_there_are_until_none_lives() -> None:
    """Who only asks decides nothing, nor does who comes later."""
    it = desk()
    assert it.offer(asked("1", "3"), 0) == (1, 3)
    assert it.offer(asked("1", "2"), 0) == (1, 2)
    assert it.came(1, 3, "t", 0)
    assert not it.came(1, 2, "u", 0)
    assert it.confirm(1, 2, "u", "b") == "this run has 3 slices, not 2"
    for which in ("1", "auto"):
        with pytest.raises(LookupError, match=r"^this run has 3 slices, not 2$"):
            it.offer(asked(which, "2"), 0)
    assert it.went(1, "t", 1)
    assert it.offer(asked("1", "2"), 2) == (1, 2)
    assert it.came(2, 2, "v", 2)
    assert it.lost(2, 0).ids == ("n3", "n4", "n5")


def test_few_divisions_are_remembered() -> None:
    """However many ask for other numbers of slices; the one that holds is not forgotten."""
    it = desk()
    it.offer(asked(of="2"), 0)
    it.came(1, 2, "t", 0)
    it.went(1, "t", 0)
    for _ in range(3):
        for of in "3456":
            it.offer(asked(of=of), 0)
    assert len(it._divisions) <= KEPT + 2
    assert it.came(1, 2, "t", 1)


@pytest.mark.parametrize(
    ("question", "says"),
    [
        (asked(version="2"), "this run is of Trackfield 1, the slice of 2"),
        (asked("3"), "there is no slice 3 of 2: they count from 1, or from 0"),
        (asked("-1"), "the slice is '-1': expected a whole number"),
        (asked("1", "0"), "the number of slices: is 0; expected 1 to 6, as many as there are processes on the field"),
        (asked("1", "7"), "the number of slices: is 7; expected 1 to 6, as many as there are processes on the field"),
        (asked("1", "²"), "the number of slices is '²': expected a whole number"),
        (asked("1", "1" * 7), "the number of slices is '1111111': expected a whole number"),
    ],
)
def test_what_can_never_be_is_refused(question: Question, says: str) -> None:
    with pytest.raises(LookupError) as refused:
        desk().offer(question, 0)
    assert str(refused.value) == says


def test_a_run_whose_field_starts_with_it_has_none() -> None:
    with pytest.raises(LookupError, match=r"^this run has no processes for slices: .* without --field external$"):
        Desk([], "1").offer(asked(), 0)


def test_processes_that_others_start_are_in_no_slice() -> None:
    plan = planned(load("spcpf", nodes=9, settings=["run.external=['n004']"]), 1.0)
    assert {life.id for life in plan.in_slices} == plan.in_field - {"n004"}


def test_a_secured_run_has_the_slices_of_its_certificates() -> None:
    with pytest.raises(LookupError, match=r"^this run has certificates of 3 slices, not of 2: trackfield certificates"):
        desk(3).offer(asked(), 0)
    with pytest.raises(LookupError, match=r"^this run has no certificates of slices, not of 2"):
        desk(0).offer(asked(), 0)
    assert desk(2).offer(asked(), 0) == (1, 2)


def test_who_is_gone_is_named_with_its_host() -> None:
    it = desk()
    it.offer(asked(), 0)
    it.came(1, 2, "t", 0)
    it.confirm(1, 2, "t", "box")
    assert not it.went(1, "another's", 1)
    assert it.went(1, "t", 1)
    assert not it.went(1, "t", 1)
    assert it.lost(1, 7).why == "slice 1/2 on box died, or cannot be reached"
    it.leaves(1, "another's")
    assert it.lost(1, 7).why.endswith("died, or cannot be reached")
    it.leaves(1, "t")
    lost = it.lost(1, 7)
    assert (lost.why, lost.since_ns, lost.ids) == ("slice 1/2 on box left", 7, ("n0", "n1", "n2"))


def test_who_is_missing_is_named_by_slices() -> None:
    it = desk()
    assert it.missing({"n0", "n5"}) == []
    it.offer(asked(), 0)
    assert it.missing({"n0", "n5"}) == []
    it.came(2, 2, "t", 0)
    assert it.missing({"n0", "n3", "n4", "n5", "fusion"}) == ["slice 1/2 missing: n0", "slice 2/2 missing: n3..n5"]
    it.went(2, "t", 0)
    it.came(1, 1, "t", 0)
    assert it.missing({life.name for life in FIELD}) == ["slice 1/1 missing: n0..n5"]


def test_lives_that_are_over_are_not_started_again() -> None:
    first = replace(FIELD[0], kill_ns=5)
    it = Desk([first, replace(first, incarnation=1, start_ns=9, kill_ns=None), *FIELD[1:]], "1")
    assert [life.name for life in it.lives(1, 2, None)] == ["n0", "n0~1", "n1", "n2"]
    assert [life.name for life in it.lives(1, 2, 4)] == ["n0", "n0~1", "n1", "n2"]
    assert [life.name for life in it.lives(1, 2, 5)] == ["n0~1", "n1", "n2"]


NUMBERS = st.integers(1, 3)
STEPS = st.lists(st.tuples(st.sampled_from(["came", "went", "leaves"]), NUMBERS, st.sampled_from("xyz")), max_size=30)


@given(STEPS)
def test_a_slice_has_one_holder_whatever_tokens_come_and_go(steps: list[tuple[str, int, str]]) -> None:
    """A token is its holder's until it goes; another that comes meanwhile has nothing, and takes nothing by going."""
    it = desk()
    holders: dict[int, str] = {}
    for word, number, ticket in steps:
        if word == "came":
            assert it.came(number, 3, ticket, 0) == (holders.setdefault(number, ticket) == ticket)
        elif word == "went":
            assert it.went(number, ticket, 0) == (holders.get(number) == ticket)
            if holders.get(number) == ticket:
                del holders[number]
        else:
            it.leaves(number, ticket)
    assert {(n, one.ticket) for n, one in it.slices.items() if one.live} == set(holders.items())


# --- what a slice is told ---------------------------------------------------------------------------------------------


PACKAGED = ("bus", "hall", "ozfidan-clusters", "radar", "yang-ecpa", "yu-mrbpf", "zhai-spcpf", "zhou-upf")


@pytest.mark.parametrize("scenario", PACKAGED)
def test_a_slice_makes_what_the_plan_has(scenario: str) -> None:
    """By the names of roles and kinds of sensing alone: the same factories, and what the zygotes load for them."""
    plan = planned(load(scenario), 1.0)
    field = plan.in_slices
    assert {life.id for life in field} == plan.in_field != set()
    told = msgpack.unpackb(msgpack.packb(facts(field)), use_list=False)
    sensors = [_sensor(*one) for one in told["sensors"]]
    lives = [_life(sensors, *life) for life in told["lives"]]
    for ours, theirs in zip(lives, field, strict=True):
        same = ("name", "id", "role", "factory", "sink", "kill_ns", "incarnation")
        assert [getattr(ours, name) for name in same] == [getattr(theirs, name) for name in same]
    assert preload_of(lives) == preload_of(field)


def test_a_zygote_rehearses_what_its_nodes_do(monkeypatch: pytest.MonkeyPatch) -> None:
    """A failure would be passed over there; its title stays its own."""
    claimed: list[str] = []

    def claiming(session: object, role: str, host: str, place: str, *rest: object, own: bool) -> str:
        claimed.append(place)
        return claim(session, role, host, place, *rest, own=own)  # type: ignore[arg-type]

    monkeypatch.setattr(member, "claim", claiming)
    title = getproctitle()
    member.rehearse()
    assert (claimed, getproctitle()) == (["n001"], title)


def test_roles_of_other_architectures_are_unknown() -> None:
    assert factory("node") == ROLES["node"]
    with pytest.raises(ScenarioError, match=r"role 'centre'.*trackfield\.drivers\.standalone"):
        factory("centre")


def test_classes_of_users_are_looked_for_among_installed_packages() -> None:
    assert own_places([]) == {}
    for kind in ("sensor", "tracker"):
        with pytest.raises(ScenarioError, match=rf"this run needs the {kind} 'sonar'.*not installed on this host"):
            own_places([f"{kind}:sonar"])


def test_a_clock_may_be_off_by_a_quarter_of_the_shortest_deadline() -> None:
    """And by less than frames may seem to be early, 50 ms: two hosts may be off to either side."""
    plan = planned(load("spcpf", nodes=4, settings=["fusion.deadline_s=0.08"]), 1.0)
    assert bears_ns(plan) == 20_000_000
    assert bears_ns(replace(plan, run=replace(plan.run, speed=10.0))) == 2_000_000
    assert bears_ns(replace(plan, run=replace(plan.run, speed=0.1))) == 25_000_000


# --- over Zenoh -------------------------------------------------------------------------------------------------------


class Told:
    """A launcher's desk at a router, and slices that ask there."""

    def __init__(self, endpoint: str, token: bytes) -> None:
        from launcher.processes.places.open_registry import OpenRegistry

        self._endpoint = endpoint
        self.plan = planned(load("spcpf", nodes=4), 1.0)
        self.alarms = Alarms()
        self.registry = OpenRegistry(self.plan, Seal(token), self.alarms, self.plan.in_field)
        self.launcher = open_client(endpoint, self.plan.run.run)
        self.registry.declare(self.launcher)
        self.session = open_client(endpoint, self.plan.run.run)
        asking = self.session.declare_querier(keys.SLICE)
        until(lambda: asking.matching_status.matching)

    @property
    def slices(self) -> Slices:
        return self.registry.slices

    def asking(self, host: str, token: bytes) -> Asking:
        return Asking(self.plan.run.run, host, Seal(token))

    def close(self) -> None:
        self.session.close()  # type: ignore[no-untyped-call]
        self.launcher.close()  # type: ignore[no-untyped-call]


@pytest.fixture(params=[b"", b"secret"], ids=["without", "with"])
def told(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[tuple[Told, bytes]]:
    endpoint = f"unixsock-stream/{tmp_path / 'r'}"
    with open_router(endpoint):
        told = Told(endpoint, request.param)
        yield told, request.param
        told.close()


def shown(told: Told, asking: Asking, given: Given) -> object:
    """The token of a slice."""
    return told.session.liveliness().declare_token(asking.token(given))


def test_a_slice_joins_shows_its_token_and_leaves(told: tuple[Told, bytes]) -> None:
    it, secret = told
    ours, theirs = it.asking("a", secret), it.asking("b", secret)
    given = ours.join(it.session, Share.parse("1/2"))
    assert (given.number, given.of, given.text, given.scenario) == (1, 2, "slice 1/2", "zhai-spcpf")
    assert [life.id for life in given.lives] == sorted(life.id for life in it.slices.desk.lives(1, 2, None))
    assert (given.start_ns, given.speed, given.end_ns) == (None, 1.0, it.plan.run.end_ns)
    other = theirs.join(it.session, Share.parse("1/2"))
    token = shown(it, ours, given)
    ours.confirm(it.session, given)
    with pytest.raises(TakenError, match=r"^slice 1/2 is taken: a has it$"):
        theirs.confirm(it.session, other)
    with pytest.raises(TakenError, match=r"^slice 1/2 is taken: a has it$"):
        theirs.join(it.session, Share.parse("1/2"))
    ours.leave(it.session, given)
    token.undeclare()  # type: ignore[attr-defined]
    until(lambda: it.slices.lost)
    assert it.slices.lost[1].why == "slice 1/2 on a left"
    token = shown(it, theirs, other)
    theirs.confirm(it.session, other)
    assert [lost.why for lost in it.slices.replaced] == ["slice 1/2 on a left"]
    assert not it.alarms.counts


def test_a_slice_that_comes_back_was_not_replaced(told: tuple[Told, bytes]) -> None:
    it, secret = told
    ours = it.asking("a", secret)
    given = ours.join(it.session, Share.parse("2/2"))
    token = shown(it, ours, given)
    ours.confirm(it.session, given)
    token.undeclare()  # type: ignore[attr-defined]
    until(lambda: it.slices.lost)
    token = shown(it, ours, given)
    until(lambda: not it.slices.lost)
    assert not it.slices.replaced


def test_a_token_without_a_ticket_is_an_alarm(told: tuple[Told, bytes]) -> None:
    it, _ = told
    names = ["1", "1/2/" + "0" * 48, "x/y", "²/2/" + "0" * 48, "1/2/3", "1/2", "0/0/" + "0" * 48]
    held = [it.session.liveliness().declare_token(f"{keys.SLICE}/{name}") for name in names]
    until(lambda: it.alarms.counts["tokens"] == len(held))
    assert not it.slices.desk.slices


def test_the_ticket_of_one_slice_is_none_of_another(told: tuple[Told, bytes]) -> None:
    it, secret = told
    ours = it.asking("a", secret)
    given = replace(ours.join(it.session, Share.parse("1/2")), number=2)
    with pytest.raises(RefusedError, match="no ticket of this run"):
        ours.confirm(it.session, given)


PLAN = planned(load("spcpf", nodes=4), 1.0)


@given(st.lists(st.one_of(st.text(), st.sampled_from(["join", "confirm", "leave", "1", "2", "auto", "²"])), min_size=6))
def test_whatever_is_asked_is_answered_or_refused(texts: list[str]) -> None:
    """And nobody has a slice by asking."""
    front = Slices(PLAN, Desk(FIELD, own_version()), Seal(), Alarms(), {})
    front.declare(NoSession(), lambda *_: None, lambda: {"start_ns": None, "end_ns": 1, "speed": 1.0})  # type: ignore[arg-type]
    for version in ("", own_version()):
        with suppress(LookupError):
            assert front._answer(*texts[:4], version or texts[4], texts[5])
    assert not front.desk.slices


class NoSession:
    """A session at which nothing is declared."""

    def declare_queryable(self, *_: object) -> None: ...

    def declare_subscriber(self, *_: object, **__: object) -> None: ...

    def liveliness(self) -> NoSession:
        return self


def test_a_run_that_goes_on_tells_since_when(told: tuple[Told, bytes]) -> None:
    it, secret = told
    it.registry.start_ns = 5
    given = it.asking("a", secret).join(it.session, Share.parse("auto/1"))
    assert given.start_ns == 5
    assert own_version().endswith("(wire 1)")
