"""Whom a head has measure, and to whom it hands over, against choices made by trying all."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations
from math import comb, hypot
from statistics import NormalDist
from typing import Any

import numpy as np
import pytest
from immutables import Map

from head.header import Header
from head.peers import choice
from head.peers.memory import Leadership, Memory
from tests.ether import Place
from tests.peered import ANNOUNCEMENTS, MANNERS, RANGE_M, Manner, grid, header_of
from trackfield.draw import uniform
from trackfield.filters.types import Array, Gaussian
from trackfield.tracking.collecting import Collected
from trackfield.tracking.steps import Progress

STEP = 5


def places_of(seed: int, nodes: int) -> list[Place]:
    """So many nodes anywhere in 100 m by 100 m."""
    return [(100.0 * uniform(seed, "x", i), 100.0 * uniform(seed, "y", i)) for i in range(nodes)]


def header_at(places: Sequence[Place], manner: Manner = "location-central", **settings: Any) -> Header:
    return header_of(0, places, manner, **settings)


def leads_at(header: Header, at: Place | None, **leads: Any) -> tuple[Memory, Leadership]:
    """A head that has the target at this place after the step, at rest; and has heard all others."""
    bank = header.bank
    known = None if at is None else Gaussian(np.array([*at, 0.0, 0.0]), np.diag([4.0, 4.0, 0.5, 0.5]))
    tracks = bank.resume({"ukf": known}, STEP, STEP).tracks
    led = Leadership(Progress(tracks, Collected(STEP)), **leads)
    return Memory(near=Map(dict.fromkeys(header.settings.numbers, ANNOUNCEMENTS)), leads=led), led


def chosen(header: Header, memory: Memory, leads: Leadership) -> tuple[str, ...]:
    return choice.chosen(header.settings, header.bank, memory, leads)


def nominees(header: Header, memory: Memory, leads: Leadership) -> list[str]:
    return choice.nominees(header.settings, header.bank, memory, leads)


# --- peers ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("announcements", "heard", "peer"), [(3, 1, False), (3, 2, True), (4, 2, True), (1, 0, False)])
def test_peers_are_those_of_whom_it_heard_half_of_what_they_announced(
    announcements: int, heard: int, peer: bool
) -> None:
    header = header_at(grid(1), announcements=announcements)
    memory = Memory(near=Map({"n01": heard}))
    assert choice.peers_of(header.settings, memory) == ["n00"] + ["n01"] * peer


# --- who measures -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(20))
def test_the_nearest_measure(seed: int) -> None:
    places = places_of(seed, 12)
    header = header_at(places)
    at = (100.0 * uniform(seed, "at x"), 100.0 * uniform(seed, "at y"))
    found = chosen(header, *leads_at(header, at))
    away = {id: hypot(x - at[0], y - at[1]) for id, (x, y) in header.bank.positions.items()}
    assert set(found) == set(sorted(away, key=lambda id: away[id])[:4])
    assert "n00" not in found or found[0] == "n00"  # its own report needs no slot
    others = [id for id in found if id != "n00"]
    assert others == sorted(others, key=lambda id: away[id])


def test_of_equally_near_ones_the_lower_ids_measure() -> None:
    header = header_at([(0.0, 0.0), (10.0, 0.0), (-10.0, 0.0), (0.0, 10.0), (0.0, -10.0), (10.0, 0.0)])
    assert chosen(header, *leads_at(header, (0.0, 0.0))) == ("n00", "n01", "n02", "n03")


def test_those_out_of_reach_and_those_that_are_left_alone_do_not_measure() -> None:
    header = header_at(grid(4))
    memory, leads = leads_at(header, (15.0, 15.0), avoided={"n01": STEP + 1, "n03": STEP})
    memory = replace(memory, near=memory.near.delete("n02"))
    assert set(chosen(header, memory, leads)) == {"n00", "n03", "n04", "n05"}


def brute(header: Header, ids: Sequence[str], ahead: Gaussian, count: int) -> float:
    """The smallest trace of the position's covariance that any set of sensors is likely to leave."""
    return min(trace(header, one, ahead) for one in combinations(ids, count))


def trace(header: Header, ids: Sequence[str], ahead: Gaussian) -> float:
    J = np.linalg.inv(ahead.covariance)
    for id in ids:
        J = J + chance(header, id, ahead) * header.bank.information([id], ahead.mean)[0]
    left: Array = np.linalg.inv(J)
    return float(left[0, 0] + left[1, 1])


def chance(header: Header, id: str, ahead: Gaussian) -> float:
    """That the target is in this sensor's range, by its distance and the variance of that."""
    apart = ahead.mean[:2] - header.bank.positions[id]
    distance = float(np.linalg.norm(apart))
    variance = float(apart @ ahead.covariance[:2, :2] @ apart) / distance**2
    return NormalDist(distance, variance**0.5).cdf(RANGE_M)


