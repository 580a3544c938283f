"""Plans of fields with a camera: what cannot be, what is foreseen and warned of, and what the processes are told."""

from __future__ import annotations

from typing import Any

import pytest

from launcher.plan.forecast.answers import answers
from launcher.plan.forecast.foresight import foresee
from launcher.plan.forecast.warnings import summary
from launcher.plan.prepare import planned, warned
from launcher.records import Plan
from tests.camera_fields import HOPS, NOISE, expected
from tests.cpa_fields import SMALL
from trackfield.errors import ScenarioError
from trackfield.scenario import Scenario, names
from trackfield.wire.codec import decode, encode
from trackfield.wire.outside import Carried, Item
from trackfield.wire.passes import FixReport
from trackfield.wire.registry import kind_of

LINE: dict[str, Any] = {"camera.hops": HOPS["camera.hops"]}
"""Three hops by wire."""


def plan_of(settings: dict[str, Any], scenario: Any = "yang-ecpa") -> Plan:
    return planned(Scenario.load(scenario, {**NOISE, **settings} if scenario == "yang-ecpa" else settings))


def error(settings: dict[str, Any], scenario: Any = "yang-ecpa") -> str:
    """The error of a plan that cannot be."""
    with pytest.raises(ScenarioError) as caught:
        plan_of(settings, scenario)
    return str(caught.value)


def said(plan: Plan) -> tuple[list[str], list[str]]:
    """What is expected of the camera; and what is warned of, but for answers that are too fast for a machine."""
    lines = [line for line in summary(plan, foresee(plan)) if line.startswith("camera")]
    return lines, [text for text in warned(plan).warnings if "answer each other" not in text]


# --- what cannot be ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("settings", "expected"),
    [
        (
            {"camera.heads": ["n0000"]},
            "camera.heads: there is no sensor 'n0000'; did you mean n000?; expected ids of sensors, or unset",
        ),
        (
            {"camera.orders": [[3, "stop", "vido"]]},
            "camera.orders[0]: there is no process 'vido' that takes orders; did you mean video?; "
            "expected one of base, camera-control, video",
        ),
        (
            {**LINE, "camera.orders": [[1, "stop", "video"], [3, "stop", "camera"]]},
            "camera.orders[1]: there is no process 'camera' that takes orders",
        ),
        (
            {"camera.orders": [[87, "stop", "video"]]},
            "camera.orders[0]: is at 87 s, and the run ends at 87 s; expected a time before the end",
        ),
        (
            {"architecture.base": "video"},
            "architecture.base: is 'video', the id of a process beyond the gateway; "
            "expected another id than camera-control, camera, video, system",
        ),
        ({**LINE, "architecture.base": "hop3"}, "architecture.base: is 'hop3', the id of a process beyond"),
        ({"camera.kind": "none", "backbone.model": "ethernet"}, "backbone: is given, and no process"),
        ({"camera.kind": "none", "serial.baud": 9600}, "serial: is given, and no process"),
        ({"camera.kind": "evi"}, "camera.kind: unknown kind 'evi'; did you mean evi-d30?"),
        ({"camera.hops": [[0, 0]] * 17}, "camera.hops"),
        ({"camera.passes": ["fixes", "fixes"]}, "camera.passes: has something twice"),
        ({"radio": {"camra": {"device": "wifi11b"}}}, "radio.camra: there is no role or process 'camra'"),
        (
            {"faults": [{"kind": "kill", "role": "forwarder", "share": 1.0, "at_s": 3}]},
            "faults[0].role: no process has the role 'forwarder'; "
            "expected one of gateway, ear, camera-control, camera, video, system",
        ),
    ],
)
def test_what_cannot_be_is_one_clear_error(settings: dict[str, Any], expected: str) -> None:
    found = error(settings)
    assert found.startswith(expected)
    assert "\n" not in found


@pytest.mark.parametrize("name", [name for name in names() if name != "yang-ecpa"])
def test_other_architectures_have_no_gateway(name: str) -> None:
    kind = Scenario.load(name).architecture.kind
    expected = f"camera.kind: is 'evi-d30', and architecture {kind} has no gateway to it; expected 'none', or"
    assert error({"camera.kind": "evi-d30"}, name).startswith(expected)


def test_a_sensor_with_the_id_of_a_process_beyond_the_gateway(tmp_path: Any) -> None:
    file = tmp_path / "ears.csv"
    file.write_text("id,x,y\nn000,0,0\ncamera,20,0\nn002,0,20\nn003,20,20\n")
    field = {**SMALL, "field": {"layout": "file", "file": str(file)}}
    found = error({"camera.kind": "evi-d30"}, field)
    assert found.startswith("field: a sensor has the id 'camera', and so has a process beyond the gateway; expected")
    assert plan_of({}, field)


def test_a_hop_out_of_reach_is_named_with_its_distance() -> None:
    found = error({**HOPS, "camera.hops": [[60, -60], [3060, -60], [70, -40]]})
    expected = "camera.hops: on the backbone hop2 and hop1 are 3000 m apart, and 0% of the messages arrive; expected"
    assert found.startswith(expected)


def test_a_backbone_that_loses_most_is_an_error() -> None:
    assert "and 30% of the messages arrive" in error({"backbone.model": "fixed", "backbone.loss": 0.7})
    assert plan_of({"backbone.model": "fixed", "backbone.loss": 0.5})


# --- what is foreseen -------------------------------------------------------------------------------------------------


