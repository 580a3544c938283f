"""What stands around a camera, besides targets: sky and ground, a grid on it, trees far away, sensors."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from math import cos, pi, sin
from typing import Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from launcher.filming.lens import Array, Lens
from trackfield.models.pointing import Mount

Colour = tuple[int, int, int]
Band = NDArray[np.uint8]

GRID_M: Final = 10.0
"""How far lines on the ground are apart."""
GRID_TO_M: Final = 120.0
"""How far from the camera they reach."""
DISTANCES_M: Final = (5, 10, 20, 30, 50, 100)
"""Distances that are marked at the edge of a frame."""
SENSOR_M: Final = 1.2
"""The height of a sensor on its stand."""
TREES: Final = 120
"""The number of trees around."""
_ZENITH: Final = (96, 146, 208)
_HAZE: Final = (196, 216, 234)
_FAR: Final = (126, 146, 96)
_NEAR: Final = (92, 118, 62)
_PALE_ROWS: Final = 260.0
"""So many rows from the horizon colours are as above and below a frame."""


@cache
def bands(height: int) -> Band:
    """The colours (rows, 3) of sky and ground by their row: the horizon is at half of them."""
    rows = np.arange(-4 * height, 4 * height)[:, None] + 0.5
    share = np.sqrt(np.minimum(np.abs(rows) / (_PALE_ROWS * height / 480), 1.0))
    above = np.array(_HAZE) + share * (np.array(_ZENITH) - _HAZE)
    below = np.array(_FAR) + share * (np.array(_NEAR) - _FAR)
    colours: Band = np.where(rows < 0, above, below).round().astype(np.uint8)
    return colours


def background(lens: Lens, scale: int) -> Image.Image:
    """Sky and ground of a frame that is drawn ``scale`` times as large."""
    width, height = lens.optics.width * scale, lens.optics.height * scale
    table = bands(height)
    horizon = round(min(max(lens.horizon * scale, -3.0 * height), 4.0 * height))
    rows = table[len(table) // 2 - horizon :][:height]
    return Image.fromarray(np.ascontiguousarray(rows[:, None])).resize((width, height), Image.Resampling.NEAREST)


@dataclass(frozen=True)
class Scenery:
    """What stands around a camera: starts and ends (n, 3) of the lines on the ground, trees, sensors by id."""

    starts: Array
    ends: Array
    trees: Array
    sensors: Mapping[str, tuple[float, float]]

    @classmethod
    def around(cls, mount: Mount, sensors: Mapping[str, tuple[float, float]]) -> Scenery:
        """That of a camera which stands there."""
        starts, ends = _grid(mount)
        return cls(starts, ends, _trees(mount), dict(sensors))


def _grid(mount: Mount) -> tuple[Array, Array]:
    """Lines on the ground in both directions, at multiples of their distance, each in a circle around the camera."""
    found = []
    for along, (at, across) in enumerate(((mount.x_m, mount.y_m), (mount.y_m, mount.x_m))):
        for number in range(int((at - GRID_TO_M) // GRID_M) + 1, int((at + GRID_TO_M) // GRID_M) + 1):
            line = number * GRID_M
            half = max(GRID_TO_M**2 - (line - at) ** 2, 0.0) ** 0.5
            ends = [(line, across - half), (line, across + half)]
            found.append([(*(end if along == 0 else end[::-1]), 0.0) for end in ends])
    lines = np.array(found)
    return lines[:, 0], lines[:, 1]


def _trees(mount: Mount) -> Array:
    """Trees (n, 3, 3) as triangles that face the camera, the farthest first; the same at every camera."""
    found = []
    for number in range(TREES):
        angle = 2 * pi * (number + 0.45 * sin(17.0 * number)) / TREES
        away, high = 230.0 + 60.0 * sin(5.3 * number + 1.0), 9.0 + 3.5 * sin(2.9 * number)
        x, y, half = mount.x_m + away * cos(angle), mount.y_m + away * sin(angle), 0.33 * high
        right = np.array([sin(angle), -cos(angle), 0.0]) * half
        foot = np.array([x, y, 0.0])
        found.append((away, np.array([foot - right, foot + right, [x, y, high]])))
    return np.array([corners for _, corners in sorted(found, key=lambda one: -one[0])])
