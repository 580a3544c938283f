"""How a process comes to its place in a run."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import pytest
import zenoh
from zenoh.handlers import Callback

from trackfield.drivers import ask as asking
from trackfield.drivers.intake import Refusals
from trackfield.drivers.join import join
from trackfield.drivers.seal import Seal
from trackfield.drivers.session import open_client, open_router
from trackfield.drivers.spec import ProcessSpec, RunSpec
from trackfield.wire import keys

SEAL = Seal(b"a secret")
RUN = RunSpec("run", 1, 10, {"model": "ideal"})
NODE = ProcessSpec("n1", "node", "node.role:Node", x=3.0, y=4.0)


def test_a_question_that_got_lost_is_asked_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where thousands start at once, the launcher may never see one of their questions."""
    monkeypatch.setattr(asking, "ASK_TIMEOUT_S", 0.5)
    endpoint = f"unixsock-stream/{tmp_path / 'router.sock'}"
    asked: list[zenoh.Query] = []

    def answer(query: zenoh.Query) -> None:
        asked.append(query)  # and kept: a query that is dropped unanswered would end at once
        if len(asked) > 1:
            payload = {"run": asdict(RUN), "process": NODE.plain(), "start_ns": None, "stored": None}
            asking.answer(query, payload, SEAL)

    with open_router(endpoint), open_client(endpoint, "run") as launcher, open_client(endpoint, "run") as process:
        held = launcher.declare_queryable(keys.JOIN, Callback(answer, indirect=False))
        joined = join(process, "n1", NODE.factory, SEAL, Refusals())
        held.undeclare()  # type: ignore[no-untyped-call]
    assert (joined.run.run, joined.process) == ("run", NODE)
    assert [query.payload.to_string() for query in asked if query.payload] == ["n1", "n1"]
