"""Fields of masters and slaves before they run: what is wrong with them, and what is expected of them."""

from __future__ import annotations

import re
from collections import Counter
from math import hypot
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from launcher.plan.forecast.foresight import foresee
from launcher.plan.forecast.masters.association import FULL, NO_MASTER
from launcher.plan.forecast.masters.led import orphaned
from launcher.plan.forecast.masters.load import Load, _most_in_an_hour
from launcher.plan.forecast.masters.scheduled import Scheduled
from launcher.plan.forecast.warnings import summary, warnings
from launcher.plan.prepare import planned
from launcher.record.figures.channel import air_of_run, channel_metrics
from launcher.record.ledger import Ledger
from launcher.records import SENSES, Plan
from launcher.reproduce.papers.ozfidan.field import NOBODY, associated
from tests.cluster_budgets import FIELD, budget
from tests.command_line import Call, trackfield
from tests.simulated import simulated
from trackfield.errors import ScenarioError
from trackfield.role import NS
from trackfield.scenario import Scenario

__all__ = ["trackfield"]

SMALL: dict[str, Any] = {
    "name": "small",
    "field": {"layout": "random", "nodes": 24, "spacing_m": 100.0},
    "sensor": {"kind": "range", "range_m": 800.0, "floor_sd_m": 0.1, "growth_m": 0.02},
    "target": {
        "path": "drifting", "start_m": [250.0, 250.0], "half_width_m": 240.0, "speed_m_s": 4.0,
        "step_s": 1.0, "steps": 60,
    },
    "link": {"model": "fixed", "delay_ms": 20.0, "loss": 0.0},
    "architecture": {"kind": "clusters", "masters": 6, "placement": "random"},
    "fusion": {"trackers": ["ukf"], "prior": "paper", "prior_sd": [1.0, 1.0, 0.5, 0.5], "sigma_v": 0.1,
               "deadline_s": 0.4},
    "run": {"setup_s": 15.0},
}  # fmt: skip
LORA = {**FIELD, "link": {**FIELD["link"], "sf": 7}, "radio": {"master": {"tx_dbm": 20.0}}}


def plan_of(scenario: dict[str, Any] = SMALL, **changes: Any) -> Plan:
    return planned(Scenario.load(scenario, {key.replace("__", "."): value for key, value in changes.items()}))


def expected(scenario: dict[str, Any] = SMALL, **changes: Any) -> Scheduled:
    found = Scheduled.of(plan_of(scenario, **changes))
    assert found is not None
    return found


# --- what is wrong with a scenario ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("setting", "says"),
    [
        ("architecture.masters=0", "architecture.masters: is 0; expected a whole number from 1 to 1000"),
        ("architecture.capacity=0", "architecture.capacity: is 0; expected a whole number from 1 to 50"),
        ("architecture.policy=nearst_4", "did you mean nearest_4?"),
        ("architecture.placement=besides", "architecture.placement"),
        ("architecture.base=n000", "architecture.base: is 'n000', which is also a sensor's id"),
        ("architecture.base=m0", "architecture.base: is 'm0', which is also a master's id"),
        ("architecture.base=recorder", "architecture.base: is 'recorder', which names another process of the run"),
        ("architecture.beacon_every=1", "architecture.beacon_every: is 1; expected a whole number from 2 to 250"),
        ("architecture.listen_every=0", "architecture.listen_every: is 0"),
        ("architecture.share_every=0", "architecture.share_every: is 0"),
        ("architecture.base_every=-1", "architecture.base_every: is -1"),
        ("architecture.timeout_steps=0", "architecture.timeout_steps: is 0"),
        ("architecture.handover=belief", "architecture.handover"),
        ("architecture.unasked=1", "architecture.unasked"),
        ("architecture.announcements=0", "architecture.announcements: is 0"),
        ("architecture.renew_s=0", "architecture.renew_s: is 0"),
        ("architecture.master_battery_j=0", "architecture.master_battery_j: is 0"),
        ("architecture.master=6", "architecture.master: unknown; did you mean masters?"),
        ("fusion.deadline_s=0.01", "fusion.deadline_s: is 0.01 s, and policy 'merge_until_3' takes reports of up to 7"),
        ("fusion.deadline_s=0.99", "of a step of 1 s; expected from 0.1 to 0.88"),
        ("run.setup_s=1", "run.setup_s: is 1 s, and 24 slaves take 6.6 s to find masters; expected at least 7"),
    ],
)
def test_one_message_says_what_is_wrong(trackfield: Call, tmp_path: Path, setting: str, says: str) -> None:
    said = _validated(trackfield, tmp_path, SMALL, setting)
    assert said.code == 2
    assert says in said.err
    assert len(said.err.splitlines()) == 1


