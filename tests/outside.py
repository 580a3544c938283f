"""Processes that start outside of a run, by hand: plain processes of this machine that join through a router."""

from __future__ import annotations

import signal
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest

from tests.running import until

OPTIONS = ("spcpf", "--nodes", "4", "--set", "target.steps=12", "--set", "sensor.threshold=0.5", "--external")
Start = Callable[..., subprocess.Popen[str]]


@contextmanager
def process(*arguments: str, said: Path) -> Iterator[subprocess.Popen[str]]:
    with said.open("w") as file:
        started = subprocess.Popen([sys.executable, "-m", *arguments], stderr=file, text=True)
    try:
        yield started
    finally:
        started.kill()
        started.wait()


@pytest.fixture
def start(router: str, tmp_path: Path) -> Iterator[Start]:
    """``start(role, option, ...)`` starts a process that waits for a run; none of them has anything to complain of."""
    with ExitStack() as stack:
        logs: list[Path] = []

        def call(role: str, *options: str) -> subprocess.Popen[str]:
            logs.append(tmp_path / f"log{len(logs)}")
            return stack.enter_context(process(role, "--connect", router, "--wait", *options, said=logs[-1]))

        yield call
        assert [log.read_text() for log in logs] == [""] * len(logs)


@pytest.fixture
def router(tmp_path: Path) -> Iterator[str]:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        endpoint = f"tcp/127.0.0.1:{probe.getsockname()[1]}"
    said = tmp_path / "router"
    with process("launcher", "router", "--listen", endpoint, said=said) as router:
        until(lambda: said.read_text() == f"router at {endpoint}\n")
        yield endpoint
        assert router.poll() is None
        router.send_signal(signal.SIGINT)
        assert router.wait(10) == 0


def join(*arguments: str) -> tuple[int, str]:
    done = subprocess.run(
        [sys.executable, "-m", "node", *arguments], capture_output=True, text=True, timeout=60, check=False
    )
    return done.returncode, done.stderr
