"""Which sensors measure at the next step: each policy on fields where the answer is known."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import Final

import numpy as np
import pytest

from trackfield.filters.measurement import sensing_information
from trackfield.filters.types import Array, Gaussian, Model, Readings, Reports
from trackfield.sensing.kinds import make_sensor
from trackfield.tracking.selection import (
    POLICIES,
    All,
    Closest,
    Cluster,
    Grounds,
    InformationK,
    NearestK,
    Trace,
    informations,
)

MODEL: Final = Model({"range": make_sensor("range", {"range_m": 1000.0, "floor_sd_m": 1.0, "growth_m": 0.05})})
P: Final = np.diag([25.0, 16.0, 1.0, 1.0])


def reports_of(ids: Sequence[str], positions: Mapping[str, tuple[float, float]]) -> Reports:
    at = np.array([positions[id] for id in ids]).reshape(-1, 2)
    return Reports(0, tuple(ids), at, (Readings("range", np.zeros((len(ids), 1)), None),), 1, False)


def grounds(
    clusters: Sequence[tuple[str, tuple[float, float], Mapping[str, tuple[float, float]]]],
    target: tuple[float, float],
    *,
    ahead: tuple[float, float] | None = None,
    leader: str = "",
    covariance: Array = P,
) -> Grounds:
    positions = {id: place for _, _, members in clusters for id, place in members.items()}
    found = [Cluster(id, place, tuple(members)) for id, place, members in clusters]
    mean, there = np.array([*target, 0.0, 0.0]), np.array([*(ahead or target), 0.0, 0.0])
    return Grounds(
        found,
        mean,
        Gaussian(there, covariance),
        positions,
        lambda ids, state: informations(MODEL, state, reports_of(ids, positions)),
        leader,
    )


ROW: Final = [
    ("m0", (0.0, 0.0), {"a": (-10.0, 5.0), "b": (10.0, 8.0)}),
    ("m1", (100.0, 0.0), {"c": (95.0, 12.0)}),
    ("m2", (200.0, 0.0), {"d": (190.0, -10.0), "e": (205.0, 15.0), "f": (210.0, -5.0)}),
    ("m3", (130.0, 0.0), {}),
]


def test_the_closest_master_leads_and_its_slaves_measure() -> None:
    choice = Closest().choose(grounds(ROW, (30.0, 0.0)))
    assert choice == ("m0", {"m0": ("a", "b")})
    assert choice.measuring == 2
    assert Closest().choose(grounds(ROW, (125.0, 0.0))) == ("m3", {"m3": ()})  # blind, and it stays so


def test_clusters_are_merged_until_three_measure() -> None:
    policy = POLICIES["merge_until_3"]
    assert policy.choose(grounds(ROW, (30.0, 0.0))) == ("m0", {"m0": ("a", "b"), "m1": ("c",)})
    assert policy.choose(grounds(ROW, (125.0, 0.0))) == ("m3", {"m3": (), "m1": ("c",), "m2": ("d", "e", "f")})
    assert policy.choose(grounds(ROW[:2], (30.0, 0.0))).measuring == 3  # all that there are
    assert policy.choose(grounds(ROW[1:2], (30.0, 0.0))).measuring == 1


def test_the_choice_is_by_the_estimate_and_not_by_where_it_will_be() -> None:
    assert Closest().choose(grounds(ROW, (49.0, 0.0), ahead=(60.0, 0.0))).leader == "m0"
    near = NearestK(2).choose(grounds(ROW, (49.0, 0.0), ahead=(200.0, 0.0)))
    assert near == ("m0", {"m2": ("f", "d")})


def test_all_measure() -> None:
    assert All().choose(grounds(ROW, (30.0, 0.0))).measuring == 6


def test_the_information_of_each_adds_up_to_that_of_all() -> None:
    here = grounds(ROW, (30.0, 10.0))
    ids, state = list(here.positions), here.ahead.mean
    each = informations(MODEL, state, reports_of(ids, here.positions))
    assert each.sum(axis=0) == pytest.approx(sensing_information(MODEL, state, reports_of(ids, here.positions)))
    for id, one in zip(ids, each, strict=True):
        assert one == pytest.approx(sensing_information(MODEL, state, reports_of([id], here.positions)))


def left_by(here: Grounds, ids: Sequence[str]) -> float:
    J = np.linalg.inv(here.ahead.covariance) + here.information(ids, here.ahead.mean).sum(axis=0)
    return float(np.trace(np.linalg.inv(J)[:2, :2]))


@pytest.mark.parametrize("seed", range(5))
def test_the_most_informative_are_chosen_one_after_the_other(seed: int) -> None:
    rng = np.random.default_rng(seed)
    field = [(f"m{i}", (0.0, 0.0), {f"s{i}": tuple(rng.uniform(-80, 80, 2))}) for i in range(9)]
    here = grounds(field, (0.0, 0.0))
    one = min(here.positions, key=lambda id: left_by(here, [id]))
    assert set(InformationK(1).choose(here).sensors) == {f"m{one[1:]}"}
    two = min((id for id in here.positions if id != one), key=lambda id: left_by(here, [one, id]))
    chosen = [id for ids in InformationK(2).choose(here).sensors.values() for id in ids]
    assert chosen == [one, two]
    best = min(left_by(here, pair) for pair in combinations(here.positions, 2))
    assert left_by(here, chosen) <= 1.25 * best


def test_more_than_there_are_are_all() -> None:
    assert InformationK(50).choose(grounds(ROW, (30.0, 0.0))).measuring == 6
    assert NearestK(50).choose(grounds(ROW, (30.0, 0.0))).measuring == 6


def test_the_cluster_that_leaves_the_least_leads_unless_another_is_little_worse() -> None:
    field = [
        ("m0", (-20.0, 0.0), {"a": (-20.0, 0.0), "b": (0.0, -20.0)}),
        ("m1", (22.0, 0.0), {"c": (22.0, 0.0), "d": (0.0, 22.0)}),
        ("m2", (300.0, 0.0), {"e": (300.0, 0.0)}),
    ]
    assert Trace().choose(grounds(field, (0.0, 0.0))).leader == "m0"
    assert Trace().choose(grounds(field, (0.0, 0.0), leader="m1")) == ("m1", {"m1": ("c", "d")})  # 20 % or less
    assert Trace().choose(grounds(field, (0.0, 0.0), leader="m2")).leader == "m0"
    assert Trace(hysteresis=0.0).choose(grounds(field, (0.0, 0.0), leader="m1")).leader == "m0"


@pytest.mark.parametrize("name", POLICIES)
def test_a_field_without_slaves_has_a_leader_all_the_same(name: str) -> None:
    choice = POLICIES[name].choose(grounds([("m0", (9.0, 0.0), {}), ("m1", (5.0, 0.0), {})], (0.0, 0.0)))
    assert (choice.leader, choice.measuring) == ("m1", 0)
