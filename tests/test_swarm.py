"""A field on Docker Swarm: its stack on a swarm of this machine alone, whose replicas are the slices."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import uuid
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.containers import image, output
from tests.running import PATIENCE_S, until

__all__ = ["image"]

pytestmark = [pytest.mark.engine, pytest.mark.timeout(900)]  # the first build of the images takes minutes
SCENARIO = "spcpf --nodes 9 --set sensor.threshold=0.5 --set target.steps=30"
SLICES = 3


def tried(*command: str) -> None:
    """Clean up, as far as there is something."""
    subprocess.run(command, capture_output=True, check=False, timeout=PATIENCE_S)


@pytest.fixture(scope="module")
def swarm(image: str) -> Iterator[str]:
    """The image, on an engine that is a swarm; it is none afterwards if it was none before."""
    state = output("docker", "info", "--format", "{{.Swarm.LocalNodeState}}").strip()
    if state == "inactive":
        output("docker", "swarm", "init", "--advertise-addr", "127.0.0.1")
    try:
        yield image
    finally:
        if state == "inactive":
            tried("docker", "swarm", "leave", "--force")


class Stack:
    """The stack of deploy/swarm.yaml under a name of its own."""

    def __init__(self, image: str, runs: Path) -> None:
        self.name, self.runs = f"trackfield-test-{uuid.uuid4().hex[:8]}", runs
        certificates = runs.with_name(f"{runs.name}-certificates")
        made = (
            "certificates",
            *SCENARIO.split(),
            "--out",
            str(certificates),
            "--host",
            "launcher",
            "--slices",
            str(SLICES),
        )
        output(sys.executable, "-m", "launcher", *made)
        environment = {
            "TRACKFIELD_IMAGE": image,
            "TRACKFIELD_RUN": SCENARIO,
            "TRACKFIELD_RUNS": str(runs),
            "TRACKFIELD_CERTIFICATES": str(certificates),
            "TRACKFIELD_USER": f"{os.getuid()}:{os.getgid()}",
            "TRACKFIELD_TOKEN": uuid.uuid4().hex,
            "SLICES": str(SLICES),
        }
        file = ("--compose-file", "deploy/swarm.yaml")
        output("docker", "stack", "deploy", "--resolve-image", "never", *file, self.name, **environment)

    def tasks(self, service: str) -> list[tuple[str, str]]:
        """Slot and state of the tasks of a service that were ever started."""
        listed = ("--no-trunc", "--format", "{{.Name}} {{.CurrentState}}")
        lines = output("docker", "service", "ps", *listed, f"{self.name}_{service}").splitlines()
        return [(name.rpartition(".")[2], state.split()[0]) for name, state in (line.split(" ", 1) for line in lines)]

    def containers(self, service: str) -> list[str]:
        label = f"label=com.docker.swarm.service.name={self.name}_{service}"
        return output("docker", "ps", "--quiet", "--filter", label).split()

    def said(self, service: str) -> str:
        done = subprocess.run(
            ["docker", "service", "logs", "--raw", f"{self.name}_{service}"],
            capture_output=True,
            text=True,
            check=False,
            timeout=PATIENCE_S,
        )
        return done.stdout + done.stderr

    def ended(self) -> str:
        """Wait for the end of the run: the state of its launcher."""
        return str(until(lambda: next((state for _, state in self.tasks("launcher") if state in ENDS), None)))

    def metrics(self) -> dict[str, Any]:
        [file] = self.runs.glob("*/metrics.json")
        return json.loads(file.read_text())  # type: ignore[no-any-return]

    def down(self) -> None:
        tried("docker", "stack", "rm", self.name)
        until(lambda: self.name not in output("docker", "network", "ls"))


ENDS = ("Complete", "Failed", "Rejected")


@pytest.fixture
def stack(swarm: str, tmp_path: Path) -> Iterator[Stack]:
    found = Stack(swarm, tmp_path)
    try:
        yield found
    finally:
        found.down()


def test_a_field_in_replicas_is_tracked_to_the_end(stack: Stack) -> None:
    assert stack.ended() == "Complete", stack.said("launcher")
    assert stack.metrics()["trackers"]["imm-ukf"]["verdict"] == "tracked"
    assert not any(count for count in stack.metrics()["interference"].values() if isinstance(count, int))
    until(lambda: set(stack.tasks("slice")) == {(str(slot), "Complete") for slot in range(1, SLICES + 1)})
    said = stack.said("slice")
    for number in range(1, SLICES + 1):
        assert f"slice {number}/{SLICES}: all its processes are done" in said


def test_a_slice_that_is_killed_is_started_again_by_the_engine(stack: Stack) -> None:
    until(lambda: "t = 0 s" in stack.said("launcher"))
    killed = stack.containers("slice")[0]
    output("docker", "kill", killed)
    assert stack.ended() == "Failed", stack.said("launcher")  # what nobody had planned is told
    said = stack.said("launcher")
    died = {one["id"] for one in stack.metrics()["processes"]["died"]}
    assert len(died) == 3 + 1, said  # of the field, and the slice itself
    assert said.count("(started again)") >= 3, said
    assert sorted(state for _, state in stack.tasks("slice")).count("Failed") == 1
    assert len(stack.tasks("slice")) == SLICES + 1
