"""What is predicted of a field in which any node may lead, before it runs, and what such a run sends."""

from __future__ import annotations

from collections import Counter
from math import hypot
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from launcher.plan.forecast.foresight import foresee
from launcher.plan.forecast.heads.polled import Polled
from launcher.plan.forecast.heads.turns import MOST_POLLS
from launcher.plan.forecast.masters.load import Load
from launcher.plan.forecast.warnings import summary, warnings
from launcher.plan.prepare import planned
from launcher.record.figures.channel import air_of_run, channel_metrics
from launcher.record.ledger import Ledger
from launcher.records import Plan, Polls
from tests.command_line import Call, trackfield
from tests.simulated import simulated
from trackfield.role import NS
from trackfield.scenario import Scenario

__all__ = ["trackfield"]

RADIO = {"model": "lognormal_prr", "radio": "802154-20dbm"}
SMALL: dict[str, Any] = {
    "name": "small",
    "field": {"layout": "grid", "nodes": 36, "spacing_m": 40.0},
    "sensor": {"kind": "range", "range_m": 70.0, "floor_sd_m": 0.5},
    "target": {"path": "waypoints", "waypoints": [[0, 10, 60], [40, 190, 130]], "step_s": 1.0, "steps": 40},
    "link": {"model": "fixed", "delay_ms": 5.0, "loss": 0.0},
    "architecture": {"kind": "location-central"},
    "fusion": {"trackers": ["ukf"], "prior": "paper", "prior_sd": [2.0, 2.0, 0.5, 0.5], "sigma_v": 0.1,
               "deadline_s": 0.4},
    "clock": {"offset_ms": 0.0, "drift_ppm": 0.0},
}  # fmt: skip
BOTH = pytest.mark.parametrize("kind", ["location-central", "elected"])


def plan_of(scenario: dict[str, Any] = SMALL, **changes: Any) -> Plan:
    return planned(Scenario.load(scenario, {key.replace("__", "."): value for key, value in changes.items()}))


def expected(scenario: dict[str, Any] = SMALL, **changes: Any) -> Polled:
    return polled_of(plan_of(scenario, **changes))


def polled_of(plan: Plan) -> Polled:
    assert isinstance(plan.schedule, Polls)
    return Polled.of(plan, plan.schedule)


def nearest(field: Polled, step: int) -> list[str]:
    """The sensors, the one nearest to the target at a step first."""
    (path,) = field.plan.paths.values()
    state = path.at((field.plan.origin_ns + step * field.plan.step_ns) / NS)
    assert state is not None
    places = {place.id: hypot(place.x - state[0], place.y - state[1]) for place in field.plan.info.tagged("senses")}
    return sorted(places, key=lambda id: (places[id], id))


def away(field: Polled, id: str, step: int) -> float:
    (path,) = field.plan.paths.values()
    state = path.at((field.plan.origin_ns + step * field.plan.step_ns) / NS)
    assert state is not None
    place = next(place for place in field.plan.info.places if place.id == id)
    return hypot(place.x - state[0], place.y - state[1])


# --- what is wrong with a scenario ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        (["fusion.deadline_s=0.001"], "fusion.deadline_s: is 0.001 s, and of a step of 1 s are taken: reports 0.0"),
        (["fusion.deadline_s=0.99"], "fusion.deadline_s: is 0.99 s, and of a step of 1 s are taken: reports 0.0"),
        (["target.step_s=0.04", "fusion.deadline_s=0.03"], "target.step_s: is 0.04 s, and with N sensors that measure"),
        (["run.setup_s=1"], "run.setup_s: is 1 s, and it takes "),
        (["architecture.sensors=0"], "architecture.sensors: is 0; expected a whole number from 1 to 50"),
        (["architecture.base=n000"], "architecture.base: is 'n000', which is also a sensor's id"),
    ],
)
@BOTH
def test_one_message_says_what_is_wrong(
    trackfield: Call, tmp_path: Path, kind: str, settings: list[str], says: str
) -> None:
    says = says.replace("with N", "with 3" if kind == "elected" else "with 4")
    said = _validated(trackfield, tmp_path, {**SMALL, "architecture": {"kind": kind}}, *settings)
    assert said.code == 2
    assert says in said.err
    assert len(said.err.splitlines()) == 1


