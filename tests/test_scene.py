"""What is to be seen when: the raster, the sums per second, the shapes."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from launcher.records import FieldInfo, MessageRow, Place
from launcher.timeline.scene import RASTER_NS, Seconds, Shown, crosses, extent, halves, rings, spacing
from tests.fake_run import info
from trackfield.role import NS

MS = 1_000_000
TIMES = st.integers(0, 5 * NS)


def history(shown: Shown, until_ns: float = math.inf) -> list[tuple[int, dict[object, object]]]:
    return [(t, dict(shown.now["a"])) for t, changed in shown.until(until_ns) if "a" in changed]


def test_a_value_is_seen_from_the_next_instant_of_the_raster_until_its_end() -> None:
    shown = Shown()
    shown.show("a", "k", "x", 1010 * MS, 2000 * MS)
    assert history(shown) == [(1050 * MS, {"k": "x"}), (2000 * MS, {})]


def test_a_value_without_an_end_stays() -> None:
    shown = Shown()
    shown.show("a", "k", "x", 0)
    shown.show("a", "k", "y", NS)
    assert history(shown) == [(0, {"k": "x"}), (NS, {"k": "y"})]


def test_the_end_of_a_value_does_not_end_the_one_that_replaced_it() -> None:
    shown = Shown()
    shown.show("a", "k", "x", 0, 1 * NS)
    shown.show("a", "k", "y", 500 * MS, 2 * NS)
    assert history(shown) == [(0, {"k": "x"}), (500 * MS, {"k": "y"}), (2 * NS, {})]


def test_two_values_of_a_key_with_one_end_both_end_there() -> None:
    shown = Shown()
    shown.show("a", "k", "x", 0, 1 * NS)
    shown.show("a", "k", "y", 500 * MS, 1 * NS)
    assert history(shown) == [(0, {"k": "x"}), (500 * MS, {"k": "y"}), (NS, {})]


def test_what_would_end_before_it_begins_is_never_seen() -> None:
    shown = Shown()
    shown.show("a", "k", "x", 3 * NS, 2 * NS)
    shown.show("a", "k", "x", 3 * NS, 3 * NS)
    assert history(shown) == []


def test_only_the_keys_that_changed_are_named() -> None:
    shown = Shown()
    shown.show("a", "k", 1, 0)
    shown.show("b", "k", 1, 0)
    shown.show("b", "k", 2, NS)
    shown.show("b", "k", 2, 2 * NS)
    shown.show("b", "other", 2, 3 * NS)
    assert list(shown.until(math.inf)) == [
        (0, {"a": {"k"}, "b": {"k"}}),
        (NS, {"b": {"k"}}),
        (2 * NS, {}),
        (3 * NS, {"b": {"other"}}),
    ]


def test_nothing_is_a_value_too() -> None:
    shown = Shown()
    shown.show("a", "k", "x", 0, 3 * NS)
    shown.show("a", "k", None, NS)
    shown.show("a", "k", None, 2 * NS)
    assert history(shown) == [(0, {"k": "x"}), (NS, {})]


def test_the_same_value_without_an_end_replaces_one_with_an_end() -> None:
    shown = Shown()
    shown.show("a", "k", "x", 0, 2 * NS)
    shown.show("a", "k", "x", NS)
    assert [values for _, values in history(shown)][-1] == {"k": "x"}
    assert shown.now["a"] == {"k": "x"}


def test_nothing_after_the_given_time_is_applied_yet() -> None:
    shown = Shown()
    shown.show("a", "k", "x", NS)
    assert history(shown, NS - 1) == []
    assert history(shown, NS) == [(NS, {"k": "x"})]


def test_a_change_that_comes_too_late_is_applied_at_the_last_instant() -> None:
    shown = Shown()
    shown.show("a", "k", "new", 5 * NS)
    history(shown)
    shown.show("a", "other", "late", 1 * NS)
    assert history(shown) == [(5 * NS, {"k": "new", "other": "late"})]


@given(st.lists(st.tuples(TIMES, TIMES), max_size=20))
def test_at_each_instant_exactly_the_intervals_around_it_are_seen(spans: list[tuple[int, int]]) -> None:
    shown = Shown()
    for index, (begin, end) in enumerate(spans):
        shown.show("a", index, True, begin, end)

    def up(t: int) -> int:
        return math.ceil(t / RASTER_NS) * RASTER_NS

    seen = history(shown)
    assert [t for t, _ in seen] == sorted({t for t, _ in seen})
    for t, values in seen:
        assert set(values) == {i for i, (b, e) in enumerate(spans) if b < e and up(b) <= t < up(e)}
    assert not seen or not seen[-1][1]


def row(outcome: str, sent_ms: int, delay_ms: int | None, size: int = 14) -> MessageRow:
    sent = sent_ms * MS
    due = None if delay_ms is None else sent + delay_ms * MS
    return MessageRow("doa", "n1", "fusion", "field", sent, due, outcome, size)


def plots(seconds: Seconds, t_ns: float) -> dict[tuple[int, str], tuple[float, ...]]:
    return {(t // NS, name): values for t, name, values in seconds.until(t_ns)}


def test_sums_per_second() -> None:
    seconds = Seconds()
    seconds.message(100 * MS, row("delivered", 90, 10))
    seconds.message(200 * MS, row("late", 170, 30))
    seconds.message(999 * MS, row("radio", 999, None))
    seconds.message(1000 * MS, row("radio", 1000, None, size=6))
    assert plots(seconds, 2 * NS) == {
        (1, "lost"): (1, 1),
        (1, "bytes"): (42, 28),
        (1, "queue"): (0,),
        (1, "latency"): (20.0, pytest.approx(29.0)),
        (2, "lost"): (2, 1),
        (2, "bytes"): (6, 0),
        (2, "queue"): (0,),
    }


def test_a_quiet_second_has_no_bytes_and_no_latency() -> None:
    seconds = Seconds()
    seconds.message(2500 * MS, row("delivered", 2490, 10))
    assert plots(seconds, 2 * NS) == {
        (1, "lost"): (0, 0),
        (1, "bytes"): (0, 0),
        (1, "queue"): (0,),
        (2, "lost"): (0, 0),
        (2, "bytes"): (0, 0),
        (2, "queue"): (0,),
    }
    assert plots(seconds, 2 * NS + 999 * MS) == {}
    assert (3, "latency") in plots(seconds, math.inf)


def test_clocks_and_queues_of_a_second() -> None:
    seconds = Seconds()
    for t_ms, error_ms in ((100, 3.0), (900, -4.0), (2500, -1.5)):
        seconds.clock(t_ms * MS, error_ms)
    for t_ms, waiting in ((100, 2), (200, 7), (300, 1), (1999, 3)):
        seconds.queue(t_ms * MS, waiting)
    found = {key: values for key, values in plots(seconds, math.inf).items() if key[1] in ("clock", "queue")}
    assert found == {
        (1, "clock"): (pytest.approx(math.sqrt(12.5)), 4.0),
        (1, "queue"): (7,),
        (2, "queue"): (3,),
        (3, "clock"): (1.5, 1.5),
        (3, "queue"): (0,),
    }


def test_a_message_of_a_settled_second_counts_in_the_next_one() -> None:
    seconds = Seconds()
    assert plots(seconds, 3 * NS)[3, "lost"] == (0, 0)
    seconds.message(1 * NS, row("radio", 1000, None))
    assert plots(seconds, math.inf) == {(4, "lost"): (1, 0), (4, "bytes"): (14, 0), (4, "queue"): (0,)}


@given(st.floats(0.1, 50), st.floats(0.1, 50), st.floats(-0.99, 0.99), st.floats(-1e4, 1e4), st.floats(-1e4, 1e4))
def test_the_ring_is_where_the_mahalanobis_distance_squared_is_5_99(
    sx: float, sy: float, rho: float, x: float, y: float
) -> None:
    covariance = np.zeros((4, 4))
    covariance[:2, :2] = [[sx * sx, rho * sx * sy], [rho * sx * sy, sy * sy]]
    (ring,) = rings(np.array([[x, y]]), tuple(covariance.ravel()))
    away = ring - (x, y)
    distance = np.einsum("ni,ij,nj->n", away, np.linalg.inv(covariance[:2, :2]), away)
    assert ring.shape == (33, 2)
    assert distance == pytest.approx(np.full(33, 5.991), rel=1e-3)
    assert ring[0] == pytest.approx(ring[-1])
    assert len({tuple(p) for p in np.round(away, 9)}) == 32  # a full turn


@pytest.mark.parametrize("variances", [(0.0, 0.0), (4.0, 0.0), (0.0, 4.0), (-1e-12, 1.0)])
def test_a_degenerate_covariance_has_a_flat_ring(variances: tuple[float, float]) -> None:
    covariance = np.diag([*variances, 1.0, 1.0])
    (ring,) = rings(np.zeros((1, 2)), tuple(covariance.ravel()))
    sd = np.sqrt(np.maximum(variances, 0))
    assert np.max(np.abs(ring), axis=0) == pytest.approx(math.sqrt(-2 * math.log(0.05)) * sd)


def test_no_estimate_has_no_ring() -> None:
    assert rings(np.empty((0, 2)), ()).shape == (0, 33, 2)


def test_extent_is_the_longer_side() -> None:
    assert extent(info(side=5)) == 200.0


def field_of(*at: tuple[float, float], receptions: tuple[tuple[str, str, float], ...] = ()) -> FieldInfo:
    places = tuple(Place(f"n{index}", "node", x, y) for index, (x, y) in enumerate(at))
    return FieldInfo("r", "s", places, (), (), 1.0, receptions=receptions)


def test_spacing_is_the_distance_to_the_next_place() -> None:
    assert spacing(info(side=20)) == 50.0
    assert spacing(field_of((0, 0), (3, 4), (100, 0))) == 5.0
    assert 0 < spacing(field_of((7, 7))) < 0.1
    assert 0 < spacing(field_of((7, 7), (7, 7))) < 0.1


def test_a_cross_has_two_strokes() -> None:
    found = crosses(np.array([[10.0, 20.0]]), 2.0)
    assert found.tolist() == [[[8, 18], [12, 22]], [[8, 22], [12, 18]]]
    assert crosses(np.empty((0, 2)), 2.0).shape == (0, 2, 2)


def test_a_link_that_is_used_both_ways_is_drawn_in_halves() -> None:
    links = (("n0", "n1", 0.9), ("n1", "n0", 0.8), ("n0", "n2", 0.7))
    found = halves(field_of((0, 0), (10, 4), (6, 0), receptions=links))
    assert found.tolist() == [[[0, 0], [5, 2]], [[10, 4], [5, 2]], [[0, 0], [6, 0]]]
    assert halves(field_of((0, 0))).shape == (0, 2, 2)
