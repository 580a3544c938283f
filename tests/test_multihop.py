"""A field whose nodes hand on each other's messages to the centre (``architecture.multihop``)."""

from __future__ import annotations

import json
import re
from collections import Counter
from dataclasses import replace
from functools import cache
from itertools import pairwise
from pathlib import Path
from statistics import median
from typing import Any

import pytest

import trackfield.scenario as scenarios
from launcher.plan.architectures.arranged import Arranged
from launcher.plan.architectures.checks import checked
from launcher.plan.architectures.field import Field
from launcher.plan.forecast.foresight import foresee
from launcher.plan.forecast.warnings import summary, warnings
from launcher.plan.prepare import load, planned
from launcher.record.figures.hops import hop_latencies
from launcher.record.journal import METRICS
from launcher.record.ledger import Ledger
from launcher.record.metrics import run_metrics
from launcher.records import Plan
from launcher.report.folder import read_run
from launcher.study.compare import differences
from launcher.study.replay import replay
from tests.running import Run, both_ways
from tests.simulated import simulated
from trackfield.drivers.spec import links_of
from trackfield.errors import ScenarioError
from trackfield.role import Note
from trackfield.scenario import survey
from trackfield.wire.codec import decode, encode
from trackfield.wire.messages import Hop, Threshold

WEAK = ("link.tx_dbm=0", "fusion.x_m=0", "fusion.y_m=0")
"""A centre in the corner of the field, and radios that reach 60 m or so."""
MULTIHOP = (*WEAK, "architecture.multihop=true")


@cache
def run(*settings: str, seed: int = 1) -> tuple[Plan, Ledger, dict[str, Any]]:
    plan = planned(load("zhai-spcpf", seed=seed, settings=[*settings, "fusion.trackers=['imm-ukf']"]))
    ledger, tracks = simulated(plan)
    return plan, ledger, run_metrics(plan, ledger, tracks)


def tracker(metrics: dict[str, Any]) -> dict[str, Any]:
    return metrics["trackers"]["imm-ukf"]


def hops(ledger: Ledger) -> list[tuple[Any, Hop]]:
    return [(row, decode(row.payload)) for row in ledger.rows if row.kind == "hop"]


def test_a_field_of_which_few_reach_the_centre_tracks_over_the_tree_and_not_without() -> None:
    plan, _, metrics = run(*MULTIHOP)
    link = links_of(plan.run, plan.processes)["field"]
    nodes = [process.id for process in plan.processes if process.id != "fusion"]
    assert sum(link.reception(id, "fusion", 29, "hop") > 0.1 for id in nodes) < len(nodes) / 5
    assert tracker(metrics)["verdict"] == "tracked"
    assert tracker(metrics)["rmse"]["position"] < 3.0
    _, _, alone = run(*WEAK)
    assert tracker(alone)["verdict"] == "lost"


def test_reports_make_several_hops_and_the_figures_say_how_long_they_took() -> None:
    plan, ledger, metrics = run(*MULTIHOP)
    by_hops = metrics["latency_ms"]["hops"]
    came = {
        (hop.origin, hop.number): hop.hops + 1
        for row, hop in hops(ledger)
        if row.dst == "fusion" and row.outcome == "delivered"
    }
    assert {hops: of["n"] for hops, of in by_hops.items()} == {str(k): n for k, n in Counter(came.values()).items()}
    assert max(map(int, by_hops)) >= 4
    assert by_hops["5"]["p50"] > 3 * by_hops["1"]["p50"]
    assert by_hops == hop_latencies(plan.bases, ledger.rows)
    assert run(*WEAK)[2]["latency_ms"]["hops"] == {}


def test_a_message_of_the_table_says_what_it_carries() -> None:
    _, ledger, _ = run(*MULTIHOP)
    first = next(row for row, hop in hops(ledger) if hop.hops == 0)
    assert first.text.startswith("doa: DOA ")
    assert f"of {first.src}, hop 1)" in first.text
    assert first.step is not None
    assert len(first.values) == 2
    second = next(row for row, hop in hops(ledger) if hop.hops == 1)
    assert second.step is None
    assert second.values == ()
    said = {row.text for row in ledger.rows if row.kind == "route"}
    assert any(text.startswith("0.00 transmissions to the base") for text in said)
    assert any("over n0" in text for text in said)
    assert any(row.text.endswith("is here") for row in ledger.rows if row.kind == "hop-ack")


