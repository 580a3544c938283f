"""Who gets a place of a run whose processes start elsewhere: those that ask, join and are there, whatever others do."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import msgpack
import pytest
import zenoh

from launcher.plan.prepare import load, planned
from launcher.processes.alarms import Alarms
from launcher.processes.places.open_registry import LEAD_S, OpenRegistry
from tests.running import until
from trackfield.drivers.exchange.intake import Refusals
from trackfield.drivers.exchange.seal import Seal
from trackfield.drivers.joining.ask import JoinError, TokenError
from trackfield.drivers.joining.claim import claim
from trackfield.drivers.joining.join import Joined, confirm, join, token
from trackfield.drivers.session import open_client, open_router
from trackfield.wire import keys

SECRET = b"secret"
PLACES = ["n000", "n001", "n002", "n003"]


class Run:
    """A launcher's registry of four nodes and a centre, and what others do beside it."""

    def __init__(self, endpoint: str, token: bytes) -> None:
        self._endpoint = endpoint
        self._token = token
        self.alarms = Alarms()
        self.plan = planned(load("spcpf", nodes=4), 1.0)
        self.registry = OpenRegistry(self.plan, Seal(token), self.alarms, self.plan.ids)
        self.launcher = self.session()
        self.registry.declare(self.launcher)
        with self.session() as other:  # the router knows of it only a moment later
            for key in (keys.CLAIM, keys.asked_by(keys.JOIN, "n000"), keys.asked_by(keys.CONFIRM, "n000")):
                asking = other.declare_querier(key)
                until(lambda asking=asking: asking.matching_status.matching)

    def session(self) -> zenoh.Session:
        return open_client(self._endpoint, self.plan.run.run)

    @contextmanager
    def guest(self, place: str = "", host: str = "h", token: bytes | None = None) -> Iterator[Guest]:
        session = self.session()
        try:
            yield Guest(session, place, host, Seal(self._token if token is None else token))
        finally:
            session.close()  # type: ignore[no-untyped-call]

    def asked(self) -> set[str]:
        """Who is there after asking, which may have to be repeated while somebody leaves."""
        self.registry.refresh(self.launcher)
        return self.registry.live

    def alarm(self, kind: str) -> int:
        return self.alarms.counts[kind]


class Guest:
    """A process that asks for a place, step by step."""

    def __init__(self, session: zenoh.Session, place: str, host: str, seal: Seal) -> None:
        self.session, self.seal, self._host, self._refused = session, seal, host, Refusals()
        self.name = claim(session, "node", host, place, seal, self._refused)
        self.joined: Joined | None = None

    def join(self) -> Guest:
        self.joined = join(self.session, self.name, "node.role:Node", self.seal, self._refused)
        return self

    def appear(self) -> Guest:
        assert self.joined is not None
        self.held = self.session.liveliness().declare_token(token(self.name, self.joined.ticket, self.seal))
        return self

    def confirm(self) -> None:
        assert self.joined is not None
        confirm(self.session, self.name, self.joined.ticket, self._host, self.seal, self._refused)


@pytest.fixture
def endpoint(tmp_path: Path) -> Iterator[str]:
    endpoint = f"unixsock-stream/{tmp_path / 'r'}"
    with open_router(endpoint):
        yield endpoint


@pytest.fixture(params=[b"", SECRET], ids=["without", "with"])
def run(endpoint: str, request: pytest.FixtureRequest) -> Iterator[Run]:
    """With and without a token that all share."""
    run = Run(endpoint, request.param)
    with run.launcher:
        yield run


@pytest.fixture
def trusting(endpoint: str) -> Iterator[Run]:
    run = Run(endpoint, b"")
    with run.launcher:
        yield run


@pytest.fixture
def sealed(endpoint: str) -> Iterator[Run]:
    run = Run(endpoint, SECRET)
    with run.launcher:
        yield run


def test_who_claims_joins_and_is_there_has_the_place(run: Run) -> None:
    with run.guest(host="box") as guest:
        guest.join().appear().confirm()
        assert (guest.name, run.registry.live, run.registry.hosts) == ("n000", {"n000"}, {"n000": "box"})
    until(lambda: not run.registry.live)
    assert not run.alarms.counts


def test_asking_mends_what_notices_missed(run: Run) -> None:
    """Who is there although its token was said to be lost is back; who is gone without notice is gone."""
    with run.guest() as guest:
        ticket = guest.join().joined.ticket  # type: ignore[union-attr]
        guest.appear().confirm()
        run.registry._went(guest.name, ticket)
        until(lambda: run.asked() == {guest.name})
        with run.guest() as other:
            other.join().appear().confirm()
        until(lambda: run.registry.live == {guest.name})
        run.registry._add(other.name)
        until(lambda: run.asked() == {guest.name})


