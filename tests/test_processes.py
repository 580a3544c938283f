"""Runs as processes over Zenoh, seen from outside: titles, memory, frames, deaths, signals."""

from __future__ import annotations

import json
import os
import signal
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import psutil
import pyarrow.parquet as pq
import pytest

from launcher.processes import patience
from tests.running import METRICS, Run, counting, kept_up, leftovers, on_time, until
from tests.test_timeline import verify
from trackfield.drivers.session import open_client
from trackfield.wire import Doa, Envelope, encode

FORBIDDEN = ("numpy", "rerun", "pydantic", "pyarrow", "scipy")


@dataclass
class Seen:
    """One watched run of the paper's scenario over a link that loses frames in bursts."""

    titles: set[str]
    maps: dict[str, str]
    niceness: dict[str, list[int]]
    counted: int
    exit_code: int
    said: str
    metrics: dict[str, Any]
    folder: Path


def niceness_of_threads(pid: int) -> list[int]:
    """That of the main thread first; of those that live on while they are asked."""
    found = []
    for task in sorted(Path(f"/proc/{pid}/task").iterdir(), key=lambda task: (task.name != str(pid), task.name)):
        with suppress(FileNotFoundError, ProcessLookupError):
            found.append(int((task / "stat").read_text().rpartition(")")[2].split()[16]))
    return found


@pytest.fixture(scope="module")
def seen(tmp_path_factory: pytest.TempPathFactory) -> Seen:
    """At the first speed at which the machine keeps up with it."""
    for speed in (5, 1):
        folder = tmp_path_factory.mktemp("runs") / "watched"
        run = Run(folder, "spcpf", "--speed", str(speed), "--link", "gilbert_elliott", "--seed", "3")
        with counting(run) as count:
            run.started()
            family = run.family()
            maps = {t: Path(f"/proc/{family[t].pid}/maps").read_text() for t in ("node n060", "fusion")}
            niceness = {t: niceness_of_threads(family[t].pid) for t in ("node n060", "fusion", "router")}
            exit_code, said = run.finish()
            counted = count()
        if kept_up(run.metrics()):
            break
    return Seen(set(family), maps, niceness, counted, exit_code, said, run.metrics(), folder)


def test_every_process_says_what_it_is(seen: Seen) -> None:
    nodes = {f"node n{i:03}" for i in range(121)}
    assert nodes | {"fusion", "router", "recorder"} <= seen.titles


def test_a_node_carries_nothing_that_it_does_not_need(seen: Seen) -> None:
    """Its memory map shows none of the libraries that others of the run have (the fusion centre has numpy)."""
    assert "numpy" in seen.maps["fusion"]
    assert [name for name in FORBIDDEN if name in seen.maps["node n060"]] == []


def test_a_node_works_after_the_others_but_its_frames_leave_at_once(seen: Seen) -> None:
    """The main thread does the work; all others are those of its session."""
    own, *session = seen.niceness["node n060"]
    others = os.nice(0)
    assert own == others + patience.NICENESS > others
    assert len(session) >= 2
    assert {*session, *seen.niceness["fusion"], *seen.niceness["router"]} == {others}


def test_a_bystander_counts_the_same_frames(seen: Seen) -> None:
    frames = seen.metrics["frames"]
    assert seen.exit_code == 0, seen.said
    assert seen.counted == frames["sent"] > 100
    assert frames["expected"] == frames["delivered"] + sum(frames["lost"].values())
    assert frames["lost"]["radio"] > 0
    assert frames["host_lost"] == 0
    assert seen.metrics["recorder"]["dropped"] == 0


def test_a_finished_run_names_its_folder_and_the_next_command(seen: Seen) -> None:
    folder, page, following = seen.said.strip().splitlines()[-3:]
    assert folder == f"run folder: {seen.folder}"
    assert page == f"report: {seen.folder}/report.html"
    assert following.endswith(f"view {seen.folder}")
    assert verify(seen.folder / "run.rrd").returncode == 0
    assert seen.metrics["processes"]["died"] == []


# --- deaths and signals: nothing hangs, nothing is left behind ---------------------------------------------------


def mid_run(folder: Path, *options: str) -> tuple[Run, list[psutil.Process]]:
    """A small run that has started, and all its processes but the launcher."""
    run = Run(folder, "spcpf", "--nodes", "16", "--set", "target.steps=40", *options)
    run.started()
    return run, list(run.family().values())


def test_a_killed_node_is_named_and_the_run_goes_on_without_it(tmp_path: Path) -> None:
    run, family = mid_run(tmp_path / "run", "--speed", "4")
    run.family()["node n005"].kill()
    exit_code, said = run.finish()
    metrics = run.metrics()
    assert exit_code == 1
    assert "n005 died" in said
    assert str(tmp_path / "run" / "logs" / "n005.log") in said.replace("\n", "")
    [death] = metrics["processes"]["died"]
    assert (death["id"], death["why"]) == ("n005", "signal 9")
    assert 0 < death["t"] < 41
    assert max(pq.read_table(tmp_path / "run" / "tracks.parquet")["step"].to_pylist()) == 40
    assert metrics["frames"]["host_lost"] == 0
    until(lambda: leftovers(family) == [], timeout=5)


