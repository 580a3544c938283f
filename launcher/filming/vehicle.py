"""A vehicle as a solid: its faces, its shadow, and the rectangle around it in a picture."""

from __future__ import annotations

from collections.abc import Iterator
from math import atan2, cos, hypot, radians, sin
from typing import Final, NamedTuple

import numpy as np

from launcher.filming.frames import Framed
from launcher.filming.lens import Array, Lens
from trackfield.models.pointing import in_view

LONG_M: Final = 4.5
WIDE_M: Final = 1.8
HIGH_M: Final = 1.5
"""The size of a vehicle."""
SUN: Final = np.array([-0.45, -0.6, 0.66])
"""Where light comes from, as a direction of length 1: from the south-west, 41 degrees high."""
Colour = tuple[int, int, int]
SHADE: Final = 0.55
"""How bright a face is that turns away from the sun, of one that faces it."""

_CORNERS: Final = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (0, 1)], float)
_FACES: Final = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (1, 5, 7, 3), (0, 2, 6, 4))
"""Of a box: back, front, right, left, top, bottom, each as four of its corners, around it."""
_NORMALS: Final = np.array([(-1, 0, 0), (1, 0, 0), (0, -1, 0), (0, 1, 0), (0, 0, 1), (0, 0, -1)], float)


class Vehicle(NamedTuple):
    """A target at an instant: where it is (m), and where it heads, in radians anticlockwise from east."""

    target: str
    x_m: float
    y_m: float
    heading: float

    @classmethod
    def of(cls, target: str, state: tuple[float, float, float, float]) -> Vehicle:
        """One with this x, y (m), vx, vy (m/s); one that stands heads east."""
        x, y, vx, vy = state
        return cls(target, x, y, atan2(vy, vx) if hypot(vx, vy) > 1e-9 else 0.0)

    def placed(self, points: Array) -> Array:
        """Points (n, 3) ahead, left and up of the middle of its underside (m): where they are, (n, 3)."""
        c, s = cos(self.heading), sin(self.heading)
        return np.asarray(points @ np.array([(c, s, 0.0), (-s, c, 0.0), (0.0, 0.0, 1.0)]) + (self.x_m, self.y_m, 0.0))

    @property
    def corners(self) -> Array:
        """The corners (8, 3) of the box around it."""
        return self.placed(_CORNERS * (LONG_M / 2, WIDE_M / 2, HIGH_M))


class Part(NamedTuple):
    """A part of a vehicle, a box that narrows upwards: from where to where ahead, at its underside and at its top."""

    below: tuple[float, float]
    above: tuple[float, float]
    low_m: float
    high_m: float
    narrow: float
    glass: bool = False

    def corners(self) -> Array:
        """Its corners (8, 3) ahead, left and up (m), in the order of ``_CORNERS``."""
        found = _CORNERS.copy()
        top = _CORNERS[:, 2] > 0
        for ends, high, side, z in (
            (self.below, ~top, WIDE_M / 2, self.low_m),
            (self.above, top, self.narrow, self.high_m),
        ):
            found[high, 0] = np.where(_CORNERS[high, 0] < 0, *ends)
            found[high, 1] *= side
            found[high, 2] = z
        return found


PARTS: Final = (
    Part((-LONG_M / 2, LONG_M / 2), (-LONG_M / 2, LONG_M / 2), 0.22, 0.85, WIDE_M / 2),
    Part((-1.9, 1.0), (-1.45, 0.35), 0.85, HIGH_M, 0.72, glass=True),
)
"""Body and cabin; the whole is as large as the box around it."""
_WHEELS: Final = tuple((ahead, aside) for ahead in (-1.4, 1.4) for aside in (-WIDE_M / 2, WIDE_M / 2))
_WHEEL_M: Final = 0.33
_ROUND: Final = np.array([(cos(a), 0.0, sin(a)) for a in np.linspace(0.0, radians(330.0), 12)])


