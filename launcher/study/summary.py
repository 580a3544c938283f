"""The summary of a study: the mean of every figure over the seeds, with intervals, by combination and tracker."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

import pyarrow as pa

from launcher.record.figures.verdict import LOST, TRACKED, WITH_GAPS
from launcher.study.axes import Axis, Design
from launcher.study.figures import FIGURES
from launcher.study.intervals import FEWEST, Estimate, mean_of, share_of
from launcher.study.results import StudyRun, column, columns

VERDICTS: Final = (TRACKED, WITH_GAPS, LOST)


@dataclass(frozen=True)
class Row:
    """A combination and a tracker: how many of the ``runs`` got each verdict, and the means of the figures by key.

    A run without a figure (no track at all, no battery) or a verdict does not count for it; ``None`` if no run has it.
    """

    values: Mapping[str, Any]
    tracker: str
    runs: int
    verdicts: Mapping[str, int]
    figures: Mapping[str, Estimate | None]

    def share(self, verdict: str) -> Estimate | None:
        """The share of runs with this verdict, among those that have one."""
        judged = sum(self.verdicts.values())
        return share_of(self.verdicts[verdict], judged) if judged else None


@dataclass(frozen=True)
class Summary:
    """A row for each combination and tracker, in the order of the axes; ``seeds`` are those of every combination."""

    name: str
    axes: tuple[Axis, ...]
    seeds: tuple[int, ...]
    rows: tuple[Row, ...]

    @cached_property
    def trackers(self) -> tuple[str, ...]:
        """All that ran, in the order in which they first did."""
        return tuple(dict.fromkeys(row.tracker for row in self.rows))

    @property
    def own_axes(self) -> list[Axis]:
        """The axes without that of the tracker, which every row names anyway."""
        return columns(self.axes)

    @cached_property
    def estimated(self) -> bool:
        """Whether the seeds are enough for intervals."""
        return any(row.runs >= FEWEST for row in self.rows)

    def told(self, key: str) -> bool:
        """Whether any row has this figure."""
        return any(row.figures[key] is not None for row in self.rows)

    @property
    def table(self) -> pa.Table:
        """A row for each combination and tracker; docs/study.md says what its columns are."""
        found = {axis.key: column(axis, [row.values[axis.key] for row in self.rows]) for axis in self.own_axes}
        found["tracker"] = pa.array([row.tracker for row in self.rows])
        found["runs"] = pa.array([row.runs for row in self.rows], pa.int64())
        for verdict in VERDICTS:
            key = verdict.replace(" ", "_")
            found[key] = pa.array([row.verdicts[verdict] for row in self.rows], pa.int64())
            found |= _ends(f"{key}.share", [row.share(verdict) for row in self.rows])
        for key in FIGURES:
            found |= _ends(key, [row.figures[key] for row in self.rows])
        return pa.table(found)


def _ends(key: str, estimates: Sequence[Estimate | None]) -> dict[str, pa.Array]:
    """Columns of values, of the ends of their intervals, and of how many runs they are of."""
    return {
        key: pa.array([one and one.value for one in estimates], pa.float64()),
        f"{key}.low": pa.array([one and one.low for one in estimates], pa.float64()),
        f"{key}.high": pa.array([one and one.high for one in estimates], pa.float64()),
        f"{key}.runs": pa.array([one.runs if one else 0 for one in estimates], pa.int64()),
    }


def summary_of(design: Design, runs: Sequence[StudyRun]) -> Summary:
    """The summary of all runs of a design."""
    rows = [row for variant in design.variants for row in _rows(variant.values, runs)]
    return Summary(design.scenario.name, design.axes, design.seeds, tuple(rows))


def _rows(values: Mapping[str, Any], runs: Sequence[StudyRun]) -> Iterator[Row]:
    """The rows of the runs with these values, one for each tracker."""
    found: dict[str, list[dict[str, Any]]] = {}
    for run in runs:
        if run.values == values:
            for row in run.metrics.rows():
                found.setdefault(row["tracker"], []).append(row)
    for tracker, rows in found.items():
        verdicts = [row["verdict"] for row in rows]
        counts = {verdict: verdicts.count(verdict) for verdict in VERDICTS}
        figures = {
            key: mean_of([value for row in rows if (value := figure.of(row)) is not None])
            for key, figure in FIGURES.items()
        }
        yield Row(values, tracker, len(rows), counts, figures)
