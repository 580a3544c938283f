"""How a run looks in the Rerun viewer: entity paths, colours and the layout of the views."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from functools import lru_cache
from typing import Final

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
import rerun.blueprint.archetypes as rrba

from launcher.records import FieldInfo, Place

EMU: Final = "emu"
"""The timeline of emulated time since the start of the run."""

Colour = int
"""0xRRGGBBAA."""

STATE_COLOURS: Final[dict[str, Colour]] = {
    "asleep": 0x525661FF,
    "awake": 0xB0B7C6FF,
    "reporting": 0x3DBE6CFF,
    "waiting": 0x606C88FF,
    "tracking": 0x3DBE6CFF,
    "coasting": 0xF2A93BFF,
}
OTHER_STATE: Final[Colour] = 0xAA78DCFF
CENTRE: Final[Colour] = 0xF2A93BFF
TRUTH: Final[Colour] = 0x969BA5FF
INTERPOLATED: Final[Colour] = 0xE258A0FF
TARGET: Final[Colour] = 0xFFFFFFFF
RAY: Final[Colour] = 0x4FC07AC8
INFO: Final[Colour] = 0xC8CDD6FF
LATE: Final[Colour] = 0xF5B041FF
LOST: Final[Colour] = 0xF2524BFF
_TRACKERS: Final[tuple[Colour, ...]] = (
    0xFFC83DFF,
    0x4FA3FFFF,
    0xF078C8FF,
    0x2BD4BDFF,
    0xC88C5AFF,
)

_GRAPH_SPACING: Final = 52.0
LANES: Final = 7
"""Lanes that fit below the field,"""
ALL_LANES: Final = 200
"""and in the tab with all of them; a field of more sensors is drawn without their names."""


def tracker_colour(info: FieldInfo, tracker: str) -> Colour:
    """The colour of a tracker's track, ellipse and error; one that the run did not announce comes last."""
    rank = info.trackers.index(tracker) if tracker in info.trackers else len(info.trackers)
    return _TRACKERS[rank % len(_TRACKERS)]


@lru_cache(maxsize=4096)
def path(*parts: str) -> str:
    """An entity path of these parts, whatever characters they hold."""
    return "/" + "/".join(rr.escape_entity_path_part(part) for part in parts)


def line_style(colour: Colour, width: float, order: float) -> rr.LineStrips2D:
    """Lines of this width on screen; a higher order is drawn on top."""
    return rr.LineStrips2D.from_fields(colors=colour, radii=rr.Radius.ui_points(width / 2), draw_order=order)


def point_style(colour: Colour, radius: float, order: float) -> rr.Points2D:
    """Dots of this radius on screen; a higher order is drawn on top."""
    return rr.Points2D.from_fields(colors=colour, radii=rr.Radius.ui_points(radius), draw_order=order)


def lanes(info: FieldInfo) -> list[Place]:
    """All places, the ones whose states are worth a look first.

    That is whatever is no sensor, then the sensors in the order of how long the target is nearest to them.
    """
    sensors = [place for place in info.places if place.role == "node"]
    others = [place for place in info.places if place.role != "node"]
    if not sensors or not info.truth:
        return others + sensors
    at = np.array([(place.x, place.y) for place in sensors])
    nearest = Counter(int(np.argmin(np.hypot(*(at - point[1:]).T))) for point in info.truth)
    first = [sensors[index] for index, _ in nearest.most_common()]
    return others + first + [place for index, place in enumerate(sensors) if index not in nearest]


