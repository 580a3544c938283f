"""What is beyond a gateway: where a camera looks and was told to look, its frames, and how fixes got to it.

Frames and aims are known once a run is over; where a message on the backbone is, as the run goes on.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from math import cos, inf, radians, sin
from typing import Any, Final

import numpy as np
import rerun as rr

from launcher.filming.frames import Frame
from launcher.outside import Aim, Counts, Outside, Turn
from launcher.records import FieldInfo, MessageRow
from launcher.timeline import look, rows
from launcher.timeline.beyond import camera_of, chain, links
from launcher.timeline.look import path as entity
from launcher.timeline.scene import RASTER_NS, Add, Points, Shown, extent
from trackfield.models.pointing import EVI_D30, Direction, Mount
from trackfield.role import NS
from trackfield.wire.codec import WireError, decode
from trackfield.wire.outside import Carried, Item

LOG: Final = "/camera-log"
"""The entity of what happens to a camera, in words."""
IMAGE: Final = "/video/frame"
BOXES: Final = "/video/targets"
VIEW: Final = "/field/camera/view"
"""What the camera sees, on the map."""
AIM: Final = "/field/camera/aim"
"""From the camera to the point at which it was aimed, and a cross there."""
TOLD_NS: Final = 4 * NS
"""For so long after the instant for which the camera was aimed that is drawn."""
BACKBONE: Final = "/field/backbone/links"
ITEMS: Final = "/field/backbone/items"
CARRIED_NS: Final = NS
"""For so long an item is drawn on its way."""
ARC: Final = 12
"""The pieces of the arc of a view."""
CROSS_M: Final = 2.0
INSIDE: Final = 0x3DDC6EFF
OUTSIDE: Final = look.LOST
SIGHT: Final = 0x6FD3FFFF
TOLD: Final = 0xFFC857FF
WIRE: Final = 0xB48CF2FF
ALONG: Final = (0x4FC0F0FF, 0xB48CF2FF, 0x3DBE6CFF, 0xF2A93BFF, 0xE258A0FF, 0xC8CDD6FF)
"""Colours of the links of the way to camera control."""
TURNING: Final = {"pan": (SIGHT, TOLD), "tilt": (0x3C7F9EFF, 0x9A7A38FF)}
"""The colours of an axis: where it was, where it was told to be."""
GATEWAY: Final = {"waiting": 0xE68A5CFF, "dropped": look.LOST, "refused": look.LATE}


class Beyond:
    """Hands what is beyond a gateway to ``add``: items on their way as they come, the rest once the run is over.

    Of what is ``shown`` it draws the kind ``item``, (from, to) -> True while an item is under way. ``here`` says
    whether there is a camera.
    """

    def __init__(self, info: FieldInfo, shown: Shown, add: Add) -> None:
        self._shown, self._add = shown, add
        self.here = camera_of(info) is not None
        self._places = {place.id: (place.x, place.y) for place in info.places}
        self._links = links(info)
        self._reach_m = extent(info)
        self._end_ns = info.origin_ns + round(info.end_s * NS)

    # --- as the run goes on -------------------------------------------------------------------------------------------

    def message(self, row: MessageRow) -> None:
        """A frame reached its hearer: what matters is an item on its way to camera control."""
        link = row.src, row.dst
        if row.due_ns is None or not row.delivered or link not in self._links or not _item(row):
            return
        self._add(
            entity("plots", "hops", " → ".join(link)), rows.scalars, row.due_ns, ((row.due_ns - row.sent_ns) / 1e6,)
        )
        self._shown.show("item", link, True, row.due_ns, row.due_ns + CARRIED_NS)

    def draw(self, t_ns: int) -> int:
        """Draw the items on their way; how many points that took."""
        ends = [[self._places[end] for end in link] for link in sorted(self._shown.now["item"])]
        self._add(ITEMS, rows.strips, t_ns, np.reshape(ends, (-1, 2, 2)))
        return len(ends)

    # --- once it is over ----------------------------------------------------------------------------------------------

    def outside(self, outside: Outside) -> None:
        """All that was told of the camera."""
        self._turns(outside.mount, outside.turns)
        self._aims(outside)
        self._counts(outside.counts)
        for aim in outside.aims:
            self._add(entity("plots", "delay", "fixes"), rows.scalars, aim.t_ns, (aim.delay_s,))
            self._log(aim.t_ns, *_aimed(aim))
        for known in outside.states:
            self._log(known.t_ns, f"camera {known.state}", "WARN" if known.state in ("lost", "failed") else "INFO")
        for order in outside.orders:
            level = "INFO" if order.answer == "ok" else "WARN"
            self._log(order.t_ns, f"system control: {order.verb} {order.id}: {order.answer}", level)
        for refusal in outside.refusals:
            self._log(refusal.t_ns, f"{refusal.process} refuses an order of {refusal.sender}: {refusal.why}", "WARN")

    def frame(self, frame: Frame) -> None:
        """A frame, and the targets in it."""
        t_ns = frame.exposed.t_ns
        self._add(IMAGE, rows.images, t_ns, frame.jpeg)
        self._add(BOXES, rows.boxes, t_ns, [_box(one) for one in frame.framed])

    def _turns(self, mount: Mount, turns: Sequence[Turn]) -> None:
        """The view on the map and the curves of both axes, as often as the camera moves."""
        for number, turn in enumerate(turns):
            until_ns = turns[number + 1].t_ns if number + 1 < len(turns) else self._end_ns
            lasts_ns = min(turn.motion.lasts_s * NS, float(until_ns - turn.t_ns))
            moving = np.arange(0, lasts_ns, RASTER_NS).tolist() if lasts_ns < inf else [0.0]
            for after_ns in dict.fromkeys((0.0, *moving, lasts_ns)):
                looks = turn.motion.at(after_ns / NS)
                self._add(VIEW, rows.strips, turn.t_ns + round(after_ns), _view(mount, looks, self._reach_m))
                self._axes(0, turn.t_ns + round(after_ns), looks)
            if until_ns - turn.t_ns > lasts_ns + RASTER_NS:
                self._axes(0, until_ns - RASTER_NS // 2, turn.motion.at((until_ns - turn.t_ns) / NS))

    def _aims(self, outside: Outside) -> None:
        shots = outside.shots
        if shots:
            self._axes(1, max(self._end_ns, shots[-1].t_ns + 1), shots[-1].to)
        for number, aim in enumerate(shots):
            after_ns = shots[number + 1].t_ns if number + 1 < len(shots) else self._end_ns
            over_ns = min(max(aim.aim_ns, aim.t_ns) + TOLD_NS, after_ns)
            at = np.array([(outside.mount.x_m, outside.mount.y_m), (aim.aim_x_m, aim.aim_y_m)])
            self._add(AIM, rows.strips, aim.t_ns, np.array([at, *_cross(at[1])]))
            self._add(AIM, rows.strips, over_ns, np.empty((0, 2, 2)))
            self._axes(1, aim.t_ns, aim.to)

    def _axes(self, told: int, t_ns: int, looks: Direction) -> None:
        for axis, value in zip(TURNING, looks, strict=True):
            self._add(entity("plots", "turn", f"{axis}, told" if told else axis), rows.scalars, t_ns, (value,))

    def _counts(self, counts: Sequence[Counts]) -> None:
        """Curves with steps, and in words what does not get through."""
        for one in counts:
            self._add(entity("plots", "gateway"), rows.scalars, one.t_ns, _counted(one))
        if counts:
            self._add(entity("plots", "gateway"), rows.scalars, self._end_ns, _counted(counts[-1]))
        for before, one in pairwise(counts):
            for name in ("dropped", "refused", "unwanted"):
                if one.life == before.life and getattr(one, name) > getattr(before, name):
                    self._log(one.t_ns, f"gateway: {_OF_ITEMS[name]}", "WARN")

    def _log(self, t_ns: int, text: str, level: str = "INFO") -> None:
        self._add(LOG, rows.texts, t_ns, (text, level, look.LEVELS[level]))


_OF_ITEMS: Final = {
    "dropped": "the oldest item is dropped",
    "refused": "rules keep an item back",
    "unwanted": "nobody wants an item",
}


def styles(info: FieldInfo) -> Iterator[tuple[str, *tuple[rr.AsComponents, ...]]]:
    """How they look; nothing without a camera."""
    if camera_of(info) is None:
        return
    yield BACKBONE, rr.LineStrips2D(list(_dashes(info)), colors=WIRE, radii=rr.Radius.ui_points(0.8), draw_order=3.0)
    yield ITEMS, look.line_style(look.TARGET, 3.0, order=27)
    yield VIEW, look.line_style(SIGHT, 1.5, order=30)
    yield AIM, look.line_style(TOLD, 1.2, order=31)
    for axis, colours in TURNING.items():
        for name, colour in zip((axis, f"{axis}, told"), colours, strict=True):
            yield entity("plots", "turn", name), _curve([colour], [name], steps=name != axis)
    yield (
        entity("plots", "delay", "fixes"),
        rr.SeriesPoints(colors=TOLD, names="fix to camera control", marker_sizes=4.0),
    )
    yield entity("plots", "gateway"), _curve(list(GATEWAY.values()), list(GATEWAY), steps=True)
    for number, link in enumerate(links(info)):
        name = " → ".join(link)
        colour = ALONG[number % len(ALONG)]
        yield entity("plots", "hops", name), rr.SeriesPoints(colors=colour, names=name, marker_sizes=3.5)


def _curve(colours: list[int], names: list[str], *, steps: bool) -> rr.SeriesLines:
    """Curves that are drawn as they are, however dense their values."""
    mode = rr.components.InterpolationMode.StepAfter if steps else rr.components.InterpolationMode.Linear
    off = rr.components.AggregationPolicy.Off
    shown = np.array(colours, np.uint32)
    return rr.SeriesLines(colors=shown, names=names, widths=1.5, interpolation_mode=mode, aggregation_policy=off)


def _item(row: MessageRow) -> bool:
    """Whether a frame carries an item."""
    if row.kind != "carried":
        return row.kind == "item"
    try:
        carried = decode(row.payload)
        return isinstance(carried, Carried) and isinstance(decode(carried.message), Item)
    except WireError:
        return False


def _view(mount: Mount, looks: Direction, reach_m: float) -> Points:
    """The outline of what a camera sees of the ground, (1, ARC + 3, 2)."""
    middle, half = radians(mount.heading_deg - looks.pan), radians(EVI_D30.wide / 2)
    angles = np.linspace(middle - half, middle + half, ARC + 1)
    arc = [(mount.x_m + reach_m * cos(a), mount.y_m + reach_m * sin(a)) for a in angles.tolist()]
    here = (mount.x_m, mount.y_m)
    return np.array([[here, *arc, here]])


def _cross(at: Points) -> Points:
    strokes = np.array([[(-1.0, -1.0), (1.0, 1.0)], [(-1.0, 1.0), (1.0, -1.0)]])
    return np.asarray(at + CROSS_M * strokes)


def _dashes(info: FieldInfo) -> Iterator[Points]:
    """The backbone as dashed lines; what is nearer than a dash has none."""
    dash_m = max(extent(info) / 40, 0.1)
    for a, b in pairwise(chain(info)):
        start, end = np.array((a.x, a.y)), np.array((b.x, b.y))
        length = float(np.hypot(*(end - start)))
        for number in range(int(length / dash_m / 2)):
            yield start + (end - start) * np.array([[2 * number], [2 * number + 1]]) * dash_m / length


def _box(framed: Any) -> tuple[tuple[float, float, float, float], int, str]:
    colour = INSIDE if framed.inside else OUTSIDE
    return (framed.left, framed.top, framed.right, framed.bottom), colour, framed.target


def _aimed(aim: Aim) -> tuple[str, str]:
    """A fix in words, and their level."""
    fix = f"fix of {aim.head}, {aim.delay_s:.2f} s old"
    if not aim.shot:
        return f"{aim.outcome}: {fix}", "WARN" if aim.outcome in ("camera lost", "out of reach") else "INFO"
    return f"shot {aim.shot}: pan {aim.pan_deg:+.1f}°, tilt {aim.tilt_deg:+.1f}°, {fix}", "INFO"


def _counted(counts: Counts) -> tuple[float, ...]:
    return tuple(float(getattr(counts, name)) for name in GATEWAY)
