"""Others at the router of a run whose processes start elsewhere: they take no place, and start nothing."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import msgpack
import pyarrow.parquet as pq
import pytest
import zenoh

from tests.hostile.verdicts import INTERFERED
from tests.outside import router
from tests.running import Run, kept_up, until
from tests.same_tables import points, track_differences
from trackfield.drivers.exchange.seal import TOKEN
from trackfield.drivers.session import open_client
from trackfield.wire import keys

__all__ = ["router"]
NODES = ("n000", "n001", "n002", "n003")
FIELD = ("spcpf", "--nodes", "4", "--set", "target.steps=12", "--set", "sensor.threshold=0.5", "--speed", "3")

Start = Callable[..., subprocess.Popen[str]]


@pytest.fixture
def start(router: str, tmp_path: Path) -> Iterator[Start]:
    """``start(role, option, ...)`` starts a process of the field."""
    with ExitStack() as stack:

        def call(role: str, *options: str, log: str = "log") -> subprocess.Popen[str]:
            said = stack.enter_context((tmp_path / log).open("a"))
            command = [sys.executable, "-m", role, "--connect", router, "--wait", *options]
            process = subprocess.Popen(command, stderr=said, text=True)
            stack.callback(process.wait, 20)
            stack.callback(process.kill)
            return process

        yield call


@pytest.fixture
def token(monkeypatch: pytest.MonkeyPatch) -> None:
    """Launcher and processes share a secret."""
    monkeypatch.setenv(TOKEN, "a secret of the field")


@contextmanager
def gathering(router: str, folder: Path) -> Iterator[tuple[Run, zenoh.Session]]:
    """A run that waits for its processes, and a stranger in it."""
    run = Run(folder, *FIELD, "--external", "--connect", router)
    try:
        manifest = until(run.manifest)
        with open_client(router, manifest["run"]) as stranger:
            until(lambda: "ready, missing" in run.said() or "starting" in run.said())
            yield run, stranger
    finally:
        run.process.kill()
        run.process.wait()


def undisturbed(folder: Path) -> Path:
    code, said = Run(folder, *FIELD[:-2], "--virtual").finish()
    assert code == 0, said
    return folder


def check(run: Run, twin: Path) -> str:
    """The run ended with all its tracks as they should be; what it said."""
    code, said = run.finish()
    assert code == 0 or (code == 1 and INTERFERED in said), said
    assert "Traceback" not in said
    assert run.metrics()["processes"]["died"] == []
    tracks = [points(pq.read_table(folder / "tracks.parquet")) for folder in (twin, run.folder)]
    assert track_differences(*tracks) == [] or not kept_up(run.metrics())
    return said


@pytest.mark.long
def test_who_only_claims_places_keeps_nobody_from_them(router: str, start: Start, tmp_path: Path) -> None:
    with gathering(router, tmp_path / "run") as (run, stranger):
        for i in range(20):
            question = msgpack.packb(["fusion" if i % 5 == 0 else "node", f"host{i}"])
            list(stranger.get(keys.CLAIM, payload=question, timeout=5))
        start("fusion")
        for _ in NODES:
            start("node")
        check(run, undisturbed(tmp_path / "virtual"))
    assert (tmp_path / "log").read_text() == ""


@pytest.mark.usefixtures("token")
@pytest.mark.long
def test_forged_tokens_start_no_run(router: str, start: Start, tmp_path: Path) -> None:
    with gathering(router, tmp_path / "run") as (run, stranger):
        ends = [f"{name}{end}" for name in ("fusion", *NODES) for end in ("", "/x")]
        held = [stranger.liveliness().declare_token(f"live/{name}") for name in ends]
        time.sleep(3)
        assert "\nt = " not in run.said()
        for name in NODES:
            start("node", "--id", name)
        start("fusion", "--id", "fusion")
        said = check(run, undisturbed(tmp_path / "virtual"))
        assert INTERFERED in said
        assert len(held) == 10


@pytest.mark.usefixtures("token")
@pytest.mark.long
def test_a_living_process_keeps_its_id(router: str, start: Start, tmp_path: Path) -> None:
    """Another that asks for it is refused, at the start and during the run."""
    with gathering(router, tmp_path / "run") as (run, _):
        for name in NODES:
            start("node", "--id", name)
        until(lambda: "missing fusion\n" in run.said())
        early = start("node", "--id", "n001", log="second")
        start("fusion", "--id", "fusion")
        run.started()
        late = start("node", "--id", "n002", log="second")
        check(run, undisturbed(tmp_path / "virtual"))
        assert (early.poll(), late.poll()) != (0, 0)
