"""One complete run of a case, for a paper's figures of typical runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from launcher.plan.prepare import planned
from launcher.record.virtually import simulate
from launcher.records import SENSES
from launcher.reproduce.case import Case
from launcher.reproduce.records import Record
from trackfield.filters.types import Array
from trackfield.role import NS


@dataclass(frozen=True, eq=False)
class Realisation:
    """A run with T steps of ``step_s`` seconds.

    ``truth`` (T+1, 4) is at steps 0 to T, ``estimates`` (T, 4) by tracker at 1 to T (m, m/s); ``sensors`` (n, 2) all
    of them, ``active`` (k, 2) those that reported at any time (m).
    """

    seed: int
    step_s: float
    truth: Array
    estimates: Mapping[str, Array]
    sensors: Array
    active: Array

    @property
    def times(self) -> Array:
        """(T+1,) s."""
        times: Array = np.arange(len(self.truth), dtype=float) * self.step_s
        return times


def realise(case: Case, seed: int) -> Realisation:
    """Run the case again, and keep all of it."""
    plan = planned(case.scenario(seed))
    ledger, rows = simulate(plan)
    steps = max(plan.step_of(row.t_ns) for row in rows)
    estimates = {name: np.full((steps, 4), np.nan) for name in case.trackers}
    for row in rows:
        if row.point.mean:
            estimates[row.point.tracker][plan.step_of(row.t_ns) - 1] = row.point.mean
    step_s = plan.step_ns / NS
    (path,) = plan.paths.values()
    truth = [path.at(step * step_s) or (np.nan,) * 4 for step in range(steps + 1)]
    places = {place.id: (place.x, place.y) for place in plan.info.tagged(SENSES)}
    active = sorted({row.src for row in ledger.rows if row.kind == "doa"})
    return Realisation(
        seed,
        step_s,
        np.array(truth, float),
        estimates,
        np.array(list(places.values()), float).reshape(-1, 2),
        np.array([places[id] for id in active], float).reshape(-1, 2),
    )


def typical(case: Case, records: Sequence[Record], trackers: Sequence[str]) -> int:
    """The place of the run in which the errors of these trackers are nearest to their medians over all runs."""
    rows = [list(case.trackers).index(name) for name in trackers]
    errors = np.stack([record.errors[rows, :, :2] for record in records])
    runs = np.log(np.sqrt(np.nanmean(np.square(errors).sum(axis=-1), axis=-1)))  # (R, trackers)
    return int(np.abs(runs - np.median(runs, axis=0)).sum(axis=-1).argmin())
