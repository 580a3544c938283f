"""Runs whose processes start elsewhere: here as plain processes of this machine that join through a router."""

from __future__ import annotations

import errno
import signal
import socket
import time
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from tests.command_line import Call, trackfield
from tests.outside import OPTIONS, Start, join, process, router, start
from tests.running import Run, until

__all__ = ["router", "start", "trackfield"]
LEASE_S = 10.0
"""After which Zenoh gives up a session of which nothing is heard."""
LONGER = tuple(option.replace("target.steps=12", "target.steps=30") for option in OPTIONS)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_a_router_ends_when_it_is_told(number: int, tmp_path: Path) -> None:
    said = tmp_path / "router"
    with process("launcher", "router", "--listen", f"unixsock-stream/{tmp_path}/s", said=said) as router:
        until(lambda: said.read_text().startswith("router at "))
        router.send_signal(number)
        assert router.wait(10) == 0


def test_everybody_finds_the_run_and_a_place_in_it(router: str, start: Start, tmp_path: Path) -> None:
    """Five wait for a run, before there is one; one too many waits on, and is not in the way."""
    processes = [start("fusion"), *(start("node") for _ in range(5))]
    run = Run(tmp_path / "run", *OPTIONS, "--connect", router)
    code, said = run.finish()
    assert code == 0, said
    until(lambda: sorted(str(p.poll()) for p in processes) == ["0", "0", "0", "0", "0", "None"], timeout=5)
    rows = pq.read_table(run.folder / "messages.parquet").to_pylist()
    assert {row["src"] for row in rows} == {"n000", "n001", "n002", "n003"}
    assert {row["outcome"] for row in rows} == {"delivered"}


def test_a_killed_process_is_reported_and_its_place_taken_again(router: str, start: Start, tmp_path: Path) -> None:
    start("fusion")
    nodes = [start("node") for _ in range(4)]
    run = Run(tmp_path / "run", *LONGER, "--connect", router)  # a new process has to start, join and report
    run.started()
    time.sleep(3)  # steps in which all report
    nodes[0].kill()
    start("node")
    code, said = run.finish()
    metrics = run.metrics()
    [death] = metrics["processes"]["died"]
    assert (code, death["why"], death["host"]) == (1, "gone: its token was lost", socket.gethostname())
    assert 0 < death["t"] < 31
    assert f"{death['id']} died at {death['t']:.1f} s: gone: its token was lost (started again)" in said
    rows = pq.read_table(run.folder / "messages.parquet").to_pylist()
    assert {row["incarnation"] for row in rows if row["src"] == death["id"]} == {0, 1}
    assert metrics["processes"]["stopped"] == []
    frames = metrics["frames"]
    assert (
        frames["expected"]
        == frames["delivered"] + sum(frames["lost"].values()) + frames["host_lost"] + frames["host_late"]
    )


def test_who_stands_still_for_longer_than_a_lease_was_out_of_reach(router: str, start: Start, tmp_path: Path) -> None:
    start("fusion")
    for _ in range(3):
        start("node")
    still = start("node", "--id", "n003")
    run = Run(tmp_path / "run", *LONGER, "--connect", router)
    run.started()
    still.send_signal(signal.SIGSTOP)
    time.sleep(LEASE_S + 5)
    still.send_signal(signal.SIGCONT)
    code, said = run.finish()
    assert still.wait(10) == 0
    [stop] = run.metrics()["processes"]["stopped"]
    assert (code, stop["id"]) == (1, "n003")
    assert 0 < stop["t"] < stop["t"] + stop["s"] < 30
    assert f"n003 was out of reach at {stop['t']:.1f} s, for {stop['s']:.1f} s" in said


# --- one message for what cannot be ---------------------------------------------------------------------------------


def test_without_a_run_there_is_none_to_join(router: str) -> None:
    assert join("--connect", router) == (1, f"node: cannot join the run through {router}: there is no run yet\n")


def test_a_router_with_several_runs_names_them(router: str, tmp_path: Path) -> None:
    runs = [Run(tmp_path / name, *OPTIONS, "--connect", router) for name in ("a", "b")]
    try:
        names = sorted(until(lambda run=run: run.manifest()["run"]) for run in runs)
        said = until(lambda: (answer := join("--connect", router))[1].count("spcpf-") == 2 and answer)
        assert said == (
            1,
            f"node: cannot join the run through {router}: there are 2 runs, name one with --run: {', '.join(names)}\n",
        )
    finally:
        for run in runs:
            run.process.send_signal(signal.SIGINT)
            assert run.finish()[0] == 130


def test_who_is_missing_is_shown(router: str, tmp_path: Path) -> None:
    run = Run(tmp_path / "run", *OPTIONS, "--connect", router)
    until(lambda: "1 of 6 ready, missing fusion, n000, n001, n002, n003\n" in run.said())
    run.process.send_signal(signal.SIGINT)
    assert run.finish()[0] == 130


def test_a_run_that_starts_its_own_processes_gives_no_places(router: str, tmp_path: Path) -> None:
    run = Run(tmp_path / "run", *LONGER[:-1], "--connect", router)
    run.started()
    code, said = join("--connect", router)
    assert code == 1
    assert (
        "the launcher starts all processes of this run: it gives places with --external, --field or run.external"
        in said
    )
    assert join("--connect", router, "--id", "n000") == (code, said)
    assert run.finish()[0] == 0


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("run", "spcpf", "--external"), "--external: other processes cannot find the run's own router"),
        (
            ("run", "spcpf", "--external", "--virtual", "--connect", "tcp/h:1"),
            "--external: there are no processes in virtual time",
        ),
        (("router", "--listen", "here"), "--listen: is 'here'"),
        (("router",), "--listen"),
    ],
)
def test_bad_options_have_one_message(trackfield: Call, arguments: tuple[str, ...], says: str) -> None:
    said = trackfield(*arguments)
    assert (said.code, said.out) == (2, "")
    assert says in said.err


def test_a_run_whose_router_cannot_listen_says_so(trackfield: Call, tmp_path: Path) -> None:
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        place = f"tcp/127.0.0.1:{other.getsockname()[1]}"
        said = trackfield("run", "zhai-spcpf", "--field", "external", "--listen", place, "--out", str(tmp_path / "run"))
    assert said.code == 1
    last = said.err.splitlines()[-1]
    assert last == f"trackfield: cannot listen at {place}: Address already in use (os error {errno.EADDRINUSE})"
    assert "Traceback" not in said.err


def test_a_router_that_cannot_listen_says_so(trackfield: Call) -> None:
    said = trackfield("router", "--insecure", "--listen", "tcp/192.0.2.1:7447")
    assert said.code == 1
    assert said.err.startswith("trackfield: cannot listen at tcp/192.0.2.1:7447: ")
    assert said.err.count("\n") == 1
