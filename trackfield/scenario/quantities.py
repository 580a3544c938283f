"""The numbers of a scenario: each quantity with the range in which it makes sense, and in which all sums stay finite.

No length, time or power of a field is beyond these; a number that is, is a mistake in its unit.
"""

from __future__ import annotations

from typing import Annotated, Final

from pydantic import AfterValidator, Field

from trackfield.files import FAR_M, LONG_S, SLOW_MS
from trackfield.scenario.section import wrong

SHORT_S: Final = 0.001
"""The shortest time that makes a difference: every frame takes it."""
MOST_SEED: Final = 2**63 - 1
"""The largest whole number that TOML and tables can hold."""
MOST_NODES: Final = 200_000
"""The largest number of places; more are taken for a mistake in the units."""

_TINY: Final = 1e-9


def _exact(value: float) -> float:
    """The number itself, 0 for -0. Raises an error for one that is nearly 0, whose square is 0."""
    if 0 < abs(value) < _TINY:
        raise wrong(f"is {value:g}", f"0, or a number that is not within {_TINY:g} of it")
    return value + 0.0


Exact: Final = AfterValidator(_exact)

Coordinate = Annotated[float, Field(ge=-FAR_M, le=FAR_M), Exact]
"""Metres east or north."""
Length = Annotated[float, Field(ge=0, le=FAR_M), Exact]
"""Metres, or none."""
Distance = Annotated[float, Field(ge=0.001, le=FAR_M)]
"""Metres between two things that are apart."""
Speed = Annotated[float, Field(ge=0.001, le=100_000)]
"""m/s, above 0."""
Acceleration = Annotated[float, Field(ge=0, le=10_000), Exact]
"""m/s^2"""
Instant = Annotated[float, Field(ge=0, le=LONG_S), Exact]
"""Seconds from the first step on."""
LaterInstant = Annotated[float, Field(ge=SHORT_S, le=LONG_S)]
"""Seconds after the first step."""
Duration = Annotated[float, Field(ge=SHORT_S, le=LONG_S)]
"""Seconds."""
Delay = Annotated[float, Field(ge=1, le=SLOW_MS)]
"""Milliseconds from sending to arrival, at most an hour."""
Jitter = Annotated[float, Field(ge=0, le=SLOW_MS), Exact]
"""Milliseconds, at most an hour."""
Share = Annotated[float, Field(ge=0, le=1), Exact]
"""A probability, or a part of a whole."""
SomeShare = Annotated[float, Field(ge=0.000_001, le=1)]
"""A part of a whole that is not empty."""
Joules = Annotated[float, Field(ge=0.000_001, le=1e9)]
"""The charge of a battery."""
Millijoules = Annotated[float, Field(ge=0, le=1e9), Exact]
"""The energy of one act."""
Number = Annotated[float, Field(ge=-1e15, le=1e15), Exact]
"""A number in whatever unit a kind of sensing has."""
Seed = Annotated[int, Field(ge=0, le=MOST_SEED)]
"""The seed of random draws."""
Nodes = Annotated[int, Field(ge=1, le=MOST_NODES)]
"""A number of sensors."""
Option = bool | Annotated[int, Field(ge=-(10**15), le=10**15)] | Annotated[float, Field(ge=-1e15, le=1e15)] | Annotated[
    str, Field(max_length=1000)
]  # fmt: skip
"""An option of a tracker or a sensor; its class checks it further."""
