"""The views of a run in the Rerun viewer, and how they are laid out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import rerun as rr
import rerun.blueprint as rrb
import rerun.blueprint.archetypes as rrba

from launcher.heard import RANKS
from launcher.records import FieldInfo
from launcher.timeline import look, outlook
from launcher.timeline.beyond import camera_of
from launcher.timeline.curves import Axis
from launcher.timeline.layers.camera import LOG as CAMERA_LOG
from launcher.timeline.layers.closeup import WIDE
from launcher.timeline.layers.heads import EVENTS, any_may_lead
from launcher.timeline.layers.hearing import ears
from launcher.timeline.layers.passes import LOG
from launcher.timeline.outlook import whole_run

AROUND_S: Final = 5.0
"""So much of what is heard is shown before and after the time."""
PLOTS: Final = ("error", "latency", "clock", "lost", "queue", "bytes")
Axes = Mapping[str, Axis | None]
Overrides = Mapping[Any, rrb.VisibleTimeRanges]


def layout(info: FieldInfo, axes: Axes | None = None, *, live: bool = False) -> rrb.Blueprint:
    """The views of a run: field (network) and states left, close-up, radio and messages in the middle, plots right.

    ``axes`` are those of the plots, by name, once all their values are known. A ``live`` one stays at the latest time.
    """

    def plot(what: str, name: str) -> rrb.TimeSeriesView:
        return _plot(info, what, name, (axes or {}).get(what))

    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(
                _tabs(_field(info), _network(info)), _states(info, "Node states", _lanes(info)), row_shares=[3, 2]
            ),
            rrb.Vertical(
                *_seen(info),
                _tabs(
                    *([_log("Camera log", CAMERA_LOG)] if camera_of(info) else []),
                    *([_log("Heads", EVENTS)] if any_may_lead(info) else []),
                    *([_log("Passes", LOG)] if info.hears else []),
                    _log("Messages", "/messages/**", "/notes/**", "/faults"),
                    _log("Faults", "/faults"),
                    _times(),
                    _states(info, "All states", look.ALL_LANES),
                ),
            ),
            rrb.Vertical(
                *(_sounds(info) if info.listens else []),
                *(_pointing(info) if camera_of(info) else []),
                *_several(
                    info,
                    [plot("error", "Error [m]")],
                    [plot("latency", "Latency [ms]"), plot("clock", "Clock error [ms]")],
                    [plot("lost", "Frames lost"), plot("queue", "Frames waiting")],
                    [plot("bytes", "Bytes/s")],
                ),
            ),
            column_shares=[5, 4, 3],
        ),
        rrb.TimePanel(state="collapsed", timeline=look.TIME, play_state="following" if live else "playing"),
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
        auto_views=False,
    )


def labels(info: FieldInfo, plot: str) -> list[str]:
    """The entries of a plot's legend."""
    if plot != "error":
        return look.SERIES[plot][0]
    names = [", ".join(parts) for name in info.trackers for parts in look.track_names(info, name)]
    return [*look.SERIES["error/bound"][0], *names]


def _several(info: FieldInfo, *groups: Sequence[rrb.View]) -> list[rrb.Container | rrb.View]:
    """Plots below each other, those of a group as tabs; all of them as tabs where others take the place."""
    if camera_of(info):
        return [_tabs(*(view for group in groups for view in group))]
    if info.listens:
        return [groups[0][0], _tabs(*(view for group in groups[1:] for view in group))]
    return [_tabs(*group) if len(group) > 1 else group[0] for group in groups]


def _seen(info: FieldInfo) -> list[rrb.Container | rrb.View]:
    """What is seen of the targets: by the camera, from near by; and the radio links."""
    closeups = [_closeup(info, truth.target) for truth in info.truths]
    links = [_links(info)] if info.receptions else []
    if camera_of(info):
        return [_tabs(outlook.video(), *closeups, *links)]
    return [*([_tabs(*closeups)] if closeups else []), *links]


def _pointing(info: FieldInfo) -> list[rrb.Container | rrb.View]:
    """How the camera turned, and how fixes came to it; all of them as tabs where sound takes the place."""
    turning, ways = outlook.turning(info), outlook.ways(info)
    return [_tabs(turning, *ways)] if info.listens else [turning, _tabs(*ways)]


def _sounds(info: FieldInfo) -> list[rrb.Container | rrb.View]:
    """What the loudest and the weakest sensor of an event hear: levels around the time, and sound that is played."""
    around = rrb.TimeAxis(
        view_range=rr.TimeRange(
            start=rrb.TimeRangeBoundary.cursor_relative(seconds=-AROUND_S),
            end=rrb.TimeRangeBoundary.cursor_relative(seconds=AROUND_S),
        )
    )
    plain = rrb.PlotLegend(visible=False)
    name = "Heard [dB] (blue: loudest)"
    level = rrb.TimeSeriesView(origin="/plots/level", name=name, axis_x=around, plot_legend=plain)
    waves = rrb.TimeSeriesView(origin="/plots/waveform", name="Waveform", axis_x=around, plot_legend=plain)
    played = [rrb.AudioView(origin=look.path("sound", rank), name=f"Sound, {rank}") for rank in RANKS]
    return [level, _tabs(*played, waves)]


def _tabs(*views: rrb.View) -> rrb.Tabs:
    return rrb.Tabs(*views, active_tab=0)


