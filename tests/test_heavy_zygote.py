"""Roles that need numpy are forked from a zygote that has it: what they share, and what becomes of them with it."""

from __future__ import annotations

import os
import signal
import statistics
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import psutil
import pytest

from bench.ready import with_centres
from launcher.plan.prepare import load, planned
from launcher.processes.children import HEAVY_ZYGOTE, ZYGOTE
from launcher.processes.deployment import Deployment
from launcher.processes.preload import REHEARSAL, preload_of
from launcher.records import RECORDER, Plan
from launcher.run import run_processes
from launcher.show import Quiet
from tests.two_centres import two_centres

CENTRES = 64


def pss_mb(plan: Plan, folder: Path, names: Sequence[str]) -> list[float]:
    """The memory of these processes when all are ready."""
    with Deployment(plan, folder) as field:
        field.wait_ready(lambda missing, of: False)
        return [psutil.Process(field.pids()[name]).memory_full_info().pss / 1e6 for name in names]


def test_one_process_with_numpy_needs_no_zygote_of_its_own(tmp_path: Path) -> None:
    plan = planned(load("spcpf", nodes=16))
    assert preload_of(plan.processes) == (("node.role", REHEARSAL), (), frozenset())
    with Deployment(plan, tmp_path) as field:
        assert HEAVY_ZYGOTE not in field.pids()


def test_two_are_forked_from_the_heavy_one_and_nodes_from_the_other(tmp_path: Path) -> None:
    plan = with_centres(planned(load("spcpf", nodes=16)), 2)
    assert preload_of(plan.processes).heavy == ("fusion.role",)
    with Deployment(plan, tmp_path) as field:
        pids = field.pids()
        parents = {name: psutil.Process(pid).ppid() for name, pid in pids.items()}
    assert {parents["fusion"], parents["c001"]} == {pids[HEAVY_ZYGOTE]}
    assert {parents["n001"], parents[RECORDER]} == {pids[ZYGOTE]}


def test_a_node_of_the_same_making_as_one_that_fuses_has_its_zygote_too() -> None:
    """The light zygote must not import numpy for it, and it should not import numpy by itself."""
    plan = planned(load("spcpf", nodes=16))
    centre = next(life for life in plan.processes if life.sink)
    found = preload_of([*plan.processes, replace(centre, id="c000", sink=False)])
    assert (found.light, found.heavy) == (("node.role", REHEARSAL), ("fusion.role",))


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP])
def test_all_end_with_the_heavy_zygote_too_and_it_does_not_stay_stopped(number: int, tmp_path: Path) -> None:
    plan = two_centres(settings=["target.steps=12"])

    class Operator(Quiet):
        done = False

        def running(self, status: dict[str, object]) -> None:
            if status and not self.done and float(str(status["t_s"])) >= 3:
                self.done = True
                [zygote] = [
                    one
                    for one in psutil.Process().children(recursive=True)
                    if one.cmdline() and one.cmdline()[0] == f"trackfield {HEAVY_ZYGOTE}"
                ]
                os.kill(zygote.pid, number)

    metrics = run_processes(plan, tmp_path, Operator()).metrics
    if number == signal.SIGKILL:
        deaths = [(death["id"], death["why"]) for death in metrics["processes"]["died"]]
        assert deaths == [(HEAVY_ZYGOTE, "signal 9")]
        assert metrics["ended_s"] < 12
    else:
        [stop] = metrics["processes"]["stopped"]
        assert (stop["id"], metrics["processes"]["died"]) == (HEAVY_ZYGOTE, [])
        assert metrics["complete"]


@pytest.mark.alone
def test_sixty_four_processes_share_the_memory_of_numpy(tmp_path: Path) -> None:
    """Of 320 processes; one that imported numpy by itself has more than twice as much."""
    field = planned(load("zhai-spcpf", nodes=256))
    [alone] = pss_mb(field, tmp_path, ["fusion"])
    shared = with_centres(field, CENTRES)
    names = [life.name for life in shared.processes if life.sink]
    assert (len(shared.processes), len(names)) == (320, CENTRES)
    assert statistics.fmean(pss_mb(shared, tmp_path, names)) < 0.5 * alone
