"""Figures of the filters of Yu et al. (2009): errors before, in and after the turns, beside bound and other figures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from launcher.reproduce.intervals import Interval, share
from launcher.reproduce.kernels import scores
from launcher.reproduce.kernels.study import Found
from launcher.reproduce.papers.yu.experiments import (
    CASES,
    CROSSING_PARTICLES,
    IMM,
    LAG,
    RULE,
    SENSORS,
    crossing,
)
from launcher.reproduce.papers.yu.truth import STEPS, TURNS
from launcher.reproduce.tables import Band, Row, aligned, inside, percent, plain, rows_table, with_interval
from trackfield.filters.types import Array

AFTER: Final = 10
"""Steps after a turn."""
PERIODS: Final[Mapping[str, list[int]]] = {
    "before": list(range(11, 31)),
    "in the turns": [t for first, last, _ in TURNS for t in range(first + 1, last + 1)],
    "after": [t for _, last, _ in TURNS for t in range(last + 1, last + 1 + AFTER)],
}
"""The steps before the first turn, once the start is forgotten; those of the turns; those after each."""

PUBLISHED: Final = {"rbpf": 59.0321, "mrbpf": 9.4187}
"""Table 2, m."""
BANDS: Final = {"rbpf": Band(49.0, 66.0), "mrbpf": Band(5.0, 22.0), "jm-rbpf": Band(0.0, 5.0)}
"""m, over all steps. The paper gives none of the parameters of noise and field, so errors of another setup differ."""
PROTOTYPE: Final[Mapping[str, str]] = {
    "rbpf": "62.5, 3.39, 74 %",
    "rbpf, never anew": "165",
    "mrbpf": "12.8, 7.64, 3 %",
    "mrbpf, never anew": "33-39",
    "mrbpf-weightmass": "4.78, 4.94, 0 %",
    "jm-rbpf": "4.50, 4.42, 0 %",
    "jm-rbpf, unknown rate": "4.4",
    "bootstrap, modes": "4.59, 4.75, 0 %",
    IMM: "8.1, 10.1, 1 %",
    "jm-rbpf, 8 sensors": "3.5",
    f"jm-rbpf, lag {LAG}": "2.7",
    f"jm-rbpf, lag {LAG}, 8 sensors": "2.5",
    "bound": "2.67, 2.77",
}
"""Of an independent implementation with the same parameters and other fields: all steps, before the turn, lost."""
NAMES: Final = (*CASES, IMM)


def errors_of(found: Found, name: str, period: str | None = None) -> Array:
    """The errors (R, T', 2) of an experiment, of all steps or those of a period."""
    errors = found.figures[name]["errors"]
    return errors if period is None else errors[:, [t - 1 for t in PERIODS[period] if t <= errors.shape[1]]]


def lost(found: Found, name: str) -> Interval:
    """The share of the runs that are lost."""
    hits = RULE.holds(found.figures[name]["errors"])
    return share(int(hits.sum()), len(hits))


def bound(found: Found, sensors: int = SENSORS[0]) -> float:
    """m, over all runs and steps."""
    return float(np.sqrt(np.square(found.figures["bound"][f"{sensors}"]).mean()))


def tables(found: Found) -> dict[str, list[Row]]:
    """The errors over all steps, by filter, and those of each period."""
    return {"filters": [_row(found, name) for name in NAMES], "periods": _periods(found)}


def _row(found: Found, name: str) -> Row:
    error, least = scores.rmse(errors_of(found, name)), bound(found, _sensors(name))
    published, band = PUBLISHED.get(name), BANDS.get(name)
    smoothed = "lag" in name  # the bound is that of filters
    return Row(
        name,
        name.split(",", maxsplit=1)[0],
        "error, m",
        error,
        published=published,
        ratio=error.over(published) if published else None,
        lost=lost(found, name),
        bound=None if smoothed else least,
        to_bound=None if smoothed else error.value / least,
        band=str(band or ""),
        verdict=inside([error], [band]) if band else "",
    )


def _sensors(name: str) -> int:
    return CASES[name].sensors if name in CASES else SENSORS[0]


def _periods(found: Found) -> list[Row]:
    return [
        Row(name, name.split(",", maxsplit=1)[0], f"error {period}, m", scores.rmse(errors_of(found, name, period)))
        for name in NAMES
        for period in PERIODS
    ]


# --- in Markdown ------------------------------------------------------------------------------------------------------


def filters(found: Found) -> str:
    """A row for each experiment with one target."""
    header = ("filter", "error, m", *PERIODS, "95 %", "lost", "over bound", "prototype")
    rows = []
    for name in NAMES:
        row = _row(found, name)
        rows.append(
            [
                name,
                with_interval(row.ours),
                *(plain(scores.rmse(errors_of(found, name, period)).value) for period in PERIODS),
                plain(scores.percentile(errors_of(found, name), 95.0).value),
                with_interval(lost(found, name), percent),
                "-" if row.to_bound is None else f"{row.to_bound:.2f}",
                PROTOTYPE.get(name, ""),
            ]
        )
    least = found.figures["bound"][f"{SENSORS[0]}"]
    periods = [plain(float(np.sqrt(np.square(least[:, [t - 1 for t in PERIODS[p]]]).mean()))) for p in PERIODS]
    rows.append(["bound", plain(bound(found)), *periods, "", "", "1", PROTOTYPE["bound"]])
    return aligned(header, rows)


def published(found: Found) -> str:
    """Beside the paper's Table 2, and the bands."""
    return rows_table([row for row in tables(found)["filters"] if row.case in BANDS])


def ratios(found: Found, pairs: Mapping[str, tuple[str, str]]) -> str:
    """What each difference costs: the errors of the first over those of the second, run by run."""
    rows = [
        [what, one, other, with_interval(scores.ratio(errors_of(found, one), errors_of(found, other)))]
        for what, (one, other) in pairs.items()
    ]
    return aligned(("what", "error of", "over that of", "ratio"), rows)


def sound(found: Found, names: Sequence[str]) -> str:
    """What the delay of sound and a window cost: errors, and how far tracks are ahead of the target on the mean."""
    rows = []
    for name in names:
        one, ratio = found.figures[name], scores.ratio(errors_of(found, name), errors_of(found, names[0]))
        way = np.diff(one["truth"], axis=1)
        ahead = np.vecdot(one["errors"][:, 1:], way / np.linalg.norm(way, axis=-1, keepdims=True)).mean()
        error = with_interval(scores.rmse(one["errors"]))
        rows.append([name, error, f"{ahead:.2f}", with_interval(ratio)])
    return aligned(("filter", "error, m", "ahead, m", f"over {names[0]}"), rows)


def headers(found: Found) -> str:
    """How often another sensor becomes the processing header."""
    shares = {
        name: found.figures[name]["changes"].mean() / STEPS for name in ("jm-rbpf", "mrbpf", "jm-rbpf, 8 sensors")
    }
    rows = [[name, f"{share:.3f}"] for name, share in shares.items()]
    return aligned(("filter", "hand-overs in a step"), rows)


def consistency(found: Found) -> str:
    """The mean of the squared error in units of the covariance: 2 where it is right."""
    rows = [[name, plain(float(found.figures[name]["squares"].mean()))] for name in CASES if "," not in name]
    return aligned(("filter", "NEES of the position"), rows)


def crossings(found: Found) -> str:
    """A row for each number of particles."""
    rows = []
    for n in CROSSING_PARTICLES:
        one = found.figures[crossing(n)]
        runs = len(one["lost"])
        away = np.linalg.norm(one["means"] - one["truth"], axis=-1)
        rows.append(
            [
                f"{n}",
                f"{runs}",
                with_interval(share(int(one["lost"].sum()), runs), percent),
                with_interval(share(int(one["swapped"].sum()), runs), percent),
                plain(float(np.median(away))),
            ]
        )
    return aligned(("particles", "runs", "lost", "swapped", "median error, m"), rows)
