"""How long the processes of a field in slices take until they have joined, what that costs, and how right their clocks
are, as a table in Markdown.

    python -m bench.slices [--processes 500 [--slices 2]]

Without a number, the table has one row for each of ``CASES``; with one, that case is printed as JSON. All slices are on
this machine; nodes are those of ``zhai-spcpf``. As all clocks are one here, whatever offset is measured is an error.
"""

from __future__ import annotations

import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, Final

import psutil
import zenoh

from bench.processes import clock
from bench.scale import Column, Figures, machine, one_or_all, table
from launcher.plan.prepare import load, planned
from launcher.processes.endpoint import Way
from launcher.processes.gathering import Gathering, Guests
from launcher.records import ROUTER
from launcher.timeline.view import free_port
from trackfield.drivers.exchange.intake import Refusals
from trackfield.drivers.hostclock import HostClock
from trackfield.drivers.joining import clock as joining
from trackfield.drivers.session import open_client, open_session, router_settings

CASES: Final = ((121, 1), (121, 3), (500, 1), (500, 4), (1_000, 4))
"""About how many processes, and in how many slices."""
PSS_SAMPLE: Final = 16
READINGS: Final = 50
"""How often each clock is measured."""


def measure(processes: int, slices: int, seed: int) -> Figures:
    """Start about so many processes in so many slices, and end them when all have joined."""
    plan = planned(load("zhai-spcpf", nodes=processes - 1, seed=seed))
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with tempfile.TemporaryDirectory() as home, ExitStack() as stack:
        folder = Path(home)
        begun, own_cpu_s = time.monotonic(), time.process_time()
        way, guests = Way(listen=(endpoint,)), Guests(plan.in_field)
        field = stack.enter_context(Gathering(plan, folder, way, guests))
        started = [stack.enter_context(_slice(f"{i}/{slices}", endpoint, folder)) for i in range(1, slices + 1)]
        field.wait_ready(lambda missing, of: False)
        ready_s = time.monotonic() - begun
        families = [psutil.Process(one.pid).children(recursive=True) for one in started]
        titled = [(" ".join(child.cmdline()).strip(), child) for family in families for child in family]
        nodes = [child for title, child in titled if title.startswith("trackfield node ")]
        routers = [child for title, child in titled if title == f"trackfield {ROUTER}"]
        cpu_s = {
            "launcher": time.process_time() - own_cpu_s,
            "router": time.clock_gettime(clock(field.pids()[ROUTER])),
            "slices' routers": sum(time.clock_gettime(clock(one.pid)) for one in routers),
            "slices": sum(time.clock_gettime(clock(one.pid)) for one in started),
            "nodes": sum(time.clock_gettime(clock(one.pid)) for one in nodes),
        }
        some = nodes[:: max(len(nodes) // PSS_SAMPLE, 1)]
        return {
            "processes": len(nodes),
            "slices": slices,
            "ready_s": ready_s,
            "cpu_s": cpu_s,
            "pss_mb": statistics.fmean(one.memory_full_info().pss / 1e6 for one in some),
            "router_mb": statistics.fmean(one.memory_full_info().pss / 1e6 for one in routers),
            "clock": _clocks(field, endpoint, folder),
        }


@contextmanager
def _slice(which: str, endpoint: str, folder: Path) -> Iterator[subprocess.Popen[bytes]]:
    """A slice of the run, as the command line starts it."""
    command = [sys.executable, "-m", "launcher", "field", "--slice", which, "--connect", endpoint, "--wait"]
    out = folder / f"slice-{which.partition('/')[0]}"
    with (folder / f"{out.name}.log").open("w") as log:
        process = subprocess.Popen([*command, "--out", str(out)], stderr=log)
    try:
        yield process
    finally:
        process.terminate()
        process.wait()


def _clocks(field: Gathering, endpoint: str, folder: Path) -> dict[str, float]:
    """Errors and uncertainties (ms) of the clock as a slice measures it, by a router of its own: medians and worst."""
    own = f"unixsock-stream/{folder / 'clock.sock'}"
    with open_session(router_settings([own], upstream=endpoint)), open_client(own, field.plan.run.run) as session:
        _until_heard(session, field)
        found = [joining.measured(session, field.seal) for _ in range(READINGS)]
    errors = sorted(abs(one.offset_ns) / 1e6 for one in found)
    unsure = sorted(one.uncertainty_ns / 1e6 for one in found)
    return {
        "error_ms": statistics.median(errors),
        "worst_ms": errors[-1],
        "uncertainty_ms": statistics.median(unsure),
        "most_uncertain_ms": unsure[-1],
    }


def _until_heard(session: zenoh.Session, field: Gathering) -> None:
    """Wait until the launcher answers, which takes a moment by a router that is new."""
    joining.set_clock(session, HostClock(), field.seal, Refusals())


def _each(part: str) -> Any:
    return lambda f: f"{1000 * f['cpu_s'][part] / f['processes']:.1f}"


COLUMNS: Final[Sequence[Column]] = (
    ("nodes", lambda f: f"{f['processes']:,}"),
    ("slices", lambda f: f["slices"]),
    ("joined s", lambda f: f"{f['ready_s']:.1f}"),
    ("CPU ms, a node", _each("nodes")),
    ("launcher", _each("launcher")),
    ("its router", _each("router")),
    ("slices' routers", _each("slices' routers")),
    ("slices", _each("slices")),
    ("PSS MB, a node", lambda f: f"{f['pss_mb']:.1f}"),
    ("a slice's router", lambda f: f"{f['router_mb']:.0f}"),
    ("clock off by ms, median", lambda f: f"{f['clock']['error_ms']:.3f}"),
    ("at most", lambda f: f"{f['clock']['worst_ms']:.3f}"),
    ("uncertainty ms, median", lambda f: f"{f['clock']['uncertainty_ms']:.2f}"),
)
"""Launcher, routers and slices: ms of processor time for each node."""


def main() -> None:
    """See the module's docstring."""
    if found := one_or_all("bench.slices", __doc__, measure, CASES, "slices"):
        print(f"Until all nodes have joined ({machine()}):\n\n{table(COLUMNS, found)}")


if __name__ == "__main__":
    main()
