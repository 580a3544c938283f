"""From a scenario to sensors, a path and audible windows."""

from collections.abc import Callable
from dataclasses import replace
from math import hypot
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from trackfield.errors import ScenarioError
from trackfield.scenario import Scenario, survey
from trackfield.scenario.layouts import Ground
from trackfield.scenario.paths import MAX_STEPS
from trackfield.scenario.survey import target_paths
from trackfield.sensing.complete import Kind
from trackfield.sensing.doa import Doa as Arrays
from trackfield.wire import Doa, WireError, encode
from trackfield.world.targets import s1, s2, s3, waypoints
from trackfield.world.windows import distances

S = 1_000_000_000
DataFile = Callable[[str], Path]
EASTWARD = waypoints([(0, 0, 0), (10, 500, 0)])


def mine(field: dict[str, Any] | None = None, **target: Any) -> Scenario:
    target = target or {"path": "waypoints", "waypoints": [[0, 0, 0], [10, 500, 0]]}
    soon = {"deadline_s": 0.001}
    return Scenario.load({"name": "mine", "target": target, "field": field or {"layout": "grid"}, "fusion": soon})


def target_path(scenario: Scenario) -> tuple[int, Any]:
    """The number of steps, and the path of the only target."""
    steps, paths = target_paths(scenario)
    return steps, paths["target"]


def layout(scenario: Scenario, path: Any) -> Any:
    """The sensors alone."""
    sensors, centre = scenario.field.stand(Ground(scenario.seed, (path,), "fusion", lambda: None))
    assert centre is None
    return sensors


# --- layouts -----------------------------------------------------------------------------------------------


def test_the_papers_field_has_121_sensors_numbered_by_row() -> None:
    sensors = layout(Scenario.load("spcpf"), s1(1))
    assert len(sensors) == 121
    for row, column in ((0, 0), (0, 10), (1, 0), (4, 7), (10, 10)):
        number = row * 11 + column
        assert sensors[number] == (f"n{number:03}", 50.0 * column, 50.0 * row)


@pytest.mark.parametrize(("extent", "spacing", "side"), [(0, 50, 1), (49, 50, 1), (120, 50, 3), (0.3, 0.1, 4)])
def test_a_grid_fills_its_extent(extent: float, spacing: float, side: int) -> None:
    field = {"layout": "grid", "extent_m": extent, "spacing_m": spacing}
    assert len(layout(mine(field), EASTWARD)) == side**2


@pytest.mark.parametrize(
    ("nodes", "columns", "rows"), [(1, 1, 1), (2, 1, 2), (25, 5, 5), (121, 11, 11), (1000, 32, 31)]
)
def test_a_grid_of_about_so_many_nodes_keeps_its_spacing(nodes: int, columns: int, rows: int) -> None:
    sensors = layout(mine({"layout": "grid", "nodes": nodes, "spacing_m": 20.0}), EASTWARD)
    assert len(sensors) == rows * columns
    assert abs(len(sensors) - nodes) <= 0.05 * nodes
    assert sensors[-1][1:] == (20.0 * (columns - 1), 20.0 * (rows - 1))


def test_ids_grow_only_when_they_have_to() -> None:
    for nodes, last in ((10, "n008"), (1000, "n991"), (1024, "n1023"), (100_000, "n99855")):
        sensors = layout(mine({"layout": "grid", "nodes": nodes}), EASTWARD)
        assert sensors[-1][0] == last
        assert len({len(name) for name, *_ in sensors}) == 1


@pytest.mark.parametrize("path", [EASTWARD, s1(1), s2(), s3()], ids=["eastward", "s1", "s2", "s3"])
def test_along_a_path_sensors_stand_wherever_it_comes_near_and_nowhere_else(path: Any) -> None:
    field = {"layout": "along-path", "spacing_m": 40.0, "within_m": 130.0}
    sensors = layout(mine(field), path)
    places = {(x, y) for _, x, y in sensors}
    axis = 40.0 * np.arange(-30, 30) + 20.0
    every = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
    states = np.array([path.at(t)[:2] for t in np.linspace(path.start_s, path.end_s, 5000)])
    far = np.array([np.hypot(*(states - place).T).min() for place in every])
    sure, possible = ({(float(x), float(y)) for x, y in every[far <= limit]} for limit in (130.0 - 0.2, 130.0))
    assert sure <= places <= possible
    assert [name for name, *_ in sensors] == [f"n{i:03}" for i in range(len(sensors))]
    assert sensors == sorted(sensors, key=lambda place: (place[2], place[1]))


@pytest.mark.parametrize("nodes", [1, 7, 60, 500])
def test_so_many_along_a_path_are_those_nearest_to_it(nodes: int) -> None:
    sensors = layout(mine({"layout": "along-path", "nodes": nodes}), EASTWARD)
    assert len(sensors) == nodes
    everybody = layout(mine({"layout": "along-path", "within_m": 2000.0}), EASTWARD)
    places = {place[1:] for place in sensors}
    far = {(x, y): hypot(max(-x, x - 500, 0), y) for _, x, y in everybody}
    assert max(far[place] for place in places) <= min(far[place] for place in far.keys() - places) + 1.0


