"""Solvers by name: from the reports of events to paths, or to the reasons why there is none."""

from __future__ import annotations

from typing import Final

import numpy as np

from trackfield.filters.passes.cpa import alike, cpa, tried
from trackfield.filters.passes.doubt import judged, refused
from trackfield.filters.passes.ecpa import ALL_DIFFERENCES, Differences, ecpa
from trackfield.filters.passes.geometry import state
from trackfield.filters.passes.ml import MOST
from trackfield.filters.passes.noise import Lines, covariance
from trackfield.filters.passes.plane import plane
from trackfield.filters.passes.types import FIX, UNCERTAIN, Codes, Event, Flags, Numbers, Passes, Solved, event_of
from trackfield.filters.types import Array

SOLVERS: Final = ("cpa", "ecpa", "ml")
GATE: Final = 20.5
"""Five reports of one pass leave a chi^2 above this in one of a thousand events."""
LEAST: Final = 4
FEWEST: Final = 4
"""The solvers look at so many sensors at a time; fewer reports are padded."""


def solve(name: str, passes: Passes, *, sound_m_s: float = 340.0, gate: float = GATE, least: int = LEAST) -> Solved:
    """The paths that events tell of, by the solver ``name``: one of ``SOLVERS``, or "plane".

    Fewer than ``least`` reports are refused. ``gate`` is for ml: a path is refused if its chi^2 is as unlikely as this
    is for five reports.
    """
    count = passes.times_s.shape[-1]
    if count < FEWEST:
        answer = solve(name, _padded(passes), sound_m_s=sound_m_s, gate=gate, least=least)
        return answer._replace(used=answer.used[..., :count])
    if name == "ml":
        return solve_ml(passes, sound_m_s=sound_m_s, gate=gate, least=least)
    if name == "ecpa":
        return solve_ecpa(passes, sound_m_s=sound_m_s, least=least)
    if name == "cpa":
        return solve_cpa(passes, sound_m_s=sound_m_s, least=least)
    if name == "plane":
        return solve_plane(passes, sound_m_s=sound_m_s, least=least)
    raise ValueError(f"no solver {name!r}; there are {', '.join((*SOLVERS, 'plane'))}")


def _padded(passes: Passes) -> Passes:
    """The same with room for ``FEWEST`` reports."""
    missing = FEWEST - passes.times_s.shape[-1]

    def wider(part: Array, axis: int = -1) -> Array:
        room = [(0, missing if i == part.ndim + axis else 0) for i in range(part.ndim)]
        return np.pad(part, room, constant_values=np.nan)

    return passes._replace(
        places=wider(passes.places, -2),
        times_s=wider(passes.times_s),
        strengths=wider(passes.strengths),
        time_sd_s=wider(passes.time_sd_s),
        strength_sd=wider(passes.strength_sd),
    )


def solve_ml(passes: Passes, *, sound_m_s: float = 340.0, gate: float = GATE, least: int = LEAST) -> Solved:
    """Maximum likelihood, without the one report that is bad if one is."""
    event = _flat(event_of(passes), passes)
    with np.errstate(all="ignore"):
        found = judged(event, sound_m_s, gate, max(least, 4))
    return _answer(passes, event, found.best.line, found.best.covariance, found.used, found.reason)


def solve_ecpa(
    passes: Passes,
    *,
    sound_m_s: float = 340.0,
    least: int = LEAST,
    location: str = "pair",
    differences: Differences = ALL_DIFFERENCES,
    sides: Array | None = None,
) -> Solved:
    """ECPA as published, or with parts of it, as ``ecpa`` describes them; ``sides`` (..., K)."""
    beside = _beside(passes, sides, _flat(event_of(passes), passes).loudest(MOST)[1])

    def lines(event: Event) -> tuple[Array, Codes]:
        told = None if beside is None else np.broadcast_to(beside, event.times.shape)
        return ecpa(event, sound_m_s, location=location, differences=differences, sides=told)

    return _direct(passes, lines, max(least, 4))


def solve_cpa(passes: Passes, *, sound_m_s: float = 340.0, least: int = LEAST, sides: Array | None = None) -> Solved:
    """The original algorithm, if ``sides`` (..., K) are known, or trying each sensor as the lone one."""
    event, kept = _flat(event_of(passes), passes).loudest(MOST)
    beside = _beside(passes, sides, kept)
    with np.errstate(all="ignore"):
        found = tried(event, sound_m_s) if beside is None else cpa(event, beside, sound_m_s)
        C = covariance(event, found.line, lambda other: alike(other, found, sound_m_s))
    return _doubted(passes, event, kept, (found.line, found.reason), C, max(least, 4))


def solve_plane(passes: Passes, *, sound_m_s: float = 340.0, least: int = LEAST) -> Solved:
    """Least squares, and the offset from the strengths."""

    def lines(event: Event) -> tuple[Array, Codes]:
        return plane(event, sound_m_s), np.full(event.epoch_s.shape, FIX, np.uint8)

    return _direct(passes, lines, max(least, 3))


def _direct(passes: Passes, lines: Lines, least: int) -> Solved:
    """By a solver that gives lines only."""
    event, kept = _flat(event_of(passes), passes).loudest(MOST)
    with np.errstate(all="ignore"):
        found = lines(event)
        C = covariance(event, found[0], lines)
    return _doubted(passes, event, kept, found, C, least)


def _doubted(passes: Passes, event: Event, kept: Numbers, found: tuple[Array, Codes], C: Array, least: int) -> Solved:
    """What was found, unless there are too few reports, or nothing says how certain it is."""
    line, failed = found
    reason = refused(event, least)
    reason = np.where(reason == FIX, failed, reason)
    known = np.isfinite(line).all(axis=-1) & np.isfinite(C).all(axis=(-2, -1))
    reason = np.where((reason == FIX) & ~known, np.uint8(UNCERTAIN), reason)
    used = np.zeros((len(reason), passes.times_s.shape[-1]), bool)
    np.put_along_axis(used, kept, event.heard, axis=-1)
    return _answer(passes, event, line, C, used, reason)


def _answer(passes: Passes, event: Event, line: Array, C: Array, used: Flags, reason: Codes) -> Solved:
    """In the shape of ``passes``, with NaN where there is no fix."""
    refused = reason != FIX
    with np.errstate(all="ignore"):
        mean = state(line)
    mean[:, :2] += event.centroid
    shape = passes.times_s.shape
    return Solved(
        np.where(refused, np.nan, event.epoch_s + line[:, 0]).reshape(shape[:-1]),
        np.where(refused[:, None], np.nan, mean).reshape(*shape[:-1], 4),
        np.where(refused[:, None, None], np.nan, C).reshape(*shape[:-1], 4, 4),
        (used & ~refused[:, None]).reshape(shape),
        reason.reshape(shape[:-1]),
    )


def _flat(event: Event, passes: Passes) -> Event:
    """The events with one leading axis."""
    leading = passes.times_s.ndim - 1
    return event.map(lambda part: part.reshape(-1, *part.shape[leading:]))


def _beside(passes: Passes, sides: Array | None, kept: Numbers) -> Array | None:
    """``sides`` (..., K) of the reports that are ``kept``, as (N, K), 0 where there is no report."""
    if sides is None:
        return None
    heard = event_of(passes).heard
    return np.take_along_axis(np.where(heard, sides, 0.0).reshape(-1, heard.shape[-1]), kept, axis=-1)