def test_claims_alone_keep_nobody_out(trusting: Run) -> None:
    """Thousands of them, and as many joins; then come four processes."""
    flood = trusting.session()
    for i in range(1000):
        question = msgpack.packb(["node", f"evil{i}", "", os.urandom(8)])
        name = msgpack.unpackb(next(r for r in flood.get(keys.CLAIM, payload=question)).ok.payload.to_bytes())["name"]
        list(flood.get(keys.asked_by(keys.JOIN, name), payload=msgpack.packb([name, os.urandom(8)])))
    with ExitStack() as stack:
        guests = [stack.enter_context(trusting.guest()) for _ in PLACES]
        for guest in guests:
            guest.join().appear().confirm()
        assert trusting.registry.live == set(PLACES)
        with pytest.raises(JoinError, match="every place of a node is taken"):
            trusting.guest().__enter__()
    flood.close()  # type: ignore[no-untyped-call]


@pytest.mark.parametrize("mark", ["", "/" + "0" * 48, "/x/y", "/" + "é" * 48], ids=["bare", "zeros", "deep", "odd"])
def test_forged_tokens_are_nobody(run: Run, mark: str) -> None:
    stranger = run.session()
    held = [stranger.liveliness().declare_token(f"live/{name}{mark}") for name in (*PLACES, "fusion")]
    until(lambda: run.alarm("tokens") == len(held))
    assert not run.registry.live
    with run.guest() as guest:
        guest.join().appear().confirm()
    stranger.close()  # type: ignore[no-untyped-call]


def test_a_ticket_is_good_for_the_name_that_joined_only(run: Run) -> None:
    with run.guest() as guest:
        guest.join()
        guest.name = "n003"
        guest.appear()
        until(lambda: run.alarm("tokens") == 1)
        assert not run.registry.live


def test_who_did_not_join_is_not_confirmed(run: Run) -> None:
    with run.guest() as guest:
        guest.join()
        guest.name = "n001"
        with pytest.raises(JoinError, match="no ticket of this run"):
            guest.confirm()


def test_a_living_id_is_refused_until_its_process_is_gone(run: Run) -> None:
    with run.guest("n003") as first:
        first.join().appear().confirm()
        with pytest.raises(JoinError, match=r"^n003 is taken: a process lives there$"), run.guest("n003"):
            pass
        with pytest.raises(JoinError, match=r"^n003 is taken: a process lives there$"), run.guest("n002") as other:
            other.name = "n003"
            other.join()
    until(lambda: not run.registry.live)
    with run.guest("n003") as second:
        second.join().appear().confirm()
    assert not run.alarms.counts


def test_of_two_that_joined_at_once_the_first_that_is_there_has_the_place(run: Run) -> None:
    with run.guest("n003") as one, run.guest("n003") as other:
        one.join()
        other.join()
        other.appear().confirm()
        one.appear()
        with pytest.raises(JoinError, match="n003 is taken: a process lives there"):
            one.confirm()
        assert run.registry.live == {"n003"}
    until(lambda: not run.registry.live)
    assert not run.alarms.counts  # both were asked to come


