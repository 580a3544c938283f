"""Fields that are no plain grid: jittered, random, ring."""

from __future__ import annotations

from math import hypot
from typing import Any

import numpy as np
import pytest

from trackfield.scenario import Scenario, survey
from trackfield.scenario.layouts import Ground
from trackfield.world.targets import waypoints
from trackfield.world.windows import Array

EASTWARD = waypoints([(0, 0, 0), (10, 500, 0)])


def laid_out(seed: int = 1, **field: Any) -> tuple[list[str], Array]:
    """Ids and places (n, 2)."""
    scenario = Scenario.load({"name": "mine", "seed": seed, "target": {"path": "s1"}, "field": field})
    sensors, centre = scenario.field.stand(Ground(seed, (EASTWARD,), "fusion", lambda: None))
    assert centre is None
    return [id for id, *_ in sensors], np.array([place[1:] for place in sensors])


# --- jittered ---------------------------------------------------------------------------------------------------------


def test_a_jittered_grid_has_the_grids_sensors_each_near_its_place() -> None:
    for field in ({}, {"nodes": 1000}, {"spacing_m": 7.0, "extent_m": 100.0}):
        ids, grid = laid_out(layout="grid", **field)
        for jitter in (0.0, 0.25, 1.0):
            names, places = laid_out(layout="jittered", jitter=jitter, **field)
            assert names == ids
            reach = jitter * field.get("spacing_m", 50.0)
            assert np.abs(places - grid).max() <= reach
            assert (jitter == 0.0) == np.array_equal(places, grid)


def test_jitter_is_uniform_and_independent_in_both_directions() -> None:
    grid, places = (laid_out(layout=kind, nodes=10_000)[1] for kind in ("grid", "jittered"))
    off = (places - grid) / (0.25 * 50.0)
    # Standard errors of 10^4 draws from U(-1, 1): mean 0.0058, variance (1/3) 0.0030, correlation 0.01.
    assert np.abs(off.mean(axis=0)).max() < 5 * 0.0058
    assert np.abs(off.var(axis=0) - 1 / 3).max() < 5 * 0.0030
    assert abs(np.corrcoef(off.T)[0, 1]) < 0.05
    assert np.abs(off).max() > 0.999


def test_more_jitter_moves_each_sensor_the_same_way() -> None:
    grid, little, much = (laid_out(layout="jittered", jitter=share)[1] for share in (0.0, 0.1, 0.5))
    assert much - grid == pytest.approx(5 * (little - grid), abs=1e-9)


# --- random -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("field", "number", "side"),
    [
        ({}, 100, 500.0),
        ({"spacing_m": 25.0}, 400, 500.0),
        ({"extent_m": 10.0}, 1, 10.0),
        ({"extent_m": 0.0}, 1, 0.0),
        ({"nodes": 1}, 1, 50.0),
        ({"nodes": 400}, 400, 1000.0),
        ({"nodes": 7, "spacing_m": 10.0}, 7, 10 * 7**0.5),
    ],
)
def test_a_random_field_has_a_sensor_to_each_square_of_its_spacing(
    field: dict[str, float], number: int, side: float
) -> None:
    ids, places = laid_out(layout="random", **field)
    assert ids == [f"n{i:03}" for i in range(number)]
    assert places.min() >= 0.0
    assert places.max() <= side


def test_random_places_are_uniform_in_the_square() -> None:
    _, places = laid_out(layout="random", nodes=10_000)
    cells = np.histogram2d(*places.T, bins=10, range=[[0, 5000], [0, 5000]])[0]
    assert cells.sum() == 10_000
    # Chi-square with 99 degrees of freedom: mean 99, sd 14.1; 5 sd on either side.
    assert abs((np.square(cells - 100) / 100).sum() - 99) < 70


# --- ring -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("nodes", "radius"), [(1, 250.0), (4, 100.0), (30, 250.0), (1001, 3.0)])
def test_a_ring_is_round_and_even(nodes: int, radius: float) -> None:
    ids, places = laid_out(layout="ring", nodes=nodes, radius_m=radius)
    assert (len(ids), len(set(ids))) == (nodes, nodes)
    off = places - radius
    assert np.hypot(*off.T) == pytest.approx(radius)
    steps = np.diff(np.unwrap(np.arctan2(off[:, 0], off[:, 1])))
    assert steps == pytest.approx(2 * np.pi / nodes)


def test_a_ring_goes_round_from_north_by_east() -> None:
    ids, places = laid_out(layout="ring", nodes=4, radius_m=100.0)
    assert ids == ["n000", "n001", "n002", "n003"]
    assert places == pytest.approx(np.array([(100.0, 200.0), (200.0, 100.0), (100.0, 0.0), (0.0, 100.0)]))


def test_the_centre_stands_in_the_middle_of_a_ring_unless_told_otherwise() -> None:
    ring = Scenario.load("spcpf", {"field.layout": "ring", "field.radius_m": 80.0, "field.nodes": 8})
    assert survey(ring).centre == pytest.approx((80.0, 80.0))
    assert survey(ring.set("fusion.y_m", -3)).centre == pytest.approx((80.0, -3.0))


# --- the seed ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["jittered", "random"])
def test_the_seed_decides_every_place(kind: str) -> None:
    first, again, other = (laid_out(seed, layout=kind)[1] for seed in (1, 1, 2))
    assert np.array_equal(first, again)
    assert not np.isclose(first, other).any()


@pytest.mark.parametrize("kind", ["grid", "ring", "along-path"])
def test_a_regular_field_is_the_same_for_all_seeds(kind: str) -> None:
    assert np.array_equal(laid_out(1, layout=kind)[1], laid_out(2, layout=kind)[1])


@pytest.mark.parametrize("kind", ["jittered", "random", "ring"])
def test_about_so_many_nodes_on_the_command_line(kind: str) -> None:
    for nodes in (9, 100, 2500):
        ids, _ = laid_out(layout=kind, nodes=nodes)
        assert len(ids) == nodes
        assert len({len(id) for id in ids}) == 1


@pytest.mark.parametrize("kind", ["jittered", "random"])
def test_every_layout_can_be_planned(kind: str) -> None:
    site = survey(Scenario.load("spcpf", {"field.layout": kind}))
    sensors = [site.sensor(i) for i in range(len(site.sensors))]
    states = [site.paths["target"].at(float(step)) for step in range(site.steps + 1)]
    for step, state in enumerate(states):
        assert state is not None
        for sensor in sensors:
            near = hypot(state[0] - sensor.position[0], state[1] - sensor.position[1]) < 70.0  # audible to 71 m
            assert (sensor.sample(step * site.step_ns) is not None) >= near