@BOTH
def test_sensors_whose_threshold_nobody_sets_are_refused(trackfield: Call, kind: str) -> None:
    said = trackfield("validate", "bus", *_set(f"architecture.kind={kind}", "sensor.threshold='adaptive'"))
    assert said.code == 2
    assert f"sensor.threshold: is adaptive, and with architecture {kind} no centre sets it" in said.err
    assert len(said.err.splitlines()) == 1


@BOTH
def test_sensors_that_report_when_others_did_are_refused(trackfield: Call, kind: str) -> None:
    said = trackfield("validate", "hall", *_set(f"architecture.kind={kind}", "sensor.play='times'"))
    assert said.code == 2
    assert f"sensor.play: is 'times', and with architecture {kind} sensors measure when they are polled" in said.err
    assert len(said.err.splitlines()) == 1


def test_lora_in_steps_too_short_says_what_they_would_take(trackfield: Call, tmp_path: Path) -> None:
    link = {"model": "lognormal_prr", "radio": "lora868", "sf": 9}
    said = _validated(trackfield, tmp_path, {**SMALL, "link": link})
    assert said.code == 2
    assert "target.step_s: is 1 s, and with 4 sensors that measure it takes " in said.err
    assert "a faster radio, or fewer sensors" in said.err
    assert len(said.err.splitlines()) == 1


def _validated(trackfield: Call, folder: Path, scenario: dict[str, Any], *settings: str) -> Any:
    file = folder / "field.toml"
    file.write_text(Scenario.load(scenario).to_toml())
    return trackfield("validate", file, *_set(*settings))


def _set(*settings: str) -> list[str]:
    return [word for one in settings for word in ("--set", one)]


@BOTH
@pytest.mark.parametrize(
    "name",
    [
        "bus",
        "hall",
        *(pytest.param(one, marks=pytest.mark.long) for one in ("radar", "zhai-spcpf", "yu-mrbpf", "zhou-upf")),
    ],
)
def test_packaged_fields_are_foreseen(trackfield: Call, name: str, kind: str) -> None:
    said = trackfield("validate", name, *_set(f"architecture.kind={kind}"))
    assert said.code == 0, said.err
    assert "heads: from step " in said.err
    assert "budget: reports 0." in said.err
    assert "base hears " in said.err


# --- who leads and who is polled --------------------------------------------------------------------------------------


def test_the_nearest_sensors_are_polled_and_one_of_them_leads() -> None:
    field = expected()
    assert sorted(field.turns) == list(range(min(field.turns), 41))
    for step, turn in field.turns.items():
        assert set(turn.polled) == set(nearest(field, step)[:4])
        assert turn.leader == turn.polled[0]
        assert turn.polled[1:] == tuple(id for id in nearest(field, step)[:4] if id != turn.leader)


def test_a_head_is_sticky_or_the_nearest() -> None:
    sticky, nearer = expected(), expected(architecture__sticky=False)
    changes = [sum(bool(turn.heir) for turn in field.turns.values()) for field in (sticky, nearer)]
    assert 2 <= changes[0] < changes[1]
    for field in (sticky, nearer):
        for step, turn in field.turns.items():
            if (after := field.turns.get(step + 1)) is not None:
                assert after.leader == (turn.heir or turn.leader)
    for step, turn in nearer.turns.items():
        if step > min(nearer.turns) and not turn.heir and step + 1 in nearer.turns:
            assert turn.leader == nearest(nearer, step + 1)[0]


def test_an_elected_head_leads_while_it_is_near() -> None:
    field = expected(architecture__kind="elected")
    assert all(len(turn.polled) == 3 for turn in field.turns.values())
    handed = [step for step, turn in field.turns.items() if turn.heir]
    assert len(handed) >= 3
    for step, turn in field.turns.items():
        if step < 40:
            assert bool(turn.heir) == (away(field, turn.leader, step + 1) > 35.0)  # half a range


def test_the_loudest_is_elected_first_and_again_after_a_gap() -> None:
    """No sensor has the target within 70 m for some seconds: the track is lost, and an election follows."""
    target = {**SMALL["target"], "waypoints": [[0, 10, 60], [5, 10, 60], [15, 10, -400], [25, 10, 60], [40, 20, 60]]}
    field = expected({**SMALL, "target": target})
    elected = [turn for turn in field.turns.values() if turn.contenders]
    assert len(elected) == 2
    assert sum(turn.lost for turn in field.turns.values()) == 1
    for turn in elected:
        begun = (turn.elected_ns - field.plan.origin_ns) // field.plan.step_ns
        assert begun < turn.step
        assert turn.leader == nearest(field, begun)[0]
        assert all(away(field, id, begun) <= 70.0 for id in turn.contenders)
    lost = next(step for step, turn in field.turns.items() if turn.lost)
    assert not any(field.turns[step].sensed for step in range(lost - 2, lost + 1))
    assert field.turns[lost - 3].sensed
    assert lost + 1 not in field.turns


