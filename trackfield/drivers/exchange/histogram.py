"""Durations counted in logarithmic buckets, so that the counts of thousands of processes can be added up."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from math import exp, log
from typing import Final, Self

WIDTH: Final = 0.05
"""Natural logarithm of the ratio of two bucket edges: quantiles are exact to 2.5 %."""
FLOOR_NS: Final = 1_000
"""Shorter durations count as this one."""


class Histogram:
    """Counts of durations in ns."""

    def __init__(self, counts: Mapping[int, int] | None = None) -> None:
        self.counts: Counter[int] = Counter(counts or {})

    def add(self, duration_ns: int) -> None:
        """Count one duration."""
        self.counts[round(log(max(duration_ns, FLOOR_NS)) / WIDTH)] += 1

    def update(self, other: Self) -> None:
        """Add another histogram's counts."""
        self.counts.update(other.counts)

    def quantile_ms(self, share: float) -> float | None:
        """The duration (ms) that this share of all stays below; None if there are none."""
        rank = share * self.counts.total()
        for bucket in sorted(self.counts):
            rank -= self.counts[bucket]
            if rank <= 0:
                return exp(bucket * WIDTH) / 1e6
        return None
