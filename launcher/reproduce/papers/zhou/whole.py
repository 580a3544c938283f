"""The figures of whole runs of ``zhou-upf`` in virtual time: nodes that sense, elect a head, measure, hand over."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

import numpy as np

from launcher.plan.plan import make_plan
from launcher.record.ledger import Ledger
from launcher.record.metrics import run_metrics
from launcher.record.tables import TrackRow
from launcher.record.views import headline, seen
from launcher.record.virtually import simulate
from launcher.records import Plan
from launcher.reproduce.kernels.study import Figures
from launcher.reproduce.papers.zhou import outlying
from launcher.reproduce.papers.zhou.setups import Setup
from trackfield.filters.bounds import information
from trackfield.filters.measurement import jacobians, noise_sd
from trackfield.filters.types import Array, Readings, Reports
from trackfield.role import NS
from trackfield.scenario import Scenario
from trackfield.tracking.smoothing import RTS

SCENARIO: Final = "zhou-upf"
BASE: Final = "base "
"""Before the names of errors in the view of the base."""
SCALARS: Final = (
    "reports", "measuring", "handovers", "lost handovers", "hand-over frames", "hand-over bytes", "frames", "bytes",
    "awake", "most awake", "elections", "split elections", "claims in vain", "election s",
)  # fmt: skip
"""Figures that are one number a run.

``reports`` used and sensors ``measuring`` in a step; ``hand-over frames`` and ``hand-over bytes`` for each hand-over
that was tried; ``frames`` and payload ``bytes`` in a step; the share of time ``awake``, mean of the nodes and of the
one that is ``most awake``; ``elections`` that somebody won, of these ``split elections`` that more than one did, and
their mean duration; ``claims in vain``: those after which nobody led, as a head answered that it does. NaN where there
is nothing to take the mean of.
"""


def run(setup: Setup, changes: Mapping[str, Any], seeds: Sequence[int]) -> Figures:
    """The figures of runs with these seeds, of the scenario with ``changes``; ``setup`` says what the bound is of.

    ``errors NAME`` (R, T, 4) of each tracker in the network, ``base errors NAME`` in the base, NaN without a track;
    what the base smoothed is there only;
    ``information`` (R, T, 4, 4), which the reports that were used have about the true state; ``SCALARS`` (R,).
    """
    found = [_figures(setup, changes, seed) for seed in seeds]
    return {name: np.stack([one[name] for one in found]) for name in found[0]}


def _figures(setup: Setup, changes: Mapping[str, Any], seed: int) -> dict[str, Array]:
    outlying.known()
    plan = make_plan(Scenario.load(SCENARIO, {"seed": seed, **changes}), run=f"{SCENARIO}-{seed}")
    ledger, rows = simulate(plan)
    in_network, base = (seen(rows, view) for view in plan.views)
    figures = {}
    for name in plan.info.trackers:
        for before, some in ((BASE, base),) if name.endswith(RTS) else (("", in_network), (BASE, base)):
            figures[f"{before}errors {name}"] = _errors(plan, setup, [row for row in some if row.point.tracker == name])
    figures["information"] = _informations(plan, setup, headline(plan, rows))
    scalars = _scalars(plan, ledger, rows)
    return figures | {name: np.array(scalars[name], float) for name in SCALARS}


# --- tracks -----------------------------------------------------------------------------------------------------------


def _errors(plan: Plan, setup: Setup, rows: Iterable[TrackRow]) -> Array:
    """(T, 4): estimate less truth, NaN without a track."""
    found = np.full((setup.steps, 4), np.nan)
    for row in rows:
        step = plan.step_of(row.t_ns)
        if row.has_track and row.truth is not None and 1 <= step <= setup.steps:
            found[step - 1] = np.subtract(row.point.mean, row.truth)
    return found


def _informations(plan: Plan, setup: Setup, rows: Iterable[TrackRow]) -> Array:
    """(T, 4, 4), of the sensors behind the points of the first tracker; 0 in steps without."""
    at = {place.id: (place.x, place.y) for place in plan.info.places}
    found = np.zeros((setup.steps, 4, 4))
    (path,) = plan.paths.values()
    for row in rows:
        step, sensors = plan.step_of(row.t_ns), row.point.sensors
        if row.point.tracker == plan.info.trackers[0] and 1 <= step <= setup.steps and sensors:
            truth = np.array(path.at(row.t_ns / NS))
            places = np.array([at[id] for id in sensors])
            readings = (Readings(setup.kind, np.zeros((len(sensors), 1))),)
            some = Reports(step, tuple(sensors), places, readings, 1, directional=False)
            found[step - 1] = information(jacobians(setup.model, truth, some), noise_sd(setup.model, some))
    return found


# --- frames -----------------------------------------------------------------------------------------------------------


def _scalars(plan: Plan, ledger: Ledger, rows: Sequence[TrackRow]) -> dict[str, float]:
    metrics = run_metrics(plan, ledger, rows)
    leaders = metrics["leaders"]
    sent = {
        (row.src, row.kind, row.sent_ns, row.copy): row for row in ledger.rows if row.sent_ns >= plan.origin_ns - NS
    }.values()
    hands = [row for row in sent if row.kind == "hand-over"]
    offers = {row.payload for row in hands}
    steps = (ledger.run.end_ns - plan.origin_ns) / plan.step_ns
    return {
        "reports": _or_nan(leaders["reports_used"]),
        "measuring": _or_nan(leaders["reports_asked"]),
        "handovers": leaders["handovers"],
        "lost handovers": leaders["lost_handovers"],
        "hand-over frames": len(hands) / len(offers) if offers else np.nan,
        "hand-over bytes": sum(len(row.payload) for row in hands) / len(offers) if offers else np.nan,
        "frames": len(sent) / steps,
        "bytes": sum(len(row.payload) for row in sent) / steps,
        "awake": _or_nan(metrics["awake_share"]["mean"]),
        "most awake": _or_nan(metrics["awake_share"]["most"]),
        "elections": leaders["elections"] - leaders["unwon_elections"],
        "split elections": leaders["split_elections"],
        "claims in vain": leaders["unwon_elections"],
        "election s": _or_nan(leaders["election_s"]["mean"]),
    }


def _or_nan(value: float | None) -> float:
    return np.nan if value is None else value
