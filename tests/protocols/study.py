"""The toy protocols as processes against virtual time, from many seeds.

    python -m tests.protocols.study [--seeds 30] [--seed 1] [--only election] [--ways fast,slow,disturbed]

Each seed runs once a way, never again at a lower speed: ``slow`` at speed 1, ``fast`` at speed 5, and ``disturbed`` at
speed 1 while two processes compute for nothing and processes of the run are stopped for 50 ms now and then. Every third
seed is one of hard times. One table is printed; the exit code is 1 unless all of this holds: a run with no
``timing.host_late`` equals its run in virtual time, nothing is lost by the machine, undisturbed runs are all equal,
disturbed ones 95 in 100, and retractions happened in half of the elections at least.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final

from launcher.records import Plan
from tests.protocols.agreement import Compared, Stalls, busy, compared
from tests.protocols.hardships import hard
from tests.protocols.parties import PARTIES
from tests.test_drivers_agree import toy_plan

WAYS: Final = {"fast": 5.0, "slow": 1.0, "disturbed": 1.0}
"""The ways in which a seed is run, and their speeds."""
HARD: Final = 3
"""Every so many seeds times are hard."""
BUSY: Final = 2
EQUAL_SHARE: Final = 0.95


def plan_of(protocol: str, seed: int) -> Plan:
    """The plan of a seed."""
    return toy_plan(*(hard(protocol, seed) if seed % HARD == 0 else PARTIES[protocol](seed)))


def lived(protocol: str, seed: int, way: str) -> Compared:
    """A run of a seed."""
    plan = plan_of(protocol, seed)
    if way != "disturbed":
        return compared(plan, WAYS[way])[0]
    with busy(BUSY), Stalls({p.name for p in plan.processes}, seed) as stalls:
        (result,) = compared(plan, WAYS[way])
    return result if stalls.count else replace(result, found=(*result.found, "no process was stopped"))


@dataclass(frozen=True)
class Tally:
    """The runs of a protocol, all of one way."""

    protocol: str
    way: str
    runs: Sequence[Compared]

    @property
    def equal(self) -> int:
        return sum(not run.found for run in self.runs)

    @property
    def retracting(self) -> int:
        return sum(run.retractions > 0 for run in self.runs)

    def row(self) -> str:
        """Its line of the table."""
        cells = [
            self.protocol,
            self.way,
            len(self.runs),
            self.equal,
            sum(run.host_late > 0 for run in self.runs),
            sum(run.host_lost for run in self.runs),
            self.retracting,
            sum(run.retractions for run in self.runs),
            f"{max(run.lag_ms for run in self.runs):.0f}",
        ]
        return f"| {' | '.join(map(str, cells))} |"

    def complaints(self) -> Iterator[str]:
        """What should not be, besides runs that are unequal with nothing late, of which each is told by itself."""
        share = EQUAL_SHARE if self.way == "disturbed" else 1.0
        if self.equal < share * len(self.runs):
            yield f"{self.protocol}, {self.way}: {self.equal} of {len(self.runs)} runs are equal, {share:.0%} should be"
        if self.protocol == "election" and 2 * self.retracting < len(self.runs):
            yield f"{self.protocol}, {self.way}: retractions in {self.retracting} of {len(self.runs)} runs only"


HEAD: Final = "| protocol | way | runs | equal | host_late in | host_lost | retractions in | retractions | lag (ms) |"


def wrong(run: Compared) -> list[str]:
    """What is wrong with a run by itself; one on a machine that was too slow may differ, but has to say so."""
    if run.host_late:
        return []
    return list(run.found)


def study(
    protocols: Sequence[str], ways: Sequence[str], seeds: Sequence[int], say: Callable[[str], object] = print
) -> int:
    """The exit code: 1 if anything is not as it should be."""
    begun, tallies, failed = time.monotonic(), list[Tally](), 0
    for protocol in protocols:
        for way in ways:
            runs = []
            for seed in seeds:
                runs.append(lived(protocol, seed, way))
                if found := wrong(runs[-1]):
                    failed += 1
                    again = f"--seeds 1 --seed {seed} --only {protocol} --ways {way}"
                    say(f"{protocol} {seed} fails: python -m tests.protocols.study {again}")
                    for what in found[:5]:
                        say("  " + what.replace("\n", "\n  "))
            tallies.append(Tally(protocol, way, runs))
    for line in (HEAD, "| --- |" + " --- |" * HEAD.count(" | "), *(tally.row() for tally in tallies)):
        say(line)
    complaints = [what for tally in tallies for what in tally.complaints()]
    for what in complaints:
        say(what)
    say(f"{len(seeds)} seeds in {time.monotonic() - begun:.0f} s: {failed} runs failed")
    return int(failed > 0 or bool(complaints))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=30)
    parser.add_argument("--seed", type=int, default=1, help="the first one")
    parser.add_argument("--only", help="this protocol alone", choices=sorted(PARTIES))
    parser.add_argument("--ways", default=",".join(WAYS), help="some of " + ", ".join(WAYS))
    asked = parser.parse_args()
    ways = asked.ways.split(",")
    if unknown := set(ways) - WAYS.keys():
        parser.error(f"--ways: {', '.join(sorted(unknown))}: expected some of {', '.join(WAYS)}")
    return study([asked.only] if asked.only else list(PARTIES), ways, range(asked.seed, asked.seed + asked.seeds))


if __name__ == "__main__":
    sys.exit(main())
