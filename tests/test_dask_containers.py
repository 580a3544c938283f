"""Studies on a Dask cluster of containers: a scheduler and two workers, of the image that fields have."""

from __future__ import annotations

import subprocess
import sys
import uuid
from collections.abc import Iterator
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from tests.containers import image, output
from tests.running import PATIENCE_S, killed_on_failure, until
from tests.test_dask import FIELD

__all__ = ["image"]

pytestmark = [pytest.mark.engine, pytest.mark.timeout(900)]  # the first build of the images takes minutes
WORKERS = 2


class Cluster:
    """A scheduler and its workers, in a network of their own."""

    def __init__(self, image: str) -> None:
        self.name = f"trackfield-test-{uuid.uuid4().hex[:8]}"
        output("docker", "network", "create", self.name)
        self.image, self.containers = f"{image}:full", list[str]()
        scheduler = self._started("dask", "scheduler", "--no-dashboard")
        where = output(
            "docker", "inspect", "--format", "{{range .NetworkSettings.Networks}}{{.IPAddress}}{{end}}", scheduler
        )
        self.address = f"tcp://{where.strip()}:8786"
        self.workers = [self._started("dask", "worker", self.address, *THREAD) for _ in range(WORKERS)]

    def _started(self, *command: str) -> str:
        container = output("docker", "run", "--detach", "--init", "--network", self.name, self.image, *command).strip()
        self.containers.append(container)
        return container

    def down(self) -> None:
        subprocess.run(["docker", "rm", "--force", *self.containers], capture_output=True, check=False)
        subprocess.run(["docker", "network", "rm", self.name], capture_output=True, check=False)


ADDRESS = "{{range .NetworkSettings.Networks}}{{.IPAddress}}{{end}}"
THREAD = ("--nthreads", "1", "--no-dashboard")


@pytest.fixture
def cluster(image: str) -> Iterator[Cluster]:
    found = Cluster(image)
    try:
        yield found
    finally:
        found.down()


def study(home: Path, *arguments: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "launcher", "study", *FIELD, "--vary", "link.model=ideal,fixed", *arguments]
    return subprocess.Popen(command, cwd=home, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)


def ended(running: subprocess.Popen[str]) -> str:
    with killed_on_failure(running):
        _, said = running.communicate(timeout=PATIENCE_S)
    assert running.returncode == 0, said
    return said


def test_a_study_on_containers_is_the_same_and_survives_one_of_them(cluster: Cluster, tmp_path: Path) -> None:
    running = study(tmp_path, "--seeds", "60", "--dask", cluster.address, "--out", "there")
    with killed_on_failure(running):
        until(lambda: len(list(tmp_path.rglob("0*.parquet"))) >= 3)
    output("docker", "kill", cluster.workers[0])
    said = ended(running)
    assert f"computed by {WORKERS} workers with {WORKERS} threads at {cluster.address}" in said
    ended(study(tmp_path, "--seeds", "60", "--out", "here"))
    for name in ("study.csv", "summary.csv"):
        assert (tmp_path / "there" / name).read_bytes() == (tmp_path / "here" / name).read_bytes()
    assert pq.read_table(tmp_path / "there" / "tracks.parquet") == pq.read_table(tmp_path / "here" / "tracks.parquet")
