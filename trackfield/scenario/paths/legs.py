"""Paths of straight legs: positions over time."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Final

from pydantic import AfterValidator, Field, JsonValue

from trackfield.scenario.section import wrong

Leg = tuple[Annotated[float, Field(ge=0, le=1e9)], float, float]
"""(t_s, x_m, y_m)"""
LEGS: Final[dict[str, JsonValue]] = {"expected": "a list of at least two [t_s, x_m, y_m], with increasing times"}


def _increasing(points: tuple[Leg, ...] | None) -> tuple[Leg, ...] | None:
    if any(b[0] <= a[0] for a, b in pairwise(points or ())):
        raise wrong("its times do not increase", "increasing times")
    return points


Legs = Annotated[tuple[Leg, ...], Field(min_length=2), AfterValidator(_increasing)]
