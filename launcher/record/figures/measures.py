"""The figures of a run with types: metrics.json as frozen objects, its keys as attributes (docs/metrics.md)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Final, Literal, Self

from pydantic import StrictBool, ValidationError

from launcher.nested import flat
from launcher.record.figures.camera.figures import CameraFigures, in_study
from launcher.record.figures.costs import LedgerFigures
from launcher.record.figures.frames import (
    Bytes,
    ChannelFigures,
    Count,
    Figures,
    Frames,
    Latencies,
    Lost,
    Number,
    Seed,
    Signed,
)
from launcher.record.figures.passes.figures import PassFigures
from launcher.record.figures.verdict import Verdict
from launcher.records import BASE
from trackfield.errors import ScenarioError
from trackfield.words import quoted


class Rmse(Figures):
    """Root mean square errors in m (velocity: m/s)."""

    x: Number | None
    y: Number | None
    position: Number | None
    velocity: Number | None


class Gap(Figures):
    """RMSE of the position (m) over the ``steps`` with a track inside gaps of the recorded truth."""

    rmse: Number | None
    steps: Count


class ScoreFigures(Figures):
    """How well a tracker did in a view."""

    rmse: Rmse
    median_error: Number | None
    nees: Number | None
    nees_band: tuple[Number, Number] | None
    nees_position: Number | None = None
    nees_position_band: tuple[Number, Number] | None = None
    steps: Count
    bound_m: Number | None
    times_bound: Number | None
    verdict: Verdict | None
    lost: StrictBool
    steps_expected: Count
    steps_tracked: Count
    share_within: Number | None
    longest_blackout_s: Number
    gap: Gap
    detection_s: Number | None


class TargetFigures(Figures):
    """RMSE of the position (m) over the ``steps`` in which this target was the nearest to the track."""

    rmse: Number | None
    steps: Count


class TrackerFigures(ScoreFigures):
    """How well a tracker did in the headline view; ``sources`` counts the steps in which a process had a track."""

    association: Literal["nearest"] | None
    targets: Mapping[str, TargetFigures]
    sources: Mapping[str, Count]
    views: Mapping[str, ScoreFigures]

    @property
    def by_place(self) -> dict[str, float | None]:
        """Figures at the base, and in the network if another view is of that; by their names in a study."""
        base: ScoreFigures = self.views.get(BASE, self)
        inside = next((view for name, view in self.views.items() if name != BASE), None)
        return {
            "base.rmse.position": base.rmse.position,
            "base.share_within": base.share_within,
            "base.detection_s": base.detection_s,
            "network.rmse.position": None if inside is None else inside.rmse.position,
        }


class Bound(Figures):
    """The least error (m) of any tracker: with every report in reach, and with those that came."""

    position: Number | None
    trajectory: Number | None


class Spread(Figures):
    """Mean and maximum of a time in s."""

    mean: Number | None
    max: Number | None


class Leaders(Figures):
    """Processes that take turns at tracking: how many led in a step, their terms, and their reports in a step.

    ``election_s`` is how long elections took, ``healed_s`` how long more than one led after a split one.
    """

    per_step_mean: Number | None
    per_step_max: Count | None
    two_leader_steps: Count
    handovers: Count | None
    lost_handovers: Count | None
    take_overs: Count
    false_take_overs: Count
    dissolved: Count
    elections: Count
    split_elections: Count
    unwon_elections: Count
    election_s: Spread
    healed_s: Spread
    reports_used: Number | None
    reports_asked: Number | None
    out_of_reach_steps: Count


class Clusters(Figures):
    """The slaves of each master at the end, and how many had none at the first step and at the end."""

    members: Mapping[str, tuple[str, ...]]
    orphans_first: Count | None
    orphans_last: Count | None
    overheard: Count


class Age(Figures):
    """How old (s) what a base knew was: of the points that it predicted from that, and over all time."""

    mean: Number | None
    p95: Number | None
    base_mean: Number | None
    base_p95: Number | None


class Death(Figures):
    """A process that died unplanned; ``t`` in emulated s, None before the start."""

    id: str
    host: str
    why: str
    t: Number | None


class Stop(Figures):
    """A process that was stopped from outside at ``t``, for ``s`` (emulated s; None: it never resumed)."""

    id: str
    host: str
    t: Number | None
    s: Number | None


class Processes(Figures):
    """The processes of the run."""

    started: Count
    ready_s: Number | None
    died: tuple[Death, ...] | None
    stopped: tuple[Stop, ...] | None
    pss_mb_per_node: Number | None
    unwritten: Count | None


class HostQuantiles(Figures):
    """Of a time in ms, on this machine."""

    p50: Number | None
    p99: Number | None


class Lag(HostQuantiles):
    """How late corrections came, in ms on this machine."""

    max: Number | None


class Timing(Figures):
    """How well this machine kept up."""

    speed: Number | None
    slip_ms: HostQuantiles
    inversions: Count | None
    host_late: Count | None
    retractions: Count | None
    lag_ms: Lag
    unsettled: Count | None
    foreign_corrections: Count | None


class EnergyByCause(Figures):
    """Energy in J."""

    send: Number | None
    receive: Number | None
    listen: Number | None
    sleep: Number | None
    sense: Number | None


class Energy(Figures):
    """Energy from batteries in J; ``by_accounting`` by the name of the accounting, ``by_role`` by that of the role."""

    total: Number | None
    max_node: Number | None
    by: EnergyByCause
    by_accounting: Mapping[str, Number | None]
    by_role: Mapping[str, Number | None]


class AwakeShare(Figures):
    """The share of the time in which a sensor's receiver was on: mean of the sensors, and of the one with the most."""

    mean: Number | None
    most: Number | None


