"""Whole runs of ``yang-ecpa`` in virtual time: sound, detection, directed diffusion, the head, fixes at the base."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final, NamedTuple

import numpy as np

from launcher.plan.plan import make_plan
from launcher.record.ledger import Ledger
from launcher.record.tables import TrackRow
from launcher.record.virtually import simulate
from launcher.records import Plan
from launcher.reproduce.kernels.study import Figures
from launcher.reproduce.papers.yang.solved.solving import figures_of
from launcher.reproduce.papers.yang.trials.sensitivity import C
from trackfield.filters.passes.bounds import line_errors
from trackfield.filters.types import Array
from trackfield.models import passing
from trackfield.role import NS
from trackfield.scenario import Scenario

SCENARIO: Final = "yang-ecpa"
TRACKERS: Final = ("ml", "ecpa")
NEAR_M: Final = 30.0
"""A leg of the path that comes so close to the middle of the nodes is a pass."""
SCALARS: Final = ("frames", "bytes", "data", "interests")
"""Of a run, for each pass: all frames and their payload, those with data (reports and fixes, each hop), interests."""


class Pass(NamedTuple):
    """A pass of a run: from when until when (s), the true state (4,) nearest to the nodes' middle, and ``last_s``.

    That is when the last node hears the target nearest.
    """

    from_s: float
    until_s: float
    truth: Array
    last_s: float


def run(changes: Mapping[str, Any], seeds: Sequence[int]) -> Figures:
    """Errors (R, P) of each tracker's fix at the base in each of the P passes of a run; NaN where it has none.

    ``fix NAME`` (R, P, 4) is the state, ``reports NAME`` (R, P) of how many sensors it is made, ``delay NAME`` (R, P)
    (s) how long after the last node heard the target nearest it is known at the base; ``SCALARS`` (R,).
    """
    found = [_run(changes, seed) for seed in seeds]
    return {name: np.stack([one[name] for one in found]) for name in found[0]}


def _run(changes: Mapping[str, Any], seed: int) -> dict[str, Array]:
    settings = {"seed": seed, "camera.kind": "none", "fusion.trackers": list(TRACKERS), **changes}
    plan = make_plan(Scenario.load(SCENARIO, settings), run=f"{SCENARIO}-{seed}")
    ledger, rows = simulate(plan)
    places = np.array([(place.x, place.y) for place in plan.info.places if place.id.startswith("n")])
    passes = passes_of(plan, places)
    figures = dict(_scalars(plan, ledger, len(passes)))
    base = plan.views[-1].sources
    for name in TRACKERS:
        told = [row for row in rows if row.point.tracker == name and row.point.source in base and row.has_track]
        figures |= _fixes(name, told, passes, places.mean(axis=0))
    return figures


def passes_of(plan: Plan, places: Array) -> list[Pass]:
    """The passes of the target, in their order: legs of its path that come near the middle of ``places`` (K, 2)."""
    (path,) = plan.paths.values()
    middle = places.mean(axis=0)
    found = []
    for from_s, until_s in zip(path.t, path.t[1:], strict=False):
        state = path.at((from_s + until_s) / 2.0)
        if state is None or np.hypot(*state[2:]) == 0.0:
            continue
        half = np.array(state)
        since = float(passing.times(half, middle[None], np.inf)[0])
        nearest = half + since * np.array([half[2], half[3], 0.0, 0.0])
        if abs(since) < (until_s - from_s) / 2.0 and np.hypot(*(nearest[:2] - middle)) < NEAR_M:
            at = (from_s + until_s) / 2.0 + since
            found.append(Pass(from_s, until_s, nearest, at + float(passing.times(nearest, places, C).max())))
    return found


def _fixes(name: str, rows: Iterable[TrackRow], passes: Sequence[Pass], middle: Array) -> dict[str, Array]:
    """Of the points in which an event was closed with a fix; of several in a pass, the last."""
    count = len(passes)
    means, reports, delays = np.full((count, 4), np.nan), np.full(count, np.nan), np.full(count, np.nan)
    for row in rows:
        event_ns = row.point.event_ns
        if event_ns is None or row.point.refused:
            continue
        for number, one in enumerate(passes):
            if one.from_s <= event_ns / NS < one.until_s:
                means[number] = row.point.mean
                reports[number] = len(row.point.sensors)
                delays[number] = row.told_ns / NS - one.last_s
    truth = np.array([one.truth for one in passes])
    errors = figures_of(name, line_errors(means, truth, middle))
    return {**errors, f"fix {name}": means, f"reports {name}": reports, f"delay {name}": delays}


def _scalars(plan: Plan, ledger: Ledger, passes: int) -> dict[str, Array]:
    sent = {
        (row.src, row.kind, row.sent_ns, row.copy): row for row in ledger.rows if row.sent_ns >= plan.origin_ns
    }.values()
    counts = {
        "frames": len(sent),
        "bytes": sum(len(row.payload) for row in sent),
        "data": sum(row.kind == "data" for row in sent),
        "interests": sum(row.kind == "interest" for row in sent),
    }
    return {name: np.array(count / passes) for name, count in counts.items()}
