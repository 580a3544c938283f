"""Which of the nodes that heard a pass are used: against a search through all sets."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

from head.hearing.choice import MOST, Choice, Heard, chosen


def drawn(seed: int, count: int) -> Heard:
    rng = np.random.default_rng(seed)
    places = [(float(x), float(y)) for x, y in rng.uniform(0.0, 100.0, (count, 2))]
    ids = [f"n{i:02}" for i in range(count)]
    return Heard(ids, places, rng.uniform(0.0, 5.0, count).tolist(), rng.uniform(-30.0, 0.0, count).tolist())


def hull_of(heard: Heard) -> set[int]:
    return {int(i) for i in ConvexHull(np.array(heard.places)).vertices}


def area(heard: Heard, which: tuple[int, ...]) -> float:
    return float(ConvexHull(np.array([heard.places[i] for i in which])).volume)


def numbers(heard: Heard, choice: Choice) -> set[int]:
    return {list(heard.ids).index(id) for id in choice.ids}


@settings(max_examples=150, deadline=None)
@given(st.integers(0, 10**6), st.integers(6, 14))
def test_it_has_the_ends_and_of_the_hull_what_makes_the_area_largest(seed: int, count: int) -> None:
    heard = drawn(seed, count)
    choice = chosen(heard)
    found, hull = numbers(heard, choice), hull_of(heard)
    order = sorted(range(count), key=lambda i: heard.times[i])
    ends = {order[0], order[-1]}
    assert ends <= found
    assert len(found) == 5
    assert [heard.times[list(heard.ids).index(id)] for id in choice.ids] == sorted(heard.times[i] for i in found)
    rest = sorted(hull - ends)
    if len(rest) >= 3:
        best = max(area(heard, (*ends, *others)) for others in combinations(rest, 3))
        assert found - ends <= hull
        assert area(heard, tuple(found)) == pytest.approx(best, rel=1e-9)
        assert choice.words == f"5 on the hull of {count}"
    else:
        assert hull <= found
        loud = sorted(set(range(count)) - ends - hull, key=lambda i: -heard.strengths[i])
        assert found - ends - hull == set(loud[: 5 - len(ends | hull)])
        assert "loudest" in choice.words


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 10**6), st.integers(6, 12), st.randoms(use_true_random=False))
def test_the_order_of_reports_does_not_matter(seed: int, count: int, random: object) -> None:
    heard = drawn(seed, count)
    order = list(range(count))
    random.shuffle(order)  # type: ignore[attr-defined]
    mixed = Heard(*([part[i] for i in order] for part in heard))
    assert chosen(mixed) == chosen(heard)


@pytest.mark.parametrize("count", [0, 1, 2, 5])
def test_few_are_all_used(count: int) -> None:
    heard = drawn(1, count)
    assert set(chosen(heard).ids) == set(heard.ids)
    assert chosen(heard).words == f"all {count}"


def test_all_are_the_loudest_eight() -> None:
    heard = drawn(3, 12)
    loud = sorted(range(12), key=lambda i: -heard.strengths[i])[:MOST]
    assert numbers(heard, chosen(heard, 0)) == set(loud)
    assert numbers(drawn(3, MOST), chosen(drawn(3, MOST), 0)) == set(range(MOST))


def test_nodes_in_a_line_have_no_hull() -> None:
    """The ends are used, and the loudest of the others."""
    heard = Heard([f"n{i}" for i in range(7)], [(10.0 * i, 5.0) for i in range(7)], [float(i) for i in range(7)], [
        -9.0, -8.0, -1.0, -7.0, -2.0, -3.0, -9.0
    ])  # fmt: skip
    assert chosen(heard).ids == ("n0", "n2", "n4", "n5", "n6")


def test_of_equally_loud_ones_the_lower_id_fills_up() -> None:
    places = [(0.0, 0.0), (10.0, 0.0), (0.0, 10.0), (10.0, 10.0), (4.0, 5.0), (5.0, 5.0), (6.0, 5.0)]
    heard = Heard([f"n{i}" for i in range(7)], places, [0.0, 4.0, 1.0, 3.0, 2.0, 2.1, 2.2], [-5.0] * 7)
    assert set(chosen(heard).ids) == {"n0", "n1", "n2", "n3", "n4"}