@pytest.mark.parametrize("number", [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.long), signal.SIGHUP])
def test_a_run_ended_early_leaves_a_whole_folder(number: int, tmp_path: Path) -> None:
    """A signal reaches the launcher alone: the terminal signals a whole process group, and the nodes are not in it."""
    run, family = mid_run(tmp_path / "run")
    assert os.getpgid(run.process.pid) not in {os.getpgid(process.pid) for process in family}
    time.sleep(4)
    run.process.send_signal(number)
    exit_code, said = run.finish()
    assert exit_code == 128 + number, said
    assert verify(tmp_path / "run" / "run.rrd").returncode == 0
    metrics = run.metrics()
    frames = metrics["frames"]
    assert frames["expected"] == frames["delivered"] + sum(frames["lost"].values())
    assert frames["host_lost"] == 0
    assert 0 < len(pq.read_table(tmp_path / "run" / "tracks.parquet")) < 2 * 40
    until(lambda: leftovers(family) == [], timeout=5)


def test_a_killed_launcher_leaves_no_process_behind(tmp_path: Path) -> None:
    run, family = mid_run(tmp_path / "run")
    assert len(leftovers(family)) > 16
    run.process.kill()
    run.process.wait()
    until(lambda: leftovers(family) == [], timeout=5)


@pytest.mark.parametrize("title", ["recorder", "fusion", "router"])
def test_the_death_of_one_does_not_hold_up_the_rest(title: str, tmp_path: Path) -> None:
    run, family = mid_run(tmp_path / "run", "--speed", "8")
    run.family()[title].kill()
    exit_code, said = run.finish()
    assert (exit_code, f"{title} died" in said) == (1, True), said
    metrics = run.metrics()
    assert title in [death["id"] for death in metrics["processes"]["died"]]
    assert metrics["frames"]["sent"] > 0
    whys = {"recorder": "the recorder died", "fusion": "end of the scenario", "router": "end of the scenario"}
    assert (metrics["complete"], metrics["end_reason"]) == (title != "recorder", whys[title])
    until(lambda: leftovers(family) == [], timeout=5)


@pytest.mark.alone
def test_a_thousand_nodes_that_report_at_once_lose_nothing(tmp_path: Path) -> None:
    """Threshold 0: everybody hears the target in every step and reports in the same instant."""
    all_of_them = ("--link", "ideal", "--set", "sensor.threshold=0", "--set", "target.steps=6")
    exit_code, said = on_time(tmp_path / "run", "spcpf", "--nodes", "1000", *all_of_them, speeds=(1.0, 0.3))
    assert exit_code == 0, said
    metrics = json.loads((tmp_path / "run" / METRICS).read_text())
    frames, processes = metrics["frames"], metrics["processes"]
    assert processes["started"] > 900
    assert frames["sent"] == 6 * (processes["started"] - 1)
    assert frames["expected"] == frames["delivered"] == frames["sent"]
    assert (frames["host_lost"], metrics["recorder"]["dropped"]) == (0, 0)
    assert processes["pss_mb_per_node"] < 4.5


def test_no_peer_can_bring_a_run_down(tmp_path: Path) -> None:
    """A stranger in the field sends what no node would: it is refused and counted, and all goes on."""
    run, _ = mid_run(tmp_path / "run", "--speed", "4", "--link", "ideal")
    manifest = run.manifest()
    with open_client(manifest["endpoint"], manifest["run"]) as session:
        inbox = "data/field/to/fusion/stranger/doa"
        for payload, attachment in [
            (b"\xc1 no message", Envelope(1).pack()),
            (b"\x90" * 5000, Envelope(2).pack()),
            (encode(Doa(1, 90.0, 60.0)), Envelope(3).pack()),
            (encode(Doa(1, 90.0, 60.0)), Envelope(3).pack()),
            (encode(Doa(1, 90.0, 60.0)), Envelope(2**62).pack()),
            (encode(Doa(1, 90.0, 60.0)), b"no envelope"),
            (encode(Doa(1, 90.0, 60.0)), None),
        ]:
            session.put(inbox, payload, attachment=attachment)
        session.put("data/field/to/fusion/too/many/chunks/here", b"")
        session.put("telemetry/n001/event", b"\xc1")
        session.put("telemetry/n001/final/deep", b"")
    exit_code, said = run.finish()
    frames = run.metrics()["frames"]
    assert exit_code == 1
    strange = "2 pieces of telemetry that no process of the run sent (interference)"
    assert f"failed: somebody interfered with the run: {strange}" in said
    assert "refused, as no frames of this field: 2 (envelope), 1 (key), 4 (sender), 1 (size)" in said
    assert frames["refused"] == {"envelope": 2, "key": 1, "sender": 4, "size": 1}
    assert frames["expected"] == frames["delivered"] == frames["sent"]
    assert (frames["ignored"], frames["duplicate"], frames["host_lost"]) == (0, 0, 0)
    assert not run.metrics()["trackers"]["imm-ukf"]["lost"]
