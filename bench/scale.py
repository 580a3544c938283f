"""The cost of a run as the field grows, as tables in Markdown.

    python -m bench.scale [--virtual] [--processes]

Both kinds of runs if none is named. Every figure is from a run in a process of its own, with seed 1.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import subprocess
import sys
from collections.abc import Callable, Iterable, Sequence
from typing import Any, Final

import psutil

from launcher.processes.garbage import look_seldom

SEED: Final = 1
VIRTUAL: Final = tuple((n, link, 600) for n in (100, 1_000, 10_000, 100_000) for link in ("ideal", "lognormal_prr"))
HOUR: Final = (100_000, "lognormal_prr", 3600)
PROCESSES: Final = (121, 1_000, 3_000)
STEADY_S: Final = 20.0

Figures = dict[str, Any]
Column = tuple[str, Callable[[Figures], object]]


def _lap(stage: str, which: int) -> Callable[[Figures], object]:
    return lambda f: f"{f['laps'][stage][which]:.1f}"


def _memory(f: Figures) -> str:
    return " / ".join(f"{mb:.0f}" for mb in f["rss_mb"][1:])


def _share(*groups: str) -> Callable[[Figures], object]:
    return lambda f: f"{sum(f['shares'][group] for group in groups or f['shares']):.1%}"


VIRTUAL_COLUMNS: Final[Sequence[Column]] = (
    ("nodes", lambda f: f"{f['nodes']:,}"),
    ("link", lambda f: f["link"]),
    ("emulated s", lambda f: f"{f['emulated_s']:.0f}"),
    ("plan s", _lap("plan", 0)),
    ("build s", _lap("build", 0)),
    ("run s", _lap("run", 0)),
    ("run s (CPU)", _lap("run", 1)),
    ("close s", _lap("close", 0)),
    ("all s (CPU)", lambda f: f"{sum(cpu for _, cpu in f['laps'].values()):.1f}"),
    ("emulated s per s", lambda f: f"{f['emulated_s'] / sum(wall for wall, _ in f['laps'].values()):.0f}"),
    ("events per s", lambda f: f"{f['events'] / f['laps']['run'][0]:,.0f}"),
    ("RSS MB at 25 / 50 / 75 / 100 %", _memory),
    ("peak MB", lambda f: f"{f['peak_mb']:.0f}"),
    ("frames sent, delivered", lambda f: f"{f['frames']['sent']}, {f['frames']['delivered']}"),
)
PROCESS_COLUMNS: Final[Sequence[Column]] = (
    ("nodes", lambda f: f"{f['nodes']:,}"),
    ("ready s", lambda f: f"{f['processes']['ready_s']:.1f}"),
    ("CPU, all", _share()),
    ("CPU, nodes", _share("node")),
    ("CPU, centre", _share("fusion")),
    ("CPU, router", _share("router")),
    ("CPU, recorder", _share("recorder")),
    ("CPU, launcher", _share("launcher")),
    ("PSS MB per node", lambda f: f"{f['processes']['pss_mb_per_node']:.2f}"),
    ("frames sent", lambda f: f["frames"]["sent"]),
    ("host_late", lambda f: f["timing"]["host_late"]),
    ("host_lost", lambda f: f["frames"]["host_lost"]),
    ("recorder dropped", lambda f: f["recorder"]["dropped"]),
    ("host latency ms p50, p99", lambda f: "{p50:.2f}, {p99:.2f}".format(**f["host_latency_ms"])),
)


def measured(module: str, **arguments: object) -> Figures:
    """The figures of a run in a process of its own. Raises ``CalledProcessError`` if it failed."""
    options = [word for name, value in arguments.items() for word in (f"--{name}", str(value))]
    command = [sys.executable, "-m", module, *options, "--seed", str(SEED)]
    print(f"{' '.join(command[1:])} ...", file=sys.stderr, flush=True)
    figures: Figures = json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout)
    return figures


def table(columns: Sequence[Column], rows: Iterable[Figures]) -> str:
    """In Markdown."""
    lines = [[head for head, _ in columns], ["---:" for _ in columns]]
    lines += [[str(cell(row)) for _, cell in columns] for row in rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def machine() -> str:
    """The machine and its load."""
    memory, load = psutil.virtual_memory().total / 2**30, os.getloadavg()[0]
    return f"{os.cpu_count()} cores, {memory:.0f} GiB, Python {platform.python_version()}; load average {load:.1f}"


def one_or_all(
    module: str, about: str | None, measure: Callable[..., Figures], cases: Sequence[tuple[int, int]], second: str
) -> list[Figures]:
    """What the command line asks a bench of processes for: those of ``cases`` that it measures, each by itself.

    A case has the number of processes and of something else (``second``). If the command line names one, it is
    measured here and printed as JSON, and there are no figures to return. ``about`` is the help.
    """
    parser = argparse.ArgumentParser(description=about, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--processes", type=int)
    parser.add_argument(f"--{second}", type=int, default=1)
    parser.add_argument("--seed", type=int, default=SEED)
    asked: dict[str, Any] = vars(parser.parse_args())
    if asked["processes"]:
        look_seldom()  # as the command line does
        print(json.dumps(measure(**asked)))
        return []
    return [measured(module, **{"processes": processes, second: other}) for processes, other in cases]


def main() -> None:
    """See the module's docstring."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--virtual", action="store_true", help="runs in virtual time")
    parser.add_argument("--processes", action="store_true", help="runs as processes")
    asked = parser.parse_args()
    both = not (asked.virtual or asked.processes)
    if asked.virtual or both:
        print(f"In virtual time ({machine()}):\n")
        found = [measured("bench.virtual", nodes=n, link=link, seconds=s) for n, link, s in (*VIRTUAL, HOUR)]
        print(table(VIRTUAL_COLUMNS, found), end="\n\n", flush=True)
    if asked.processes or both:
        print(f"As processes ({machine()}):\n")
        found = [measured("bench.processes", nodes=n, seconds=STEADY_S) for n in PROCESSES]
        print(table(PROCESS_COLUMNS, found), flush=True)


if __name__ == "__main__":
    main()
