"""One run of a case in figures, as it is stored."""

from __future__ import annotations

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from zipfile import BadZipFile

import numpy as np
import numpy.typing as npt

from launcher.files import whole_file
from launcher.plan.prepare import planned
from launcher.record.figures.bounds import headline_bound, run_bounds
from launcher.record.metrics import run_metrics
from launcher.record.virtually import simulate
from launcher.reproduce.case import Case
from launcher.study.results import damaged
from trackfield.filters.types import Array


@dataclass(frozen=True, eq=False)
class Record:
    """A run of T steps with V trackers, and what its network did.

    ``errors`` (V, T, 4) are estimate minus truth (m, m/s; nan where there is no track), ``reports`` (T,) counts the
    reports fused in each step, ``bound`` (T,) is the least sd of the position (m; nan where unknown).
    ``network`` is frames sent, bytes of their payloads, and energy of all nodes for sending and in total (J).
    """

    errors: Array
    reports: npt.NDArray[np.int64]
    bound: Array
    network: Array

    def save(self, file: Path) -> None:
        """Write it, whole or not at all."""
        file.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(file) as part, part.open("wb") as stream:
            np.savez(stream, errors=self.errors, reports=self.reports, bound=self.bound, network=self.network)

    @classmethod
    def load(cls, file: Path) -> Record:
        """What ``save`` wrote. Raises ``ScenarioError`` if the file is damaged."""
        try:
            with np.load(file) as stored:
                return cls(stored["errors"], stored["reports"], stored["bound"], stored["network"])
        except (OSError, ValueError, KeyError, EOFError, BadZipFile, zlib.error):
            raise damaged(file) from None


Records = Mapping[str, Sequence[Record]]
"""The runs of each case, by its name."""


def errors_by_tracker(case: Case, records: Sequence[Record]) -> dict[str, Array]:
    """Errors (R, T, 4) of each of the case's trackers over R runs of it."""
    errors = np.stack([record.errors for record in records], axis=1)
    return dict(zip(case.trackers, errors, strict=True))


def measure(case: Case, seed: int) -> Record:
    """Run it in virtual time."""
    plan = planned(case.scenario(seed))
    ledger, tracks = simulate(plan)
    steps = max(plan.step_of(row.t_ns) for row in tracks)
    places = {name: i for i, name in enumerate(case.trackers)}
    errors = np.full((len(places), steps, 4), np.nan)
    reports = np.zeros(steps, np.int64)
    for row in tracks:
        at = plan.step_of(row.t_ns) - 1
        reports[at] = row.point.reports
        if row.point.mean and row.truth:
            errors[places[row.point.tracker], at] = np.subtract(row.point.mean, row.truth)
    every = run_bounds(plan, tracks)
    metrics = run_metrics(plan, ledger, tracks, every)
    energy = metrics["energy_j"]
    network = [metrics["frames"]["sent"], metrics["bytes"]["payload"], energy["by"]["send"], energy["total"]]
    bounds = headline_bound(plan, tracks, every)
    bound = np.array([bounds.get(plan.origin_ns + step * plan.step_ns, np.nan) for step in range(1, steps + 1)])
    return Record(errors, reports, bound, np.array(network, float))
