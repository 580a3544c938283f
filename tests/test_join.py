"""How a process comes to its place in a run: whom it believes, and what it says if there is none for it."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

import msgpack
import pytest
import zenoh
from zenoh.handlers import Callback

from tests.running import until
from trackfield.drivers.exchange.intake import Refusals
from trackfield.drivers.exchange.seal import Seal
from trackfield.drivers.hostclock import host_id
from trackfield.drivers.joining import ask as asking
from trackfield.drivers.joining.ask import REFUSED, JoinError, TokenError, answer, question_of
from trackfield.drivers.joining.join import join
from trackfield.drivers.session import open_client, open_router
from trackfield.drivers.spec import ProcessSpec, RunSpec
from trackfield.wire import keys

RUN = RunSpec("run", 1, 10, {"model": "ideal"})
NODE = ProcessSpec("n1", "node", "node.role:Node", x=3.0, y=4.0)
TOLD = {"run": asdict(RUN), "process": NODE.plain(), "start_ns": None, "stored": None, "ticket": "abc"}
SECRET = b"secret"
JOIN = keys.asked_by(keys.JOIN, "n1")

Answers = Callable[[zenoh.Query], None]


def _give(key: str, told: dict[str, str], query: zenoh.Query) -> None:
    answer(query, key, told, Seal())


class Stage:
    """A router with a process that asks, and as many as wanted that answer it."""

    def __init__(self, endpoint: str) -> None:
        self.endpoint = endpoint
        self.process = self._session()
        self.refused = Refusals()

    def _session(self) -> zenoh.Session:
        return open_client(self.endpoint, "run")

    @contextmanager
    def answering(self, answers: Answers, *, launcher: bool = False, name: str = "") -> Iterator[None]:
        """Somebody answers who joins, as a ``launcher`` or not, and gives this ``name`` and the time to who claims."""
        with self._session() as session:
            held: list[Any] = [session.declare_queryable(JOIN, Callback(answers, indirect=False))]
            if name:
                for key, told in ((keys.CLAIM, {"name": name}), (keys.CLOCK, {"host": host_id()})):
                    gives = Callback(partial(_give, key, told), indirect=False)
                    held.append(session.declare_queryable(key, gives))
            if launcher:
                held.append(session.liveliness().declare_token(keys.launcher(session.info.zid())))
            ready = f"ready/{session.info.zid()}"
            held.append(session.liveliness().declare_token(ready))
            until(lambda: any(token.ok for token in self.process.liveliness().get(ready)))
            yield

    def join(self, token: bytes = b"") -> ProcessSpec:
        return join(self.process, "n1", NODE.factory, Seal(token), self.refused).process


@pytest.fixture
def stage(tmp_path: Path) -> Iterator[Stage]:
    endpoint = f"unixsock-stream/{tmp_path / 'r'}"
    with open_router(endpoint):
        stage = Stage(endpoint)
        with stage.process:
            yield stage


def telling(told: Any, token: bytes = b"") -> Answers:
    seal = Seal(token)
    return lambda query: answer(query, JOIN, told, seal)


OTHER = {**TOLD, "process": ProcessSpec("n1", "node", "node.role:Node", x=666.0).plain()}


def test_a_question_that_got_lost_is_asked_again(stage: Stage, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where thousands start at once, the launcher may never see one of their questions."""
    monkeypatch.setattr(asking, "ASK_TIMEOUT_S", 3.0)
    asked: list[zenoh.Query] = []
    questions: list[bytes] = []
    seal = Seal(SECRET)

    def answers(query: zenoh.Query) -> None:
        asked.append(query)  # and kept: a query that is dropped unanswered would end at once
        questions.append(question_of(query, JOIN, seal))
        if len(asked) > 1:
            answer(query, JOIN, TOLD, seal)

    with stage.answering(answers):
        assert stage.join(SECRET) == NODE
    assert len(questions) == 2
    assert len(set(questions)) == 1
    assert msgpack.unpackb(questions[0])[0] == "n1"


