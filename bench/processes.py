"""One run as processes, measured from outside.

    python -m bench.processes --nodes 121 --seconds 20 --seed 1

Prints the cost as JSON: the processor time by group of processes over some seconds of the running field, and the run's
own figures at its end.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Final

import psutil

SETTLE_S: Final = 3.0
"""Time after the start until the steady state is measured."""
GROUPS: Final = ("node", "fusion", "router", "recorder", "launcher")


def measure(nodes: int, steps: int, seconds: float, seed: int) -> dict[str, Any]:
    """A run of the packaged scenario with about so many nodes, for so many steps of a second."""
    with tempfile.TemporaryDirectory() as scratch:
        out = Path(scratch) / "run"
        asked = ["--nodes", str(nodes), "--set", f"target.steps={steps}", "--seed", str(seed), "--out", str(out)]
        command = [sys.executable, "-m", "launcher.cli", "run", "zhai-spcpf", *asked]
        with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as run:
            assert run.stderr is not None
            for line in run.stderr:
                if line.startswith("t = "):  # emulated time has started
                    break
            shares = _shares(run.pid, seconds) if run.poll() is None else {}
            said = run.stderr.read()
        if not (out / "metrics.json").exists():
            raise RuntimeError(f"there was no run: {said}")
        metrics = json.loads((out / "metrics.json").read_text())
    return {"nodes": metrics["processes"]["started"] - 1, "shares": shares, "exit_code": run.returncode, **metrics}


def _shares(launcher: int, seconds: float) -> dict[str, float]:
    """Share of the cores' total processor time, by group of processes."""
    time.sleep(SETTLE_S)
    family = [(process, _group(process)) for process in _family(launcher)]
    before, begun = _used(family), time.monotonic()
    time.sleep(seconds)
    after, had = _used(family), (time.monotonic() - begun) * (os.cpu_count() or 1)
    return {group: (after[group] - before[group]) / had for group in GROUPS}


def _family(launcher: int) -> list[psutil.Process]:
    """The launcher and all its descendants."""
    return [psutil.Process(launcher), *psutil.Process(launcher).children(recursive=True)]


def _group(process: psutil.Process) -> str:
    """The group of a process; the process that forks the others belongs to the launcher."""
    words = " ".join(process.cmdline()).split()
    return words[1] if words[0] == "trackfield" and words[1] in GROUPS else "launcher"


def _used(family: Iterable[tuple[psutil.Process, str]]) -> dict[str, float]:
    """Processor time so far (s) by group; to the nanosecond, as a node uses less than a clock tick in many a second."""
    used = dict.fromkeys(GROUPS, 0.0)
    for process, group in family:
        used[group] += time.clock_gettime(clock(process.pid))
    return used


def clock(pid: int) -> int:
    """Linux's clock of the processor time of a process, with all its threads (clock_getcpuclockid(3))."""
    return (~pid << 3) | 2


def main() -> None:
    """See the module's docstring."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--nodes", type=int, default=121)
    parser.add_argument("--steps", type=int, default=60)
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--seed", type=int, default=1)
    print(json.dumps(measure(**vars(parser.parse_args()))))


if __name__ == "__main__":
    main()
