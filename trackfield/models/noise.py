"""Noise that is not drawn anew for every reading."""

from __future__ import annotations

from typing import NamedTuple


class Colour(NamedTuple):
    """What the variance of a reading's noise is made of; the rest is drawn for every reading.

    ``slow`` is the share that changes slowly: of it, readings have the less in common the farther they are apart in
    time, and nothing from twice ``slow_s`` seconds on. ``fixed`` is the share that is drawn once for each sensor.
    """

    slow: float = 0.0
    slow_s: float = 10.0
    fixed: float = 0.0
