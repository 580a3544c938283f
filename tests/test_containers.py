"""Fields of containers, where an engine is: real images, networks, and things that happen to containers."""

from __future__ import annotations

import json
import os
import re
import subprocess
import time
import uuid
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

ROOT = Path(__file__).parents[1]
SCENARIO = "spcpf --nodes 25 --set field.spacing_m=75 --set sensor.threshold=0.6"
"""All hear the vehicle all the time, so that it shows who is there."""
LEASE_S = 10.0
"""After which Zenoh gives up a session of which nothing is heard."""

pytestmark = pytest.mark.timeout(900)  # the first build of the images takes minutes


def output(*command: str, **environment: str) -> str:
    done = subprocess.run(
        command, cwd=ROOT, env=os.environ | environment, capture_output=True, text=True, timeout=600, check=False
    )
    assert done.returncode == 0, done.stderr[-2000:]
    return done.stdout


def found_or_skip(script: str) -> str:
    """What a script of containers/ finds; skips the test if that is nothing, for the reason that it gives."""
    done = subprocess.run([ROOT / script], capture_output=True, text=True, timeout=600, check=False)
    if done.returncode:
        pytest.skip(done.stderr[done.stderr.find("no ") :].strip())
    return done.stdout.strip()


@pytest.fixture(scope="module")
def image() -> str:
    """The image of this source; skips the test where there is no engine, no Compose or no base image for it."""
    found_or_skip("containers/compose")
    base = found_or_skip("containers/base")
    output("make", "image", "IMAGE=trackfield-test", f"BASE={base}")
    return "trackfield-test"


class Field:
    """Containers of one project, asked for by their labels."""

    def __init__(self, image: str, folder: Path, scenario: str = SCENARIO) -> None:
        self.project, self.folder = f"trackfield-test-{uuid.uuid4().hex[:8]}", folder
        self.launcher: subprocess.Popen[str]
        self.compose = [*output("containers/compose").split(), "--project-name", self.project]
        self.environment = {
            "COMPOSE_HTTP_TIMEOUT": "300",  # an older Compose gives up after a minute of a busy machine
            "TRACKFIELD_IMAGE": image,
            "TRACKFIELD_RUN": scenario,
            "TRACKFIELD_RUNS": str(folder),
            "TRACKFIELD_USER": f"{os.getuid()}:{os.getgid()}",
            "TRACKFIELD_TOKEN": uuid.uuid4().hex,
        }

    def up(self, **containers: int) -> None:
        """Start so many containers of these services, and the router."""
        services = [name.replace("_", "-") for name in containers]
        scale = [f"--scale={name}={count}" for name, count in zip(services, containers.values(), strict=True)]
        output(*self.compose, "up", "--detach", *scale, "router", *services, **self.environment)

    def launch(self) -> None:
        """Start the run."""
        command = [*self.compose, "run", "--rm", "-T", "launcher"]
        with (self.folder / "said").open("w") as said:
            self.launcher = subprocess.Popen(
                command, cwd=ROOT, env=os.environ | self.environment, stdout=said, stderr=said, text=True
            )

    def until(self, t_s: float) -> None:
        """Wait until the run says that it is there, or further: it says its time every few seconds, not each second."""
        deadline = time.monotonic() + 150
        while not any(float(t) >= t_s for t in re.findall(r"^t = (\d+) s", self.said(), re.MULTILINE)):
            assert self.launcher.poll() is None, self.said()
            assert time.monotonic() < deadline, self.said()
            time.sleep(0.05)

    def finish(self) -> int:
        """Wait for the end of the run, and its exit code."""
        return self.launcher.wait(200)

    def said(self) -> str:
        return (self.folder / "said").read_text()

    def labelled(self, *command: str, **labels: str) -> list[str]:
        """What a listing of the engine's has of this project under these labels."""
        wanted = {"project": self.project, **labels}
        filters = [f"--filter=label=com.docker.compose.{label}={value}" for label, value in wanted.items()]
        return output("docker", *command, "--quiet", *filters).split()

    def hosts(self, service: str) -> list[str]:
        """The host names of a service's containers, which are the beginnings of their ids."""
        return self.labelled("ps", "--all", service=service)

    def network(self, name: str) -> str:
        [network] = self.labelled("network", "ls", network=name)
        return network

    def down(self) -> None:
        if hasattr(self, "launcher"):
            self.launcher.kill()
            self.launcher.wait()
        if containers := self.labelled("ps", "--all"):
            output("docker", "rm", "--force", *containers)
        # An engine may forget to let go of a container that was cut off, and keep the network until it restarts.
        subprocess.run(["docker", "network", "rm", *self.labelled("network", "ls")], capture_output=True, check=False)


@dataclass
class Seen:
    """A run in whose course some containers fared ill."""

    code: int
    said: str
    folder: Path
    metrics: dict[str, Any]
    killed: str
    restarted: str
    paused: str
    cut: str


@pytest.fixture(scope="module")
def seen(image: str, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Seen]:
    field = Field(image, tmp_path_factory.mktemp("runs"))
    try:
        field.up(node=25, fusion=1)
        field.launch()
        field.until(0)
        time.sleep(5)  # steps in which all report
        killed, restarted, paused, cut = field.hosts("node")[:4]
        network = field.network("field")
        output("docker", "kill", killed, restarted)
        output("docker", "pause", paused)
        output("docker", "network", "disconnect", network, cut)
        time.sleep(LEASE_S / 2)
        output("docker", "start", restarted)
        time.sleep(LEASE_S)
        output("docker", "unpause", paused)
        output("docker", "network", "connect", network, cut)
        code = field.finish()
        [folder] = (path for path in field.folder.iterdir() if path.is_dir())
        metrics = json.loads((folder / "metrics.json").read_text())
        yield Seen(code, field.said(), folder, metrics, killed, restarted, paused, cut)
    finally:
        field.down()


