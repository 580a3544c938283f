"""Errors of the policies beside the bound and an independent prototype's figures; all from batched kernels."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Final

import numpy as np

from launcher.reproduce.intervals import Interval, median, positive, share
from launcher.reproduce.kernels.scores import mean, rmse
from launcher.reproduce.kernels.study import Figures, Found
from launcher.reproduce.papers.ozfidan.experiments import (
    BOTH,
    DETECTION,
    FALLBACK,
    FAR_M,
    HOUSE,
    LINGERING,
    PAPER,
    PAPERS_POLICY,
    RARELY,
    SCALED,
    SCALED_STRICT,
    SWEPT,
    each_rms,
)
from launcher.reproduce.papers.ozfidan.scheduling import POLICIES
from launcher.reproduce.tables import Band, Row, aligned, inside, percent, plain, with_interval

CLOSE: Final = 1.1
"""An error is at most so much of the prototype's; what the field and the policy alone decide is within that factor."""
TO_BOUND: Final[Mapping[str, float]] = {"ukf": 1.1, "pf": 1.4}
"""What a filter's error should be at most of the bound, with the fallback."""
EXCURSIONS: Final = Band(0.05, 0.25)
"""The share of the runs that should be far off at some time, with the paper's policy."""
PROTOTYPE: Final[Mapping[str, Mapping[str, float]]] = {
    "closest": {"awake": 4.5, "bound": 2.03, "pf": 2.47, "ukf": 2.01},
    "merge_until_3": {"awake": 4.83, "bound": 2.11, "pf": 2.71, "ukf": 2.09},
    "nearest_4": {"awake": 4.0, "bound": 1.56, "pf": 1.97, "ukf": 1.58},
    "nearest_5": {"awake": 5.0, "bound": 1.36, "pf": 1.68, "ukf": 1.37},
    "information_2": {"awake": 2.0, "bound": 1.70, "pf": 2.02, "ukf": 1.69},
    "information_4": {"awake": 4.0, "bound": 1.32, "pf": 1.54, "ukf": 1.32},
    "trace": {"hand-overs": 129.0, "ukf": 1.52},
    "all": {"awake": 256.0, "bound": 0.48, "pf": 0.52, "ukf": 0.46},
}
"""An independent program's figures over 400 runs; of ``closest`` those of the median run. m, hand-overs in a run."""
OTHERS: Final = (SCALED, SCALED_STRICT, HOUSE, LINGERING, RARELY, DETECTION)
"""Experiments with the UKF besides, nearly all with ``merge_until_3``."""


def tables(found: Found) -> dict[str, list[Row]]:
    """The errors, those of each axis, and what is beside the prototype's; see ``energies`` for the others."""
    every = [(name, kind) for name in POLICIES for kind in BOTH]
    every += [(name, "ukf") for name in (*OTHERS, *SWEPT)]
    return {
        "errors": [error_row(found, name, kind) for name, kind in every],
        "axes": [row for name in POLICIES for kind in BOTH for row in _axes(found, name, kind)],
        "prototype": list(_prototype(found)),
    }


def of(found: Found, name: str, kind: str, what: str) -> np.ndarray:
    """A figure of a filter in an experiment."""
    return found.figures[name][f"{kind} {what}"]


def error(found: Found, name: str, kind: str) -> Interval:
    """The mean over runs of a run's RMSE of the position (m)."""
    return mean(each_rms(of(found, name, kind, "errors")))


def median_run(found: Found, name: str, kind: str, what: str = "errors") -> Interval:
    """The same of the median run."""
    return median(each_rms(of(found, name, kind, what)))


def bound(found: Found, name: str, kind: str = "ukf") -> Interval:
    """The mean over runs of the root mean square of the bound (m), for the schedule of this filter."""
    return mean(each_rms(of(found, name, kind, "bound")))


def over_bound(found: Found, name: str, kind: str) -> Interval:
    """The one over the other."""
    return over(*(each_rms(of(found, name, kind, what)) for what in ("errors", "bound")))


def over(ours: np.ndarray, theirs: np.ndarray) -> Interval:
    """The mean of one figure (R,) over that of another, in the same runs."""
    return positive(lambda weights: (weights @ ours) / (weights @ theirs), len(ours))


def median_over_bound(found: Found, name: str, kind: str) -> Interval:
    """The median over runs of a run's error over its bound."""
    ours, least = (each_rms(of(found, name, kind, what)) for what in ("errors", "bound"))
    return median(ours / least)


def far(found: Found, name: str, kind: str) -> Interval:
    """The share of the runs that are more than ``FAR_M`` off at some time."""
    away = np.linalg.norm(of(found, name, kind, "errors"), axis=-1).max(axis=1)
    return share(int((away > FAR_M).sum()), len(away))


