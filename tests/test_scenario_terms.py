"""The terms of a run: when it begins, who is the centre, what counts as lost, whom faults befall by role."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from trackfield.errors import ScenarioError
from trackfield.scenario import Scenario, survey
from trackfield.scenario.architectures import Centralised
from trackfield.scenario.faults import Partition
from trackfield.scenario.sections.score import Lost

S = 1_000_000_000
LEAST: dict[str, Any] = {"name": "mine", "target": {"path": "s1"}}


def failure(values: dict[str, Any], source: Any = LEAST) -> str:
    with pytest.raises(ScenarioError) as caught:
        survey(Scenario.load(source, values))
    return str(caught.value)


# --- setup_s ----------------------------------------------------------------------------------------------------------


def test_without_setup_the_first_step_is_at_once() -> None:
    site = survey(Scenario.load(LEAST))
    assert site.origin_ns == 0
    assert site.paths["target"].start_s == 0.0


@pytest.mark.parametrize(("setup_s", "step_s"), [(0.1, 0.1), (12.3, 0.7), (86400.0, 1.0)])
def test_all_is_later_by_the_time_of_setup(setup_s: float, step_s: float) -> None:
    drives = {"fusion.path": [[0, 1, 2], [9.5, 3, 4]], "fusion.deadline_s": step_s / 2}
    scenario = Scenario.load("bus", {"target.step_s": step_s, **drives})
    early, late = survey(scenario), survey(scenario.set("run.setup_s", setup_s))
    assert late.origin_ns == round(setup_s * S)
    assert (late.steps, late.sensors) == (early.steps, early.sensors)
    assert [(t - late.origin_ns, x, y) for t, x, y in late.route] == list(early.route)
    for step in range(late.steps + 1):
        t_ns = step * late.step_ns
        there = late.paths["target"].at((late.origin_ns + t_ns) / S)
        assert there == pytest.approx(early.paths["target"].at(t_ns / S), abs=1e-6)
    assert late.paths["target"].at((late.origin_ns - 1) / S) is None
    for own, before in zip(late.windows, early.windows, strict=True):
        for window, earlier in zip(own, before, strict=True):
            assert [t - late.origin_ns for t in window] == pytest.approx(earlier, abs=2)


@pytest.mark.parametrize("value", [-1, float("nan"), 1e7, "long"])
def test_a_setup_that_is_none(value: Any) -> None:
    assert failure({"run.setup_s": value}).startswith("run.setup_s: is ")
    assert "; expected a number from 0 to 1000000" in failure({"run.setup_s": value})


# --- what is lost -----------------------------------------------------------------------------------------------------


def test_the_last_step_decides_unless_said_otherwise() -> None:
    scenario = Scenario.load(LEAST, {"fusion.lost_m": 70.0})
    assert scenario.score.lost == Lost(steps=1, within=1)
    assert scenario.lost_beyond_m == 70.0
    assert scenario.plain()["score"] == {"lost": {"steps": 1, "within": 1}}


def test_a_table_says_how_far_off_for_how_long_and_when() -> None:
    whole = Scenario.load(LEAST, {"score.lost": {"beyond_m": 20.0, "steps": 3, "within": 10}})
    assert (whole.score.lost.steps, whole.score.lost.within, whole.lost_beyond_m) == (3, 10, 20.0)
    part = Scenario.load(LEAST, {"score.lost.steps": 3})
    assert (part.score.lost.within, part.lost_beyond_m) == (None, 50.0)
    assert Scenario.load(LEAST, {"score.lost": {}}).score.lost == Lost(steps=1, within=None)


def test_a_table_reads_back_the_same(tmp_path: Path) -> None:
    for lost in ({"beyond_m": 20.0, "steps": 3, "within": 10}, {"steps": 3}, {}):
        scenario = Scenario.load(LEAST, {"score.lost": lost})
        (tmp_path / "mine.toml").write_text(scenario.to_toml())
        assert Scenario.load(tmp_path / "mine.toml") == scenario


@pytest.mark.parametrize(
    ("lost", "message"),
    [
        ({"steps": 4, "within": 3}, "score.lost.steps: is 4; expected at most within, which is 3"),
        ({"steps": 0}, "score.lost.steps: is 0; expected a whole number from 1 to 65535"),
        ({"within": 0.5}, "score.lost.within: is 0.5; expected a whole number from 1 to 65535"),
        ({"beyond_m": 0}, "score.lost.beyond_m: is 0; expected a number from 0.001 to 10000000"),
        ({"stps": 1}, "score.lost.stps: unknown; did you mean steps?; expected one of beyond_m, steps, within"),
        (3, "score.lost: is 3; expected a table, like { beyond_m = 50.0, steps = 3, within = 10 }"),
    ],
)
def test_a_table_that_is_none(lost: Any, message: str) -> None:
    assert failure({"score": {"lost": lost}}) == message


def test_a_table_of_its_own_is_told_with_its_line(tmp_path: Path) -> None:
    for lost in ("[score.lost]\nwithin = 2\nsteps = 4\n", "[score]\n\nlost = { within = 2, steps = 4 }\n"):
        (tmp_path / "mine.toml").write_text(f'name = "mine"\ntarget.path = "s1"\n{lost}')
        assert failure({}, tmp_path / "mine.toml").startswith(
            f"{tmp_path / 'mine.toml'}:5: score.lost.steps: is 4; expe"
        )


# --- the centre -------------------------------------------------------------------------------------------------------


def surveyed(tmp_path: Path, *rows: str) -> dict[str, Any]:
    (tmp_path / "a.csv").write_text("\n".join(["id,x,y,role", *rows]))
    return {**LEAST, "field": {"layout": "file", "file": str(tmp_path / "a.csv")}}


def test_one_centre_is_called_fusion_unless_told_otherwise(tmp_path: Path) -> None:
    assert Scenario.load(LEAST).architecture == Centralised(centre="fusion")
    source = surveyed(tmp_path, "post,60,80,node", "hub,5,6,fusion")
    site = survey(Scenario.load(source, {"architecture.centre": "hub"}))
    assert site.centre == (5.0, 6.0)
    assert [id for id, *_ in site.sensors] == ["post"]
    named = surveyed(tmp_path, "fusion,60,80,node", "hub,5,6,fusion")
    assert survey(Scenario.load(named, {"architecture.centre": "hub"})).sensors == (("fusion", 60.0, 80.0),)


def test_a_centre_of_a_file_has_the_id_of_the_scenario(tmp_path: Path) -> None:
    source, file = surveyed(tmp_path, "post,60,80,node", "hub,5,6,fusion"), tmp_path / "a.csv"
    assert failure({}, source) == (
        f"{file}:3: a fusion is called 'hub'; expected the id fusion, or architecture.centre = 'hub' in the scenario"
    )
    source = surveyed(tmp_path, "hub,60,80,node")
    expected = "expected an id other than hub, router, recorder, live"
    assert failure({"architecture.centre": "hub"}, source) == f"{file}:2: a node is called 'hub'; {expected}"
    source = surveyed(tmp_path, "post,60,80,node", "live,5,6,fusion")
    assert failure({}, source) == f"{file}:3: a fusion is called 'live'; expected the id fusion"


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"architecture.centre": "n060"}, "architecture.centre: is 'n060', which is also a sensor's id; expected"),
        ({"architecture.centre": "live"}, "architecture.centre: is 'live', which names another process of the run; "),
        ({"architecture.centre": "a/b"}, 'architecture.centre: is "a/b"; expected 1 to 32 characters of A-Z'),
        ({"architecture.centre": 3}, "architecture.centre: is 3; expected 1 to 32 characters of A-Z"),
        ({"architecture.kind": 1}, "architecture.kind: is 1; expected a text"),
        ({"architecture.center": "a"}, "architecture.center: unknown; did you mean centre?"),
    ],
)  # fmt: skip
def test_a_centre_that_is_none(values: dict[str, Any], message: str) -> None:
    assert failure(values).startswith(message)


# --- faults -----------------------------------------------------------------------------------------------------------


def test_a_fault_befalls_a_role_or_a_share_of_it_and_one_medium() -> None:
    cut = {"kind": "partition", "role": "node", "share": 0.5, "at_s": 1, "until_s": 2, "medium": "backbone"}
    (fault,) = Scenario.load(LEAST, {"faults": [cut]}).faults
    assert fault == Partition(role="node", share=0.5, at_s=1.0, until_s=2.0, medium="backbone")
    (fault,) = Scenario.load(LEAST, {"faults": [{"kind": "kill", "role": "fusion", "at_s": 1}]}).faults
    assert (fault.role, fault.nodes, fault.share) == ("fusion", None, None)


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        (
            {"kind": "kill", "nodes": ["n001"], "role": "node"},
            "role: is given together with nodes; expected one of the two",
        ),
        ({"kind": "kill", "role": ""}, 'role: is ""; expected a text'),
        ({"kind": "kill", "role": 3}, "role: is 3; expected a text"),
        ({"kind": "kill", "role": "node", "medium": "field"}, "medium: belongs to kind partition, not to kill"),
        (
            {"kind": "partition", "role": "node", "until_s": 9, "medium": "fild"},
            'medium: is "fild"; did you mean field?; expected one of field, backbone',
        ),
    ],
)
def test_a_fault_of_nobody_or_of_no_medium(fault: dict[str, Any], message: str) -> None:
    assert failure({"faults": [{"at_s": 1, **fault}]}).startswith(f"faults[0].{message}")