def test_a_second_token_for_a_living_process_is_an_alarm(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    with run.guest("n003") as kept, run.guest("n003") as first:
        kept.join()
        first.join().appear().confirm()
        monkeypatch.setattr("launcher.processes.places.open_registry.TICKET_S", 0.2)
        time.sleep(0.2)
        kept.appear()
        until(lambda: run.alarm("tokens") == 1)
    assert not run.alarm("questions")


def test_a_ticket_does_not_last(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("launcher.processes.places.open_registry.TICKET_S", 0.2)
    with run.guest() as guest:
        guest.join()
        time.sleep(0.2)
        guest.appear()
        with pytest.raises(JoinError, match="it took too long to start as n000"):
            guest.confirm()
        assert not run.registry.live
    assert not run.alarms.counts


def test_a_process_that_returns_is_the_same(run: Run) -> None:
    """Its connection was cut, or its router started again."""
    with run.guest() as guest:
        guest.join().appear().confirm()
        guest.held.undeclare()
        until(lambda: not run.registry.live)
        guest.appear()
        until(lambda: run.registry.live)
    assert not run.alarms.counts


def test_while_time_runs_another_is_the_next_life_and_claims_make_none(run: Run) -> None:
    with run.guest("n001") as guest:
        guest.join().appear().confirm()
        run.registry.start_ns = time.monotonic_ns() - 2_000_000_000
    until(lambda: not run.registry.live)
    for _ in range(100):
        with run.guest("n001") as asks:
            assert asks.name == "n001~1"
            asks.join()
    assert not run.registry.births
    with run.guest("n001", host="spare") as second:
        second.join().appear().confirm()
        [(before, life)] = run.registry.births
        assert second.joined is not None
        assert (before, life.name, run.registry.hosts["n001~1"]) == ("n001", "n001~1", "spare")
        assert 2_000_000_000 < life.start_ns == second.joined.process.start_ns
    assert not run.alarms.counts


def test_a_next_life_that_comes_after_its_beginning_is_refused(run: Run) -> None:
    with run.guest("n001") as guest:
        guest.join().appear().confirm()
        run.registry.start_ns = time.monotonic_ns()
    until(lambda: not run.registry.live)
    with run.guest("n001") as late:
        late.join()
        time.sleep(LEAD_S)
        late.appear()
        with pytest.raises(JoinError, match="it took too long to start as n001~1"):
            late.confirm()
    assert not run.registry.births
    assert not run.alarms.counts


# --- the token that all share ---------------------------------------------------------------------------------------


def test_without_the_runs_token_there_is_no_place(sealed: Run) -> None:
    with pytest.raises(
        JoinError, match="lacks the seal of this run: set TRACKFIELD_TOKEN as it is set for the launcher"
    ):
        sealed.guest(token=b"").__enter__()
    assert sealed.alarm("questions") == 1


def test_with_another_token_there_is_no_place(sealed: Run) -> None:
    with pytest.raises(TokenError, match="the answers lack the seal of the token in TRACKFIELD_TOKEN: the run was"):
        sealed.guest(token=b"other").__enter__()
    assert sealed.alarm("questions") > 0


def test_with_a_token_that_the_run_does_not_have_there_is_no_place(trusting: Run) -> None:
    with pytest.raises(TokenError, match="the answers lack the seal of the token in TRACKFIELD_TOKEN: the run was"):
        trusting.guest(token=b"other").__enter__()


def test_who_repeats_a_question_that_it_heard_gets_no_place(sealed: Run) -> None:
    """It learns the ticket, as anyone may; the token needs the seal."""
    question = msgpack.packb(["n000", b"12345678"])
    key = keys.asked_by(keys.JOIN, "n000")
    stamp = Seal(SECRET).stamp(f"{key}!{question.hex()}", question)
    with sealed.session() as session:
        [reply] = session.get(key, payload=question, attachment=stamp)
        ticket = msgpack.unpackb(reply.ok.payload.to_bytes())["ticket"]
        for mark in (ticket, ticket + 32 * "0"):
            held = session.liveliness().declare_token(keys.live("n000", mark))
            until(lambda: sealed.alarm("tokens") >= 1)
            held.undeclare()
        until(lambda: sealed.alarm("tokens") == 2)
        assert not sealed.registry.live


def test_waiting_processes_cost_the_launcher_no_memory(sealed: Run) -> None:
    """They claim every second, for as long as the run goes."""
    with sealed.session() as session:
        refused, seal, sizes = Refusals(), Seal(SECRET), []
        for _ in range(3):
            for _ in range(100):
                claim(session, "node", "waiting", "", seal, refused)
            sizes.append(sum(len(key) for key in sealed.registry._seal._latest))
    assert sizes == [0, 0, 0]


# --- whatever is asked ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("key", [f"{keys.JOIN}/n000", keys.CLAIM, f"{keys.CONFIRM}/n000"])
def test_no_question_stops_the_launcher(trusting: Run, key: str) -> None:
    odd = [5, None, [], {}, "n000", ["n000"], ["n000", "x", "y", "z"], [1, 2, 3, b""], [[], {}, 0.5, b"x"], {"a": 1}]
    questions = [msgpack.packb(one) for one in odd] + [b"", b"\xc1", b"\x91" * 3000, b"\xff" * 500]
    questions.append(msgpack.packb(["node", "a" * 900, "", b"1"]))
    questions.append(msgpack.packb(["\x1b[31m", "\x1b[31m", "\x1b[31m", b"1"]))
    with trusting.session() as session:
        until(lambda: list(session.get(key, payload=b"")))  # the router knows who answers
        for question in questions:
            [reply] = session.get(key, payload=question)
            told = msgpack.unpackb(reply.ok.payload.to_bytes())
            assert set(told) in ({"refused"}, {"name"})
        list(session.get("control/*", payload=msgpack.packb(["n000", b"1"])))
        list(session.get(key))
    with trusting.guest() as guest:
        guest.join().appear().confirm()


def test_a_second_launcher_is_an_alarm_and_confuses_no_process(trusting: Run) -> None:
    with trusting.session() as stranger:
        held = stranger.liveliness().declare_token(keys.launcher(stranger.info.zid()))
        until(lambda: trusting.alarm("tokens") == 1)
        with pytest.raises(JoinError, match="2 launchers claim this run: somebody pretends to be one"):
            trusting.guest().__enter__()
        held.undeclare()
