"""Audible windows: never too short, hardly too long, and quick for a large field."""

import time
from math import hypot

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from trackfield.world.path import Path
from trackfield.world.targets import s1, s2, s3, waypoints
from trackfield.world.windows import distances, merged, windows

S = 1_000_000_000
Window = tuple[int, int]


def grid(n: int, spacing: float) -> NDArray[np.float64]:
    return np.stack(np.meshgrid(np.arange(n) * spacing, np.arange(n) * spacing), axis=-1).reshape(-1, 2)


def inside(t_ns: float, own: tuple[Window, ...]) -> bool:
    return any(a <= t_ns <= b for a, b in own)


def check(positions: NDArray[np.float64], path: Path, radius: float, times: NDArray[np.float64]) -> None:
    """Windows against looking at every time."""
    found = windows(positions, path, radius)
    assert len(found) == len(positions)
    states = [path.at(float(t)) for t in times]
    for (x, y), own in zip(positions, found, strict=True):
        assert all(a <= b for a, b in own)
        assert all(own[i][1] < own[i + 1][0] for i in range(len(own) - 1))
        for t, state in zip(times, states, strict=True):
            assert state is not None
            far = hypot(state[0] - x, state[1] - y)
            if far <= radius:
                assert inside(t * S, own)
            elif inside(t * S, own):
                assert far <= radius * 1.125 + 2.0


@pytest.mark.parametrize("radius", [1.0, 20.0, 56.2, 91.2, 1000.0, 1e7])
@pytest.mark.parametrize("name", ["s1", "s2", "s3", "legs"])
def test_windows_hold_all_times_in_range_and_few_others(name: str, radius: float) -> None:
    legs = waypoints([(0, 0, 0), (10, 0, 0), (60, 400, 300)])
    path = {"s1": s1(1), "s2": s2(), "s3": s3(), "legs": legs}[name]
    times = np.random.default_rng(1).uniform(path.start_s, path.end_s, 300)
    check(grid(11, 50.0), path, radius, np.concatenate([times, [path.start_s, path.end_s]]))


@st.composite
def wild_paths(draw: st.DrawFn) -> Path:
    """Knots anywhere, with velocities that make the curve swing far beyond them."""
    places, speeds = st.floats(-300, 300), st.floats(-80, 80)
    rows, t = [], 0.0
    for _ in range(draw(st.integers(1, 8))):
        place = draw(st.tuples(places, places))
        rows += [(t, *place, *draw(st.tuples(speeds, speeds))) for _ in range(draw(st.integers(1, 2)))]
        t += draw(st.sampled_from([0.1, 1.0, 20.0]))
    return Path.of(rows)


coordinates = st.tuples(st.floats(-400, 400), st.floats(-400, 400))


@given(wild_paths(), st.floats(0.5, 500), st.lists(coordinates, min_size=1, max_size=5))
def test_no_instant_in_range_is_ever_missing(path: Path, radius: float, places: list[tuple[float, float]]) -> None:
    found = windows(np.array(places), path, radius)
    for t in (*path.t, *np.linspace(path.start_s, path.end_s, 200)):
        state = path.at(float(t))
        assert state is not None
        for (x, y), own in zip(places, found, strict=True):
            if hypot(state[0] - x, state[1] - y) <= radius:
                assert inside(t * S, own)


def test_a_window_begins_and_ends_where_the_circle_is_crossed() -> None:
    # 10 m/s along the x axis; 30 m beside it, the 50 m circle is crossed at x = -40 and x = 40
    path = waypoints([(0, -200, 0), (40, 200, 0)])
    (((begin, end),),) = windows(np.array([[0.0, 30.0]]), path, 50.0)
    assert 15.7 * S <= begin <= 16 * S
    assert 24 * S <= end <= 24.3 * S


def test_a_target_that_comes_twice_is_heard_in_two_windows() -> None:
    path = waypoints([(0, 0, 0), (50, 500, 0), (100, 0, 0)])
    (own,) = windows(np.array([[100.0, 0.0]]), path, 20.0)
    assert len(own) == 2
    assert inside(10 * S, own)
    assert inside(90 * S, own)
    assert not inside(50 * S, own)


def test_a_parked_target_is_heard_all_the_time() -> None:
    path = waypoints([(3, 10, 10), (3600, 10, 10)])
    near, far = windows(np.array([[0.0, 0.0], [0.0, 30.0]]), path, 15.0)
    assert near == ((3 * S, 3600 * S),)
    assert far == ()


def test_a_target_that_is_there_for_an_instant() -> None:
    path = Path.of([(5.0, 1.0, 1.0, 3.0, 3.0)])
    assert windows(np.array([[0.0, 0.0], [9.0, 9.0]]), path, 2.0) == [((5 * S, 5 * S),), ()]


def test_who_reaches_nowhere_hears_nothing() -> None:
    assert windows(np.zeros((2, 2)), s1(1), 0.0) == [(), ()]
    assert windows(np.zeros((0, 2)), s1(1), 50.0) == []


def test_a_cut_path_is_refused() -> None:
    cut = s1(1).cut([(0.0, 1.0), (50.0, 51.0)])
    with pytest.raises(ValueError, match="was cut"):
        windows(np.zeros((1, 2)), cut, 50.0)
    with pytest.raises(ValueError, match="was cut"):
        distances(np.zeros((1, 2)), cut, 50.0)


@pytest.mark.parametrize(("seconds", "radius"), [(60, 91.2), (3600, 91.2), (3600, 3000.0), (3600, 1e7)])
def test_a_hundred_thousand_sensors_are_no_burden(seconds: int, radius: float) -> None:
    field = grid(317, 50.0)[:100_000] - 2000.0
    begin = time.process_time()
    found = windows(field, s1(1, seconds), radius)
    assert time.process_time() - begin < 5.0  # about 0.1 to 0.5 s
    assert sum(map(bool, found)) == pytest.approx(np.isfinite(distances(field, s1(1, seconds), radius)).sum(), rel=0.1)


def test_distances_are_those_to_the_nearest_place() -> None:
    path = waypoints([(0, 0, 0), (10, 100, 0), (20, 100, 100)])
    places = np.array([[50.0, 30.0], [-30.0, -40.0], [130.0, 100.0], [100.0, 0.0], [50.0, 101.0]])
    assert distances(places, path, 60.0) == pytest.approx([30.0, 50.0, 30.0, 0.0, 50.0], abs=0.06)
    assert distances(places, path, 40.0).tolist()[1] == np.inf


def test_distances_are_hardly_too_long_at_their_limit() -> None:
    path = waypoints([(0, 0, 0), (10, 1000, 0)])
    far = distances(np.column_stack([np.linspace(0, 1000, 777), np.full(777, 149.8)]), path, 150.0)
    assert far.min() >= 149.8
    assert far.max() <= 149.95


@pytest.mark.parametrize(
    ("parts", "whole"),
    [
        ([], ()),
        ([((1, 2), (5, 9))], ((1, 2), (5, 9))),
        ([((5, 9),), ((1, 2),)], ((1, 2), (5, 9))),
        ([((1, 4), (6, 7)), ((2, 6),)], ((1, 7),)),
        ([((1, 9),), ((2, 3), (4, 5))], ((1, 9),)),
        ([((1, 3),), ((3, 4),), ((5, 6),)], ((1, 4), (5, 6))),
    ],
)
def test_windows_of_several_paths_are_in_order_and_apart(parts: list[tuple[Window, ...]], whole: object) -> None:
    assert merged(parts) == whole
