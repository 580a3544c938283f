"""Runs whose processes start elsewhere, and somebody who wants a place in them without being one of theirs."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Event, Thread

import msgpack
import pyarrow.parquet as pq
import pytest
import zenoh
from zenoh.handlers import Callback

from launcher.plan.prepare import load, planned
from launcher.processes import gathering, patience
from launcher.processes.endpoint import Way
from launcher.processes.gathering import Guests
from launcher.run import Outcome, run_processes
from launcher.show import Quiet
from tests.outside import OPTIONS, Start, join, process, router, start
from tests.running import Run, until
from trackfield.drivers.exchange.intake import Refusals
from trackfield.drivers.exchange.seal import TOKEN, Seal
from trackfield.drivers.joining.claim import claim, find_run
from trackfield.drivers.joining.join import join as ask_to_join
from trackfield.drivers.joining.join import token
from trackfield.drivers.process import LAST_WAVE
from trackfield.drivers.session import open_client, open_router
from trackfield.wire import keys

__all__ = ["router", "start"]
NAMES = ("fusion", "n000", "n001", "n002", "n003")


def tracked(run: Run) -> int:
    return max(pq.read_table(run.folder / "tracks.parquet")["step"].to_pylist())


@contextmanager
def flooding(endpoint: str, run: str) -> Iterator[Callable[[], int]]:
    """Somebody claims and joins as fast as possible, under ever new names of hosts; call it for how often."""
    done, count = Event(), 0

    def flood(session: zenoh.Session) -> None:
        nonlocal count
        while not done.is_set():
            for role in ("node", "fusion"):
                question = msgpack.packb([role, f"host{count}", "", os.urandom(8)])
                list(session.get(keys.CLAIM, payload=question))
            for name in NAMES:
                list(session.get(keys.asked_by(keys.JOIN, name), payload=msgpack.packb([name, os.urandom(8)])))
            count += 1

    with open_client(endpoint, run) as session:
        thread = Thread(target=flood, args=(session,))
        thread.start()
        try:
            yield lambda: count
        finally:
            done.set()
            thread.join()


def test_neither_a_flood_of_claims_nor_forged_tokens_keep_the_processes_out(
    router: str, start: Start, tmp_path: Path
) -> None:
    run = Run(tmp_path / "run", *OPTIONS, "--connect", router)
    until(lambda: "1 of 6 ready" in run.said())
    name = run.manifest()["run"]
    with open_client(router, name) as session:
        held = [session.liveliness().declare_token(keys.live(one)) for one in NAMES]
        with flooding(router, name) as floods:
            until(lambda: floods() > 20)
            assert "\nt = " not in run.said()  # it did not start with nobody there
            for role in ("fusion", *4 * ["node"]):
                start(role)
            run.started()
        code, said = run.finish()
        assert len(held) == len(NAMES)
    assert code == 1
    assert "somebody interfered with the run: 5 liveliness tokens of no process of the run (interference)" in said
    assert run.metrics()["processes"]["died"] == []
    assert tracked(run) == 12


def test_a_second_process_with_a_living_id_is_refused(router: str, start: Start, tmp_path: Path) -> None:
    start("fusion")
    for _ in range(3):
        start("node")
    third = start("node", "--id", "n003")
    run = Run(tmp_path / "run", *OPTIONS, "--connect", router)
    run.started()
    says = f"node: cannot join the run through {router}: n003 is taken: a process lives there\n"
    assert join("--connect", router, "--id", "n003") == (1, says)
    says = f"node: cannot join the run through {router}: every place of a node is taken\n"
    assert join("--connect", router) == (1, says)
    says = (
        f"node: cannot join the run through {router}: no process of this run with the role 'node' is named 'fusion'\n"
    )
    assert join("--connect", router, "--id", "fusion") == (1, says)
    code, said = run.finish()
    assert (code, third.wait(10)) == (0, 0), said
    assert run.metrics()["processes"]["died"] == []


@pytest.mark.long
def test_a_place_whose_process_is_gone_can_be_taken_by_name(router: str, start: Start, tmp_path: Path) -> None:
    start("fusion")
    for _ in range(3):
        start("node")
    third = start("node", "--id", "n003")
    run = Run(tmp_path / "run", *OPTIONS, "--connect", router)
    run.started()
    third.kill()
    again = start("node", "--id", "n003")
    code, said = run.finish()
    assert (code, again.wait(10)) == (1, 0)
    assert "gone: its token was lost (started again)" in said
    assert [death["id"] for death in run.metrics()["processes"]["died"]] == ["n003"]


# --- nobody is there ------------------------------------------------------------------------------------------------


class Nobody:
    """Takes every place of a run as its processes would, and does no more, or ``says`` that all reached the end."""

    def __init__(self, endpoint: str, *, says: bool) -> None:
        self._endpoint, self._says = endpoint, says
        self.left = Event()

    def __call__(self) -> None:
        with open_client(self._endpoint, until(self._run)) as session:
            seal, refused, held = Seal(), Refusals(), list[object]()
            if self._says:
                leave = Callback(lambda _: self.left.set(), indirect=False)
                held.append(session.declare_subscriber(keys.STOP, leave))
            for name in NAMES:
                role = "fusion" if name == "fusion" else "node"
                assert claim(session, role, "nowhere", name, seal, refused) == name
                joined = ask_to_join(session, name, "", seal, refused)
                held.append(session.liveliness().declare_token(token(name, joined.ticket, seal)))
            while not self.left.is_set():
                for name in NAMES if self._says else ():
                    session.put(keys.telemetry(name, "reached"), msgpack.packb([LAST_WAVE, 0, {}, False]))
                self.left.wait(0.2)

    def _run(self) -> str:
        try:
            return find_run(self._endpoint)
        except RuntimeError:
            return ""


@pytest.fixture
def haunted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[bool], Outcome]:
    """A run in which nobody is there, whether it says that all reached the end or not."""

    def run(says: bool) -> Outcome:
        monkeypatch.setattr(patience, "OVERDUE_S", 1.0)
        monkeypatch.setattr(gathering, "STOP_TIMEOUT_S", 4.0)
        endpoint = f"unixsock-stream/{tmp_path / 'r'}"
        with open_router(endpoint):
            nobody = Nobody(endpoint, says=says)
            thread = Thread(target=nobody)
            thread.start()
            plan = planned(load("spcpf", settings=["target.steps=2"], nodes=4), 5.0)
            try:
                return run_processes(plan, tmp_path, Quiet(), [], Way(endpoint), guests=Guests(plan.ids))
            finally:
                nobody.left.set()
                thread.join()

    return run


@pytest.mark.parametrize("says", [False, pytest.param(True, marks=pytest.mark.long)])
def test_a_run_in_which_nobody_is_there_fails(haunted: Callable[[bool], Outcome], says: bool) -> None:
    outcome = haunted(says)
    assert outcome.exit_code == 1
    died = {(death["id"], death["why"]) for death in outcome.metrics["processes"]["died"]}
    why = "left without its final record" if says else "did not reach the end"
    assert died >= {(name, why) for name in NAMES}


# --- the token that all share ---------------------------------------------------------------------------------------


def test_processes_share_a_token(router: str, start: Start, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(TOKEN, "a secret of ours")
    for role in ("fusion", *4 * ["node"]):
        start(role)
    run = Run(tmp_path / "run", *OPTIONS, "--connect", router)
    code, said = run.finish()
    assert code == 0, said
    assert set(run.metrics()["interference"].values()) == {0}
    assert tracked(run) == 12
    assert "a secret of ours" not in "".join(
        file.read_text(errors="replace") for file in (*run.folder.rglob("*.json"), *run.folder.rglob("*.log"))
    )


@pytest.mark.parametrize(
    ("of_run", "of_process", "says"),
    [
        pytest.param("ours", "theirs", "the answers lack the seal of the token in TRACKFIELD_TOKEN: ", id="another"),
        pytest.param(
            "",
            "theirs",
            "the answers lack the seal of the token in TRACKFIELD_TOKEN: ",
            id="too much",
            marks=pytest.mark.long,
        ),
        pytest.param(
            "ours",
            "",
            "the question lacks the seal of this run: set TRACKFIELD_TOKEN as it is set for the launcher\n",
            id="none",
            marks=pytest.mark.long,
        ),
    ],
)
def test_another_token_is_one_message(
    router: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, of_run: str, of_process: str, says: str
) -> None:
    monkeypatch.setenv(TOKEN, of_run)
    run = Run(tmp_path / "run", *OPTIONS, "--connect", router)
    until(lambda: "1 of 6 ready" in run.said())
    monkeypatch.setenv(TOKEN, of_process)
    code, said = join("--connect", router)
    assert code == 1
    assert said.startswith(f"node: cannot join the run through {router}: {says}")
    assert said.count("\n") == 1
    waiting = tmp_path / "waiting"
    with process("node", "--connect", router, "--wait", said=waiting) as waits:
        until(lambda: TOKEN in waiting.read_text())
        time.sleep(2)  # it tries again, and says nothing new
        assert waits.poll() is None
        assert waiting.read_text() == said
    run.process.send_signal(signal.SIGINT)
    run.finish()


# --- a sensor of one's own ------------------------------------------------------------------------------------------

SONAR = """
from dataclasses import dataclass
from math import dist

