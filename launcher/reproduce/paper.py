"""The parts of a paper that is reproduced."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Generic

from launcher.reproduce.case import Case
from launcher.reproduce.intervals import Interval
from launcher.reproduce.records import Record, Records
from launcher.reproduce.scores import Results, S
from launcher.reproduce.tables import Claim, Row


@dataclass(frozen=True)
class Paper(Generic[S]):
    """A paper: what is run, how it is scored by ``S`` (a dataclass of numbers), and the parts of its report.

    ``cases`` are by name. ``scores`` has a score for each tracker of a case, from the case's runs.
    ``contrasts`` are what is compared run by run (ratios, shares), by name, from all runs and each tracker's repeated
    processor times. ``tables`` and ``claims`` go to results.json. The report has the claims, then ``parts``: headings
    and what stands below them, in Markdown; then ``figures``: the name of each, what it shows, and what the paper has
    of it.
    ``draw`` writes the figures into a folder and returns the seed of a typical run, by case; that of ``run`` is kept as
    a run folder. ``timed`` is the case whose processor time is measured, with the trackers that are measured.
    """

    name: str
    title: str
    cases: Mapping[str, Case]
    scores: Callable[[Case, Sequence[Record]], Mapping[str, S]]
    contrasts: Callable[[Records, Mapping[str, Sequence[float]]], Mapping[str, Interval]]
    tables: Callable[[Results[S]], Mapping[str, Sequence[Row]]]
    claims: Callable[[Results[S]], Sequence[Claim]]
    parts: Callable[[Results[S]], Sequence[tuple[str, str]]]
    figures: Sequence[tuple[str, str, str]]
    draw: Callable[[Path, Records, Results[S]], Mapping[str, int]]
    run: Case
    timed: Case | None = None