class Empty(Figures):
    """A battery that was empty at ``t``, emulated s."""

    id: str
    t: Number


class Lifetime(Figures):
    """Until when batteries last, emulated s; ``empty`` within the run, None on mains."""

    first_death: Number | None
    half_dead: Number | None
    coverage_lost: Number | None
    extrapolated: StrictBool | None
    empty: tuple[Empty, ...] | None


class ClockError(Figures):
    """The clock error of senders, ms."""

    rms: Number | None
    max: Number | None


class Interference(Figures):
    """What others than the processes of the run did in it."""

    frames: Count
    telemetry: Count
    answers: Count
    orders: Count
    tokens: Count
    questions: Count
    denied: Count
    handshakes: Count
    sessions: Count


class Recorder(Figures):
    """What the recorder received, what never reached it, and what went wrong with the record."""

    messages: Count
    dropped: Signed | None
    complaints: tuple[str, ...]


def first_problem(error: ValidationError) -> tuple[str, str]:
    """The key of the first value that is wrong, and what is wrong with it; both fit into a line."""
    first = error.errors(include_url=False, include_context=False)[0]
    key = ".".join(map(str, first["loc"]))
    what = "is missing" if first["type"] == "missing" else f"is {quoted(first['input'])}"
    return (key if key.isprintable() and len(key) <= 80 else quoted(key)), what


class RunFigures(Figures):
    """All of metrics.json; ``trackers`` by their names."""

    scenario: str
    seed: Seed
    driver: Literal["processes", "virtual", "replay"]
    ended_s: Number
    complete: bool
    end_reason: str
    wall_s: Number | None
    cpu_s: Number | None
    trackers: Mapping[str, TrackerFigures]
    bound: Bound
    leaders: Leaders
    clusters: Clusters
    passes: PassFigures
    camera: CameraFigures | None
    age_of_information_s: Age
    processes: Processes
    frames: Frames
    bytes: Bytes
    channel: ChannelFigures
    latency_ms: Latencies
    host_latency_ms: HostQuantiles
    timing: Timing
    energy_j: Energy
    awake_share: AwakeShare
    ledger: LedgerFigures
    lifetime_s: Lifetime
    clock_error_ms: ClockError
    recorder: Recorder
    interference: Interference
    attempts: Mapping[str, Mapping[str, Count]]

    @classmethod
    def of(cls, metrics: Mapping[str, Any], file: str = "") -> Self:
        """From what is in metrics.json. Raises ``ScenarioError`` if figures are missing."""
        try:
            return cls.model_validate(metrics)
        except ValidationError as error:
            key, what = first_problem(error)
            expected = "the figures of a run by this version, whose recorder did not die"
            raise ScenarioError(what, file=file, key=key, expected=expected) from None

    def plain(self) -> dict[str, Any]:
        """As in metrics.json."""
        return self.model_dump(mode="json")

    def rows(self) -> Iterator[dict[str, Any]]:
        """A row for each tracker: its figures and those of the run that ``OF_RUN`` names, by their keys."""
        whole = flat(self.model_dump(exclude={"trackers"}))
        run = {key: whole[key] for key in OF_RUN}
        run |= in_study(self.camera)
        for name, tracker in self.trackers.items():
            figures = tracker.model_dump(exclude=set(TrackerFigures.model_fields) - set(ScoreFigures.model_fields))
            fixes = self.passes.of(name)
            yield {"seed": self.seed, "tracker": name, **flat(figures), **tracker.by_place, **fixes, **run}


OF_RUN: Final[tuple[str, ...]] = (
    "bound.position",
    "bound.trajectory",
    "frames.sent",
    "frames.expected",
    "frames.delivered",
    "frames.late",
    *(f"frames.lost.{cause}" for cause in Lost.model_fields),
    "bytes.payload",
    "bytes.on_air",
    "latency_ms.link.p95",
    "latency_ms.to_track.p95",
    "energy_j.total",
    "energy_j.max_node",
    "lifetime_s.first_death",
    "lifetime_s.half_dead",
    "lifetime_s.coverage_lost",
    "lifetime_s.extrapolated",
    "latency_ms.to_base.p95",
    "age_of_information_s.base_mean",
    "ledger.setup.total_j",
    "ledger.present.bytes",
    "ledger.present.total_j",
    "ledger.idle.total_j",
    "ledger.power_w.present",
    "ledger.power_w.idle",
    "ledger.hottest",
    "ledger.lifetime_s.first_death",
    "ledger.lifetime_s.half_dead",
    "channel.use_peak",
)
"""Figures of the whole run that stand in the table of a study, the same for all its trackers."""
