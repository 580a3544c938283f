"""The path ``drifting``: the noise of Özfidan et al. (2018), eqs. 5 and 6, and the square that it does not leave.

Each comparison of drawn numbers fails for correct code in one of ten thousand seeds at most; they draw by key.
"""

from __future__ import annotations

import json
from dataclasses import replace
from itertools import pairwise
from math import atan2, degrees, hypot, sqrt
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from scipy import stats

from launcher.reproduce.papers.ozfidan.field import Q, Setup, T, drawn
from tests.running import Run
from trackfield.errors import ScenarioError
from trackfield.models.motion import transition, white_acceleration
from trackfield.scenario import Scenario, survey
from trackfield.scenario.survey import target_paths
from trackfield.world.drift import MOST_DRAWN, TRIES, Drift

FREE = Drift(q=Q, speed_m_s=2.0, heading_deg=None, half_width_m=1e7)
NARROW = replace(FREE, half_width_m=400.0)
"""Of 150 steps of 2 s about half of the paths leave it."""
RANGES = {"kind": "range", "range_m": 30_000.0}


def scenario(**target: Any) -> Scenario:
    return Scenario.load({"name": "mine", "target": {"path": "drifting", **target}, "sensor": RANGES})


def states(path: Any) -> np.ndarray:
    """(T + 1, 4), with x, y, vx, vy at the knots."""
    return np.array([path.x, path.y, path.vx, path.vy]).T


def kicks(path: np.ndarray, step_s: float) -> np.ndarray:
    """(T, 2, 2): what each step of a path (T + 1, 4) adds to (place, velocity), x and y last, besides its motion."""
    moved = path[1:] - path[:-1] @ np.array(transition(step_s)).T
    return moved.reshape(-1, 2, 2)


# --- the motion -------------------------------------------------------------------------------------------------------


def test_the_noise_of_two_halves_of_a_step_is_that_of_the_whole() -> None:
    F = np.array([[1.0, 1.5], [0.0, 1.0]])
    half, whole = (np.array(white_acceleration(dt, 0.7)) for dt in (1.5, 3.0))
    assert F @ half @ F.T + half == pytest.approx(whole, rel=1e-12)
    assert whole == pytest.approx(0.7 * np.array([[9.0, 4.5], [4.5, 3.0]]), rel=1e-12)


@pytest.mark.parametrize(("q", "step_s"), [(0.01, 2.0), (0.01, 0.1), (3.0, 1.0)])
def test_each_step_adds_the_noise_of_the_paper(q: float, step_s: float) -> None:
    steps = 5000
    added = kicks(states(replace(FREE, q=q).path(3, steps, step_s)), step_s)
    expected = np.linalg.cholesky(np.array(white_acceleration(step_s, q)))
    normals = np.linalg.solve(expected, added.transpose(1, 0, 2).reshape(2, -1)).reshape(2, steps, 2)
    four = normals.transpose(0, 2, 1).reshape(4, steps)  # independent N(0, 1), if the noise is as it should be
    for one in four:
        assert stats.kstest(one, "norm").pvalue > 1e-4
        assert abs(np.mean(one[1:] * one[:-1])) < 4.5 / sqrt(steps)
    assert np.abs(np.cov(four) - np.eye(4)).max() < 4.5 * sqrt(2.0 / steps)


def test_it_moves_as_the_field_of_the_paper_does_in_batches() -> None:
    """Paths that stay in a square which half of them leave: places and speeds after a third of the time and all."""
    setup, number = Setup(masters=1, slaves=1, half_m=400.0, steps=150), 400
    batch = drawn(setup, range(number)).path
    own = np.stack([states(NARROW.path(seed, setup.steps, T)) for seed in range(number)])
    assert own.shape == batch.shape
    for k in (50, 150):
        for name, what in {
            "x": lambda s: s[:, 0],
            "vy": lambda s: s[:, 3],
            "distance": lambda s: np.hypot(s[:, 0], s[:, 1]),
            "speed": lambda s: np.hypot(s[:, 2], s[:, 3]),
            "outwards": lambda s: (s[:, :2] * s[:, 2:]).sum(axis=-1),
        }.items():
            assert stats.ks_2samp(what(own[:, k]), what(batch[:, k])).pvalue > 1e-4, (k, name)


def test_between_two_steps_it_is_at_the_mean_of_all_motions_with_these_ends() -> None:
    step_s, at_s = 2.0, 0.6
    path = FREE.path(1, 5, step_s)
    before, after = (np.array([[1.0, dt], [0.0, 1.0]]) for dt in (at_s, step_s - at_s))
    there, rest = (np.array(white_acceleration(dt, Q)) for dt in (at_s, step_s - at_s))
    gain = there @ after.T @ np.linalg.inv(after @ there @ after.T + rest)
    for k, (a, b) in enumerate(pairwise(states(path))):
        found = path.at(k * step_s + at_s)
        assert found is not None
        for axis in (0, 1):
            expected = before @ a[axis::2]
            expected = expected + gain @ (b[axis::2] - after @ expected)
            assert found[axis::2] == pytest.approx(expected, abs=1e-9)


