"""What a broadcast costs in virtual time, for each of its hearers, in fields of growing size and equal density.

    python -m bench.broadcasts [--sizes 100 10000] [--seconds 4] [--seed 1]

All nodes broadcast once a second over a radio of 802.15.4, at instants of their own. Prints processor time for each
frame and hearer, without planning and without the recorder, and its ratio to that of the first size, which is run
before and after the others. ``--sleepers`` lets all listen 5 ms every 2 s in place of always.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Mapping
from dataclasses import replace
from math import sqrt
from typing import Any, Final

from launcher.plan.reach import cells_of, neighbours
from launcher.processes.garbage import look_seldom
from trackfield.draw import uniform
from trackfield.drivers.engine.frames import Frame, Refused, Told, Undone
from trackfield.drivers.spec import ProcessSpec, RunSpec, links_of, places_of
from trackfield.drivers.virtual import Virtual
from trackfield.role import NS

LINK: Final = {"model": "lognormal_prr", "radio": "802154-0dbm", "range_m": 100.0}
SPACING_M: Final = 30.0
"""Some 25 hearers each."""


class Nobody:
    """A recorder that keeps nothing."""

    def sent(self, frame: Frame) -> None:
        """A frame left."""

    def told(self, process: str, output: Told | Refused | Undone) -> None:
        """Telemetry."""

    def final(self, process: str, record: Mapping[str, Any]) -> None:
        """A final record."""


def field(size: int, seconds: int, seed: int, *, sleeps: bool) -> tuple[RunSpec, list[ProcessSpec]]:
    """So many criers at random places, who know those in reach of them."""
    run, side_m = RunSpec("cries", seed, seconds * NS, LINK), SPACING_M * sqrt(size)
    x, y, at = ([uniform(seed, what, i) for i in range(size)] for what in ("x", "y", "at"))
    processes = [
        ProcessSpec(
            f"n{i}",
            "crier",
            "bench.criers:Crier",
            {"at": int(NS * at[i]), "sleeps": sleeps},
            x=side_m * x[i],
            y=side_m * y[i],
        )
        for i in range(size)
    ]
    link = links_of(run, processes)["field"]
    near, cells, places = neighbours(processes, link, "field"), cells_of(processes, link), places_of(processes)
    return run, [
        replace(
            p,
            cell=cells[p.id],
            cells=tuple(sorted({cells[id] for id in near[p.id]})),
            peers={id: places[id] for id in near[p.id]},
        )
        for p in processes
    ]


def cost_us(size: int, seconds: int, seed: int, *, sleeps: bool) -> tuple[float, float]:
    """(hearers of each, processor time in microseconds for each frame and hearer)."""
    run, processes = field(size, seconds, seed, sleeps=sleeps)
    virtual = Virtual(run, processes, Nobody())
    hearers = sum(len(p.peers) for p in processes)
    begun = time.process_time()
    virtual.run()
    return hearers / size, 1e6 * (time.process_time() - begun) / (hearers * seconds)


def main() -> None:
    """Print the costs."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sizes", type=int, nargs="+", default=[100, 10_000])
    parser.add_argument("--seconds", type=int, default=4)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--sleepers", action="store_true")
    asked = parser.parse_args()
    look_seldom()  # as trackfield does
    first, *others = asked.sizes
    sizes = [first, *others, first]
    found = [cost_us(size, asked.seconds, asked.seed, sleeps=asked.sleepers) for size in sizes]
    base = (found[0][1] + found[-1][1]) / 2
    for size, (hearers, cost) in zip(sizes, found, strict=True):
        print(f"{size:6} nodes, {hearers:4.1f} hearers each: {cost:6.1f} us, ratio {cost / base:.2f}")


if __name__ == "__main__":
    main()
