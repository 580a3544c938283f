"""Runs that wait for some of their processes, which others start, and start the rest: ``run.external``."""

from __future__ import annotations

import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

from launcher import api
from launcher.plan.prepare import load, planned
from tests.command_line import Call, trackfield
from tests.outside import join, process
from tests.running import PATIENCE_S, Run, until
from trackfield.errors import ScenarioError
from trackfield.scenario import Scenario

__all__ = ["trackfield"]
FIELD = ("spcpf", "--nodes", "4", "--set", "target.steps=12", "--set", "sensor.threshold=0.5")
WAITING = (*FIELD, "--set", 'run.external=["n002"]')


@pytest.fixture
def endpoint() -> str:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{probe.getsockname()[1]}"


def tables(folder: Path) -> list[list[dict[str, Any]]]:
    """What was sent and tracked, without what depends on the machine."""
    rows = pq.read_table(folder / "messages.parquet").to_pylist()
    frames = sorted(rows, key=lambda row: (row["sent_ns"], row["src"], row["dst"], row["copy"]))
    return [frames, pq.read_table(folder / "tracks.parquet").to_pylist()]


@pytest.fixture
def alone(tmp_path: Path) -> Iterator[Callable[[str], subprocess.Popen[str]]]:
    """Start a node by itself that waits for a run and for the place n002 in it."""
    started: list[subprocess.Popen[str]] = []

    def start(router: str) -> subprocess.Popen[str]:
        command = [sys.executable, "-m", "node", "--connect", router, "--id", "n002", "--wait"]
        started.append(subprocess.Popen(command, text=True))
        return started[-1]

    yield start
    for one in started:
        one.kill()
        one.wait()


def test_the_run_waits_for_it_and_treats_it_like_the_rest(
    endpoint: str, alone: Callable[[str], subprocess.Popen[str]], tmp_path: Path
) -> None:
    run = Run(tmp_path / "run", *WAITING, "--listen", endpoint)
    until(lambda: "5 of 6 ready, missing n002\n" in run.said())
    node = alone(endpoint)
    code, said = run.finish()
    assert code == 0, said
    assert node.wait(PATIENCE_S) == 0
    assert set(run.metrics()["interference"].values()) == {0}
    virtual = Run(tmp_path / "virtual", *FIELD, "--virtual")
    assert virtual.finish()[0] == 0
    assert tables(run.folder) == tables(virtual.folder)


def test_it_may_come_before_the_run_by_a_router_that_others_run(
    endpoint: str, alone: Callable[[str], subprocess.Popen[str]], tmp_path: Path
) -> None:
    said = tmp_path / "router"
    with process("launcher", "router", "--listen", endpoint, said=said):
        until(lambda: said.read_text() == f"router at {endpoint}\n")
        node = alone(endpoint)
        run = Run(tmp_path / "run", *WAITING, "--connect", endpoint)
        code, told = run.finish()
        assert code == 0, told
        assert node.wait(PATIENCE_S) == 0


def test_it_gets_a_certificate_where_the_run_is_secure(endpoint: str, tmp_path: Path) -> None:
    router, folder = endpoint.replace("tcp/", "tls/"), tmp_path / "certificates"
    run = Run(tmp_path / "run", *WAITING, "--secure", "--certificates", str(folder), "--listen", router)
    until(lambda: "5 of 6 ready, missing n002\n" in run.said())
    assert join("--connect", router, "--id", "n002", "--secure", str(folder / "guest")) == (0, "")
    code, said = run.finish()
    assert code == 0, said
    assert set(run.metrics()["interference"].values()) == {0}


def test_its_death_is_reported_and_the_others_go_on(
    endpoint: str, alone: Callable[[str], subprocess.Popen[str]], tmp_path: Path
) -> None:
    run = Run(tmp_path / "run", *WAITING, "--listen", endpoint)
    node = alone(endpoint)
    run.started()
    node.kill()
    code, said = run.finish()
    [death] = run.metrics()["processes"]["died"]
    assert (code, death["id"], death["why"]) == (1, "n002", "gone: its token was lost")
    assert f"n002 died at {death['t']:.1f} s: gone: its token was lost" in said
    assert run.metrics()["complete"]


