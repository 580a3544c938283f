"""Building blocks of all pages: tables, bars, formatted figures, lists of ids."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

NOTHING: Final = "–"
MOST_IDS: Final = 6


@dataclass(frozen=True)
class Table:
    """Rows under a head; the first column is text, the others are figures."""

    head: Sequence[str]
    rows: Sequence[Sequence[str]]


@dataclass(frozen=True)
class Bar:
    """A line of a bar chart: ``share`` of the longest (0 to 1), its colour, and what it means."""

    label: str
    value: str
    share: float
    colour: str
    meaning: str = ""


def number(value: float | None, unit: str = "") -> str:
    """A figure to about three digits; a dash for none."""
    if value is None or not np.isfinite(value):
        return NOTHING
    size = abs(value)
    if isinstance(value, int) or size >= 100:
        text = f"{value:,.0f}"
    else:
        text = f"{value:.1f}" if size >= 10 else f"{value:.2f}" if size >= 1 or not size else f"{value:.3g}"
    return f"{text} {unit}".rstrip()


def percent(share: float) -> str:
    """A share (0 to 1) to a tenth of a percent; ``< 0.1 %`` and ``> 99.9 %`` if it is not quite 0 or 1."""
    if 0 < share < 0.0005:
        return "< 0.1 %"
    return "> 99.9 %" if 0.9995 <= share < 1 else f"{100 * share:.1f} %"


def ids(names: Iterable[str]) -> str:
    """The first few, and how many there are."""
    known = list(names)
    more = f" and {len(known) - MOST_IDS} more" if len(known) > MOST_IDS else ""
    return ", ".join(known[:MOST_IDS]) + more
