"""What a study of bare filters consists of, and how its runs are done."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from launcher.reproduce.tables import Claim, Row
from launcher.study.parallel import unordered
from trackfield.filters.types import Array

Figures = Mapping[str, Array]
"""Figures of R runs by name: arrays (R, ...)."""


def _no_times() -> Mapping[str, Sequence[float]]:
    return {}


@dataclass(frozen=True)
class Experiment:
    """A setup in which filters track the same targets, run by run.

    ``run`` does the runs with these seeds, all as arrays, and returns their figures in this order. All random draws of
    a run are keyed by its seed, so it is the same whatever other runs are beside it (to rounding). It travels to other
    processes: a function of a module, or a ``functools.partial`` of one.
    ``batch`` is the number of runs that are done at once, ``most`` the largest number of runs that it is worth.
    ``roles`` says that it runs roles and their messages: it is left out of a study of bare filters alone.
    """

    run: Callable[[Sequence[int]], Figures]
    batch: int = 25
    most: int | None = None
    roles: bool = False

    def seeds(self, runs: int) -> range:
        """The seeds of its runs, if the study has so many: 1, 2, ..."""
        return range(1, min(runs, self.most or runs) + 1)


@dataclass(frozen=True)
class Found:
    """The ``figures`` of each experiment by its name, and ``times``: repeated processor times (s) by name."""

    runs: int
    figures: Mapping[str, Figures]
    times: Mapping[str, Sequence[float]] = field(default_factory=dict)


@dataclass(frozen=True)
class Kernels:
    """The experiments of a paper on bare filters, and the parts of its report.

    ``experiments`` are by name. ``tables`` and ``claims`` go to results.json. The report has the claims, then
    ``parts``: headings and what stands below them, in Markdown; then ``figures``: the name of each, what it shows, and
    what the paper has of it. ``draw`` writes them into a folder. ``times`` measures processor times, in this process
    after all runs (``turns.taken``). ``with_roles`` says that experiments with roles belong to them, too: then they are
    the whole study of the paper, and its bare filters alone one without those (``experiments_of``).
    """

    name: str
    title: str
    experiments: Mapping[str, Experiment]
    tables: Callable[[Found], Mapping[str, Sequence[Row]]]
    claims: Callable[[Found], Sequence[Claim]]
    parts: Callable[[Found], Sequence[tuple[str, str]]]
    figures: Sequence[tuple[str, str, str]]
    draw: Callable[[Path, Found], None]
    times: Callable[[], Mapping[str, Sequence[float]]] = _no_times
    with_roles: bool = False

    def experiments_of(self, *, roles: bool) -> dict[str, Experiment]:
        """All experiments, or those on bare filters alone."""
        return {name: one for name, one in self.experiments.items() if roles or not one.roles}


def done(experiments: Mapping[str, Experiment], runs: int) -> dict[str, Figures]:
    """The figures of all experiments, their batches spread over all cores."""
    jobs = [
        (name, experiment, seeds[first : first + experiment.batch])
        for name, experiment in experiments.items()
        for seeds in (experiment.seeds(runs),)
        for first in range(0, len(seeds), experiment.batch)
    ]
    answers = dict(unordered(_run, jobs, title=f"{len(jobs)} batches of runs", lines=True, unit="batches"))
    found: dict[str, list[Figures]] = {name: [] for name in experiments}
    for place, (name, *_) in enumerate(jobs):
        found[name].append(answers[place])
    return {
        name: {which: np.concatenate([part[which] for part in parts]) for which in parts[0]}
        for name, parts in found.items()
    }


def _run(job: tuple[str, Experiment, Sequence[int]]) -> Figures:
    _, experiment, seeds = job
    return experiment.run(seeds)
