"""Clusters at the corners of pentagons."""

from __future__ import annotations

from itertools import pairwise
from math import cos, hypot, radians, sin
from typing import Any

import numpy as np
import pytest

from trackfield.errors import ScenarioError
from trackfield.scenario import Scenario, survey
from trackfield.scenario.layouts import Ground
from trackfield.scenario.layouts.pentagon import places_along
from trackfield.world.path import Path
from trackfield.world.targets import waypoints
from trackfield.world.windows import Array, distances

EAST = waypoints([(0, -200, 0), (30, 200, 0)])
JITTER = ((0.05, -0.08), (0.10, 0.05), (-0.08, 0.10), (0.06, -0.05), (-0.10, 0.02))
"""Of the deployment that the paper's experiments are repeated with."""


def laid_out(*paths: Path, seed: int = 1, **field: Any) -> tuple[list[str], Array]:
    """Ids and places (n, 2)."""
    section = {"layout": "pentagon", **field}
    scenario = Scenario.load({"name": "mine", "seed": seed, "target": {"path": "s1"}, "field": section})
    sensors, centre = scenario.field.stand(Ground(seed, paths or (EAST,), None, lambda: None))
    assert centre is None
    return [id for id, *_ in sensors], np.array([place[1:] for place in sensors])


def test_a_regular_cluster_has_its_first_corner_due_north_and_goes_on_anticlockwise() -> None:
    ids, places = laid_out(centres=[[100, -50]], corner_m=10.0, displaced=False)
    corners = [(100 + 10 * cos(radians(a)), -50 + 10 * sin(radians(a))) for a in (90, 162, 234, 306, 378)]
    assert ids == ["n000", "n001", "n002", "n003", "n004"]
    assert places == pytest.approx(np.array(corners), abs=1e-9)


def test_corners_are_displaced_in_radii() -> None:
    regular, usual = (laid_out(centres=[[0, 0]], corner_m=30.0, **more)[1] for more in ({"displaced": False}, {}))
    assert usual - regular == pytest.approx(30.0 * np.array(JITTER), abs=1e-9)
    own = [[0, 0], [0, 0], [1, -1], [0, 0], [0, 0]]
    assert laid_out(centres=[[0, 0]], corner_m=30.0, displaced=own)[1] - regular == pytest.approx(30.0 * np.array(own))


def test_sides_are_within_one_and_a_half_radii_and_diagonals_are_not() -> None:
    """So a radio that reaches 1.5 R hops along the sides (Yang et al., section 4)."""
    _, places = laid_out(centres=[[0, 0]])
    apart = {(i, j): hypot(*(places[i] - places[j])) for i in range(5) for j in range(i)}
    sides = {(1, 0), (2, 1), (3, 2), (4, 3), (4, 0)}
    assert {pair for pair, d in apart.items() if d < 30.0} == sides


def test_clusters_stand_where_they_are_told_one_after_the_other() -> None:
    ids, places = laid_out(centres=[[0, 0], [0, 60], [500, 500]])
    assert ids == [f"n{i:03}" for i in range(15)]
    assert places[5:10] - places[:5] == pytest.approx(np.tile([0.0, 60.0], (5, 1)))
    assert places[10:] - places[:5] == pytest.approx(np.tile([500.0, 500.0], (5, 1)))


@pytest.mark.parametrize("seed", range(1, 6))
@pytest.mark.parametrize("least", [0.0, 2.0, 4.0])
def test_along_a_path_no_target_passes_too_close_and_it_goes_through_each_cluster(seed: int, least: float) -> None:
    other = waypoints([(0, 0, -200), (30, 10, 200)])
    _, places = laid_out(EAST, other, seed=seed, min_pass_m=least)
    assert len(places) == 5 * 6  # 400 m with one every 60 m
    if least:
        assert min(distances(places, path, 100.0).min() for path in (EAST, other)) >= least
    middles = places.reshape(-1, 5, 2).mean(axis=1)
    assert np.abs(middles[:, 1]).max() < 10.5  # half a radius, and the mean displacement
    assert [b - a for a, b in pairwise(middles[:, 0])] == pytest.approx([60.0] * 5, abs=21.0)
    assert len(set(middles[:, 1].tolist())) == 6


