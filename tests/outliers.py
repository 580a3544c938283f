"""What the option ``robust`` is worth, and what it costs: the tables of docs/tracking.md.

    python -m tests.outliers [--runs 10] [--share 0.1] [--trackers ukf upf] [--fields range rss]

Field, target and prior are those of ``tests.matrix``. Outliers are off by up to 20 sds of the noise, to either side.
"""

from __future__ import annotations

import argparse
from typing import Final

import numpy as np

from tests.matrix import FIELDS, Cell, cell, field, refused
from trackfield.filters.trackers import NOT_ROBUST, TRACKERS

ROBUST: Final = [name for name in TRACKERS.own if name not in NOT_ROBUST]
"""The trackers with the option."""


def median(one: Cell) -> float:
    """The error of the median run over the bound."""
    errors = np.sqrt(np.nanmean(np.square(one.errors[..., :2]).sum(axis=-1), axis=1))
    return float(np.median(errors / np.sqrt(np.square(one.bounds).mean(axis=1))))


def words(name: str, on: str, share: float, runs: range) -> tuple[str, str]:
    """Error over the bound, without the option and with it: of all runs, and of the median run.

    Empty for a tracker that does not take these kinds.
    """
    of = field(on, share)
    if refused(name, of):
        return "", ""
    plain, robust = (cell(name, of, runs, alone=False, options={"robust": on}) for on in (False, True))
    return f"{plain.ratio:.2f}, {robust.ratio:.2f}", f"{median(plain):.2f}, {median(robust):.2f}"


def main() -> None:
    """Two tables without outliers and two with them: a row for each tracker, a column for each field."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=10)
    parser.add_argument("--share", type=float, default=0.1)
    parser.add_argument("--trackers", nargs="*", default=ROBUST, choices=ROBUST)
    parser.add_argument("--fields", nargs="*", default=list(FIELDS), choices=list(FIELDS))
    given = parser.parse_args()
    for share in (0.0, given.share):
        rows = {name: [words(name, on, share, range(given.runs)) for on in given.fields] for name in given.trackers}
        for which, of in enumerate(("all runs", "the median run")):
            print(f"Outliers: {share:.0%}, {of}\n\n| tracker | {' | '.join(given.fields)} |")
            print(f"| --- |{' ---: |' * len(given.fields)}")
            for name, cells in rows.items():
                print(f"| `{name}` | {' | '.join(one[which] for one in cells)} |")
            print(flush=True)


if __name__ == "__main__":
    main()
