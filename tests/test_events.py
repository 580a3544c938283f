"""Sensors that report by themselves: once for each pass of a target, at its closest, whatever the steps are."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from math import hypot
from pathlib import Path as FilePath
from typing import Any

import numpy as np
import pytest

import trackfield as tf
from launcher.plan.architectures import ARCHITECTURES
from launcher.plan.forecast.heard import Heard
from launcher.plan.prepare import planned, warned
from launcher.record.figures import bounds
from node.role import Node, Phase
from tests.running import METRICS, SPEEDS, kept_up
from tests.tripwire import Trip
from trackfield.filters.measurement import expected, jacobians, log_likelihood, sensing_information
from trackfield.filters.types import Model, Readings, Reports
from trackfield.role import NS, Received, Sample, Sampled, Send, SetTimer, Started, Timer
from trackfield.scenario import survey
from trackfield.sensing.complete import Kind
from trackfield.sensing.kinds import make_sensor, register_sensor
from trackfield.sensing.readings import Measured
from trackfield.wire.messages import Measurement, SyncReply
from trackfield.world.faulty import Faulty, SensorFault
from trackfield.world.path import Path
from trackfield.world.placed import Placed
from trackfield.world.scene import Scene

register_sensor("trip", Trip)
STRAIGHT = Path.of([(0.0, -100.0, 0.0, 10.0, 0.0), (40.0, 300.0, 0.0, 10.0, 0.0)])
"""East at 10 m/s."""
FIELD = {"sensor.kind": "trip", "fusion.trackers": ["ekf", "ukf"], "target.path": "s1", "target.steps": 20}


def placed(x: float, y: float, *paths: Path, options: dict[str, Any] | None = None) -> Placed:
    """A sensor that hears these targets at any time at which they are there."""
    kind = make_sensor("trip", options or {})
    end = max(round(path.end_s * NS) for path in paths)
    return Placed("n1", (x, y), Scene(paths), ((0, end),), kind, options or {}, kind.threshold, 7)


# --- when -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("x", [-37.25, 0.0, 123.456, 250.0])
def test_a_sensor_reports_at_the_closest_approach(x: float) -> None:
    assert placed(x, 20.0, STRAIGHT).events() == [pytest.approx((x + 100.0) / 10.0 * NS, abs=2000)]


def test_no_report_of_a_target_that_stays_out_of_range() -> None:
    assert placed(50.0, 61.0, STRAIGHT).events() == []


def test_each_pass_is_one_report() -> None:
    """There and back: the windows of a field's plan are one for each stay within range."""
    scenario = tf.Scenario.load(
        "zhai-spcpf",
        {"sensor.kind": "trip", "fusion.trackers": ["ekf"]}
        | {"target": {"path": "waypoints", "waypoints": [[0, -200, 50], [40, 600, 50], [80, -200, 50]]}},
    )
    site = survey(scenario)
    passes = [list(times.values()) for times in site.passes.values() if times]
    assert passes and all(len(times) == 2 for times in passes)
    assert all(sum(times) == pytest.approx(80 * NS, abs=4000) for times in passes)


def test_the_next_report_is_a_later_one() -> None:
    sensor = placed(0.0, 20.0, STRAIGHT)
    (at,) = sensor.events()
    assert sensor.next_window(0) == at == sensor.next_window(at - 1)
    assert sensor.next_window(at) is None


def test_a_babbling_sensor_reports_once_a_second_and_a_deaf_one_never() -> None:
    sensor = placed(0.0, 20.0, STRAIGHT)
    (at,) = sensor.events()
    babbles = Faulty(sensor, (SensorFault("babble", 2 * NS, 5 * NS),))
    times = [0]
    while (after := babbles.next_window(times[-1])) is not None:
        times.append(after)
    assert times[1:] == [2 * NS, 3 * NS, 4 * NS, at]
    assert babbles.sample(3 * NS) is not None
    assert Faulty(sensor, (SensorFault("deaf", 0),)).sample(at) is None


# --- the node ---------------------------------------------------------------------------------------------------------


def sends(effects: tuple[Any, ...]) -> list[Send]:
    return [one for one in effects if isinstance(one, Send)]


def reading(value: float) -> Measured:
    return Measured((round(value * 100),), (value,), timed=True)


def test_a_node_sleeps_until_its_sensor_reports_and_says_how_early_that_was() -> None:
    node = Node(step_ns=NS, centre="hub", by_itself=True)
    state, effects = node.handle(node.begin(), Started(0))
    assert Sample("wake-up") in effects
    state, effects = node.handle(state, Sampled(0, "wake-up", 2_250_000_000))
    assert effects == (SetTimer("step", 2_250_000_000),)
    state, effects = node.handle(state, Timer(2_250_000_000, "step"))
    assert effects == (Sample("sound"),)
    state, effects = node.handle(state, Sampled(2_250_000_000, "sound", reading(12.34)))
    assert [one.message for one in sends(effects)] == [Measurement(3, (1234, 750_000))]
    assert effects[-1] == Sample("wake-up")
    assert state.phase is Phase.ASLEEP


