"""Processes that move, and links that follow them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scipy.stats import binom

from tests.links import PLACES, S, likely, radio_link
from trackfield.link import make_link
from trackfield.link.fate import Transmission
from trackfield.link.places import Path, Places, moves, position
from trackfield.link.shadowing import CHANNELS

DRIVE: Final[Path] = ((10 * S, 0.0, 0.0), (20 * S, 100.0, 0.0), (22 * S, 100.0, -40.0))
NEAR_THEN_FAR: Final[Places] = {"fusion": ((0, 0.0, 0.0), (100 * S, 1000.0, 0.0)), "n1": (0.0, 30.0), "n2": (0.0, 0.0)}


@pytest.mark.parametrize(
    ("t_ns", "x", "y"),
    [
        (-S, 0, 0),
        (0, 0, 0),
        (10 * S, 0, 0),
        (10 * S + 1, 1e-8, 0),
        (13 * S, 30, 0),
        (20 * S, 100, 0),
        (21 * S, 100, -20),
        (22 * S, 100, -40),
        (10**18, 100, -40),
    ],
)
def test_straight_from_leg_to_leg(t_ns: int, x: float, y: float) -> None:
    assert position({"fusion": DRIVE}, "fusion", t_ns) == pytest.approx((x, y), abs=1e-12)


@given(st.integers(-(10**12), 10**12))
@example(0)
def test_who_does_not_move_is_where_it_is(t_ns: int) -> None:
    assert position({"n1": (1.5, -2.0), "n2": ((5, 3.0, 4.0),)}, "n1", t_ns) == (1.5, -2.0)
    assert position({"n1": (1.5, -2.0), "n2": ((5, 3.0, 4.0),)}, "n2", t_ns) == (3.0, 4.0)


@given(
    st.lists(st.tuples(st.integers(0, 10**10), *[st.floats(-1e4, 1e4)] * 2), min_size=1, unique_by=lambda leg: leg[0])
)
def test_a_path_passes_its_own_points(legs: list[tuple[int, float, float]]) -> None:
    path = tuple(sorted(legs))
    assert moves(path)
    assert [position({"fusion": path}, "fusion", t) for t, _, _ in path] == [(x, y) for _, x, y in path]


def test_a_point_is_no_path_and_an_unknown_place_is_an_error() -> None:
    assert not moves((1.0, 2.0))
    with pytest.raises(KeyError):
        position(PLACES, "stranger", 0)


def at(places: Places, t_ns: int) -> Mapping[str, tuple[float, float]]:
    return {id: position(places, id, t_ns) for id in places}


RADIO: Final = {"model": "lognormal_prr", "radio": "802154-0dbm", "busy": 0.2, "ack": 2}


@pytest.mark.parametrize(
    "spec", [RADIO, {**RADIO, "range_m": 150.0}, {"model": "fixed", "loss": 0.1, "range_m": 150.0}]
)
def test_a_frame_meets_the_places_of_its_sending(spec: dict[str, Any]) -> None:
    """At each instant a link to a mover is the link to one that stands where it just is, also when asked backwards."""
    moving, size = make_link(spec, 1, NEAR_THEN_FAR), 12
    times = [i * S // 7 for i in range(700)]
    fates = {}
    for t in times:
        still = make_link(spec, 1, at(NEAR_THEN_FAR, t))
        for src, dst in (("n1", "fusion"), ("fusion", "n1"), ("n1", "n2")):
            fates[src, dst, t] = still.fate(Transmission(src, dst, "doa", t, 0, size))
            assert moving.fate(Transmission(src, dst, "doa", t, 0, size)) == fates[src, dst, t]
            assert moving.reception(src, dst, size, at_ns=t) == still.reception(src, dst, size)
    assert {key: moving.fate(Transmission(*key[:2], "doa", key[2], 0, size)) for key in reversed(fates)} == fates
    late = [fates["n1", "fusion", t].cause for t in times if t > 50 * S]
    early = [fates["n1", "fusion", t].cause for t in times if t < S]
    assert set(late) == {"radio"}
    assert None in early


def test_reception_is_that_at_the_start_unless_asked_otherwise() -> None:
    link = make_link(RADIO, 1, NEAR_THEN_FAR)
    assert link.reception("n1", "fusion", 12) == link.reception("n1", "fusion", 12, at_ns=0) > 0.5
    assert link.reception("n1", "fusion", 12, at_ns=100 * S) == pytest.approx(0, abs=1e-6)


def test_shadowing_stays_with_a_link_that_moves() -> None:
    link, castalia = radio_link(NEAR_THEN_FAR, radio="802154-0dbm"), CHANNELS["castalia"]
    shadow_db = {t: -link.snr_db("n2", "fusion", t * S) + 100 - castalia.mean_db(10.0 * t) for t in (1, 2, 30, 99)}
    assert max(shadow_db.values()) - min(shadow_db.values()) == pytest.approx(0, abs=1e-9)


def test_a_centre_that_drives_away_loses_its_nodes_one_by_one() -> None:
    """Frames sent while it passes a distance are received as by a centre that stands there."""
    places: dict[str, Any] = {f"n{i}": (0.0, 0.0) for i in range(3000)}
    for t_s, metres in ((3, 30.0), (8, 80.0), (10, 100.0)):
        moving = radio_link({**places, "fusion": ((0, 0.0, 0.0), (100 * S, 1000.0, 0.0))}, radio="802154-0dbm")
        shares = [moving.reception(id, "fusion", 20, at_ns=t_s * S) for id in places]
        standing = radio_link({**places, "fusion": (metres, 0.0)}, radio="802154-0dbm")
        assert shares == pytest.approx([standing.reception(id, "fusion", 20) for id in places])
        got = sum(moving.fate(Transmission(id, "fusion", "doa", t_s * S, 0, 20)).cause is None for id in places)
        assert likely(got, binom(len(places), sum(shares) / len(places)))