def test_it_believes_the_seal(stage: Stage) -> None:
    strangers = [telling(OTHER), telling(OTHER, b"guess")]
    with stage.answering(strangers[0]), stage.answering(strangers[1]), stage.answering(telling(TOLD, SECRET)):
        assert stage.join(SECRET) == NODE


def test_without_a_seal_it_believes_the_session_that_has_the_launchers_token(stage: Stage) -> None:
    with stage.answering(telling(OTHER)), stage.answering(telling(TOLD), launcher=True):
        assert stage.join() == NODE


def test_without_a_seal_two_launchers_are_none(stage: Stage) -> None:
    one, other = telling(OTHER), telling(TOLD)
    with (
        stage.answering(one, launcher=True),
        stage.answering(other, launcher=True),
        pytest.raises(JoinError, match="2 launchers claim this run: somebody pretends to be one"),
    ):
        stage.join()


@pytest.mark.parametrize("token", [b"", b"other"], ids=["none", "another"])
def test_another_token_is_one_message_that_names_the_variable(stage: Stage, token: bytes) -> None:
    says = "the answers lack the seal of the token in TRACKFIELD_TOKEN: the run was started with another one or without"
    with stage.answering(telling(TOLD, token), launcher=True), pytest.raises(TokenError, match=says):
        stage.join(SECRET)


def test_an_answer_to_another_question_is_none(stage: Stage) -> None:
    """One that was recorded when another process asked, with the run's seal."""
    recorded: list[zenoh.Sample] = []
    question = msgpack.packb(["n1", b"87654321"])
    with stage.answering(telling(TOLD, SECRET)):
        for reply in stage.process.get(JOIN, payload=question):
            assert reply.ok is not None
            recorded.append(reply.ok)

    def again(query: zenoh.Query) -> None:
        query.reply(JOIN, recorded[0].payload, attachment=recorded[0].attachment)

    with stage.answering(again), pytest.raises(TokenError):
        stage.join(SECRET)


def test_what_a_launcher_says_reaches_a_terminal_in_one_printable_line(stage: Stage) -> None:
    refusal = telling({REFUSED: "no\n\x1b[31m place" + 1000 * "!"})
    with stage.answering(refusal, launcher=True), pytest.raises(JoinError) as caught:
        stage.join()
    assert str(caught.value).startswith(r"no\n\x1b[31m place!")
    assert len(str(caught.value)) < 600


@pytest.mark.parametrize(
    "told",
    [
        5,
        {},
        {**TOLD, "ticket": None},
        {**TOLD, "ticket": "a/**"},
        {**TOLD, "ticket": ""},
        {**TOLD, "start_ns": "now"},
        {**TOLD, "stored": 1},
        {**TOLD, "stored": b"", "spent": 1},
        {**TOLD, "process": 1},
        {**TOLD, "run": {"run": "x"}},
    ],
)
def test_a_strange_answer_is_an_error_of_joining(stage: Stage, told: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(asking, "ANSWER_TIMEOUT_S", 0.5)
    with stage.answering(telling(told), launcher=True), pytest.raises(JoinError):
        stage.join()


def test_a_process_makes_its_own_role_whatever_it_is_told(stage: Stage) -> None:
    told = {**TOLD, "process": {**NODE.plain(), "factory": "subprocess:check_call"}}
    with stage.answering(telling(told), launcher=True):
        assert stage.join() == NODE


@pytest.mark.parametrize(
    "changed",
    [
        {"config": {"nonsense": 1}},
        {"config": {}},
        {"clock": {"x": 1}},
        {"sound": {"position": 1}},
        {"media": (5,)},
        {"cells": ("*", "**")},
        {"faults": (5,)},
    ],
    ids="-".join,
)
def test_a_launcher_of_another_version_is_one_message(stage: Stage, changed: dict[str, Any]) -> None:
    told = {**TOLD, "process": {**NODE.plain(), **changed}}
    with stage.answering(telling(told), launcher=True, name="n1"):
        command = [sys.executable, "-m", "node", "--connect", stage.endpoint, "--run", "run"]
        done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 1
    assert done.stderr.startswith(f"node: cannot join the run run through {stage.endpoint}: ")
    assert "makes no node here" in done.stderr
    assert done.stderr.count("\n") == 1