def test_a_sensor_that_the_target_may_be_out_of_reach_of_counts_less() -> None:
    """One in line with what is known least is best, unless it stands where the target is likely out of its range."""
    header = header_at([(0.0, 30.0), (-49.5, 0.0), (20.0, 4.0)], "elected")
    for variances, best in (((0.01, 0.0025), "n01"), ((100.0, 1.0), "n02")):
        ahead = Gaussian(np.zeros(4), np.diag([*variances, 1.0, 1.0]))
        assert choice.smallest(header.bank, ["n01", "n02"], ahead, 1) == [best]


def test_chances_are_those_of_a_normal_distance() -> None:
    header = header_at(places_of(3, 9), "elected")
    ahead = Gaussian(np.array([40.0, 60.0, 0.0, 0.0]), np.diag([25.0, 100.0, 1.0, 1.0]) + 3.0)
    ids = list(header.bank.positions)
    found = choice.chances(header.bank, ids, ahead)
    assert found == pytest.approx([chance(header, id, ahead) for id in ids], abs=1e-12)
    assert found.min() < 0.9 and found.max() > 0.999


@pytest.mark.parametrize("count", [1, 2, 3])
@pytest.mark.parametrize("seed", range(10))
def test_those_that_leave_the_smallest_covariance_measure(seed: int, count: int) -> None:
    header = header_at(places_of(seed, 9), "elected", count=count)
    spread = np.array([uniform(seed, "sd", i) for i in range(16)]).reshape(4, 4)
    ahead = Gaussian(np.array([50.0, 50.0, 1.0, -2.0]), 9.0 * spread @ spread.T + 0.1 * np.eye(4))
    ids = list(header.bank.positions)
    found = choice.smallest(header.bank, ids, ahead, count)
    assert len(set(found)) == count
    assert trace(header, found, ahead) == pytest.approx(brute(header, ids, ahead, count), rel=1e-9)


@pytest.mark.parametrize("seed", range(5))
def test_of_too_many_sets_one_is_found_sensor_by_sensor(seed: int) -> None:
    header = header_at(places_of(seed, 24), "elected", count=4)
    ids = list(header.bank.positions)
    assert comb(len(ids), 4) > choice.MOST_SETS
    ahead = Gaussian(np.array([50.0, 50.0, 0.0, 0.0]), np.diag([9.0, 2.0, 1.0, 1.0]))
    expected = list[str]()
    for _ in range(4):
        left = [id for id in ids if id not in expected]
        expected.append(min(left, key=lambda id: trace(header, [*expected, id], ahead)))
    found = choice.smallest(header.bank, ids, ahead, 4)
    assert trace(header, found, ahead) == pytest.approx(trace(header, expected, ahead), rel=1e-9)
    assert trace(header, found, ahead) < trace(header, choice.by_distance(header.bank, ids, ahead.mean)[:4], ahead) + 1


def test_few_are_all_taken() -> None:
    header = header_at(grid(1), "elected")
    _, leads = leads_at(header, (5.0, 5.0))
    known = header.bank.ahead(leads.progress.tracks)
    assert known is not None
    assert choice.smallest(header.bank, ["n00", "n01"], known[1], 3) == ["n00", "n01"]
    assert choice.smallest(header.bank, [], known[1], 3) == []


def test_an_elected_head_picks_among_those_that_joined_and_then_the_nearest() -> None:
    header = header_at(grid(5), "elected")
    memory, leads = leads_at(header, (45.0, 15.0))
    memory = replace(memory, joined=Map({"n08": STEP + 1, "n09": STEP + 1, "n07": STEP + 9, "n02": STEP}))
    assert set(chosen(header, memory, leads)) == {"n07", "n08", "n09"}
    memory = replace(memory, joined=Map({"n09": STEP + 1}))
    assert chosen(header, memory, replace(leads, came=frozenset({"n08"}))) == ("n08", "n09", "n02")
    assert chosen(header, replace(memory, joined=Map()), leads) == ("n02", "n03", "n04")


@pytest.mark.parametrize("manner", MANNERS)
def test_without_a_track_it_looks_around_itself_first_with_those_that_sense_something(manner: Manner) -> None:
    """It has more of them measure than with a track, as far as there are slots."""
    header = header_at(grid(4), manner, count=3, search=4)
    memory, leads = leads_at(header, None)
    assert set(chosen(header, memory, leads)) == {"n00", "n01", "n02", "n03"}
    memory = replace(memory, joined=Map({"n07": 99, "n06": 99}))
    assert chosen(header, memory, leads) == ("n00", "n06", "n07", "n01")


# --- who is missed ----------------------------------------------------------------------------------------------------


