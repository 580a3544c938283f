"""The views of what a camera sees, and of how it is told where to look."""

from __future__ import annotations

import rerun as rr
import rerun.blueprint as rrb

from launcher.records import FieldInfo
from launcher.timeline import look
from launcher.timeline.beyond import links
from trackfield.models.pointing import EVI_D30
from trackfield.role import NS


def video() -> rrb.Spatial2DView:
    """The latest frame, with the targets in it."""
    bounds = rrb.VisualBounds2D(x_range=(0.0, EVI_D30.width), y_range=(0.0, EVI_D30.height))
    return rrb.Spatial2DView(
        origin="/video", contents=["/video/**"], name="Camera", background=look.GROUND, visual_bounds=bounds
    )


def turning(info: FieldInfo) -> rrb.TimeSeriesView:
    """Both axes of the camera."""
    most = 1.1 * EVI_D30.pan
    return _plot(info, "turn", "Pan, tilt [deg]", rrb.ScalarAxis(range=(-most, most)))


def ways(info: FieldInfo) -> list[rrb.TimeSeriesView]:
    """How fixes got to camera control."""
    hops = [_plot(info, "hops", "Hops [ms]")] if links(info) else []
    return [_plot(info, "delay", "Delay of fixes [s]"), *hops, _plot(info, "gateway", "Gateway")]


def _plot(info: FieldInfo, what: str, name: str, axis: rrb.ScalarAxis | None = None) -> rrb.TimeSeriesView:
    return rrb.TimeSeriesView(
        origin=look.path("plots", what),
        name=name,
        axis_x=whole_run(info),
        axis_y=axis,
        plot_legend=rrb.PlotLegend(visible=True),
    )


def whole_run(info: FieldInfo) -> rrb.TimeAxis:
    """An axis from the start of a run to its end."""
    return rrb.TimeAxis(
        view_range=rr.TimeRange(
            start=rrb.TimeRangeBoundary.absolute(seconds=-info.origin_ns / NS),
            end=rrb.TimeRangeBoundary.absolute(seconds=info.end_s),
        )
    )
