"""What a study leaves besides its report: tables of all runs and steps, and one run to look at."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Final

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from launcher.plan.prepare import planned
from launcher.record.folder import keep, prepare_folder
from launcher.reproduce.case import Case
from launcher.reproduce.records import Record, Records, errors_by_tracker
from launcher.reproduce.scores import rmse_over_time
from launcher.run import run_virtual
from trackfield.filters import metrics

RUNS, STEPS, RUN = "runs.parquet", "steps.parquet", "run"
_AXES: Final = ("x", "y", "vx", "vy")


def write_tables(folder: Path, cases: Mapping[str, Case], records: Records) -> None:
    """runs.parquet has a row for each case, seed and tracker, steps.parquet one for each case, tracker and step."""
    runs, steps = [], []
    for case, some in records.items():
        for tracker, errors in errors_by_tracker(cases[case], some).items():
            runs += [
                {"case": case, "tracker": tracker, "seed": seed, **_run(one, record)}
                for seed, (one, record) in enumerate(zip(errors, some, strict=True), 1)
            ]
            steps += [
                {"case": case, "tracker": tracker, "step": step, **_named(rmse)}
                for step, rmse in enumerate(rmse_over_time(errors), 1)
            ]
    pq.write_table(pa.Table.from_pylist(runs), folder / RUNS)
    pq.write_table(pa.Table.from_pylist(steps), folder / STEPS)


def _run(errors: np.ndarray[tuple[int, int], np.dtype[np.float64]], record: Record) -> dict[str, float | bool]:
    """The figures of a run: errors (T, 4)."""
    frames, payload, send_j, total_j = record.network.tolist()
    return {
        **_named(np.sqrt(np.nanmean(np.square(errors), axis=0))),
        "rmse_position": metrics.rmse(errors[:, :2]),
        "lost": bool(metrics.Lost().holds(errors[:, :2])),
        "reports": float(record.reports.sum()),
        "frames": frames,
        "payload_bytes": payload,
        "send_j": send_j,
        "total_j": total_j,
    }


def _named(rmse: np.ndarray[tuple[int], np.dtype[np.float64]]) -> dict[str, float]:
    return {f"rmse_{axis}": value for axis, value in zip(_AXES, rmse.tolist(), strict=True)}


def write_run(folder: Path, case: Case, seed: int) -> Path:
    """The run of the case with this seed as a run folder like any other, in place of an earlier one."""
    out = folder / RUN
    shutil.rmtree(out, ignore_errors=True)
    scenario = case.scenario(seed)
    plan = planned(scenario)
    keep(scenario, prepare_folder(out, scenario.name, seed))
    if run_virtual(plan, out).signal is not None:
        raise KeyboardInterrupt
    return out