def _validated(trackfield: Call, folder: Path, scenario: dict[str, Any], *settings: str) -> Any:
    file = folder / "field.toml"
    file.write_text(Scenario.load(scenario).to_toml())
    return trackfield("validate", file, *(word for one in settings for word in ("--set", one)))


@pytest.mark.parametrize(
    ("sf", "policy", "slots_s", "least_s"),
    [(7, "all", 34.32, 35.0), (8, "merge_until_3", 1.84, 2.99), (9, "merge_until_3", 3.34, 5.42)],
)
def test_a_step_that_is_too_short_says_what_it_would_take(
    trackfield: Call, tmp_path: Path, sf: int, policy: str, slots_s: float, least_s: float
) -> None:
    given = {**LORA, "link": {**FIELD["link"], "sf": 7}}
    said = _validated(trackfield, tmp_path, given, f"link.sf={sf}", f"architecture.policy={policy}")
    assert said.code == 2
    pattern = r"target.step_s: is 2 s, and policy '(\w+)' takes ([\d.]+) s of radio time \(reports .* ([\d.]+) s, a h"
    words = re.search(pattern, said.err)
    assert words
    assert words[1] == policy
    assert float(words[2]) == pytest.approx(least_s, abs=0.2)
    assert float(words[3]) == pytest.approx(slots_s, abs=0.01)
    assert "a faster radio, or another policy" in said.err


def test_a_budget_is_the_sum_of_its_parts() -> None:
    """By hand, for SF7: a report of 11 bytes and 13 around it takes 61.7 ms, and a slot a quarter more."""
    one = budget(7, "merge_until_3")
    assert one.slot_ns == pytest.approx(1.25 * 61.696e6, abs=1)
    assert one.reports_ns == one.slots * one.slot_ns
    assert one.least_ns == one.deadline_ns + one.acts_ns + one.beacon_ns
    assert 7 < one.slots <= 7 + 2 * 4  # of seven slaves, and of what two masters send


# --- who has which master ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(10))
def test_without_losses_the_paper_s_order_is_expected(seed: int) -> None:
    field = expected(seed=seed)
    masters = np.array([place for _, *place in field.schedule.masters])
    slaves = np.array([(place.x, place.y) for place in field.plan.info.tagged(SENSES)])
    owners = associated(masters, slaves, 5).tolist()
    assert NOBODY not in owners
    assert [field.association.masters[id] for id in field.association.asked] == [f"m{owner}" for owner in owners]


def test_more_slaves_than_places_leave_orphans() -> None:
    field = expected(architecture__masters=4)
    assert len(field.association.masters) == 20
    assert list(field.association.orphans.values()) == [FULL] * 4
    assert sorted(field.association.orphans) == ["n020", "n021", "n022", "n023"]  # the last in the order
    (said,) = orphaned(field)
    assert said.startswith("4 of 24 slaves find no master and will not measure (4: all in reach are full); 24 slaves")
    assert "more than the 20 places of 4 masters" in said


def test_slaves_out_of_reach_of_all_masters_are_orphans() -> None:
    field = expected(link__range_m=150.0, architecture__capacity=24, architecture__masters=8, seed=3)
    at = {place.id: (place.x, place.y) for place in field.plan.info.places}
    near = {
        id: min(hypot(x - at[id][0], y - at[id][1]) for _, x, y in field.schedule.masters)
        for id in field.association.asked
    }
    assert set(field.association.orphans) == {id for id, away in near.items() if away > 150}
    assert len(field.association.orphans) == 7
    assert set(field.association.orphans.values()) == {NO_MASTER}


