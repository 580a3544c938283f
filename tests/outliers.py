"""What the option ``robust`` is worth, and what it costs: the tables of docs/tracking.md.

    python -m tests.outliers [--runs 30] [--share 0.1] [--trackers ukf upf] [--fields range rss]

The field, target and prior are those of ``tests.matrix``; outliers are off by up to 20 sds of the noise, to either side.
"""

from __future__ import annotations

import argparse
from typing import Final

from tests.matrix import FIELDS, cell, field, refused
from trackfield.filters.trackers import FORMER, NOT_ROBUST, TRACKERS

ROBUST: Final = [name for name in TRACKERS.own if name not in FORMER and name not in NOT_ROBUST]
"""The trackers with the option."""


def words(name: str, on: str, share: float, runs: range) -> str:
    """Error over the bound, without the option and with it; empty for a tracker that does not take these kinds."""
    of = field(on, share)
    if refused(name, of):
        return ""
    plain, robust = (cell(name, of, runs, alone=False, options={"robust": on}) for on in (False, True))
    return f"{plain.ratio:.2f}, {robust.ratio:.2f}"


def main() -> None:
    """A table without outliers and one with them: a row for each tracker, a column for each field."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=30)
    parser.add_argument("--share", type=float, default=0.1)
    parser.add_argument("--trackers", nargs="*", default=ROBUST, choices=ROBUST)
    parser.add_argument("--fields", nargs="*", default=list(FIELDS), choices=list(FIELDS))
    given = parser.parse_args()
    for share in (0.0, given.share):
        print(
            f"Outliers: {share:.0%}\n\n| tracker | {' | '.join(given.fields)} |\n| --- |{' ---: |' * len(given.fields)}"
        )
        for name in given.trackers:
            cells = (words(name, on, share, range(given.runs)) for on in given.fields)
            print(f"| `{name}` | {' | '.join(cells)} |", flush=True)
        print()


if __name__ == "__main__":
    main()
