"""A campaign of faults: small runs under everything at once, drawn from seeds, and what must hold all the same.

    python -m tests.campaign [--runs 200] [--seed 1] [--processes 10]

Each seed draws who talks (a field that tracks a target, or a protocol of peers), their number, radio, clocks, batteries
and up to six faults of any kind, and runs them in virtual time; ``--processes`` says how many of the seeds run as
processes too, and have to come to the same. A seed that fails is printed as the command that repeats it. So is, in a
campaign of at least a hundred runs, whatever it should have provoked and never did: that is a failure, too.
"""

from __future__ import annotations

import argparse
import sys
import time
import traceback
from collections import Counter
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field
from typing import Final

from tests.campaign.cases import case
from tests.campaign.census import PROVOKED, RETRACTION, happened
from tests.campaign.verdicts import complaints, disagreements, run

ENOUGH: Final = 100
"""From so many runs on, everything should have happened."""
ENOUGH_PROCESSES: Final = 5
"""From so many runs as processes on, a frame should have been taken back."""


@dataclass
class Verdict:
    """What is wrong with the run of a seed, and what happened in it."""

    wrong: list[str] = field(default_factory=list)
    happened: set[str] = field(default_factory=set)


def judged(seed: int, *, processes: bool) -> Verdict:
    """The run of a seed, in virtual time and perhaps as processes."""
    verdict = Verdict()
    try:
        one = case(seed)
        virtual = run(one.plan)
        verdict.wrong += complaints(virtual)
        verdict.happened |= set(happened(one, virtual))
        if processes and not verdict.wrong:
            found, real = disagreements(one.plan)
            verdict.wrong += found
            verdict.happened |= {RETRACTION} if real and real.retractions else set()
    except Exception:  # noqa: BLE001  whatever it is, it is what the campaign is after
        verdict.wrong.append(traceback.format_exc(limit=-3))
    return verdict


def expected(runs: int, processes: int) -> frozenset[str]:
    """What a campaign of so many runs should provoke."""
    return (PROVOKED if runs >= ENOUGH else frozenset()) | ({RETRACTION} if processes >= ENOUGH_PROCESSES else set())


def campaign(
    seeds: Sequence[int],
    *,
    processes: int,
    provoking: Collection[str] = (),
    say: Callable[[str], object] = print,
) -> int:
    """The exit code: 1 if any seed fails, or nothing of a kind happened. Runs as processes are spread over all."""
    begun, failed, census = time.monotonic(), 0, Counter[str]()
    both = {seeds[i * len(seeds) // processes] for i in range(processes)} if processes else set()
    for seed in seeds:
        verdict = judged(seed, processes=seed in both)
        census.update(verdict.happened)
        if verdict.wrong:
            failed += 1
            say(f"seed {seed} fails: python -m tests.campaign --runs 1 --seed {seed} --processes {int(seed in both)}")
            for what in verdict.wrong[:5]:
                say("  " + what.replace("\n", "\n  "))
    say("in so many runs: " + ", ".join(f"{what} {census[what]}" for what in sorted({*census, *provoking})))
    missing = sorted(what for what in provoking if not census[what])
    for what in missing:
        say(f"never happened, and should have: {what}")
    took = f"{time.monotonic() - begun:.0f} s"
    say(f"{len(seeds)} runs, {len(both)} of them as processes too, in {took}: {failed} failed")
    return int(failed > 0 or bool(missing))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1, help="of the first run")
    parser.add_argument("--processes", type=int, default=10, help="how many of them run as processes too")
    asked = parser.parse_args()
    processes, seeds = min(asked.processes, asked.runs), range(asked.seed, asked.seed + asked.runs)
    return campaign(seeds, processes=processes, provoking=expected(asked.runs, processes))


if __name__ == "__main__":
    sys.exit(main())
