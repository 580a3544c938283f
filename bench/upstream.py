"""What the link of a slice carries, and what the routers on both sides of it cost, as a table in Markdown.

    python -m bench.upstream [--slices 3 --nodes 900]

Without numbers, the table has one row for each of ``CASES``; with both, that case is printed as JSON. The scenario is
``zhai-spcpf``, all slices are on this machine, and each reaches the run's router through a relay that counts bytes.
"""

from __future__ import annotations

import argparse
import json
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, Final

import psutil

from bench.processes import clock
from bench.relay import Relay, free_port
from bench.scale import Column, Figures, machine, measured, table

CASES: Final = ((1, 300), (3, 300), (3, 900))
"""How many slices, and about how many nodes in all."""
STEPS: Final = 90
SETTLE_S: Final = 5.0
"""After the start, until the steady state is measured."""
STEADY_S: Final = 30.0
PATIENCE_S: Final = 600.0

Family = dict[str, list[psutil.Process]]


@contextmanager
def running(command: Sequence[str], said: Path) -> Iterator[subprocess.Popen[bytes]]:
    """``trackfield`` with these arguments, which says to a file; killed at the end of the block."""
    with (
        said.open("w") as stream,
        subprocess.Popen([sys.executable, "-m", "launcher", *command], stderr=stream) as process,
    ):
        try:
            yield process
        finally:
            process.kill()


def measure(slices: int, nodes: int, seed: int) -> Figures:
    """The figures of a run of about so many nodes in so many slices."""
    with tempfile.TemporaryDirectory(prefix="trackfield-") as scratch, ExitStack() as stack:
        home, port = Path(scratch), free_port()
        relays = [Relay(port) for _ in range(slices)]
        asked = ["--nodes", str(nodes), "--set", f"target.steps={STEPS}", "--seed", str(seed), "--wait", "600"]
        outside = ["--field", "external", "--listen", f"tcp/127.0.0.1:{port}", "--out", str(home / "run")]
        run = stack.enter_context(running(["run", "zhai-spcpf", *asked, *outside], home / "run.said"))
        hosts = []
        for number, relay in enumerate(relays, 1):
            share = ["--slice", f"{number}/{slices}", "--connect", f"tcp/127.0.0.1:{relay.port}", "--wait"]
            command = ["field", *share, "--out", str(home / f"slice-{number}")]
            hosts.append(stack.enter_context(running(command, home / f"slice-{number}.said")))
        _until_started(run, home / "run.said")
        joined = sum(relay.bytes for relay in relays)
        time.sleep(SETTLE_S)
        steady = _steady(_family([run]), _family(hosts), relays)
        run.wait(PATIENCE_S)
        metrics = json.loads((home / "run" / "metrics.json").read_text())
        codes = [run.returncode, *(host.wait(PATIENCE_S) for host in hosts)]
    started, ready_s = metrics["processes"]["started"], metrics["processes"]["ready_s"]
    own = {"slices": slices, "started": started, "ready_s": ready_s, "joined": joined / started, "codes": codes}
    return {**own, **steady, "frames": metrics["frames"]}


def _until_started(run: subprocess.Popen[bytes], said: Path) -> None:
    deadline = time.monotonic() + PATIENCE_S
    while "\nt = " not in said.read_text():
        if run.poll() is not None or time.monotonic() > deadline:
            raise RuntimeError(f"there was no run: {said.read_text()}")
        time.sleep(0.05)


def _family(roots: Iterable[subprocess.Popen[bytes]]) -> Family:
    """All processes of a run or of its slices: nodes, routers, and all others."""
    found: Family = {"node": [], "router": [], "other": []}
    for root in roots:
        for process in (psutil.Process(root.pid), *psutil.Process(root.pid).children(recursive=True)):
            words = " ".join(process.cmdline()).split()
            group = words[1] if words[0] == "trackfield" and words[1] in found else "other"
            found[group].append(process)
    return found


def _steady(run: Family, hosts: Family, relays: Sequence[Relay]) -> Figures:
    """What the running field costs: ms of processor time and bytes in each second, and memory (MB)."""
    groups = {
        "node": hosts["node"],
        "slice router": hosts["router"],
        "run router": run["router"],
        "other": run["other"],
    }
    cpu, passed, begun = _used(groups), [relay.bytes for relay in relays], time.monotonic()
    time.sleep(STEADY_S)
    took_s = time.monotonic() - begun
    return {
        "cpu_ms": {name: 1000 * (used - cpu[name]) / took_s for name, used in _used(groups).items()},
        "link": statistics.fmean(relay.bytes - before for relay, before in zip(relays, passed, strict=True)) / took_s,
        "besides_mb": sum(map(_pss_mb, [*hosts["router"], *hosts["other"]])) / len(relays),
    }


def _used(groups: Family) -> dict[str, float]:
    return {name: sum(time.clock_gettime(clock(one.pid)) for one in some) for name, some in groups.items()}


def _pss_mb(process: psutil.Process) -> float:
    return float(process.memory_full_info().pss) / 1e6


COLUMNS: Final[Sequence[Column]] = (
    ("slices", lambda f: f["slices"]),
    ("processes", lambda f: f["started"]),
    ("ready s", lambda f: f"{f['ready_s']:.1f}"),
    ("bytes of a link, to join, each process", lambda f: f"{f['joined']:,.0f}"),
    ("bytes a second of a link", lambda f: f"{f['link']:,.0f}"),
    ("CPU ms a second: all nodes", lambda f: f"{f['cpu_ms']['node']:.1f}"),
    ("routers of the slices", lambda f: f"{f['cpu_ms']['slice router']:.1f}"),
    ("router of the run", lambda f: f"{f['cpu_ms']['run router']:.1f}"),
    ("PSS MB of a slice beside its nodes", lambda f: f"{f['besides_mb']:.0f}"),
    ("frames sent, lost by hosts", lambda f: f"{f['frames']['sent']}, {f['frames']['host_lost']}"),
    ("exit codes", lambda f: "".join(map(str, f["codes"]))),
)


def main() -> None:
    """See the module's docstring."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--slices", type=int)
    parser.add_argument("--nodes", type=int, default=300)
    parser.add_argument("--seed", type=int, default=1)
    asked: dict[str, Any] = vars(parser.parse_args())
    if asked["slices"]:
        print(json.dumps(measure(**asked)))
        return
    found = [measured("bench.upstream", slices=slices, nodes=nodes) for slices, nodes in CASES]
    print(f"Fields in slices ({machine()}):\n\n{table(COLUMNS, found)}")


if __name__ == "__main__":
    main()