def test_another_seed_draws_other_offsets() -> None:
    assert not np.array_equal(laid_out(seed=1)[1], laid_out(seed=2)[1])
    assert np.array_equal(laid_out(seed=1)[1], laid_out(seed=1)[1])


def test_places_are_spread_over_the_path_by_its_length_not_its_time() -> None:
    slow_then_fast = waypoints([(0, 0, 0), (100, 100, 0), (110, 100, 300)])
    places = places_along(slow_then_fast, 100.0)
    expected = np.array([[50.0, 0.0], [100.0, 50.0], [100.0, 150.0], [100.0, 250.0]])
    assert places == pytest.approx(expected, abs=0.2)


def test_a_path_that_comes_back_has_no_second_cluster_there() -> None:
    there_and_back = waypoints([(0, 0, 0), (10, 120, 0), (20, 0, 0)])
    assert places_along(there_and_back, 60.0) == pytest.approx(np.array([[30.0, 0.0], [90.0, 0.0]]), abs=0.2)


def test_a_short_path_has_one_cluster_at_its_middle() -> None:
    short = waypoints([(0, 0, 0), (10, 0, 8)])
    assert places_along(short, 60.0) == pytest.approx(np.array([[0.0, 4.0]]))
    still = waypoints([(0, 7, 7), (10, 7, 7)])
    assert places_along(still, 60.0) == pytest.approx(np.array([[7.0, 7.0]]))


def test_no_room_to_pass_is_an_error() -> None:
    with pytest.raises(ScenarioError, match=r"field\.min_pass_m: there is no place near \(.*less than 15"):
        laid_out(min_pass_m=15.0)


def test_too_many_clusters_are_an_error() -> None:
    with pytest.raises(ScenarioError, match=r"field\.every_m: the field has .* places or more"):
        laid_out(every_m=0.001)


def test_without_a_path_it_needs_centres() -> None:
    scenario = Scenario.load({"name": "mine", "target": {"path": "s1"}, "field": {"layout": "pentagon"}})
    with pytest.raises(ScenarioError, match=r"field\.layout: is 'pentagon', and the recording does not say"):
        scenario.field.stand(Ground(1, (), None, lambda: None))


@pytest.mark.parametrize(
    ("field", "said"),
    [
        (
            {"displaced": True},
            "field.displaced: is true; expected false, or a list of 5 [east, north], each from -1 to 1",
        ),
        ({"displaced": [[0, 0]]}, "field.displaced: is [[0, 0]]; expected false, or a list of 5"),
        (
            {"displaced": [[0, 2]] * 5},
            "field.displaced: is [[0, 2], [0, 2], [0, 2], [0, 2], [0, 2]]; expected false, or",
        ),
        ({"centres": []}, "field.centres: is []; expected a list of at least one [x_m, y_m]"),
        ({"corner_m": 0}, "field.corner_m: is 0; expected a number from 0.001"),
        ({"spacing_m": 20.0}, "field.spacing_m: "),
    ],
)
def test_bad_keys_are_said(field: dict[str, Any], said: str) -> None:
    with pytest.raises(ScenarioError) as error:
        laid_out(**field)
    assert said in str(error.value)


def test_a_scenario_that_is_written_is_read_again() -> None:
    for field in ({}, {"displaced": False}, {"centres": [[0, 0], [60, 1.5]]}):
        plain = {"name": "mine", "target": {"path": "s1"}, "field": {"layout": "pentagon", **field}}
        scenario = Scenario.load(plain)
        assert Scenario.load(scenario.plain()) == scenario


def test_the_bus_drives_past_clusters_along_its_track() -> None:
    site = survey(Scenario.load("bus", {"field": {"layout": "pentagon"}}))
    assert len(site.sensors) % 5 == 0
    assert len(site.sensors) >= 25
    places = np.array([place[1:] for place in site.sensors])
    assert distances(places, site.paths["target"], 200.0).min() >= 2.0
