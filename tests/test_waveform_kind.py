"""Sensors that find passes in sound: what they hear and when they say so, sound files, and their processes."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import replace
from math import log10
from pathlib import Path as FilePath
from typing import Any

import numpy as np
import psutil
import pytest
import soundfile

import trackfield as tf
from launcher.plan.forecast.foresight import foresee
from launcher.plan.forecast.warnings import summary, warnings
from launcher.plan.prepare import planned
from launcher.processes.children import HEAVY_ZYGOTE, ZYGOTE
from launcher.processes.deployment import Deployment
from launcher.processes.preload import preload_of
from launcher.record.folder import keep
from launcher.study.store import scenario_digest
from tests.running import METRICS, SPEEDS, kept_up
from trackfield.acoustics.microphone import Microphone
from trackfield.acoustics.signals import RATE
from trackfield.acoustics.sources import engine
from trackfield.errors import ScenarioError
from trackfield.role import NS
from trackfield.scenario import Scenario, survey
from trackfield.scenario.sounds import read_sound
from trackfield.sensing.kinds import make_sensor
from trackfield.sensing.listening import Pass
from trackfield.world.faulty import Faulty, SensorFault
from trackfield.world.heard import AHEAD_NS, BESIDE_NS, Heard, Sounds
from trackfield.world.path import Path
from trackfield.world.placed import Placed
from trackfield.world.scene import Scene

EAST = Path.of([(0.0, -100.0, 0.0, 12.5, 0.0), (20.0, 150.0, 0.0, 12.5, 0.0)])
"""Past (0, 0) after 8 s, at 12.5 m/s."""
FIELD: dict[str, Any] = {
    "field.layout": "grid",
    "field.extent_m": 60.0,
    "field.spacing_m": 30.0,
    "sensor.kind": "cpa",
    "sensor.waveform": True,
    "target.path": "waypoints",
    "target.waypoints": [[0, -100, 15], [18, 125, 15]],
    "target.step_s": 0.5,
    "fusion.trackers": ["ukf"],
    "fusion.prior": "paper",
}


def scenario(**changes: Any) -> Scenario:
    return Scenario.load({"name": "heard"}, FIELD | changes)


def placed(x: float, y: float, *paths: Path, sounds: Sounds | None = None, **options: Any) -> Placed:
    """A sensor that hears these targets in one window."""
    chosen: dict[str, Any] = {"waveform": True, **options}
    kind, end = make_sensor("cpa", chosen), max(round(path.end_s * NS) for path in paths)
    args = ("n1", (x, y), Scene(paths), ((5 * NS, end),), kind, chosen, kind.threshold, 7)
    return Placed(*args) if sounds is None else Placed(*args, sounds=sounds)


def told(sensor: Placed, from_ns: int = 0) -> list[tuple[int, tuple[float, ...]]]:
    """When a sensor reports, and what, as its node finds out."""
    found, at = [], sensor.next_window(from_ns)
    while at is not None:
        if (reading := sensor.sample(at)) is not None:
            found.append((at, reading.values))
        at = sensor.next_window(at)
    return found


def pass_as_heard(y_m: float, seconds: float = 14.0) -> np.ndarray[Any, Any]:
    """(n,) what a microphone at (0, y) records of a vehicle that passes (0, 0) after 8 s, below full scale."""
    microphone = Microphone([EAST], (0.0, y_m), [engine(3, "t")], seed=3, id="m", snr_db=20.0)
    blocks = [samples for _, samples in microphone.blocks(0, round(seconds * NS))]
    return np.concatenate(blocks) * 0.9 / np.abs(np.concatenate(blocks)).max()


# --- when a sensor listens --------------------------------------------------------------------------------------------


class Tape:
    """Something to listen to in pieces of a quarter of a second, with passes at known times; it says what was heard."""

    def __init__(self, *passes: int) -> None:
        self.passes, self.begun, self.heard_ns = passes, list[tuple[int, int]](), 0

    def __call__(self, from_ns: int, until_ns: int) -> Iterator[tuple[int, Sequence[Pass]]]:
        self.begun.append((from_ns, until_ns))
        for begin in range(from_ns, until_ns, NS // 4):
            self.heard_ns = min(begin + NS // 4, until_ns)
            yield self.heard_ns, [(at, (-1.0,)) for at in self.passes if begin < at <= self.heard_ns]


def test_a_sensor_listens_window_by_window_and_no_farther_than_the_next_pass() -> None:
    tape = Tape(12 * NS, 14 * NS, 52 * NS)
    heard = Heard(((10 * NS, 20 * NS), (50 * NS, 60 * NS)), lambda: tape, lead_ns=2 * NS)
    assert heard.next(0) == 8 * NS
    assert tape.begun == []
    assert heard.next(8 * NS) == 8 * NS + AHEAD_NS
    assert heard.next(8 * NS + AHEAD_NS) == 12 * NS
    assert tape.heard_ns == 12 * NS
    assert (heard.at(12 * NS), heard.at(12 * NS - 1000), heard.at(13 * NS)) == ((-1.0,), (-1.0,), None)
    assert heard.next(12 * NS) == 14 * NS
    assert [heard.next(t * NS) for t in (14, 16, 18, 20)] == [16 * NS, 18 * NS, 48 * NS, 48 * NS]
    assert tape.begun == [(8 * NS, 20 * NS)]
    assert [heard.next(t * NS) for t in (48, 50)] == [50 * NS, 52 * NS]
    assert heard.next(59 * NS) is None


def test_in_a_long_silence_it_is_asked_again() -> None:
    tape = Tape(70 * NS)
    heard = Heard(((0, 100 * NS),), lambda: tape)
    asked = [0]
    while (after := heard.next(asked[-1])) is not None:
        assert tape.heard_ns <= asked[-1] + AHEAD_NS + NS // 4
        asked.append(after)
    assert 70 * NS in asked
    assert [at for at in asked if heard.at(at)] == [70 * NS]
    assert tape.begun == [(0, 100 * NS)], "nothing is heard twice"


def test_a_life_that_begins_within_a_window_hears_nothing_of_before() -> None:
    tape = Tape(12 * NS, 16 * NS)
    heard = Heard(((10 * NS, 20 * NS),), lambda: tape, lead_ns=2 * NS)
    assert heard.next(13 * NS) == 14 * NS
    assert heard.next(14 * NS) == 16 * NS
    assert tape.begun == [(13 * NS, 20 * NS)]


def test_when_it_is_asked_again_depends_on_the_time_alone() -> None:
    """A process that goes back is told what one is told that never did, and nothing is heard again for that."""
    passes = [t * NS // 10 for t in (121, 150, 155, 523, 571)]

    def made() -> tuple[Tape, Heard]:
        tape = Tape(*passes)
        return tape, Heard(((10 * NS, 20 * NS), (50 * NS, 60 * NS)), lambda: tape, lead_ns=2 * NS)

    times = [t * NS // 4 for t in range(240)]
    _, once = made()
    straight = [once.next(t) for t in times]
    tape, back = made()
    back.next(0)
    for t, before in zip(times[20:], times, strict=False):
        assert (back.next(t), back.next(before)) == (straight[times.index(t)], straight[times.index(before)])
    assert tape.begun == [(8 * NS, 20 * NS), (48 * NS, 60 * NS)]


def test_each_window_is_heard_once_even_if_the_next_is_near() -> None:
    tape = Tape(20 * NS, 22 * NS)
    heard = Heard(((10 * NS, 20 * NS), (21 * NS, 30 * NS)), lambda: tape, lead_ns=2 * NS)
    asked = [0]
    while (after := heard.next(asked[-1])) is not None:
        asked.append(after)
    assert asked == [t * NS for t in (0, 8, 10, 12, 14, 16, 18, 19, 20, 22, 24, 26, 28)]
    assert [at for at in asked if heard.at(at)] == [20 * NS, 22 * NS]
    assert tape.begun == [(8 * NS, 20 * NS), (19 * NS, 30 * NS)]


@pytest.mark.parametrize("by_ns", [-BESIDE_NS, -1, 0])
def test_a_clock_that_is_a_little_early_does_not_ask_for_ever(by_ns: int) -> None:
    heard = Heard(((10 * NS, 20 * NS),), lambda: Tape(13 * NS), lead_ns=2 * NS)
    assert [heard.next(t * NS + by_ns) for t in (8, 10, 12, 13)] == [t * NS for t in (10, 12, 13, 14)]


# --- what it hears ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("y_m", [8.0, 20.0])
def test_passes_are_found_when_they_are(y_m: float) -> None:
    """The sd of a fitted time is 0.015 w at best: it is within 5 of these."""
    sensor = placed(0.0, y_m, EAST, variances=True)
    ((at, (time_s, strength_db, width_s, time_sd_s, strength_sd_db)),) = told(sensor)
    width = y_m / 12.5
    assert at / NS + time_s == pytest.approx(8.0 + y_m / 340.0, abs=5 * 0.015 * width)
    assert at == pytest.approx(sensor.events()[0], abs=0.3 * NS), "as foreseen"
    assert width_s == pytest.approx(width, rel=0.3)
    assert strength_db == pytest.approx(-20.0 * log10(y_m), abs=2.0)
    assert 0.0 < time_sd_s < 0.1 * width
    assert 0.0 < strength_sd_db < 3.0


def test_what_is_heard_is_the_same_after_the_plain_form_and_differs_by_life() -> None:
    sensor = placed(0.0, 12.0, EAST)
    again = Placed.from_plain(json.loads(json.dumps(sensor.to_plain())))
    first = told(sensor)
    assert told(again) == first
    assert told(replace(sensor, incarnation=1))[0][1] != first[0][1]


def test_a_far_target_is_not_noticed_and_a_share_of_the_others_is_lost() -> None:
    assert told(placed(0.0, 45.0, EAST, snr_db=-20.0)) == []
    assert told(placed(0.0, 12.0, EAST, loss=1.0)) == []


def test_faults_of_sensors_that_listen() -> None:
    sensor = placed(0.0, 12.0, EAST)
    ((at, fine),) = told(sensor)
    assert Faulty(sensor, (SensorFault("deaf", 0),)).sample(at) is None
    biased = Faulty(sensor, (SensorFault("bias", 0, None, (-0.25, 3.0, 0.0)),)).sample(at)
    stuck = Faulty(sensor, (SensorFault("stuck", NS),)).sample(at)
    assert biased is not None and stuck is not None
    assert np.subtract(biased.values, fine) == pytest.approx([-0.25, 3.0, 0.0])
    assert stuck.values[0] == -1.0
    babbles = Faulty(sensor, (SensorFault("babble", 6 * NS, 8 * NS),))
    assert [babbles.next_window(t) for t in (5 * NS, 6 * NS)] == [6 * NS, 7 * NS]


def test_a_sensor_that_plays_what_was_reported_listens_to_nothing() -> None:
    played = ((9 * NS, (-1.2, -20.0, 0.9)), (12 * NS, (-1.1, -30.0, 2.0)))
    kind = make_sensor("cpa", {"waveform": True}, recorded=True)
    sensor = Placed("n1", (0.0, 12.0), Scene((EAST,)), ((9 * NS, 12 * NS),), kind, {}, kind.threshold, 7, played=played)
    assert told(sensor) == list(played)
    assert kind.modules == ()


def test_a_sensor_hears_its_recording_and_nothing_else() -> None:
    samples = (pass_as_heard(12.0) * 32767).astype("<i2").tobytes()
    sensor = placed(0.0, 12.0, EAST, sounds=Sounds((), samples, 2 * NS))
    long = replace(sensor, windows=((2 * NS, 16 * NS),))
    ((at, (time_s, *_)),) = told(long)
    assert at / NS + time_s == pytest.approx(2.0 + 8.0 + 12.0 / 340.0, abs=5 * 0.015 * 12.0 / 12.5)


# --- sound files ------------------------------------------------------------------------------------------------------


def test_files_of_any_rate_become_samples_of_four_kilohertz(tmp_path: FilePath) -> None:
    t = np.arange(2 * 44_100) / 44_100
    tone = np.stack([0.5 * np.sin(2 * np.pi * 440.0 * t), np.zeros(len(t))], axis=-1)
    soundfile.write(tmp_path / "tone.wav", tone, 44_100)
    loud, silent = (np.frombuffer(one, "<i2") for one in read_sound(tmp_path / "tone.wav", 10.0))
    expected = 0.5 * 32768 * np.sin(2 * np.pi * 440.0 * np.arange(2 * RATE) / RATE)
    assert len(loud) == 2 * RATE
    assert np.abs(loud - expected)[200:-200].max() < 40.0
    assert not silent.any()


@pytest.mark.parametrize(("seconds", "what"), [(0.5, "has 0.5 s of sound"), (61.0, "is longer than 60 s")])
def test_a_targets_sound_has_a_sensible_length(seconds: float, what: str, tmp_path: FilePath) -> None:
    file = tmp_path / "car.wav"
    soundfile.write(file, np.ones(round(seconds * RATE)) * 0.1, RATE)
    with pytest.raises(ScenarioError, match=f"car.wav: target.sound: {what}"):
        survey(scenario(**{"target.sound": str(file)}))


def test_files_that_cannot_be_used(tmp_path: FilePath) -> None:
    for name, samples in {"silent": np.zeros(3 * RATE), "two": np.ones((3 * RATE, 2)) * 0.1}.items():
        soundfile.write(tmp_path / f"{name}.wav", samples, RATE)
    (tmp_path / "text.wav").write_text("no sound")
    for name, what in {
        "none": "No such file",
        "text": "no sound file",
        "silent": "of power 0",
        "two": "2 channels",
    }.items():
        with pytest.raises(ScenarioError, match=f"{name}.wav: target.sound: .*{what}"):
            survey(scenario(**{"target.sound": str(tmp_path / f"{name}.wav")}))
    with pytest.raises(
        ScenarioError,
        match=r"two\.wav: sensor\.recording: has 2 channels; expected one, or one for each of its 9 sensors",
    ):
        survey(scenario(**{"sensor.recording": str(tmp_path / "two.wav")}))
    with pytest.raises(
        ScenarioError, match=r"silent\.wav: sensor\.recording: is of sound, and sensors of kind 'cpa' do not listen"
    ):
        survey(scenario(**{"sensor.recording": str(tmp_path / "silent.wav"), "sensor.waveform": False}))
    with pytest.raises(
        ScenarioError,
        match=r'silent\.wav: target\.sound: is of sound, and no sensor listens; expected sensors of kind "cpa"',
    ):
        survey(scenario(**{"target.sound": str(tmp_path / "silent.wav"), "sensor.waveform": False}))


def test_the_run_has_copies_of_its_sounds(tmp_path: FilePath) -> None:
    soundfile.write(tmp_path / "pass.wav", pass_as_heard(12.0), RATE)
    folder = tmp_path / "run"
    folder.mkdir()
    keep(scenario(**{"target.sound": str(tmp_path / "pass.wav")}), folder)
    assert (folder / "target-sound.wav").read_bytes() == (tmp_path / "pass.wav").read_bytes()
    assert Scenario.load(folder / "scenario.toml").every_target[0].sound == str(folder / "target-sound.wav")


def test_runs_with_another_sound_are_other_runs(tmp_path: FilePath) -> None:
    file = tmp_path / "pass.wav"
    soundfile.write(file, pass_as_heard(12.0), RATE)
    before = scenario_digest(scenario(**{"target.sound": str(file)}))
    soundfile.write(file, pass_as_heard(16.0), RATE)
    assert scenario_digest(scenario(**{"target.sound": str(file)})) != before


def test_all_nodes_share_the_samples_of_a_target(tmp_path: FilePath) -> None:
    soundfile.write(tmp_path / "pass.wav", pass_as_heard(12.0), RATE)
    plan = planned(scenario(**{"target.sound": str(tmp_path / "pass.wav")}))
    sounds = {id(one.sound["sounds"][0][0]) for one in plan.processes if one.sound}
    assert len(sounds) == 1
    assert any(plan.passes.values()), "as its kind foresees them"


def test_each_sensor_hears_its_channel_and_nobody_need_know_where_the_target_was(tmp_path: FilePath) -> None:
    near = [10.0, 15.0, 20.0, 25.0, *(12.0,) * 5]
    soundfile.write(tmp_path / "field.wav", np.stack([pass_as_heard(y) for y in near], axis=-1), RATE)
    without = {key: value for key, value in FIELD.items() if not key.startswith("target")} | {"fusion.prior": "none"}
    played = Scenario.load({"name": "played"}, without | {"sensor.recording": str(tmp_path / "field.wav")})
    site = survey(played)
    assert (site.steps, site.paths, site.pass_steps) == (14, {}, None)
    origin_s = site.origin_ns / NS
    for index, y in enumerate(near[:4]):
        sensor = site.sensor(index)
        ((at, (time_s, _, width_s)),) = told(Placed.from_plain(sensor.to_plain()))
        assert at / NS + time_s == pytest.approx(origin_s + 8.0 + y / 340.0, abs=5 * 0.015 * y / 12.5)
        assert width_s == pytest.approx(y / 12.5, rel=0.3)


def test_what_recorded_sound_holds_is_not_foreseen(tmp_path: FilePath) -> None:
    """A target that passes all sensors is no reason to expect anything of those that hear a recording."""
    soundfile.write(tmp_path / "pass.wav", pass_as_heard(12.0), RATE)
    hears = {"recording": str(tmp_path / "pass.wav")}
    all_hear = planned(scenario(**{f"sensor.{key}": value for key, value in hears.items()}))
    few = planned(scenario(sensors=[{"kind": "cpa", "waveform": True, "nodes": ["n000", "n001"], **hears}]))
    assert any(all_hear.passes.values()), "the truth, if the target is the one recorded"
    assert foresee(all_hear).reports == {}
    assert [line.split("; ")[0] for line in summary(all_hear, foresee(all_hear))] == [
        "recorded sound: nobody knows before the run which passes 9 of 9 sensor nodes will find in it"
    ]
    assert foresee(few).reports.keys() == foresee(planned(scenario())).reports.keys() - {"n000", "n001"}
    first, second, *_ = summary(few, foresee(few))
    assert "which passes 2 of 9 sensor nodes will find" in first
    assert second.startswith("coverage: ")
    assert warnings(all_hear, foresee(all_hear)) == warnings(few, foresee(few)) == ()


def test_a_run_lasts_to_the_end_of_the_sound_or_to_the_last_report(tmp_path: FilePath) -> None:
    soundfile.write(tmp_path / "field.wav", pass_as_heard(12.0), RATE)
    reports = {"kind": "range", "recording": str(tmp_path / "reports.csv"), "nodes": ["n000"]}
    without = {key: value for key, value in FIELD.items() if not key.startswith("target")} | {"fusion.prior": "none"}
    sounding = without | {"sensor.recording": str(tmp_path / "field.wav"), "sensors": [reports]}
    for last_s, steps in ((3, 14), (20, 21)):  # of 1 s; the first is half a step before the first report
        (tmp_path / "reports.csv").write_text(f"t_s,sensor,range\n0,n000,10\n{last_s},n000,12\n")
        assert survey(Scenario.load({"name": "both"}, sounding)).steps == steps


# --- processes --------------------------------------------------------------------------------------------------------


def test_nodes_that_listen_are_forked_from_a_zygote_that_has_numpy_and_others_are_not(tmp_path: FilePath) -> None:
    mixed = scenario(**{"sensors": [{"kind": "range", "nodes": ["n000"]}]})
    plan = planned(mixed)
    preload = preload_of(plan.processes)
    assert "trackfield.acoustics.listener" in preload.heavy
    assert not [name for name in preload.light if "acoustics" in name]
    with Deployment(plan, tmp_path) as field:
        field.wait_ready(lambda missing, of: False)
        pids = field.pids()
        parents = {name: psutil.Process(pids[name]).ppid() for name in ("n000", "n001", "n005")}
        mapped = {name: numpy_mapped(pids[name]) for name in ("n000", "n001", ZYGOTE)}
    assert parents == {"n000": pids[ZYGOTE], "n001": pids[HEAVY_ZYGOTE], "n005": pids[HEAVY_ZYGOTE]}
    assert mapped == {"n000": False, "n001": True, ZYGOTE: False}


def numpy_mapped(pid: int) -> bool:
    """Whether a process has loaded numpy."""
    return any("numpy" in one.path for one in psutil.Process(pid).memory_maps())


def test_a_field_whose_sensors_do_not_listen_needs_no_such_zygote() -> None:
    assert preload_of(planned(scenario(**{"sensor.waveform": False})).processes).heavy == ()


@pytest.mark.parametrize("waveform", [False, True])
def test_both_drivers_agree(waveform: bool, tmp_path: FilePath) -> None:
    """The processes that listen get the sound of the target with their place in the run."""
    soundfile.write(tmp_path / "pass.wav", pass_as_heard(12.0), RATE)
    settings = {"target.sound": str(tmp_path / "pass.wav")} if waveform else {"sensor.waveform": False}
    settings |= {"clock.offset_ms": 30.0, "clock.drift_ppm": 40.0}
    heard = scenario(**settings, **{"link.model": "fixed", "link.loss": 0.1, "sensor.variances": True})
    virtual = tf.run(heard, seed=3)
    for speed in SPEEDS[1:] if waveform else SPEEDS:
        real = tf.run(heard, seed=3, driver="processes", speed=speed, out=tmp_path / f"at-{speed}")
        if kept_up(json.loads((real.path / METRICS).read_text())):
            break
    sent, fates = ["src", "sent_ns", "kind", "payload", "outcome", "due_ns"], ["tracker", "at_ns", *"xy", "covariance"]
    assert real.messages.select(sent).equals(virtual.messages.select(sent))
    assert real.tracks.select(fates).equals(virtual.tracks.select(fates))
    assert virtual.messages.column("kind").to_pylist().count("cpa-report-sds") >= 6


@pytest.mark.parametrize("waveform", [False, True])
def test_a_tracker_with_a_prior_follows_a_target_by_its_passes(waveform: bool) -> None:
    """Its errors over three runs are smaller than those without any report."""
    error = dict.fromkeys(("ukf", "predict-only"), 0.0)
    for seed in range(3):
        followed = scenario(
            **{"sensor.waveform": waveform, "fusion.trackers": [*error], "fusion.prior_sd": [8.0, 8.0, 2.0, 2.0]}
        )
        figures = tf.run(followed, seed=seed).metrics.trackers
        for name in error:
            error[name] += figures[name].rmse.position
    assert error["ukf"] < 0.8 * error["predict-only"]
