"""The target's path: exact where it has to be, silent where it knows nothing, small when cut."""

from dataclasses import replace

import msgpack
import pytest
from hypothesis import given
from hypothesis import strategies as st

from trackfield.world.path import Path
from trackfield.world.targets import s1

# x = 3t + t^2 and y = 5 - t for 2 s, then constant velocity.
ROWS = [(0.0, 0.0, 5.0, 3.0, -1.0), (2.0, 10.0, 3.0, 7.0, -1.0), (6.0, 38.0, -1.0, 7.0, -1.0)]

finite = st.floats(-1e4, 1e4, allow_nan=False)


@st.composite
def paths(draw: st.DrawFn) -> Path:
    """Knots at increasing times, some of them doubled with another velocity."""
    rows = []
    t = draw(st.floats(0, 100))
    for _ in range(draw(st.integers(1, 12))):
        place = draw(st.tuples(finite, finite))
        rows += [(t, *place, *draw(st.tuples(finite, finite))) for _ in range(draw(st.integers(1, 2)))]
        t += draw(st.floats(0.01, 50))
    return Path.of(rows)


@pytest.mark.parametrize(("t", "x"), [(0.0, 0.0), (0.5, 1.75), (1.0, 4.0), (2.0, 10.0), (3.5, 20.5), (6.0, 38.0)])
def test_constant_acceleration_is_reproduced_exactly(t: float, x: float) -> None:
    at = Path.of(ROWS).at(t)
    assert at == pytest.approx((x, 5.0 - t, min(3.0 + 2.0 * t, 7.0), -1.0), abs=1e-12)


@pytest.mark.parametrize("t", [-1e-9, 6.0 + 1e-9, -100.0, 1e9])
def test_before_and_after_the_target_is_not_there(t: float) -> None:
    assert Path.of(ROWS).at(t) is None


def test_its_ends_belong_to_it() -> None:
    path = Path.of(ROWS)
    assert (path.start_s, path.end_s) == (0.0, 6.0)
    assert path.at(0.0) == ROWS[0][1:]
    assert path.at(6.0) == ROWS[-1][1:]


def test_two_knots_at_one_instant_turn_a_corner() -> None:
    path = Path.of([(0, 0, 0, 1, 0), (10, 10, 0, 1, 0), (10, 10, 0, 0, 2), (20, 10, 20, 0, 2)])
    assert path.at(5.0) == (5.0, 0.0, 1.0, 0.0)
    assert path.at(10.0) == (10.0, 0.0, 0.0, 2.0)  # what holds from now on
    assert path.at(15.0) == (10.0, 10.0, 0.0, 2.0)


@pytest.mark.parametrize(
    "columns",
    [
        ((), (), (), (), ()),
        ((0.0,), (0.0,), (0.0,), (0.0,), ()),
        ((1.0, 0.0), (0.0, 0.0), (0.0, 0.0), (0.0, 0.0), (0.0, 0.0)),
        ((1.0, 1.0), (0.0, 0.1), (0.0, 0.0), (0.0, 0.0), (0.0, 0.0)),
    ],
)
def test_what_is_no_path_is_refused(columns: tuple[tuple[float, ...], ...]) -> None:
    with pytest.raises(ValueError, match=r"knot"):
        Path(*columns)


@given(paths())
def test_position_and_velocity_are_those_of_the_knots(path: Path) -> None:
    for i, t in enumerate(path.t):
        if path.t[i + 1 : i + 2] != (t,):
            assert path.at(t) == (path.x[i], path.y[i], path.vx[i], path.vy[i])


@given(paths(), st.data())
def test_a_cut_path_answers_inside_its_intervals_bit_for_bit(path: Path, data: st.DataObject) -> None:
    times = st.floats(path.start_s - 5, path.end_s + 5)
    intervals = [tuple(sorted(data.draw(st.tuples(times, times)))) for _ in range(data.draw(st.integers(0, 4)))]
    cut = path.cut(intervals)
    assert len(cut.t) <= len(path.t)
    for a, b in intervals:
        for t in (a, b, data.draw(st.floats(a + 0.0, b + 0.0)), *(t for t in path.t if a <= t <= b)):
            assert cut.at(t) == path.at(t)


@given(paths(), st.data())
def test_a_cut_path_never_answers_differently(path: Path, data: st.DataObject) -> None:
    t = data.draw(st.floats(path.start_s, path.end_s))
    a = data.draw(st.floats(path.start_s, path.end_s))
    assert path.cut([(a, a)]).at(t) in (None, path.at(t))


def test_a_cut_leaves_out_what_lies_between() -> None:
    path = Path.of([(float(t), float(t), 0.0, 1.0, 0.0) for t in range(101)])
    cut = path.cut([(10.5, 11.5), (90.2, 90.4)])
    assert cut.t == (10.0, 11.0, 12.0, 90.0, 91.0)
    assert cut.missing == (2,)
    assert cut.at(50.0) is None
    assert cut.at(10.9) == path.at(10.9)
    assert cut.cut([(0.0, 100.0)]) == cut


