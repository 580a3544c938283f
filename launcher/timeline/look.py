"""How what is drawn looks: entity paths, colours, styles, and where things stand."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from functools import lru_cache
from typing import Final

import numpy as np
import rerun as rr

from launcher.colours import tracker_colours
from launcher.records import SENSES, TRACKS, FieldInfo, Place
from launcher.timeline.beyond import WATCHED, beyond, within
from launcher.timeline.scene import spacing

TIME: Final = "emulated time"
"""The timeline of emulated time since the first step."""

Colour = int
"""0xRRGGBBAA."""

REST: Final = "asleep"
"""The state of nodes while nothing happens."""
DEAD: Final = "dead"
STATE_COLOURS: Final[dict[str, Colour]] = {
    REST: 0x6F7686FF,
    "awake": 0xDDE2ECFF,
    "reporting": 0x3DBE6CFF,
    "waiting": 0x606C88FF,
    "tracking": 0x3DBE6CFF,
    "coasting": 0xF2A93BFF,
    "active": 0x3DBE6CFF,
    "seeking": 0xDDE2ECFF,
    "orphan": 0xE258A0FF,
    "idle": 0x4A5061FF,
    "following": 0x606C88FF,
    "helping": 0x9C8452FF,
    "leading": 0xF2A93BFF,
    "sensing": 0xDDE2ECFF,
    "polled": 0x3DBE6CFF,
    "watching": 0xDDE2ECFF,
    "contending": 0xB48CF2FF,
    "gathering": 0x3DBE6CFF,
    "electing": 0xB48CF2FF,
    "sending": 0x3DBE6CFF,
    "ready": 0x606C88FF,
    "moving": 0x4FC0F0FF,
    "aiming": 0xF2A93BFF,
    "lost": 0xF2524BFF,
    "off": 0x4A5061FF,
    "running": 0x606C88FF,
    "stopped": 0xE258A0FF,
    DEAD: 0x8E2420FF,
}
OTHER_STATE: Final[Colour] = 0xAA78DCFF
CENTRE: Final[Colour] = 0xF2A93BFF
MASTER: Final[Colour] = 0x8C7B5AFF
HELPING: Final[Colour] = 0xC7A566FF
ELECTING: Final[Colour] = 0xB48CF2FF
POLLED: Final[Colour] = 0x4FA873FF
MEMBER: Final[Colour] = 0x4C556CFF
WAY: Final[Colour] = 0x2F6F9EFF
TRUTH: Final[Colour] = 0x969BA5FF
INTERPOLATED: Final[Colour] = 0xE258A0FF
TARGET: Final[Colour] = 0xFFFFFFFF
RAY: Final[Colour] = 0x4FC07AC8
RING: Final[Colour] = 0x4FC07A90
DISC: Final[Colour] = 0x2F7A4EFF
INFO: Final[Colour] = 0xC8CDD6FF
LATE: Final[Colour] = 0xF5B041FF
LOST: Final[Colour] = 0xF2524BFF
LEVELS: Final[dict[str, Colour]] = {"INFO": INFO, "WARN": LATE, "ERROR": LOST}
SERIES: Final[dict[str, tuple[list[str], list[Colour]]]] = {
    "error/bound": (["bound"], [0x969BA5FF]),
    "latency": (["median", "95 %"], [0x8C7BF0FF, 0x5B4FB0FF]),
    "lost": (["lost", "late"], [LOST, LATE]),
    "bytes": (["sent to receivers", "delivered"], [0x9A8F6AFF, 0xE6C65CFF]),
    "clock": (["rms", "largest"], [0x2BD4BDFF, 0x1F7F78FF]),
    "queue": (["longest"], [0xE68A5CFF]),
}
"""Names and colours of the lines of each plot."""
SHARES: Final = (1.0, 0.5, 0.0)
"""Shares of frames that arrive, in the legend of the links."""
_SHARES: Final[tuple[Colour, ...]] = (0xF2524BFF, 0xF5D041FF, 0x3DBE6CFF)

GROUND: Final = (14, 15, 20)
_GRAPH_SPACING: Final = (52.0, 42.0)
"""The spacing of a network, east and north: a little more than the box that is drawn around a name."""
LOW: Final = 0.2
"""A battery is shown once it has no more than this share left."""
FEW: Final = 6
"""Of more places without a sensor, those are small and without names of which there are many."""
LANES: Final = 7
"""Lanes that fit below the field."""
CROWD_LANES: Final = 3
"""So many of them are for places without a sensor that are one of many."""
ALL_LANES: Final = 200
"""The most lanes in the tab with all of them; a larger field is drawn without names of sensors."""
WHOLE_NETWORK: Final = 2000
"""Of a network of more places, only the active ones are drawn, without their positions: neighbours would be too close
to each other."""


def tracker_colour(info: FieldInfo, tracker: str) -> Colour:
    """The colour of a tracker's track, ellipse and error; an unknown tracker gets the next free colour."""
    return int(tracker_colours([*info.trackers, tracker])[tracker][1:], 16) << 8 | 0xFF


