"""The kind ``cpa``: when its sensors report a pass, what they report, and what trackers expect of it."""

from __future__ import annotations

import subprocess
import sys
from math import hypot, inf, log10
from typing import Any

import numpy as np
import pytest

import trackfield as tf
from launcher.plan.prepare import planned, warned
from launcher.plan.probe import probe
from node.role import Node
from trackfield.errors import ScenarioError
from trackfield.role import NS, Received, Sample, Sampled, Send, Started, Timer
from trackfield.sensing.cpa import KNOWN_NS
from trackfield.sensing.kinds import make_sensor
from trackfield.wire.codec import decode, encode
from trackfield.wire.messages import SyncReply
from trackfield.wire.passes import MOST_EARLY_S, CpaReport, CpaReportSds
from trackfield.world.faulty import Faulty, SensorFault
from trackfield.world.path import Path
from trackfield.world.placed import Placed
from trackfield.world.scene import Scene, Still

STRAIGHT = Path.of([(0.0, -100.0, 0.0, 12.5, 0.0), (40.0, 400.0, 0.0, 12.5, 0.0)])
"""East at 12.5 m/s."""
BACK = Path.of([(0.0, 150.0, -10.0, -10.0, 0.0), (40.0, -250.0, -10.0, -10.0, 0.0)])
QUIET = (0.0,) * 5


def placed(x: float, y: float, *paths: Path, seed: int = 7, **options: Any) -> Placed:
    """A sensor that hears these targets at any time at which they are there."""
    kind, end = make_sensor("cpa", options), max(round(path.end_s * NS) for path in paths)
    return Placed("n1", (x, y), Scene(paths), ((0, end),), kind, options, kind.threshold, seed)


