"""Sections ``[[sensors]]``: which sensors are of which kind, and what is refused."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

import trackfield as tf
from launcher.plan.flaws import worked_out
from launcher.plan.prepare import planned
from tests.rangers import Distance, Ranger
from tests.sensing import registered
from trackfield.scenario import survey


@pytest.fixture(autouse=True)
def kinds() -> Iterator[None]:
    with registered(ranger=Ranger, distance=Distance):
        yield


def scenario(*groups: dict[str, Any], **settings: Any) -> tf.Scenario:
    """A field of 25 sensors, n000 to n024, with these groups."""
    keys = {key.replace("__", "."): value for key, value in settings.items()}
    base = {"field.extent_m": 200.0, "target.steps": 5, "fusion.trackers": ["ekf"], "sensors": list(groups)}
    return tf.Scenario.load("zhai-spcpf", base | keys)


def found(*groups: dict[str, Any], **settings: Any) -> dict[str, list[str]]:
    """The ids of the sensors of each kind, in order."""
    site = survey(scenario(*groups, **settings))
    ids = [id for id, *_ in site.sensors]
    assert sorted(id for members in site.kinds.values() for id in map(ids.__getitem__, members)) == ids
    return {name: [ids[i] for i in sorted(members)] for name, members in site.kinds.items()}


def refused(*groups: dict[str, Any], **settings: Any) -> str:
    with pytest.raises(tf.ScenarioError) as caught:
        planned(scenario(*groups, **settings))
    return str(caught.value)


ALL = [f"n{i:03d}" for i in range(25)]


# --- which ------------------------------------------------------------------------------------------------------------


def test_those_that_a_group_names_are_of_its_kind_and_the_others_as_sensor_says() -> None:
    named = ["n003", "n020", "n004"]
    of = found({"kind": "ranger", "nodes": named}, sensor={"kind": "distance"})
    assert of == {"distance": [id for id in ALL if id not in named], "ranger": sorted(named)}
    assert list(found({"kind": "ranger", "nodes": named})) == ["doa", "ranger"]  # without a [sensor]


def test_a_share_is_of_all_sensors_and_drawn_by_the_seed() -> None:
    by_seed = [found({"kind": "ranger", "share": 0.4}, seed=seed) for seed in range(6)]
    assert [len(of["ranger"]) for of in by_seed] == [10] * 6
    assert found({"kind": "ranger", "share": 0.4}, seed=3) == by_seed[3]
    assert len({tuple(of["ranger"]) for of in by_seed}) == 6
    drawn = [sum(id in of["ranger"] for of in by_seed) for id in ALL]
    assert max(drawn) <= 6 and len(set(drawn)) > 2  # not always the same ones


def test_a_share_leaves_alone_what_other_groups_name() -> None:
    for order in (1, -1):
        groups = [{"kind": "ranger", "share": 0.6}, {"kind": "distance", "nodes": ALL[:8]}][::order]
        of = found(*groups)
        assert of["distance"] == ALL[:8]
        assert (len(of["ranger"]), len(of["doa"])) == (15, 2)


def test_a_share_of_hardly_any_is_one_sensor() -> None:
    assert len(found({"kind": "ranger", "share": 1e-6})["ranger"]) == 1


def test_two_groups_of_a_kind_are_told_apart_and_have_their_own_options() -> None:
    site = survey(
        scenario(
            {"kind": "ranger", "nodes": ["n001"], "range_m": 50.0},
            {"kind": "ranger", "nodes": ["n002"], "range_m": 70.0},
            sensor={"kind": "ranger"},
        )
    )
    assert {name: len(members) for name, members in site.kinds.items()} == {"ranger": 23, "ranger-2": 1, "ranger-3": 1}
    assert [site.sensor(i).kind.range_m for i in range(4)] == [100.0, 50.0, 70.0, 100.0]


def test_sensor_drops_out_if_no_sensors_are_left_for_it() -> None:
    halves = [{"kind": "ranger", "nodes": ALL[:12]}, {"kind": "distance", "share": 1.0}]
    assert list(found(*halves)) == ["ranger", "distance"]
    plan = planned(scenario(*halves, sensor={"kind": "doa", "threshold": "adaptive"}))  # which is nobody's then
    assert list(plan.tracking["sensing"]) == ["ranger", "distance"]


def test_what_takes_one_kind_only_takes_a_group_of_all_sensors() -> None:
    everybody = {"kind": "doa", "share": 1.0, "doa_sd_deg": 2.0}
    for more in ({"fusion__trackers": ["spcpf"]}, {"fusion__trackers": ["fix-doa"]}):
        assert len(planned(scenario(everybody, **more)).tracking["sensing"]) == 1
    plan = planned(scenario(everybody | {"threshold": "adaptive"}))
    assert any("threshold" in process.config for process in plan.processes if process.role == "fusion")


# --- what is refused --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("groups", "settings", "says"),
    [
        (
            [{"kind": "ranger", "nodes": ["n001", "n099"]}],
            {},
            "sensors[0].nodes: there is no sensor 'n099'; expected ids of this field, like n000",
        ),
        (
            [{"kind": "ranger", "nodes": ["n001"]}, {"kind": "distance", "nodes": ["n002", "n001"]}],
            {},
            "sensors[1].nodes: 'n001' is named twice; expected ids of this field, like n000",
        ),
        (
            [{"kind": "ranger", "nodes": ["n001", "n001"]}],
            {},
            "sensors[0].nodes: 'n001' is named twice; expected ids of this field, like n000",
        ),
        (
            [{"kind": "ranger", "share": 1.0}, {"kind": "distance", "share": 0.1}],
            {},
            "sensors[1].share: no sensor is left for it; expected less before it",
        ),
        (
            [{"kind": "ranger", "nodes": ["n001"], "share": 0.5}],
            {},
            "sensors[0].share: is given together with nodes; expected one of the two",
        ),
        (
            [{"kind": "ranger", "share": 0.5}, {"kind": "distance"}],
            {},
            "sensors[1]: says not which sensors it is about; expected nodes (ids) or share (from 0 to 1)",
        ),
        ([{"share": 1.5}], {}, "sensors[0].share: is 1.5; expected a number from 1e-06 to 1"),
        ([{"kind": "ranger", "nodes": []}], {}, "sensors[0].nodes: "),
        (
            [],
            {"sensor": {"kind": "ranger", "nodes": ["n001"]}},
            "sensor.nodes: is for some of the sensors, in [[sensors]]; expected [sensor] for the others",
        ),
        (
            [],
            {"sensor": {"kind": "doa", "share": 0.5}},
            "sensor.share: is for some of the sensors, in [[sensors]]; expected [sensor] for the others",
        ),
        ([{"kind": "rangr", "share": 0.5}], {}, "sensor.kind: unknown sensor 'rangr'; expected 'ranger'"),
        (
            [{"kind": "ranger", "share": 0.5}],
            {"sensor": {"kind": "doa", "threshold": "adaptive"}},
            "sensors: sensors of kind 'doa' have an adaptive threshold, and there are others; "
            "expected a fixed threshold, or sensors of one kind",
        ),
        (
            [{"kind": "ranger", "share": 0.5}],
            {"fusion__trackers": ["ekf", "fix-doa"]},
            "fusion.trackers: 'fix-doa' takes ",
        ),
        (
            [{"kind": "doa", "nodes": ["n001"], "threshold": 0.99}],
            {"sensor": {"kind": "ranger", "range_m": 0.01}},
            "sensors: the target never comes in range",
        ),
    ],
)  # fmt: skip
def test_bad_input(groups: list[dict[str, Any]], settings: dict[str, Any], says: str) -> None:
    assert refused(*groups, **settings).startswith(says)


def test_only_what_is_wrong_is_told() -> None:
    """Whether trackers and thresholds fit the kinds is not said as long as it does not show which kinds there are."""
    groups = [{"kind": "doa", "nodes": ["n999"], "threshold": "adaptive"}]
    (error,) = worked_out(scenario(*groups, fusion__trackers=["fix-doa"]), set())
    assert str(error).startswith("sensors[0].nodes: there is no sensor 'n999'")
    assert not worked_out(scenario(*groups), {"sensors"})  # the group is known to be wrong, and told