def test_a_path_that_comes_near_no_place_of_the_grid_has_no_sensors() -> None:
    field = {"layout": "along-path", "spacing_m": 1000.0, "within_m": 10.0}
    with pytest.raises(ScenarioError, match=r"field.within_m: no sensors.*; expected more than half the spacing"):
        layout(mine(field), EASTWARD)


@pytest.mark.parametrize("kind", ["grid", "jittered", "random", "along-path"])
def test_a_field_too_dense_for_any_machine(kind: str) -> None:
    with pytest.raises(ScenarioError, match=r"field.spacing_m: the field has \d{7,} places or more; expected a value"):
        layout(mine({"layout": kind, "spacing_m": 0.1}), EASTWARD)


@pytest.mark.parametrize("kind", ["grid", "jittered", "random"])
def test_a_field_as_large_as_numbers_go(kind: str) -> None:
    with pytest.raises(ScenarioError, match=r"field.spacing_m: the field has \d{11} places or more"):
        layout(mine({"layout": kind, "extent_m": 1e7, "spacing_m": 0.001}), EASTWARD)


# --- the target --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("target", "steps", "path"),
    [
        ({"path": "s1"}, 60, s1(1)),
        ({"path": "s2"}, 75, s2()),
        ({"path": "s3"}, 40, s3()),
        ({"path": "s1", "steps": 7}, 7, s1(1, 7)),
        ({"path": "s1", "step_s": 0.5}, 120, s1(1, 120, 0.5)),
        ({"path": "s2", "step_s": 0.5, "steps": 10}, 10, s2(5.0)),
        ({"path": "s3", "step_s": 3.0}, 13, s3(39.0)),
        ({"path": "waypoints", "waypoints": [[0, 0, 0], [10.9, 1, 1]]}, 10, None),
        ({"path": "waypoints", "waypoints": [[0, 0, 0], [10.9, 1, 1]], "steps": 3}, 3, None),
        ({"path": "waypoints", "waypoints": [[0, 0, 0], [10.9, 1, 1]], "steps": 30}, 10, None),
    ],
)
def test_a_run_lasts_its_steps_and_the_path_as_long(target: dict[str, Any], steps: int, path: Any) -> None:
    found = target_path(mine(**target))
    assert found[0] == steps
    assert found[1].end_s == steps * target.get("step_s", 1.0)
    assert path in (None, found[1])


@pytest.mark.parametrize("step_s", [0.001, 0.1, 0.3, 0.7, 1.1])
@pytest.mark.parametrize("kind", ["s1", "s2", "s3", "waypoints", "drifting"])
def test_the_target_is_there_at_every_step_to_the_last(kind: str, step_s: float) -> None:
    more = {"waypoints": [[0, 0, 0], [33.3, 1, 1]]} if kind == "waypoints" else {"steps": 101}
    steps, path = target_path(mine(path=kind, step_s=step_s, **more))
    step_ns = round(step_s * S)
    assert path.at(steps * step_ns / S) is not None
    assert path.at((steps * step_ns + 1000) / S) is None


def test_another_seed_moves_s1() -> None:
    scenario = mine(path="s1")
    assert target_path(scenario)[1] == s1(1)
    assert target_path(scenario.set("seed", 2))[1] == s1(2)


def test_a_target_that_is_not_there_for_a_step() -> None:
    for target in (
        {"path": "waypoints", "waypoints": [[0, 0, 0], [0.5, 1, 1]]},
        {"path": "waypoints", "waypoints": [[20, 0, 0], [50, 1, 1]], "steps": 19},
    ):
        with pytest.raises(ScenarioError, match=r"target.steps: the target is present from .* s to .* s"):
            target_path(mine(**target))


def test_a_file_is_read_for_its_window(tmp_path: Path) -> None:
    rows = "".join(f"{t},{10 * t},0\n" for t in range(100))
    (tmp_path / "a.csv").write_text("t_s,x,y\n" + rows)
    target = {"path": "file", "file": str(tmp_path / "a.csv"), "from": "20", "to": "50.5"}
    steps, path = target_path(mine(**target))
    assert (steps, path.start_s, path.end_s) == (30, 0.0, 30.0)
    assert path.at(15.0) == pytest.approx((350.0, 0.0, 10.0, 0.0))
    with pytest.raises(ScenarioError, match="no fix inside the window"):
        target_path(mine(**{**target, "from": "200", "to": "300"}))


KEEN = Kind("doa", Arrays(threshold=0.0, margin_db=1000.0))
"""Arrays that hear the source of the packaged scenarios at any distance, without noise of the level."""

# --- the whole ---------------------------------------------------------------------------------------------


