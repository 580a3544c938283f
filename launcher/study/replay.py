"""The reports of a finished run, fused again: by other trackers, or without those that came late.

Each process that tracked repeats the steps for which it published points, with the reports that its tracks used; a
later life continues from the estimates of the life before it. A process that published points of others, which it had
by radio, publishes those that the same origins now have for the same instants. Points are published at the times of the
run. No messages are sent. A process that neither fuses reports nor hands points on computes its tracks in a way that
only its role knows: a run with such a process cannot be replayed.
"""

from __future__ import annotations

import shutil
import time
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

from launcher.files import CAMERA, MESSAGES_TABLE, SCENARIO, TRACKS_TABLE
from launcher.plan.prepare import load, planned
from launcher.record.figures.hops import CARRIERS, end_to_end
from launcher.record.folder import check_scenario, keep, prepare_folder, whole_or_none, write_manifest
from launcher.record.journal import Journal
from launcher.record.ledger import Ledger
from launcher.record.metrics import Metrics
from launcher.record.reading.camera import read_camera
from launcher.record.reading.files import (
    check_belongs,
    check_run,
    read_figures,
    read_manifest,
    read_table,
    refuse,
)
from launcher.records import SENSES, TRACKS, MessageRow, Plan
from launcher.run import Outcome, close_folder
from launcher.study.repeatable import check_repeatable
from trackfield.drivers.engine.frames import LATE, RANK_TIMER, Told
from trackfield.drivers.spec import life_name
from trackfield.role import NS, Publish, State, TrackPoint
from trackfield.tracking.bank import Bank
from trackfield.tracking.forwarding import Numbering, received
from trackfield.tracking.stored import pack, unpack
from trackfield.wire.codec import WireError, decode

FUSED_ANEW: Final = ("trackers", "bound", "passes", "latency_ms")
"""Parts of metrics.json that depend on the trackers; all others stay as they were."""


def replay(
    run: Path,
    trackers: Sequence[str] = (),
    *,
    drop_late: bool = False,
    out: Path | None = None,
    command: Sequence[str] = (),
) -> Outcome:
    """Fuse the reports of a run folder with these trackers (none: its own) and leave a folder of the same kind.

    With ``drop_late``, reports that came after their deadline are left out. Raises ``ScenarioError`` if the folder is
    not that of a finished run by this version, for an unknown tracker, if ``out`` is not empty, and for a run in which
    a process made tracks in a way of its own.
    """
    begun, cpu_s = time.monotonic(), time.process_time()
    check_run(run)
    check_scenario(run)
    metrics: Metrics = read_figures(run).plain()
    settings = ["fusion.max_age_s=0"] if drop_late else []
    scenario = load(str(run / SCENARIO), settings=settings, trackers=trackers)
    if metrics["camera"] is not None:
        read_camera(run)
    messages = read_table(run, MESSAGES_TABLE)
    plan = planned(scenario)
    jumps = (p.jumps for p in plan.processes)
    check_belongs(run, plan.info.places, plan.run.end_ns, jumps, read_table(run, TRACKS_TABLE), messages)
    rows = [MessageRow(**row) for row in messages.to_pylist()]
    reports = [*(row for row in rows if row.kind not in CARRIERS), *end_to_end(plan.bases, rows)]
    check_repeatable(run, plan)
    fusions, handed = read_points(run)
    _check_usable(run, plan, fusions, reports)
    folder = prepare_folder(out, scenario.name, scenario.seed)
    with whole_or_none(folder):
        keep(scenario, folder)
        write_manifest(folder, replace(plan, bridges=read_manifest(run).bridges), command, None)
        used = [row for row in reports if not (drop_late and row.outcome == LATE)]
        anew = _fuse(plan, (fusions, handed), rows, used, metrics, folder)
        for kept in (MESSAGES_TABLE, *([CAMERA] if metrics["camera"] is not None else [])):
            shutil.copyfile(run / kept, folder / kept)
    metrics |= {part: anew[part] for part in FUSED_ANEW}
    metrics |= {"driver": "replay", "wall_s": time.monotonic() - begun, "cpu_s": time.process_time() - cpu_s}
    metrics["timing"]["speed"] = None
    # failures of the run are not failures of its replay
    return replace(close_folder(plan, folder, metrics, [], []), complaints=())


