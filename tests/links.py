"""What the tests of links have in common: places, and how far a right answer may be from what is expected."""

from __future__ import annotations

from math import log, sqrt
from pathlib import Path
from typing import Any, Final

from trackfield.link import make_link
from trackfield.link.lognormal_prr import LognormalPrr
from trackfield.link.places import Places

US: Final = 1_000
MS: Final = 1_000_000
S: Final = 1_000_000_000
SURE: Final = 1e-6
"""A right answer fails a statistical test with this probability, once and for all, as the draws do not change."""

PLACES: Final = {"n1": (0.0, 0.0), "n2": (70.0, 0.0), "n10": (0.0, 85.0), "fusion": (50.0, 50.0)}
TRACE: Final = {"model": "trace", "file": str(Path(__file__).with_name("trace.csv"))}


def likely(count: int, distribution: Any) -> bool:
    return bool(distribution.ppf(SURE / 2) <= count <= distribution.isf(SURE / 2))


def within(n: int) -> float:
    """How far the mean of n values from [0, 1] may be from its expectation (Hoeffding)."""
    return sqrt(log(2 / SURE) / (2 * n))


def ring(distance_m: float, n: int) -> dict[str, tuple[float, float]]:
    """A centre, and n nodes that far from it."""
    return {"fusion": (0.0, 0.0)} | {f"n{i}": (distance_m, 0.0) for i in range(n)}


def radio_link(places: Places = PLACES, seed: int = 1, **keys: Any) -> LognormalPrr:
    link = make_link({"model": "lognormal_prr", **keys}, seed, places)
    assert isinstance(link, LognormalPrr)
    return link
