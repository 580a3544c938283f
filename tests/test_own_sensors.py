"""Sensors that users bring: at a node, in a scenario, over the wire, in the fusion centre, and where tracks begin."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import dist, inf
from typing import Any

import numpy as np
import pytest

import trackfield as tf
from fusion.role import Fusion
from launcher.plan.forecast.reception import receptions
from launcher.plan.prepare import planned
from launcher.records import Plan
from launcher.study.replay import replay
from node.role import Node
from tests.sensing import model_of, reports_of
from tests.simulated import simulated
from trackfield.filters.metrics import LOST_M
from trackfield.filters.search import searched
from trackfield.filters.types import Reports
from trackfield.plugins import give
from trackfield.role import NS, Ignored, Received, Sampled, Send, Started, Timer
from trackfield.scenario import Scenario
from trackfield.sensing.complete import Kind
from trackfield.sensing.kinds import SENSORS, make_sensor, register_sensor
from trackfield.sensing.readings import Measured
from trackfield.tracking.following import ANYWHERE
from trackfield.wire import Doa, Measurement
from trackfield.world.faulty import Faulty, SensorFault
from trackfield.world.path import Path
from trackfield.world.placed import Placed
from trackfield.world.scene import Scene


@dataclass(frozen=True)
class Ranger:
    """How far away the target is, and how far east: two numbers of different noise and resolution."""

    range_m: float = 100.0
    blind_m: float = 0.0

    sd = (0.5, 2.0)
    resolution = (0.01, 0.1)

    def simulate(self, target: Any, position: Any, normals: Any) -> tuple[float, float] | None:
        away = dist(target[:2], position)
        if away < self.blind_m:
            return None
        return away + 0.5 * normals[0], target[0] - position[0] + 2.0 * normals[1]

    def h(self, states: Any, positions: Any) -> Any:
        apart = states[..., None, :2] - positions
        return np.stack((np.linalg.norm(apart, axis=-1), apart[..., 0]), axis=-1)

    def jacobian(self, states: Any, positions: Any) -> Any:
        apart = states[..., None, :2] - positions
        slopes = np.zeros((*apart.shape[:-1], 2, 4))
        slopes[..., 0, :2] = apart / np.maximum(np.linalg.norm(apart, axis=-1, keepdims=True), 1e-6)
        slopes[..., 1, 0] = 1.0
        return slopes


@dataclass(frozen=True)
class Distance(Ranger):
    """The first of the two alone."""

    sd = (0.5,)  # type: ignore[assignment]
    resolution = (0.01,)  # type: ignore[assignment]

    def simulate(self, target: Any, position: Any, normals: Any) -> Any:
        return (dist(target[:2], position) + 0.5 * normals[0],)

    def h(self, states: Any, positions: Any) -> Any:
        return super().h(states, positions)[..., :1]

    def jacobian(self, states: Any, positions: Any) -> Any:
        return super().jacobian(states, positions)[..., :1, :]


@pytest.fixture(autouse=True)
def ranger() -> Iterator[None]:
    register_sensor("ranger", Ranger)
    register_sensor("distance", Distance)
    yield
    SENSORS.registered.clear()


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
    give({"sensor:ranger": f"{__name__}:Ranger"}, installed=False)
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


# --- in a scenario ---

SHORT = {"sensor.kind": "ranger", "target.steps": 15, "fusion.trackers": ["ekf", "ukf", "bootstrap", "predict-only"]}


def plan_with(**settings: Any) -> Plan:
    keys = {key.replace("__", "."): value for key, value in settings.items()}
    return planned(Scenario.load("spcpf", SHORT | keys))


def test_a_run_with_a_sensor_of_ones_own() -> None:
    """Within its range of 100 m a dozen sensors measure the target, to half a metre: so well is it known."""
    plan = plan_with()
    ledger, rows = simulated(plan)
    sent = [row for row in ledger.rows if row.kind == "measurement"]
    assert {row.kind for row in ledger.rows} == {"measurement"}
    assert sent[0].text.startswith("ranger ")
    assert {row.step for row in sent} == set(range(1, 16))
    last = {row.point.tracker: dist(row.point.mean[:2], row.truth[:2]) for row in rows if row.point.step == 15}
    assert max(last[name] for name in ("ekf", "ukf")) < 1.5
    assert max(last["ekf"], last["ukf"]) < last["predict-only"]
    assert receptions(plan).keys() == {"measurement"}
    assert plan.reach_m == 100.0


def test_without_a_prior_the_track_starts_from_the_first_readings() -> None:
    _, rows = simulated(plan_with(fusion__prior="none"))
    errors = [dist(row.point.mean[:2], row.truth[:2]) for row in rows if row.point.tracker == "ekf" and row.truth]
    assert len(errors) == 15
    assert max(errors) < 3.0


def test_faults_befall_its_nodes() -> None:
    """Near the start of s1: what is deaf or dead says nothing, what babbles speaks in every step."""
    faults = [
        {"kind": "deaf", "nodes": ["n012"], "at_s": 4.5},
        {"kind": "kill", "nodes": ["n013"], "at_s": 4.5},
        {"kind": "babble", "nodes": ["n120"], "at_s": 0.0},
        {"kind": "stuck", "nodes": ["n001"], "at_s": 4.5},
        {"kind": "clock_jump", "nodes": ["n024"], "at_s": 4.5, "jump_ms": 30.0},
    ]
    ledger, _ = simulated(plan_with(faults=faults, link__model="ideal"))
    said: dict[str, dict[int | None, str]] = {}
    for row in ledger.rows:
        said.setdefault(row.src, {})[row.step] = row.text
    assert set(said["n012"]) == set(said["n013"]) == {1, 2, 3, 4}
    assert set(said["n120"]) == set(range(1, 16))
    assert len(set(said["n120"].values())) == 15
    assert len({said["n001"][step] for step in range(5, 16)}) == 1
    assert {row.outcome for row in ledger.rows} <= {"delivered", "late", "in_flight", "dead"}


def test_its_options_stand_in_its_section_and_in_the_resolved_file(tmp_path: Any) -> None:
    scenario = Scenario.load("spcpf", SHORT).set("sensor.range_m", 80)
    assert planned(scenario).reach_m == 80
    (tmp_path / "again.toml").write_text(scenario.to_toml())
    assert Scenario.load(tmp_path / "again.toml") == scenario
    assert scenario.set("sensor.threshold", 0.7).sensor.kind == "ranger"  # it may have a field of any name
    assert scenario.set("sensor.kind", "distance").sensor.options == {}
    assert scenario.set("sensor.kind", "doa").sensor == Scenario.load("spcpf").sensor


def test_an_option_called_file_is_no_file_of_the_run(tmp_path: Any) -> None:
    @dataclass(frozen=True)
    class Calibrated(Ranger):
        file: str = "calib.csv"

    register_sensor("calibrated", Calibrated)
    settings = {**SHORT, "sensor.kind": "calibrated", "sensor.file": "mine.csv"}
    tf.run(Scenario.load("spcpf", settings), out=tmp_path / "run")
    assert replay(tmp_path / "run", out=tmp_path / "again").metrics["driver"] == "replay"


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        ({"sensor__kind": "rangr"}, "sensor.kind: unknown sensor 'rangr'; expected 'ranger'"),
        (
            {"sensor__rang_m": 3.0},
            "sensor.rang_m: unknown option; did you mean range_m?; expected one of range_m",
        ),
        ({"sensor__range_m": "far"}, "sensor.range_m: is 'far'; expected a number"),
        ({"sensor__range_m": -1.0}, "sensor.range_m: 'ranger' has -1.0; expected metres, above 0"),
        ({"sensor__range_m": [1.0]}, "sensor.range_m: is [1.0]; expected a number, a text, or true or false"),
        ({"sensor__range_m": 0.5}, "sensor.range_m: the target never comes in range"),
        (
            {"fusion__trackers": ["ekf", "spcpf"]},
            "fusion.trackers: 'spcpf' takes bearings only, and the sensors are of kind ranger; "
            "expected bootstrap, ekf, predict-only, ukf, or one of your own",
        ),
        (
            {"faults": [{"kind": "bias", "share": 0.1, "at_s": 3.0, "bias_deg": 5.0}]},
            "faults[0].bias_deg: has no meaning for sensors of kind 'ranger'; expected by, a list of 2 numbers",
        ),
    ],
)
def test_bad_input(settings: dict[str, Any], says: str) -> None:
    with pytest.raises(tf.ScenarioError) as caught:
        plan_with(**settings)
    assert str(caught.value).startswith(says)


@pytest.mark.parametrize(
    ("members", "says"),
    [
        (
            {"h": lambda self, x, s: np.zeros((3, 1))},
            "sensor 'bad': h: returned an array (3, 1) for arrays (2, 4) and (3, 2)",
        ),
        ({"jacobian": lambda self, x, s: self.h(x, s)}, "sensor 'bad': jacobian: returned an array (2, 3, 2)"),
        (
            {"simulate": lambda self, target, position, normals: (1.0,)},
            "sensor 'bad': simulate: returned (1.0,); expected 2 numbers, or None",
        ),
        ({"h": lambda self, x, s: x["east"]}, "sensor 'bad': h: IndexError: "),
        ({"sd": (1.0, 1.0, 1.0)}, "sensor.sd: 'bad' has 3 sd and 2 resolutions; expected one of each"),
        ({"sd": 1.0}, "sensor.sd: 'bad' has 1.0; expected a tuple of numbers above 0"),
        ({"resolution": (0.0, 1.0)}, "sensor.resolution: 'bad' has (0.0, 1.0); expected a tuple of numbers above 0"),
        ({"range_m": None}, "sensor.range_m: 'bad' has None; expected metres, above 0"),
    ],
)
def test_a_class_that_is_wrong_is_found_when_the_run_is_planned(members: dict[str, Any], says: str) -> None:
    register_sensor("bad", type("Bad", (Ranger,), {"__init__": lambda self: None, **members}))
    with pytest.raises(tf.ScenarioError) as caught:
        plan_with(sensor__kind="bad")
    assert str(caught.value).startswith(says)


def test_what_cannot_be_registered() -> None:
    with pytest.raises(tf.ScenarioError, match="'doa' is a sensor of Trackfield's own"):
        tf.register_sensor("doa", Ranger)
    with pytest.raises(tf.ScenarioError, match="sensor 'mine' has no simulate, h, jacobian"):
        tf.register_sensor("mine", dict)


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


# --- where tracks begin ---


def ranges(target: tuple[float, float], positions: list[tuple[float, float]], sensor: Any) -> Reports:
    """What sensors at these positions read of a target, without noise."""
    at = np.array(positions).reshape(-1, 2)
    return reports_of(at, sensor.h(np.array([*target, 0.0, 0.0]), at))


SQUARE = [(0.0, 0.0), (50.0, 0.0), (0.0, 50.0), (50.0, 50.0)]


def test_the_fix_is_where_the_readings_say() -> None:
    model = model_of(Distance())
    for target in ((20.0, 30.0), (70.0, -40.0), (25.0, 25.0), (50.0, 49.0)):
        fix = searched(ANYWHERE, model, ranges(target, SQUARE, Distance()), LOST_M)
        assert fix is not None
        assert fix.mean[:2] == pytest.approx(target, abs=0.01)
        H = Distance().jacobian(fix.mean, np.array(SQUARE))[:, 0] / 0.5
        assert fix.covariance == pytest.approx(np.linalg.inv(np.linalg.inv(ANYWHERE) + H.T @ H), rel=1e-6)


def test_readings_that_fit_several_places_are_no_fix() -> None:
    model = model_of(Distance())
    assert searched(ANYWHERE, model, ranges((20.0, 30.0), [], Distance()), LOST_M) is None
    assert searched(ANYWHERE, model, ranges((20.0, 30.0), SQUARE[:1], Distance()), LOST_M) is None  # a circle
    assert searched(ANYWHERE, model, ranges((20.0, 30.0), SQUARE[:2], Distance()), LOST_M) is None  # mirrored at y = 0
    assert searched(ANYWHERE, model, ranges((20.0, 0.0), SQUARE[:2], Distance()), LOST_M) is None  # y is open
    assert searched(ANYWHERE, model, ranges((20.0, 30.0), SQUARE[:3], Distance()), LOST_M) is not None
    assert searched(ANYWHERE, model_of(Ranger()), ranges((9.0, 30.0), SQUARE[:1], Ranger()), LOST_M) is None


def test_a_node_reports_all_that_it_measured() -> None:
    node = Node(step_ns=NS, centre="fusion")
    state, _ = node.handle(node.begin(), Started(0))
    state, _ = node.handle(state, Sampled(0, "wake-up", NS))
    state, _ = node.handle(state, Timer(NS, "step"))
    state, effects = node.handle(state, Sampled(NS, "sound", Measured((12, -7), (0.12, -0.7))))
    assert Send(Measurement(1, (12, -7)), "fusion") in effects
    assert state.phase.value == "reporting"
