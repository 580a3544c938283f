"""The layout ``cells``: one sensor anywhere in each square cell, wherever a target goes.

Each comparison of drawn numbers fails for correct code in one of ten thousand seeds at most; they draw by key.
"""

from __future__ import annotations

from itertools import pairwise
from math import floor
from typing import Any

import numpy as np
import pytest
from scipy import stats

from trackfield.errors import ScenarioError
from trackfield.scenario import Scenario, survey
from trackfield.scenario.layouts import CellsSection, Ground
from trackfield.scenario.layouts.near_path import MOST_PLACES
from trackfield.world.path import Path
from trackfield.world.targets import s1, s2, s3, waypoints
from trackfield.world.windows import Array

EASTWARD = waypoints([(0, 0, 0), (10, 500, 0)])
FAR_WEST = waypoints([(0, 0, 0), (100, -9000, -6500)])


def laid_out(*paths: Path, seed: int = 1, **field: Any) -> tuple[list[str], Array]:
    """Ids and places (n, 2) of cells of 10 m, as far as 40 m from the paths, unless ``field`` says otherwise."""
    cells = CellsSection(**{"spacing_m": 10.0, "within_m": 40.0, **field})
    sensors, centre = cells.stand(Ground(seed, paths or (EASTWARD,), "fusion", lambda: None))
    assert centre is None
    return [id for id, *_ in sensors], np.array([place[1:] for place in sensors])


def by_cell(places: Array, side: float = 10.0) -> dict[tuple[int, int], tuple[float, float]]:
    found = {(floor(x / side), floor(y / side)): (x, y) for x, y in places.tolist()}
    assert len(found) == len(places)  # no cell has two
    return found


def every(side: float, seed: int, low: int, high: int) -> Array:
    """The sensors of all cells from ``low`` to ``high`` in both directions."""
    axis = np.arange(low, high)
    return CellsSection(spacing_m=side).places(np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2), seed)


@pytest.mark.parametrize("path", [EASTWARD, s1(1), s2(), s3()], ids=["eastward", "s1", "s2", "s3"])
def test_there_is_every_sensor_that_the_path_comes_near_to_and_no_other(path: Path) -> None:
    _, places = laid_out(path, within_m=40.0)
    states = np.array([path.at(t)[:2] for t in np.linspace(path.start_s, path.end_s, 5000)])
    around = every(10.0, 1, -20, 80)
    far = np.array([np.hypot(*(states - place).T).min() for place in around])
    sure, possible = (set(map(tuple, around[far <= limit].tolist())) for limit in (40.0 - 0.1, 40.0))
    found = set(map(tuple, places.tolist()))
    assert sure <= found <= possible
    assert len(sure) > 300


def test_each_cell_near_the_path_has_its_sensor() -> None:
    """A cell whose farthest corner is within reach has one, wherever in the cell it is."""
    _, places = laid_out(EASTWARD)
    sure = {(i, j) for i in range(50) for j in range(-3, 3)}  # |y| <= 30 m
    assert sure <= by_cell(places).keys()


def test_another_path_finds_the_same_sensors_where_both_come_by() -> None:
    one, other = (by_cell(laid_out(path)[1]) for path in (s1(1), waypoints([(0, 500, 0), (9, 0, 500)])))
    both = one.keys() & other.keys()
    assert len(both) > 20
    assert all(one[cell] == other[cell] for cell in both)
    assert one.keys() - both
    assert other.keys() - both


def test_two_targets_share_the_sensors_of_both_paths() -> None:
    alone = [set(map(tuple, laid_out(path)[1].tolist())) for path in (s1(1), s2())]
    _, together = laid_out(s1(1), s2())
    assert len(together) == len(set(map(tuple, together.tolist())))
    assert set(map(tuple, together.tolist())) == alone[0] | alone[1]


@pytest.mark.parametrize(("spacing", "within"), [(10.0, 20.0), (100.0, 400.0)])
def test_it_has_no_edge(spacing: float, within: float) -> None:
    """Eleven kilometres away as near the start, on either side of (0, 0)."""
    _, places = laid_out(FAR_WEST, spacing_m=spacing, within_m=within)
    for a, b in pairwise(np.linspace(0.0, 100.0, 41)):
        x, y = FAR_WEST.at((a + b) / 2)[:2]
        near = np.hypot(*(places - (x, y)).T) <= within
        # However they are drawn: at least so many cells, a quarter by area, are in the disc with all four corners.
        assert near.sum() >= np.pi * within**2 / spacing**2 / 4
    assert np.hypot(*places.T).max() > 11_000.0