def test_a_field_of_containers_tracks_to_the_end_whatever_befalls_some(seen: Seen) -> None:
    assert seen.code == 1, seen.said
    assert [tracker["lost"] for tracker in seen.metrics["trackers"].values()] == [False, False]
    assert max(pq.read_table(seen.folder / "tracks.parquet")["step"].to_pylist()) == 60


def test_nobody_else_interfered(seen: Seen) -> None:
    """Nor were containers that were cut off, or that came twice, taken for strangers."""
    assert set(seen.metrics["interference"].values()) == {0}


def test_who_is_gone_is_reported(seen: Seen) -> None:
    died = {death["host"]: death for death in seen.metrics["processes"]["died"]}
    assert set(died) == {seen.killed, seen.restarted}
    for death in died.values():
        assert death["why"] == "gone: its token was lost"
        assert 0 < death["t"] < 40
        assert f"{death['id']} died at {death['t']:.1f} s" in seen.said


def test_who_came_back_is_reported_with_the_time_that_it_was_away(seen: Seen) -> None:
    stopped = {stop["host"]: stop for stop in seen.metrics["processes"]["stopped"]}
    assert set(stopped) == {seen.paused, seen.cut}
    for stop in stopped.values():
        assert 0 < stop["t"] < stop["t"] + stop["s"] < 60


def test_a_container_that_starts_again_takes_its_place_again(seen: Seen) -> None:
    [place] = [death["id"] for death in seen.metrics["processes"]["died"] if death["host"] == seen.restarted]
    lives = {
        row["incarnation"] for row in pq.read_table(seen.folder / "messages.parquet").to_pylist() if row["src"] == place
    }
    assert lives == {0, 1}


def test_every_frame_is_accounted_for(seen: Seen) -> None:
    frames = seen.metrics["frames"]
    assert (
        frames["expected"]
        == frames["delivered"] + sum(frames["lost"].values()) + frames["host_lost"] + frames["host_late"]
    )


BEYOND = "yang-ecpa --set sensor.waveform=false"
"""Passes at 10, 30, 56.5 and 76.5 s."""


@dataclass
class Beyond:
    """A run with a camera in whose course some containers fared ill, and the hosts of these."""

    code: int
    said: str
    metrics: dict[str, Any]
    rows: list[dict[str, Any]]
    gone: str
    video: str
    control: str
    told: str


@pytest.fixture(scope="module")
def beyond(image: str, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Beyond]:
    field = Field(image, tmp_path_factory.mktemp("runs"), BEYOND)
    try:
        field.up(ear=5, gateway=1, camera_control=1, camera=1, video=1, system=1)
        field.launch()
        field.until(10)
        [control], [gateway] = field.hosts("camera-control"), field.hosts("gateway")
        [video], [gone] = field.hosts("video"), field.hosts("system")
        backbone = field.network("backbone")
        time.sleep(5)  # the first fix has come
        told = output("docker", "exec", gone, "trackfield", "control", "latest", "status")
        output("docker", "kill", gone, video)
        for one in (control, gateway):  # a gateway that is in both networks goes on through the other one
            output("docker", "network", "disconnect", backbone, one)
        time.sleep(LEASE_S / 2)
        output("docker", "start", video)
        time.sleep(LEASE_S)
        for one in (control, gateway):
            output("docker", "network", "connect", backbone, one)
        code = field.finish()
        [folder] = (path for path in field.folder.iterdir() if path.is_dir())
        rows = pq.read_table(folder / "messages.parquet").to_pylist()
        yield Beyond(
            code, field.said(), json.loads((folder / "metrics.json").read_text()), rows, gone, video, control, told
        )
    finally:
        field.down()


def test_a_field_with_a_gateway_goes_on_whatever_befalls_what_is_beyond_it(beyond: Beyond) -> None:
    assert beyond.code == 1, beyond.said
    assert beyond.metrics["complete"]
    assert {name: one["lost"] for name, one in beyond.metrics["trackers"].items()} == {"ml": False, "ecpa": False}
    assert set(beyond.metrics["interference"].values()) == {0}


def test_containers_beyond_the_gateway_that_are_gone_are_reported(beyond: Beyond) -> None:
    assert {death["host"] for death in beyond.metrics["processes"]["died"]} == {beyond.gone, beyond.video}
    assert beyond.control in {stop["host"] for stop in beyond.metrics["processes"]["stopped"]}


def test_the_camera_looks_at_the_last_vehicle_when_all_are_back(beyond: Beyond) -> None:
    assert beyond.metrics["camera"]["shots"] >= 2
    last = [row for row in beyond.rows if row["src"] == "video" and row["kind"] == "captured"][-1]
    assert last["incarnation"] == 1
    assert last["outcome"] == "delivered"
    assert beyond.metrics["camera"]["in_frame"]["at_aim"] > 0.4


def test_system_control_takes_orders_in_its_container(beyond: Beyond) -> None:
    assert [line.split() for line in beyond.told.splitlines()] == [
        ["base", "running"],
        ["camera-control", "running"],
        ["video", "running"],
    ]
