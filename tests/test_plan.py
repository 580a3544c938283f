"""From a scenario to processes: clocks, batteries, lives, faults, a centre that drives, and who is told what."""

from __future__ import annotations

from dataclasses import replace
from statistics import fmean, stdev
from typing import Any

import msgpack
import pytest

from launcher.plan.forecast.reception import receptions
from launcher.plan.hardware import duty_of, slowest_ns
from launcher.plan.prepare import load, planned
from launcher.records import Plan
from trackfield.drivers.spec import ProcessSpec, places_of
from trackfield.errors import ScenarioError
from trackfield.link.clock import Clock
from trackfield.link.energy import DEVICES, Power
from trackfield.link.places import position
from trackfield.scenario.survey import survey
from trackfield.world.placed import Placed

S = 1_000_000_000


def made(*settings: str, seed: int = 1) -> Plan:
    return planned(load("spcpf", settings=["link.model=ideal", *settings], seed=seed))


def process(plan: Plan, name: str) -> ProcessSpec:
    (found,) = [p for p in plan.processes if p.name == name]
    return found


def refused(*settings: str) -> str:
    with pytest.raises(ScenarioError) as caught:
        made(*settings)
    return str(caught.value)


def test_a_plain_field_is_told_nothing_of_what_it_does_not_use() -> None:
    plan = made()
    assert process(plan, "n060").config.keys() == {"step_ns", "threshold_db", "centre"}
    assert not process(plan, "fusion").config.keys() & {"max_age_ns", "threshold"}
    assert {(p.incarnation, p.start_ns, p.kill_ns, p.freezes, p.jumps, p.faults, p.legs) for p in plan.processes} == {
        (0, 0, None, (), (), (), ())
    }
    assert not any(p.clock for p in plan.processes)
    assert (plan.run.partitions, plan.info.marks, plan.restart) == ((), (), False)
    assert made("restart=on-death").restart


# --- clocks -----------------------------------------------------------------------------------------------------------

OFF = ("clock.offset_ms=50", "clock.drift_ppm=20")


def test_clocks_are_drawn_for_each_node_and_the_centres_is_right() -> None:
    centre, *nodes = made(*OFF, "clock.ramp_ppm_per_h=-2", "field.nodes=1000").processes
    assert centre.clock == {}
    for name, sd in (("offset_ns", 50e6), ("drift_ppb", 20e3)):
        drawn = [node.clock[name] for node in nodes]
        assert fmean(drawn) == pytest.approx(0, abs=4 * sd / len(drawn) ** 0.5)
        assert stdev(drawn) == pytest.approx(sd, rel=0.1)
        assert len(set(drawn)) > 0.95 * len(drawn)
    assert {node.clock["ramp_ppb_per_h"] for node in nodes} == {-2000}
    assert Clock(**nodes[0].clock).local(0) == nodes[0].clock["offset_ns"]


def test_a_clock_belongs_to_seed_and_node_whatever_else_is_there() -> None:
    few, many, other = made(*OFF), made(*OFF, "field.nodes=144", "sensor.alpha=2.1"), made(*OFF, seed=2)
    assert process(few, "n060").clock == process(many, "n060").clock
    assert process(few, "n060").clock != process(other, "n060").clock


def test_nodes_synchronise_if_their_clocks_are_off_and_they_may() -> None:
    plan = made(*OFF, "clock.exchanges=4", "clock.resync_s=30.5")
    assert process(plan, "n060").config["sync"] == {
        "reference": "fusion", "exchanges": 4, "resync_ns": 30_500_000_000, "timeout_ns": 100_000_000,
        "seed": 1, "id": "n060",
    }  # fmt: skip
    for settings in ((), ("clock.exchanges=4",), (*OFF, "clock.sync=false")):
        assert "sync" not in process(made(*settings), "n060").config
    assert "sync" in process(made("clock.ramp_ppm_per_h=1"), "n060").config


