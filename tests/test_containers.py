"""Fields of containers, where an engine is: real images, networks, and things that happen to containers."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

from tests.containers import LEASE_S, Field, image, output

__all__ = ["image"]

pytestmark = [pytest.mark.engine, pytest.mark.timeout(900)]  # the first build of the images takes minutes


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
