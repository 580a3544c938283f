"""The script that brings about planned faults of containers, with an engine that only writes down what it is told."""

from __future__ import annotations

import json
import os
import re
import signal
import stat
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from launcher.away import Away, not_done
from tests.running import PATIENCE_S, until

SCRIPT = Path(__file__).parents[1] / "containers" / "faults.py"
ENGINE = f"""#!{sys.executable}
import json, sys, time
from pathlib import Path
home = Path(__file__).parent
with (home / "told").open("a") as told:
    told.write(json.dumps([time.monotonic_ns(), *sys.argv[1:]]) + "\\n")
if sys.argv[1:2] == ["inspect"]:
    print(json.dumps([{{"NetworkSettings": {{"Networks": {{
        "p_field": {{"Aliases": ["node", "abc"]}}, "p_backbone": {{"Aliases": None}}}}}}}}]))
elif sys.argv[1:3] == ["network", "inspect"]:
    print(json.dumps([{{"Labels": {{"com.docker.compose.network": sys.argv[3].removeprefix("p_")}}}}]))
elif (home / "broken").exists():
    sys.exit("Error response from daemon: No such container: " + sys.argv[-1])
"""
Written = dict[str, Any]


class Host:
    """The script beside a run, whose folder this is, and an engine."""

    def __init__(self, home: Path) -> None:
        self.folder, self._engine = home / "runs" / "run-1", home / "engine"
        for folder in (self.folder, self._engine):
            folder.mkdir(parents=True)
        docker = self._engine / "docker"
        docker.write_text(ENGINE)
        docker.chmod(docker.stat().st_mode | stat.S_IXUSR)
        self.begun_ns = 0
        path = f"{self._engine}:{os.environ['PATH']}"
        self.process = subprocess.Popen([sys.executable, SCRIPT, home / "runs"], env={**os.environ, "PATH": path})
        until(self._waits)

    def _waits(self) -> bool:
        """Whether it looks for a run: it catches signals by then."""
        caught = re.search(r"SigCgt:\s*(\w+)", Path(f"/proc/{self.process.pid}/status").read_text())
        return caught is not None and bool(int(caught[1], 16) >> (signal.SIGTERM - 1) & 1)

    def tell(self, *faults: Away, places: dict[str, str], over: bool = False, lead_s: float = 0.5, **more: Any) -> None:
        """What the run tells; it begins so many seconds after it told first."""
        self.begun_ns = self.begun_ns or time.monotonic_ns() + round(lead_s * 1e9)
        told = {"begun_ns": self.begun_ns, "speed": 1.0, "first_step_s": 0.0, "places": places, "over": over, **more}
        part = self.folder / "part"
        part.write_text(json.dumps({**told, "faults": [one.plain() for one in faults]}))
        part.replace(self.folder / "places.json")

    def break_engine(self) -> None:
        (self._engine / "broken").touch()

    def log(self) -> list[str]:
        """The lines of the log so far."""
        file = self.folder / "containers.log"
        return file.read_text().splitlines() if file.exists() else []

    def done(self) -> list[tuple[float, str]]:
        """What the engine was told to do, and when: s after the beginning of the run."""
        lines = (self._engine / "told").read_text().splitlines() if (self._engine / "told").exists() else []
        told = [json.loads(line) for line in lines]
        return [((at - self.begun_ns) / 1e9, " ".join(words)) for at, *words in told if "inspect" not in words]


@pytest.fixture
def host(tmp_path: Path) -> Iterator[Host]:
    one = Host(tmp_path)
    yield one
    one.process.kill()
    one.process.wait()


def commands(host: Host) -> list[str]:
    return [command for _, command in host.done()]


