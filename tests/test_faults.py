"""Planned faults: whom they befall, what lives they leave, and which of them contradict each other."""

from __future__ import annotations

import re
from typing import Any

import pytest

from launcher.plan.faults import Faults, Life, resolve
from launcher.plan.prepare import load, planned
from launcher.records import SENSES, Place
from trackfield.errors import ScenarioError
from trackfield.scenario import Scenario
from trackfield.world.path import Path

S = 1_000_000_000
END = 61 * S
SENSORS = [f"n{i:03}" for i in range(121)]
PLACES = [Place("fusion", "fusion", 0.0, 0.0), *(Place(id, "node", 0.0, 0.0, frozenset({SENSES})) for id in SENSORS)]
Written = dict[str, Any]


def faults(*written: Written, seed: int = 1) -> Faults:
    scenario = Scenario.load({"name": "mine", "target": {"path": "s1"}, "faults": list(written)})
    arrays = dict.fromkeys((place.id for place in PLACES if SENSES in place.tags), scenario.sensor.sensing)
    return resolve(scenario.faults, seed, PLACES, END, kinds=arrays)


def fault(
    kind: str, at_s: float = 20, until_s: float | None = None, nodes: tuple[str, ...] = ("n060",), **more: Any
) -> Written:
    until = {} if until_s is None else {"until_s": until_s}
    return {"kind": kind, "at_s": at_s, "nodes": list(nodes), **until, **more}


def failure(*written: Written) -> str:
    with pytest.raises(ScenarioError) as caught:
        faults(*written)
    return str(caught.value)


# --- lives ------------------------------------------------------------------------------------------------------------


def test_without_faults_everybody_lives_once_to_the_end() -> None:
    assert faults().of("n000").lives == (Life(0, None, ()),)
    assert faults() == Faults()


def test_a_kill_ends_the_only_life() -> None:
    plan = faults(fault("kill", 20, nodes=("n060", "fusion")))
    assert plan.of("n060").lives == plan.of("fusion").lives == (Life(0, 20 * S),)
    assert plan.of("n061").lives == (Life(),)


