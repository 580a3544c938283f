"""The errors of two runs step by step: how often, and in how many parts of the run, one was lower."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from launcher.report.cells import NOTHING, Table, number, percent
from launcher.study.comparison.lines import Line, common

PARTS: Final = 10
"""Parts of equal numbers of steps, long enough for most errors not to last from one part into the next."""


def paired(found: Sequence[Line]) -> Table:
    """Each further run against the first, over common steps, for each tracker that several runs have."""
    head = [
        "tracker",
        "run",
        "against",
        "steps in both",
        "difference [m]",
        "steps lower",
        "parts lower",
    ]
    by_tracker: dict[tuple[str, str], list[Line]] = {}
    for line in found:
        by_tracker.setdefault((line.track.tracker, line.track.target), []).append(line)
    rows = [row for same in by_tracker.values() for other in same[1:] for row in _row(same[0], other)]
    return Table(head, rows)


def _row(first: Line, other: Line) -> Iterator[list[str]]:
    at_first, at_other = common(first.track, other.track)
    both = first.track.scored[at_first] & other.track.scored[at_other]
    if not both.any():
        return
    before, after = first.track.error_m[at_first[both]], other.track.error_m[at_other[both]]
    steps = len(before)
    parts = NOTHING
    if steps >= 2 * PARTS:
        pairs = zip(np.array_split(before, PARTS), np.array_split(after, PARTS), strict=True)
        parts = f"{sum(float(np.mean(b**2)) < float(np.mean(a**2)) for a, b in pairs)} of {PARTS}"
    difference = float((after - before).mean())
    yield [
        other.track.tracker,
        other.name,
        first.name,
        number(steps),
        f"{difference:+.3g}" if difference else "0",
        percent(float((after < before).mean())),
        parts,
    ]
