"""Tables of how often the original algorithm and ECPA are right, why they fail, and what each difference gives."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from launcher.reproduce.intervals import Interval
from launcher.reproduce.kernels.study import Found
from launcher.reproduce.papers.yang.published import ENHANCED, SUCCESS
from launcher.reproduce.papers.yang.scores import mean_error, share_of
from launcher.reproduce.papers.yang.solved.failing import TOLD, WITHOUT
from launcher.reproduce.papers.yang.solved.solving import ECPA
from launcher.reproduce.papers.yang.trials.setups import FAIL
from launcher.reproduce.tables import Band, Row, aligned, inside
from trackfield.filters.passes.types import REASONS

RIGHT: Final = "share of runs that are right"
PROTOTYPE_BOTH: Final = 0.04
"""Of the original algorithm, with times off by 0.1 s and places by up to 5 m."""
_BOTH: Final = "times 0.1 s, places 5 m"


def success_rows(found: Found) -> list[Row]:
    """The shares of runs that are right, of both algorithms, beside the prototype's and the bands."""
    return [row for case in FAIL for row in _success(found, case)]


def _success(found: Found, case: str) -> Iterator[Row]:
    figures = found.figures[case]
    yield _row(case, "cpa", share_of(figures["cpa right"]), SUCCESS.get(case, (PROTOTYPE_BOTH, None)))
    yield Row(case, "cpa", "share of runs with a path", share_of(figures["cpa accepted"]))
    yield _row(case, ECPA, share_of(figures[f"right {ECPA}"]), ENHANCED.get(case, (None, None)))
    hull = Band(0.99, 1.0)
    share = share_of(figures["ecpa in hull"])
    yield Row(
        *(case, ECPA, "share of runs with a path through the hull", share),
        prototype=1.0, band=str(hull), verdict=inside([share], [hull]),
    )  # fmt: skip


def _row(case: str, name: str, share: Interval, told: tuple[float | None, Band | None]) -> Row:
    prototype, band = told
    text, verdict = ("", "") if band is None else (str(band), inside([share], [band]))
    return Row(case, name, RIGHT, share, prototype=prototype, band=text, verdict=verdict)


def reason_rows(found: Found) -> list[Row]:
    """Why the original algorithm has no path, or a wrong one: the share of the runs with each outcome."""
    codes = sorted({int(code) for case in FAIL for code in found.figures[case]["cpa reason"]} - {0})
    rows = []
    for case in FAIL:
        figures = found.figures[case]
        wrong = (figures["cpa accepted"] > 0) & (figures["cpa right"] == 0)
        outcomes = {"right": figures["cpa right"] > 0, "accepted, wrong": wrong}
        outcomes |= {REASONS[code]: figures["cpa reason"] == code for code in codes}
        rows += [Row(case, "cpa", name, share_of(hits)) for name, hits in outcomes.items()]
    return rows


def reasons(rows: Sequence[Row]) -> str:
    """The rows above with a line for each case, in Markdown."""
    outcomes = list(dict.fromkeys(row.quantity for row in rows))
    cases: dict[str, dict[str, str]] = {}
    for row in rows:
        cases.setdefault(row.case, {})[row.quantity] = f"{row.ours.value:.1%}"
    return aligned(("case", *outcomes), [[case, *(some[name] for name in outcomes)] for case, some in cases.items()])


def ablation_rows(found: Found) -> list[Row]:
    """ECPA without each of its differences: how often it is right, and the location's mean error."""
    return [row for case in ("times 0.1 s", _BOTH) for row in _ablation(found, case)]


def _ablation(found: Found, case: str) -> Iterator[Row]:
    figures = found.figures[case]
    for name in (ECPA, *WITHOUT, TOLD):
        yield Row(case, name, RIGHT, share_of(figures[f"right {name}"]))
        if np.isfinite(figures[f"location {name}"]).any():
            yield Row(case, name, "location, m", mean_error(figures[f"location {name}"]))
            yield Row(case, name, "heading, deg", mean_error(np.degrees(figures[f"heading {name}"])))
