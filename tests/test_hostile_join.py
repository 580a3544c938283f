"""Who answers in the launcher's place: a process never takes code, a place or a start from it."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import msgpack
import pytest
import zenoh
from zenoh.handlers import Callback

from tests.hostile import field
from tests.hostile.attack import SPEEDS
from tests.hostile.verdicts import Attacked, complaints
from tests.outside import router
from tests.running import METRICS, Run, until
from trackfield.wire import keys

__all__ = ["router"]
EVIL = (
    "subprocess:check_call",
    "os:system",
    "posix:system",
    "builtins:exec",
    "shutil:rmtree",
    "tests.hostile.bomb:Bomb",
)


class Impostor:
    """Answers every question for a place, in any run at this router, sooner than a launcher might.

    All roles and factories that it names would leave the file ``canary``, if a process took one of them. One that says
    that it is ``complete`` is asked alone, if the question is left to Zenoh's best choice; a ``silent`` one keeps each
    question open and does not answer.
    """

    def __init__(self, endpoint: str, canary: Path, *, complete: bool, silent: bool) -> None:
        self.asked = 0
        self._silent, self._unanswered = silent, list[zenoh.Query]()
        self._canary = canary
        self._session = zenoh.open(
            zenoh.Config.from_json5(json.dumps({"mode": "client", "connect": {"endpoints": [endpoint]}}))
        )
        self._held: list[Any] = [
            self._session.declare_queryable(key, Callback(answer, indirect=False), complete=complete)
            for key, answer in {"*/control/join/*": self._join, "*/control/claim": self._claim}.items()
        ]

    def pretend(self, run: str) -> None:
        """Be the launcher of a run that does not exist."""
        self._held.append(self._session.liveliness().declare_token(f"{run}/{keys.launcher(self._session.info.zid())}"))

    def close(self) -> None:
        self._session.close()  # type: ignore[no-untyped-call]

    def _join(self, query: zenoh.Query) -> None:
        if self._silent:
            self.asked += 1
            self._unanswered.append(query)
            return
        evil = EVIL[self.asked % len(EVIL)]
        self.asked += 1
        name = query.payload.to_string().partition("\n")[0] if query.payload else "n000"
        query.reply(query.key_expr, msgpack.packb(self._answer(name[:32], evil)))

    def _claim(self, query: zenoh.Query) -> None:
        self.asked += 1
        query.reply(query.key_expr, b"n000")

    def _answer(self, name: str, evil: str) -> dict[str, Any]:
        touch = ["touch", str(self._canary)]
        code = f"import pathlib; pathlib.Path({str(self._canary)!r}).touch()"
        config = {
            "subprocess:check_call": {"args": touch},
            "os:system": {"command": " ".join(touch)},
            "posix:system": {"command": " ".join(touch)},
            "builtins:exec": {"source": code},
            "shutil:rmtree": {"path": str(self._canary.parent / "precious")},
        }.get(evil, {})
        process = {
            "id": name, "role": evil, "factory": evil, "config": config, "x": 0.0, "y": 0.0,
            "sound": {"kind": evil, "factory": evil, "class": evil}, "media": ["field"], "cell": "c0", "cells": [],
            "incarnation": 0, "sink": False, "peers": {}, "start_ns": 0, "kill_ns": None, "clock": {}, "power": {},
            "freezes": [], "jumps": [], "faults": [], "legs": [],
        }  # fmt: skip
        run = {
            "run": "r",
            "seed": 1,
            "end_ns": 10**12,
            "link": {"model": "ideal"},
            "speed": 1.0,
            "partitions": [],
            "queue": 32,
        }
        return {"run": run, "process": process, "start_ns": time.monotonic_ns(), "stored": b""}


@contextmanager
def impostor(endpoint: str, canary: Path, *, complete: bool = False, silent: bool = False) -> Iterator[Impostor]:
    (canary.parent / "precious").mkdir()
    peer = Impostor(endpoint, canary, complete=complete, silent=silent)
    try:
        yield peer
        assert not canary.exists(), "an answer that anybody may give was run as code"
        assert (canary.parent / "precious").is_dir()
    finally:
        peer.close()


@pytest.mark.parametrize(
    "manner", [{}, {"complete": True}, {"complete": True, "silent": True}], ids=["answers", "complete", "silent"]
)
def test_the_processes_of_a_launcher_take_its_own_answer(manner: dict[str, bool], router: str, tmp_path: Path) -> None:
    """The peer is there before the run; each process that joins gets both answers, in any order."""
    with impostor(router, tmp_path / "canary", **manner) as peer:
        for speed in SPEEDS:
            shutil.rmtree(tmp_path / "run", ignore_errors=True)
            run = Run(tmp_path / "run", *field.arguments(1), "--speed", str(speed), "--connect", router)
            code, said = run.finish()
            assert (run.folder / METRICS).exists(), said
            came = Attacked(1, run.folder, code, said, run.metrics())
            if came.kept_up:
                break
    assert peer.asked >= field.NODES
    assert list(complaints(came)) == [], said


def test_a_role_that_stands_alone_runs_no_code_for_an_impostor(router: str, tmp_path: Path) -> None:
    """There is no run at all: whoever answers is no launcher. It ends with a message, or waits on."""
    with impostor(router, tmp_path / "canary") as peer, ExitStack() as stack:
        peer.pretend("r")
        processes = [alone(stack, tmp_path / role, role, router, "--run", "r") for role in ("node", "fusion") * 3]
        until(lambda: peer.asked >= len(processes) or all(p.poll() is not None for p in processes))
        time.sleep(2)  # for what an answer might do
        assert peer.asked
    for role in ("node", "fusion"):
        said = (tmp_path / role).read_text()
        assert "Traceback" not in said, said


def alone(stack: ExitStack, log: Path, role: str, router: str, *options: str) -> subprocess.Popen[bytes]:
    """A role that is started by hand."""
    command = [sys.executable, "-m", role, "--connect", router, "--id", "n000" if role == "node" else role, *options]
    environment = {**os.environ, "PYTHONPATH": str(Path.cwd())}
    process = subprocess.Popen(command, stderr=stack.enter_context(log.open("a")), env=environment)
    stack.callback(process.wait, 20)
    stack.callback(process.kill)
    return process
