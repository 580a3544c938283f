"""The cost of solving for a path from the reports of an event: one event, and many at once, in Markdown.

    OPENBLAS_NUM_THREADS=1 python -m bench.passes [--rounds 7]

In each round every solver takes the same ``ONE`` events of five sensors one by one, and ``MANY`` at once. Times are
medians over the rounds of the processor time per event, and ratios medians of the ratios to the plane within a round.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from typing import Final, NamedTuple

import numpy as np

from launcher.reproduce.papers.yang.trials.field import Setup, trials
from trackfield.filters.passes.solve import SOLVERS, solve
from trackfield.filters.passes.types import Passes

ONE: Final = 20
MANY: Final = 500
NAMES: Final = ("plane", *SOLVERS)
"""The first is what the others' ratios are to."""


class Row(NamedTuple):
    """A solver's time for one event by itself, how much that is of a plane's, and per event for many at once."""

    who: str
    ms: float
    ratio: float
    many_ms: float


def measured(rounds: int, many: int = MANY) -> list[Row]:
    """All solvers in turn, ``rounds`` times, after one to warm up."""
    passes = trials(Setup(), range(many)).passes
    singles = [event(passes, k) for k in range(ONE)]
    taken = np.array([[(ms(singles, who), ms([passes], who) / many) for who in NAMES] for _ in range(rounds + 1)])[1:]
    alone, together = taken[..., 0] / ONE, taken[..., 1]
    ratios = np.median(alone / alone[:, :1], axis=0)
    times = zip(NAMES, np.median(alone, axis=0), ratios, np.median(together, axis=0), strict=True)
    return [Row(who, float(one), float(ratio), float(many)) for who, one, ratio, many in times]


def event(passes: Passes, k: int) -> Passes:
    """One of them."""
    places, times_s, strengths, time_sd_s, strength_sd, place_sd_m = passes
    return Passes(places[k], times_s[k], strengths[k], time_sd_s[k], strength_sd[k], place_sd_m)


def ms(given: list[Passes], who: str) -> float:
    """Processor time (ms) of one solver for all that is given."""
    begun = time.process_time()
    for passes in given:
        solve(who, passes)
    return (time.process_time() - begun) * 1e3


def table(rows: list[Row], many: int = MANY) -> Iterator[str]:
    """The lines of a table in Markdown."""
    yield f"| solver | ms for an event | of a plane's | ms each of {many:,} at once |"
    yield "| --- | ---: | ---: | ---: |"
    for who, one, ratio, each in rows:
        yield f"| {who} | {one:.1f} | {ratio:.1f} | {each:.2f} |"


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=7)
    print(*table(measured(parser.parse_args().rounds)), sep="\n")


if __name__ == "__main__":
    main()