def caveats(metrics: Metrics, *, drop_late: bool = False) -> list[str]:
    """Why a replay may differ from the run with these metrics though nothing was changed, or be the same."""
    said = []
    if drop_late and not metrics["frames"]["late"]:
        said.append("no report of the run was late (frames.late): --drop-late changes nothing")
    if dropped := metrics["recorder"]["dropped"]:
        said.append(f"{dropped} frames of the run never reached the recorder (recorder.dropped): the replay lacks them")
    if late := metrics["timing"]["host_late"]:
        said.append(
            f"{late} events were handled out of order in the run (timing.host_late); the replay has all in order"
        )
    return said


def _check_usable(run: Path, plan: Plan, fusions: Iterable[Fusion], rows: Iterable[MessageRow]) -> None:
    """Raise ``ScenarioError`` for a step that the run cannot have had, and for a report that no tracker can use."""
    last, reports = plan.step_of(plan.run.end_ns), _reports(rows)
    bank = Bank(**plan.bank_of(plan.info.tagged(TRACKS)[0].id))
    for one in fusions:
        if not 1 <= one.step <= last:
            refuse(run / TRACKS_TABLE, "step", f"is {one.step}", f"from 1 to {last}")
        for sensor in one.sensors:
            if row := reports.get((sensor, one.step)):
                try:
                    usable = bank.takes(decode(row.payload), sensor)
                except WireError:
                    usable = False
                if not usable:
                    what = (
                        f"is no {' or '.join(sorted(bank.messages))} message where {sensor} reported on step {one.step}"
                    )
                    refuse(run / MESSAGES_TABLE, "payload", what, "the messages of the run")


def _reports(rows: Iterable[MessageRow]) -> dict[tuple[str, int], MessageRow]:
    """The frame that counts of each report, by its sensor and step.

    Tracks name the reports used, even if an unplanned death left outcomes open; delivered frames count before others.
    """
    kept = sorted(rows, key=lambda row: row.outcome in ("delivered", LATE))
    return {(row.src, row.step): row for row in kept if row.step is not None}


@dataclass(frozen=True)
class Fusion:
    """A process used the reports of these ``sensors`` for a step, and first published the result at ``told_ns``."""

    source: str
    incarnation: int
    step: int
    told_ns: int
    sensors: tuple[str, ...]

    @property
    def life(self) -> str:
        """The name of its life."""
        return life_name(self.source, self.incarnation)


@dataclass(frozen=True)
class Handed:
    """A process first published at ``told_ns`` what ``tracker`` of the process ``origin`` knew of an instant."""

    source: str
    incarnation: int
    at_ns: int
    told_ns: int
    tracker: str
    origin: str

    @property
    def life(self) -> str:
        """The name of its life."""
        return life_name(self.source, self.incarnation)


def read_points(run: Path) -> tuple[list[Fusion], list[Handed]]:
    """The fusions of a run, process by process and in the order of time, and the points that had come by radio."""
    columns = ("source", "incarnation", "step", "told_ns", "sensors", "lag", "at_ns", "tracker", "origin")
    first, handed = dict[tuple[str, int], dict[str, Any]](), list[Handed]()
    for row in read_table(run, TRACKS_TABLE, columns).to_pylist():
        lag, step, sensors = (row.pop(name) for name in ("lag", "step", "sensors"))
        if row["origin"]:
            handed.append(Handed(**row))
        elif not lag and step is not None:
            kept = {name: row[name] for name in ("source", "incarnation", "told_ns")}
            before = first.setdefault((row["source"], step), {**kept, "step": step, "sensors": tuple(sensors)})
            before["told_ns"] = min(before["told_ns"], row["told_ns"])
    return [Fusion(**one) for _, one in sorted(first.items())], handed