def test_restarts_make_lives_and_a_kill_the_last_of_them() -> None:
    plan = faults(fault("kill", 50), fault("restart", 10, 12.5), fault("restart", 30, 31))
    assert plan.of("n060").lives == (Life(0, 10 * S), Life(12 * S + S // 2, 30 * S), Life(31 * S, 50 * S))


def test_freezes_that_meet_are_one_and_those_of_others_are_not() -> None:
    plan = faults(
        fault("freeze", 20, 30), fault("freeze", 5, 8), fault("freeze", 25, 27), fault("freeze", 30, 35),
        fault("freeze", 8.001, 9), fault("freeze", 6, 7, nodes=("n061",)),
    )  # fmt: skip
    (life,) = plan.of("n060").lives
    assert life.freezes == ((5 * S, 8 * S), (8 * S + S // 1000, 9 * S), (20 * S, 35 * S))
    assert plan.of("n061").lives[0].freezes == ((6 * S, 7 * S),)


def test_a_freeze_ends_with_its_life_or_with_the_run() -> None:
    plan = faults(fault("freeze", 15, 25), fault("restart", 20, 22), fault("freeze", 22, 23), fault("freeze", 60, 1e9))
    assert plan.of("n060").lives == (
        Life(0, 20 * S, ((15 * S, 20 * S),)),
        Life(22 * S, None, ((22 * S, 23 * S), (60 * S, END))),
    )


@pytest.mark.parametrize(
    ("written", "message"),
    [
        (
            [fault("kill", 20), fault("freeze", 25, 30)],
            "faults[1].at_s: freeze of n060 at 25 s, while faults[0] keeps it down for good; expected a time at",
        ),
        ([fault("freeze", 25, 30), fault("kill", 20)], "faults[0].at_s: freeze of n060 at 25 s, while faults[1]"),
        ([fault("kill"), fault("kill")], "faults[1].at_s: kill of n060 at 20 s, while faults[0] keeps it down f"),
        ([fault("kill"), fault("kill", 21)], "faults[1].at_s: kill of n060 at 21 s, while faults[0] keeps it down f"),
        ([fault("kill", 20), fault("restart", 30, 40)], "faults[1].at_s: restart of n060 at 30 s, while faults[0]"),
        (
            [fault("restart", 20, 30), fault("kill", 25)],
            "faults[1].at_s: kill of n060 at 25 s, while faults[0] keeps it down until 30 s; expected",
        ),
        ([fault("restart", 20, 30), fault("kill", 30)], "faults[1].at_s: kill of n060 at 30 s, while faults[0]"),
        ([fault("freeze", 20, 30), fault("kill", 20)], "faults[0].at_s: freeze of n060 at 20 s, while faults[1]"),
        ([fault("restart", 20, 30), fault("freeze", 29, 40)], "faults[1].at_s: freeze of n060 at 29 s, while faults["),
    ],
)  # fmt: skip
def test_nothing_can_begin_while_a_process_is_down(written: list[Written], message: str) -> None:
    assert failure(*written).startswith(message)


def test_the_others_are_not_down() -> None:
    assert faults(fault("kill", 20), fault("freeze", 25, 30, nodes=("n061",))).of("n061").lives[0].freezes


# --- times ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("written", "message"),
    [
        (fault("kill", 61), "faults[0].at_s: is 61, and the run ends at 61 s; expected a time before that"),
        (fault("stuck", 1e9), "faults[0].at_s: is 1e+09, and the run ends at 61 s"),
        (fault("partition", 70, 80), "faults[0].at_s: is 70, and the run ends at 61 s"),
        (fault("restart", 20, 61), "faults[0].until_s: is 61, and the run ends at 61 s; expected a time before that"),
    ],
)
def test_what_comes_after_the_end_is_a_mistake(written: Written, message: str) -> None:
    assert failure(written).startswith(message)


def test_what_begins_before_the_end_may_last_longer() -> None:
    plan = faults(fault("partition", 60.9, 1e9), fault("stuck", 60, 1e9))
    assert plan.partitions == ((60_900_000_000, END, ("n060",), None),)
    assert plan.of("n060").sensor == ({"kind": "stuck", "from_ns": 60 * S, "until_ns": None},)


# --- whom -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("written", "message"),
    [
        (fault("kill", nodes=("n60",)), "faults[0].nodes: there is no 'n60'; did you mean n060?; expected ids of this"),
        (fault("kill", nodes=("n001", "zzz")), "faults[0].nodes: there is no 'zzz'; expected ids of this field, like "),
        (fault("freeze", 1, 2, nodes=("fussion",)), "faults[0].nodes: there is no 'fussion'; did you mean fusion?"),
        (fault("stuck", nodes=("fusion",)), "faults[0].nodes: fusion has no sensor, and stuck is a fault of s"),
        (fault("deaf", nodes=("router",)), "faults[0].nodes: there is no 'router'; expected ids of this field"),
    ],
)  # fmt: skip
def test_who_is_not_there_cannot_fail(written: Written, message: str) -> None:
    assert failure(written).startswith(message)


def share(kind: str, share: float) -> Written:
    return {"kind": kind, "at_s": 20, "share": share}


@pytest.mark.parametrize(("part", "number"), [(0.1, 12), (0.5, 60), (1.0, 121), (1e-6, 1)])
def test_a_share_is_a_share_of_the_sensors(part: float, number: int) -> None:
    plan = faults(share("kill", part))
    assert len(plan.fates) == number
    assert plan.fates.keys() <= set(SENSORS)


def test_shares_are_drawn_by_seed_and_number_of_the_fault() -> None:
    first, second = share("kill", 0.3), share("deaf", 0.3)

    def struck(plan: Faults) -> set[str]:
        return {id for id, fates in plan.fates.items() if fates.sensor}

    assert struck(faults(first, second)) == struck(faults(first, second))
    assert (
        len({frozenset(struck(one)) for one in (faults(first, second), faults(second), faults(first, second, seed=2))})
        == 3
    )
    counts = dict.fromkeys(SENSORS, 0)
    for seed in range(200):
        for id in faults(share("kill", 0.3), seed=seed).fates:
            counts[id] += 1
    assert sum(counts.values()) == 200 * 36
    assert 30 < min(counts.values()) <= max(counts.values()) < 92  # 60 +- 5 standard deviations


# --- clocks, sensors, links -------------------------------------------------------------------------------------------


def test_jumps_of_a_clock_are_in_order_and_go_on_through_its_lives() -> None:
    plan = faults(
        fault("clock_jump", 30, jump_ms=-1.5), fault("clock_jump", 0, jump_ms=1000), fault("clock_jump", 30, jump_ms=2),
        fault("restart", 25, 35), fault("clock_jump", 40, jump_ms=1), fault("clock_jump", 40, jump_ms=-1),
    )  # fmt: skip
    assert plan.of("n060").jumps == ((0, S), (30 * S, 500_000))
    assert len(plan.of("n060").lives) == 2


def test_faults_of_a_sensor_are_as_the_world_has_them() -> None:
    plan = faults(
        fault("bias", 5, bias_deg=20), fault("deaf", 20, 30), fault("babble", 30), fault("bias", 2, 3, bias_db=-2)
    )
    assert plan.of("n060").sensor == (
        {"kind": "bias", "from_ns": 2 * S, "until_ns": 3 * S, "bias": (0.0, -2.0)},
        {"kind": "bias", "from_ns": 5 * S, "until_ns": None, "bias": (20.0, 0.0)},
        {"kind": "deaf", "from_ns": 20 * S, "until_ns": 30 * S},
        {"kind": "babble", "from_ns": 30 * S, "until_ns": None},
    )


@pytest.mark.parametrize(
    ("written", "message"),
    [
        (
            [fault("stuck", 10), fault("deaf", 20)],
            "faults[1].at_s: deaf of n060 at 20 s, during faults[0] (stuck to the end); expected one such fault",
        ),
        (
            [fault("babble", 20, 30), fault("babble", 10, 20.5)],
            "faults[0].at_s: babble of n060 at 20 s, during faults[1] (babble until 20.5 s)",
        ),
        ([fault("stuck", 10, 20), {"kind": "deaf", "at_s": 15, "share": 1.0}], "faults[1].at_s: deaf of n060 at 15 s"),
    ],
)
def test_a_sensor_fails_in_one_way_at_a_time(written: list[Written], message: str) -> None:
    assert failure(*written).startswith(message)


def test_partitions_cut_their_ids_off() -> None:
    plan = faults(fault("partition", 1, 2, nodes=("n001", "fusion")), fault("partition", 1.5, 3, nodes=("n002",)))
    assert plan.partitions == ((S, 2 * S, ("n001", "fusion"), None), (S + S // 2, 3 * S, ("n002",), None))
    assert not plan.fates


# --- the timeline -----------------------------------------------------------------------------------------------------


def test_marks_tell_what_begins_and_ends_in_order() -> None:
    plan = faults(
        fault("restart", 20, 30), fault("freeze", 1, 99), fault("partition", 2, 3.5, nodes=("n001", "n002")),
        fault("bias", 4, bias_deg=20), fault("clock_jump", 5, jump_ms=-10), fault("stuck", 6, 7), fault("kill", 50),
    )  # fmt: skip
    assert plan.marks == (
        (1, "n060", "freeze"),
        (2, "n001", "partition until 3.5 s"),
        (2, "n002", "partition until 3.5 s"),
        (3.5, "n001", "partition ends"),
        (3.5, "n002", "partition ends"),
        (4, "n060", "bias: +20 degrees, +0 dB"),
        (5, "n060", "clock jump by -10 ms"),
        (6, "n060", "stuck until 7 s"),
        (7, "n060", "stuck ends"),
        (20, "n060", "restart until 30 s"),
        (30, "n060", "up again"),
        (50, "n060", "kill"),
    )
    assert plan.spells == (  # what has no end within the run lasts until its end; a jump does not last
        (1, 61, "n060", "freeze"),
        (2, 3.5, "n001", "partition until 3.5 s"),
        (2, 3.5, "n002", "partition until 3.5 s"),
        (4, 61, "n060", "bias: +20 degrees, +0 dB"),
        (6, 7, "n060", "stuck until 7 s"),
        (20, 30, "n060", "restart until 30 s"),
        (50, 61, "n060", "kill"),
    )


# --- who stands nearest, and parts of an architecture -----------------------------------------------------------------


ROW = [Place(f"n{i}", "node", 10.0 * i, 0.0, frozenset({SENSES})) for i in range(10)]
MASTERS = [Place(f"m{i}", "master", 30.0 * i, 5.0) for i in range(4)]
EAST = Path.of([(5.0, 0.0, 0.0, 1.0, 0.0), (105.0, 100.0, 0.0, 1.0, 0.0)])
"""From the first step on, 5 s after the start, at 1 m/s."""


def struck(**written: Any) -> tuple[str, ...]:
    scenario = Scenario.load({"name": "mine", "target": {"path": "s1"}, "faults": [{"kind": "kill", **written}]})
    parts = {"tracking": ("m0", "m1", "m2", "m3"), "base": ()}
    found = resolve(scenario.faults, 1, [*ROW, *MASTERS], 120 * S, 5 * S, parts=parts, paths=[EAST])
    assert all(fates.lives[0].kill_ns == round((5 + written["at_s"]) * S) for fates in found.fates.values())
    return tuple(found.fates)


def test_the_nearest_to_the_target_at_that_time_is_struck() -> None:
    assert struck(nearest=1, at_s=41) == ("n4",)
    assert struck(nearest=3, at_s=41) == ("n3", "n4", "n5")
    assert struck(role="master", nearest=1, at_s=41) == ("m1",)
    assert struck(part="tracking", nearest=1, at_s=80) == ("m3",)
    assert struck(part="tracking", at_s=80) == ("m0", "m1", "m2", "m3")
    assert len(struck(part="tracking", share=0.5, at_s=80)) == 2
    assert struck(nearest=99, at_s=1) == tuple(place.id for place in ROW)


def test_who_stands_nearest_is_not_known_without_a_target() -> None:
    with pytest.raises(ScenarioError, match=r"faults\[0\]\.at_s: no target is there 110 s after the first step"):
        struck(nearest=1, at_s=110)


def test_a_part_that_an_architecture_does_not_have_is_an_error() -> None:
    with pytest.raises(ScenarioError, match=r"faults\[0\]\.part: the architecture has no process of the part 'base'; "
                       "expected one of tracking"):  # fmt: skip
        struck(part="base", at_s=10)


@pytest.mark.parametrize(
    ("more", "what"),
    [
        ({"nearest": 1, "share": 0.1}, "nearest: is given together with share"),
        ({"part": "base", "role": "node"}, "part: is given together with role"),
        ({"nodes": ["n1"], "nearest": 1}, "nearest: is given together with nodes"),
        ({"nearest": 0}, "nearest: is 0"),
        ({"part": "head"}, 'part: is "head"'),
    ],
)
def test_ways_to_say_who_exclude_each_other(more: Written, what: str) -> None:
    with pytest.raises(ScenarioError, match=re.escape(what)):
        struck(at_s=1, **more)


def test_sensor_faults_of_a_part_without_sensors_are_errors() -> None:
    written = {"kind": "deaf", "part": "tracking", "at_s": 1}
    scenario = Scenario.load({"name": "mine", "target": {"path": "s1"}, "faults": [written]})
    with pytest.raises(ScenarioError, match="a tracking has no sensor"):
        resolve(scenario.faults, 1, [*ROW, *MASTERS], 120 * S, parts={"tracking": ("m0",)})


@pytest.mark.parametrize(("kind", "tracking", "base"), [("centralised", "fusion", "fusion"), ("clusters", "m", "base")])
def test_the_same_faults_strike_each_architecture(kind: str, tracking: str, base: str) -> None:
    faults = "faults=[{kind='kill',part='tracking',nearest=1,at_s=3},{kind='freeze',part='base',at_s=1,until_s=2}]"
    plan = planned(load("bus", settings=["target.steps=6", f"architecture.kind={kind}", faults]))
    (killed,) = (one for one in plan.processes if one.kill_ns is not None)
    assert killed.id.startswith(tracking)
    assert [one.id for one in plan.processes if one.freezes] == [base]