def test_few_orphans_are_no_warning() -> None:
    field = expected(field__nodes=100, architecture__masters=20, architecture__capacity=5, run__setup_s=60.0)
    assert not field.association.orphans
    assert not list(orphaned(field))


# --- who measures -----------------------------------------------------------------------------------------------------


def test_the_nearest_master_s_slaves_measure() -> None:
    field = expected(architecture__policy="closest")
    for step, turn in field.turns.items():
        x, y = _at(field, step - 1)
        nearest = min(field.schedule.masters, key=lambda one: hypot(one[1] - x, one[2] - y))[0]
        assert turn.leader == nearest
        members = [id for id, master in field.association.masters.items() if master == nearest]
        assert sorted(turn.slots) == sorted(members)
        assert sorted(turn.slots.values()) == list(range(len(members)))


@pytest.mark.parametrize("policy", ["nearest_4", "information_4"])
def test_the_nearest_sensors_measure(policy: str) -> None:
    field = expected(architecture__policy=policy)
    at = {place.id: (place.x, place.y) for place in field.plan.info.tagged(SENSES)}
    for step, turn in field.turns.items():
        x, y = _at(field, step)
        assert set(turn.slots) == set(sorted(at, key=lambda id: hypot(at[id][0] - x, at[id][1] - y))[:4])


def test_a_cluster_of_two_is_merged_with_the_next() -> None:
    field = expected(architecture__capacity=2, architecture__masters=12)
    assert all(len(turn.slots) >= 3 for turn in field.turns.values())
    assert all(turn.gathered for turn in field.turns.values())


def _at(field: Scheduled, step: int) -> tuple[float, float]:
    (path,) = field.plan.paths.values()
    state = path.at((field.plan.origin_ns + step * field.plan.step_ns) / NS)
    assert state is not None
    return state[0], state[1]


# --- what is sent, and what a run sends -------------------------------------------------------------------------------

EXACT = ("announce", "join", "admit", "roster", "hand-over", "hand-over-ack", "share", "hop", "hop-ack")
NEARLY = {"range": 0.02, "wake": 0.1, "aggregate": 0.3}
"""Where an estimate is another one than the truth, another cluster measures, near the edge of one."""


@pytest.mark.parametrize("seed", [1, 2])
def test_without_losses_a_run_sends_what_was_predicted(seed: int) -> None:
    plan = plan_of(seed=seed)
    field = Scheduled.of(plan)
    assert field is not None
    load = Load.of(field)
    predicted = Counter(frame.kind for frame in (*load.setup, *load.steps))
    ledger, _ = simulated(plan)
    assert isinstance(ledger, Ledger)
    sent = Counter(kind for _, kind, _, _ in {(row.src, row.kind, row.sent_ns, row.copy) for row in ledger.rows})
    for kind in EXACT:
        assert sent[kind] == predicted[kind], kind
    for kind, share in NEARLY.items():
        assert sent[kind] == pytest.approx(predicted[kind], rel=share, abs=3), kind


def test_reports_are_those_of_the_schedule() -> None:
    plan = plan_of()
    seen = foresee(plan)
    assert seen.scheduled is not None
    assert sum(seen.reports.values()) == sum(len(turn.slots) for turn in seen.scheduled.turns.values())
    assert seen.arriving == 1.0
    assert not warnings(plan, seen)
    text = "\n".join(summary(plan, seen))
    assert "clusters: 24 of 24 slaves find one of 6 masters with a place\n" in text
    assert re.search(
        r"schedule: by policy 'merge_until_3' 4\.\d slaves measure in a step \(5 at most\), of 1\.\d clusters, 3", text
    )
    assert "budget: reports 0.07 s, clocks and delays" in text