class _Source:
    """Repeats a process that tracked; ``starts`` has the beginnings of its planned later lives, by their names.

    Its tracks of a step are due ``deadline_ns`` after it.
    """

    def __init__(self, bank: Bank, starts: Mapping[str, int], deadline_ns: int) -> None:
        self.bank, self._starts, self._deadline_ns = bank, starts, deadline_ns
        self._tracks: tuple[Any, ...] = ()
        self._stored: tuple[int, bytes] | None = None
        self._life, self._step, self._phase = "", 0, ""

    def fuse(self, one: Fusion, heard: Mapping[str, Any], *, early: bool) -> Iterator[tuple[int, State | Publish]]:
        """(time, effect) published for a step; ``early`` says that some of what it ``heard`` had come by then."""
        resumed = self._resumes(one)
        if one.life != self._life:
            yield from self._begin(one)
        for step in range(self._step + 1, one.step):
            self._tracks = self.bank.advance(self._tracks, step, {}).tracks
        self._tracks, points, earlier = self.bank.advance(self._tracks, one.step, heard)
        self._step = one.step
        told = [point for point in points.values() if point.mean] if resumed else [*points.values(), *earlier]
        yield from ((one.told_ns, Publish(replace(point, source=one.source))) for point in told)
        if not resumed:
            self._stored = one.step, pack(one.step, None, self.bank.beliefs(self._tracks))
            status = next(iter(points.values())).status
            yield from self._enter(one.told_ns, "coasting" if status == "tracking" and not early else status)

    def _resumes(self, one: Fusion) -> bool:
        """Whether a later life published this step as it began, at once or when its clock was set, not at a deadline.

        It does so for the last step that was due by then, if it knows the target and missed that step.
        """
        if one.life == self._life or not one.incarnation or self._stored is None:
            return False
        since, kept = self._stored
        if one.sensors or all(belief is None for belief in unpack(kept).beliefs.values()):
            return False
        start_ns = self._starts.get(one.life, one.told_ns)
        return one.step > since + 1 or self.bank.at_ns(one.step) + self._deadline_ns <= start_ns

    def _begin(self, one: Fusion) -> Iterator[tuple[int, State | Publish]]:
        """A life begins, from what the life before it stored, if anything."""
        until, self._life, self._phase = one.step - 1, one.life, ""
        if self._stored is None:
            self._tracks = self.bank.begin(prior=until == 0)
        else:
            since, kept = self._stored
            self._tracks = self.bank.resume(unpack(kept).beliefs, since, until).tracks
        known = self._stored is not None and self._tracks[0].known
        start_ns = self._starts.get(one.life, one.told_ns if one.incarnation else 0)
        self._step = until
        yield from self._enter(start_ns, "coasting" if known else "waiting")

    def _enter(self, t_ns: int, phase: str) -> Iterator[tuple[int, State | Publish]]:
        if phase != self._phase:
            self._phase = phase
            yield t_ns, State(phase)


def fused(
    plan: Plan, fusions: Iterable[Fusion], rows: Iterable[MessageRow]
) -> Iterator[tuple[Fusion, int, State | Publish]]:
    """(fusion, time in ns, effect) of what all tracking processes publish, with the reports in these messages."""
    reports = _reports(rows)
    starts = {life.name: life.start_ns for life in plan.processes if life.incarnation}
    deadline_ns = round(plan.deadline_s * NS)
    sources: dict[str, _Source] = {}
    for one in fusions:
        if one.source not in sources:
            sources[one.source] = _Source(Bank(**plan.bank_of(one.source)), starts, deadline_ns)
        came = {sensor: reports[sensor, one.step] for sensor in one.sensors if (sensor, one.step) in reports}
        heard = {sensor: decode(row.payload) for sensor, row in came.items()}
        early = any(row.due_ns is not None and row.due_ns <= one.told_ns for row in came.values())
        for t_ns, effect in sources[one.source].fuse(one, heard, early=early):
            yield one, t_ns, effect


