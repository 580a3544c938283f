"""A finished run, read from its folder: the input of a report and a comparison."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.compute as pc

from launcher.files import MESSAGES_TABLE, TRACKS_TABLE
from launcher.outside import Outside
from launcher.plan.architectures import Built, built, surveyed
from launcher.plan.faults import Faults, Mark
from launcher.plan.plan import hears, planned_faults
from launcher.record.figures.hops import CARRIERS, REPORTS, reports_end_to_end
from launcher.record.journal import METRICS
from launcher.record.reading import files as reading
from launcher.record.reading.camera import check_camera, read_camera
from launcher.record.reading.files import Manifest
from launcher.records import ARRIVED, SENSES, MessageRow, Place, View, last_due
from launcher.report import tracks
from launcher.report.heard import Heard
from launcher.report.tracks import Array, Course, Track
from trackfield.role import NS
from trackfield.scenario import Scenario, Site
from trackfield.tracking.smoothing import WHOLE_PATTERN
from trackfield.words import quoted

LONG: Final = 400
"""The most steps that a line can show one by one."""
WINDOWS: Final = 60
"""The number of windows of a longer run over which errors are averaged."""
_COLUMNS: Final = ("kind", "src", "dst", "outcome", "sent_ns", "due_ns", "bytes", "copy", "incarnation", "step")
_USES: Final = ("sensors", "step", "told_ns")
"""The columns of tracks.parquet that say when which reports were used."""
_TEXT: Final = ("kind", "src", "dst", "outcome")


@dataclass(frozen=True)
class Frames:
    """Every frame and what became of it at each receiver; the columns of messages.parquet that a report needs.

    Times in s count from the first step, at ``origin_ns``. The last ``ways`` rows are no frames, but reports that went
    over several hops, each as one from its sensor to its end.
    """

    table: pa.Table
    origin_ns: int
    ways: int = 0

    def __len__(self) -> int:
        return int(self.table.num_rows)

    def where(self, column: str, *values: str) -> npt.NDArray[np.bool_]:
        """(n,) whether the column holds one of these values."""
        return np.asarray(pc.is_in(self.table[column], pa.array(values, pa.string())))

    @property
    def on_air(self) -> npt.NDArray[np.bool_]:
        """(n,) whether it is a frame."""
        return np.arange(len(self)) < len(self) - self.ways

    @cached_property
    def sent_s(self) -> Array:
        """(n,) when each was sent, s."""
        return (self._floats("sent_ns") - self.origin_ns) / NS

    @cached_property
    def link_s(self) -> Array:
        """(n,) how long each was under way, s; NaN where it did not arrive."""
        arrived = self.where("outcome", *ARRIVED) & self.on_air
        return np.where(arrived, self._floats("due_ns") - self._floats("sent_ns"), np.nan) / NS

    @cached_property
    def steps(self) -> Array:
        """(n,) the step that a report is about; NaN for other messages."""
        return self._floats("step")

    @cached_property
    def reports(self) -> npt.NDArray[np.bool_]:
        """(n,) whether it is a report of a sensor."""
        return self.where("kind", *REPORTS)

    def senders(self, *outcomes: str) -> set[str]:
        """The nodes that sent a report with one of these outcomes, or with any."""
        return self.those(self.reports & self.where("outcome", *outcomes) if outcomes else self.reports)

    def those(self, chosen: npt.NDArray[np.bool_]) -> set[str]:
        """The nodes that sent these frames."""
        return set(self.table["src"].filter(pa.array(chosen)).unique().to_pylist())

    def fates(self, chosen: npt.NDArray[np.bool_]) -> dict[str, int]:
        """What became of these, the most frequent first."""
        counted = Counter(self.table["outcome"].filter(pa.array(chosen)).to_pylist())
        return dict(counted.most_common())

    def late_s(self, step_ns: int, deadline_s: float) -> Array:
        """(n,) how long after the deadline of its step each late report came, s; NaN for all others."""
        late = self.reports & self.where("outcome", "late")
        after = (self._floats("due_ns") - self.origin_ns - self.steps * step_ns) / NS
        return np.where(late, after - deadline_s, np.nan)

    def by_kind(self) -> dict[str, tuple[int, int, int]]:
        """(expected, arrived, arrived late) at receivers, by kind of message."""
        arrived, late = self.where("outcome", *ARRIVED), self.where("outcome", "late")
        of = {kind: self.where("kind", kind) for kind in sorted(self.table["kind"].unique().to_pylist())}
        return {
            kind: (int(chosen.sum()), int((chosen & arrived).sum()), int((chosen & late).sum()))
            for kind, chosen in of.items()
        }

    def _floats(self, column: str) -> Array:
        return np.asarray(self.table[column].to_numpy(), float)


@dataclass(frozen=True)
class Run:
    """A run folder, read; all times in s count from the first step.

    ``field`` is its scenario worked out, with its processes and views; ``faults`` are the planned ones. ``points`` are
    those of all sources, with the columns of tracks.parquet that a report needs; ``tracks`` are those of the headline
    view, and ``course`` has the instants at which one is expected. ``outside`` is what the processes of a camera told.
    """

    folder: Path
    metrics: dict[str, Any]
    manifest: Manifest
    toml: str
    field: Built
    faults: Faults
    points: pa.Table
    course: Course
    tracks: tuple[Track, ...]
    frames: Frames
    outside: Outside | None = None

    @property
    def site(self) -> Site:
        """The scenario worked out."""
        return self.field.site

    @property
    def places(self) -> tuple[Place, ...]:
        """The places of its processes."""
        return self.field.places

    @property
    def scenario(self) -> Scenario:
        """The scenario as it ran."""
        return self.site.scenario

    @cached_property
    def trackers(self) -> tuple[str, ...]:
        """Their names, as the scenario has them, then any others."""
        return tuple(dict.fromkeys((*self.scenario.fusion.trackers, *self.metrics["trackers"])))

    @property
    def marks(self) -> tuple[Mark, ...]:
        """When the planned faults begin and end, and the processes that they affect."""
        return self.faults.marks

    @property
    def end_s(self) -> float:
        """When the run was planned to end."""
        return (self.site.end_ns - self.site.origin_ns) / NS

    @property
    def ended_early(self) -> bool:
        """Whether the run was interrupted before that."""
        return bool(self.metrics["ended_s"] < self.end_s)

    @property
    def origin_s(self) -> float:
        """How long after the start of the run the first step was."""
        return self.site.origin_ns / NS

    @property
    def last_step(self) -> int:
        """The number of the last step whose track was due before the run ended."""
        return _last_step(self.site, self.metrics)

    @property
    def several(self) -> bool:
        """Whether there is more than one target."""
        return len(self.site.paths) > 1

    @property
    def step_s(self) -> float:
        """The length of a step."""
        return self.site.step_ns / NS

    @property
    def long(self) -> bool:
        """Whether there are too many steps to draw each of them."""
        return len(self.course.at_ns) > LONG

    @property
    def window(self) -> int:
        """The number of steps over which figures are averaged for display: 1 unless the run is long."""
        return max(len(self.course.at_ns) // WINDOWS, 2) if self.long else 1

    @cached_property
    def heard(self) -> Heard:
        """The events in which sensors heard targets pass."""
        return Heard.of(self.folder, self.scenario) if hears(self.site) else Heard(None, (), {})

    @cached_property
    def gaps(self) -> tuple[tuple[float, float], ...]:
        """(from s, to s) of each gap and jump in the data of any target, up to the end, interpolated there."""
        return self._so_far(gap for path in self.site.paths.values() for gap in path.guessed_inside)

    @cached_property
    def jumps(self) -> tuple[tuple[float, float], ...]:
        """Those of them that are jumps."""
        return self._so_far(jump for path in self.site.paths.values() for jump in path.jumps_inside)

    def _so_far(self, found: Iterable[tuple[float, float]]) -> tuple[tuple[float, float], ...]:
        shifted = ((begin - self.origin_s, end - self.origin_s) for begin, end in found)
        return tuple(one for one in shifted if one[0] < self.metrics["ended_s"])

    @property
    def bounded(self) -> bool:
        """Whether the tracks have a bound beside them."""
        return any(bool(np.isfinite(track.bound).any()) for track in self.tracks)

    @cached_property
    def first_fused_ns(self) -> dict[tuple[str, int], int]:
        """When a track was first told that used a report, by its sensor and step; ns since the start of the run."""
        first: dict[tuple[str, int], int] = {}
        for sensors, step, told_ns in zip(*(self.points[name].to_pylist() for name in _USES), strict=True):
            for sensor in sensors:
                first[sensor, step] = min(told_ns, first.get((sensor, step), told_ns))
        return first

    @cached_property
    def fused_late(self) -> npt.NDArray[np.bool_]:
        """(n,) whether a frame is a report that came late and was fused all the same, within ``fusion.max_age_s``."""
        found = self.frames.reports & self.frames.where("outcome", "late")
        late = self.frames.table.filter(pa.array(found))
        used = zip(late["src"].to_pylist(), late["step"].to_pylist(), strict=True)
        found[found] = [report in self.first_fused_ns for report in used]
        return found

    @cached_property
    def sensors(self) -> dict[str, tuple[float, float]]:
        """Where each sensor stands, m."""
        return {place.id: (place.x, place.y) for place in self.tagged(SENSES)}

    def tagged(self, tag: str) -> list[Place]:
        """The places that have this tag."""
        return [place for place in self.places if tag in place.tags]


def read_run(folder: Path) -> Run:
    """Read a finished run. Raises ``ScenarioError`` for any other folder, and for one whose files are damaged."""
    metrics, manifest = reading.read_figures(folder).plain(), reading.read_manifest(folder)
    points = reading.read_table(folder, TRACKS_TABLE, tracks.COLUMNS)
    frames = reading.read_table(folder, MESSAGES_TABLE, _COLUMNS, _TEXT)
    on_air = frames.num_rows
    toml, scenario = reading.read_scenario(folder)
    site = surveyed(scenario)
    field = built(site)
    frames = _with_reports_over_hops(folder, field, frames)
    course = course_of(site, metrics)
    run = Run(
        folder,
        metrics,
        manifest,
        toml,
        field,
        planned_faults(field),
        points,
        course,
        _tracks(points, field, course),
        Frames(frames, site.origin_ns, frames.num_rows - on_air),
        None if metrics["camera"] is None else read_camera(folder),
    )
    check_camera(folder, run.outside, metrics["camera"] and metrics["camera"]["fixes"], site)
    jumps = (run.faults.of(place.id).jumps for place in run.places)
    reading.check_belongs(folder, run.places, site.end_ns, jumps, points, frames)
    if (metrics["scenario"], metrics["seed"]) != (scenario.name, scenario.seed):
        what = f"are {quoted(metrics['scenario'])} and {metrics['seed']}"
        reading.refuse(folder / METRICS, "scenario, seed", what, reading.OF_THIS)
    if strange := {track.tracker for track in run.tracks} - set(run.trackers):
        what = f"is {quoted(min(strange))}, which has no figures"
        reading.refuse(folder / TRACKS_TABLE, "tracker", what, f"one of {', '.join(run.trackers)}")
    return run


def _tracks(points: pa.Table, field: Built, course: Course) -> tuple[Track, ...]:
    """The tracks of the headline view, and those that a base smoothed as a whole."""
    order = field.site.scenario.fusion.trackers
    if not field.smoothers:
        return tracks.read(points, field.views[0], order, course)
    smoothed = pc.match_substring_regex(points["tracker"], WHOLE_PATTERN)
    found = tracks.read(points.filter(pc.invert(smoothed)), field.views[0], order, course)
    whole = tracks.read(points.filter(smoothed), View("smoothed", field.smoothers), order, course)
    return (*found, *(replace(track, lag=0, whole=True) for track in whole))


def _with_reports_over_hops(folder: Path, field: Built, frames: pa.Table) -> pa.Table:
    """The frames, followed by the reports that went over several hops, each as one message."""
    carriers = pc.is_in(frames["kind"].cast(pa.string()), pa.array(CARRIERS))
    if not pc.any(carriers).as_py():
        return frames
    rows = reading.read_table(folder, MESSAGES_TABLE).filter(carriers).to_pylist()
    bases = [process.id for process in field.processes if process.base == process.id]
    reports = reports_end_to_end(bases, [MessageRow(**row) for row in rows])
    columns = [pa.array([getattr(row, one.name) for row in reports], one.type) for one in frames.schema]
    return pa.concat_tables([frames, pa.table(columns, frames.schema)]).unify_dictionaries()


def course_of(site: Site, metrics: Mapping[str, Any]) -> Course:
    """Of which instants a track is expected in a run of this site that has these metrics, whoever told of them."""
    last = _last_step(site, metrics)
    passes = site.pass_steps
    steps = range(1, last + 1) if passes is None else sorted(step for step in passes if step <= last)
    return Course.of(site.paths, steps, site.step_ns, site.origin_ns)


def _last_step(site: Site, metrics: Mapping[str, Any]) -> int:
    end_ns = round(float(metrics["ended_s"]) * NS)
    return min(last_due(end_ns, site.step_ns, site.scenario.fusion.deadline_s), site.steps)
