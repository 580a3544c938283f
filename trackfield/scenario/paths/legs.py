"""Paths of straight legs: positions over time."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Final

from pydantic import AfterValidator, Field, JsonValue

from trackfield.scenario.quantities import SHORT_S, Coordinate, Instant
from trackfield.scenario.section import wrong

Leg = tuple[Instant, Coordinate, Coordinate]
"""(t_s, x_m, y_m)"""
MOST_POINTS: Final = 100_000
LEGS: Final[dict[str, JsonValue]] = {
    "expected": "a list of at least two [t_s, x_m, y_m], with increasing times, up to 1e9 s and 1e7 m"
}


def _increasing(points: tuple[Leg, ...] | None) -> tuple[Leg, ...] | None:
    for a, b in pairwise(points or ()):
        if round(b[0] - a[0], 9) < SHORT_S:
            what = f"its times do not increase ({b[0]:g} s follows {a[0]:g} s)"
            raise wrong(what, f"increasing times, {SHORT_S:g} s apart or more")
    return points


Legs = Annotated[tuple[Leg, ...], Field(min_length=2, max_length=MOST_POINTS), AfterValidator(_increasing)]