@dataclass(frozen=True)
class Sonar:
    range_m: float = 150.0
    resolution = (0.01,)
    sd = (1.0,)

    def simulate(self, target, position, normals):
        return (dist(target[:2], position) + normals[0],)

    def h(self, states, positions):
        import numpy as np
        return np.linalg.norm(states[..., None, :2] - positions, axis=-1)[..., None]

    def jacobian(self, states, positions):
        import numpy as np
        slopes = np.zeros((*states.shape[:-1], len(positions), 1, 4))
        slopes[..., 0, :2] = (states[..., None, :2] - positions) / np.maximum(self.h(states, positions), 1e-6)
        return slopes
"""


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A package with a sensor, in the Python of launcher, centre and nodes."""
    info = tmp_path / "packages" / "sonar-1.0.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: sonar\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[trackfield.sensors]\nsonar = own_sonar:Sonar\n")
    (info.parent / "own_sonar.py").write_text(SONAR)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(info.parent), os.environ.get("PYTHONPATH", "")]))


def test_a_sensor_of_ones_own_in_processes_that_start_by_hand(
    router: str, start: Start, tmp_path: Path, installed: None
) -> None:
    settings = ("--set", "sensor.kind=sonar", "--tracker", "ekf")
    options = [option for option in OPTIONS if option not in ("--set", "sensor.threshold=0.5", "target.steps=12")]
    run = Run(tmp_path / "run", *options, "--set", "target.steps=12", *settings, "--connect", router)
    until(lambda: "1 of 6 ready" in run.said())
    for own, says in (
        ((), "--own tells this process where a class of yours is"),
        (("--own", "sensor:sonar=nowhere:Sonar"), "cannot be loaded from nowhere:Sonar"),
        (("--own", "sensor:sonar=own_sonar:Sona"), "cannot be loaded from own_sonar:Sona"),
        (("--own", "sonar=own_sonar:Sonar"), "expected something like sensor:sonar=mine.sonar:Sonar"),
    ):
        code, said = join("--connect", router, *own)
        assert code in (1, 2)
        assert says in said
        assert "Traceback" not in said
    start("fusion")
    for _ in range(4):
        start("node", "--own", "sensor:sonar=own_sonar:Sonar")
    code, said = run.finish()
    assert code == 0, said
    assert {row["kind"] for row in pq.read_table(run.folder / "messages.parquet").to_pylist()} == {"measurement"}
    assert tracked(run) == 12
