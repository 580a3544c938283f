"""The figures of the experiments beside those of an independent prototype, and of the paper.

Every verdict is computed from figures and a band that is stated beside it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Final

import numpy as np

from launcher.reproduce.intervals import Interval, median, positive
from launcher.reproduce.kernels.scores import mean, mean_rmse, percentile, ratio, share_lost
from launcher.reproduce.kernels.study import Figures, Found
from launcher.reproduce.papers.zhou.experiments import FILTERS, ROBUST, SWEEPS, UNGUARDED
from launcher.reproduce.papers.zhou.setups import LINEAR, ORIGIN, OUTLIERS, RSS, SETUPS, WITHIN, Setup
from launcher.reproduce.scores import over_steps
from launcher.reproduce.tables import FACTOR, Band, Row, inside
from launcher.reproduce.tables import beside as beside_published
from trackfield.filters.bounds import pcrlb, position_sd
from trackfield.filters.measurement import moving
from trackfield.filters.types import Array

CLOSE: Final = 1.1
"""A sound filter's error is at most so much of the prototype's; one that is unsound is within ``FACTOR`` of it."""
PROTOTYPE: Final[Mapping[str, Mapping[str, float]]] = {
    "walk": {
        "bootstrap-100": 1.01, "upf-paper": 0.89, "upf": 0.98, "fa-upf": 0.87, "gpf-ukf": 0.81, "ukf": 0.81,
        "bootstrap-1000": 0.81, "ukf, smoothed": 0.46,
    },
    "sharp": {
        "bootstrap-100": 2.33, "upf-paper": 0.24, "upf": 0.15, "fa-upf": 0.15, "gpf-ukf": 0.15, "ukf": 0.22,
        "bootstrap-1000": 0.19,
    },
    "paperlike": {
        "bootstrap-100": 34.4, "upf-paper": 5.98, "upf": 4.91, "fa-upf": 4.53, "gpf-ukf": 4.79, "ukf": 6.07,
        "bootstrap-1000": 5.33,
    },
    "rss 2 dB": {"ukf": 0.78, "ukf, distances": 1.10},
    "rss 4 dB": {"ukf": 1.42, "ukf, distances": 1.89},
    "rss 6 dB": {"ukf": 2.05, "ukf, distances": 3.24},
    "outliers": {"ukf": 3.98, "ukf, robust": 0.96},
}  # fmt: skip
"""The mean over the steps of the position's RMSE (m) that an independent prototype has, on the same setups."""
UNSOUND: Final = ("bootstrap-100", "upf-paper", "ukf, distances")
"""Filters that are not made for what they get; so is the plain UKF with outliers."""
BOUNDS: Final[Mapping[str, float]] = {"walk": 0.724, "sharp": 0.113, "paperlike": 3.37}
"""The prototype's posterior bounds, m."""
PUBLISHED: Final[Mapping[str, tuple[float, float, float, float]]] = {
    "upf-paper": (2.0, 3.0, 4.0, 5.0), "bootstrap-100": (7.0, 18.0, 10.0, 15.0),
}  # fmt: skip
"""The mean errors of x, y, vx and vy in the text of sec. III-B, of its UPF and PF."""
LOST_BY_ORIGIN: Final = Band(0.48, 0.58)
"""The share of runs that any filter of the prototype loses under eq. 11."""
CONSISTENT: Final = 3.357
"""The median of a chi-squared variable of four degrees of freedom: of the NEES of a filter that knows its errors."""
HIGH: Final = 95.0
"""The percentile of distances that is shown."""


def tables(found: Found) -> dict[str, list[Row]]:
    """All tables, by name."""
    return {
        "bounds": [_bound(found, name) for name in SETUPS],
        "errors": [row for name in SETUPS for row in _rows(found, name, SETUPS[name], FILTERS)],
        "restarts": [row for name in SETUPS for row in _rows(found, name, SETUPS[name], _guarded(), bands=False)],
        "smoothing": [row for name in SETUPS for row in _rows(found, name, SETUPS[name], ("ukf", "ukf, smoothed"))],
        "consistency": list(_consistency(found)),
        "tails": [row for name in SETUPS for row in _tails(found, name)],
        "published": list(_published(found)),
        "linear": list(_rows(found, "linear", LINEAR, FILTERS)),
        "origin": list(_origin(found)),
        "outliers": list(_rows(found, "outliers", OUTLIERS, ROBUST)),
        "rss": [row for name, setup in RSS.items() for row in _rows(found, name, setup, _rss())],
        "particles": [row for name in SETUPS for row in _sweep(found, name)],
    }


def errors(found: Found, case: str, name: str) -> Array:
    """Those (R, T, 4) of a filter in an experiment."""
    return found.figures[case][f"errors {name}"]


