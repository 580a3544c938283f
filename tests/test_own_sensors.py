"""Sensors that users bring: at a node, over the wire, and in the fusion centre."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from math import dist, inf
from typing import Any

import numpy as np
import pytest

import trackfield as tf
from fusion.role import Fusion
from node.role import Node
from tests.rangers import Distance, Ranger
from tests.sensing import registered
from trackfield.plugins import give
from trackfield.role import NS, Ignored, Received, Sampled, Send, Started, Timer
from trackfield.sensing.complete import Kind
from trackfield.sensing.kinds import SENSORS, make_sensor
from trackfield.sensing.readings import Measured
from trackfield.wire import Doa, Measurement
from trackfield.world.faulty import Faulty, SensorFault
from trackfield.world.path import Path
from trackfield.world.placed import Placed
from trackfield.world.scene import Scene


@pytest.fixture(autouse=True)
def ranger() -> Iterator[None]:
    with registered(ranger=Ranger, distance=Distance):
        yield


WALK = Path.of([(0.0, 0.0, 30.0, 5.0, 0.0), (100.0, 500.0, 30.0, 5.0, 0.0)])
"""Past a sensor at (100, 0): in its range of 100 m from 0.9 s to 39 s."""


def placed(incarnation: int = 0, seed: int = 1, **options: Any) -> Placed:
    sensor = make_sensor("ranger", options)
    return Placed("n1", (100.0, 0.0), Scene((WALK,)), ((0, 50 * NS),), sensor, options, -inf, seed, incarnation)


def faulty(*faults: SensorFault) -> Faulty:
    return Faulty(placed(), faults)


# --- at a node ---


def test_readings_are_whole_numbers_of_steps_with_the_sensors_noise() -> None:
    readings = [placed().sample(round(t * NS)) for t in np.linspace(2.0, 38.0, 2000)]
    truth = [WALK.at(t) for t in np.linspace(2.0, 38.0, 2000)]
    assert all(isinstance(value, int) for reading in readings for value in reading.steps)
    values = np.array([reading.steps for reading in readings]) * (0.01, 0.1)
    misses = values - [[dist(x[:2], (100.0, 0.0)), x[0] - 100.0] for x in truth]
    assert misses.std(axis=0) == pytest.approx([0.5, 2.0], rel=0.07)  # 1/sqrt(2 n) is 1.6 %
    assert abs(np.corrcoef(misses.T)[0, 1]) < 0.09  # 4 / sqrt(n)


def test_draws_are_keyed_by_seed_node_life_and_instant() -> None:
    assert (reading := placed().sample(10 * NS)) == placed().sample(10 * NS)
    assert reading not in [placed(1).sample(10 * NS), placed(seed=2).sample(10 * NS), placed().sample(10 * NS + 1)]


def test_out_of_range_or_unmeasured_is_nothing() -> None:
    assert [t for t in range(50) if placed().sample(t * NS)] == list(range(1, 40))
    blind = placed(blind_m=50.0)
    assert [t for t in range(50) if blind.sample(t * NS)] == [*range(1, 13), *range(28, 40)]
    assert (placed().next_window(7 * NS), placed().next_window(51 * NS)) == (0, None)


def test_of_several_targets_the_nearest_is_measured() -> None:
    rests = Path.of([(0.0, 100.0, 50.0, 0.0, 0.0), (200.0, 100.0, 50.0, 0.0, 0.0)])
    other, both = replace(placed(), scene=Scene((rests,))), replace(placed(), scene=Scene((rests, WALK)))
    assert both.sample(20 * NS) == placed().sample(20 * NS)  # 30 m away
    assert both.sample(5 * NS) == other.sample(5 * NS)
    assert both.sample(150 * NS) == other.sample(150 * NS)  # the other is gone
    assert Placed.from_plain(both.to_plain()).sample(20 * NS) == both.sample(20 * NS)


def test_its_plain_form_makes_the_same_sensor() -> None:
    form = placed(3, blind_m=5.0).to_plain()
    here = placed(3, blind_m=5.0)
    SENSORS.registered.clear()  # as in another process, which its parent told where that is
    give({"sensor:ranger": f"{Ranger.__module__}:Ranger"}, installed=False)
    try:
        again = Placed.from_plain(form)
    finally:
        give({}, installed=True)
    assert [again.sample(t * NS) for t in range(50)] == [here.sample(t * NS) for t in range(50)]


def test_faults() -> None:
    healthy = [placed().sample(t * NS) for t in range(60)]
    stuck = faulty(SensorFault("stuck", 5 * NS, 8 * NS))
    assert [stuck.sample(t * NS) for t in range(4, 9)] == [healthy[4], *[healthy[5]] * 3, healthy[8]]
    deaf = faulty(SensorFault("deaf", 5 * NS))
    assert [deaf.sample(t * NS) for t in (4, 5, 20)] == [healthy[4], None, None]
    far = faulty(SensorFault("stuck", 55 * NS))
    assert far.sample(55 * NS) == far.sample(58 * NS) != healthy[20]
    babble = faulty(SensorFault("babble", 0))
    drawn = [babble.sample(round(t * NS)).steps for t in np.linspace(0.0, 50.0, 2000)]  # type: ignore[union-attr]
    away = np.array(drawn)[:, 0] * 0.01
    assert away.max() < 103.0
    assert np.mean(away < 50.0) == pytest.approx(0.25, abs=0.04)  # anywhere in the circle: a quarter in half of it
    assert babble.next_window(70 * NS) == 0


@pytest.mark.parametrize("values", [(1.0,), (1.0, float("nan")), (1e15, 0.0)])
def test_a_reading_that_is_none_is_told_with_node_and_time(values: tuple[float, ...]) -> None:
    class Broken(Ranger):
        def simulate(self, target: Any, position: Any, normals: Any) -> Any:
            return values

    broken = Placed("n1", (100.0, 0.0), Scene((WALK,)), (), Kind("broken", Broken()), {}, -inf, 1)
    with pytest.raises(tf.RunFailed, match=r"sensor of n1, at 3 s: simulate returned \(.*expected None, or 2 numbers"):
        broken.sample(3 * NS)


def test_nodes_carry_nothing_that_is_heavy() -> None:
    there = "print(*sorted({'inspect', 'numpy', 'pydantic', 'importlib.metadata'} & sys.modules.keys()))"
    base, node = "import dataclasses, sys, typing", "import sys, node.role, trackfield.drivers.spec"
    said, light = (
        subprocess.run([sys.executable, "-c", f"{imports}; {there}"], capture_output=True, text=True, check=True).stdout
        for imports in (node, base)
    )
    assert said == light


# --- in the fusion centre ---


def test_the_centre_takes_reports_of_its_sensors_kind_alone() -> None:
    sensing = {"ranger": {"kind": "ranger", "options": {}}}
    fusion = Fusion(
        trackers=["ekf"], sensors=[("a", 0.0, 0.0)], step_ns=NS, deadline_ns=NS // 2, seed=1, sensing=sensing
    )
    assert fusion.kinds == {"measurement", "sync-request"}
    state, _ = fusion.handle(fusion.begin(), Started(0))
    for report in (Doa(1, 10.0, 60.0), Measurement(1, (1,)), Measurement(1, (1, 2, 3))):
        assert fusion.handle(state, Received(NS + 1, report, "a")) == (state, (Ignored("unexpected"),))
    after, effects = fusion.handle(state, Received(NS + 1, Measurement(1, (500, -30)), "a"))
    assert (effects, after.progress.collected.ahead[1]["a"].values) == ((), (500, -30))
    reports = fusion.bank._reports(1, after.progress.collected.ahead[1])
    assert reports.values == pytest.approx(np.array([[5.0, -3.0]]))
    assert [one.kind for one in reports.readings] == ["ranger"]


def test_a_node_reports_all_that_it_measured() -> None:
    node = Node(step_ns=NS, centre="fusion")
    state, _ = node.handle(node.begin(), Started(0))
    state, _ = node.handle(state, Sampled(0, "wake-up", NS))
    state, _ = node.handle(state, Timer(NS, "step"))
    state, effects = node.handle(state, Sampled(NS, "sound", Measured((12, -7), (0.12, -0.7))))
    assert Send(Measurement(1, (12, -7)), "fusion") in effects
    assert state.phase.value == "reporting"
