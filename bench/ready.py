"""How long it takes until all processes of a run are ready, and what each part of it costs, as a table in Markdown.

    python -m bench.ready [--processes 1000 [--heavy 1]]

Without a number, the table has one row for each of ``CASES``; with one, that case is printed as JSON. Nodes are those
of ``zhai-spcpf``; processes with numpy are its fusion centre, and others like it to which nobody reports.
"""

from __future__ import annotations

import statistics
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

import psutil

from bench.processes import clock
from bench.scale import Column, Figures, machine, one_or_all, table
from launcher.plan.prepare import load, planned
from launcher.processes.children import ZYGOTES
from launcher.processes.deployment import Deployment
from launcher.records import RECORDER, ROUTER, Plan

CASES: Final = ((121, 1), (320, 64), (1_000, 1), (3_000, 1))
"""About how many processes, and how many of them with numpy."""
PSS_SAMPLE: Final = 16


def with_centres(plan: Plan, heavy: int) -> Plan:
    """The plan with so many processes with numpy, all like its fusion centre."""
    centre = next(life for life in plan.processes if life.sink)
    more = [replace(centre, id=f"c{number:03}") for number in range(1, heavy)]
    return replace(plan, processes=(*plan.processes, *more))


def measure(processes: int, heavy: int, seed: int) -> Figures:
    """Start about so many processes, and end them when all are ready."""
    plan = with_centres(planned(load("zhai-spcpf", nodes=processes - heavy, seed=seed)), heavy)
    with tempfile.TemporaryDirectory() as folder:
        begun, own_cpu_s = time.monotonic(), time.process_time()
        with Deployment(plan, Path(folder)) as field:
            field.wait_ready(lambda missing, of: False)
            ready_s = time.monotonic() - begun
            cpu_s = {"launcher": time.process_time() - own_cpu_s, **_used(plan, field.pids())}
            memory = _memory(plan, field.pids())
    return {"processes": len(plan.processes), "heavy": heavy, "ready_s": ready_s, "cpu_s": cpu_s, "pss_mb": memory}


def _used(plan: Plan, pids: Mapping[str, int]) -> dict[str, float]:
    """Processor time so far (s) by part."""
    parts = {"router": [ROUTER], "recorder": [RECORDER], "zygotes": [name for name in ZYGOTES if name in pids]}
    parts |= {"light": _named(plan, sink=False), "heavy": _named(plan, sink=True)}
    return {part: sum(time.clock_gettime(clock(pids[name])) for name in names) for part, names in parts.items()}


def _memory(plan: Plan, pids: Mapping[str, int]) -> dict[str, float]:
    """PSS of a process (MB) without and with numpy, the mean of some."""
    found = {}
    for part, names in {"light": _named(plan, sink=False), "heavy": _named(plan, sink=True)}.items():
        some = names[:: max(len(names) // PSS_SAMPLE, 1)]
        found[part] = statistics.fmean(psutil.Process(pids[name]).memory_full_info().pss / 1e6 for name in some)
    return found


def _named(plan: Plan, *, sink: bool) -> list[str]:
    return [life.name for life in plan.processes if life.sink is sink]


def _each(part: str, how_many: Callable[[Figures], int]) -> Callable[[Figures], object]:
    return lambda f: f"{1000 * f['cpu_s'][part] / how_many(f):.1f}"


def _all(f: Figures) -> int:
    return int(f["processes"])


COLUMNS: Final[Sequence[Column]] = (
    ("processes", lambda f: f"{f['processes']:,}"),
    ("with numpy", lambda f: f["heavy"]),
    ("ready s", lambda f: f"{f['ready_s']:.1f}"),
    ("CPU s, all", lambda f: f"{sum(f['cpu_s'].values()):.1f}"),
    ("CPU ms, a node", _each("light", lambda f: f["processes"] - f["heavy"])),
    ("CPU ms, one with numpy", _each("heavy", lambda f: f["heavy"])),
    ("router", _each("router", _all)),
    ("launcher", _each("launcher", _all)),
    ("zygotes", _each("zygotes", _all)),
    ("PSS MB, a node", lambda f: f"{f['pss_mb']['light']:.1f}"),
    ("PSS MB, one with numpy", lambda f: f"{f['pss_mb']['heavy']:.1f}"),
)
"""Router, launcher and zygotes: ms of processor time for each process."""


def main() -> None:
    """See the module's docstring."""
    if found := one_or_all("bench.ready", __doc__, measure, CASES, "heavy"):
        print(f"Until all processes are ready ({machine()}):\n\n{table(COLUMNS, found)}")


if __name__ == "__main__":
    main()