@pytest.mark.parametrize(
    ("settings", "least_ms", "most_ms"),
    [
        (["link.model=ideal"], 0, 1),
        (["link.model=fixed", "link.delay_ms=300"], 300, 300),
        (["link.model=gilbert_elliott", "link.delay_ms=20", "link.jitter_ms=10"], 60, 80),
        (["link.radio=802154-20dbm", "link.ack=3"], 9, 12),
        (["link.radio=lora868", "link.sf=12", "link.ack=0"], 3000, 6000),
        (["link.model=csma154", "link.ack=2"], 6, 8),
    ],
)
def test_a_node_waits_as_long_for_an_answer_as_its_link_may_take(
    settings: list[str], least_ms: float, most_ms: float
) -> None:
    scenario = load("spcpf", settings=settings)
    assert least_ms <= slowest_ns(scenario) / 1e6 <= most_ms


# --- energy -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("settings", "device"),
    [
        ([], "cc2420"),
        (["link.radio=802154-0dbm"], "cc2420"),
        (["link.radio=802154-20dbm"], "cc2420-20dbm"),
        (["link.radio=lora868"], "sx1276"),
        (["link.radio=wifi11b"], "wifi11b"),
        (["link.radio=mica2"], "cc2420"),
        (["link.radio=wifi11b", "energy.device=cc2420"], "cc2420"),
        (["link.loss=0.1", "energy.device=sx1276"], "sx1276"),
    ],
)
def test_a_device_is_that_of_the_radio_unless_it_is_named(settings: list[str], device: str) -> None:
    plan = planned(load("spcpf", settings=settings or ["link.model=ideal"]))
    assert {Power(**p.power) for p in plan.processes} == {DEVICES[device]}


def test_batteries_are_of_nodes_and_centre_and_readings_cost_nodes_alone() -> None:
    plan = made("energy.battery_j=0.5", "energy.centre_battery_j=1e9", "energy.sample_mj=0.25")
    node, centre = Power(**process(plan, "n060").power), Power(**process(plan, "fusion").power)
    assert (node.battery_fj, node.sample_fj) == (5 * 10**14, 25 * 10**10)
    assert (centre.battery_fj, centre.sample_fj) == (10**24, 0)


# --- what travels -----------------------------------------------------------------------------------------------------


def test_every_part_of_a_process_travels() -> None:
    plan = made(
        *OFF, "energy.centre_battery_j=1e9", "energy.battery_j=1", "fusion={path=[[0, 0, 0], [60, 500, 1]]}",
        "faults=[{kind='restart', nodes=['n060'], at_s=20, until_s=30}, {kind='deaf', nodes=['n060'], at_s=3}, "
        "{kind='freeze', nodes=['n060'], at_s=3, until_s=4}, {kind='clock_jump', nodes=['n060'], at_s=3, jump_ms=9}]",
    )  # fmt: skip
    for name in ("fusion", "n060", "n060~1"):
        one = process(plan, name)
        travelled = ProcessSpec.from_plain(
            msgpack.unpackb(msgpack.packb(one.plain()), strict_map_key=False), one.factory
        )
        assert travelled == ProcessSpec.from_plain(one.plain(), one.factory)
        parts = ("power", "clock", "peers", "legs", "freezes", "jumps", "faults", "kill_ns", "start_ns", "incarnation")
        assert [getattr(travelled, part) for part in parts] == [getattr(one, part) for part in parts]


# --- a centre that drives ---------------------------------------------------------------------------------------------


def test_a_centre_that_drives_is_where_its_path_says() -> None:
    plan = made("fusion={path=[[10, -50, 250], [40, 550, 250]]}")
    centre = process(plan, "fusion")
    assert centre.legs == ((10 * S, -50.0, 250.0), (40 * S, 550.0, 250.0))
    assert (centre.x, centre.y) == (-50.0, 250.0)
    for places in (places_of(plan.processes), process(plan, "n060").places, centre.places):
        assert [position(places, "fusion", t * S) for t in (0, 10, 25, 40, 61)] == [
            (-50.0, 250.0), (-50.0, 250.0), (250.0, 250.0), (550.0, 250.0), (550.0, 250.0)
        ]  # fmt: skip
    assert {p.place for p in plan.processes if p.role == "node"} == {(p.x, p.y) for p in plan.processes[1:]}