def test_a_sensor_may_be_anywhere_in_its_cell_and_says_nothing_of_others() -> None:
    places = every(10.0, 3, -50, 50)
    share = places / 10.0 - np.floor(places / 10.0)
    for axis in share.T:
        assert stats.kstest(axis, "uniform").pvalue > 1e-4
    assert stats.pearsonr(*share.T).pvalue > 1e-4
    square = share.reshape(100, 100, 2)
    for axis in (0, 1):
        assert stats.pearsonr(square[1:, :, axis].ravel(), square[:-1, :, axis].ravel()).pvalue > 1e-4
        assert stats.pearsonr(square[:, 1:, axis].ravel(), square[:, :-1, axis].ravel()).pvalue > 1e-4
    mirrored = square[::-1, ::-1]  # cells whose column or row differ in sign only
    assert stats.pearsonr(square[:50].ravel(), mirrored[:50].ravel()).pvalue > 1e-4


def test_the_seed_decides_every_place() -> None:
    first, again, other = (by_cell(laid_out(seed=seed)[1]) for seed in (1, 1, 2))
    assert first == again
    assert not any(first[cell] == other[cell] for cell in first.keys() & other.keys())


def test_wider_cells_have_their_sensors_at_the_same_shares() -> None:
    assert every(100.0, 1, -5, 5) == pytest.approx(10.0 * every(10.0, 1, -5, 5))


def test_ids_count_from_the_south() -> None:
    ids, places = laid_out()
    assert ids == [f"n{i:03}" for i in range(len(ids))]
    assert places.tolist() == sorted(places.tolist(), key=lambda place: (place[1], place[0]))


@pytest.mark.parametrize("nodes", [1, 7, 60, 500])
def test_so_many_are_those_nearest_to_the_path(nodes: int) -> None:
    ids, places = laid_out(nodes=nodes)
    assert len(ids) == nodes
    _, everybody = laid_out(within_m=300.0)
    far = {(x, y): np.hypot(max(-x, x - 500, 0), y) for x, y in everybody.tolist()}
    chosen = set(map(tuple, places.tolist()))
    assert max(far[place] for place in chosen) <= min(far[place] for place in far.keys() - chosen) + 0.5


def test_a_whole_field_can_be_surveyed() -> None:
    site = survey(
        Scenario.load(
            {
                "name": "mine",
                "target": {"path": "s1"},
                "field": {"layout": "cells", "spacing_m": 10.0, "within_m": 40.0},
                "sensor": {"kind": "range", "range_m": 20.0},
            }
        )
    )
    places = np.array([place[1:] for place in site.sensors])
    assert places == pytest.approx(laid_out(s1(1))[1])
    for step in range(site.steps + 1):
        here = np.array(site.paths["target"].at(float(step))[:2])
        assert (np.hypot(*(places - here).T) <= 20.0).sum() >= 3  # those that measure


# --- what is wrong ----------------------------------------------------------------------------------------------------


def test_a_path_that_comes_near_none_has_no_sensors() -> None:
    expected = r"field.within_m: no sensors: .*; expected more than the diagonal of a cell of 1000 m"
    with pytest.raises(ScenarioError, match=expected):
        laid_out(waypoints([(0, 500, 500), (1, 501, 500)]), spacing_m=1000.0, within_m=0.5)


@pytest.mark.parametrize(
    ("field", "most"), [({"spacing_m": 0.01}, MOST_PLACES), ({"spacing_m": 0.5, "within_m": 100.0}, 200_000)]
)
def test_a_field_too_dense_for_any_machine(field: dict[str, float], most: int) -> None:
    what = rf"field.spacing_m: the field has \d{{6,}} places or more; expected a value that gives at most {most}"
    with pytest.raises(ScenarioError, match=what):
        laid_out(**field)


@pytest.mark.parametrize(
    ("field", "message"),
    [
        ({"spacing_m": 0}, "field.spacing_m: is 0; expected a number from 0.001"),
        ({"within_m": -1}, "field.within_m: is -1; expected a number from 0.001"),
        ({"nodes": 0}, "field.nodes: is 0; expected a whole number from 1 to 200000"),
        ({"extent_m": 100.0}, "field.extent_m: belongs to layout grid or jittered or random, not to cells"),
        ({"jitter": 0.5}, "field.jitter: belongs to layout jittered, not to cells"),
    ],
)
def test_what_it_cannot_be(field: dict[str, float], message: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        Scenario.load({"name": "mine", "target": {"path": "s1"}, "field": {"layout": "cells", **field}})
    assert str(caught.value).startswith(message)
