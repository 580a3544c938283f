"""What certificates cost a run as processes, as a table in Markdown: the same field without and with them.

    python -m bench.secured [--nodes 121 --secure]

Without a number, all of ``NODES`` are run both ways; with one, that case is printed as JSON.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Final

from bench.scale import SEED, Column, Figures, machine, table

NODES: Final = (25, 121)
STEPS: Final = 20
"""Of emulated time, a second each."""
COLUMNS: Final[tuple[Column, ...]] = (
    ("processes", lambda f: f["processes"]),
    ("reach each other by", lambda f: "TLS, certificates, access rules" if f["secure"] else "a socket in a folder"),
    ("ready after (s)", lambda f: f"{f['ready_s']:.1f}"),
    ("memory of a node (MB)", lambda f: f"{f['pss_mb']:.2f}"),
    ("put to receiver, median (ms)", lambda f: f"{f['latency_ms']['p50']:.2f}"),
    ("99 % within (ms)", lambda f: f"{f['latency_ms']['p99']:.1f}"),
    ("processor time of all (s)", lambda f: f"{f['cpu_s']:.1f}"),
)


def measure(nodes: int, *, secure: bool) -> Figures:
    """The figures of one run, of its metrics.json. Raises ``CalledProcessError`` if it failed."""
    with tempfile.TemporaryDirectory() as scratch:
        options = ["--nodes", str(nodes), "--seed", str(SEED), "--set", f"target.steps={STEPS}"]
        command = [sys.executable, "-m", "launcher", "run", "zhai-spcpf", *options, *(["--secure"] if secure else [])]
        subprocess.run([*command, "--quiet", "--out", str(Path(scratch) / "run")], check=True)
        metrics = json.loads((Path(scratch) / "run" / "metrics.json").read_text())
    return {
        "processes": metrics["processes"]["started"],
        "secure": secure,
        "ready_s": metrics["processes"]["ready_s"],
        "pss_mb": metrics["processes"]["pss_mb_per_node"],
        "latency_ms": metrics["host_latency_ms"],
        "cpu_s": metrics["cpu_s"],
    }


def main() -> None:
    """See the module's docstring."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--nodes", type=int, help="the number of sensors of a single case")
    parser.add_argument("--secure", action="store_true", help="this case with certificates")
    asked = parser.parse_args()
    if asked.nodes is not None:
        print(json.dumps(measure(asked.nodes, secure=asked.secure)))
        return
    print(f"{machine()}\n")
    print(table(COLUMNS, [measure(nodes, secure=secure) for nodes in NODES for secure in (False, True)]))


if __name__ == "__main__":
    main()