# --- thresholds, queues, acknowledgements, late reports ---------------------------------------------------------------


def test_an_adaptive_threshold_is_told_to_both_ends() -> None:
    plan = made("sensor.threshold=adaptive", "sensor.threshold_max=0.78", "fusion.target_sd_m=5")
    node, centre = process(plan, "n060"), process(plan, "fusion")
    assert node.config["adaptive"] == {"listen_from_ns": 300_000_000, "listen_for_ns": 100_000_000}
    assert node.config["threshold_db"] == pytest.approx(0.74 * 70)
    assert Placed.from_plain(node.sound).kind.own.audible_db == pytest.approx(0.70 * 70 - 1)
    assert centre.config["threshold"] == {
        "low_db": pytest.approx(49),
        "high_db": pytest.approx(54.6),
        "start_db": pytest.approx(51.8),
        "target_sd_m": 5.0,
        "reach_m": pytest.approx(10**2.2),
    }
    assert plan.reach_m == pytest.approx(10**2.1)


@pytest.mark.parametrize(
    ("settings", "from_ms", "for_ms"),
    [
        ([], 300, 431.776),  # 32 commands of 3 times 3.456 ms: 81 bytes and the wait for an acknowledgement
        (["link.ack=0"], 300, 210.592),
        (["link.model=csma154", "link.ack=0"], 300, 210.592),
        (["link.radio=lora868"], 300, 1000),  # its commands take longer than a step
        (["link.model=trace", "link.file=trace.csv"], 300, 1000),
        (["link.model=fixed", "link.delay_ms=30"], 300, 130),
        (["link.model=gilbert_elliott", "fusion.deadline_s=1"], 1000, 170),
        (["link.model=ideal", *OFF], 300, 100),
        (["link.model=ideal", *OFF, "clock.sync=false"], 300 - 153.66, 100 + 2 * 153.66),  # 61 s of 20 ppm
        (["link.model=ideal", "clock.sync=false", "target.step_s=0.25", "fusion.deadline_s=0.2"], 200, 100),
        (["link.model=ideal", "clock={sync=false, offset_ms=300}"], -600, 1000),
    ],
)
def test_nodes_listen_for_commands_as_long_as_they_may_take(settings: list[str], from_ms: float, for_ms: float) -> None:
    scenario = load("spcpf", settings=["sensor.threshold=adaptive", *settings])
    duty = duty_of(replace(survey(scenario), origin_ns=0))
    assert duty is not None
    assert (duty["listen_from_ns"] / 1e6, duty["listen_for_ns"] / 1e6) == pytest.approx((from_ms, for_ms))


def test_a_queue_is_the_processes_and_acknowledgements_are_the_links() -> None:
    plan = planned(load("spcpf", settings=["link.queue=3", "link.acks={doa = 5, sync-reply = 0}"]))
    assert plan.run.queue() == 3
    assert "queue" not in plan.run.link
    assert plan.run.link["acks"] == {"doa": 5, "sync-reply": 0}
    assert made().run.queue() == 32
    message = refused("link={model='csma154', acks={dooa = 5}}")
    assert message.startswith(
        "link.acks: there is no message 'dooa'; did you mean doa?; expected names of messages: doa"
    )


def test_late_reports_are_of_use_up_to_an_age() -> None:
    assert process(made("fusion.max_age_s=2.5"), "fusion").config["max_age_ns"] == 2_500_000_000


# --- lives and faults -------------------------------------------------------------------------------------------------


def faulty(*faults: str, **more: Any) -> Plan:
    return made(f"faults=[{', '.join('{' + fault + '}' for fault in faults)}]", **more)


