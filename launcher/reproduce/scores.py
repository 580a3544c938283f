"""Figures over all runs of a case: the usual indices, and those that show how reliable they are."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, Generic, TypeVar

import numpy as np

from launcher.reproduce.case import Case
from launcher.reproduce.intervals import Interval, Weighted, median, positive, share
from launcher.reproduce.records import Record, errors_by_tracker
from trackfield.filters import metrics
from trackfield.filters.types import Array

S = TypeVar("S")
"""A score, of one tracker in one case: a dataclass of numbers. A paper may bring its own."""


@dataclass(frozen=True)
class Score:
    """One tracker in one case, over runs and steps 1 to T; metres.

    ``mean_x``, ``var_x``, ``mean_y``, ``var_y``: mean and variance over the steps of RMSE(t), the root mean square over
    the runs of the error at step t. ``median_x``, ``median_y``: RMSE over the steps, of the median run.
    ``position`` pools the distance over runs and steps, ``median_run`` is its RMSE over the steps, of the median run.
    ``lost`` is the share of the runs that end more than 50 m off or without a track, ``largest`` the largest error of
    any step. ``ends`` has the ends of their intervals, by name; those of ``largest`` have no meaning.
    """

    mean_x: float
    var_x: float
    median_x: float
    mean_y: float
    var_y: float
    median_y: float
    position: float
    median_run: float
    lost: float
    largest: float
    ends: Mapping[str, Sequence[float | None]] = field(default_factory=dict)

    @classmethod
    def of(cls, errors: Array) -> Score:
        """The score of errors (R, T, 4). A step without a track counts in none of the means."""
        places = errors[..., :2]
        squared = np.square(places).sum(axis=-1)
        lost = metrics.Lost().holds(places)
        found = {"position": positive(pooled(errors), len(errors))}
        for axis, name in enumerate("xy"):
            found[f"mean_{name}"] = positive(over_steps(errors[..., axis], np.nanmean), len(errors))
            found[f"var_{name}"] = positive(over_steps(errors[..., axis], np.nanvar), len(errors))
            found[f"median_{name}"] = median(np.sqrt(np.nanmean(np.square(errors[..., axis]), axis=1)))
        found["median_run"] = median(np.sqrt(np.nanmean(squared, axis=1)))
        found["lost"] = share(int(lost.sum()), len(lost))
        ends = {name: one[1:] for name, one in found.items()}
        return cls(
            **{name: one.value for name, one in found.items()}, largest=float(np.sqrt(np.nanmax(squared))), ends=ends
        )

    def interval(self, name: str) -> Interval:
        """The figure of this name and the ends of its interval; a figure without ends is exact."""
        value = getattr(self, name)
        low, high = self.ends.get(name, (value, value))
        return Interval(value, low, high)


def pooled(errors: Array) -> Weighted:
    """RMSE of the position over all runs and steps of errors (R, T, 4)."""
    squared = np.square(errors[..., :2]).sum(axis=-1)
    sums, counts = np.nansum(squared, axis=1), (~np.isnan(squared)).sum(axis=1)
    return lambda weights: np.sqrt(weights @ sums / (weights @ counts))


def over_steps(errors: Array, statistic: Callable[..., Array]) -> Weighted:
    """A statistic over the steps of RMSE(t), of errors (R, T) in one coordinate."""
    squared, there = np.nan_to_num(np.square(errors)), ~np.isnan(errors)

    def weighted(weights: Array) -> Array:
        with np.errstate(invalid="ignore", divide="ignore"):
            return statistic(np.sqrt(weights @ squared / (weights @ there)), axis=-1)

    return weighted


def rmse_over_time(errors: Array) -> Array:
    """RMSE(t) (T, d) over the runs of errors (R, T, d)."""
    rmse: Array = np.sqrt(np.nanmean(np.square(errors), axis=0))
    return rmse


def usual_scores(case: Case, records: Sequence[Record]) -> dict[str, Score]:
    """The ``Score`` of each of a case's trackers."""
    return {name: Score.of(errors) for name, errors in errors_by_tracker(case, records).items()}


@dataclass(frozen=True)
class Field:
    """What the network of a case did in a run, on average.

    ``active`` sensors report in a step, in a share ``silent`` of the steps none does, in a share ``few`` one or two.
    ``frames`` and ``payload_bytes`` were sent for ``send_j`` of radio energy, out of ``total_j`` that all nodes spent.
    ``bound`` is the least position error that the bearings allow (m), pooled like ``Score.position``.
    """

    active: float
    silent: float
    few: float
    frames: float
    payload_bytes: float
    send_j: float
    total_j: float
    bound: float | None

    @classmethod
    def of(cls, records: Sequence[Record]) -> Field:
        """The means over a case's runs."""
        reports = np.stack([record.reports for record in records])
        bounds = np.stack([record.bound for record in records])
        frames, payload, send, total = np.mean([record.network for record in records], axis=0).tolist()
        return cls(
            float(reports.mean()),
            float((reports == 0).mean()),
            float(((reports == 1) | (reports == 2)).mean()),
            frames,
            payload,
            send,
            total,
            None if np.isnan(bounds).all() else float(np.sqrt(np.nanmean(np.square(bounds)))),
        )


@dataclass(frozen=True)
class Results(Generic[S]):
    """All figures of a study: by case and tracker, by case, and the comparisons of a paper by their names.

    ``times`` is the processor time of a run by tracker, if timed (s).
    """

    runs: int
    scores: Mapping[str, Mapping[str, S]]
    fields: Mapping[str, Field]
    times: Mapping[str, float]
    contrasts: Mapping[str, Interval]

    def plain(self) -> dict[str, Any]:
        """Dicts and numbers, for a file."""
        return asdict(self)

    @classmethod
    def of_plain(cls, plain: Mapping[str, Any], score: Callable[..., S]) -> Results[S]:
        """The inverse of ``plain``; ``score`` makes a score of its fields."""
        scores = {case: {name: score(**one) for name, one in some.items()} for case, some in plain["scores"].items()}
        fields = {case: Field(**one) for case, one in plain["fields"].items()}
        contrasts = {name: Interval(*one) for name, one in plain["contrasts"].items()}
        return cls(plain["runs"], scores, fields, plain["times"], contrasts)