def test_each_kind_is_done_at_its_times_and_undone(host: Host) -> None:
    faults = (
        Away(0, "container-kill", "n001", 0.2),
        Away(1, "container-restart", "n002", 0.4, 1.4),
        Away(2, "container-pause", "n003", 0.6, 1.6),
        Away(3, "container-disconnect", "n004", 0.8, 1.8, "field"),
        Away(4, "container-disconnect", "n005", 1.0, 2.0),
    )
    places = {f"n00{i}": f"c{i}" for i in range(1, 6)}
    host.tell(*faults, places=places)
    until(lambda: len(host.log()) == 9)
    host.tell(*faults, places=places, over=True)
    assert host.process.wait(PATIENCE_S) == 0
    planned = {
        "kill c1": 0.2,
        "kill c2": 0.4,
        "pause c3": 0.6,
        "network disconnect p_field c4": 0.8,
        "network disconnect p_field c5": 1.0,
        "network disconnect p_backbone c5": 1.0,
        "start c2": 1.4,
        "unpause c3": 1.6,
        "network connect --alias node --alias abc p_field c4": 1.8,
        "network connect p_backbone c5": 2.0,
        "network connect --alias node --alias abc p_field c5": 2.0,
    }
    assert sorted(commands(host)) == sorted(planned)
    assert all(at >= planned[command] for at, command in host.done())
    assert not_done(faults, "\n".join(host.log()), 60.0) == []
    [line] = (line for line in host.log() if "n001" in line)
    assert re.fullmatch(r"container-kill of n001 at 0.2 s: docker kill c1, from \d+\.\d{3} s to \d+\.\d{3} s", line)


def test_times_count_from_the_first_step_at_the_speed_of_the_run(host: Host) -> None:
    host.tell(Away(0, "container-kill", "n001", 4.0), places={"n001": "c1"}, speed=10.0, first_step_s=6.0)
    until(host.log)
    [(at, _)] = host.done()
    assert at >= 1.0
    assert re.search(r"at 4 s: docker kill c1, from (\S+) s", host.log()[0])


def ended(host: Host) -> None:
    host.tell(*PAUSED, places={"n001": "c1", "n002": "c2"}, over=True)


def terminated(host: Host) -> None:
    host.process.send_signal(signal.SIGTERM)


PAUSED = (
    Away(0, "container-pause", "n001", 0.1, 1000.0),
    Away(1, "container-disconnect", "n002", 0.1, 1000.0, "field"),
)


@pytest.mark.parametrize("end", [ended, terminated])
def test_what_is_away_when_the_run_ends_early_is_let_go(host: Host, end: Callable[[Host], None]) -> None:
    host.tell(*PAUSED, places={"n001": "c1", "n002": "c2"})
    until(lambda: len(host.log()) == 2)
    end(host)
    assert host.process.wait(PATIENCE_S) == 0
    assert commands(host)[2:] == ["unpause c1", "network connect --alias node --alias abc p_field c2"]
    assert len(host.log()) == 4


def test_one_that_is_killed_stays_so_when_the_run_ends_early(host: Host) -> None:
    fault, places = Away(0, "container-restart", "n001", 0.1, 1000.0), {"n001": "c1"}
    host.tell(fault, places=places)
    until(host.log)
    host.tell(fault, places=places, over=True)
    assert host.process.wait(PATIENCE_S) == 0
    assert commands(host) == ["kill c1"]


def test_who_has_the_place_by_then_is_struck(host: Host) -> None:
    fault = Away(0, "container-kill", "n001", 2.0)
    host.tell(fault, places={"n001": "c1"})
    host.tell(fault, places={"n001": "c9"})
    until(host.log)
    assert commands(host) == ["kill c9"]


def test_what_the_engine_refuses_is_told_and_the_rest_goes_on(host: Host) -> None:
    faults = (Away(0, "container-pause", "n001", 0.1, 0.6), Away(1, "container-kill", "n002", 0.3))
    host.break_engine()
    host.tell(*faults, places={"n001": "c1"})
    until(lambda: len(host.log()) == 3)
    assert sorted(host.log()) == [
        "container-kill of n002 at 0.3 s: failed: nobody has the place of n002",
        "container-pause of n001 at 0.1 s ends: failed: it did not begin",
        "container-pause of n001 at 0.1 s: failed: Error response from daemon: No such container: c1",
    ]
    assert not_done(faults, "\n".join(host.log()), 60.0) == list(faults)


def test_a_run_of_before_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "runs" / "old").mkdir(parents=True)
    about = {
        "begun_ns": time.monotonic_ns(),
        "speed": 1.0,
        "first_step_s": 0.0,
        "places": {"n001": "c1"},
        "over": False,
    }
    fault = Away(0, "container-kill", "n001", 0.1).plain()
    (tmp_path / "runs" / "old" / "places.json").write_text(json.dumps({**about, "faults": [fault]}))
    host = Host(tmp_path)
    try:
        host.tell(Away(0, "container-kill", "n001", 0.1), places={"n001": "c2"})
        until(host.log)
        assert commands(host) == ["kill c2"]
    finally:
        host.process.kill()
        host.process.wait()
