"""What Zhai et al. (2009) compare: ratios and shares, paired by seed, from the runs themselves."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Final

import numpy as np

from launcher.reproduce.intervals import Interval, Weighted, positive, share, share_of_steps
from launcher.reproduce.papers.zhai.cases import CASES, NOMINALS, nominals
from launcher.reproduce.records import Records, errors_by_tracker
from launcher.reproduce.scores import over_steps, pooled
from trackfield.filters.types import Array

PATHS: Final = ("s1", "s2", "s3")
CAUSES: Final = ("s1-narrow", "s2-agile", "s3-agile")
"""The three scenarios with a prior, or a model, that suits a bootstrap filter."""
ENOUGH: Final = (10, 15, 20)
"""The paper's range of N."""
WEIGHTS: Final = ("spcpf", "spcpf-paper")
"""SP-CPF with either weights for a step in which a single sensor reports."""
RADAR_RIVALS: Final = ("ekf", "bootstrap")
TIME: Final = "s1: processor time, spcpf / bootstrap"


def ratio(case: str, tracker: str, other_case: str, other: str) -> str:
    """The name of the first tracker's error over the second's, pooled over runs and steps."""
    return f"{case} {tracker} / {other_case} {other}"


def closer(case: str) -> str:
    """The name of the share of the runs in which SP-CPF errs no more than the bootstrap."""
    return f"{case}: share of runs with spcpf ≤ bootstrap"


def variance(axis: str) -> str:
    """The name of the ratio of the variances of RMSE(t) in x or y."""
    return f"s1: variance of RMSE {axis}, spcpf / bootstrap"


def silent(case: str) -> str:
    """The name of the share of the steps without a report."""
    return f"{case}: share of steps without a report"


def contrasts(records: Records, goes: Mapping[str, Sequence[float]]) -> dict[str, Interval]:
    """All of them, by name."""
    errors = {case: errors_by_tracker(CASES[case], some) for case, some in records.items()}
    runs = len(records["s1"])
    found = {}
    for case, tracker, other_case, other in _compared():
        statistic = _over(pooled(errors[case][tracker]), pooled(errors[other_case][other]))
        found[ratio(case, tracker, other_case, other)] = positive(statistic, runs)
    for case in (*PATHS, *CAUSES):
        ours, rival = (_each(errors[case][name]) for name in ("spcpf", "bootstrap"))
        found[closer(case)] = share(int((ours <= rival).sum()), runs)
    for column, axis in enumerate("xy"):
        spread, rivals = (over_steps(errors["s1"][name][..., column], np.nanvar) for name in ("spcpf", "bootstrap"))
        found[variance(axis)] = positive(_over(spread, rivals), runs)
    for case in ("s1-78", "s1-79"):
        found[silent(case)] = share_of_steps(np.array([(record.reports == 0).mean() for record in records[case]]))
    found[TIME] = _times(goes)
    return found


def _compared() -> Iterator[tuple[str, str, str, str]]:
    for case in (*PATHS, *CAUSES):
        yield case, "spcpf", case, "bootstrap"
    for n in ENOUGH:
        yield "s1", nominals(n), "s1", nominals(max(NOMINALS))
    for name in WEIGHTS:
        for path in PATHS:
            yield f"{path}-78", name, path, "spcpf"
        for rival in RADAR_RIVALS:
            yield "radar", name, "radar", rival
    for path in PATHS[1:]:
        yield path, "spcpf", "s1", "spcpf"


def _over(one: Weighted, other: Weighted) -> Weighted:
    return lambda weights: one(weights) / other(weights)


def _each(errors: Array) -> Array:
    """RMSE (R,) of the position of each run."""
    return pooled(errors)(np.eye(len(errors)))


def _times(goes: Mapping[str, Sequence[float]]) -> Interval:
    """The ratio of processor times, over the repetitions, each of which has both."""
    logs = np.log(np.array(goes["spcpf"]) / np.array(goes["bootstrap"]))
    return positive(lambda weights: np.exp(weights @ logs / weights.sum(axis=-1)), len(logs))