def test_a_relay_that_dies_is_replaced_within_seconds() -> None:
    """The neighbour of the centre that hands on most dies in the middle of the run."""
    _, ledger, _ = run(*MULTIHOP)
    busiest = Counter(row.src for row, hop in hops(ledger) if row.dst == "fusion" and hop.hops).most_common(1)[0][0]
    dies_s = 30
    fault = f"faults=[{{kind='kill', nodes=['{busiest}'], at_s={dies_s}}}]"
    _, killed, metrics = run(*MULTIHOP, fault)
    assert not any(row.src == busiest and row.sent_ns > dies_s * 10**9 for row in killed.rows)
    missed = [
        note for diary in killed.diaries.values() for told in diary.told
        if isinstance(note := told.effect, Note) and note.text.startswith(f"{busiest} does not answer")
    ]  # fmt: skip
    assert missed
    arrived = sorted(row.due_ns / 1e9 for row, hop in hops(killed) if row.dst == "fusion" and row.delivered)
    gaps = [later - earlier for earlier, later in pairwise(arrived) if later > dies_s]
    assert max(gaps) < 3.0
    assert tracker(metrics)["verdict"] == "tracked"


def test_thresholds_come_to_the_nodes_over_the_tree() -> None:
    _, ledger, metrics = run(*MULTIHOP, "sensor.threshold=adaptive")
    commands = [
        (row, decode(hop.message)) for row, hop in hops(ledger) if hop.to == row.dst.encode() and row.delivered
    ]  # fmt: skip
    assert len(commands) > 50
    assert all(isinstance(command, Threshold) for _, command in commands)
    assert sum(row.outcome == "delivered" for row, _ in commands) > 50
    assert tracker(metrics)["verdict"] == "tracked"


def test_clocks_are_set_over_the_tree() -> None:
    _, ledger, metrics = run(*MULTIHOP, "clock.offset_ms=40")
    sent = [row for row, _ in hops(ledger) if row.step is not None]
    errors_ms = [abs(ledger.clock_errors[row.sent_ns, row.src]) / 1e6 for row in sent]
    assert len(errors_ms) > 100
    assert median(errors_ms) < 5.0 < 40.0
    assert tracker(metrics)["verdict"] == "tracked"


def test_the_tree_repeats_its_messages_itself_unless_the_scenario_says_otherwise() -> None:
    acks = planned(load("zhai-spcpf", settings=["architecture.multihop=true", "link.acks.hop=2"])).run.link["acks"]
    assert acks == {"route": 0, "hop": 2, "hop-ack": 0}
    assert "acks" not in planned(load("zhai-spcpf")).run.link


def test_each_process_has_those_in_reach_for_neighbours() -> None:
    plan, _, _ = run(*MULTIHOP)
    corner = next(process for process in plan.processes if process.id == "n000")
    assert 2 < len(corner.peers) < 40
    assert corner.tree["base"] == "fusion"
    assert len(encode(next(flow.message for flow in plan.flows if flow.over_tree))) < 20


def test_what_is_expected_before_a_run_is_of_the_way_over_the_tree() -> None:
    plan, ledger, _ = run(*MULTIHOP)
    seen = foresee(plan)
    came = {(hop.origin, hop.number) for row, hop in hops(ledger) if row.dst == "fusion" and row.delivered}
    made = {(hop.origin, hop.number) for _, hop in hops(ledger)}
    assert seen.arriving == pytest.approx(len(came) / len(made), abs=0.05)
    assert any("arrive" in line for line in summary(plan, seen))
    assert not any("arrive on the links" in text for text in warnings(plan, seen))