def test_one_that_does_not_answer_three_polls_in_a_row_is_left_alone() -> None:
    header = header_at(grid(2))
    _, leads = leads_at(header, (15.0, 15.0), asked=("n00", "n01", "n02", "n03"), came=frozenset({"n00", "n01"}))
    leads = replace(leads, deaf=frozenset({"n02"}), missing={"n01": 2, "n03": 1}, avoided={"n05": STEP, "n06": 9})
    missing, avoided = choice.missed(leads)
    assert (missing, avoided) == ({"n03": 2}, {"n06": 9, "n02": STEP + choice.DEAF})
    missing, avoided = choice.missed(replace(leads, missing=missing))
    assert (missing, avoided["n03"]) == ({}, STEP + choice.PAUSE)


# --- who leads next ---------------------------------------------------------------------------------------------------


def heard_all(header: Header, at: Place, **leads: Any) -> tuple[Memory, Leadership]:
    """All that it asked reported, and who measures next is chosen."""
    memory, led = leads_at(header, at)
    led = replace(led, chosen=chosen(header, memory, led))
    asked = leads.pop("asked", tuple(header.settings.numbers))
    led = replace(led, asked=asked, came=frozenset(leads.pop("came", asked)), **leads)
    return replace(memory, leads=led), led


def test_a_sticky_head_leads_on_while_it_measures_and_another_while_it_is_the_nearest() -> None:
    for at, sticky, plain in (
        ((5.0, 5.0), [], []),
        ((25.0, 6.0), [], ["n02", "n03"]),
        ((62.0, 5.0), ["n04", "n05"], ["n04", "n05"]),
    ):
        header = header_at(grid(5))
        assert nominees(header, *heard_all(header, at)) == sticky
        other = header_at(grid(5), sticky=False)
        assert nominees(other, *heard_all(other, at)) == plain


def test_only_those_that_listen_are_nominated_unless_all_always_do() -> None:
    at = (62.0, 5.0)
    for came, expected in ((("n02", "n05"), ["n05", "n02"]), (("n00",), [])):
        header = header_at(grid(5))
        assert nominees(header, *heard_all(header, at, came=came)) == expected
        always = header_at(grid(5), always_on=True)
        assert nominees(always, *heard_all(always, at, came=came)) == ["n04", "n05"]
    header = header_at(grid(5))
    memory, leads = heard_all(header, at, came=("n02",))
    assert nominees(header, memory, replace(leads, deaf=frozenset({"n03"}))) == ["n02", "n03"]


def test_those_that_measure_next_are_nominated_first_and_farther_ones_never() -> None:
    header = header_at(grid(5))
    memory, leads = heard_all(header, (62.0, 5.0))
    assert nominees(header, memory, replace(leads, chosen=("n06", "n05"))) == ["n05", "n06"]
    assert nominees(header, *heard_all(header, (-40.0, 0.0))) == []


@pytest.mark.parametrize(("x", "expected"), [(24.0, []), (26.0, ["n02"]), (70.0, ["n04", "n02"])])
def test_an_elected_head_leads_on_while_the_target_is_within_half_its_range(x: float, expected: list[str]) -> None:
    places = [(0.0, 0.0), (500.0, 0.0), (30.0, 0.0), (500.0, 9.0), (60.0, 0.0)]
    header = header_at(places, "elected", keep_within_m=RANGE_M / 2)
    memory, leads = heard_all(header, (x, 0.0))
    assert nominees(header, memory, leads) == expected


def test_without_a_track_it_hands_over_to_nobody() -> None:
    header = header_at(grid(4))
    memory, leads = leads_at(header, None, asked=("n01",), came=frozenset({"n01"}))
    assert nominees(header, memory, leads) == []
    assert choice.unreached(header.settings, header.bank, leads) == []


def test_a_head_that_is_near_only_among_those_that_it_hears_hands_over() -> None:
    """Four are nearer to the target than it, and it hears two of them."""
    header = header_at(grid(5))
    memory, leads = heard_all(header, (75.0, 15.0))
    memory = replace(memory, near=Map({"n02": ANNOUNCEMENTS, "n03": ANNOUNCEMENTS, "n01": ANNOUNCEMENTS}))
    leads = replace(leads, chosen=chosen(header, memory, leads), asked=("n00", "n01", "n02", "n03"))
    assert leads.chosen == ("n00", "n02", "n03", "n01")
    assert nominees(header, memory, leads) == ["n02", "n03"]


def test_one_that_is_near_among_all_leads_on_though_some_are_beyond() -> None:
    beyond = (("f0", 14.0, 14.0), ("f1", 16.0, 16.0))
    header = header_at(grid(1), beyond=beyond, count=3)
    memory, leads = heard_all(header, (14.0, 14.0))
    assert nominees(header, memory, leads) == []
    assert choice.unreached(header.settings, header.bank, leads) == ["f0", "f1"]
    third = header_at(grid(1), beyond=(*beyond, ("f2", 15.0, 15.0)), count=3)
    assert nominees(third, *heard_all(third, (14.0, 16.0))) == ["n01"]