def test_each_life_is_a_process_of_the_same_place() -> None:
    plan = faulty("kind='restart', nodes=['n060'], at_s=20, until_s=30", "kind='kill', nodes=['fusion'], at_s=50")
    first, second = process(plan, "n060"), process(plan, "n060~1")
    assert (first.start_ns, first.kill_ns, second.start_ns, second.kill_ns) == (0, 20 * S, 30 * S, None)
    assert (first.x, first.y, first.config, first.power) == (second.x, second.y, second.config, second.power)
    assert (first.sound["incarnation"], second.sound["incarnation"]) == (0, 1)
    assert process(plan, "fusion").kill_ns == 50 * S
    assert len(plan.processes) == 123
    assert [place.id for place in plan.info.places] == ["fusion", *(f"n{i:03}" for i in range(121))]
    assert plan.info.marks == (
        (20.0, "n060", "restart until 30 s"), (30.0, "n060", "up again"), (50.0, "fusion", "kill")
    )  # fmt: skip
    assert len(receptions(plan)["doa"]) == 121


def test_the_noise_of_a_second_life_is_its_own_and_its_place_is_not() -> None:
    plan = faulty("kind='restart', nodes=['n060'], at_s=20, until_s=30")
    assert process(plan, "fusion").peers == places_of(p for p in plan.processes if p.role == "node")
    assert process(plan, "n060~1").peers == {"fusion": (250.0, 250.0)}


def test_faults_go_to_whom_they_befall() -> None:
    plan = faulty(
        "kind='stuck', nodes=['n060'], at_s=3, until_s=4", "kind='freeze', nodes=['n061'], at_s=3, until_s=4",
        "kind='clock_jump', nodes=['n062'], at_s=3, jump_ms=-5", "kind='partition', share=0.5, at_s=3, until_s=4",
    )  # fmt: skip
    assert process(plan, "n060").faults == ({"kind": "stuck", "from_ns": 3 * S, "until_ns": 4 * S},)
    assert process(plan, "n061").freezes == ((3 * S, 4 * S),)
    assert process(plan, "n062").jumps == ((3 * S, -5_000_000),)
    ((begin, end, ids, medium),) = plan.run.partitions
    assert (begin, end, len(ids), medium) == (3 * S, 4 * S, 60, None)
    assert not any(p.faults or p.freezes or p.jumps for p in plan.processes if p.id not in ("n060", "n061", "n062"))


def test_a_fault_of_nobody_is_told_when_the_field_is_known() -> None:
    message = refused("faults=[{kind='kill', nodes=['n06'], at_s=20}]")
    assert message.startswith("faults[0].nodes: there is no 'n06'; did you mean n")
    assert refused("faults=[{kind='kill', nodes=['n060'], at_s=61}]").startswith("faults[0].at_s: is 61, and the run")


# --- receptions -------------------------------------------------------------------------------------------------------


def test_receptions_are_of_the_links_in_use() -> None:
    assert receptions(made()).keys() == {"doa"}
    both = receptions(made(*OFF, "sensor.threshold=adaptive"))
    assert list(both) == ["doa", "sync-request", "sync-reply", "threshold"]
    for kind, shares in both.items():
        there = kind in ("doa", "sync-request")
        assert set(shares) == {(f"n{i:03}", "fusion")[:: 1 if there else -1] for i in range(121)}


def test_the_reception_of_a_centre_that_drives_is_that_of_its_whole_path() -> None:
    """It is in range of the corner (0, 0) in the first quarter of the run alone."""
    drives = made("fusion={path=[[0, 0, 0], [61, 400, 0]]}", "link.range_m=100")
    shares = receptions(drives)["doa"]
    assert shares["n000", "fusion"] == pytest.approx(0.25, abs=0.03)
    assert shares["n004", "fusion"] == pytest.approx(0.5, abs=0.03)
    assert shares["n120", "fusion"] == 0


def test_a_plan_tells_the_timeline_how_well_reports_get_through() -> None:
    plan = planned(load("spcpf"))
    assert {(src, dst): share for src, dst, share in plan.info.receptions} == receptions(plan)["doa"]
    assert made("field.nodes=3000").info.receptions == ()


@pytest.mark.parametrize(("setting", "name"), [("backbone.model=ideal", "backbone"), ("serial.baud=9600", "serial")])
def test_a_medium_that_no_process_has_needs_no_section(setting: str, name: str) -> None:
    what = f"{name}: is given, and no process of architecture centralised has this medium; expected an architecture"
    assert refused(setting).startswith(what)
