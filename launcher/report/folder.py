"""A finished run as its folder tells it: what a report and a comparison are made from."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from launcher.plan.faults import Mark, resolve
from launcher.record.tables import STATE
from launcher.records import ARRIVED
from trackfield.errors import ScenarioError
from trackfield.filters import metrics as score
from trackfield.role import NS
from trackfield.scenario import Scenario, Site, survey

Array = npt.NDArray[np.float64]
REPORTS: Final = ("doa", "measurement")
"""The kind of message that carries what a sensor heard."""
_COLUMNS: Final = ("kind", "src", "dst", "outcome", "sent_ns", "due_ns", "bytes", "copy", "incarnation", "step")
_TEXT: Final = ("kind", "src", "dst", "outcome")


@dataclass(frozen=True)
class Track:
    """What one tracker said of one target: an entry per step, in the order of time.

    ``t_s`` and ``told_s`` (T,) in s; ``reports`` (T,) fused; ``coasting`` (T,) where there was a track and no report;
    ``mean`` and ``truth`` (T, 4) as (x, y, vx, vy) in m and m/s; ``covariance`` (T, 4, 4); ``bound`` (T,) in m, the
    least standard deviation of the position. Where there was no track, target or bound, they are NaN.
    """

    tracker: str
    target: str
    t_s: Array
    told_s: Array
    reports: Array
    coasting: npt.NDArray[np.bool_]
    mean: Array
    covariance: Array
    truth: Array
    bound: Array

    @cached_property
    def error_m(self) -> Array:
        """(T,) distance from the truth, m."""
        distances: Array = np.hypot(*(self.mean - self.truth)[:, :2].T)
        return distances

    @cached_property
    def nees(self) -> Array:
        """(T,) normalised estimation error squared of the whole state."""
        found = np.full(len(self.t_s), np.nan)
        known = np.isfinite(self.mean - self.truth).all(axis=1) & np.isfinite(self.covariance).all(axis=(1, 2))
        found[known] = score.nees((self.mean - self.truth)[known], self.covariance[known])
        return found


@dataclass(frozen=True)
class Frames:
    """Every frame and what became of it at each hearer; the columns of messages.parquet that a report needs."""

    table: pa.Table

    def __len__(self) -> int:
        return int(self.table.num_rows)

    def where(self, column: str, *values: str) -> npt.NDArray[np.bool_]:
        """(n,) whether the column holds one of these values."""
        return np.asarray(pc.is_in(self.table[column], pa.array(values)))

    @cached_property
    def sent_s(self) -> Array:
        """(n,) when each was sent, s."""
        return self._floats("sent_ns") / NS

    @cached_property
    def link_s(self) -> Array:
        """(n,) how long each was on its way, s; NaN where it did not arrive."""
        return np.where(self.where("outcome", *ARRIVED), self._floats("due_ns") / NS - self.sent_s, np.nan)

    @cached_property
    def step(self) -> Array:
        """(n,) the step that each report is about; NaN for what is no report."""
        return self._floats("step")

    def senders(self, *outcomes: str) -> set[str]:
        """Who sent a report that had one of these outcomes, or any."""
        chosen = self.where("kind", *REPORTS)
        if outcomes:
            chosen &= self.where("outcome", *outcomes)
        return set(self.table["src"].filter(pa.array(chosen)).unique().to_pylist())

    def by_kind(self) -> dict[str, tuple[int, int]]:
        """(at how many hearers they were expected, at how many they arrived) of each kind, by its name."""
        arrived = self.where("outcome", *ARRIVED)
        of = {kind: self.where("kind", kind) for kind in sorted(self.table["kind"].unique().to_pylist())}
        return {kind: (int(chosen.sum()), int((chosen & arrived).sum())) for kind, chosen in of.items()}

    def _floats(self, column: str) -> Array:
        return np.asarray(self.table[column].to_numpy(), float)


@dataclass(frozen=True)
class Run:
    """A run folder, read: ``site`` is its scenario worked out, ``marks`` the faults that were planned."""

    folder: Path
    metrics: dict[str, Any]
    manifest: dict[str, Any]
    toml: str
    site: Site
    marks: tuple[Mark, ...]
    tracks: tuple[Track, ...]
    frames: Frames

    @property
    def scenario(self) -> Scenario:
        """The scenario as it ran."""
        return self.site.scenario

    @cached_property
    def trackers(self) -> tuple[str, ...]:
        """Their names, as the scenario has them, then any others."""
        return tuple(dict.fromkeys((*self.scenario.fusion.trackers, *self.metrics["trackers"])))

    @property
    def end_s(self) -> float:
        """When the run was to end, emulated s."""
        return (self.site.steps + 1) * self.site.step_ns / NS

    @cached_property
    def steps(self) -> int:
        """The last step of which a tracker said something."""
        times = [track.t_s[-1] for track in self.tracks if len(track.t_s)]
        return round(max(times, default=0.0) * NS / self.site.step_ns)

    @property
    def bound_m(self) -> float | None:
        """What errors are measured by, m: the bound for the reports that the trackers were given."""
        found: float | None = self.metrics["bound"].get("trajectory")
        return found

    @property
    def bounded(self) -> bool:
        """Whether the tracks have a bound beside them."""
        return any(bool(np.isfinite(track.bound).any()) for track in self.tracks)

    @cached_property
    def places(self) -> dict[str, tuple[float, float]]:
        """Where each sensor stands, m."""
        return {id: (x, y) for id, x, y in self.site.sensors}


def read_run(folder: Path) -> Run:
    """Read a finished run. Raises ``ScenarioError`` for a folder that is none, or whose scenario cannot be read."""
    metrics, manifest = (_json(folder, name) for name in ("metrics.json", "manifest.json"))
    tracks, frames = (_table(folder, name) for name in ("tracks.parquet", "messages.parquet"))
    scenario = Scenario.load(folder / "scenario.toml")
    site = survey(scenario)
    end_ns = (site.steps + 1) * site.step_ns
    faults = resolve(
        scenario.faults, scenario.seed, [id for id, *_ in site.sensors], [scenario.architecture.centre], end_ns
    )
    toml = (folder / "scenario.toml").read_text(encoding="utf-8")
    read = _tracks(tracks, scenario.fusion.trackers)
    return Run(folder, metrics, manifest, toml, site, faults.marks, read, Frames(frames.select(_COLUMNS)))


def _json(folder: Path, name: str) -> dict[str, Any]:
    try:
        read: dict[str, Any] = json.loads((folder / name).read_bytes())
    except (OSError, ValueError) as error:
        raise _unusable(folder, name, error) from None
    return read


def _table(folder: Path, name: str) -> pa.Table:
    try:
        return pq.read_table(folder / name, read_dictionary=list(_TEXT))
    except (OSError, ValueError) as error:
        raise _unusable(folder, name, error) from None


def _unusable(folder: Path, name: str, error: OSError | ValueError) -> ScenarioError:
    what = f"has no {name}" if isinstance(error, OSError) else f"its {name} is damaged"
    return ScenarioError(what, file=str(folder), expected="the folder of a finished run")


def _tracks(table: pa.Table, order: Sequence[str]) -> tuple[Track, ...]:
    """The tracks in the order of their trackers in the scenario; what it does not name comes last."""
    keys = list(zip(table["tracker"].to_pylist(), table["target"].to_pylist(), strict=True))
    rows: dict[tuple[str, str], list[int]] = {}
    for index, key in enumerate(keys):
        rows.setdefault(key, []).append(index)
    names = [*order, *(tracker for tracker, _ in rows)]
    ordered = sorted(rows.items(), key=lambda item: names.index(item[0][0]))
    return tuple(_track(*key, table.take(pa.array(own))) for key, own in ordered)


def _track(tracker: str, target: str, table: pa.Table) -> Track:
    def floats(name: str) -> Array:
        return np.asarray(table[name].to_numpy(), float)

    covariances = [row or [np.nan] * 16 for row in table["covariance"].to_pylist()]
    return Track(
        tracker,
        target,
        floats("t_s"),
        floats("told_s"),
        floats("reports"),
        np.array([status == "coasting" for status in table["status"].to_pylist()], bool),
        np.column_stack([floats(name) for name in STATE]),
        np.array(covariances, float).reshape(-1, 4, 4),
        np.column_stack([floats(f"true_{name}") for name in STATE]),
        floats("bound_m") if "bound_m" in table.column_names else np.full(table.num_rows, np.nan),
    )
