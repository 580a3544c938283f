"""Tracks and errors of several runs in one recording, on one timeline."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import rerun as rr
import rerun.blueprint as rrb
import rerun_bindings

from launcher.timeline import look, rows
from launcher.timeline.curves import BINS, axis_of
from launcher.timeline.layers.closeup import WIDE, scale_bar, zoomed
from launcher.timeline.look import path as entity
from launcher.timeline.scene import Points, rings
from launcher.timeline.views import bounds, so_far, space
from trackfield.role import NS

Array = npt.NDArray[np.float64]
PLOT: Final = (760.0, 390.0)
"""Width and height of a plot on a screen of 1600 x 900."""
NEAR: Final = 0.9
"""The share of the errors that fit into the close-up."""


@dataclass(frozen=True)
class Overlaid:
    """The estimates of one tracker in one run, an entry per step: ``t_s`` (T,) in s since the first step.

    ``mean`` (T, 2) in m, ``covariance`` (T, 4, 4), ``error_m`` (T,); NaN where there was no track. ``colour`` is
    "#rrggbb", ``width`` that of its lines on screen.
    """

    tracker: str
    run: str
    t_s: Array
    mean: Array
    covariance: Array
    error_m: Array
    colour: str
    width: float

    @property
    def name(self) -> str:
        """What legends say."""
        return f"{self.tracker}, {self.run}"

    def path(self, *parts: str) -> str:
        """An entity of this track in the field."""
        return entity("field", self.tracker, self.run, *parts)


@dataclass(frozen=True)
class Way:
    """Where a target was: ``t_s`` (T,) in s since the first step, ``at`` (T, 2) in m."""

    target: str
    t_s: Array
    at: Points


def write_overlay(file: Path, name: str, sensors: Points, ways: Sequence[Way], tracks: Sequence[Overlaid]) -> None:
    """Write a recording, over an existing file; ``sensors`` (n, 2) are their positions, m."""
    rec = rr.RecordingStream("trackfield", recording_id=name)
    rr.set_log_tick_enabled(False, recording=rec)
    rr.set_log_time_enabled(False, recording=rec)
    rec.set_sinks(rr.FileSink(file), default_blueprint=_layout(sensors, ways, tracks))
    rec.send_recording_name(name)
    for path, *parts in _still(sensors, ways, tracks):
        rec.log(path, *parts, static=True)
    for path, t_s, columns in (*_ways(ways), *_tracks(tracks)):
        times = np.round(t_s * NS).astype(np.int64).astype("timedelta64[ns]")
        rec.send_columns(path, [rr.TimeColumn(look.TIME, duration=times)], columns)
    rec.flush(timeout_sec=5)
    rec.disconnect()
    del rec
    rerun_bindings.flush_and_cleanup_orphaned_recordings()  # otherwise its threads stay until the program ends


# --- what is drawn ----------------------------------------------------------------------------------------------------


def _still(sensors: Points, ways: Sequence[Way], tracks: Sequence[Overlaid]) -> Iterator[tuple[Any, ...]]:
    """How everything looks, and what does not change."""
    yield "/field", rr.Transform3D(scale=[1, -1, 1])  # 2-D views point y down, north is up
    sensor = look.point_style(look.state_colour(look.REST), 2.5, order=24)
    yield "/field/sensors", rr.Points2D.from_fields(positions=sensors), sensor
    for way in ways:
        yield look.truth_path(way.target, "path"), look.line_style(look.TRUTH, 4.5, order=10)
        yield look.truth_path(way.target, "position"), look.point_style(look.TARGET, 3.5, order=60)
        yield look.closeup_path(way.target, "zoom"), rr.Transform3D(scale=_half(tracks))
        length, text = scale_bar(_half(tracks))
        bar = np.array([[(-rows.BAR_AT[0], rows.BAR_AT[1]), (length - rows.BAR_AT[0], rows.BAR_AT[1])]])
        scale = rr.LineStrips2D.from_fields(strips=bar, labels=[text])
        yield look.closeup_path(way.target, "zoom", "scale"), scale, look.line_style(look.INFO, 2.5, order=70)
    for number, track in enumerate(tracks):
        colour = int(track.colour[1:], 16) << 8 | 0xFF
        yield track.path("track"), look.line_style(colour, track.width, order=20 + number)
        yield track.path("ellipse"), look.line_style(colour, track.width, order=40 + number)
        yield track.path("position"), look.point_style(colour, 1.5 + track.width, order=50 + number)
        line = rr.SeriesLines(colors=colour, names=track.name, widths=track.width)
        yield entity("plots", "error", track.tracker, track.run), line


def _half(tracks: Sequence[Overlaid]) -> float:
    """From the middle of the close-up to its upper edge, m."""
    errors = np.concatenate([track.error_m[np.isfinite(track.error_m)] for track in tracks] or [np.ones(1)])
    return zoomed(np.inf, 1.2 * float(np.quantile(errors, NEAR)) if len(errors) else 1.0)


Moving = Iterator[tuple[str, Array, rows.Columns]]


def _ways(ways: Sequence[Way]) -> Moving:
    for way in ways:
        yield look.truth_path(way.target, "position"), way.t_s, rows.points([point[None] for point in way.at])
        yield look.closeup_path(way.target), way.t_s, rows.moves([(x, -y) for x, y in way.at.tolist()])
        yield look.truth_path(way.target, "path"), way.t_s[1:], rows.strips(_legs(way.at))


def _tracks(tracks: Sequence[Overlaid]) -> Moving:
    for track in tracks:
        there = [bool(np.isfinite(point).all()) for point in track.mean]
        points = [point[None][: int(known)] for point, known in zip(track.mean, there, strict=True)]
        ellipses = [
            rings(point, tuple(covariance.ravel().tolist()))
            for point, covariance in zip(points, track.covariance, strict=True)
        ]
        yield track.path("position"), track.t_s, rows.points(points)
        yield track.path("ellipse"), track.t_s, rows.strips(ellipses)
        yield track.path("track"), track.t_s[1:], rows.strips(_legs(track.mean))
        yield (
            entity("plots", "error", track.tracker, track.run),
            track.t_s,
            rows.scalars(track.error_m[:, None].tolist()),
        )


def _legs(at: Points) -> list[Points]:
    """From each of these points (T, 2) to the next; none where one of them is not there."""
    legs = np.stack((at[:-1], at[1:]), axis=1)
    return [leg[None][: int(np.isfinite(leg).all())] for leg in legs]


# --- the views --------------------------------------------------------------------------------------------------------


def _layout(sensors: Points, ways: Sequence[Way], tracks: Sequence[Overlaid]) -> rrb.Blueprint:
    """The field left; a close-up of each target and the errors right."""
    trails = [look.truth_path(way.target, "path") for way in ways] + [track.path("track") for track in tracks]
    shown = dict.fromkeys(trails, so_far())
    points = [tuple(point) for point in np.vstack([sensors, *(way.at for way in ways)]).tolist()]
    closeups = [_closeup(way.target, shown) for way in ways]
    end_s = max((float(track.t_s[-1]) for track in tracks if len(track.t_s)), default=1.0)
    by_tracker = {tracker: [t for t in tracks if t.tracker == tracker] for tracker in _trackers(tracks)}
    plots = [_plot("Error [m]", "/plots/error/**", tracks, end_s)]
    if len(by_tracker) > 1:
        paths = {tracker: entity("plots", "error", tracker) + "/**" for tracker in by_tracker}
        plots += [_plot(f"{name} [m]", paths[name], own, end_s) for name, own in by_tracker.items()]
    return rrb.Blueprint(
        rrb.Horizontal(
            space("/", ["/field/**"], "Field (E right, N up)", bounds(points), shown),
            rrb.Vertical(*(rrb.Tabs(*views, active_tab=0) for views in (closeups, plots) if views)),
        ),
        rrb.TimePanel(state="collapsed", timeline=look.TIME, play_state="playing"),
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
        auto_views=False,
    )


def _trackers(tracks: Sequence[Overlaid]) -> list[str]:
    return list(dict.fromkeys(track.tracker for track in tracks))


def _closeup(target: str, shown: Mapping[Any, rrb.VisibleTimeRanges]) -> rrb.Spatial2DView:
    contents = ["/field/**", look.closeup_path(target) + "/**"]
    around = rrb.VisualBounds2D(x_range=(-WIDE, WIDE), y_range=(-1.0, 1.0))
    return space(look.closeup_path(target, "zoom"), contents, f"Close-up of {target}", around, shown)


def _plot(name: str, contents: str, tracks: Sequence[Overlaid], end_s: float) -> rrb.TimeSeriesView:
    """Errors over time, with a legend that hides none of them."""
    highest = np.zeros(BINS)
    for track in tracks:
        at = np.clip(track.t_s / max(end_s, 1e-9) * BINS, 0, BINS - 1).astype(int)
        np.maximum.at(highest, at, np.nan_to_num(track.error_m))
    axis = axis_of(highest, [track.name for track in tracks] or [""], PLOT)
    corner = rrb.Corner2D.LeftTop if axis.left else rrb.Corner2D.RightTop
    whole = rr.TimeRange(
        start=rrb.TimeRangeBoundary.absolute(seconds=0.0), end=rrb.TimeRangeBoundary.absolute(seconds=end_s)
    )
    return rrb.TimeSeriesView(
        origin="/",
        contents=[contents],
        name=name,
        plot_legend=rrb.PlotLegend(corner=corner, visible=axis.legend),
        axis_x=rrb.TimeAxis(view_range=whole),
        axis_y=rrb.ScalarAxis(range=(-0.03 * axis.top, axis.top)),
    )