def test_polls_in_a_row_are_counted_up_to_those_that_matter() -> None:
    field, before = expected(), dict[str, int]()
    for turn in field.turns.values():
        assert turn.polls == {id: min(before.get(id, 0) + 1, MOST_POLLS) for id in turn.polled}
        before = dict(turn.polls)


def test_heads_poll_those_that_they_hear() -> None:
    field = expected(link__range_m=60.0)
    at = {place.id: (place.x, place.y) for place in field.plan.info.places}
    for turn in field.turns.values():
        (x, y) = at[turn.leader]
        assert all(hypot(at[id][0] - x, at[id][1] - y) <= 60.0 for id in turn.polled)
    plan = field.plan
    assert any(turn.beyond for turn in field.turns.values())
    (said,) = (text for text in warnings(plan, foresee(plan_of(link__range_m=60.0))) if "best sensors" in text)
    assert said.startswith("the best sensors are out of the head's reach in ")
    assert "sensors within 140 m; use more power" in said


# --- what is foreseen -------------------------------------------------------------------------------------------------


@BOTH
def test_a_field_without_losses_is_covered(kind: str) -> None:
    plan = plan_of(architecture__kind=kind)
    seen = foresee(plan)
    field, (one,) = seen.scheduled, seen.coverage
    assert isinstance(field, Polled)
    first = min(field.turns)
    assert np.all(one.fixed[first - 1 :] == 1.0)
    assert not one.fixed[: first - 1].any()
    assert np.all(one.in_reach[first - 1 :] == (3 if kind == "elected" else 4))
    assert not [text for text in warnings(plan, seen) if "answer each other" not in text]
    assert seen.arriving == 1.0
    text = "\n".join(summary(plan, seen))
    assert "base: base hears 100.0% of what heads tell it directly" in text
    assert "at most, of a step of 1 s, which needs 0." in text


def test_what_a_head_measures_needs_no_radio() -> None:
    """With links that lose nearly all a head still has its own reading, and that is not a report."""
    plan = plan_of(link__loss=0.5)
    seen = foresee(plan)
    field = seen.scheduled
    assert isinstance(field, Polled)
    assert sum(seen.reports.values()) == sum(len(set(turn.polled) - {turn.leader}) for turn in field.turns.values())
    turn = field.turns[min(field.turns) + 5]
    chances = dict(zip(turn.polled, field.chances((turn.t_ns, id) for id in turn.polled), strict=True))
    assert chances[turn.leader] == 1.0
    for id, times in turn.polls.items():
        if id != turn.leader:
            assert chances[id] == pytest.approx((1 - 0.5**times) * 0.5)
    assert seen.arriving == pytest.approx(0.42, abs=0.03)


def test_a_base_out_of_reach_is_named() -> None:
    plan = plan_of(link__range_m=120.0, fusion__x_m=-100.0, fusion__y_m=60.0)
    said = [text for text in warnings(plan, foresee(plan)) if "the path leaves the reach of base" in text]
    field = polled_of(plan)
    poor = sum(share < 0.5 for share in field.told.values())
    assert 5 < poor < len(field.turns)
    assert len(said) == 1
    assert f"in {poor} of {len(field.turns)} steps with a head less than 50% of what the head says arrives" in said[0]
    assert "a tree (architecture.multihop)" in said[0]


def test_a_head_follows_one_of_several_targets() -> None:
    second = {**SMALL["target"], "id": "second", "waypoints": [[0, 190, 20], [40, 10, 20]]}
    plan = plan_of({**SMALL, "targets": [second]})
    assert any(text.startswith("there are 2 targets, and a head follows one") for text in warnings(plan, foresee(plan)))


def test_fewer_sensors_than_a_fix_needs_are_named() -> None:
    """From a prior on those count that measure; without one a fix takes three ranges."""
    few = plan_of(architecture__sensors=2)
    assert foresee(few).needs == 2
    blind = plan_of(architecture__sensors=2, fusion__prior="none")
    seen = foresee(blind)
    assert seen.needs == 3
    assert any("too few sensors along the path" in text for text in warnings(blind, seen))


