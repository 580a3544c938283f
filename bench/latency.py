"""The latency of a frame from its put to its receiver, beside bare puts through the same router.

    python -m bench.latency --seconds 60 --seed 1

Both run at the same time: a run as processes over an ideal link, and bare Zenoh publishers and subscribers on its
router. In the first run about one sensor at a time reports, in the second four at the same instant, as in the scenario.
Beside each, one bare publisher puts alone, and four in the same instant.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Final

import numpy as np

from bench import bare_zenoh

THRESHOLDS: Final = (0.8, 0.75)
"""Of the sensors: about one of them hears the target at a time, or four."""
TOGETHER: Final = (1, 4)
"""How many bare publishers put in the same instant."""
EARLIER_S: Final = 8.0
"""Bare puts end before the run closes its router."""

Figures = dict[str, Any]


def measure(threshold: float, seconds: int = 60, seed: int = 1) -> Figures:
    """The latency (ms) of a run's frames (``run``), and of bare puts by how many are put at once: number, p50, p99."""
    with tempfile.TemporaryDirectory() as scratch:
        out = Path(scratch) / "run"
        settings = [f"target.steps={seconds}", f"sensor.threshold={threshold}", "fusion.trackers=['imm-ukf']"]
        asked = [word for setting in settings for word in ("--set", setting)]
        command = [
            sys.executable,
            "-m",
            "launcher.cli",
            "run",
            "zhai-spcpf",
            "--link",
            "ideal",
            "--seed",
            str(seed),
            *asked,
        ]
        with subprocess.Popen([*command, "--out", str(out)], stderr=subprocess.PIPE, text=True) as run:
            assert run.stderr is not None
            for line in run.stderr:
                if line.startswith("t = "):  # emulated time has started
                    break
            endpoint = json.loads((out / "manifest.json").read_text())["endpoint"]
            plain = bare_puts(endpoint, seconds - EARLIER_S)
            said = run.stderr.read()
        if run.returncode:
            raise RuntimeError(f"the run failed: {said}")
        metrics = json.loads((out / "metrics.json").read_text())
    frames = metrics["frames"]["delivered"]
    found = {"run": {"frames": frames, **metrics["host_latency_ms"]}, "at_once": frames / seconds}
    return found | {str(count): _figures(took) for count, took in plain.items()}


def bare_puts(endpoint: str, seconds: float) -> dict[int, list[int]]:
    """What bare puts took (ns), by how many were put at once; each kind in a namespace that the run does not hear."""
    with ExitStack() as stack:
        hearers = {}
        for count in TOGETHER:
            hearers[count] = stack.enter_context(
                bare_zenoh.process(bare_zenoh.hear_latencies, endpoint, f"bare-{count}")
            )
            hearers[count].recv()
            for _ in range(count):
                phase = TOGETHER.index(count) / len(TOGETHER)
                stack.enter_context(bare_zenoh.process(bare_zenoh.put_now_and_then, endpoint, f"bare-{count}", phase))
        time.sleep(seconds)
        for hearer in hearers.values():
            hearer.send(None)
        return {count: hearer.recv() for count, hearer in hearers.items()}


def _figures(took: list[int]) -> Figures:
    p50, p99 = np.quantile(took, (0.5, 0.99)) / 1e6
    return {"frames": len(took), "p50": float(p50), "p99": float(p99)}


def table(runs: list[Figures]) -> str:
    """In Markdown."""
    heads = ("reports at once", "p50, p99 ms", *(f"{n} bare at once: p50, p99 ms" for n in TOGETHER))
    heads += tuple(f"p50 / {n} bare" for n in TOGETHER)
    lines = [heads, ("---:",) * len(heads)]
    for f in runs:
        latencies = [f"{f[key]['p50']:.2f}, {f[key]['p99']:.2f}" for key in ("run", *map(str, TOGETHER))]
        ratios = [f"{f['run']['p50'] / f[str(n)]['p50']:.2f}" for n in TOGETHER]
        lines.append((f"{f['at_once']:.1f}", *latencies, *ratios))
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def main() -> None:
    """See the module's docstring."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=int, default=60)
    parser.add_argument("--seed", type=int, default=1)
    asked = vars(parser.parse_args())
    print(table([measure(threshold, **asked) for threshold in THRESHOLDS]))


if __name__ == "__main__":
    main()
