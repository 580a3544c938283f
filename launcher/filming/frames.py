"""Frames, as they are handed on to those who show them."""

from __future__ import annotations

from typing import NamedTuple

from launcher.outside import Exposure
from trackfield.models.pointing import Direction


class Framed(NamedTuple):
    """A target in a frame: the rectangle around it (pixels from the left and the top), cut to the frame.

    ``inside`` says whether its middle is in the frame.
    """

    target: str
    left: float
    top: float
    right: float
    bottom: float
    inside: bool


class Frame(NamedTuple):
    """A frame as a JPEG file, where the camera looked, and the targets in it."""

    exposed: Exposure
    look: Direction
    jpeg: bytes
    framed: tuple[Framed, ...]
