"""The static parts of a run's pictures: places, links and their reception, the style of what moves."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import rerun as rr

from launcher.records import BATTERY, SENSES, SLAVE, FieldInfo, Place
from launcher.timeline import look
from launcher.timeline.beyond import beyond, marks
from launcher.timeline.layers import READINGS, camera, closeup, clusters, heads, hearing, passes, truth
from launcher.timeline.scene import crosses, halves

Part = tuple[str, *tuple[rr.AsComponents, ...]]
"""An entity and what it is given."""


def parts(info: FieldInfo) -> Iterator[Part]:
    """All that is logged once, before the run."""
    yield from _field(info)
    yield from _network(info)
    if info.receptions:
        yield from _links(info)
    for name, (labels, colours) in look.SERIES.items():
        yield f"/plots/{name}", rr.SeriesLines(colors=colours, names=labels, widths=1.5)


def _field(info: FieldInfo) -> Iterator[Part]:
    dot = look.dot(info)
    yield "/field", rr.Transform3D(scale=[1, -1, 1])  # 2-D views point y down, north is up
    yield "/field/battery", look.point_style(None, dot + min(dot, 2.5), order=23)
    yield "/field/sensors", *_places(info.tagged(SENSES), dot, look.state_colour(look.REST), 24)
    yield "/field/working", look.point_style(None, max(dot, 2.5), order=28)
    yield "/field/dead", look.line_style(look.LOST, 2.0, order=29)
    moving = [id for id, _ in info.paths]
    alone, crowd = ([place for place in some if place.id not in moving] for some in look.others(info))
    yield "/field/centres", *_marks(marks(alone + beyond(info.places)), 8, look.CENTRE, 25)
    if crowd:
        yield "/field/masters", *_places(crowd, max(dot, 3.5), look.MASTER, 25)
    if moving:
        labels = rr.Points2D.from_fields(labels=moving, show_labels=True)
        yield "/field/moving", look.point_style(look.CENTRE, 8, order=25), labels
    for name in sorted(set(info.layers.values())):
        yield f"/field/{name}", READINGS[name].style
    yield from clusters.styles(info)
    yield from heads.styles(info)
    yield from hearing.styles(info)
    yield from passes.styles(info)
    yield from camera.styles(info)
    yield from truth.styles(info)
    yield from closeup.styles(info)
    yield from _legend(info)


def _legend(info: FieldInfo) -> Iterator[Part]:
    """What the colours of the sensors mean."""
    slaves = any(place.role == SLAVE for place in info.places)
    states = [look.REST, "active", "orphan"] if slaves else [look.REST, "awake", "reporting"]
    if heads.any_may_lead(info):
        states = [look.REST, "sensing", "active", heads.ELECTING, heads.LEADING]
    if hearing.ears(info):
        states = ["idle", "watching", hearing.LEADING]
    entries = [(name, look.state_colour(name)) for name in states] + [("dead", 0)]
    if ringed := bool(info.tagged(BATTERY)):
        entries.append(("battery low", look.state_colour(look.REST)))
    at = look.row_below(look.field_points(info), len(entries))
    names, colours = zip(*entries, strict=True)
    yield from look.legend("/field/legend", at, names, colours, -0.08 * (at[1][0] - at[0][0]), 4.5)
    size = 0.09 * (at[1][0] - at[0][0])
    cross = crosses(np.array(at[len(states) : len(states) + 1]), size)
    yield (
        "/field/legend/dead",
        look.line_style(look.LOST, 2.0, order=70),
        rr.LineStrips2D.from_fields(strips=list(cross)),
    )
    if ringed:
        ring = rr.Points2D.from_fields(positions=at[-1:])
        yield "/field/legend/battery", look.point_style(look.share_colour(0.25), 7.0, order=69), ring


def _network(info: FieldInfo) -> Iterator[Part]:
    directed = rr.GraphEdges.from_fields(graph_type="directed")
    if len(info.places) > look.WHOLE_NETWORK:
        yield "/network", rr.GraphNodes.from_fields(show_labels=True), directed
        return
    style = rr.GraphNodes.from_fields(show_labels=len(info.places) <= look.ALL_LANES, radii=10.0)
    at = look.graph_positions(info)
    names = rr.GraphNodes.from_fields(node_ids=list(at), positions=list(at.values()), labels=list(at))
    yield "/network", names, style, directed


def _links(info: FieldInfo) -> Iterator[Part]:
    shares = [share for *_, share in info.receptions]
    yield "/links", rr.Transform3D(scale=[1, -1, 1])
    yield (
        "/links/reception",
        rr.LineStrips2D(
            list(halves(info)),
            colors=np.array([look.share_colour(share) for share in shares], np.uint32),
            radii=rr.Radius.ui_points(0.8),
            labels=[f"{src} → {dst}: {share:.1%}" for src, dst, share in info.receptions],
            show_labels=False,
            draw_order=10,
        ),
    )
    yield "/links/sensors", *_places(info.tagged(SENSES), look.dot(info) / 1.5, look.TRUTH, 20)
    alone, crowd = look.others(info)
    yield "/links/centres", *_marks(marks(alone), 6, look.CENTRE, 25)
    if crowd:
        yield "/links/masters", *_places(crowd, look.dot(info), look.CENTRE, 24)
    yield "/links/frames", look.line_style(look.TARGET, 2.5, order=15)
    yield "/links/lost", look.point_style(look.LOST, 5.0, order=22)
    colours = [look.share_colour(share) for share in look.SHARES]
    at = look.beside_links(info)
    drop = 0.07 * (at[-1][1] - at[0][1])
    yield from look.legend("/links/legend", at, [f"{share:.0%}" for share in look.SHARES], colours, drop)


def _marks(marks: list[tuple[str, tuple[float, float]]], radius: float, colour: int, order: float) -> list[rr.Points2D]:
    return [
        rr.Points2D(
            [at for _, at in marks],
            radii=rr.Radius.ui_points(radius),
            colors=colour,
            draw_order=order,
            labels=[name for name, _ in marks],
            show_labels=True,
        )
    ]


def _places(places: list[Place], radius: float, colour: int, order: float) -> list[rr.Points2D]:
    return [
        rr.Points2D(
            [(place.x, place.y) for place in places],
            radii=rr.Radius.ui_points(radius),
            colors=colour,
            draw_order=order,
            labels=[place.id for place in places],
            show_labels=False,
        )
    ]
