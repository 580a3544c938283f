"""The tables, figures and timeline of a run made from its log: its recorder died before it had written them."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Final

from launcher.files import LOG, reason
from launcher.record.journal import TIMELINE, TIMELINE_FAILED, Journal, Unplanned
from launcher.record.kept.log import MARK, REFUSED, Entry, Reading
from launcher.record.listener import ARRIVED, Intake
from launcher.record.metrics import Metrics, cut_off
from launcher.record.samples import deaths_of, mark_of, refusals_of
from launcher.records import Plan
from trackfield.errors import RunFailed
from trackfield.role import NS
from trackfield.wire import keys
from trackfield.wire.error import WireError

TRANSIT_S: Final = 0.3
"""How long (wall time) frames and telemetry may be on their way to the recorder."""


def recovered(plan: Plan, folder: Path, deaths: Sequence[Unplanned] | None = None) -> Metrics:
    """Write the tables and the timeline of this folder from its log; returns the metrics that are known of it.

    ``deaths`` are the unplanned ones (None: those of which the launcher told the recorder, if it did). The record goes
    up to ``settled_until``, or to the end of the run if the recorder was told that it is over. What is wrong with it is
    in ``recorder.complaints``. Raises ``RunFailed`` if there is no log, or the disk does not take the tables.
    """
    intake, entries, said = _read(plan, folder)
    told = intake.deaths if deaths is None else deaths
    part = folder / f".{TIMELINE}.part"
    try:
        journal = Journal(plan, intake.ledger, folder, part)
        metrics = journal.tables(told or (), messages=entries)
        failure = journal.draw()
        if not failure.startswith(TIMELINE_FAILED):
            part.replace(folder / TIMELINE)
    finally:
        part.unlink(missing_ok=True)
    metrics["recorder"]["complaints"] += [*said, *filter(None, [failure])]
    return metrics if intake.deaths is not None else cut_off(metrics)


def _read(plan: Plan, folder: Path) -> tuple[Intake, int, list[str]]:
    """What the log says, how many samples of the run it has, and what is wrong with it."""
    reading = Reading(folder / LOG)
    intake, entries, strange = Intake(plan), 0, 0
    try:
        last_ns, finished = _extent(reading)
        if not finished:
            intake.ledger.end(settled_until(plan, last_ns))
        for entry in reading:
            try:
                entries += _take(intake, entry)
            except WireError:
                strange += 1
    except OSError as error:
        raise RunFailed(f"{folder / LOG} cannot be read ({reason(error)})") from None
    said = ["its log is damaged: what came after the damage is lost"] if reading.damaged else []
    if strange:
        said.append(f"its log is damaged: {strange} entries are none of this run, and are left out")
    return intake, entries, said


def _extent(reading: Reading) -> tuple[int, bool]:
    """The emulated time (ns) up to which the log goes, and whether the recorder was told that the run is over."""
    last_ns, finished = 0, False
    for entry in reading:
        with suppress(WireError):  # it is counted with the others
            if entry.key == MARK:
                last_ns = max(last_ns, mark_of(entry.payload))
            elif entry.key == keys.FINISH:
                deaths_of(entry.payload)
                finished = True
    return last_ns, finished


def _take(intake: Intake, entry: Entry) -> bool:
    """Enter an entry into the ledger; whether it is a sample. Raises ``WireError`` for one that is none of the run."""
    if entry.key == MARK:
        mark_of(entry.payload)
    elif entry.key == REFUSED:
        for plane, why, times in refusals_of(entry.payload):
            intake.ledger.refuse(f"{plane}/", why, times)
    else:
        intake.take(*entry, ARRIVED)
        return True
    return False


def settled_until(plan: Plan, now_ns: int) -> int:
    """The emulated time (ns) up to which nothing is missing from a record that broke off at ``now_ns``."""
    return max(now_ns - round(TRANSIT_S * plan.run.speed * NS), 0)