def test_without_noise_it_goes_straight_on() -> None:
    path = replace(FREE, q=0.0, heading_deg=90.0, start=(10.0, -20.0)).path(1, 30, 0.5)
    assert path.x == pytest.approx([10.0 + k for k in range(31)])
    assert path.y == pytest.approx([-20.0] * 31)


# --- the start --------------------------------------------------------------------------------------------------------


def test_it_starts_where_as_fast_and_in_the_direction_that_it_is_told() -> None:
    for heading, (vx, vy) in {0.0: (0, 3), 90.0: (3, 0), 180.0: (0, -3), -90.0: (-3, 0)}.items():
        (x, *_), (y, *_), vxs, vys = states(Drift(0.01, 3.0, heading, 1e4, (5.0, 7.0)).path(1, 3, 1.0)).T
        assert (x, y, vxs[0], vys[0]) == pytest.approx((5, 7, vx, vy), abs=1e-12)


def test_a_direction_that_is_not_told_may_be_any() -> None:
    starts = [FREE.path(seed, 1, 1.0).at(0.0) for seed in range(400)]
    speeds = [start[2:] for start in starts if start]
    assert [hypot(*speed) for speed in speeds] == pytest.approx([2.0] * 400)
    turned = [degrees(atan2(*speed)) % 360.0 for speed in speeds]
    assert stats.kstest(turned, "uniform", args=(0.0, 360.0)).pvalue > 1e-4


def test_a_seed_has_one_path_and_another_seed_or_id_another() -> None:
    assert FREE.path(1, 9, 1.0) == FREE.path(1, 9, 1.0)
    others = [FREE.path(2, 9, 1.0), FREE.path(1, 9, 1.0, "van")]
    assert FREE.path(1, 9, 1.0) not in others
    assert others[0] != others[1]


# --- the square -------------------------------------------------------------------------------------------------------


def test_it_stays_in_the_square_around_its_start() -> None:
    left = 0
    for seed in range(40):
        here, there = (NARROW.path(seed, 150, 2.0), replace(NARROW, start=(1000.0, -50.0)).path(seed, 150, 2.0))
        away = np.abs(states(here)[:, :2])
        assert len(away) == 151
        assert away.max() <= 400.0
        assert states(there) - states(here) == pytest.approx(np.tile([1000.0, -50.0, 0.0, 0.0], (151, 1)), abs=1e-6)
        left += here != FREE.path(seed, 150, 2.0)
    assert 0 < left < 40  # those that would leave it are others, and only those


def test_a_path_that_leaves_is_drawn_again_as_a_whole() -> None:
    for seed in range(40):
        free = FREE.path(seed, 150, 2.0)
        stays = bool(np.abs(states(free)[:, :2]).max() <= 400.0)
        narrow = NARROW.path(seed, 150, 2.0)
        assert (narrow == free) is stays
        assert (narrow.vx[0] == free.vx[0]) is stays


def test_a_longer_run_goes_on_if_it_stays() -> None:
    assert FREE.path(1, 100, 1.0).x[:61] == FREE.path(1, 60, 1.0).x


@pytest.mark.parametrize("target", [{"half_width_m": 1.0}, {"half_width_m": 10.0, "speed_m_s": 0.0}])
def test_a_square_in_which_none_stays_is_one_error(target: dict[str, Any]) -> None:
    what = f"is {target['half_width_m']:g} m; {TRIES} paths of 1000 steps were drawn, and none stays within it"
    expected = "expected a wider square, or fewer steps, or a lower q or speed_m_s"
    with pytest.raises(ScenarioError, match=rf"^target\.half_width_m: {what}; {expected}$"):
        survey(scenario(**target))
    other = {"id": "a", "path": "drifting", **target}
    with pytest.raises(ScenarioError, match=rf"^targets\[0\]\.half_width_m: {what}; {expected}$"):
        survey(Scenario.load({"name": "mine", "targets": [other], "sensor": RANGES}))


def test_what_is_drawn_in_vain_ends_after_some_seconds() -> None:
    still = Drift(q=1e-9, speed_m_s=1.0, heading_deg=30.0, half_width_m=1000.0)
    with pytest.raises(ValueError, match=r"^(\d+) paths of 65535 steps") as caught:
        still.path(1, 65535, 1.0)
    tries = int(str(caught.value).split()[0])  # each leaves to the north, after about 1000 / cos(30 degrees) = 1155 s
    assert MOST_DRAWN / 1160 < tries < MOST_DRAWN / 1150 + 1


# --- the section ------------------------------------------------------------------------------------------------------