def faces(vehicle: Vehicle, lens: Lens, colour: Colour) -> Iterator[tuple[Array, Colour]]:
    """The areas (n, 2) of a vehicle in the picture, those behind first, each with its colour; first its shadow."""
    yield lens.area(_shadow(vehicle)), (52, 66, 38)
    eye = np.array([lens.mount.x_m, lens.mount.y_m, lens.mount.z_m])
    parts = PARTS if eye[2] > PARTS[0].high_m else PARTS[::-1]
    for part in parts:
        yield from _box(vehicle, part, lens, eye, colour)
        if not part.glass:
            yield from _wheels(vehicle, lens, eye)


def framed(vehicle: Vehicle, lens: Lens) -> Framed | None:
    """The rectangle around the box of a vehicle; None if nothing of it is in the picture."""
    corners, size = vehicle.corners, (lens.optics.width, lens.optics.height)
    areas = [lens.area(corners[list(face)]) for face in _FACES]
    seen = np.concatenate(areas)
    if not len(seen):
        return None
    left, top = np.clip(seen.min(axis=0), 0, size).tolist()
    right, bottom = np.clip(seen.max(axis=0), 0, size).tolist()
    if left >= right or top >= bottom:
        return None
    inside = in_view(lens.mount, lens.look, vehicle.x_m, vehicle.y_m, optics=lens.optics)
    return Framed(vehicle.target, left, top, right, bottom, inside)


def _box(vehicle: Vehicle, part: Part, lens: Lens, eye: Array, colour: Colour) -> Iterator[tuple[Array, Colour]]:
    local = part.corners()
    placed = vehicle.placed(local)
    turn = Vehicle("", 0.0, 0.0, vehicle.heading)
    for face, normal in zip(_FACES, turn.placed(_NORMALS), strict=True):
        corners = placed[list(face)]
        if (eye - corners.mean(axis=0)) @ normal <= 0:
            continue
        glass = part.glass and abs(normal[2]) < 0.5
        yield lens.area(corners), _lit((46, 60, 74) if glass else colour, float(normal @ SUN))


def _wheels(vehicle: Vehicle, lens: Lens, eye: Array) -> Iterator[tuple[Array, Colour]]:
    aside = vehicle.placed(np.array([(0.0, 1.0, 0.0)]))[0] - (vehicle.x_m, vehicle.y_m, 0.0)
    to_left = (eye - (vehicle.x_m, vehicle.y_m, 0.0)) @ aside > 0
    for ahead, side in _WHEELS:
        if (side > 0) == to_left:
            yield lens.area(vehicle.placed(_ROUND * _WHEEL_M + (ahead, side, _WHEEL_M))), (24, 24, 27)
            yield lens.area(vehicle.placed(_ROUND * _WHEEL_M * 0.5 + (ahead, side, _WHEEL_M))), (128, 130, 134)


def _shadow(vehicle: Vehicle) -> Array:
    """The corners of the shadow of the box on the ground, around it."""
    along = -SUN / SUN[2]
    corners = vehicle.corners
    ground = corners + corners[:, 2:] * along
    return _hull(ground)


def _hull(points: Array) -> Array:
    """The corners around points (n, 3) on the ground."""
    ordered = sorted({(round(x, 9), round(y, 9)) for x, y, _ in points.tolist()})

    def half(some: list[tuple[float, float]]) -> list[tuple[float, float]]:
        found: list[tuple[float, float]] = []
        for point in some:
            while len(found) >= 2 and _turns(found[-2], found[-1], point) <= 0:
                found.pop()
            found.append(point)
        return found[:-1]

    return np.array([(x, y, 0.0) for x, y in (*half(ordered), *half(ordered[::-1]))])


def _turns(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def _lit(colour: Colour, sun: float) -> Colour:
    share = SHADE + (1 - SHADE) * max(sun, 0.0)
    red, green, blue = (round(part * share) for part in colour)
    return red, green, blue
