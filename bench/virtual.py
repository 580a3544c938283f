"""One run in virtual time, measured from inside.

    python -m bench.virtual --nodes 1000 --link ideal --seconds 600 --seed 1

Prints its cost as JSON. Times are wall time unless they say otherwise; memory is resident, in MB (10^6 bytes).
"""

from __future__ import annotations

import argparse
import json
import resource
import tempfile
import time
from collections.abc import Iterator
from itertools import pairwise
from math import dist
from pathlib import Path
from typing import Any, Final

import psutil

from launcher.plan.prepare import load, planned
from launcher.processes.garbage import look_seldom
from launcher.record.journal import Journal
from launcher.record.ledger import Ledger
from trackfield.drivers.virtual import Virtual
from trackfield.role import NS
from trackfield.scenario import Scenario

SPACING_M: Final = 50.0
SPEED_M_S: Final = 10.0
MIDDLE_M: Final = 800.0
"""Side of the square that the target sweeps, all of it within radio range of the centre."""
LANES_M: Final = 100.0
"""Distance between the target's lanes."""


def scenario(nodes: int, link: str, seconds: int, seed: int) -> Scenario:
    """The packaged field at its own spacing, with a target that is always among its sensors."""
    settings = {
        "target.path": "waypoints",
        "target.waypoints": route(SPACING_M * (round(nodes**0.5) - 1), seconds),
        "field.spacing_m": SPACING_M,
        "fusion.prior": "none",
    }
    values = [f"{key}={json.dumps(value)}" for key, value in settings.items()]
    return load("zhai-spcpf", settings=values, seed=seed, nodes=nodes, link=link, trackers=["imm-ukf"])


def route(field_m: float, seconds: int) -> list[tuple[float, float, float]]:
    """Waypoints (s, m, m) of a target that sweeps the middle of a square field at constant speed, for ``seconds``."""
    side_m = min(field_m, MIDDLE_M)
    corner_m, t, legs = (field_m - side_m) / 2, 0.0, [(0.0, 0.0, 0.0)]
    for here, there in pairwise(_corners(side_m)):
        left, takes = seconds - t, dist(here, there) / SPEED_M_S
        t += min(takes, left)
        x, y = (a + min(left / takes, 1.0) * (b - a) for a, b in zip(here, there, strict=True))
        legs.append((t, x, y))
        if takes >= left:
            break
    return [(t, corner_m + x, corner_m + y) for t, x, y in legs]


def _corners(side_m: float) -> Iterator[tuple[float, float]]:
    """Along one lane and back along the next, up to the last; from there back on the same path, and so on."""
    lanes = max(round(side_m / LANES_M), 1)
    ends = [((0.0, y), (side_m, y)) for y in (lane * side_m / lanes for lane in range(lanes + 1))]
    way = [corner for lane, (west, east) in enumerate(ends) for corner in ((east, west) if lane % 2 else (west, east))]
    yield way[0]
    while True:
        yield from way[1:]
        way.reverse()


class Probe:
    """Counts the events of a run, and measures its memory after each quarter of the emulated time."""

    def __init__(self, virtual: Virtual) -> None:
        self.virtual, self.events = virtual, 0
        self.rss_mb: list[float] = []
        self._next_ns = 0

    def __call__(self) -> bool:
        """Called before each event; never ends the run."""
        self.events += 1
        if self.virtual.now_ns >= self._next_ns:
            self.look()
        return False

    def look(self) -> None:
        """Record the present memory, and set the time of the next measurement."""
        self.rss_mb.append(rss_mb())
        self._next_ns = round(len(self.rss_mb) / 4 * self.virtual.end_ns)


def rss_mb() -> float:
    """Resident memory of this process (MB)."""
    return float(psutil.Process().memory_info().rss / 1e6)


class Laps:
    """Wall and processor time of one stage after the other, in s."""

    def __init__(self) -> None:
        self.taken: dict[str, tuple[float, float]] = {}
        self._last = self._now()

    def lap(self, stage: str) -> None:
        """End a stage."""
        before, self._last = self._last, self._now()
        self.taken[stage] = (self._last[0] - before[0], self._last[1] - before[1])

    @staticmethod
    def _now() -> tuple[float, float]:
        return time.perf_counter(), time.process_time()


def measure(nodes: int, link: str, seconds: int, seed: int) -> dict[str, Any]:
    """Plan, build, run and close one run."""
    laps = Laps()
    plan = planned(scenario(nodes, link, seconds, seed))
    laps.lap("plan")
    with tempfile.TemporaryDirectory() as folder:
        ledger = Ledger(plan.run, plan.processes)
        journal = Journal(plan, ledger, Path(folder))
        virtual = Virtual(plan.run, plan.processes, ledger)
        laps.lap("build")
        probe = Probe(virtual)
        virtual.run(stop=probe)
        probe.look()
        laps.lap("run")
        metrics = journal.tables([], messages=ledger.leaving.left)
        journal.draw()
        laps.lap("close")
    return {
        "nodes": len(plan.info.places) - 1,
        "link": link,
        "emulated_s": plan.run.end_ns / NS,
        "laps": laps.taken,
        "events": probe.events,
        "rss_mb": probe.rss_mb,
        "peak_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6,
        "frames": metrics["frames"],
        "rmse_m": metrics["trackers"]["imm-ukf"]["rmse"]["position"],
    }


def main() -> None:
    """See the module's docstring."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--nodes", type=int, default=1000)
    parser.add_argument("--link", default="ideal")
    parser.add_argument("--seconds", type=int, default=600)
    parser.add_argument("--seed", type=int, default=1)
    look_seldom()  # as the command line does
    print(json.dumps(measure(**vars(parser.parse_args()))))


if __name__ == "__main__":
    main()
