"""A field of containers for tests: the images of this source, its containers, and what the engine says of them."""

from __future__ import annotations

import fcntl
import os
import re
import shlex
import subprocess
import time
import uuid
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SCENARIO = "spcpf --nodes 25 --set field.spacing_m=75 --set sensor.threshold=0.6"
"""All hear the vehicle all the time, so that it shows who is there."""
LEASE_S = 10.0
"""After which Zenoh gives up a session of which nothing is heard."""


def output(*command: str, **environment: str) -> str:
    done = subprocess.run(
        command, cwd=ROOT, env=os.environ | environment, capture_output=True, text=True, timeout=900, check=False
    )
    assert done.returncode == 0, done.stderr[-2000:]
    return done.stdout


def found_or_skip(script: str) -> str:
    """What a script of containers/ finds; skips the test if that is nothing, for the reason that it gives."""
    done = subprocess.run([ROOT / script], capture_output=True, text=True, timeout=900, check=False)
    if done.returncode:
        pytest.skip(done.stderr[done.stderr.find("no ") :].strip())
    return done.stdout.strip()


@pytest.fixture(scope="module")
def image() -> str:
    """The images of this source; skips the test where there is no engine, no Compose or no base image for them."""
    found_or_skip("containers/compose")
    base = found_or_skip("containers/base")
    (ROOT / "build").mkdir(exist_ok=True)
    with (ROOT / "build" / "image.lock").open("w") as lock:  # another process of the tests may be at it
        fcntl.flock(lock, fcntl.LOCK_EX)
        output("make", "image", "IMAGE=trackfield-test", f"BASE={base}")
    return "trackfield-test"


class Field:
    """Containers of one project, asked for by their labels; its certificates are beside its folder."""

    def __init__(self, image: str, folder: Path, scenario: str = SCENARIO) -> None:
        self.project, self.folder = f"trackfield-test-{uuid.uuid4().hex[:8]}", folder
        self.certificates = folder.with_name(f"{folder.name}-certificates")
        user = output("containers/user").strip()
        if os.getuid() == 0:
            os.chown(folder, *map(int, user.split(":")))
        self.launcher: subprocess.Popen[str]
        self.compose = [*output("containers/compose").split(), "--project-name", self.project]
        self.environment = {
            "COMPOSE_HTTP_TIMEOUT": "300",  # an older Compose gives up after a minute of a busy machine
            "COMPOSE_PROFILES": "parts",
            "TRACKFIELD_IMAGE": image,
            "TRACKFIELD_RUN": scenario,
            "TRACKFIELD_RUNS": str(folder),
            "TRACKFIELD_USER": user,
            "TRACKFIELD_CERTIFICATES": str(self.certificates),
            "TRACKFIELD_TOKEN": uuid.uuid4().hex,
        }
        output("containers/certificates", str(self.certificates), *shlex.split(scenario), **self.environment)

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
