"""The same study with masters and slaves that exchange messages: whole runs in virtual time of ``ozfidan-clusters``."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from math import hypot
from typing import Any, Final

import numpy as np

from launcher.plan.plan import make_plan
from launcher.record.metrics import run_metrics
from launcher.record.tables import TrackRow
from launcher.record.virtually import simulate
from launcher.reproduce.kernels.scores import mean
from launcher.reproduce.kernels.study import Experiment, Figures, Found
from launcher.reproduce.papers.ozfidan.experiments import FAR_M
from launcher.reproduce.tables import Claim, aligned, percent, plain, verdict, with_interval
from trackfield.scenario import Scenario

OZFIDAN: Final = "ozfidan-clusters"
STEPS: Final = 300
MOST: Final = 6
"""Runs of each; one takes half a minute."""
LIMIT: Final = 1.3
"""The error over the bound, of delivered reports, that the field's radio may cost."""
LORA: Final = "LoRa, "
FIELD: Final = f"{LORA}merge_until_3"
"""The packaged scenario as it is."""
SLAVES: Final = 256
FEW_ORPHANS: Final = 0.03
RUNS: Final[dict[str, dict[str, Any]]] = {
    FIELD: {},
    f"{LORA}closest": {"architecture.policy": "closest"},
    f"{LORA}nearest_4": {"architecture.policy": "nearest_4", "fusion.deadline_s": 1.33},
    f"{LORA}merge_until_3, windows every 10 steps": {"architecture.listen_every": 10},
    f"{LORA}merge_until_3, slaves at 8 dBm": {"radio.slave.tx_dbm": 8.0},
    f"{LORA}merge_until_3, slaves at 17 dBm": {"radio.slave.tx_dbm": 17.0},
}
"""The runs by name, with what they change of the scenario."""
COLUMNS: Final = {
    "error": "error, m", "to bound": "error over bound", "base": "error at the base, m", "age": "age there, s",
    "reports": "reports used", "asked": "asked for", "handovers": "hand-overs", "lost": "of them lost",
    "orphans": "orphans", "overheard": "frames overheard", "frames": "frames a step", "energy": "energy, J",
}  # fmt: skip


def run(changes: dict[str, Any], seeds: Sequence[int]) -> Figures:
    """The figures of whole runs, (R,) each; ``far`` is whether the error was once above 100 m."""
    found: dict[str, list[float]] = {name: [] for name in (*COLUMNS, "far")}
    for seed in seeds:
        for name, value in _figures(changes, seed).items():
            found[name].append(value)
    return {name: np.array(values, float) for name, values in found.items()}


def _figures(changes: dict[str, Any], seed: int) -> dict[str, float]:
    scenario = Scenario.load(OZFIDAN, {"seed": seed, "target.steps": STEPS, **changes})
    plan = make_plan(scenario, run=f"{OZFIDAN}-{seed}")
    ledger, rows = simulate(plan)
    metrics = run_metrics(plan, ledger, rows)
    (tracker,) = metrics["trackers"].values()
    leaders, clusters = metrics["leaders"], metrics["clusters"]
    return {
        "error": tracker["rmse"]["position"],
        "to bound": tracker["times_bound"],
        "base": tracker["views"]["base"]["rmse"]["position"],
        "age": metrics["age_of_information_s"]["mean"],
        "reports": leaders["reports_used"],
        "asked": leaders["reports_asked"],
        "handovers": leaders["handovers"],
        "lost": leaders["lost_handovers"],
        "orphans": clusters["orphans_first"],
        "overheard": clusters["overheard"],
        "frames": metrics["frames"]["sent"] / STEPS,
        "energy": metrics["energy_j"]["total"],
        "far": float(any(_away(row) > FAR_M for row in rows if row.point.source in plan.info.headline)),
    }


def _away(row: TrackRow) -> float:
    """How far off a point is (m)."""
    if row.truth is None or not row.has_track:
        return 0.0
    return hypot(row.point.mean[0] - row.truth[0], row.point.mean[1] - row.truth[1])


EXPERIMENTS: Final = {
    name: Experiment(partial(run, changes), batch=1, most=MOST, roles=True) for name, changes in RUNS.items()
}


def table(found: Found) -> str:
    """A row for each kind of runs: means over them."""
    rows = []
    for name in RUNS:
        some = found.figures[name]
        shown = {what: with_interval(mean(some[what])) for what in ("error", "to bound")}
        cells = [shown[what] if what in shown else plain(float(some[what].mean())) for what in COLUMNS]
        rows.append([name, f"{len(some['error'])}", *cells, f"{int(some['far'].sum())}"])
    return aligned(("runs", "number", *COLUMNS.values(), f"runs over {FAR_M:g} m"), rows)


def done(found: Found) -> bool:
    """Whether these runs are part of a study."""
    return any(name in found.figures for name in RUNS)


def claims(found: Found) -> list[Claim]:
    """What the field with its radio should reach; none of a study of bare filters alone."""
    if not done(found):
        return []
    ratio, orphans = mean(found.figures[FIELD]["to bound"]), mean(found.figures[FIELD]["orphans"] / SLAVES)
    return [
        Claim(
            "Over the field's radio the track stays near the bound of delivered reports",
            f"with {FIELD}: the error is at most {LIMIT:g} times the bound, the mean over runs",
            f"{with_interval(ratio, lambda value: f'{value:.2f}')}; "
            f"{int(found.figures[FIELD]['far'].sum())} runs with an error over {FAR_M:g} m",
            verdict(ratio.at_most(LIMIT)),
        ),
        Claim(
            "Nearly all slaves find a master by radio",
            f"with {FIELD}: at most {FEW_ORPHANS:.0%} of the slaves are without one at the first step",
            with_interval(orphans, percent),
            verdict(orphans.at_most(FEW_ORPHANS)),
        ),
    ]