def test_one_report_for_a_step() -> None:
    """Two targets pass within a step: the first counts, as a step has one report of a sensor."""
    node = Node(step_ns=NS, centre="hub", by_itself=True)
    state, _ = node.handle(node.begin(), Started(0))
    state, first = node.handle(state, Sampled(2_250_000_000, "sound", reading(12.34)))
    state, second = node.handle(state, Sampled(2_500_000_000, "sound", reading(56.78)))
    assert len(sends(first)) == 1 and not sends(second)
    assert second == (Sample("wake-up"),)


def test_a_miss_is_no_report_and_an_instant_of_a_step_is_not_early() -> None:
    node = Node(step_ns=NS, centre="hub", by_itself=True)
    state, _ = node.handle(node.begin(), Started(0))
    state, effects = node.handle(state, Sampled(2 * NS, "sound", None))
    assert effects == (Sample("wake-up"),)
    state, effects = node.handle(state, Sampled(2 * NS, "sound", reading(1.0)))
    assert [one.message for one in sends(effects)] == [Measurement(2, (100, 0))]


def test_the_instant_is_by_corrected_time() -> None:
    sync = {"reference": "hub", "exchanges": 1, "resync_ns": 60 * NS, "timeout_ns": NS // 5, "seed": 1, "id": "n1"}
    node = Node(step_ns=NS, centre="hub", by_itself=True, sync=sync)
    state, _ = node.handle(node.begin(), Started(0))
    state, effects = node.handle(state, Timer(NS, "sync"))
    (asked,) = sends(effects)
    reply = SyncReply(asked.message.exchange, asked.message.sent_us, 1_400_000, 1_400_000)
    state, _ = node.handle(state, Received(NS, reply, "hub"))
    state, _ = node.handle(state, Timer(NS + NS // 5, "sync"))
    state, effects = node.handle(state, Sampled(2 * NS, "sound", reading(1.0)))
    assert [one.message for one in sends(effects)] == [Measurement(3, (100, 600_000))], "its clock is 0.4 s behind"


# --- what trackers make of it -----------------------------------------------------------------------------------------

KIND: Kind = make_sensor("trip", {})
AT = np.array([[0.0, 30.0], [40.0, -20.0], [-10.0, -50.0]])
EARLY = np.array([0.0, 0.4, 0.9])
MODEL = Model({"trip": KIND}, 0.5)
X = np.array([12.0, 5.0, 8.0, -3.0])


def reports(early: Any, values: Any = ((20.0,), (30.0,), (50.0,))) -> Reports:
    return Reports(1, ("a", "b", "c"), AT, (Readings("trip", np.array(values), early),))


def test_a_reading_is_of_where_the_target_was() -> None:
    there = [hypot(*(X[:2] - s * X[2:] - at)) for s, at in zip(EARLY, AT, strict=True)]
    assert expected(MODEL, X, reports(EARLY)) == pytest.approx(there)
    assert expected(MODEL, X, reports(np.zeros(3))) == pytest.approx(expected(MODEL, X, reports(None)))


def test_slopes_against_differences() -> None:
    some, step = reports(EARLY), 1e-5
    found = [(expected(MODEL, X + d, some) - expected(MODEL, X - d, some)) / (2 * step) for d in step * np.eye(4)]
    assert jacobians(MODEL, X, some) == pytest.approx(np.array(found).T, abs=1e-7)
    assert np.abs(jacobians(MODEL, X, some)[1:, 2:]).max() > 0.1, "an early reading tells of the velocity"
    states = np.stack([X, X + 1.0])
    assert jacobians(MODEL, states, some)[0] == pytest.approx(jacobians(MODEL, X, some))


def test_information_and_likelihood_take_the_same_instants() -> None:
    some = reports(EARLY, expected(MODEL, X, reports(EARLY))[:, None])
    best = log_likelihood(MODEL, X, some)
    assert all(log_likelihood(MODEL, X + d, some) < best for d in np.vstack((np.eye(4), -np.eye(4))))
    H = jacobians(MODEL, X, some)
    assert sensing_information(MODEL, X, some) == pytest.approx(H.T @ H / KIND.sd[0] ** 2)


def test_some_reports_keep_their_instants() -> None:
    some = reports(EARLY).only(np.array([0, 2]))
    assert some.readings[0].early_s == pytest.approx([0.0, 0.9])


# --- runs -------------------------------------------------------------------------------------------------------------


def test_passes_are_what_a_track_is_expected_at() -> None:
    scenario = tf.Scenario.load("zhai-spcpf", FIELD | {"fusion.prior_sd": [5.0, 5.0, 1.0, 1.0]})
    plan = planned(scenario)
    steps = {k for some in plan.passes.values() for k in some if k <= 20}
    assert 5 < len(steps) < 20
    result = tf.run(scenario, seed=1)
    for figures in result.metrics.trackers.values():
        assert figures.steps_expected == len(steps)
        assert figures.steps_tracked == len(steps)
        assert figures.verdict == "tracked"
        assert figures.times_bound is not None and figures.times_bound < 2.0
    sent = {(row["src"], row["step"]) for row in result.messages.to_pylist()}
    assert sent == {(id, k) for id, some in plan.passes.items() for k in some if (k - 1) * NS < plan.run.end_ns}
    assert not [text for text in warned(plan).warnings if "reports" in text and "late" in text]
    assert "trip" in result.report().read_text()


def test_a_field_with_sensors_that_are_read_at_steps_expects_all_steps() -> None:
    kinds = [{"kind": "trip", "share": 0.5}]
    plan = planned(tf.Scenario.load("zhai-spcpf", {"sensors": kinds, "fusion.trackers": ["ekf"]}))
    assert plan.passes and plan.pass_steps is None


def test_both_drivers_agree(tmp_path: FilePath) -> None:
    settings = FIELD | {"clock.offset_ms": 80.0, "clock.drift_ppm": 40.0, "link.model": "fixed", "link.loss": 0.2}
    scenario = tf.Scenario.load("zhai-spcpf", settings)
    virtual = tf.run(scenario, seed=3)
    for speed in SPEEDS:
        real = tf.run(scenario, seed=3, driver="processes", speed=speed, out=tmp_path / f"at-{speed}")
        if kept_up(json.loads((real.path / METRICS).read_text())):
            break
    sent, fates = ["src", "sent_ns", "kind", "payload", "outcome", "due_ns"], ["tracker", "at_ns", *"xy", "covariance"]
    assert real.messages.select(sent).equals(virtual.messages.select(sent))
    assert real.tracks.select(fates).equals(virtual.tracks.select(fates))
    assert virtual.messages.num_rows > 20


def test_a_replay_is_the_run() -> None:
    result = tf.run(tf.Scenario.load("zhai-spcpf", FIELD), seed=2)
    again = tf.replay(result.path)
    columns = ["tracker", "at_ns", "x", "y", "vx", "vy", "covariance"]
    assert again.tracks.select(columns).equals(result.tracks.select(columns))


# --- bounds and forecasts ---------------------------------------------------------------------------------------------


def test_the_bound_takes_readings_at_their_instants() -> None:
    """Against Fisher's matrix of distances to a target that moved on for ``early`` seconds, by differences."""
    plan = planned(tf.Scenario.load("zhai-spcpf", FIELD))
    (path,), places = plan.paths.values(), {place.id: (place.x, place.y) for place in plan.info.tagged("senses")}
    id, step, at_ns = next((id, k, t) for id, all_ in plan.passes.items() for k, t in all_.items() if t % NS)
    t_ns = plan.origin_ns + step * NS
    early_s = (t_ns - at_ns) / NS
    state = np.array(path.at(t_ns / NS))

    def away(x: Any) -> float:
        return hypot(*(x[:2] - early_s * x[2:] - places[id]))

    slopes = np.array([(away(state + d) - away(state - d)) / 2e-4 for d in 1e-4 * np.eye(4)])
    expected = np.outer(slopes, slopes) / KIND.sd[0] ** 2
    assert 0.0 < early_s < 1.0
    found = bounds._information(plan, t_ns, state, [id], places, Model({"trip": KIND}))
    assert found == pytest.approx(expected, abs=1e-6)
    assert np.abs(found[2:, 2:]).max() > 1e-4, "it tells of the velocity"


@dataclass(frozen=True)
class Half:
    """The first half of the sensors reports to nobody."""

    def arrange(self, field: Any) -> Any:
        ids = [id for id, *_ in sorted(field.sensors)]
        told, silent = ids[len(ids) // 2 :], ids[: len(ids) // 2]
        centre = field.fusion_centre("fusion", 0.0, 0.0, told)
        idle = (replace(one, sends={}) for one in field.sensor_nodes("fusion", silent))
        return tf.Arranged([centre, *field.sensor_nodes("fusion", told), *idle], {"base": ["fusion"]})


def test_a_forecast_is_of_the_sensors_that_report_to_somebody(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(ARCHITECTURES.registered, "half", Half)
    plan = planned(tf.Scenario.load("zhai-spcpf", FIELD | {"architecture.kind": "half"}))
    told = {src for flow in plan.reports for src, _ in flow.pairs}
    ids = sorted(told & plan.passes.keys())
    places = {place.id: (place.x, place.y) for place in plan.info.tagged("senses")}
    heard = Heard.of(plan, ids, np.array([places[id] for id in ids]))
    rows = {(ids[i], t // NS) for i, t in zip(heard.sensor.tolist(), heard.t_ns.tolist(), strict=True)}
    assert rows == {(id, k) for id in ids for k in plan.passes[id]}
    assert warned(plan) is not None
