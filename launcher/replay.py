"""The reports of a finished run, fused again: by other trackers, or without those that came late.

The fusion centre is the one of a run, in all its lives, with its clock, its faults and its battery; it is given each
frame that reached it at the time at which it did. What it sends goes nowhere: the field has already acted.
"""

from __future__ import annotations

import json
import shutil
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

import pyarrow.parquet as pq

from launcher.compare import check_runs
from launcher.ledger import Ledger
from launcher.measures import RunFigures
from launcher.metrics import Metrics
from launcher.prepare import keep, load, planned
from launcher.records import MessageRow, Plan
from launcher.result import METRICS, Journal
from launcher.run import Outcome, close_folder, prepare_folder, write_manifest
from trackfield.drivers.core import Core
from trackfield.drivers.frames import Arrival, Frame, Output, Refused, Told, Undone
from trackfield.drivers.meter import spent
from trackfield.drivers.spec import build_core, link_of, places_of
from trackfield.errors import ScenarioError
from trackfield.link.fate import Link
from trackfield.role import NS

FUSED_ANEW: Final = ("trackers", "bound", "latency_ms")
"""Parts of metrics.json that depend on the fusion centre; all others stay as they were."""


def replay(
    run: Path,
    trackers: Sequence[str] = (),
    *,
    drop_late: bool = False,
    out: Path | None = None,
    command: Sequence[str] = (),
) -> Outcome:
    """Fuse the reports of a run folder with these trackers (none: its own) and leave a folder of the same kind.

    With ``drop_late`` reports that came after their deadline do not count. Raises ``ScenarioError`` if the folder is
    not that of a finished run by this version, for an unknown tracker, and if ``out`` is not empty.
    """
    begun, cpu_s = time.monotonic(), time.process_time()
    check_runs([run])
    metrics: Metrics = json.loads((run / METRICS).read_text())
    RunFigures.of(metrics, str(run / METRICS))
    settings = ["fusion.max_age_s=0"] if drop_late else []
    scenario = load(str(run / "scenario.toml"), settings=settings, trackers=trackers)
    rows = _rows(run / "messages.parquet")
    plan = planned(scenario)
    end_ns = _end_ns(plan, rows, run / "tracks.parquet")
    folder = prepare_folder(out, scenario.name, scenario.seed)
    keep(scenario, folder)
    write_manifest(folder, plan, command, None)
    anew = _fuse(plan, rows, end_ns, metrics, folder)
    shutil.copyfile(run / "messages.parquet", folder / "messages.parquet")
    metrics |= {part: anew[part] for part in FUSED_ANEW}
    metrics |= {"driver": "replay", "wall_s": time.monotonic() - begun, "cpu_s": time.process_time() - cpu_s}
    metrics["timing"]["speed"] = None
    # what went wrong in the run is no failure of its replay
    return replace(close_folder(folder, metrics, [], []), complaints=())


def caveats(metrics: Metrics) -> list[str]:
    """Why a replay of a run with these metrics may differ from it though nothing was changed."""
    said = [
        f"{died['id']} died unplanned in this run; the replay lets it live"
        for died in metrics["processes"]["died"]
        if died["id"].partition("~")[0] == "fusion"
    ]
    if lost := metrics["frames"]["host_lost"]:
        said.append(f"{lost} frames that the machine lost in this run (frames.host_lost) arrive in the replay")
    if dropped := metrics["recorder"]["dropped"]:
        said.append(
            f"{dropped} frames of this run never reached the recorder (recorder.dropped): the replay lacks them"
        )
    if late := metrics["timing"]["host_late"]:
        said.append(f"{late} events were handled out of order in this run (timing.host_late); here all are in order")
    return said


def fused(plan: Plan, rows: Iterable[MessageRow], end_ns: int) -> Iterator[tuple[str, Output]]:
    """What each life of the fusion centre says up to a time to the frames that reached it, with the life's name."""
    link = link_of(plan.run, places_of(plan.processes))
    lives = [process for process in plan.processes if process.role == "fusion"]
    centre = lives[0].id
    arrivals = [_arrival(row, link) for row in rows if row.dst == centre and row.delivered]
    before: Core | None = None
    for life in lives:
        core = build_core(plan.run, life, link)
        if before is not None:
            core.inherit(before.life.stored, spent(before.record(end_ns)))
        for arrival in arrivals:
            if core.owns(arrival.due_ns):
                core.offer(arrival)
        while (key := core.next_key()) is not None and key < (end_ns,):
            yield from ((life.name, output) for output in core.handle_next())
        before = core


def _fuse(plan: Plan, rows: Sequence[MessageRow], end_ns: int, before: Metrics, folder: Path) -> Metrics:
    """Write the tracks and the timeline; the metrics of a run in which nobody but the centre said anything."""
    ledger = Ledger(plan.run, plan.processes)
    ledger.end(end_ns)
    for name, output in fused(plan, rows, end_ns):
        if isinstance(output, Told | Refused | Undone):
            ledger.told(name, output)
    journal = Journal(plan, ledger, folder)
    journal.take_over(rows)
    for died in before["processes"]["died"]:
        if died["t"] is not None:
            journal.timeline.death(round(died["t"] * NS), died["id"].partition("~")[0], died["why"])
    return journal.close([], messages=0)


def _rows(file: Path) -> list[MessageRow]:
    table = pq.read_table(file)
    if "payload" not in table.column_names:
        expected = "a run by this version; trackfield run <its scenario.toml> makes it again"
        raise ScenarioError("has no payloads: an older version made it", file=str(file), expected=expected)
    return [MessageRow(**row) for row in table.to_pylist()]


def _arrival(row: MessageRow, link: Link) -> Arrival:
    frame = Frame(row.src, row.incarnation, row.kind, row.sent_ns, row.copy, row.dst, row.medium, row.payload)  # type: ignore[arg-type]
    assert row.due_ns is not None  # it was delivered
    return Arrival(row.due_ns, frame, frame.fate(link, row.dst))


def _end_ns(plan: Plan, rows: Iterable[MessageRow], tracks: Path) -> int:
    """When the run was over: as planned, or after the last it left if that is not about its last step."""
    table = pq.read_table(tracks, columns=["step", "told_s"])
    if max(table["step"].to_pylist(), default=0) >= plan.run.end_ns // plan.step_ns - 1:
        return plan.run.end_ns
    told_ns = (round(told_s * NS) for told_s in table["told_s"].to_pylist())
    sent_ns = (row.sent_ns for row in rows)
    return min(max((*told_ns, *sent_ns), default=0) + 1, plan.run.end_ns)
