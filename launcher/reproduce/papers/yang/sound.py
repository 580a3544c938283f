"""Tables and a claim of what is found from sound: times of the detectors, and errors of the paths."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from launcher.reproduce.intervals import Interval, all_of, positive
from launcher.reproduce.kernels.study import Found
from launcher.reproduce.papers.yang.claims import two
from launcher.reproduce.papers.yang.published import DETECTORS, END_TO_END, SOUND
from launcher.reproduce.papers.yang.scores import KINDS, UNITS, mean_error, share_of
from launcher.reproduce.papers.yang.solved.waveforms import SNR_DB, SOUND_CASE, WAYS
from launcher.reproduce.papers.yang.tables import errors, fixes, quantity
from launcher.reproduce.tables import Band, Claim, Row, Verdict, inside, percent, verdict, with_interval
from trackfield.filters.types import Array

BEST: Final = "fit + ml"
FIXES: Final = 0.95
"""The share of the runs that should have a fix: means over fewer hide what was refused."""
RULE: Final = (
    "mean errors are at most "
    + ", ".join(f"{limit:g} {UNITS[kind]}" for kind, limit in zip(KINDS, END_TO_END, strict=True))
    + f"; in part: but less than {FIXES:.0%}"
)
"""What is asked of the fit and maximum likelihood, but for the words of what has a fix."""


def sound_rows(found: Found) -> list[Row]:
    """The detectors' errors, and those of the paths that follow."""
    return [*_detectors(found), *(row for name in WAYS for row in _way(found, name))]


def _detectors(found: Found) -> Iterator[Row]:
    figures = found.figures[SOUND_CASE]
    for name, told in DETECTORS.items():
        yield Row(SOUND_CASE, name, "sd of a time, in widths", _rms(figures[f"time {name}"]), prototype=told)
        missed, false = (figures[f"{which} {name}"].sum() for which in ("missed", "false"))
        reports = figures[f"time {name}"].size
        yield Row(SOUND_CASE, name, "share of passes missed", share_of(np.arange(reports) < missed))
        yield Row(SOUND_CASE, name, "share of passes reported again", share_of(np.arange(reports) < false))


def _rms(off: Array) -> Interval:
    """Of all errors (R, K) that there are."""
    there = (~np.isnan(off)).sum(axis=1)
    squares = np.square(np.nan_to_num(off)).sum(axis=1)
    return positive(lambda weights: np.sqrt(weights @ squares / (weights @ there)), len(off))


def _way(found: Found, name: str) -> Iterator[Row]:
    for column, kind in enumerate(KINDS):
        ours = mean_error(errors(found, SOUND_CASE, kind, name))
        band = Band(0, END_TO_END[column]) if name == BEST else None
        yield Row(
            *(SOUND_CASE, name, quantity(kind), ours),
            prototype=SOUND[name][column],
            band="" if band is None else str(band),
            verdict="" if band is None else inside([ours], [band]),
        )
    yield Row(SOUND_CASE, name, "share of runs with a fix", fixes(found, SOUND_CASE, name))


def end_to_end_claim(found: Found) -> Claim:
    """Whether ``fit`` and ``ml`` keep their band, and refuse few runs."""
    means = [mean_error(errors(found, SOUND_CASE, kind, BEST)) for kind in KINDS]
    there = fixes(found, SOUND_CASE, BEST)
    return Claim(
        f"(Not in the paper) From sound at {SNR_DB:g} dB, the fit and maximum likelihood find the path",
        f"{RULE} of the runs have a fix",
        f"{listed(means)}; a fix in {with_interval(there, percent)}",
        found_by(means, there),
    )


def listed(means: Sequence[Interval]) -> str:
    """Mean errors of ``KINDS``, with their units."""
    return ", ".join(f"{kind} {two(one)} {UNITS[kind]}" for kind, one in zip(KINDS, means, strict=True))


def found_by(means: Sequence[Interval], there: Interval) -> Verdict:
    """Whether mean errors of ``KINDS`` are as ``RULE`` says, with a share ``there`` of fixes."""
    close = all_of(one.at_most(limit) for one, limit in zip(means, END_TO_END, strict=True))
    return "holds in part" if close and there.at_most(FIXES) else verdict(all_of((close, there.above(FIXES))))
