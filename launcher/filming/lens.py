"""The picture of a camera as a projection of many points at once, and what of lines and areas is in it.

The same pinhole as ``trackfield.models.pointing.project``. Points before the camera are (right, up, depth) in metres.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import cos, radians, sin, tan
from typing import Final

import numpy as np
from numpy.typing import NDArray

from trackfield.models.pointing import EVI_D30, Direction, Mount, Optics

Array = NDArray[np.float64]
NEAR_M: Final = 0.1
"""Nothing nearer than this is drawn."""
BEYOND: Final = 1.2
"""Lines and areas are cut where they are so many times as far out as the edge of the picture."""


@dataclass(frozen=True)
class Lens:
    """A camera that looks somewhere, with this zoom."""

    mount: Mount
    look: Direction
    optics: Optics = EVI_D30
    zoom: float = 1.0

    @property
    def focal(self) -> float:
        """The focal length in pixels."""
        return self.zoom * self.optics.width / 2 / tan(radians(self.optics.wide / 2))

    @property
    def horizon(self) -> float:
        """The row at which the horizon is, from the top; a line across the picture, as a camera does not roll."""
        return self.optics.height / 2 + self.focal * tan(radians(self.look.tilt))

    def row(self, depth_m: float) -> float | None:
        """The row of the ground that is so far away in the middle of the picture; None if that is behind the camera."""
        tilt = radians(self.look.tilt)
        depth = depth_m * cos(tilt) - self.mount.z_m * sin(tilt)
        up = -self.mount.z_m * cos(tilt) - depth_m * sin(tilt)
        return None if depth < NEAR_M else self.optics.height / 2 - self.focal * up / depth

    def seen(self, points: Array) -> Array:
        """Points (n, 3) east, north, up from the camera: (n, 3) right, up, depth."""
        return np.asarray((points - (self.mount.x_m, self.mount.y_m, self.mount.z_m)) @ self._turned.T)

    def pixels(self, seen: Array) -> Array:
        """Where points before the camera (n, 3) are in the picture, (n, 2) from its left and top."""
        scaled = self.focal * seen[:, :2] / seen[:, 2:]
        return np.asarray(scaled * (1.0, -1.0) + (self.optics.width / 2, self.optics.height / 2))

    def lines(self, starts: Array, ends: Array) -> Array:
        """What is in the picture of lines between points (n, 3) each: (m, 2, 2) pixels."""
        a, b = self.seen(starts), self.seen(ends)
        from_a, from_b = self._inside(a), self._inside(b)
        shown = ~((from_a < 0) & (from_b < 0)).any(axis=1)
        a, b, from_a, from_b = a[shown], b[shown], from_a[shown], from_b[shown]
        with np.errstate(divide="ignore", invalid="ignore"):
            crossed = from_a / (from_a - from_b)
        first = np.where(from_a < 0, crossed, 0.0).max(axis=1, initial=0.0)[:, None]
        last = np.where(from_b < 0, crossed, 1.0).min(axis=1, initial=1.0)[:, None]
        cut = np.stack((a + first * (b - a), a + last * (b - a)), axis=1)[(first < last)[:, 0]]
        return self.pixels(cut.reshape(-1, 3)).reshape(-1, 2, 2)

    def area(self, corners: Array) -> Array:
        """What is in the picture of an area with these corners (n, 3) in a plane: (m, 2) pixels; m may be 0."""
        seen = self.seen(corners)
        outside = self._inside(seen) < 0
        if outside.all(axis=0).any():
            return np.empty((0, 2))
        for plane in np.flatnonzero(outside.any(axis=0)):
            seen = _cut(seen, self._inside(seen)[:, plane])
            if not len(seen):
                return np.empty((0, 2))
        return self.pixels(seen)

    @cached_property
    def _turned(self) -> Array:
        """The directions right, up and ahead of the camera, a row each."""
        yaw, tilt = radians(self.mount.heading_deg - self.look.pan), radians(self.look.tilt)
        c, s = cos(tilt), sin(tilt)
        return np.array(
            [(sin(yaw), -cos(yaw), 0.0), (-s * cos(yaw), -s * sin(yaw), c), (c * cos(yaw), c * sin(yaw), s)]
        )

    @cached_property
    def _planes(self) -> tuple[Array, Array]:
        """Planes around what is drawn, by their normals (5, 3) and offsets (5,): positive inside."""
        wide, high = (BEYOND * size / 2 / self.focal for size in (self.optics.width, self.optics.height))
        normals = [(0.0, 0.0, 1.0), (-1.0, 0.0, wide), (1.0, 0.0, wide), (0.0, -1.0, high), (0.0, 1.0, high)]
        return np.array(normals), np.array([-NEAR_M, 0.0, 0.0, 0.0, 0.0])

    def _inside(self, seen: Array) -> Array:
        """How far points (n, 3) are on the inside of each plane, (n, 5)."""
        normals, offsets = self._planes
        return np.asarray(seen @ normals.T + offsets)


def _cut(corners: Array, inside: Array) -> Array:
    """The part of an area that is on the inside of a plane; ``inside`` (n,) is how far each corner is."""
    kept: list[Array] = []
    for number in range(len(corners)):
        before, here = inside[number - 1], inside[number]
        if (before < 0) != (here < 0):
            share = before / (before - here)
            kept.append(corners[number - 1] + share * (corners[number] - corners[number - 1]))
        if here >= 0:
            kept.append(corners[number])
    return np.array(kept).reshape(-1, 3)