def test_one_that_comes_again_has_what_is_left_of_the_battery(
    endpoint: str, alone: Callable[[str], subprocess.Popen[str]], tmp_path: Path
) -> None:
    """With a full one it would have some left at the end, as all are empty after 19 s."""
    long = ("--set", "target.steps=30", "--set", "energy.battery_j=0.15")
    run = Run(tmp_path / "run", "spcpf", "--nodes", "4", *WAITING[5:], *long, "--listen", endpoint)
    node = alone(endpoint)
    until(lambda: "\nt = 10 s" in run.said())
    node.kill()
    alone(endpoint)
    assert run.finish()[0] == 1
    [death] = run.metrics()["processes"]["died"]
    assert death["id"] == "n002"
    assert death["t"] > 10
    empty = {one["id"]: one["t"] for one in run.metrics()["lifetime_s"]["empty"]}
    assert empty.keys() == {"n000", "n001", "n002", "n003"}
    assert empty["n002"] > empty["n003"]
    rows = pq.read_table(run.folder / "messages.parquet").to_pylist()
    assert {row["incarnation"] for row in rows if row["src"] == "n002"} == {0, 1}


def test_the_places_of_the_others_are_not_given(endpoint: str, tmp_path: Path) -> None:
    run = Run(tmp_path / "run", *WAITING, "--listen", endpoint)
    until(lambda: "5 of 6 ready, missing n002\n" in run.said())
    code, said = join("--connect", endpoint, "--id", "n001")
    assert code == 1
    assert "n001 is no place to have: the launcher starts that process" in said
    run.process.terminate()
    assert run.finish()[0] == 143


def test_it_is_waited_for_as_long_as_the_run_is_told(endpoint: str, tmp_path: Path) -> None:
    run = Run(tmp_path / "run", *WAITING, "--listen", endpoint, "--wait", "1")
    code, said = run.finish()
    assert code == 1
    assert "of 6 processes were not ready in time" in said


# --- one message for what cannot be ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (
            ("--secure", "--listen", "tls/127.0.0.1:7447"),
            "run.external: n002 starts elsewhere, and the certificates of this run are with its launcher alone",
        ),
        ((), "run.external: n002 cannot find the run's own router; expected --listen ENDPOINT, or --connect"),
        (
            ("--virtual",),
            "run.external: others are to start n002, and there are no processes in virtual time; expected",
        ),
    ],
)
def test_a_run_that_it_cannot_join_is_refused(trackfield: Call, options: tuple[str, ...], says: str) -> None:
    for command in ("run", "validate"):
        said = trackfield(command, *WAITING, *options)
        assert (said.code, said.out) == (2, "")
        assert says in said.err
        assert said.err.count("\n") == 1


@pytest.mark.parametrize(
    ("external", "says"),
    [
        (
            '["n02"]',
            "run.external: there is no 'n02'; did you mean n002?; expected ids of this field, like fusion, n003",
        ),
        ('["n002", "n002"]', "run.external: n002 is given twice; expected each id once"),
        ("[]", "run.external: is []; expected a list of at least 1"),
    ],
)
def test_ids_that_are_none_are_refused(external: str, says: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        planned(load("spcpf", settings=[f"run.external={external}"], nodes=4))
    assert str(caught.value).startswith(says)


def test_one_that_is_unknown_is_told_with_all_else_that_is_wrong(trackfield: Call) -> None:
    said = trackfield("validate", *FIELD, "--set", 'run.external=["x"]', "--set", "link.loss=2")
    assert said.code == 2
    assert "link.loss" in said.err


def test_a_device_and_a_process_in_one_place_are_refused(trackfield: Call) -> None:
    options = ("yang-ecpa", "--set", 'run.external=["camera"]', "--bridge", "camera=pty", "--listen", "tcp/127.0.0.1:1")
    said = trackfield("validate", *options)
    assert said.code == 2
    assert "run.external: others are to start camera, and a real device is to be in its place; expected one" in said.err


@pytest.mark.parametrize("driver", ["virtual", "processes"])
def test_a_run_by_the_api_and_a_study_wait_for_nobody(driver: api.Driver) -> None:
    scenario = Scenario.load("spcpf", {"run.external": ["n002"]})
    with pytest.raises(ScenarioError, match=r"^run\.external: "):
        api.run(scenario, driver=driver)
    with pytest.raises(ScenarioError, match=r"^run\.external: others are to start n002"):
        api.study(scenario, [1])