def handovers(found: Found, name: str, kind: str) -> Interval:
    """How often the lead changes in a run."""
    return mean(of(found, name, kind, "handovers") * PAPER.steps)


def error_row(found: Found, name: str, kind: str) -> Row:
    """The error of a filter, and the share of its runs that are far off at some time as ``lost``."""
    least = bound(found, name, kind).value
    ours = error(found, name, kind)
    return Row(
        *(name, kind, "position, m", ours),
        median_run=median_run(found, name, kind),
        lost=far(found, name, kind),
        bound=least,
        to_bound=ours.value / least,
    )


def _axes(found: Found, name: str, kind: str) -> Iterator[Row]:
    for axis, which in enumerate("xy"):
        some = each_rms(of(found, name, kind, "errors")[..., axis])
        yield Row(name, kind, f"{which}, m", mean(some), median_run=median(some))


def _prototype(found: Found) -> Iterator[Row]:
    for name, told in PROTOTYPE.items():
        strict = name == PAPERS_POLICY
        tell = median_run if strict else error
        figures = {
            "awake": mean(of(found, name, "ukf", "reports")),
            "hand-overs": handovers(found, name, "ukf"),
            "bound": median_run(found, name, "ukf", "bound") if strict else bound(found, name),
            **{kind: tell(found, name, kind) for kind in BOTH},
        }
        for what, value in told.items():
            band = Band(0.0, CLOSE * value) if what in BOTH else Band(value / CLOSE, CLOSE * value)
            yield _beside(name, what, figures[what], band, value)
    for kind, most in TO_BOUND.items():
        yield _beside(FALLBACK, f"{kind} over bound", over_bound(found, FALLBACK, kind), Band(0.0, most))
    for kind in BOTH:
        yield _beside(PAPERS_POLICY, f"{kind}, runs over {FAR_M:g} m", far(found, PAPERS_POLICY, kind), EXCURSIONS)


def _beside(name: str, what: str, ours: Interval, band: Band, published: float | None = None) -> Row:
    ratio = None if published is None else ours.over(published)
    quantity = {"bound": "bound, m", "ukf": "UKF, m", "pf": "PF, m"}.get(what, what)
    return Row(
        *(name, "-", quantity, ours),
        published=published,
        ratio=ratio,
        band=str(band),
        verdict=inside([ours], [band]),
    )


# --- in Markdown ------------------------------------------------------------------------------------------------------

_HEADER: Final = (
    *("filter", "runs", "awake", "hand-overs", "bound, m", "error, m", "median run, m", "pooled, m"),
    *("error over bound", "median of it", f"over {FAR_M:g} m"),
)


def policies(found: Found) -> str:
    """A row for each policy and filter."""
    rows = [[name, *_cells(found, name, kind)] for name in POLICIES for kind in BOTH]
    return aligned(("policy", *_HEADER), rows)


def others(found: Found) -> str:
    """``merge_until_3`` as it is, and under other conditions, with the UKF."""
    rows = []
    for name in (FALLBACK, *OTHERS):
        silent, reports = (of(found, name, "ukf", what).mean() for what in ("silent", "reports"))
        rows.append([name, *_cells(found, name, "ukf"), percent(float(silent / reports))])
    return aligned(("experiment", *_HEADER, "reports of no target"), rows)


def two(value: float) -> str:
    """A number with two digits after the point."""
    return f"{value:.2f}"


def _cells(found: Found, name: str, kind: str) -> list[str]:
    runs = len(of(found, name, kind, "errors"))
    return [
        *(kind, f"{runs}"),
        plain(mean(of(found, name, kind, "reports")).value),
        plain(handovers(found, name, kind).value),
        plain(bound(found, name, kind).value),
        with_interval(error(found, name, kind)),
        with_interval(median_run(found, name, kind)),
        with_interval(rmse(of(found, name, kind, "errors"))),
        with_interval(over_bound(found, name, kind), two),
        two(median_over_bound(found, name, kind).value),
        with_interval(far(found, name, kind), percent),
    ]


def axes(found: Found) -> str:
    """The errors in x and in y."""
    rows = []
    for name in POLICIES:
        for kind in BOTH:
            some = list(_axes(found, name, kind))
            cells = (figure for row in some for figure in (row.ours, row.median_run) if figure is not None)
            rows.append([name, kind, *(with_interval(figure) for figure in cells)])
    return aligned(("policy", "filter", "x, m", "median run", "y, m", "median run"), rows)


def same(found: Found) -> str:
    """How often both filters choose the same."""
    shares: Mapping[str, Figures] = {name: found.figures[name] for name in POLICIES}
    rows = [
        [name, *(f"{one[f'same {what}'].mean():.2%}" for what in ("leader", "set"))] for name, one in shares.items()
    ]
    return aligned(("policy", "same leader", "same sensors"), rows)