def handed_on(
    plan: Plan, handed: Iterable[Handed], points: Iterable[TrackPoint], order: Sequence[str]
) -> Iterator[tuple[Handed, int, Publish]]:
    """(what was handed on, time in ns, effect) of all processes that published ``points`` of others.

    Each tracker's point of an instant is that of the process which its source had it from in the run, whose trackers
    are in ``order``. A tracker that the run did not have goes by the first that the source published of that instant.
    """
    numbering = Numbering(
        plan.tracking["trackers"],
        [place.id for place in plan.info.tagged(SENSES)],
        plan.step_ns,
        plan.origin_ns,
        plan.tracking.get("target", "target"),
    )
    known = {(point.source, point.tracker, point.at_ns): point for point in points if not point.lag}
    for one, tracker in _choices(handed, numbering.trackers, order):
        before = known.get((one.origin, tracker, one.at_ns))
        point = received(before, numbering) if before else None
        if point:
            known[one.source, tracker, one.at_ns] = point = replace(point, source=one.source)
            yield one, one.told_ns, Publish(point)


def _choices(handed: Iterable[Handed], trackers: Sequence[str], order: Sequence[str]) -> list[tuple[Handed, str]]:
    """Which point of the run each of these trackers goes by, in the order of time."""
    rank = {name: place for place, name in enumerate(order)}
    published = defaultdict[tuple[str, int], dict[str, Handed]](dict)
    for one in sorted(handed, key=lambda one: (one.told_ns, rank.get(one.tracker, len(rank)))):
        published[one.source, one.at_ns][one.tracker] = one
    choices = []
    for by_tracker in published.values():
        new = dict.fromkeys(set(trackers) - rank.keys(), next(iter(by_tracker.values())))
        choices += [(found, name) for name in trackers if (found := {**by_tracker, **new}.get(name))]
    return sorted(choices, key=lambda choice: choice[0].told_ns)


def repeated(
    plan: Plan,
    points: tuple[Iterable[Fusion], Iterable[Handed]],
    rows: Iterable[MessageRow],
    order: Sequence[str],
) -> list[tuple[Fusion | Handed, int, State | Publish]]:
    """What all processes publish that published these ``points`` in the run (``read_points``), as in ``handed_on``."""
    fusions, handed = points
    told: list[tuple[Fusion | Handed, int, State | Publish]] = [*fused(plan, fusions, rows)]
    made = [effect.estimate for _, _, effect in told if isinstance(effect, Publish)]
    return [*told, *handed_on(plan, handed, made, order)]


def _fuse(
    plan: Plan,
    points: tuple[Sequence[Fusion], Sequence[Handed]],
    rows: Sequence[MessageRow],
    used: Sequence[MessageRow],
    before: Metrics,
    folder: Path,
) -> Metrics:
    """Write the tracks and the timeline; returns the metrics of a run in which only trackers published.

    ``used`` are the reports that they use, out of all ``rows``.
    """
    ledger = Ledger(plan.run, plan.processes)
    ledger.end(plan.origin_ns + round(before["ended_s"] * NS))
    first = {life.id: life for life in plan.processes if not life.incarnation}
    told = repeated(plan, points, used, list(before["trackers"]))
    for number, (one, t_ns, effect) in enumerate(told):
        if one.life not in ledger.diaries:  # an unplanned life
            ledger.life(replace(first[one.source], incarnation=one.incarnation, start_ns=t_ns, kill_ns=None))
        ledger.told(one.life, Told((t_ns, RANK_TIMER, number), effect))
    journal = Journal(plan, ledger, folder)
    journal.take_over(rows)
    for died in before["processes"]["died"] or ():
        if died["t"] is not None:
            t_ns = plan.origin_ns + round(died["t"] * NS)
            journal.show(lambda timeline: timeline.death(t_ns, died["id"].partition("~")[0], died["why"]))  # noqa: B023
    metrics = journal.tables([], messages=0)
    metrics["recorder"]["complaints"] += filter(None, [journal.draw()])
    return metrics