def test_of_a_long_run_some_steps_stand_for_all(monkeypatch: pytest.MonkeyPatch) -> None:
    plan = plan_of()
    whole = foresee(plan)
    monkeypatch.setattr("launcher.plan.forecast.masters.scheduled.MOST_STEPS", 20)
    monkeypatch.setattr("launcher.plan.forecast.masters.load.MOST_LOOKED", 10)
    some = foresee(plan)
    assert some.scheduled is not None
    assert len(some.scheduled.turns) == 20
    assert some.every == 3
    assert Load.of(some.scheduled).every == 6.0
    assert sum(some.reports.values()) == pytest.approx(sum(whole.reports.values()), rel=0.1)


def test_a_channel_is_as_full_as_predicted() -> None:
    """2.58 % predicted, 2.55 % in the run; and an orphan, which asks for a master again and again."""
    link = {"model": "lognormal_prr", "radio": "802154-20dbm"}
    plan = plan_of({**SMALL, "link": link})
    seen = foresee(plan)
    assert seen.crowd is not None
    assert seen.scheduled is not None
    ledger, _ = simulated(plan)
    assert isinstance(ledger, Ledger)
    use = channel_metrics(air_of_run(ledger))["use_mean"]
    assert seen.crowd.use_mean == pytest.approx(use, rel=0.05)
    asking = {row.src for row in ledger.rows if row.kind == "solicit"}
    assert asking == set(seen.scheduled.association.orphans)
    assert len(asking) == 1


@pytest.mark.long
def test_the_channel_of_a_run_is_as_full_as_predicted() -> None:
    """All of its messages, of the setup too, most of which are for all in reach."""
    plan = plan_of(LORA, target__steps=100)
    crowd = foresee(plan).crowd
    assert crowd is not None
    ledger, _ = simulated(plan)
    assert isinstance(ledger, Ledger)
    use = channel_metrics(air_of_run(ledger))["use_mean"]
    assert crowd.use_mean == pytest.approx(use, rel=0.15)


# --- duty cycles ------------------------------------------------------------------------------------------------------


def test_the_busiest_hour_is_found() -> None:
    minute = 60 * NS
    assert _most_in_an_hour([(0, 1.0)]) == 1.0
    assert _most_in_an_hour([(k * minute, 1.0) for k in range(59, -1, -1)]) == 60.0
    assert _most_in_an_hour([(k * minute, 1.0) for k in range(600)]) == 60.0
    assert _most_in_an_hour([(0, 5.0), (61 * minute, 1.0), (62 * minute, 3.0)]) == 5.0


def test_duty_cycles_are_of_all_that_a_radio_sends() -> None:
    """A master with 20 dBm may send for a tenth of an hour, a slave with 14 dBm for a hundredth."""
    plan = plan_of(LORA)
    seen = foresee(plan)
    assert seen.scheduled is not None
    load, link = Load.of(seen.scheduled), seen.scheduled.link
    duties = {duty.what: duty for duty in seen.duties}
    assert {what: duty.allowed_s for what, duty in duties.items()} == {
        "its messages as base": 36.0, "its messages as master": 360.0, "its messages as slave": 36.0,
    }  # fmt: skip
    assert load.every == 1.0
    for duty in duties.values():  # the run is shorter than an hour
        sent = [link.fate(frame).air_ns for frame in (*load.setup, *load.steps) if frame.src == duty.id]
        assert duty.seconds == pytest.approx(sum(sent) / NS)
    leaders = {turn.leader for turn in seen.scheduled.turns.values()}
    assert duties["its messages as master"].id in leaders


def test_more_trackers_than_a_message_holds_are_refused() -> None:
    """Masters share what all trackers know in one message."""
    names = [f"tracker{number:02}" for number in range(15)]

    def planned_with(count: int) -> Plan:
        options = {name: {"tracker": "ukf"} for name in names[:count]}
        return plan_of(fusion__trackers=names[:count], fusion__options=options)

    assert planned_with(13)
    with pytest.raises(ScenarioError, match=r"^fusion.trackers: what 15 trackers know takes \d+ bytes"):
        planned_with(15)