def test_the_packaged_camera_can_be_turned_to_three_of_four() -> None:
    lines, warnings = said(plan_of({}))
    assert lines == [
        "camera: its control is told of a fix 1 ms after the base, directly; then it can be turned to the target of "
        "3 of 4 fixes, not of that at 58.5 s"
    ]
    assert warnings == []


def test_hops_are_counted_with_what_they_hold() -> None:
    lines, warnings = said(plan_of(LINE))
    assert lines[0].startswith("camera: its control is told of a fix 64 ms after the base, over 4 hops; ")
    assert warnings == []
    slow, _ = said(plan_of({**LINE, "camera.hop_s": 0.5, "backbone.model": "ethernet", "backbone.delay_ms": 10.0}))
    assert slow[0].startswith("camera: its control is told of a fix 1.54 s after the base, over 4 hops; ")


def test_a_backbone_that_loses_some_is_a_warning() -> None:
    _, warnings = said(plan_of({**LINE, "backbone.model": "fixed", "backbone.loss": 0.2}))
    assert len(warnings) == 1
    assert warnings[0].startswith("18 of 18 links of the backbone lose more than 10% of the messages (worst: ")
    assert "80% arrive): fixes are sent again, and come late" in warnings[0]


def test_a_camera_that_looks_away_from_all_is_a_warning() -> None:
    lines, warnings = said(plan_of({"camera.x_m": -2000.0, "camera.heading_deg": 180.0}))
    assert "0 of 4 fixes, not of that at 12.3 s, 32.3 s, 58.5 s and 1 more" in lines[0]
    assert len(warnings) == 1
    assert warnings[0].startswith("the camera cannot be turned to the target of any fix: by then all are more than 100")
    assert said(plan_of({"camera.x_m": -2000.0}))[1] == []


def test_without_a_camera_nothing_is_said_of_one() -> None:
    assert said(plan_of({"camera.kind": "none"})) == ([], [])


def test_only_those_with_a_radio_of_the_field_may_be_apart_in_it() -> None:
    plan = plan_of(HOPS)
    assert {*expected(plan).field.reached.near} == {"base", "n000", "n001", "n002", "n003", "n004"}
    assert not any("groups that do not reach each other" in text for text in warned(plan).warnings)


def test_clocks_on_the_backbone_are_no_links_of_the_field() -> None:
    field = expected(plan_of(HOPS)).field
    syncs = {flow.medium: flow.pairs for flow in field.plan.flows if kind_of(flow.message).name == "sync-request"}
    assert {id for pair in syncs["field"] for id in pair} <= {*field.reached.near}
    assert syncs["backbone"] == (("hop1", "base"), ("hop2", "hop1"), ("hop3", "hop2"), ("camera-control", "hop3"))


@pytest.mark.parametrize(
    ("delay_ms", "kinds"),
    [(1.0, {"item", "item-ack", "order", "order-reply"}), (5.0, {"data", "data-ack"}), (100.0, {"data", "data-ack"})],
)
def test_answers_are_as_fast_as_on_the_fastest_medium(delay_ms: float, kinds: set[str]) -> None:
    """A message of the field takes 1.64 ms; a serial line at 9600 baud takes 10 bits a byte."""
    found = answers(plan_of({"backbone.model": "ethernet", "backbone.delay_ms": delay_ms}))
    assert found is not None
    assert kinds <= {*found.kinds}
    assert found.delay_s == pytest.approx(min(delay_ms / 1000, 0.0016), abs=0.0001)


def test_items_are_as_long_as_fixes() -> None:
    """Of one tracker: a Gaussian over four numbers, and eight raw reports."""
    (item,) = (flow.message for flow in plan_of({}).flows if kind_of(flow.message).name == "item")
    (carried,) = (flow.message for flow in plan_of(HOPS).flows if kind_of(flow.message).name == "carried")
    assert isinstance(item, Item)
    assert isinstance(decode(item.message), FixReport)
    assert isinstance(carried, Carried)
    assert decode(carried.message) == item
    assert 150 < len(encode(item)) < len(encode(carried)) < 250


# --- what processes are told ------------------------------------------------------------------------------------------


def test_each_process_is_on_its_media() -> None:
    media = {process.id: process.media for process in plan_of(HOPS).processes if process.role != "ear"}
    backbone = ("backbone",)
    assert media == {
        "base": ("field", "backbone"),
        **dict.fromkeys(("hop1", "hop2", "hop3", "video", "system"), backbone),
        "camera-control": ("backbone", "serial"),
        "camera": ("serial",),
    }


def test_the_line_to_a_camera_is_as_fast_as_the_camera() -> None:
    assert plan_of({}).run.media["serial"]["baud"] == 9600
    assert plan_of({"serial.baud": 38400}).run.media["serial"]["baud"] == 38400


def test_faults_and_radios_may_be_those_of_the_new_roles() -> None:
    fault = {"kind": "kill", "role": "forwarder", "share": 1.0, "at_s": 3}
    plan = plan_of({**HOPS, "faults": [fault], "radio": {"forwarder": {"device": "wifi11b"}}})
    assert {process.id for process in plan.processes if process.kill_ns is not None} == {"hop1", "hop2", "hop3"}


def test_a_base_without_a_camera_is_the_sink_that_it_was() -> None:
    alone = {p.id: p for p in plan_of({"camera.kind": "none"}).processes}
    beyond = {p.id: p for p in plan_of({}).processes}
    assert {id: p.role for id, p in alone.items() if p.role != "ear"} == {"base": "sink"}
    assert beyond["base"].config["sink"] == {**alone["base"].config, "gateway": True}
    assert all(beyond[id].config == process.config for id, process in alone.items() if process.role == "ear")
