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

from launcher.colours import tracker_colours
from launcher.records import SENSES, TRACKS, FieldInfo, Place
from launcher.timeline.scene import extent, spacing
from trackfield.role import NS

EMU: Final = "emu"
"""The timeline of emulated time since the first step."""

Colour = int
"""0xRRGGBBAA."""

REST: Final = "asleep"
"""The state that nodes are in while nothing happens."""
DEAD: Final = "dead"
STATE_COLOURS: Final[dict[str, Colour]] = {
    REST: 0x525661FF,
    "awake": 0xB0B7C6FF,
    "reporting": 0x3DBE6CFF,
    "waiting": 0x606C88FF,
    "tracking": 0x3DBE6CFF,
    "coasting": 0xF2A93BFF,
    DEAD: 0x8E2420FF,
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
LEVELS: Final[dict[str, Colour]] = {"INFO": INFO, "WARN": LATE, "ERROR": LOST}
SERIES: Final[dict[str, tuple[list[str], list[Colour]]]] = {
    "error/bound": (["bound"], [0x969BA5FF]),
    "latency": (["median", "95 %"], [0x8C7BF0FF, 0x5B4FB0FF]),
    "lost": (["lost", "late"], [LOST, LATE]),
    "bytes": (["sent to hearers", "delivered"], [0x9A8F6AFF, 0xE6C65CFF]),
    "clock": (["rms", "largest"], [0x2BD4BDFF, 0x1F7F78FF]),
    "queue": (["longest"], [0xE68A5CFF]),
}
"""Names and colours of the lines of each plot."""
_SHARES: Final[tuple[Colour, ...]] = (0xF2524BFF, 0xF5D041FF, 0x3DBE6CFF)

_GROUND: Final = (14, 15, 20)
_GRAPH_SPACING: Final = 52.0
LANES: Final = 7
"""Lanes that fit below the field,"""
ALL_LANES: Final = 200
"""and in the tab with all of them; a field of more sensors is drawn without their names."""
WHOLE_NETWORK: Final = 2000
"""Of a network of more places only those are drawn that have to do with something, and not where they stand:
neighbours would be too close to be told apart."""


def tracker_colour(info: FieldInfo, tracker: str) -> Colour:
    """The colour of a tracker's track, ellipse and error; one that the run did not announce comes last."""
    return int(tracker_colours([*info.trackers, tracker])[tracker][1:], 16) << 8 | 0xFF


def state_colour(name: str) -> Colour:
    """The colour of a state, known or not."""
    return STATE_COLOURS.get(name, OTHER_STATE)


@lru_cache(maxsize=1024)
def share_colour(share: float) -> Colour:
    """From red (0) through yellow (0.5) to green (1): of batteries and of links."""
    where = min(max(share, 0.0), 1.0) * (len(_SHARES) - 1)
    low = min(int(where), len(_SHARES) - 2)
    pairs = zip(_SHARES[low].to_bytes(4), _SHARES[low + 1].to_bytes(4), strict=True)
    return int.from_bytes(bytes(round(a + (b - a) * (where - low)) for a, b in pairs))


def dot(info: FieldInfo) -> float:
    """Radius on screen of a sensor at rest; the dots of a dense field do not cover each other."""
    return 4.5 if len(info.places) <= ALL_LANES else min(2.5, max(0.7, 80 / len(info.places) ** 0.5))


@lru_cache(maxsize=4096)
def path(*parts: str) -> str:
    """An entity path of these parts, whatever characters they hold."""
    return "/" + "/".join(rr.escape_entity_path_part(part) for part in parts)


def truth_path(target: str, part: str) -> str:
    """The entity of a part of a target's truth: ``path``, ``interpolated`` or ``position``."""
    return path("field", "truth", target, part)


def line_style(colour: Colour, width: float, order: float) -> rr.LineStrips2D:
    """Lines of this width on screen; a higher order is drawn on top."""
    return rr.LineStrips2D.from_fields(colors=colour, radii=rr.Radius.ui_points(width / 2), draw_order=order)


def point_style(colour: Colour | None, radius: float, order: float) -> rr.Points2D:
    """Dots of this radius on screen, of one colour or each of its own; a higher order is drawn on top."""
    return rr.Points2D.from_fields(colors=colour, radii=rr.Radius.ui_points(radius), draw_order=order)


def lanes(info: FieldInfo) -> list[Place]:
    """All places, the ones whose states are worth a look first.

    That is whatever is no sensor, then the sensors in the order of how long a target is nearest to them.
    """
    sensors = info.tagged(SENSES)
    others = [place for place in info.places if SENSES not in place.tags]
    way = [(x, y) for truth in info.truths for _, x, y in truth.points]
    if not sensors or not way:
        return others + sensors
    at = np.array([(place.x, place.y) for place in sensors])
    nearest = Counter(int(np.argmin(np.hypot(*(at - point).T))) for point in way[:: len(way) // 150 + 1])
    first = [sensors[index] for index, _ in nearest.most_common()]
    return others + first + [place for index, place in enumerate(sensors) if index not in nearest]


def graph_positions(info: FieldInfo) -> dict[str, tuple[float, float]]:
    """Where each place is drawn in the network, sensors first: as in the field, but y down and evenly scaled.

    The graph view draws a box of some 45 x 20 units around a name, so neighbours are a little further apart,
    and whatever is no sensor is drawn half a row further south, beside the sensors that it may stand amid.
    """
    places = sorted(info.places, key=lambda place: SENSES not in place.tags)
    at = np.array([(place.x, -place.y) for place in places])
    scale = _GRAPH_SPACING / spacing(info)
    south = [0.0 if SENSES in place.tags else _GRAPH_SPACING / 2 for place in places]
    return {place.id: (x, y + down) for place, (x, y), down in zip(places, (at * scale).tolist(), south, strict=True)}


def legend_places(info: FieldInfo, count: int) -> list[tuple[float, float]]:
    """Where the entries of the legend of the links stand: in a row south of the field."""
    xs, ys = [place.x for place in info.places], [place.y for place in info.places]
    step = max(extent(info), 1.0) / 6
    middle = (min(xs) + max(xs)) / 2
    return [(middle + (index - (count - 1) / 2) * step, min(ys) - step / 2) for index in range(count)]


def layout(info: FieldInfo, *, live: bool = False) -> rrb.Blueprint:
    """The views of a run: field and states on the left, network and messages in the middle, plots right.

    A ``live`` one stays at the latest time.
    """
    right, left = rrb.Corner2D.RightTop, rrb.Corner2D.LeftTop
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(_field(info), _states(info, "Node states", LANES), row_shares=[3, 2]),
            rrb.Vertical(
                _tabs(_network(info), *([_links(info)] if info.receptions else [])),
                _tabs(
                    _log("Messages", "/messages/**", "/notes/**", "/faults"),
                    _log("Faults", "/faults"),
                    _times(),
                    _states(info, "All states", ALL_LANES),
                ),
                row_shares=[1, 1],
            ),
            rrb.Vertical(
                _plot(info, "error", "Error [m]", right),
                _tabs(_plot(info, "latency", "Latency [ms]", right), _plot(info, "clock", "Clock error [ms]", right)),
                _tabs(_plot(info, "lost", "Frames lost", left), _plot(info, "queue", "Frames waiting", left)),
                _plot(info, "bytes", "Bytes/s", rrb.Corner2D.RightBottom),
            ),
            column_shares=[5, 4, 3],
        ),
        rrb.TimePanel(state="collapsed", timeline=EMU, play_state="following" if live else "playing"),
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
        auto_views=False,
    )


def _tabs(*views: rrb.View) -> rrb.Tabs:
    return rrb.Tabs(*views, active_tab=0)


def _log(name: str, *contents: str) -> rrb.TextLogView:
    columns = rrb.TextLogColumns(timeline_columns=[EMU], text_log_columns=["LogLevel", "Body"])
    return rrb.TextLogView(origin="/", contents=list(contents), name=name, columns=columns)


def _times() -> rrb.DataframeView:
    query = rrba.DataframeQuery(timeline=EMU, auto_scroll=True)
    return rrb.DataframeView(origin="/times", name="Message times", query=query)


def _links(info: FieldInfo) -> rrb.Spatial2DView:
    places = [(place.x, place.y) for place in info.places]
    places += [(x, y - 0.05 * extent(info)) for x, y in legend_places(info, 1)]
    return rrb.Spatial2DView(
        origin="/",
        contents="/links/**",
        name="Radio links (reception)",
        background=_GROUND,
        visual_bounds=_bounds([(x, -y) for x, y in places]),
    )


def _field(info: FieldInfo) -> rrb.Spatial2DView:
    so_far = rrb.VisibleTimeRanges(
        rrb.VisibleTimeRange(EMU, start=rrb.TimeRangeBoundary.infinite(), end=rrb.TimeRangeBoundary.cursor_relative())
    )
    trails = [truth_path(truth.target, part) for truth in info.truths for part in ("path", "interpolated")]
    sources = [place.id for place in info.tagged(TRACKS)]
    for name in info.trackers:
        names = [(name,)] if len(sources) <= 1 else [(name, source) for source in sources]
        trails += [path("field", *parts, "track") for parts in names]
    points = [(place.x, place.y) for place in info.places]
    points += [(x, y) for truth in info.truths for _, x, y in truth.points]
    points += [(x, y) for _, legs in info.paths for _, x, y in legs]
    return rrb.Spatial2DView(
        origin="/",
        contents="/field/**",
        name="Field (E right, N up)",
        background=_GROUND,
        visual_bounds=_bounds([(x, -y) for x, y in points]),
        overrides=dict.fromkeys(trails, so_far),
    )


def _network(info: FieldInfo) -> rrb.GraphView:
    if len(info.places) > WHOLE_NETWORK:
        return rrb.GraphView(origin="/network", name="Network (those involved)")
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
        contents=["/faults", *(path("state", place.id) + "/**" for place in lanes(info)[:count])],
        name=name,
        time_view=_whole_run(info),
        defaults=[
            rr.StateConfiguration(values=list(STATE_COLOURS), colors=list(STATE_COLOURS.values())),
        ],
    )


def _whole_run(info: FieldInfo) -> rrb.TimeAxis:
    return rrb.TimeAxis(
        view_range=rr.TimeRange(
            start=rrb.TimeRangeBoundary.absolute(seconds=-info.origin_ns / NS),
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
