"""Durations in logarithmic buckets: quantiles to 2.5 %, and sums of many processes' counts."""

from __future__ import annotations

from math import ceil, exp

import msgpack
import pytest
from hypothesis import given
from hypothesis import strategies as st

from trackfield.drivers.exchange.histogram import FLOOR_NS, WIDTH, Histogram

DURATIONS = st.lists(st.integers(0, 10**12), max_size=50)
SHARES = st.sampled_from([0.0, 0.25, 0.5, 0.75, 1.0])


def of(durations: list[int]) -> Histogram:
    histogram = Histogram()
    for duration in durations:
        histogram.add(duration)
    return histogram


@given(DURATIONS.filter(bool), SHARES)
def test_a_quantile_is_right_to_half_a_bucket(durations: list[int], share: float) -> None:
    exact = sorted(durations)[max(ceil(share * len(durations)) - 1, 0)]
    found = of(durations).quantile_ms(share)
    assert found is not None
    assert found * 1e6 == pytest.approx(max(exact, FLOOR_NS), rel=exp(WIDTH / 2) - 1 + 1e-9)


def test_nothing_counted_has_no_quantile() -> None:
    assert Histogram().quantile_ms(0.5) is None
    assert Histogram({}).quantile_ms(1.0) is None


@given(DURATIONS, DURATIONS)
def test_histograms_add_up(a: list[int], b: list[int]) -> None:
    total = of(a)
    total.update(of(b))
    assert total.counts == of([*a, *b]).counts
    assert total.counts.total() == len(a) + len(b)


def test_adding_another_leaves_it_alone() -> None:
    a, b = of([1_000_000]), of([2_000_000])
    a.update(b)
    assert b.counts.total() == 1


@given(DURATIONS)
def test_counts_travel(durations: list[int]) -> None:
    counts = msgpack.unpackb(msgpack.packb(dict(of(durations).counts)), strict_map_key=False)
    assert Histogram(counts).counts == of(durations).counts


def test_the_shortest_durations_are_one() -> None:
    assert of([0, 1, 999, FLOOR_NS]).counts == of([FLOOR_NS] * 4).counts
    assert of([-5]).quantile_ms(0.5) == pytest.approx(1e-3, rel=0.026)


def test_a_rare_long_duration_shows_in_the_last_quantile_only() -> None:
    histogram = of([1_000_000] * 99 + [500_000_000])
    assert histogram.quantile_ms(0.5) == histogram.quantile_ms(0.99) == pytest.approx(1.0, rel=0.026)
    assert histogram.quantile_ms(1.0) == pytest.approx(500.0, rel=0.026)
