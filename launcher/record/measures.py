"""The figures of a run with types: metrics.json as frozen objects, its keys as attributes (docs/metrics.md)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Final, Literal, Self

from pydantic import BaseModel, ConfigDict, ValidationError

from launcher.nested import flat
from launcher.record.verdict import Verdict
from trackfield.errors import ScenarioError


class _Figures(BaseModel):
    """Figures that belong together; keys that a later version adds are ignored."""

    model_config = ConfigDict(frozen=True, extra="ignore")


class Rmse(_Figures):
    """Root mean square errors in m (velocity: m/s)."""

    x: float | None
    y: float | None
    position: float | None
    velocity: float | None


class Gap(_Figures):
    """RMSE of the position (m) over the ``steps`` with a track inside gaps of the recorded truth."""

    rmse: float | None
    steps: int


class ScoreFigures(_Figures):
    """How well a tracker did in a view."""

    rmse: Rmse
    median_error: float | None
    nees: float | None
    nees_band: tuple[float, float] | None
    steps: int
    bound_m: float | None
    times_bound: float | None
    verdict: Verdict | None
    lost: bool
    steps_expected: int
    steps_tracked: int
    share_within: float | None
    longest_blackout_s: float
    gap: Gap


class TargetFigures(_Figures):
    """RMSE of the position (m) over the ``steps`` in which this target was the nearest to the track."""

    rmse: float | None
    steps: int


class TrackerFigures(ScoreFigures):
    """How well a tracker did in the headline view; ``sources`` counts the steps in which a process had a track."""

    association: Literal["nearest"] | None
    targets: Mapping[str, TargetFigures]
    sources: Mapping[str, int]
    views: Mapping[str, ScoreFigures]


class Bound(_Figures):
    """The least error (m) of any tracker: with every report in reach, and with those that came."""

    position: float | None
    trajectory: float | None


class Death(_Figures):
    """A process that died unplanned; ``t`` in emulated s, None before the start."""

    id: str
    host: str
    why: str
    t: float | None


class Stop(_Figures):
    """A process that was stopped from outside at ``t``, for ``s`` (emulated s; None: it never resumed)."""

    id: str
    host: str
    t: float | None
    s: float | None


class Processes(_Figures):
    """The processes of the run."""

    started: int
    ready_s: float | None
    died: tuple[Death, ...]
    stopped: tuple[Stop, ...]
    pss_mb_per_node: float | None


class Lost(_Figures):
    """Frames that did not reach their receiver, by cause."""

    radio: int
    partition: int
    in_flight: int
    asleep: int
    frozen: int
    dead: int
    overflow: int


class Kind(_Figures):
    """The frames of one kind of message."""

    sent: int
    payload_bytes_max: int


class Frames(_Figures):
    """What became of the frames; ``by_kind`` by the name of the message, ``refused`` by the reason."""

    sent: int
    expected: int
    delivered: int
    late: int
    duplicate: int
    ignored: int
    lost: Lost
    host_lost: int
    refused: Mapping[str, int]
    by_kind: Mapping[str, Kind]


class Bytes(_Figures):
    """Payloads, and what senders put on the air."""

    payload: int
    on_air: int | None


class Quantiles(_Figures):
    """Of a time in ms, emulated."""

    p50: float | None
    p95: float | None
    p99: float | None
    max: float | None


class Latencies(_Figures):
    """Emulated times in ms: on the link, from sending to fusion, from an instant to the track of it."""

    link: Quantiles
    to_filter: Quantiles
    to_track: Quantiles


class HostQuantiles(_Figures):
    """Of a time in ms, on this machine."""

    p50: float | None
    p99: float | None


class Timing(_Figures):
    """How well this machine kept up."""

    speed: float | None
    slip_ms: HostQuantiles
    inversions: int
    host_late: int


class EnergyByCause(_Figures):
    """Energy in J."""

    send: float | None
    receive: float | None
    listen: float | None
    sleep: float | None
    sense: float | None


class Energy(_Figures):
    """Energy of the sensor nodes in J; ``by_accounting`` by the name of the accounting."""

    total: float | None
    max_node: float | None
    by: EnergyByCause
    by_accounting: Mapping[str, float | None]


class Empty(_Figures):
    """A battery that was empty at ``t``, emulated s."""

    id: str
    t: float


class Lifetime(_Figures):
    """Until when batteries last, emulated s; ``empty`` within the run, None on mains."""

    first_death: float | None
    half_dead: float | None
    coverage_lost: float | None
    extrapolated: bool | None
    empty: tuple[Empty, ...] | None


class ClockError(_Figures):
    """The clock error of senders, ms."""

    rms: float | None
    max: float | None


class Interference(_Figures):
    """What others than the processes of the run did in it."""

    frames: int
    telemetry: int
    answers: int
    orders: int
    tokens: int


class Recorder(_Figures):
    """What the recorder received, and what never reached it."""

    messages: int
    dropped: int


class RunFigures(_Figures):
    """All of metrics.json; ``trackers`` by their names."""

    scenario: str
    seed: int
    driver: Literal["processes", "virtual", "replay"]
    end_s: float
    wall_s: float
    cpu_s: float
    trackers: Mapping[str, TrackerFigures]
    bound: Bound
    processes: Processes
    frames: Frames
    bytes: Bytes
    latency_ms: Latencies
    host_latency_ms: HostQuantiles
    timing: Timing
    energy_j: Energy
    lifetime_s: Lifetime
    clock_error_ms: ClockError
    recorder: Recorder
    interference: Interference

    @classmethod
    def of(cls, metrics: Mapping[str, Any], file: str = "") -> Self:
        """From what is in metrics.json. Raises ``ScenarioError`` if figures are missing."""
        try:
            return cls.model_validate(metrics)
        except ValidationError as error:
            first = error.errors()[0]
            key, what = ".".join(map(str, first["loc"])), "is missing"
            if first["type"] != "missing":
                what = f"is {first['input']!r}"
            expected = "the figures of a run by this version, whose recorder did not die"
            raise ScenarioError(what, file=file, key=key, expected=expected) from None

    def rows(self) -> Iterator[dict[str, Any]]:
        """A row for each tracker: its figures and those of the run that ``OF_RUN`` names, by their keys."""
        whole = flat(self.model_dump(exclude={"trackers"}))
        run = {key: whole[key] for key in OF_RUN}
        for name, tracker in self.trackers.items():
            figures = tracker.model_dump(exclude=set(TrackerFigures.model_fields) - set(ScoreFigures.model_fields))
            yield {"seed": self.seed, "tracker": name, **flat(figures), **run}


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
)
"""Figures of the whole run that stand in the table of a study, the same for all its trackers."""