def _log(name: str, *contents: str) -> rrb.TextLogView:
    columns = rrb.TextLogColumns(timeline_columns=[look.TIME], text_log_columns=["LogLevel", "Body"])
    return rrb.TextLogView(origin="/", contents=list(contents), name=name, columns=columns)


def _times() -> rrb.DataframeView:
    query = rrba.DataframeQuery(timeline=look.TIME, auto_scroll=True)
    return rrb.DataframeView(origin="/times", name="Message times", query=query)


def _links(info: FieldInfo) -> rrb.Spatial2DView:
    places = [(place.x, place.y) for place in info.places]
    return space("/", ["/links/**"], "Radio links (reception)", bounds(places + look.beside_links(info)))


def _field(info: FieldInfo) -> rrb.Spatial2DView:
    points = look.field_points(info)
    row = look.row_below(points, 2)
    room = 0.4 * (row[1][0] - row[0][0])  # for its words, which are as large in a small window
    box = bounds(points + [(x, y - room) for x, y in row])
    return space("/", ["/field/**"], "Field (E right, N up)", box, _trails(info))


def _closeup(info: FieldInfo, target: str) -> rrb.Spatial2DView:
    """The field again, from a frame that moves with a target."""
    contents = ["/field/**", "- /field/legend/**", look.closeup_path(target) + "/**"]
    bounds = rrb.VisualBounds2D(x_range=(-WIDE, WIDE), y_range=(-1.0, 1.0))
    return space(look.closeup_path(target, "zoom"), contents, f"Close-up of {target}", bounds, _trails(info))


def space(
    origin: str, contents: list[str], name: str, bounds: rrb.VisualBounds2D, overrides: Overrides | None = None
) -> rrb.Spatial2DView:
    """A view of what lies in the plane, from ``origin``."""
    return rrb.Spatial2DView(
        origin=origin,
        contents=contents,
        name=name,
        background=look.GROUND,
        visual_bounds=bounds,
        overrides=overrides,
    )


def _trails(info: FieldInfo) -> Overrides:
    """The entities that are shown with their history, not only as they are now."""
    trails = [look.truth_path(truth.target, part) for truth in info.truths for part in ("path", "interpolated")]
    for name in info.trackers:
        trails += [look.path("field", *parts, "track") for parts in look.track_names(info, name)]
    return dict.fromkeys(trails, so_far())


def so_far() -> rrb.VisibleTimeRanges:
    """All of an entity up to the time that is shown."""
    start, end = rrb.TimeRangeBoundary.infinite(), rrb.TimeRangeBoundary.cursor_relative()
    return rrb.VisibleTimeRanges(rrb.VisibleTimeRange(look.TIME, start=start, end=end))


def _network(info: FieldInfo) -> rrb.GraphView:
    if len(info.places) > look.WHOLE_NETWORK:
        return rrb.GraphView(origin="/network", name="Network (active places)")
    return rrb.GraphView(
        origin="/network",
        name="Network",
        visual_bounds=bounds([(x, -y) for x, y in look.graph_positions(info).values()]),
        force_link=rrba.ForceLink(enabled=False),
        force_many_body=rrba.ForceManyBody(enabled=False),
        force_position=rrba.ForcePosition(enabled=False),
        force_collision_radius=rrba.ForceCollisionRadius(enabled=False),
        force_center=rrba.ForceCenter(enabled=False),
    )


def _plot(info: FieldInfo, what: str, name: str, axis: Axis | None) -> rrb.TimeSeriesView:
    left, right = rrb.Corner2D.LeftTop, rrb.Corner2D.RightTop
    return rrb.TimeSeriesView(
        origin=look.path("plots", what),
        name=name,
        plot_legend=rrb.PlotLegend(corner=left if axis and axis.left else right, visible=axis is None or axis.legend),
        axis_x=whole_run(info),
        axis_y=rrb.ScalarAxis(range=(-0.03 * axis.top, axis.top)) if axis else None,
    )


def _lanes(info: FieldInfo) -> int:
    """How many places have room for their lanes below the field; nodes that may lead have two each."""
    if not any_may_lead(info) and not ears(info):
        return look.LANES
    return look.LANES // 2 + (camera_of(info) is not None)  # those of the camera have one


def _states(info: FieldInfo, name: str, count: int) -> rrb.StateTimelineView:
    return rrb.StateTimelineView(
        origin="/",
        contents=[
            "/faults",
            *([EVENTS] if any_may_lead(info) else []),
            *(look.path("state", place.id) + "/**" for place in look.lanes(info)[:count]),
        ],
        name=name,
        time_view=whole_run(info),
        defaults=[
            rr.StateConfiguration(values=list(look.STATE_COLOURS), colors=list(look.STATE_COLOURS.values())),
        ],
    )


def bounds(points: Sequence[tuple[float, float]]) -> rrb.VisualBounds2D:
    """The box around some points (y up), with a margin, for a view (y down)."""
    xs, ys = zip(*points, strict=True)
    margin = 0.05 * max(max(xs) - min(xs), max(ys) - min(ys)) + 5.0
    return rrb.VisualBounds2D(
        x_range=(min(xs) - margin, max(xs) + margin), y_range=(-max(ys) - margin, margin - min(ys))
    )