def test_a_scenario_has_the_path_of_its_seed() -> None:
    steps, paths = target_paths(scenario(step_s=2.0, steps=20))
    assert (steps, paths["target"]) == (20, replace(FREE, half_width_m=8000.0).path(1, 20, 2.0))
    _, others = target_paths(scenario(step_s=2.0, steps=20).set("seed", 2))
    assert others["target"] == FREE.path(2, 20, 2.0)


def test_without_a_number_of_steps_there_are_those_of_the_paper() -> None:
    steps, paths = target_paths(scenario(step_s=2.0))
    assert (steps, paths["target"].end_s) == (1000, 2000.0)


def test_several_of_them_have_paths_of_their_own() -> None:
    many = [{"id": id, "path": "drifting", "start_m": start} for id, start in (("a", [0, 0]), ("b", [100, 50]))]
    loaded = Scenario.load({"name": "mine", "targets": many, "sensor": RANGES}, {"targets": many})
    steps, paths = target_paths(loaded)
    assert steps == 1000
    assert paths["a"] == FREE.path(1, 1000, 1.0, "a")
    assert paths["b"] == replace(FREE, start=(100.0, 50.0)).path(1, 1000, 1.0, "b")
    beside = Scenario.load({"name": "mine", "target": {"path": "s1"}, "targets": many[1:], "sensor": RANGES})
    assert survey(beside).paths["b"] == paths["b"]


def test_written_it_reads_back_the_same(tmp_path: Path) -> None:
    whole = scenario(q=0.5, speed_m_s=0.0, heading_deg=45, start_m=[3, -4.5], half_width_m=50, steps=7, step_s=0.5)
    for one in (whole, scenario(), whole.set("targets", [{"id": "b", "path": "drifting", "q": 0}])):
        (tmp_path / "mine.toml").write_text(one.to_toml())
        assert Scenario.load(tmp_path / "mine.toml").plain() == one.plain()
        assert Scenario.load(json.loads(json.dumps(one.plain()))).plain() == one.plain()
        assert survey(Scenario.load(tmp_path / "mine.toml")).paths == survey(one).paths


@pytest.mark.parametrize(
    ("target", "message"),
    [
        ({"q": -1}, "target.q: is -1; expected a number from 0 to 1000000"),
        ({"q": 1e-12}, "target.q: is 1e-12; expected 0, or a number that is not within 1e-09 of it"),
        ({"half_width_m": 0}, "target.half_width_m: is 0; expected a number from 0.001 to 10000000"),
        ({"heading_deg": 400}, "target.heading_deg: is 400; expected a number from -360 to 360"),
        ({"start_m": [1]}, "target.start_m: is [1]; expected a list of 2, each a number from -10000000 to 10000000"),
        ({"start_m": [1, 2, 3]}, "target.start_m: has more than 2 entries; expected fewer"),
        ({"waypoints": []}, "target.waypoints: belongs to path waypoints, not to drifting"),
    ],
)
def test_what_it_cannot_be(target: dict[str, Any], message: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        scenario(**target)
    assert str(caught.value).startswith(message)
    assert len(str(caught.value).splitlines()) == 1


# --- a field and a run ------------------------------------------------------------------------------------------------


def test_a_field_at_random_has_its_middle_where_the_target_starts() -> None:
    """256 sensors over 16 km: the layout ``random`` has a corner at (0, 0), so the target starts at (8, 8) km."""
    field = {"layout": "random", "nodes": 256, "spacing_m": 1000.0}
    found = scenario(start_m=[8000, 8000], steps=200, step_s=2.0).set_all({f"field.{k}": v for k, v in field.items()})
    places = np.array([place[1:] for place in survey(found).sensors])
    assert places.shape == (256, 2)
    for axis in places.T:
        assert stats.kstest(axis, "uniform", args=(0.0, 16_000.0)).pvalue > 1e-4


def test_the_true_velocity_of_a_run_is_the_one_that_was_drawn(tmp_path: Path) -> None:
    one = scenario(step_s=0.7, steps=12, q=0.5, start_m=[100, 100]).set_all(
        {"field.layout": "grid", "field.extent_m": 200.0, "run.setup_s": 0.4, "fusion.trackers": ["ukf"]}
    )
    (tmp_path / "mine.toml").write_text(one.to_toml())
    code, said = (run := Run(tmp_path / "run", str(tmp_path / "mine.toml"), "--virtual")).finish()
    assert code == 0, said
    rows = pq.read_table(run.folder / "tracks.parquet").to_pydict()
    path = replace(FREE, q=0.5, half_width_m=8000.0, start=(100.0, 100.0)).path(1, 12, 0.7)
    assert rows["step"] == list(range(1, 13))
    truth = np.array([rows[f"true_{name}"] for name in ("x", "y", "vx", "vy")]).T
    assert (truth == states(path)[1:]).all()
