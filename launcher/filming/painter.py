"""Draws frames: what a camera sees of targets that are somewhere, and where it looks."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cache
from math import hypot
from typing import Final, NamedTuple

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from launcher.filming.frames import Framed
from launcher.filming.lens import Array, Lens
from launcher.filming.scenery import DISTANCES_M, SENSOR_M, Colour, Scenery, background
from launcher.filming.vehicle import Vehicle, faces, framed

SCALE: Final = 2
"""Frames are drawn so many times as large and then made smaller, which makes edges smooth."""
PAINTS: Final[tuple[Colour, ...]] = ((206, 44, 38), (36, 96, 190), (232, 170, 30), (120, 60, 150), (230, 230, 230))
"""The colours of the targets, in their order."""
GRID: Final = (128, 150, 98)
TRAIL: Final = (176, 168, 128)
TREE: Final = (98, 128, 106)
STAND: Final = (64, 64, 70)
MICROPHONE: Final = (242, 169, 59)
INSIDE: Final = (61, 220, 110)
OUTSIDE: Final = (242, 82, 75)
WORDS: Final = (240, 244, 248)
NEARER_M: Final = 400.0
"""Targets that are farther away are not drawn: they are smaller than three pixels."""


class Picture(NamedTuple):
    """A drawn frame, and the targets in it."""

    image: Image.Image
    framed: tuple[Framed, ...]


def paint(lens: Lens, scenery: Scenery, vehicles: Sequence[Vehicle], trails: Sequence[Array], words: str) -> Picture:
    """A frame, with ``words`` at its lower edge.

    ``trails`` are where targets have been, each (n, 3) in metres.
    """
    large = background(lens, SCALE)
    draw = ImageDraw.Draw(large)
    for tree in scenery.trees:
        _fill(draw, lens.area(tree), TREE)
    _lines(draw, lens, scenery.starts, scenery.ends, GRID, 2)
    for trail in trails:
        _lines(draw, lens, trail[:-1], trail[1:], TRAIL, 4)
    names = list(_standing(draw, lens, scenery, vehicles))
    image = large.reduce(SCALE)
    _label(image, lens, names, words)
    found = (framed(vehicle, lens) for vehicle in vehicles if _away(lens, vehicle.x_m, vehicle.y_m) < NEARER_M)
    return Picture(image, tuple(one for one in found if one is not None))


def marked(picture: Picture) -> Image.Image:
    """The frame with a rectangle around each target: green if its middle is in the frame, red if not."""
    image = picture.image.copy()
    draw = ImageDraw.Draw(image)
    for one in picture.framed:
        around = (one.left - 3, one.top - 3, one.right + 3, one.bottom + 3)
        draw.rectangle(around, outline=INSIDE if one.inside else OUTSIDE, width=2)
    return image


def _standing(
    draw: ImageDraw.ImageDraw, lens: Lens, scenery: Scenery, vehicles: Sequence[Vehicle]
) -> Iterator[tuple[str, float, float]]:
    """Draw sensors and targets, the farthest first; yields the names of the sensors and where these are to stand."""
    standing = [(_away(lens, x, y), id, -1) for id, (x, y) in scenery.sensors.items()]
    standing += [(_away(lens, one.x_m, one.y_m), one.target, number) for number, one in enumerate(vehicles)]
    for away, id, number in sorted(standing, reverse=True):
        if number < 0:
            yield from _sensor(draw, lens, id, *scenery.sensors[id])
        elif away < NEARER_M:
            for area, colour in faces(vehicles[number], lens, PAINTS[number % len(PAINTS)]):
                _fill(draw, area, colour)


def _sensor(draw: ImageDraw.ImageDraw, lens: Lens, id: str, x: float, y: float) -> Iterator[tuple[str, float, float]]:
    """A stand with a microphone; its name and the place of that, if it is in the picture."""
    stand = lens.lines(np.array([(x, y, 0.0)]), np.array([(x, y, SENSOR_M)]))
    if not len(stand):
        return
    (foot, top), size = stand[0] * SCALE, lens.focal * SCALE / max(_away(lens, x, y), 1.0)
    draw.line([*foot, *top], STAND, max(round(0.05 * size), 2))
    radius = max(0.14 * size, 3.0)
    draw.ellipse((top[0] - radius, top[1] - radius, top[0] + radius, top[1] + radius), MICROPHONE, STAND, 1)
    yield id, top[0] / SCALE, (top[1] - radius) / SCALE


def _label(image: Image.Image, lens: Lens, names: Sequence[tuple[str, float, float]], words: str) -> None:
    """Names of sensors, marks of distances at the right edge, the middle of the frame, and words below."""
    draw, (width, height) = ImageDraw.Draw(image), image.size
    for name, u, v in names:
        draw.text((u, v - 2), name, WORDS, font(11), anchor="ms", stroke_width=1, stroke_fill=STAND)
    last = float(height - 26)
    for away in DISTANCES_M:
        row = lens.row(away)
        if row is not None and lens.horizon < row < last - 10:
            last = row
            draw.line([width - 10, row, width, row], WORDS, 1)
            draw.text((width - 13, row), f"{away} m", WORDS, font(10), anchor="rm", stroke_width=1, stroke_fill=STAND)
    u, v = width // 2, height // 2
    for stroke in ((u - 9, v, u - 3, v), (u + 3, v, u + 9, v), (u, v - 9, u, v - 3), (u, v + 3, u, v + 9)):
        draw.line(stroke, WORDS, 1)
    draw.rectangle((0, height - 22, width, height), (18, 20, 26))
    draw.text((8, height - 11), words, WORDS, font(13), anchor="lm")


@cache
def font(size: int) -> ImageFont.ImageFont | ImageFont.FreeTypeFont:
    """The font of all words, in this size (pixels)."""
    return ImageFont.load_default(size)


def _fill(draw: ImageDraw.ImageDraw, area: Array, colour: Colour) -> None:
    if len(area) >= 3:
        draw.polygon((area * SCALE).ravel().tolist(), colour)


def _lines(draw: ImageDraw.ImageDraw, lens: Lens, starts: Array, ends: Array, colour: Colour, width: int) -> None:
    for line in (lens.lines(starts, ends) * SCALE).reshape(-1, 4).tolist():
        draw.line(line, colour, width)


def _away(lens: Lens, x_m: float, y_m: float) -> float:
    return hypot(x_m - lens.mount.x_m, y_m - lens.mount.y_m)
