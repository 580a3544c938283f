"""What a fix costs on its way from the last report of a pass to the command that turns the camera, in Markdown.

    OPENBLAS_NUM_THREADS=1 python -m bench.camera [--passes 200]

A vehicle passes the field of ``yang-ecpa`` back and forth, in virtual time. Measured are the events of the head from
when the last report was sent to it, and from its fix on those of the base, which is the gateway, and of camera
control, up to the one in which the packet leaves: with their messages written and read, and without emulated delays
and holds, in which nothing is done. By the wall clock, and in processor time, which other load on the machine changes
little. The unit is what the same solvers take for as many reports by themselves. The first passes, which also load
modules, do not count.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterable, Iterator
from statistics import median
from typing import Any, Final, NamedTuple

import numpy as np

from bench.passes import event, ms
from launcher.plan.prepare import load, planned
from launcher.record.ledger import Ledger
from launcher.records import Plan
from launcher.reproduce.papers.yang.trials.field import Setup, trials
from trackfield.drivers.engine.core import Core
from trackfield.drivers.engine.frames import EventKey, Output, Sent, Told
from trackfield.drivers.virtual import Virtual
from trackfield.role import Publish, Tell

PASSES: Final = 200
LEG_S: Final = 20
"""A pass at 13.4 m/s, from 134 m before the middle of the field to 134 m behind it."""
ENDS: Final = ((-133.928, -7.019), (133.928, 7.019))
CONTROL: Final = "camera-control"
ALONE: Final = 20
WARM: Final = 3


class Took(NamedTuple):
    """Wall-clock and processor time (ms)."""

    wall_ms: float
    cpu_ms: float


class Did(NamedTuple):
    """An event of a process: when (ns, emulated), how long it took, and whether it made a fix, or an aim."""

    at_ns: int
    process: str
    took: Took
    fixes: bool
    aims: bool


class Way(NamedTuple):
    """What the processes took for one fix (ms)."""

    head: Took
    base: Took
    control: Took

    @property
    def whole(self) -> Took:
        """All of them."""
        return _sum(self)


class Figures(NamedTuple):
    """The ``ways`` of fixes, and the processor time of the solvers alone."""

    ways: tuple[Way, ...]
    solvers_ms: float

    def wall_ms(self, percent: float) -> float:
        """A percentile of the whole way, by the wall clock."""
        return float(np.percentile([way.whole.wall_ms for way in self.ways], percent))

    def cpu_ms(self, percent: float) -> float:
        """The same in processor time."""
        return float(np.percentile([way.whole.cpu_ms for way in self.ways], percent))

    @property
    def ratio(self) -> float:
        """The median way, in times of the solvers alone."""
        return self.cpu_ms(50) / self.solvers_ms


class Timed(Virtual):
    """A run in virtual time, whose events are timed. ``did`` are those, ``reports`` the times of data to a process."""

    def __init__(self, plan: Plan) -> None:
        super().__init__(plan.run, plan.processes, Ledger(plan.run, plan.processes))
        self.did: list[Did] = []
        self.reports: list[tuple[int, str]] = []

    def _handle_next(self, core: Core, key: EventKey) -> list[Output]:
        wall, cpu = time.perf_counter(), time.process_time()
        outputs = super()._handle_next(core, key)
        took = Took((time.perf_counter() - wall) * 1e3, (time.process_time() - cpu) * 1e3)
        effects = [one.effect for one in outputs if isinstance(one, Told)]
        fixes = any(isinstance(one, Publish) and _fixed(one.estimate) for one in effects)
        aims = any(isinstance(one, Tell) and one.topic == "aimed" and one.values[0] for one in effects)
        self.did.append(Did(self.now_ns, core.owner, took, fixes, aims))
        self.reports += [(self.now_ns, str(to)) for to in _data(outputs)]
        return outputs


def _fixed(point: Any) -> bool:
    return point.event_ns is not None and not point.refused and not point.lag


def _data(outputs: list[Output]) -> Iterator[str]:
    """To whom data went."""
    return (one.frame.to for one in outputs if isinstance(one, Sent) and one.frame.kind == "data")


def plan(passes: int) -> Plan:
    """So many passes, by the noise model of the field: sound is not what is measured."""
    waypoints = [[k * LEG_S, *ENDS[k % 2]] for k in range(passes + 1)]
    settings = ("sensor.waveform=false", "camera.kind=evi-d30", f"target.waypoints={waypoints}")
    return planned(load("yang-ecpa", seed=1, settings=settings))


def measured(passes: int = PASSES) -> Figures:
    """Run, and find the way of each fix that was aimed at."""
    run = Timed(plan(passes + WARM))
    run.run()
    return Figures(tuple(_ways(run))[WARM:], solvers_ms())


def _ways(run: Timed) -> Iterator[Way]:
    for at, aim in enumerate(run.did):
        if not aim.aims:
            continue
        made = next(i for i in range(at, -1, -1) if run.did[i].fixes)
        head = run.did[made].process
        since_ns = max((sent for sent, to in run.reports if to == head and sent <= run.did[made].at_ns), default=0)
        before = (one for one in run.did[: made + 1] if one.at_ns >= since_ns)
        after = run.did[made + 1 : at + 1]
        yield Way(
            _sum(one.took for one in (*before, *after) if one.process == head),
            *(_sum(one.took for one in after if one.process == who) for who in ("base", CONTROL)),
        )


def _sum(each: Iterable[Took]) -> Took:
    took = [*each]
    return Took(sum(one.wall_ms for one in took), sum(one.cpu_ms for one in took))


def solvers_ms() -> float:
    """Those of the packaged scenario, for one event of five sensors (ms of processor time)."""
    passes = trials(Setup(), range(ALONE)).passes
    singles = [event(passes, k) for k in range(ALONE)]
    each = [[sum(ms([one], who) for who in ("ml", "ecpa")) for one in singles] for _ in range(2)]
    return median(each[1])


def table(found: Figures) -> Iterator[str]:
    """The lines of a table in Markdown."""
    yield "| fixes | wall ms p50, p95 | CPU ms p50, p95 | head | base | control | solvers alone | p50 / solvers |"
    yield "| ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |"
    both = [f"{figure(50):.1f}, {figure(95):.1f}" for figure in (found.wall_ms, found.cpu_ms)]
    parts = [f"{median(took.cpu_ms for took in part):.1f}" for part in zip(*found.ways, strict=True)]
    last = f"{found.solvers_ms:.1f} | {found.ratio:.1f}"
    yield f"| {len(found.ways)} | {' | '.join(both)} | {' | '.join(parts)} | {last} |"


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--passes", type=int, default=PASSES)
    print(*table(measured(parser.parse_args().passes)), sep="\n")


if __name__ == "__main__":
    main()