def graph_positions(info: FieldInfo) -> dict[str, tuple[float, float]]:
    """Where each place is drawn in the network, sensors first: as in the field, but y down and evenly scaled.

    The graph view draws a box of some 45 x 20 units around a name, so neighbours are a little further apart,
    and whatever is no sensor is drawn half a row further south, beside the sensors that it may stand amid.
    """
    places = sorted(info.places, key=lambda place: place.role != "node")
    at = np.array([(place.x, -place.y) for place in places])
    some = at[:: len(at) // 100 + 1]
    apart = np.hypot(*(some[:, None] - at).T)  # (n, at most 100) distances; a place is 0 m from itself
    nearest = np.sort(apart, axis=0)[1 if len(at) > 1 else 0]
    scale = _GRAPH_SPACING / max(float(np.median(nearest)), 1e-3)
    south = [0.0 if place.role == "node" else _GRAPH_SPACING / 2 for place in places]
    return {place.id: (x, y + down) for place, (x, y), down in zip(places, (at * scale).tolist(), south, strict=True)}


def layout(info: FieldInfo) -> rrb.Blueprint:
    """The views of a run: field and states on the left, network and messages in the middle, plots right."""
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(_field(info), _states(info, "Node states", LANES), row_shares=[3, 2]),
            rrb.Vertical(
                _network(info),
                rrb.Tabs(
                    rrb.TextLogView(
                        origin="/",
                        contents=["/messages/**", "/notes/**"],
                        name="Messages",
                        columns=rrb.TextLogColumns(timeline_columns=[EMU], text_log_columns=["LogLevel", "Body"]),
                    ),
                    _states(info, "All states", ALL_LANES),
                    active_tab=0,
                ),
                row_shares=[1, 1],
            ),
            rrb.Vertical(
                _plot(info, "error", "Error [m]", rrb.Corner2D.RightTop),
                _plot(info, "latency", "Latency [ms]", rrb.Corner2D.RightTop),
                _plot(info, "lost", "Frames lost", rrb.Corner2D.LeftTop),
                _plot(info, "bytes", "Bytes/s", rrb.Corner2D.RightBottom),
            ),
            column_shares=[5, 4, 3],
        ),
        rrb.TimePanel(state="collapsed", timeline=EMU, play_state="playing"),
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
        auto_views=False,
    )


def _field(info: FieldInfo) -> rrb.Spatial2DView:
    so_far = rrb.VisibleTimeRanges(
        rrb.VisibleTimeRange(EMU, start=rrb.TimeRangeBoundary.infinite(), end=rrb.TimeRangeBoundary.cursor_relative())
    )
    truth = [path("field", "truth", part) for part in ("path", "interpolated")]
    trails = [*truth, *(path("field", name, "track") for name in info.trackers)]
    points = [(place.x, -place.y) for place in info.places] + [(x, -y) for _, x, y in info.truth]
    return rrb.Spatial2DView(
        origin="/",
        contents="/field/**",
        name="Field (E right, N up)",
        background=(14, 15, 20),
        visual_bounds=_bounds(points),
        overrides=dict.fromkeys(trails, so_far),
    )


def _network(info: FieldInfo) -> rrb.GraphView:
    return rrb.GraphView(
        origin="/network",
        name="Network",
        visual_bounds=_bounds(list(graph_positions(info).values())),
        force_link=rrba.ForceLink(enabled=False),
        force_many_body=rrba.ForceManyBody(enabled=False),
        force_position=rrba.ForcePosition(enabled=False),
        force_collision_radius=rrba.ForceCollisionRadius(enabled=False),
        force_center=rrba.ForceCenter(enabled=False),
    )


def _plot(info: FieldInfo, what: str, name: str, legend: rrb.Corner2D) -> rrb.TimeSeriesView:
    return rrb.TimeSeriesView(
        origin=path("plots", what),
        name=name,
        plot_legend=rrb.PlotLegend(corner=legend),
        axis_x=_whole_run(info),
    )


def _states(info: FieldInfo, name: str, count: int) -> rrb.StateTimelineView:
    return rrb.StateTimelineView(
        origin="/",
        contents=[path("state", place.id) + "/**" for place in lanes(info)[:count]],
        name=name,
        time_view=_whole_run(info),
        defaults=[
            rr.StateConfiguration(values=list(STATE_COLOURS), colors=list(STATE_COLOURS.values())),
        ],
    )


def _whole_run(info: FieldInfo) -> rrb.TimeAxis:
    return rrb.TimeAxis(
        view_range=rr.TimeRange(
            start=rrb.TimeRangeBoundary.absolute(seconds=0.0),
            end=rrb.TimeRangeBoundary.absolute(seconds=info.end_s),
        )
    )


def _bounds(points: Sequence[tuple[float, float]]) -> rrb.VisualBounds2D:
    """The box around some points of a view, with a margin."""
    xs, ys = zip(*points, strict=True)
    margin = 0.05 * max(max(xs) - min(xs), max(ys) - min(ys)) + 5.0
    return rrb.VisualBounds2D(
        x_range=(min(xs) - margin, max(xs) + margin), y_range=(min(ys) - margin, max(ys) + margin)
    )
