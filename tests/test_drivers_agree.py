"""The same story under both drivers, told by roles that talk back."""

from __future__ import annotations

from pathlib import Path as FilePath
from typing import Any

import pytest

from launcher.records import FieldInfo, Place, Plan
from launcher.run import run_processes, run_virtual
from tests.toys import party
from trackfield.role import NS
from trackfield.world.path import Path

LINKS: dict[str, dict[str, Any]] = {
    "ideal": {"model": "ideal"},
    "fixed": {"model": "fixed", "loss": 0.1, "delay_ms": 5},
    "gilbert_elliott": {
        "model": "gilbert_elliott", "good_s": 5, "bad_s": 1, "loss_good": 0, "loss_bad": 1, "delay_ms": 20, "jitter_ms": 10,
    },
}  # fmt: skip


class Nobody:
    def starting(self, ready: int, of: int) -> None: ...
    def running(self, status: dict[str, Any]) -> None: ...


def plan_of(link: str, *, talkers: int = 8, steps: int = 20, speed: float = 1.0) -> Plan:
    run, processes = party(talkers, steps=steps, link=LINKS[link], speed=speed)
    path = Path.of([(0.0, 0.0, 0.0, 1.0, 0.0), (float(steps), float(steps), 0.0, 1.0, 0.0)])
    places = tuple(Place(p.id, p.role, p.x, p.y) for p in processes)
    truth = tuple((float(t), float(t), 0.0) for t in range(steps))
    trackers = tuple(p.id for p in processes)
    return Plan(
        run,
        tuple(processes),
        path,
        FieldInfo(run.run, "toys", places, truth, (), trackers, run.end_ns / NS),
        NS,
    )


@pytest.mark.parametrize("link", LINKS)
def test_roles_that_talk_back_tell_the_same_story(link: str, tmp_path: FilePath) -> None:
    """Requests, replies and feedback whose order decides everything after: equal to the last bit."""
    import pyarrow.parquet as pq

    folders = [tmp_path / "processes", tmp_path / "virtual"]
    for folder in folders:
        (folder / "logs").mkdir(parents=True)
    plan = plan_of(link, speed=5)
    real = run_processes(plan, folders[0], Nobody())
    run_virtual(plan, folders[1])
    print(real.metrics["timing"], real.metrics["frames"])
    assert real.exit_code == 0
    assert real.metrics["timing"]["host_late"] == 0
    for table in ("tracks", "messages"):
        a, b = (pq.read_table(folder / f"{table}.parquet") for folder in folders)
        assert a.equals(b), table