def test_the_papers_thresholds_wake_as_many_sensors_as_the_paper_says() -> None:
    # Zhai et al., fig. 4; a margin above zero wakes more of them than report
    for threshold, active in ((0.72, 10.5), (0.75, 4.0), (0.78, 1.5)):
        counts = []
        for seed in range(1, 6):
            changes = {"sensor.threshold": threshold, "sensor.margin_db": 0.0, "seed": seed}
            site = survey(Scenario.load("spcpf", changes))
            sensors = [site.sensor(i) for i in range(len(site.sensors))]
            counts += [sum(one.sample(step * S) is not None for one in sensors) for step in range(61)]
        assert np.mean(counts) == pytest.approx(active, abs=0.3)


@pytest.mark.parametrize("name", ["spcpf", "bus"])
def test_a_sensor_hears_in_its_windows_whatever_it_could_hear_at_all(name: str) -> None:
    site = survey(Scenario.load(name))
    audible_db = site.scenario.sensor.sensing.own.audible_db
    for i in range(len(site.sensors)):
        sensor = site.sensor(i)
        own, keen = site.windows[i], replace(sensor, kind=KEEN)
        for t in range(0, site.steps * site.step_ns + 1, S // 4):
            heard = sensor.sample(t)
            assert (heard is not None) <= any(a <= t <= b for a, b in own)
            exact = keen.sample(t)
            assert exact is not None
            assert (heard is not None) == (exact.level >= audible_db)


def test_a_site_holds_what_a_run_needs() -> None:
    scenario = Scenario.load("spcpf", {"seed": 5, "target.step_s": 0.5, "fusion.x_m": -20.0})
    site = survey(scenario)
    assert (site.scenario, site.steps, site.step_ns) == (scenario, 120, S // 2)
    assert len(site.windows) == len(site.sensors) == 121
    assert site.centre == (-20.0, 250.0)
    sensor = site.sensor(13, incarnation=2)
    assert (sensor.id, sensor.position, sensor.seed, sensor.incarnation) == ("n013", (100.0, 50.0), 5, 2)
    assert (sensor.kind.own.level_db, sensor.kind.own.audible_db, sensor.kind.own.doa_sd_deg) == (70.0, 51.5, 3.0)


def test_every_sensor_hears_at_threshold_zero() -> None:
    site = survey(Scenario.load("spcpf", {"sensor.threshold": 0.0, "field.nodes": 1000}))
    assert site.windows == (((0, 60 * S),),) * 992


def test_a_target_that_comes_in_range_of_nobody() -> None:
    far = mine(path="waypoints", waypoints=[[0, 700, 700], [10, 900, 700]])
    with pytest.raises(ScenarioError) as caught:
        survey(far)
    nearest = hypot(200, 200)
    assert str(caught.value) == (
        "sensor.threshold: the target never comes in range: "
        f"it stays {nearest:.0f} m from n120, the nearest; "
        "expected a path within the 56 m in which a sensor hears a target"
    )


def test_a_target_in_the_margin_alone_is_out_of_range() -> None:
    # 60 m away: awake, but below the threshold at 56 m
    with pytest.raises(ScenarioError, match="never comes in range"):
        survey(mine(path="waypoints", waypoints=[[0, -60, 0], [10, -60, 100]]))


def test_the_largest_and_loudest_field_can_be_planned() -> None:
    wide = {"sensor.level_db": 200.0, "sensor.alpha": 0.5, "sensor.threshold": 0.0, "sensor.margin_db": 100.0}
    site = survey(Scenario.load("spcpf", wide))
    assert all(own == ((0, 60 * S),) for own in site.windows)
    assert site.sensor(0).sample(30 * S) is not None


@pytest.mark.parametrize(("start", "end"), [("07:46", "07:49"), ("07:50:00", "07:53:00"), ("08:07", "08:10")])
def test_sensors_line_the_streets_of_a_real_bus(data_file: DataFile, start: str, end: str) -> None:
    ride = {"target.file": str(data_file("bus_304.gpx")), "target.from": start, "target.to": end}
    site = survey(Scenario.load("bus", ride))
    assert site.steps == 180
    assert 25 < len(site.sensors) < 300
    assert distances(np.array([place[1:] for place in site.sensors]), site.paths["target"], 150.0).max() <= 150.0
    for step in range(181):
        assert sum(any(a <= step * S <= b for a, b in own) for own in site.windows) >= 2


def test_a_run_has_no_more_steps_than_a_report_can_count() -> None:
    encode(Doa(MAX_STEPS, 0.0, 0.0))
    with pytest.raises(WireError):
        encode(Doa(MAX_STEPS + 1, 0.0, 0.0))
    with pytest.raises(ScenarioError, match=r"70000 steps.*at most 65535"):
        survey(mine(path="waypoints", waypoints=[[0, 0, 0], [70000, 500, 0]]))
    with pytest.raises(ScenarioError, match=r"target\.steps"):
        mine(path="s1", steps=MAX_STEPS + 1)
