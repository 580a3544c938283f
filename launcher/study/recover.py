"""A run folder whose run was cut off, made as whole as its log allows."""

from __future__ import annotations

import fcntl
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

from launcher.files import LOG, MANIFEST, SCENARIO
from launcher.plan.prepare import check_speed, load, planned
from launcher.record.folder import check_scenario
from launcher.record.journal import METRICS
from launcher.record.kept.recovery import recovered
from launcher.record.measures import RunFigures
from launcher.record.metrics import INTERRUPTED, RECORDER_DIED, THE_END, Metrics, ended_because
from launcher.records import Plan
from launcher.run import Outcome, close_folder
from trackfield.errors import ScenarioError

_OF_THE_LAUNCHER = ("wall_s", "cpu_s", "processes", "end_reason")
"""Parts of metrics.json that the log does not say."""


def recover(run: Path) -> Outcome:
    """Make tables, metrics, timeline and report of a run folder from its log, and remove the log.

    Raises ``ScenarioError`` if there is no log, the run still goes on, or the scenario was changed afterwards.
    """
    _check_over(run)
    check_scenario(run)
    plan = _planned(run)
    metrics = recovered(plan, run)
    told = metrics["processes"]["died"] is not None
    metrics |= {"driver": "processes", "wall_s": None, "end_reason": INTERRUPTED if told else RECORDER_DIED}
    metrics |= _kept(run / METRICS)
    metrics |= ended_because(THE_END if metrics["ended_s"] >= plan.info.end_s else metrics["end_reason"])
    return close_folder(plan, run, metrics, [], [])


def _check_over(run: Path) -> None:
    """Raise ``ScenarioError`` unless there is a log that no recorder writes."""
    try:
        with (run / LOG).open("rb") as log:
            fcntl.flock(log, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        raise ScenarioError("is still going on", file=str(run), expected="a run that is over") from None
    except OSError as error:
        if (run / METRICS).is_file() and isinstance(error, FileNotFoundError):
            what = "is complete: there is nothing to recover"
        else:
            what = f"has no {LOG}: there is nothing to make its tables from"
        raise ScenarioError(what, file=str(run), expected="the folder of a run that was cut off") from None


def _planned(run: Path) -> Plan:
    """The plan of the run; its scenario has been checked."""
    manifest = json.loads((run / MANIFEST).read_bytes())
    name, speed = manifest.get("run"), manifest.get("speed")
    if not isinstance(name, str) or not isinstance(speed, int | float):
        raise ScenarioError("has no run and speed", file=str(run / MANIFEST), expected="the manifest of a run")
    check_speed(speed)
    plan = planned(load(str(run / SCENARIO)), speed)
    return replace(plan, run=replace(plan.run, run=name), info=replace(plan.info, run=name))


def _kept(file: Path) -> Metrics:
    """What the launcher told of the run, if it came to that."""
    try:
        metrics: dict[str, Any] = json.loads(file.read_bytes())
        RunFigures.of(metrics)
    except (OSError, ValueError, TypeError, ScenarioError):
        return {}
    return {key: metrics[key] for key in _OF_THE_LAUNCHER}