def test_who_is_longest_on_air_is_a_neighbour_of_the_centre_that_hands_on_for_others() -> None:
    lora = ("link.radio=lora868", "link.sf=7", "link.tx_dbm=-20", "target.step_s=10", "fusion.deadline_s=9")
    plan, ledger, _ = run("architecture.multihop=true", *lora, "fusion.x_m=0", "fusion.y_m=0")
    duty = max(foresee(plan).duties, key=lambda one: one.seconds, default=None)
    assert duty is not None
    last = Counter((row.src, row.dst) for row, hop in hops(ledger) if row.dst == "fusion" and row.delivered)
    assert duty.id in {id for pair in last for id in pair}
    made = {(hop.origin, hop.number) for _, hop in hops(ledger)}
    assert last.total() == len(made)
    own = Counter(src for src in (hop.origin.decode() for row, hop in hops(ledger) if hop.hops == 0))
    assert duty.id == "fusion" or own[duty.id] < last[duty.id, "fusion"]


class Headless:
    """All nodes are in a tree to a centre that is not."""

    def arrange(self, field: Field) -> Arranged:
        centre = field.fusion_centre("fusion", 0, 0, [id for id, *_ in field.sensors])
        nodes = [replace(one, base="fusion") for one in field.sensor_nodes("fusion")]
        return Arranged([centre, *nodes], {"base": ["fusion"]})


@pytest.mark.parametrize(
    ("base", "message"),
    [("fusion", "n000.base: is 'fusion', whose own base is ''"), ("fusoin", "there is no process 'fusoin'")],
)
def test_a_tree_needs_a_base_that_is_in_it(base: str, message: str) -> None:
    site = survey(scenarios.Scenario.load("zhai-spcpf"))
    arranged = Headless().arrange(Field(site))
    astray = [replace(one, base=base) if one.base else one for one in arranged.processes]
    with pytest.raises(ScenarioError, match=re.escape(message)):
        checked("headless", replace(arranged, processes=astray), site)


@pytest.mark.alone
def test_a_field_with_a_tree_is_the_same_under_both_drivers(tmp_path: Path) -> None:
    """Sixteen nodes whose clocks are off and whose threshold the centre sets; a relay dies, another is restarted."""
    faults = "faults=[{kind='kill', nodes=['n001'], at_s=6}, {kind='restart', nodes=['n005'], at_s=3, until_s=5}]"
    settings = [
        *MULTIHOP, "field.extent_m=150", "target.steps=12", "fusion.trackers=['ekf']", "sensor.threshold=adaptive",
        "clock.offset_ms=30", faults,
    ]  # fmt: skip
    home = both_ways(tmp_path, "zhai-spcpf", *(word for one in settings for word in ("--set", one)))
    assert differences(home / "virtual", home / "processes", 0.0) == []
    metrics = json.loads((home / "processes" / METRICS).read_text())
    assert {"route", "hop", "hop-ack"} <= metrics["frames"]["by_kind"].keys()
    assert "2" in metrics["latency_ms"]["hops"]


def test_a_replay_and_a_report_take_reports_from_their_sensors(tmp_path: Path) -> None:
    settings = [word for one in (*MULTIHOP, "target.steps=20", "fusion.trackers=['ekf']") for word in ("--set", one)]
    code, said = Run(tmp_path / "run", "zhai-spcpf", *settings, "--virtual", reported=True).finish()
    assert code == 0, said
    _, anew = replay(tmp_path / "run", out=tmp_path / "again"), json.loads((tmp_path / "again" / METRICS).read_text())
    before = json.loads((tmp_path / "run" / METRICS).read_text())
    assert anew["trackers"] == before["trackers"]
    assert anew["latency_ms"] == before["latency_ms"]
    run = read_run(tmp_path / "run")
    fates = run.frames.fates(run.frames.reports)
    assert sum(fates.values()) == sum(of["n"] for of in before["latency_ms"]["hops"].values())
    assert run.frames.senders() <= {place.id for place in run.places} - {"fusion"}
    assert int(run.frames.on_air.sum()) == len(run.frames) - sum(fates.values())
