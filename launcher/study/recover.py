"""A run folder whose run was cut off, made as whole as its log allows."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path

from launcher.files import LOG, MANIFEST, SCENARIO, lock, locked, reason
from launcher.plan.bridges import bridged
from launcher.plan.prepare import check_speed, load, planned
from launcher.record.folder import check_scenario
from launcher.record.journal import METRICS
from launcher.record.kept.recovery import recovered
from launcher.record.metrics import INTERRUPTED, RECORDER_DIED, THE_END, Metrics, ended_because
from launcher.record.reading.files import read_figures, read_manifest
from launcher.records import Plan
from launcher.run import Outcome, close_folder
from trackfield.errors import ScenarioError

_OF_THE_LAUNCHER = ("wall_s", "cpu_s", "processes", "end_reason")
"""Parts of metrics.json that the log does not say."""


def recover(run: Path) -> Outcome:
    """Make tables, metrics, timeline and report of a run folder from its log, and remove the log.

    Raises ``ScenarioError`` if there is no log, the run still goes on, or the scenario was changed afterwards.
    """
    with _over(run):
        check_scenario(run)
        plan = _planned(run)
        metrics = recovered(plan, run)
        told = metrics["processes"]["died"] is not None
        metrics |= {"driver": "processes", "wall_s": None, "end_reason": INTERRUPTED if told else RECORDER_DIED}
        metrics |= _kept(run)
        metrics |= ended_because(THE_END if metrics["ended_s"] >= plan.info.end_s else metrics["end_reason"])
        return close_folder(plan, run, metrics, [], [])


@contextmanager
def _over(run: Path) -> Iterator[None]:
    """Keep others from the folder and its log. Raises ``ScenarioError`` if the launcher, or a recorder, still does."""
    file = run / LOG
    if not file.is_file():
        if (run / METRICS).is_file() and not file.exists():
            what = "is complete: there is nothing to recover"
        else:
            what = f"has no {LOG}: there is nothing to make its tables from"
        raise ScenarioError(what, file=str(run), expected="the folder of a run that was cut off")
    with ExitStack() as held:
        try:
            held.enter_context(locked(run))
            lock(held.enter_context(file.open("rb")).fileno())
        except BlockingIOError:
            raise ScenarioError("is still going on", file=str(run), expected="a run that is over") from None
        except OSError as error:
            what = f"its {LOG} cannot be read ({reason(error)})"
            raise ScenarioError(what, file=str(run), expected="a file to read, in a folder of one's own") from None
        yield


def _planned(run: Path) -> Plan:
    """The plan of the run; its scenario has been checked."""
    manifest = read_manifest(run)
    name, speed = manifest.run, manifest.speed
    if not name or speed is None:
        raise ScenarioError("has no run and speed", file=str(run / MANIFEST), expected="the manifest of a run")
    check_speed(speed)
    plan = bridged(planned(load(str(run / SCENARIO)), speed), manifest.bridges)
    return replace(plan, run=replace(plan.run, run=name), info=replace(plan.info, run=name))


def _kept(run: Path) -> Metrics:
    """What the launcher told of the run, if it came to that."""
    try:
        metrics = read_figures(run).plain()
    except ScenarioError:
        return {}
    return {key: metrics[key] for key in _OF_THE_LAUNCHER}
