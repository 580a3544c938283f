"""Several targets: what a scenario may say of them, what it comes to, and each way to get it wrong."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from launcher.record.folder import keep
from trackfield.errors import ScenarioError
from trackfield.scenario import Scenario, survey
from trackfield.scenario.survey import target_paths
from trackfield.world.targets import s1, s2, s3
from trackfield.world.windows import distances, windows

S = 1_000_000_000
SECOND = {"id": "second", "path": "s3"}
LEGS = {"path": "waypoints", "waypoints": [[0, 0, 0], [10.5, 100, 0]]}


def several(*targets: dict[str, Any], **more: Any) -> Scenario:
    return Scenario.load({"name": "mine", "targets": list(targets), **more})


def failure(data: dict[str, Any]) -> str:
    with pytest.raises(ScenarioError) as caught:
        survey(Scenario.load({"name": "mine", **data}))
    return str(caught.value)


def track(file: Path, lat: float, *, seconds: int = 60) -> str:
    """Northward from ``lat``, 11.1 m a second, with a fix each second; its absolute name."""
    rows = (f"2024-05-06T08:{t // 60:02}:{t % 60:02}Z,{lat + 1e-4 * t!r},8" for t in range(seconds))
    file.write_text("\n".join(["time,lat,lon", *rows]))
    return str(file)


# --- what a scenario says ---------------------------------------------------------------------------------------------


def test_a_target_alone_is_called_target() -> None:
    scenario = Scenario.load({"name": "mine", "target": {"path": "s1"}})
    assert [target.id for target in scenario.every_target] == ["target"]
    assert scenario.keyed_targets == (("target", scenario.target),)
    assert Scenario.load({"name": "mine", "target": {"path": "s1"}}, {"target.id": "van"}).target.id == "van"


def test_they_stand_beside_the_target_or_alone() -> None:
    both = Scenario.load({"name": "mine", "target": {"path": "s1"}, "targets": [SECOND]})
    assert [key for key, _ in both.keyed_targets] == ["target", "targets[0]"]
    assert [target.id for target in both.every_target] == ["target", "second"]
    alone = several({"id": "target", "path": "s1"}, SECOND)
    assert [key for key, _ in alone.keyed_targets] == ["targets[0]", "targets[1]"]
    assert "target" not in alone.plain()
    assert survey(alone).windows == survey(both).windows


def test_the_first_says_how_long_steps_are_and_how_many() -> None:
    scenario = several({**LEGS, "id": "a", "step_s": 0.5, "steps": 8}, {**SECOND, "step_s": 0.5})
    assert (scenario.step_s, scenario.steps) == (0.5, 8)
    again = Scenario.load(scenario.plain())
    assert again == scenario
    assert again.set("targets", [{**LEGS, "id": "a"}]).step_s == 1.0


def test_on_the_command_line_they_are_set_as_a_whole() -> None:
    scenario = Scenario.load("bus", {"targets": [SECOND], "target.steps": 7})
    assert [target.path for target in scenario.every_target] == ["file", "s3"]
    assert scenario.set("target.path", "s2").every_target[0].path == "s2"
    with pytest.raises(ScenarioError, match=r"targets: are a list, which can only be set as a whole; expected tar"):
        scenario.set("targets.path", "s2")


def test_written_they_read_back_the_same(tmp_path: Path) -> None:
    for scenario in (
        Scenario.load("bus", {"targets": [SECOND], "target.step_s": 0.5}),
        several({**LEGS, "id": "a", "step_s": 0.5, "steps": 8}, {**SECOND, "steps": 8}),
    ):
        (tmp_path / "all.toml").write_text(scenario.to_toml())
        again = Scenario.load(tmp_path / "all.toml")
        assert again.to_toml() == scenario.to_toml()
        assert again.set("seed", 2).every_target == scenario.every_target


# --- files ------------------------------------------------------------------------------------------------------------


def test_their_files_lie_beside_the_scenario_and_are_kept_under_their_ids(tmp_path: Path) -> None:
    for name, lat in (("a", 50.0), ("b", 50.001), ("c", 50.002)):
        track(tmp_path / f"{name}.csv", lat)
    text = 'name = "mine"\n[target]\npath = "file"\nfile = "a.csv"\n'
    text += "".join(f'[[targets]]\nid = "{id}"\npath = "file"\nfile = "{id}.csv"\n' for id in ("b", "c"))
    (tmp_path / "mine.toml").write_text(text)
    scenario = Scenario.load(tmp_path / "mine.toml")
    assert scenario.plain()["targets"][1]["file"] == str(tmp_path / "c.csv")
    (tmp_path / "run").mkdir()
    keep(scenario, tmp_path / "run")
    kept = {file.name for file in (tmp_path / "run").iterdir()}
    assert kept == {"scenario.toml", "target.csv", "target-b.csv", "target-c.csv"}
    assert survey(Scenario.load(tmp_path / "run" / "scenario.toml")).paths == survey(scenario).paths


def test_without_target_the_first_of_them_is_kept_as_the_target(tmp_path: Path) -> None:
    files = [track(tmp_path / f"{name}.csv", 50.0) for name in "ab"]
    (tmp_path / "run").mkdir()
    scenario = several(*({"id": id, "path": "file", "file": file} for id, file in zip("ab", files, strict=True)))
    keep(scenario, tmp_path / "run")
    assert {file.name for file in (tmp_path / "run").iterdir()} == {"scenario.toml", "target.csv", "target-b.csv"}


def test_the_file_of_a_backbone_is_kept_as_well(tmp_path: Path) -> None:
    (tmp_path / "wire.csv").write_text("src,dst,t_s,received,delay_ms\n")
    (tmp_path / "run").mkdir()
    text = 'name = "mine"\ntarget.path = "s1"\nbackbone = {model = "trace", file = "wire.csv"}\n'
    (tmp_path / "mine.toml").write_text(text)
    keep(Scenario.load(tmp_path / "mine.toml"), tmp_path / "run")
    kept = Scenario.load(tmp_path / "run" / "scenario.toml").plain()["backbone"]["file"]
    assert kept == str(tmp_path / "run" / "backbone.csv")


def test_tracks_on_the_globe_share_the_plane_of_the_first(tmp_path: Path) -> None:
    files = track(tmp_path / "a.csv", 50.0), track(tmp_path / "b.csv", 50.01)
    first, other = ({"id": id, "path": "file", "file": file} for id, file in zip("ab", files, strict=True))
    paths = survey(several(first, other)).paths
    assert paths["a"].at(0.0)[:2] == pytest.approx((0.0, 0.0))  # type: ignore[index]
    assert paths["b"].at(0.0)[:2] == pytest.approx((0.0, 1112.3), abs=0.5)  # type: ignore[index]
    alone = survey(several(first))
    assert alone.paths["a"] == paths["a"]


# --- what it comes to -------------------------------------------------------------------------------------------------


def test_the_run_lasts_until_the_last_of_them_ends() -> None:
    steps, paths = target_paths(several({**LEGS, "id": "a"}, SECOND, {"id": "turns", "path": "s2"}))
    assert steps == 75
    assert [path.end_s for path in paths.values()] == [10.5, 40.0, 75.0]
    assert (paths["second"], paths["turns"]) == (s3(), s2())


def test_who_comes_late_is_waited_for() -> None:
    late = {**LEGS, "id": "late", "waypoints": [[100, 0, 0], [200, 9, 9]]}
    assert target_paths(several(SECOND, late))[0] == 200


def test_steps_that_are_set_are_those_of_all() -> None:
    steps, paths = target_paths(several({**LEGS, "id": "a", "steps": 50}, SECOND))
    assert (steps, paths["a"].end_s, paths["second"].end_s) == (50, 10.5, 50.0)
    steps, paths = target_paths(several({**SECOND, "steps": 5}, {**LEGS, "id": "a"}))
    assert (steps, paths["second"].end_s, paths["a"].end_s) == (5, 5.0, 5.0)


def test_random_accelerations_are_of_the_target() -> None:
    _, paths = target_paths(several({"id": "target", "path": "s1"}, {"id": "other", "path": "s1"}))
    assert paths["target"] == s1(1)
    assert paths["other"] == s1(1, id="other") != s1(1)


def test_a_sensor_is_awake_for_each_of_them() -> None:
    scenario = several({"id": "a", "path": "s1"}, SECOND)
    site = survey(scenario)
    positions, awake_m = np.array([place[1:] for place in site.sensors]), scenario.sensor.sensing.range_m
    each = [windows(positions, path, awake_m) for path in site.paths.values()]
    for own, *parts in zip(site.windows, *each, strict=True):
        assert all(any(a <= begin and end <= b for a, b in own) for part in parts for begin, end in part)
        assert {time for window in own for time in window} <= {time for part in parts for w in part for time in w}
        assert all(x[1] < y[0] for x, y in pairwise(own))
    sensor = site.sensor(60)
    assert sensor.scene.paths == tuple(site.paths.values())


def test_sensors_stand_along_all_their_ways_and_beside_the_first() -> None:
    far = {"id": "far", "path": "waypoints", "waypoints": [[0, 9000, 0], [10, 9100, 0]]}
    near = {**LEGS, "id": "a"}
    layout = {"layout": "along-path", "spacing_m": 40.0, "within_m": 100.0}
    both, one, other = (survey(several(*ways, field=layout)) for ways in ((near, far), (near,), (far,)))
    places = {place[1:] for place in both.sensors}
    assert places == {place[1:] for site in (one, other) for place in site.sensors}
    assert [id for id, *_ in both.sensors] == [f"n{i:03}" for i in range(len(places))]
    nearest = np.min([distances(np.array(sorted(places)), path, 1e3) for path in both.paths.values()], axis=0)
    assert nearest.max() <= 100.0
    beside = survey(several(near, far, field={"layout": "beside", "distance_m": 10.0}))
    assert beside.sensors == survey(several(near, field={"layout": "beside", "distance_m": 10.0})).sensors


def test_ways_that_cross_share_their_sensors() -> None:
    layout = {"layout": "along-path", "nodes": 30}
    one, other = {**LEGS, "id": "a"}, {**LEGS, "id": "b"}
    alone, twice = survey(several(one, field=layout)), survey(several(one, other, field=layout))
    assert alone.sensors == twice.sensors


def test_it_is_enough_that_one_of_them_comes_in_range() -> None:
    far = {"id": "far", "path": "waypoints", "waypoints": [[0, 9000, 0], [10, 9100, 0]]}
    assert survey(several(far, SECOND)).steps == 40
    message = failure({"targets": [far, {**far, "id": "further"}]})
    assert message.startswith("sensor.threshold: no target comes in range: they stay 8500 m from n010, the near")


# --- what is wrong ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ({"targets": []}, "target: missing; expected a section [target], or sections [[targets]]"),
        ({"targets": 3}, "targets: is 3; expected sections [[targets]]"),
        ({"targets": [{"path": "s1"}]}, "targets[0].id: missing; expected 1 to 32 characters of A-Z"),
        ({"targets": [{"path": "s1", "id": "a b"}]}, 'targets[0].id: is "a b"; expected 1 to 32 characters of A-Z'),
        ({"target": {"path": "s1", "id": ""}}, 'target.id: is ""; expected 1 to 32 characters of A-Z'),
        (
            {"target": {"path": "s1"}, "targets": [{**SECOND, "id": "target"}]},
            "targets[0].id: 'target' is given twice; expected a different id for each target",
        ),
        (
            {"targets": [SECOND, SECOND]},
            "targets[1].id: 'second' is given twice; expected a different id for each target",
        ),
        (
            {"target": {"path": "s1"}, "targets": [{**SECOND, "step_s": 2}]},
            "targets[0].step_s: is 2, and target.step_s is 1; expected the same as for the first target, or left out",
        ),
        (
            {"targets": [{"path": "s1", "id": "a"}, {**SECOND, "steps": 9}]},
            "targets[1].steps: is 9, and targets[0].steps is unset; expected the same as for the first target, or left",
        ),
        (
            {"targets": [{"path": "s1", "id": "a", "step_s": 0.2}]},
            "fusion.deadline_s: is 0.3; expected at most targets[0].step_s, which is 0.2",
        ),
        (
            {"targets": [{**SECOND, "step_s": 2, "waypoints": []}], "fusion": {"deadline_s": 1.5}},
            "targets[0].waypoints: belongs to path waypoints, not to s3",
        ),
        ({"targets": [{"path": "s4", "id": "a"}]}, "targets[0].path: unknown path 's4'; expected one of s1, s2"),
        (
            {"targets": [{**SECOND, "steps": 9}, {**LEGS, "id": "late", "waypoints": [[100, 0, 0], [200, 9, 9]]}]},
            "targets[1].steps: the target is present from 100 s to 200 s, but the run ends after 9 s; expected at",
        ),
    ],
)  # fmt: skip
def test_targets_that_do_not_go_together(data: dict[str, Any], message: str) -> None:
    found = failure(data)
    assert found.startswith(message)
    assert len(found.splitlines()) == 1


def test_a_window_of_another_track_is_told_with_its_number(tmp_path: Path) -> None:
    first, other = track(tmp_path / "a.csv", 50.0), track(tmp_path / "b.csv", 50.01)
    targets = [{"id": "a", "path": "file", "file": first}, {"id": "b", "path": "file", "file": other, "from": "x"}]
    assert failure({"targets": targets}).startswith(f"{other}: targets[1].from: 'x' is not a time; expected HH:MM[:SS]")


def test_each_is_told_with_its_line(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    begin = 'name = "mine"\n[target]\npath = "s1"\n[[targets]]\npath = "s2"\n'
    file.write_text(f'{begin}[[targets]]\nid = 3\npath = "s2"\n')
    with pytest.raises(ScenarioError) as caught:
        Scenario.load(file)
    assert str(caught.value).startswith(f"{file}:7: targets[1].id: is 3; expected 1 to 32 characters of")
    file.write_text(begin)
    with pytest.raises(ScenarioError) as caught:
        Scenario.load(file)
    assert str(caught.value).startswith(f"{file}:4: targets[0].id: missing; expected 1 to 32 characters of")
