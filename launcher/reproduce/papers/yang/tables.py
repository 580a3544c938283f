"""The figures of the experiments beside the paper's, an independent prototype's, and the bound."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np

from launcher.reproduce.intervals import Interval
from launcher.reproduce.kernels.study import Found
from launcher.reproduce.papers.yang.published import PROTOTYPE, PUBLISHED, TO_BOUND, Means
from launcher.reproduce.papers.yang.scores import KINDS, UNITS, mean_error, over_bound, rms_error, share_of, shown
from launcher.reproduce.papers.yang.solved.solving import BOUND, ECPA, ECPA_ALL, ML, SOLVERS
from launcher.reproduce.papers.yang.trials.setups import (
    CLOCKS,
    LAWS,
    NODES,
    PLACES,
    RADII,
    SILENT,
    SPEEDS,
    area_case,
    clock_case,
    nodes_case,
    place_case,
    silent_case,
    speed_case,
)
from launcher.reproduce.tables import FACTOR, Band, Row, inside
from trackfield.filters.types import Array

CLOSE: Final = 1.1
"""A sound solver's error is at most so much of the prototype's; ECPA's is within ``FACTOR`` of it."""
GROUPS: Final[dict[str, list[str]]] = {
    **{law: [speed_case(law, speed) for speed in SPEEDS] for law in LAWS},
    "places": [place_case(most) for most in PLACES],
    "area": [area_case(radius) for radius in RADII],
    "nodes": [*map(nodes_case, NODES), *map(silent_case, SILENT)],
    "clocks": [clock_case(sd) for sd in CLOCKS],
}
"""The cases of each sweep."""


def sweep_tables(found: Found) -> dict[str, list[Row]]:
    """A table for each sweep, and one of ``ml`` beside the bound."""
    tables = {name: [row for case in cases for row in _rows(found, case)] for name, cases in GROUPS.items()}
    return {**tables, "bound": [row for case in _bounded() for row in _beside_bound(found, case)]}


def errors(found: Found, case: str, kind: str, name: str) -> Array:
    """Those (R,) of a solver in a case, in the unit in which they are told; NaN without a fix."""
    return shown(kind, found.figures[case][f"{kind} {name}"])


def fixes(found: Found, case: str, name: str) -> Interval:
    """The share of runs in which a solver finds a path."""
    return share_of(np.isfinite(found.figures[case][f"location {name}"]))


def quantity(kind: str) -> str:
    """A kind of error and its unit."""
    return f"{kind}, {UNITS[kind]}"


def _rows(found: Found, case: str) -> Iterator[Row]:
    """The mean error of each solver."""
    for name in SOLVERS:
        for column, kind in enumerate(KINDS):
            some = errors(found, case, kind, name)
            if np.isnan(some).all():
                continue
            ours = mean_error(some)
            published = _of(PUBLISHED.get(case), column) if name == ECPA else None
            prototype = _of(PROTOTYPE.get(case, {}).get(name), column)
            band = None if prototype is None else _band(name, prototype)
            yield Row(
                *(case, name, quantity(kind), ours),
                published=published,
                ratio=None if published is None else ours.over(published),
                lost=_without(found, case, name),
                band="" if band is None else str(band),
                verdict="" if band is None else inside([ours], [band]),
                prototype=prototype,
            )


def _of(means: Means | None, column: int) -> float | None:
    return None if means is None else means[column]


def _band(name: str, prototype: float) -> Band:
    enhanced = name in (ECPA, ECPA_ALL)
    return Band(prototype / FACTOR, prototype * FACTOR) if enhanced else Band(0, prototype * CLOSE)


def _without(found: Found, case: str, name: str) -> Interval | None:
    """The share of runs without a fix, if there are any."""
    refused = np.isnan(found.figures[case][f"location {name}"])
    return share_of(refused) if refused.any() else None


def _bounded() -> list[str]:
    return [*GROUPS["velocity"], *GROUPS["places"], *GROUPS["area"]]


def to_bound(found: Found, case: str, kind: str) -> Interval:
    """The root mean square error of ``ml`` over that of the bound, in the runs with a fix."""
    return over_bound(errors(found, case, kind, ML), errors(found, case, kind, BOUND))


def _beside_bound(found: Found, case: str) -> Iterator[Row]:
    """The root mean square errors of ``ml``, beside the bound in the same runs; the band is of heading and speed."""
    for kind in KINDS:
        ratio = to_bound(found, case, kind)
        some, bound = (errors(found, case, kind, name) for name in (ML, BOUND))
        ours, least = rms_error(some), rms_error(np.where(np.isnan(some), np.nan, bound))
        banded = kind != "location"
        yield Row(
            *(case, ML, f"RMSE of {quantity(kind)}", ours),
            bound=least.value,
            to_bound=ratio.value,
            band=f"≤ {TO_BOUND:g} of the bound" if banded else "",
            verdict=inside([ratio], [Band(0, TO_BOUND)]) if banded else "",
        )
