"""The figures of whole runs beside those of the prototype, and of the bare filters' bands."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Final

import numpy as np

from launcher.reproduce.intervals import Interval, positive, share
from launcher.reproduce.kernels.scores import mean
from launcher.reproduce.kernels.study import Found
from launcher.reproduce.papers.zhou.roles import FIRST, FORMS, LEVELS, MAIN, ROLES, SMOOTHED, WHOLE, done
from launcher.reproduce.papers.zhou.setups import WITHIN
from launcher.reproduce.papers.zhou.tables import CLOSE, PROTOTYPE, bound
from launcher.reproduce.papers.zhou.whole import BASE, SCALARS
from launcher.reproduce.scores import over_steps
from launcher.reproduce.tables import Band, Row, aligned, inside, percent, plain, rows_table, with_interval
from trackfield.filters.types import Array

TO_BOUND: Final[Mapping[str, float]] = {"walk": 1.2, "sharp": 1.45, "paperlike": 1.55}
"""What ``gpf-ukf`` should reach of the posterior bound, with roles as without."""
IN_NETWORK: Final = "in the network, m"
AT_BASE: Final = "at the base, m"
PROTOTYPES: Final[Mapping[str, str]] = {"ukf-robust": "ukf, robust", f"ukf{SMOOTHED}": "ukf, smoothed"}
"""What the prototype's filters are called that have other names here."""
COLUMNS: Final[Mapping[str, str]] = {
    "reports": "reports used", "measuring": "asked", "handovers": "hand-overs", "lost handovers": "of them lost",
    "hand-over frames": "frames of one", "hand-over bytes": "its bytes", "frames": "frames a step",
    "bytes": "bytes a step", "elections": "elections", "split elections": "split", "election s": "lasted, s",
    "claims in vain": "claims in vain", "awake": "awake, mean", "most awake": "most awake node",
}  # fmt: skip
"""Of the network's table: figures, and what they are called there."""


def tables(found: Found) -> dict[str, list[Row]]:
    """All tables, by name; none of a study of bare filters alone."""
    if not done(found):
        return {}
    return {
        "roles": [row for name in MAIN for row in _rows(found, name)],
        "roles, base": [row for name in MAIN for row in _base(found, name)],
        "roles, smoothing": list(_smoothing(found)),
        "roles, rss": [row for name in LEVELS for row in _rows(found, name)],
        "roles, outliers": list(_rows(found, f"outliers{ROLES}")),
        "roles, forms": [row for name in FORMS for row in _rows(found, name)],
        "roles, network": [row for name in WHOLE for row in _network(found, name)],
    }


def errors(found: Found, case: str, name: str, view: str = "") -> Array:
    """Those (R, T, 4) of a tracker in a view; NaN where it has no track."""
    return found.figures[case][f"{view}errors {name}"]


def mean_rmse(some: Array) -> Interval:
    """The mean over the steps of RMSE(t), over the runs that have a track then; a step that none has is left out."""
    away = np.linalg.norm(some[..., :2], axis=-1)
    there = ~np.isnan(away).all(axis=0)
    if not there.any():
        return Interval(np.nan, None, None)
    return positive(over_steps(away[:, there], np.nanmean), len(some))


def ratio(found: Found, case: str, name: str, other: str, *, of: str = "") -> Interval:
    """The error of one tracker in the network over that of another, in the same runs; or in those of case ``of``."""
    one, two = (
        over_steps(np.linalg.norm(errors(found, where, which)[..., :2], axis=-1), np.nanmean)
        for where, which in ((case, name), (of or case, other))
    )
    return positive(lambda weights: one(weights) / two(weights), len(errors(found, case, name)))


def to_bound(found: Found, case: str, name: str) -> Interval:
    """The error in the network over the posterior bound of the reports that were used."""
    return mean_rmse(errors(found, case, name)).over(bound(found, case, WHOLE[case].setup))


def lost(found: Found, case: str, name: str, view: str = "") -> Interval:
    """The share of runs that are lost: off by more than a node's range in any of the last steps, or without a track."""
    away = np.linalg.norm(errors(found, case, name, view)[:, -WITHIN:, :2], axis=-1)
    hits = ~(away <= WHOLE[case].setup.sense_m).all(axis=1)
    return share(int(hits.sum()), len(hits))


def scalars(found: Found, case: str, name: str) -> Interval:
    """The mean over the runs that have this figure, with its interval."""
    some = found.figures[case][name]
    return mean(some[~np.isnan(some)]) if not np.isnan(some).all() else Interval(np.nan, None, None)