def test_of_a_long_run_some_steps_stand_for_all(monkeypatch: pytest.MonkeyPatch) -> None:
    plan = plan_of()
    whole = foresee(plan)
    monkeypatch.setattr("launcher.plan.forecast.heads.polled.MOST_STEPS", 14)
    some = foresee(plan)
    assert some.every == 3
    assert isinstance(some.scheduled, Polled)
    assert 12 <= len(some.scheduled.turns) <= 14
    assert sum(some.reports.values()) == pytest.approx(sum(whole.reports.values()), rel=0.1)
    assert len(some.coverage[0].in_reach) == 14


# --- what is sent, and what a run sends -------------------------------------------------------------------------------

EXACT = {"announce"}
NEARLY = {"poll": 0.06, "result": 0.06, "estimate": 0.06, "range": 0.1}
"""An election is over a step sooner or later; where an estimate is another one than the truth, others are polled."""


@BOTH
@pytest.mark.parametrize("seed", [1, 2])
def test_without_losses_a_run_sends_what_was_predicted(kind: str, seed: int) -> None:
    plan = plan_of(architecture__kind=kind, seed=seed)
    load = Load.of(polled_of(plan))
    predicted = Counter(frame.kind for frame in (*load.setup, *load.steps))
    assert load.every == 1.0
    ledger, _ = simulated(plan)
    assert isinstance(ledger, Ledger)
    sent = Counter(kind for _, kind, _, _ in {(row.src, row.kind, row.sent_ns, row.copy) for row in ledger.rows})
    for one in EXACT:
        assert sent[one] == predicted[one], one
    for one, share in NEARLY.items():
        assert sent[one] == pytest.approx(predicted[one], rel=share, abs=2), one
    assert sent["hand-over"] == pytest.approx(predicted["hand-over"], abs=3)
    assert sent["hand-over-ack"] == sent["hand-over"]
    assert predicted["claim"] == 1
    assert predicted["range"] == sum(foresee(plan).reports.values())


@BOTH
def test_a_channel_is_as_full_as_predicted(kind: str) -> None:
    plan = plan_of({**SMALL, "link": RADIO}, architecture__kind=kind)
    crowd = foresee(plan).crowd
    assert crowd is not None
    ledger, _ = simulated(plan)
    assert isinstance(ledger, Ledger)
    assert crowd.use_mean == pytest.approx(channel_metrics(air_of_run(ledger))["use_mean"], rel=0.1)


@pytest.mark.long
@BOTH
def test_a_channel_with_clocks_and_a_tree_is_as_full_as_predicted(kind: str) -> None:
    scenario = {**SMALL, "link": {**RADIO, "radio": "802154-0dbm"}, "clock": {"offset_ms": 20.0, "drift_ppm": 20.0}}
    plan = plan_of(scenario, architecture__kind=kind, architecture__multihop=True)
    crowd = foresee(plan).crowd
    assert crowd is not None
    ledger, _ = simulated(plan)
    assert isinstance(ledger, Ledger)
    assert crowd.use_mean == pytest.approx(channel_metrics(air_of_run(ledger))["use_mean"], rel=0.15)


@BOTH
def test_duty_cycles_are_of_all_that_a_radio_sends(kind: str) -> None:
    """A node may send for 36 s in an hour by LoRa with 14 dBm; the run is shorter than that."""
    target = {**SMALL["target"], "step_s": 10.0, "waypoints": [[0, 10, 60], [400, 190, 130]]}
    link = {"model": "lognormal_prr", "radio": "lora868", "sf": 7}
    plan = plan_of({**SMALL, "link": link, "target": target}, architecture__kind=kind, fusion__deadline_s=3.0)
    seen = foresee(plan)
    assert isinstance(seen.scheduled, Polled)
    load, link_ = Load.of(seen.scheduled), seen.scheduled.link
    (duty,) = (one for one in seen.duties if one.what == "its messages as peer")
    assert duty.allowed_s == 36.0
    sent = [link_.fate(frame).air_ns for frame in (*load.setup, *load.steps) if frame.src == duty.id]
    assert duty.seconds == pytest.approx(sum(sent) / NS)
    assert duty.id in {turn.leader for turn in seen.scheduled.turns.values()}