def track_names(info: FieldInfo, tracker: str) -> list[tuple[str, ...]]:
    """The names of a tracker's tracks in this field: one of those who take turns together, and one of each other."""
    names = (track_name(info, tracker, place.id) for place in info.tagged(TRACKS))
    return list(dict.fromkeys(names)) or [(tracker,)]


def track_name(info: FieldInfo, tracker: str, source: str) -> tuple[str, ...]:
    """The tracker, and the process if several track; those of a first view of several are one."""
    together = len(info.headline) > 1 and source in info.headline
    return (tracker,) if together or len(info.tagged(TRACKS)) <= 1 else (tracker, source)


def dimmed(colour: Colour) -> Colour:
    """The same, half as bright and translucent."""
    red, green, blue, _ = (part // 2 for part in colour.to_bytes(4))
    return int.from_bytes((red, green, blue, 0xA0))


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
    """An entity path of these parts, with special characters escaped."""
    return "/" + "/".join(rr.escape_entity_path_part(part) for part in parts)


def truth_path(target: str, part: str) -> str:
    """The entity of a part of a target's truth: ``path``, ``interpolated`` or ``position``."""
    return path("field", "truth", target, part)


def closeup_path(target: str, *parts: str) -> str:
    """The entity that stays with a target and, as its ``zoom``, is as wide as the close-up of it."""
    return path("closeup", target, *parts)


def line_style(colour: Colour, width: float, order: float) -> rr.LineStrips2D:
    """Lines of this width on screen; a higher order is drawn on top."""
    return rr.LineStrips2D.from_fields(colors=colour, radii=rr.Radius.ui_points(width / 2), draw_order=order)


def point_style(colour: Colour | None, radius: float, order: float) -> rr.Points2D:
    """Dots of this radius on screen, of one colour or each of its own; a higher order is drawn on top."""
    return rr.Points2D.from_fields(colors=colour, radii=rr.Radius.ui_points(radius), draw_order=order)


def disc_style(colour: Colour, order: float) -> rr.Points2D:
    """Discs of this colour, each as large as it is; a higher order is drawn on top."""
    return rr.Points2D.from_fields(colors=colour, draw_order=order)


def lanes(info: FieldInfo) -> list[Place]:
    """All places, those with the most interesting states first.

    These are places without a sensor, then the sensors in the order of how long a target is nearest to them. Of many
    places without a sensor those that are one of many stand in the same order, then by how near it comes, and only the
    first before the sensors. Camera control and camera come before them, too, what else is beyond a gateway after them.
    """
    sensors, alone, crowd = info.tagged(SENSES), *others(info)
    passed, rest = _passed(info, sensors)
    led, idle = _passed(info, crowd)
    led += sorted(idle, key=lambda place: _away(info, place))
    outside = beyond(info.places)
    seen = [place for place in outside if place.role in WATCHED]
    unseen = [place for place in outside if place.role not in WATCHED]
    return [*alone, *seen, *led[:CROWD_LANES], *passed, *led[CROWD_LANES:], *unseen, *rest]


def others(info: FieldInfo) -> tuple[list[Place], list[Place]]:
    """The places without a sensor; those of which there are too many to name each stand apart."""
    found = [place for place in within(info.places) if SENSES not in place.tags]
    if len(found) <= FEW:
        return found, []
    roles = Counter(place.role for place in found)
    alone = [place for place in found if roles[place.role] == 1]
    return alone, [place for place in found if roles[place.role] > 1]


def _away(info: FieldInfo, place: Place) -> float:
    """How near (m) a target comes to a place; 0 if there is none."""
    way = [point[1:] for truth in info.truths for point in truth.points]
    return float(np.hypot(*(np.array(way) - (place.x, place.y)).T).min()) if way else 0.0


def _passed(info: FieldInfo, places: list[Place]) -> tuple[list[Place], list[Place]]:
    """Those that a target is nearest to, for longest first; and the others."""
    way = [(x, y) for truth in info.truths for _, x, y in truth.points]
    if not places or not way:
        return [], places
    at = np.array([(place.x, place.y) for place in places])
    nearest = Counter(int(np.argmin(np.hypot(*(at - point).T))) for point in way[:: len(way) // 150 + 1])
    first = [places[index] for index, _ in nearest.most_common()]
    return first, [place for index, place in enumerate(places) if index not in nearest]


def graph_positions(info: FieldInfo) -> dict[str, tuple[float, float]]:
    """The position of each place in the network, sensors first: as in the field, but y down and scaled.

    The graph view draws a box of some 45 x 20 units around a name, so neighbours are a little further apart,
    and places without a sensor are drawn half a row further south, so that they do not cover sensors. What is beyond a
    gateway stands in a row below.
    """
    places = sorted(within(info.places), key=lambda place: SENSES not in place.tags)
    at = np.array([(place.x, -place.y) for place in places]) / spacing(info) * _GRAPH_SPACING
    south = [0.0 if SENSES in place.tags else _GRAPH_SPACING[1] / 2 for place in places]
    found = {place.id: (x, y + down) for place, (x, y), down in zip(places, at.tolist(), south, strict=True)}
    west, below = min(x for x, _ in found.values()), max(y for _, y in found.values()) + 1.5 * _GRAPH_SPACING[1]
    row = {place.id: (west + 2 * n * _GRAPH_SPACING[0], below) for n, place in enumerate(beyond(info.places))}
    return found | row


def field_points(info: FieldInfo) -> list[tuple[float, float]]:
    """All points of a field: places, paths of targets, and routes; of one that hears only what is near its places."""
    points = [(place.x, place.y) for place in info.places]
    way = [(x, y) for truth in info.truths for _, x, y in truth.points]
    points += _near(points, way) if info.hears else way
    return points + [(x, y) for _, legs in info.paths for _, x, y in legs]


def _near(places: Sequence[tuple[float, float]], way: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """The points of a way that are no farther from these places than half of their extent."""
    low, high = np.min(places, axis=0), np.max(places, axis=0)
    room = max(float((high - low).max()) / 2, 10.0)
    return [point for point in way if (point >= low - room).all() and (point <= high + room).all()]


def row_below(points: Sequence[tuple[float, float]], count: int) -> list[tuple[float, float]]:
    """Where the entries of a legend stand: in a row south of these points."""
    (west, south), (east, north) = np.min(points, axis=0), np.max(points, axis=0)
    step = max(float(east - west), 1.2 * float(north - south), 1.0) / 6
    middle = float(west + east) / 2
    return [(middle + (index - (count - 1) / 2) * step, float(south) - step / 2) for index in range(count)]


def beside_links(info: FieldInfo) -> list[tuple[float, float]]:
    """Where the legend of the links stands: in a column east of the places."""
    at = [(place.x, place.y) for place in info.places]
    (west, south), (east, north) = np.min(at, axis=0).tolist(), np.max(at, axis=0).tolist()
    high = max(north - south, (east - west) / 2, 10.0)
    return [(east + 0.3 * high, (south + north) / 2 + high * row) for row in (0.35, 0.0, -0.35)]


def legend(
    at: str,
    places: Sequence[tuple[float, float]],
    names: Sequence[str],
    colours: Sequence[Colour],
    drop: float,
    dot: float = 5.0,
) -> list[tuple[str, rr.Points2D]]:
    """Entities of a legend: a dot of its colour for each name, and the names, ``drop`` further up the y axis."""
    dots = rr.Points2D(places, colors=np.array(colours, np.uint32), radii=rr.Radius.ui_points(dot), draw_order=70)
    below = [(x, y + drop) for x, y in places]
    words = rr.Points2D(below, colors=INFO, radii=rr.Radius.ui_points(0), labels=names, show_labels=True)
    return [(at + "/dots", dots), (at + "/names", words)]