def bound(found: Found, case: str, setup: Setup) -> float:
    """The posterior bound on the position (m), the mean over the steps, as errors are."""
    return float(bound_over_time(found.figures[case], setup).mean())


def bound_over_time(figures: Figures, setup: Setup) -> Array:
    """The posterior bound (T,) on the position (m)."""
    return position_sd(pcrlb(setup.prior.covariance, moving(setup.model, 1.0), figures["information"]))


def _published(found: Found) -> Iterator[Row]:
    """On paperlike the mean over the steps of RMSE(t) in each coordinate, beside the paper's."""
    for name, means in PUBLISHED.items():
        for column, (coordinate, told) in enumerate(zip(("x, m", "y, m", "vx, m/s", "vy, m/s"), means, strict=True)):
            some = errors(found, "paperlike", name)[..., column]
            ours = positive(over_steps(some, np.mean), len(some))
            ratio_to = ours.over(told)
            yield Row("paperlike", name, coordinate, ours, told, ratio_to, verdict=beside_published(ratio_to))


def _guarded() -> list[str]:
    return [name for alone in UNGUARDED for name in (alone.partition(",")[0], alone)]


def _rss() -> tuple[str, ...]:
    return "ukf", "gpf-ukf", "upf", "ukf, distances", "ukf, distances without bias"


def _bound(found: Found, case: str) -> Row:
    ours = bound(found, case, SETUPS[case])
    return Row(
        case, "-", "posterior bound, m", Interval(ours, ours, ours), bound=BOUNDS[case], to_bound=ours / BOUNDS[case]
    )


def _rows(
    found: Found, case: str, setup: Setup, names: Sequence[str] | Mapping[str, object], *, bands: bool = True
) -> Iterator[Row]:
    """The error of each filter, its ratio to the bound, and the share of runs that it loses."""
    least = bound(found, case, setup) if setup.true_q is None and not setup.outliers else None
    for name in names:
        limit = None if name.endswith("smoothed") else least  # a smoother knows the readings to come as well
        some = errors(found, case, name)
        ours = mean_rmse(some)
        told = PROTOTYPE.get(case, {}).get(name) if bands else None
        band = (
            None
            if told is None
            else Band(told / FACTOR, told * FACTOR)
            if _unsound(case, name)
            else Band(0, told * CLOSE)
        )
        yield Row(
            *(case, name, "position, m", ours),
            lost=share_lost(some, setup.sense_m, WITHIN),
            bound=limit,
            to_bound=None if limit is None else ours.value / limit,
            band="" if band is None else str(band),
            verdict="" if band is None else inside([ours], [band]),
        )


def _unsound(case: str, name: str) -> bool:
    return name in UNSOUND or (case, name) == ("outliers", "ukf")


def _consistency(found: Found) -> Iterator[Row]:
    for case in SETUPS:
        for name in FILTERS:
            each = np.median(found.figures[case][f"nees {name}"], axis=1)
            yield Row(
                case, name, "NEES, median", median(each), bound=CONSISTENT, to_bound=float(np.median(each)) / CONSISTENT
            )


def _tails(found: Found, case: str) -> Iterator[Row]:
    for name in FILTERS:
        some = errors(found, case, name)
        yield Row(case, name, "95th percentile of the distance, m", percentile(some, HIGH))


def _origin(found: Found) -> Iterator[Row]:
    for name in FILTERS:
        lost = share_lost(errors(found, "origin", name), ORIGIN.sense_m, WITHIN)
        verdict = inside([lost], [LOST_BY_ORIGIN])
        yield Row("origin", name, "share of runs lost", lost, band=str(LOST_BY_ORIGIN), verdict=verdict)


def _sweep(found: Found, case: str) -> Iterator[Row]:
    for kind, (_, sizes) in SWEEPS.items():
        for n in sizes:
            some = errors(found, f"{case}, particles", f"{kind}-{n}")
            yield Row(
                case, f"{kind}-{n}", "position, m", mean_rmse(some), lost=share_lost(some, SETUPS[case].sense_m, WITHIN)
            )


def used(found: Found, case: str, name: str) -> Interval:
    """The mean share of its particles that count: N_eff / N."""
    n = 1000 if name.endswith("-1000") else 100
    return mean(found.figures[case][f"effective {name}"] / n)


def beside(found: Found, case: str, name: str, other: str) -> Interval:
    """The first's error over the second's, in the same runs."""
    return ratio(errors(found, case, name), errors(found, case, other))


def used_over(found: Found, case: str, name: str, other: str) -> Interval:
    """The first's N_eff over the second's, in the same runs; both have 100 particles."""
    ours, theirs = (found.figures[case][f"effective {one}"].mean(axis=1) for one in (name, other))
    return positive(lambda weights: (weights @ ours) / (weights @ theirs), len(ours))