# --- when -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("x", [-37.25, 0.0, 123.456])
@pytest.mark.parametrize("sound_m_s", [340.0, 0.0])
def test_a_sensor_knows_a_second_after_the_sound_of_the_pass_has_arrived(x: float, sound_m_s: float) -> None:
    sensor = placed(x, 20.0, STRAIGHT, sound_m_s=sound_m_s)
    delay_s = 20.0 / sound_m_s if sound_m_s else 0.0
    assert sensor.events() == [pytest.approx(((x + 100.0) / 12.5 + delay_s + 1.0) * NS, abs=2000)]
    (at,) = sensor.events()
    assert sensor.next_window(0) == at
    assert sensor.next_window(at) is None
    assert sensor.sample(at) is not None
    assert sensor.sample(at - 1000) is not None, "a clock may be a little beside"
    assert sensor.sample(at - NS // 10) is None
    assert sensor.sample(at + NS // 10) is None


def test_no_pass_out_of_range_and_none_of_a_target_that_stands_or_begins_nearby() -> None:
    assert placed(50.0, 51.0, STRAIGHT).events() == []
    assert placed(-110.0, 0.0, STRAIGHT).events() == []
    kind = make_sensor("cpa", {})
    assert kind.simulate(Still((5.0, 5.0, 0.0, 0.0)), 5 * NS, (0.0, 0.0), QUIET) is None


@pytest.mark.parametrize(("speed_m_s", "known"), [(2.1, 1), (1.9, 0)])
def test_a_target_so_slow_that_its_pulse_is_wider_than_detectors_find_is_not_noticed(
    speed_m_s: float, known: int
) -> None:
    """At 12 m, six seconds wide is 2 m/s: so nothing is reported of a vehicle that stands and is never quite still."""
    slow = Path.of([(t, speed_m_s * (t - 20.0), 12.0, speed_m_s, 0.0) for t in (0.0, 40.0)])
    sensor = placed(0.0, 0.0, slow)
    assert len(sensor.events()) == known
    kind, at = make_sensor("cpa", {}), round((20.0 + 12.0 / 340.0 + 1.0) * NS)
    assert (kind.simulate(Scene((slow,)), at, (0.0, 0.0), QUIET) is not None) == bool(known)


def test_a_corner_is_a_pass_if_the_target_turns_away_there() -> None:
    into, out_of = [(0.0, -80.0, 10.0, 10.0, 0.0), (8.0, 0.0, 10.0, 10.0, 0.0)], (16.0, 0.0, 90.0, 0.0, 10.0)
    corner = Path.of([*into, (8.0, 0.0, 10.0, 0.0, 10.0), out_of])
    sensor = placed(30.0, -20.0, corner)
    (at,) = sensor.events()
    assert at == pytest.approx((8.0 + hypot(30.0, 30.0) / 340.0 + 1.0) * NS, abs=1e5)
    assert sensor.sample(at) is not None


def test_of_several_targets_each_pass_is_one_report() -> None:
    sensor = placed(0.0, 20.0, STRAIGHT, BACK)
    alone = [placed(0.0, 20.0, path).events() for path in (STRAIGHT, BACK)]
    assert sensor.events() == sorted(at for some in alone for at in some)
    widths = [sensor.sample(at).values[2] for at in sensor.events()]  # type: ignore[union-attr]
    assert widths == pytest.approx([20.0 / 12.5, 30.0 / 10.0], rel=0.25)  # sd 5 %


# --- what -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("sound_m_s", [340.0, 0.0])
def test_without_noise_a_reading_is_what_trackers_expect(sound_m_s: float) -> None:
    """At any instant of the step: times are relative to it, and so is what ``h`` gives."""
    kind, at = make_sensor("cpa", {"sound_m_s": sound_m_s}), (33.0, 14.0)
    known = placed(*at, STRAIGHT, sound_m_s=sound_m_s).events()[0]
    values = kind.simulate(Scene((STRAIGHT,)), known, at, QUIET)
    assert values == pytest.approx((-KNOWN_NS / NS, -20.0 * log10(14.0), 14.0 / 12.5), abs=1e-5)
    early_ns = 321_000_000
    state = np.array(STRAIGHT.at((known + early_ns) / NS))
    report = kind.reading(values).report(17, early_ns)
    assert kind.values(report)[:2] == pytest.approx(kind.h(state, np.array([at]))[0].tolist(), abs=1e-5)
    assert (report.step, report.event) == (17, 17)


@pytest.mark.parametrize(("p", "q"), [(0.0, 0.0), (1.0, 0.0), (0.0, 3.3), (1.0, 2.0)])
@pytest.mark.parametrize("away_m", [2.0, 30.0])
def test_noise_is_as_the_papers(p: float, q: float, away_m: float) -> None:
    """sigma_t = s (max(d, 3) / d_ref)^p (13.4 / v)^q, and of the amplitude a share; drawn and assumed alike."""
    options = {"distance_power": p, "speed_power": q, "time_sd_s": 0.05, "strength_sd": 0.2, "variances": True}
    kind, at = make_sensor("cpa", options), (0.0, away_m)
    known = placed(*at, STRAIGHT, **options).events()[0]
    quiet, loud = (kind.simulate(Scene((STRAIGHT,)), known, at, (z, z, 0.0, 0.0, 0.0)) for z in (0.0, 1.0))
    sd_s = 0.05 * (max(away_m, 3.0) / 12.0) ** p * (13.4 / 12.5) ** q
    sd_db = 20.0 * 0.2 / np.log(10.0)
    assert np.subtract(loud, quiet)[:2] == pytest.approx([sd_s, sd_db])
    assert quiet[3:] == pytest.approx([sd_s, sd_db])
    if kind.variance is not None:
        state = np.array(STRAIGHT.at(8.0))
        assert kind.variance(state, np.array([at]))[0] == pytest.approx([sd_s**2, sd_db**2])
    assert (kind.variance is None) == (p == q == 0.0)


def test_an_error_of_places_makes_times_and_strengths_less_precise() -> None:
    kind = make_sensor("cpa", {"place_sd_m": 2.0})
    assert kind.variance is not None
    found = kind.variance(np.array([0.0, 0.0, 12.5, 0.0]), np.array([[0.0, 20.0]]))[0]
    relative = 0.1**2 + (2.0 / 20.0) ** 2  # of the amplitude 1/d
    assert found == pytest.approx([0.1**2 + (2.0 / 12.5) ** 2, (20.0 / np.log(10.0)) ** 2 * relative])


@pytest.mark.parametrize("options", [{}, {"source_sd_db": 6.0}, {"use_strength": False}, {"sound_m_s": 0.0}])
def test_slopes_against_differences(options: dict[str, Any]) -> None:
    kind, at, step = make_sensor("cpa", options), np.array([[0.0, 30.0], [40.0, -20.0], [-10.0, -50.0]]), 1e-5
    x = np.array([12.0, 5.0, 8.0, -3.0] + [1.5] * len(kind.unknowns))
    moved = step * np.eye(len(x))
    found = [(kind.h(x + d, at) - kind.h(x - d, at)) / (2.0 * step) for d in moved]
    assert kind.jacobian(x, at) == pytest.approx(np.moveaxis(found, 0, -1), abs=1e-7)
    assert kind.jacobian(np.stack([x, x + 1.0]), at)[0] == pytest.approx(kind.jacobian(x, at))


def test_the_level_is_an_unknown_only_if_it_matters_and_is_not_known() -> None:
    (level,) = make_sensor("cpa", {"source_db": 40.0, "source_sd_db": 6.0}).unknowns
    assert (level.name, level.sd, level.mean) == ("source_db", 6.0, 40.0)
    assert make_sensor("cpa", {"source_sd_db": 6.0, "use_strength": False}).unknowns == ()


@pytest.mark.parametrize("options", [{}, {"variances": True, "use_strength": False}, {"waveform": True}])
def test_its_methods_return_what_they_should(options: dict[str, Any]) -> None:
    kind = make_sensor("cpa", options)
    probe(kind)
    kind.simulate(Scene((STRAIGHT,)), 9 * NS, (0.0, 5.0), QUIET[: kind.n])
    loud, quiet = np.array([[-1.0, -5.0, 1.0, 0.1, 1.0], [-1.0, -30.0, 1.0, 0.1, 1.0]])[:, : kind.n]
    assert kind.loudness(np.array([loud, quiet])).tolist() == [-5.0, -30.0]
    assert 0.0 < kind.drawn(tuple(quiet)) < kind.drawn(tuple(loud)) <= 1.0


# --- passes that are missed, and faults ------------------------------------------------------------------------------


def test_a_share_of_all_passes_is_not_noticed() -> None:
    """Of 400 passes, each lost with probability 0.3 by a draw of its own: 5 sds are 46."""
    heard = 0
    for seed in range(400):
        sensor = placed(0.0, 20.0, STRAIGHT, seed=seed, loss=0.3)
        heard += sensor.sample(sensor.events()[0]) is not None
    assert heard == pytest.approx(280, abs=46)


def test_faults() -> None:
    sensor = placed(0.0, 20.0, STRAIGHT)
    (at,) = sensor.events()
    fine = sensor.sample(at)
    assert fine is not None
    biased = Faulty(sensor, (SensorFault("bias", 0, None, (-0.25, 3.0, 0.0)),)).sample(at)
    assert biased is not None
    assert np.subtract(biased.values, fine.values) == pytest.approx([-0.25, 3.0, 0.0])
    assert Faulty(sensor, (SensorFault("deaf", 0),)).sample(at) is None
    stuck = Faulty(sensor, (SensorFault("stuck", NS),))
    assert stuck.sample(at) == stuck.sample(at + NS) != fine
    babbles = Faulty(sensor, (SensorFault("babble", 2 * NS, 5 * NS),))
    said = [babbles.sample(t) for t in (2 * NS, 3 * NS)]
    assert babbles.next_window(2 * NS) == 3 * NS
    assert all(one is not None and sensor.kind.possible(one.values) for one in said)
    assert said[0] != said[1]


# --- messages ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("variances", "message", "most"), [(False, CpaReport, 16), (True, CpaReportSds, 22)])
def test_reports_are_short(variances: bool, message: type, most: int) -> None:
    kind = make_sensor("cpa", {"variances": variances})
    longest = kind.longest()
    assert type(longest) is message and kind.takes(longest)
    assert len(encode(longest)) <= most
    ordinary = kind.reading((-1.0, -26.0, 1.6, 0.1, 0.87)[: kind.n]).report(30000, NS // 3)
    decoded = decode(encode(ordinary))
    assert (decoded.step, decoded.event) == (30000, 30000 % 256)
    assert np.subtract(kind.values(decoded), kind.values(ordinary)) == pytest.approx(0.0, abs=0.0126)
    assert kind.values(decoded)[0] == pytest.approx(-4.0 / 3.0, abs=1e-4)


def test_numbers_are_limited_to_what_a_report_holds() -> None:
    kind = make_sensor("cpa", {})
    reading = kind.reading((-50.0, 900.0, 40.0))
    report = reading.report(65535, 3 * NS)
    assert (report.early_s, report.strength_db, report.width_s, report.event) == (MOST_EARLY_S, 200.0, 6.375, 255)
    assert encode(report)
    assert kind.reading((0.5, -900.0, -1.0)).report(1).early_s == 0.0
    assert not kind.possible(kind.values(report)), "nobody knows how much earlier it was"
    assert kind.possible((-1.5, -20.0, 1.0))


def test_the_time_is_by_the_nodes_corrected_clock() -> None:
    sync = {"reference": "hub", "exchanges": 1, "resync_ns": 60 * NS, "timeout_ns": NS // 5, "seed": 1, "id": "n1"}
    node, kind = Node(step_ns=NS, centre="hub", by_itself=True, sync=sync), make_sensor("cpa", {})
    state, _ = node.handle(node.begin(), Started(0))
    state, effects = node.handle(state, Timer(NS, "sync"))
    (asked,) = (one for one in effects if isinstance(one, Send))
    reply = SyncReply(asked.message.exchange, asked.message.sent_us, 1_400_000, 1_400_000)
    state, _ = node.handle(state, Received(NS, reply, "hub"))
    state, _ = node.handle(state, Timer(NS + NS // 5, "sync"))
    state, effects = node.handle(state, Sampled(2 * NS, "sound", kind.reading((-1.0, -26.0, 1.6))))
    (sent,) = (one.message for one in effects if isinstance(one, Send))
    assert (sent.step, sent.early_s) == (3, pytest.approx(1.6)), "its clock is 0.4 s behind"
    assert effects[-1] == Sample("wake-up")


# --- scenarios --------------------------------------------------------------------------------------------------------


def test_a_centre_gathers_passes_over_several_steps_and_that_is_no_warning() -> None:
    passing = {"sensor.kind": "cpa", "fusion.trackers": ["ukf"], "target.step_s": 0.5, "target.steps": 40}
    assert not [text for text in warned(planned(tf.Scenario.load("zhai-spcpf", passing))).warnings if "too few" in text]


def test_slaves_that_wake_at_steps_cannot_report_passes() -> None:
    with pytest.raises(ScenarioError, match="reports passes by itself") as error:
        planned(tf.Scenario.load("ozfidan-clusters", {"sensor.kind": "cpa", "fusion.trackers": ["ukf"]}))
    assert 'architecture.kind = "cpa"' in str(error.value)


def test_sensors_that_report_by_themselves_cannot_be_polled() -> None:
    with pytest.raises(ScenarioError, match="reports by itself") as error:
        planned(tf.Scenario.load("yu-mrbpf", {"sensor.kind": "cpa", "fusion.trackers": ["ukf"]}))
    assert "rhythm 'steps'" in str(error.value)


@pytest.mark.parametrize(("key", "value"), [("sound_m_s", 0.5), ("detector", "best"), ("loss", 1.5), ("snr_db", inf)])
def test_keys_that_cannot_be(key: str, value: Any) -> None:
    with pytest.raises(ScenarioError, match=key):
        tf.Scenario.load("zhai-spcpf", {"sensor.kind": "cpa", f"sensor.{key}": value})


def test_sound_needs_a_speed() -> None:
    with pytest.raises(ScenarioError, match="sound is synthesised"):
        tf.Scenario.load("zhai-spcpf", {"sensor.kind": "cpa", "sensor.waveform": True, "sensor.sound_m_s": 0.0})


def test_a_node_that_reports_passes_loads_nothing_that_is_heavy() -> None:
    plain = placed(0.0, 20.0, STRAIGHT).to_plain()
    code = f"""
import sys
from math import inf
import node.role, trackfield.drivers.spec
from trackfield.wire.codec import encode
from trackfield.world.faulty import with_faults
from trackfield.world.placed import Placed
sensor = Placed.from_plain({plain!r})
at = sensor.next_window(0)
for faults in ([], [dict(kind="stuck", from_ns=0)], [dict(kind="babble", from_ns=0)]):
    encode(with_faults(sensor, faults).sample(at).report(9))
print(*{{"numpy", "scipy", "pydantic", "soundfile", "trackfield.acoustics"}} & sys.modules.keys())
"""
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert said.stdout.split() == []