def test_a_cut_with_nothing_in_it_is_still_a_path() -> None:
    assert len(Path.of(ROWS).cut([]).t) == 1


@given(paths(), st.lists(st.tuples(finite, finite), max_size=3))
def test_it_travels_exactly(path: Path, gaps: list[tuple[float, float]]) -> None:
    path = Path(path.t, path.x, path.y, path.vx, path.vy, tuple(gaps)).cut([(path.start_s, path.start_s)])
    assert Path.from_plain(msgpack.unpackb(msgpack.packb(path.to_plain()))) == path


def test_a_clipped_path_is_the_same_curve_between_its_new_ends() -> None:
    path = Path.of(ROWS, gaps=[(0.0, 0.5), (1.5, 3.0), (5.0, 6.0)])
    part = path.clip(0.5, 4.0)
    assert (part.start_s, part.end_s) == (0.5, 4.0)
    assert part.gaps == ((1.5, 3.0),)
    for t in (0.5, 1.0, 1.999, 2.0, 3.0, 4.0):
        assert part.at(t) == pytest.approx(path.at(t), abs=1e-12)


def test_clipping_knows_gaps_as_far_as_it_reaches_and_keeps_corners() -> None:
    corner = [(0, 0, 0, 1, 0), (10, 10, 0, 1, 0), (10, 10, 0, 0, 2), (20, 10, 20, 0, 2)]
    path = Path.of(corner, gaps=[(0.0, 10.0)])
    part = path.clip(4.0, 8.0)
    assert part.gaps_inside == ((4.0, 8.0),)
    assert [part.interpolated(t) for t in (4.0, 8.0)] == [True, True]  # there is no fix at either end
    assert [path.interpolated(t) for t in (0.0, 10.0)] == [False, False]
    assert path.clip(4.0, 10.0).at(7.0) == (7.0, 0.0, 1.0, 0.0)  # not bent by the velocity after the corner
    assert path.clip(10.0, 20.0).at(15.0) == (10.0, 10.0, 0.0, 2.0)


def test_clipping_wider_than_the_path_changes_nothing() -> None:
    path = Path.of(ROWS)
    assert path.clip(-10.0, 10.0) == path


@pytest.mark.parametrize("window", [(-2.0, -1.0), (7.0, 8.0), (3.0, 2.0)])
def test_there_is_nothing_to_clip_outside(window: tuple[float, float]) -> None:
    with pytest.raises(ValueError, match="nothing between"):
        Path.of(ROWS).clip(*window)


def test_a_hastened_path_is_at_the_same_places_sooner() -> None:
    path = Path.of(ROWS, gaps=[(2.0, 6.0)], jumps=[(0.0, 2.0)])
    fast = path.hastened(2.0)
    for t in (0.0, 0.5, 2.0, 3.5, 6.0):
        x, y, vx, vy = path.at(t) or (0.0, 0.0, 0.0, 0.0)
        assert fast.at(t / 2) == pytest.approx((x, y, 2 * vx, 2 * vy))
    assert fast.gaps == ((1.0, 3.0),)
    assert fast.jumps == ((0.0, 1.0),)
    assert path.hastened(1.0) is path


@pytest.mark.parametrize("seconds", [0.1, 12.3, 86400.0, 1e6])
def test_a_shifted_path_is_the_same_so_much_later(seconds: float) -> None:
    path = replace(s1(3, 200, 0.1), gaps=((0.3, 0.7),))
    later = path.shifted(seconds)
    for k in range(201):
        t_ns = round(seconds * 1e9) + 100_000_000 * k
        assert later.at(t_ns / 1e9) == path.at(100_000_000 * k / 1e9)  # also at the last, which is not missed
    assert later.at((t_ns + 1000) / 1e9) is None
    assert later.gaps == ((pytest.approx(seconds + 0.3), pytest.approx(seconds + 0.7)),)


def test_by_nothing_it_is_the_path_itself() -> None:
    path = s1(3)
    assert path.shifted(0.0) is path


def test_of_knots_that_meet_far_away_the_first_stays() -> None:
    path = Path.of([(0.0, 0.0, 0.0, 1.0, 0.0), (1.0, 1.0, 0.0, 1.0, 0.0), (1.0 + 1e-12, 1.1, 0.0, 1.0, 0.0)])
    assert path.shifted(100.0).t == (100.0, 101.0)
    turns = Path.of([(0.0, 0.0, 0.0, 1.0, 0.0), (1.0, 1.0, 0.0, 1.0, 0.0), (1.0, 1.0, 0.0, 0.0, 1.0), (2, 1, 1, 0, 1)])
    assert turns.shifted(100.0).t == (100.0, 101.0, 101.0, 102.0)