def _rows(found: Found, case: str) -> Iterator[Row]:
    """The error of each tracker in the network, its ratio to the bound, and the share of runs that it loses."""
    whole, kind = WHOLE[case], case.removesuffix(ROLES)
    least = bound(found, case, whole.setup) if whole.bounded else None
    for name in whole.trackers:
        ours = mean_rmse(errors(found, case, name))
        if np.isnan(ours.value):
            continue
        limit = TO_BOUND.get(kind) if name == FIRST else None
        told = PROTOTYPE.get(kind, {}).get(PROTOTYPES.get(name, name))
        band = None
        if limit is not None and least is not None:
            band = Band(0, limit * least)
        elif told is not None and kind not in TO_BOUND and (kind, name) != ("outliers", "ukf"):
            band = Band(0, told * CLOSE)
        yield Row(
            *(kind, name, IN_NETWORK, ours),
            lost=lost(found, case, name),
            bound=least,
            to_bound=None if least is None else ours.value / least,
            band="" if band is None else str(band),
            verdict="" if band is None else inside([ours], [band]),
        )


def _base(found: Found, case: str) -> Iterator[Row]:
    """What the base knows: of the first tracker the error where it has a track, and in how many of the steps."""
    kind, some = case.removesuffix(ROLES), errors(found, case, FIRST, BASE)
    there = ~np.isnan(some[..., 0])
    yield Row(kind, FIRST, IN_NETWORK, mean_rmse(errors(found, case, FIRST)))
    if there.any():
        yield Row(kind, FIRST, AT_BASE, mean_rmse(some))
    yield Row(kind, FIRST, "share of steps with a track at the base", mean(there.mean(axis=1)))


def _smoothing(found: Found) -> Iterator[Row]:
    """Live and smoothed at the base, on walk."""
    case = f"walk{ROLES}"
    for live in ("ukf", FIRST):
        for name in (live, f"{live}{SMOOTHED}"):
            ours = mean_rmse(errors(found, case, name, BASE))
            told = PROTOTYPE["walk"].get(PROTOTYPES.get(name, name))
            band = None if told is None else Band(0, told * CLOSE)
            verdict = "" if band is None else inside([ours], [band])
            yield Row("walk", name, AT_BASE, ours, band="" if band is None else str(band), verdict=verdict)


def _network(found: Found, case: str) -> Iterator[Row]:
    figures = {name: scalars(found, case, name) for name in SCALARS}
    for name, figure in figures.items():
        if not np.isnan(figure.value):
            yield Row(case.removesuffix(ROLES), "-", name, figure)


# --- in Markdown ------------------------------------------------------------------------------------------------------

_BAND: Final = f"band: at most {CLOSE:g} of the prototype's error"
TITLES: Final[Mapping[str, str]] = {
    "roles": "With roles and messages: trackers side by side, of which gpf-ukf decides who measures (band: gpf-ukf "
    "within 1.2, 1.45, 1.55 of the bound)",
    "roles, base": "What the base knows",
    "roles, smoothing": f"Smoothed at the base, without a further byte ({_BAND})",
    "roles, rss": f"Received signal strength with roles; the UKF decides who measures ({_BAND})",
    "roles, outliers": f"One reading in ten too long by up to 20 m, with roles; the robust UKF decides ({_BAND})",
    "roles, forms": "Readings or conclusions, and what is handed over, on walk",
    "roles, network": "The network in these runs",
}


def parts(found: Found) -> list[tuple[str, str]]:
    """All tables, with their headings."""
    some = tables(found)
    return [
        (TITLES[name], network(rows, found.runs) if name.endswith("network") else rows_table(rows))
        for name, rows in some.items()
    ]


def network(rows: Sequence[Row], runs: int) -> str:
    """A row for each kind of ``runs``, of the rows of the table "roles, network": means over them."""
    cases: dict[str, dict[str, float]] = {}
    for row in rows:
        cases.setdefault(row.case, {})[row.quantity] = row.ours.value
    body = []
    for case, values in cases.items():
        shown = [(percent if "awake" in name else plain)(values[name]) if name in values else "-" for name in COLUMNS]
        body.append([case, *shown])
    return aligned((f"{runs} runs of each", *COLUMNS.values()), body)


def told(figure: Interval) -> str:
    """A ratio with its interval."""
    return with_interval(figure, lambda value: f"{value:.2f}")
