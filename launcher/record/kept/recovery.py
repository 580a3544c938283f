"""The tables, figures and timeline of a run made from its log: its recorder died before it had written them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

import msgpack

from launcher.files import LOG, reason
from launcher.record.journal import TIMELINE, Journal, Unplanned
from launcher.record.kept.log import MARK, REFUSED, Reading
from launcher.record.listener import ARRIVED, Intake
from launcher.record.metrics import Metrics, cut_off
from launcher.records import Plan
from trackfield.errors import RunFailed
from trackfield.role import NS
from trackfield.wire import keys

TRANSIT_S: Final = 0.3
"""How long (wall time) frames and telemetry may be on their way to the recorder."""


def recovered(plan: Plan, folder: Path, deaths: Sequence[Unplanned] | None = None) -> Metrics:
    """Write the tables and the timeline of this folder from its log; returns the metrics that are known of it.

    ``deaths`` are the unplanned ones (None: those of which the launcher told the recorder, if it did). The record goes
    up to ``settled_until``, or to the end of the run if the recorder was told that it is over. What is wrong with it is
    in ``recorder.complaints``. Raises ``RunFailed`` if there is no log, or the disk does not take the tables.
    """
    intake, entries, damaged = _read(plan, folder)
    told = intake.deaths if deaths is None else deaths
    part = folder / f".{TIMELINE}.part"
    try:
        journal = Journal(plan, intake.ledger, folder, part)
        metrics = journal.tables(told or (), messages=entries)
        failure = journal.draw()
        if not failure:
            part.replace(folder / TIMELINE)
    finally:
        part.unlink(missing_ok=True)
    said = "its log is damaged: what came after the damage is lost" if damaged else ""
    metrics["recorder"]["complaints"] = [one for one in (said, failure) if one]
    return metrics if intake.deaths is not None else cut_off(metrics)


def _read(plan: Plan, folder: Path) -> tuple[Intake, int, bool]:
    """What the log says, how many samples it has, and whether it is damaged."""
    reading = Reading(folder / LOG)
    intake, entries, last_ns, finished = Intake(plan), 0, 0, False
    try:
        for entry in reading:
            if entry.key == MARK:
                last_ns = int(entry.payload)
            finished |= entry.key == keys.FINISH
    except OSError as error:
        raise RunFailed(f"{folder / LOG} cannot be read ({reason(error)})") from None
    if not finished:
        intake.ledger.end(settled_until(plan, last_ns))
    for entry in reading:
        if entry.key == REFUSED:
            for plane, why, many in msgpack.unpackb(entry.payload):
                for _ in range(many):
                    intake.ledger.refuse(f"{plane}/", why)
        elif entry.key != MARK:
            intake.take(*entry, ARRIVED)
            entries += 1
    return intake, entries, reading.damaged


def settled_until(plan: Plan, now_ns: int) -> int:
    """The emulated time (ns) up to which nothing is missing from a record that broke off at ``now_ns``."""
    return max(now_ns - round(TRANSIT_S * plan.run.speed * NS), 0)
