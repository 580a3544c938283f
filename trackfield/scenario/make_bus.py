"""Makes ``bus.gpx``, the ride of the packaged scenario ``bus``: ``python -m trackfield.scenario.make_bus``.

The streets are invented and lie in the open sea. A bus leaves a stop, drives around three corners, serves two
more stops and ends at the last; it brakes and accelerates within the limits that standing passengers can bear. A
receiver on board records a fix each second, with a slowly varying error.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from itertools import pairwise
from math import acos, ceil, cos, hypot, sin, sqrt, tan
from pathlib import Path
from typing import Final

import pymap3d

from trackfield.draw import normal

Point = tuple[float, float]

FILE: Final = Path(__file__).with_name("bus.gpx")
ORIGIN: Final = (45.0, -30.0)
"""Latitude and longitude in degrees: the middle of the North Atlantic."""
BEGIN: Final = datetime(2025, 3, 3, 8, 0, tzinfo=UTC)

STREETS: Final = ((0.0, 0.0), (130.0, 18.0), (144.0, 160.0), (274.0, 147.0), (296.0, 255.0))
"""Corners in metres east and north."""
LIMITS: Final = (11.0, 8.5, 13.0, 10.0)
"""The bus's speed limit in each street, m/s."""
STOPS: Final = ((0.0, 2.0), (215.0, 6.0), (385.0, 6.0), (1e9, 3.0))
"""Stops: metres along the way, seconds of waiting; the last is at the end."""

TURN_M: Final = 14.0
"""Radius of a corner."""
SIDEWAYS: Final = 1.5  # m/s^2 in a corner
SPEED_UP: Final = 1.1  # m/s^2
BRAKE: Final = 1.3  # m/s^2

NOISE_M: Final = 0.5
"""Standard deviation of a fix's error, east and north."""
NOISE_S: Final = 12
"""Seconds over which the error varies."""


def way() -> list[tuple[float, float, float]]:
    """(x, y, speed limit) every half metre, with round corners."""
    arcs = [_corner(*three) for three in zip(STREETS, STREETS[1:], STREETS[2:], strict=False)]
    begins = [STREETS[0], *(arc[-1] for arc in arcs)]
    ends = [*(arc[0] for arc in arcs), STREETS[-1]]
    points: list[tuple[float, float, float]] = []
    for limit, begin, end, arc in zip(LIMITS, begins, ends, [*arcs, []], strict=True):
        points += [(x, y, limit) for x, y in _straight(begin, end)]
        points += [(x, y, min(limit, sqrt(SIDEWAYS * TURN_M))) for x, y in arc[:-1]]
    return [*points, (*STREETS[-1], LIMITS[-1])]


def _straight(a: Point, b: Point) -> Iterator[Point]:
    """Half-metre points from ``a`` to just before ``b``."""
    n = ceil(2 * hypot(b[0] - a[0], b[1] - a[1]))
    return ((a[0] + (b[0] - a[0]) * k / n, a[1] + (b[1] - a[1]) * k / n) for k in range(n))


def _corner(a: Point, corner: Point, b: Point) -> list[Point]:
    """Half-metre points of the arc that touches both streets."""
    length_in, length_out = (
        hypot(corner[0] - a[0], corner[1] - a[1]),
        hypot(b[0] - corner[0], b[1] - corner[1]),
    )
    ux, uy = (corner[0] - a[0]) / length_in, (corner[1] - a[1]) / length_in
    wx, wy = (b[0] - corner[0]) / length_out, (b[1] - corner[1]) / length_out
    side = 1.0 if ux * wy - uy * wx > 0 else -1.0  # left or right
    turn = acos(ux * wx + uy * wy)
    back = TURN_M * tan(turn / 2)
    x, y = corner[0] - back * ux, corner[1] - back * uy
    n = ceil(2 * TURN_M * turn)
    angles = (turn * k / n for k in range(n + 1))
    return [
        (
            x + TURN_M * (sin(angle) * ux - side * (1 - cos(angle)) * uy),
            y + TURN_M * (sin(angle) * uy + side * (1 - cos(angle)) * ux),
        )
        for angle in angles
    ]


def ride() -> tuple[list[float], list[Point]]:
    """Times (s) and positions (m) of the bus along its way; a position is repeated at the end of a wait."""
    points = way()
    steps = [hypot(b[0] - a[0], b[1] - a[1]) for a, b in pairwise(points)]
    along = [0.0]
    for step in steps:
        along.append(along[-1] + step)
    waits = {min(bisect_right(along, at), len(along) - 1): wait for at, wait in STOPS[1:]} | {0: STOPS[0][1]}
    speed = [0.0 if i in waits else limit for i, (_, _, limit) in enumerate(points)]
    for i in range(len(steps)):
        speed[i + 1] = min(speed[i + 1], sqrt(speed[i] ** 2 + 2 * SPEED_UP * steps[i]))
    for i in reversed(range(len(steps))):
        speed[i] = min(speed[i], sqrt(speed[i + 1] ** 2 + 2 * BRAKE * steps[i]))
    times, places, now = [], [], 0.0
    for i, (x, y, _) in enumerate(points):
        if i:
            now += 2 * steps[i - 1] / (speed[i - 1] + speed[i])
        times.append(now)
        places.append((x, y))
        if i in waits:
            now += waits[i]
            times.append(now)
            places.append((x, y))
    return times, places


def fixes() -> list[tuple[datetime, float, float]]:
    """(time, latitude, longitude) once a second."""
    times, places = ride()
    found = []
    for second in range(int(times[-1]) + 1):
        i = min(bisect_right(times, second), len(times) - 1)
        share = (second - times[i - 1]) / (times[i] - times[i - 1])
        x, y = (
            a + share * (b - a) + _error(axis, second)
            for axis, a, b in zip(("east", "north"), places[i - 1], places[i], strict=True)
        )
        lat, lon, _ = pymap3d.enu2geodetic(x, y, 0.0, *ORIGIN, 0.0)
        found.append((BEGIN + timedelta(seconds=second), float(lat), float(lon)))
    return found


def _error(axis: str, second: int) -> float:
    """The receiver's error in metres: a moving average of keyed draws, so that consecutive seconds are correlated."""
    draws = (normal(0, "bus", 0, axis, k) for k in range(second, second + NOISE_S))
    return NOISE_M * sum(draws) / sqrt(NOISE_S)


def gpx() -> str:
    """The ride as a GPX 1.1 file; seven decimals of a degree are a centimetre."""
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        '<gpx xmlns="http://www.topografix.com/GPX/1/1" version="1.1" creator="Trackfield make_bus">',
        "  <trk>",
        "    <name>A bus ride through streets that do not exist</name>",
        "    <trkseg>",
    ]
    for when, lat, lon in fixes():
        time = f"{when:%Y-%m-%dT%H:%M:%SZ}"
        lines.append(f'      <trkpt lat="{lat:.7f}" lon="{lon:.7f}"><time>{time}</time></trkpt>')
    return "\n".join([*lines, "    </trkseg>", "  </trk>", "</gpx>", ""])


if __name__ == "__main__":
    FILE.write_text(gpx(), encoding="utf-8")
