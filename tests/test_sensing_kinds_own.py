"""Range, strength and energy in scenarios, nodes and faults: limits of their options, reports, words, pictures."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Sequence
from dataclasses import MISSING, fields
from math import exp, inf, log
from pathlib import Path as FilePath
from statistics import fmean
from typing import Any, Final

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import trackfield as tf
from launcher.plan.prepare import planned
from launcher.record.books.said import describe
from launcher.record.figures.hops import REPORTS
from tests.command_line import Call, trackfield
from trackfield.scenario.sensors import SENSORS as SECTIONS
from trackfield.sensing.complete import Kind
from trackfield.sensing.energy import Energy
from trackfield.sensing.kinds import SENSORS, make_sensor
from trackfield.sensing.range import Range
from trackfield.sensing.readings import Reading
from trackfield.sensing.rss import Rss
from trackfield.wire.codec import decode, encode
from trackfield.wire.messages import Measurement
from trackfield.wire.registry import kind_of_class
from trackfield.world.faulty import with_faults
from trackfield.world.path import Path
from trackfield.world.placed import Placed
from trackfield.world.scene import Scene

__all__ = ["trackfield"]

NS: Final = 1_000_000_000
OWN: Final = ("range", "rss", "energy")
PASSING: Final = Path.of([(0.0, -100.0, 40.0, 10.0, 0.0), (20.0, 100.0, 40.0, 10.0, 0.0)])


def sensor(name: str, **options: Any) -> Placed:
    kind = make_sensor(name, options)
    windows = ((4 * NS, 16 * NS),)
    return Placed("n007", (0.0, 0.0), Scene((PASSING,)), windows, kind, options, kind.threshold, seed=1)


def numbers(readings: Sequence[Reading | None]) -> list[float]:
    return [one.values[0] for one in readings if one is not None]


# --- options ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["doa", *OWN])
def test_sections_have_the_options_of_their_classes_and_their_defaults(name: str) -> None:
    section = SECTIONS[name]()
    own: Any = SENSORS[name]
    defaults = ((one.name, one.default, one.default_factory) for one in fields(own))
    assert dict(section.options) == {name: one if made is MISSING else made() for name, one, made in defaults}
    assert section.sensing.own == own()


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        ("range range_m=0", "sensor.range_m: is 0; expected a number from 0.001 to 100000"),
        ("range floor_sd_m=-1", "sensor.floor_sd_m: is -1; expected a number from 0.001 to 10000"),
        ("range growth_m=-0.1", "sensor.growth_m: is -0.1; expected a number from 0 to 10000000"),
        ("range sd_m=1", "sensor.sd_m: unknown; did you mean"),
        ("rss range_m=1e9", "sensor.range_m: is 1000000000.0; expected a number from 0.001 to 100000"),
        ("rss level_dbm=nan", "sensor.level_dbm: is NaN; expected a number from -150 to 100"),
        ("rss exponent=0", "sensor.exponent: is 0; expected a number from 0.5 to 20"),
        ("rss shadow_sd_db=0", "sensor.shadow_sd_db: is 0; expected a number from 0.001 to 30"),
        ("rss floor_m=0", "sensor.floor_m: is 0; expected a number from 0.001 to 1000"),
        ("rss slow=1.5", "sensor.slow: is 1.5; expected a number from 0 to 1"),
        ("rss slow_s=0", "sensor.slow_s: is 0; expected a number from 0.001 to 1e+09"),
        ("rss fixed=often", 'sensor.fixed: is "often"; expected a number from 0 to 1'),
        (
            "rss slow=0.7 fixed=0.5",
            "sensor.fixed: is 0.5, and slow is 0.7; expected shares that are at most 1 together",
        ),
        ("energy emitted=0", "sensor.emitted: is 0; expected a number from 1e-06 to 1e+09"),
        ("energy alpha=inf", "sensor.alpha: is Infinity; expected a number from 0.5 to 20"),
        ("energy gain=-1", "sensor.gain: is -1; expected a number from 1e-06 to 1000000"),
        ("energy noise=0", "sensor.noise: is 0; expected a number from 1e-06 to 1e+09"),
        ("energy relative=-0.1", "sensor.relative: is -0.1; expected a number from 0 to 10"),
        ("energy emitted_sd=0", "sensor.emitted_sd: is 0; expected a number from 1e-06 to 10"),
        ("energy emitted_walk=-1", "sensor.emitted_walk: is -1; expected a number from 0 to 10"),
        ("energy window_s=100", "sensor.window_s: is 100; expected a number from 0 to 60"),
        ("energy sound_m_s=0.5", "sensor.sound_m_s: is 0.5; expected 0, or a speed from 1 m/s on"),
        ("energy compensate_delay=1", "sensor.compensate_delay: is 1; expected true or false"),
        ("energy compensate_window=no", 'sensor.compensate_window: is "no"; expected true or false'),
    ],
)
def test_a_wrong_option_is_one_clear_message(trackfield: Call, settings: str, says: str) -> None:
    kind, *options = settings.split()
    sets = [part for option in (f"kind={kind}", *options) for part in ("--set", f"sensor.{option}")]
    said = trackfield("validate", "zhai-spcpf", *sets, "--set", "fusion.trackers=['ekf']")
    assert said.code == 2
    assert says in " ".join(said.err.split())
    assert said.err.count("sensor.") <= 2  # the message, and perhaps a hint in it


def test_sound_that_a_target_outruns_is_refused() -> None:
    settings = {"sensor.kind": "energy", "sensor.sound_m_s": 5.0, "fusion.trackers": ["ekf"]}
    with pytest.raises(tf.ScenarioError, match=r"sensor\.sound_m_s: 'energy' has 5 m/s, and target moves at"):
        planned(tf.Scenario.load("zhai-spcpf", settings))


def test_noise_that_no_number_can_say_is_refused() -> None:
    settings = {"sensor.kind": "energy", "sensor.range_m": 0.01, "sensor.floor_m": 0.001, "sensor.alpha": 20.0}
    with pytest.raises(tf.ScenarioError, match=r"sensor\.sd: 'energy' has"):
        planned(tf.Scenario.load("zhai-spcpf", {**settings, "fusion.trackers": ["ekf"]}))


def test_the_list_of_sensors_names_them_with_their_options(trackfield: Call) -> None:
    said = " ".join(trackfield("list", "sensors").out.split())
    for name, words in (
        ("range", "a device that measures the distance to the target"),
        ("rss", "a receiver that measures how strong the target's signal is"),
        ("energy", "a microphone that measures the energy of sound"),
    ):
        assert words in said
        assert all(one.name in said for one in fields(SENSORS[name]))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("kind", "trackers"),
    [("doa", "imm-ukf, spcpf"), ("range", "imm-ukf, spcpf"), ("rss", "imm-ukf, spcpf"), ("energy", "imm-ukf")],
)
def test_a_scenario_of_another_kind_keeps_the_trackers_that_can_use_it(
    trackfield: Call, kind: str, trackers: str
) -> None:
    said = trackfield("validate", "bus", "--set", f"sensor.kind={kind}")
    assert said.code == 0
    assert f"seed 1, trackers {trackers}\n" in said.err + said.out


def test_with_none_that_can_the_default_tracker_runs(trackfield: Call, tmp_path: FilePath) -> None:
    (tmp_path / "mine.toml").write_text(
        'name = "mine"\n[target]\npath = "s1"\n[fusion]\ntrackers = ["spcpf", "fix-doa"]\n'
    )
    said = trackfield("validate", "mine.toml", "--set", "sensor.kind=energy")
    assert said.code == 0 and "trackers imm-ukf\n" in said.err + said.out
    for named in (("--tracker", "spcpf"), ("--set", "fusion.trackers=['spcpf']")):
        said = trackfield("validate", "mine.toml", "--set", "sensor.kind=energy", *named)
        assert said.code == 2 and "fusion.trackers: 'spcpf' takes" in said.err


# --- reports ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", OWN)
@given(value=st.floats(-1e15, 1e15))
def test_whatever_is_read_fits_into_a_report(name: str, value: float) -> None:
    kind = make_sensor(name, {})
    message = decode(encode(kind.reading((value,)).report(7)))
    assert kind.takes(message)
    low, high = {"range": (-1e5, 1e6), "rss": (-300.0, 100.0), "energy": (-1e12, 1e12)}[name]
    assert kind.values(message)[0] == pytest.approx(min(max(value, low), high), abs=0.006)


@pytest.mark.parametrize("name", OWN)
def test_a_longest_message_is_as_long_as_any(name: str) -> None:
    kind = make_sensor(name, {"range_m": 99_000.0})
    longest = len(encode(kind.longest()))
    for value in (-inf, -1e5, -300.0, 0.0, 99_000.0, 1e9, inf):
        if name != "range" or 0.0 <= value <= kind.range_m:
            assert len(encode(kind.reading((value,)).report(65535))) <= longest


@pytest.mark.parametrize(
    ("name", "says"), [("range", "range 40 m"), ("rss", "rss -88.06 dBm"), ("energy", "energy 44.366")]
)
def test_a_report_in_words(name: str, says: str) -> None:
    kind = make_sensor(name, {})
    exact = kind.h(np.array([0.0, 0.0, 0.0, 0.0, *(one.mean for one in kind.unknowns)]), np.array([[40.0, 0.0]]))[0]
    payload = encode(kind.reading(exact.tolist()).report(7))
    for sender in (kind, None):  # of a process that is none of the field, too
        said = describe(payload, sender)
        assert (said.text, said.step) == (says, 7)
        assert said.values == pytest.approx(exact, abs=0.006)


def test_reports_of_all_kinds_are_reports_for_whoever_counts_them() -> None:
    made = [*(make_sensor(name, {}) for name in SENSORS.own), make_sensor("cpa", {"variances": True})]
    assert set(REPORTS) == {kind_of_class(kind.message).name for kind in made} | {kind_of_class(Measurement).name}


def test_what_they_measure_in_words() -> None:
    assert make_sensor("range", {}).summary == "range (sd 1 m, or 0.02 m x distance as its variance)"
    assert make_sensor("range", {"growth_m": 0.0}).summary == "range (sd 1 m)"
    assert make_sensor("rss", {"shadow_sd_db": 6.0}).summary == "received signal strength (shadowing sd 6 dB)"
    assert make_sensor("energy", {}).summary == "received energy (noise 0.9298, calibration to 20 %)"
    assert make_sensor("cpa", {}).summary == "times of passes (sd 0.1 s), and strengths to 10 %"


@pytest.mark.parametrize("name", ["doa", *OWN])
def test_a_node_that_reports_loads_nothing_that_is_heavy(name: str) -> None:
    options = {"window_s": 1.0, "sound_m_s": 343.0} if name == "energy" else {"slow": 0.5} if name == "rss" else {}
    plain = sensor(name, **options).to_plain()
    code = f"""
import sys
from math import inf
import node.role, trackfield.drivers.spec
from trackfield.wire.codec import encode
from trackfield.world.faulty import with_faults
from trackfield.world.placed import Placed
sensor = Placed.from_plain({plain!r})
for kind in ("stuck", "babble"):
    encode(with_faults(sensor, [dict(kind=kind, from_ns=0)]).sample({10 * NS}).report(9))
print(len(encode(sensor.sample({10 * NS}).report(10))), *{{"numpy", "pydantic", "difflib"}} & sys.modules.keys())
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.stderr == ""
    assert 5 < int(done.stdout) < 16  # and no name of a module


# --- faults, in the units of each -------------------------------------------------------------------------------------


def fault(kind: str, **more: Any) -> dict[str, Any]:
    return {"kind": kind, "from_ns": 6 * NS, **more}


@pytest.mark.parametrize(("name", "by"), [("range", -35.5), ("rss", 6.25), ("energy", 120.0)])
def test_a_bias_is_in_metres_decibels_or_energy(name: str, by: float) -> None:
    biased = with_faults(sensor(name), [fault("bias", bias=(by,))])
    for t in (5, 7, 10, 12):
        true, read = sensor(name).sample(t * NS), biased.sample(t * NS)
        assert true is not None and read is not None
        assert read.values[0] == pytest.approx(true.values[0] + (by if t >= 6 else 0.0))
    assert with_faults(sensor(name), [fault("bias", bias=(by,))]).sample(20 * NS + 1) is None


@pytest.mark.parametrize(
    ("name", "key", "value"), [("range", "by", [-3.5]), ("rss", "bias_db", 6.0), ("energy", "by", [9.0])]
)
def test_a_bias_of_a_scenario_reaches_its_node(name: str, key: str, value: Any) -> None:
    faults = [{"kind": "bias", "nodes": ["n012"], "at_s": 2.0, key: value}]
    settings = {"sensor.kind": name, "fusion.trackers": ["ekf"], "target.steps": 5, "faults": faults}
    plan = planned(tf.Scenario.load("zhai-spcpf", settings))
    (process,) = (process for process in plan.processes if process.id == "n012")
    assert [one["bias"] for one in process.faults] == [(value if key == "bias_db" else value[0],)]


def test_a_bias_in_degrees_has_no_meaning_for_them() -> None:
    faults = [{"kind": "bias", "nodes": ["n012"], "at_s": 2.0, "bias_deg": 5.0}]
    for name in OWN:
        settings = {"sensor.kind": name, "fusion.trackers": ["ekf"], "faults": faults}
        with pytest.raises(tf.ScenarioError, match=rf"bias_deg: has no meaning for sensors of kind '{name}'"):
            planned(tf.Scenario.load("zhai-spcpf", settings))


@pytest.mark.parametrize("name", OWN)
def test_a_babbling_one_reads_of_targets_anywhere_within_range(name: str) -> None:
    """Distances and levels of all sizes, energies as of targets spread evenly over the disc."""
    babbles = with_faults(sensor(name), [{"kind": "babble", "from_ns": 0}])
    read = numbers([babbles.sample(t * NS) for t in range(2000)])
    assert len(set(read)) == 2000
    near, far = {"range": (0.0, 100.0), "rss": (-100.0, inf), "energy": (1e5 * 150.0**-2.0929, 1e5 * 2.0**-2.0929)}[
        name
    ]
    assert near <= min(read) and max(read) <= far
    away = {
        "range": read,
        "rss": [10.0 ** ((-40.0 - value) / 30.0) for value in read],
        "energy": [(1e5 / value) ** (1.0 / 2.0929) for value in read],
    }[name]
    mean, sd = (100.0, 35.4) if name == "energy" else (50.0, 28.9)
    assert fmean(away) == pytest.approx(mean, abs=4.5 * sd / 2000**0.5)


@pytest.mark.parametrize("name", OWN)
def test_one_that_is_stuck_repeats_itself_and_a_deaf_one_says_nothing(name: str) -> None:
    first = sensor(name).sample(6 * NS)
    stuck = with_faults(sensor(name), [fault("stuck")])
    assert {stuck.sample(t * NS) for t in range(6, 40)} == {first}
    silent = with_faults(sensor(name), [{"kind": "stuck", "from_ns": 30 * NS}])
    assert len({silent.sample(t * NS) for t in range(30, 40)}) == 1 and silent.sample(31 * NS) is not None
    deaf = with_faults(sensor(name), [fault("deaf")])
    assert [deaf.sample(t * NS) is None for t in (5, 6, 10)] == [False, True, True]


# --- what is drawn ----------------------------------------------------------------------------------------------------


def test_a_ring_has_the_distance_that_was_measured() -> None:
    assert make_sensor("range", {}).drawn((42.5,)) == 42.5


@pytest.mark.parametrize("shadow_sd_db", [2.0, 4.0, 6.0])
def test_a_ring_of_a_level_has_the_right_radius_in_the_mean(shadow_sd_db: float) -> None:
    """That of 30 m, over the shadowing; without the correction it would be too large by e^(s^2 / 2)."""
    kind = Kind("rss", Rss(shadow_sd_db=shadow_sd_db))
    nodes, weights = np.polynomial.hermite_e.hermegauss(40)
    levels = -40.0 - 30.0 * np.log10(30.0) + shadow_sd_db * nodes
    radii = [kind.drawn((level,)) for level in levels]
    assert np.average(radii, weights=weights) == pytest.approx(30.0, rel=1e-9)
    s = shadow_sd_db * log(10.0) / 30.0
    assert kind.drawn((-40.0 - 30.0 * np.log10(30.0),)) == pytest.approx(30.0 * exp(-(s**2) / 2.0))


def test_a_disc_grows_with_the_energy_from_the_noise_to_the_loudest() -> None:
    kind = Kind("energy", Energy())
    loudest = 1e5 * 2.0**-2.0929
    sizes = [kind.drawn((energy,)) for energy in (-5.0, 0.0, 0.9298, 5.0, 50.0, 5000.0, loudest, 2.0 * loudest)]
    assert sizes[:3] == [0.0, 0.0, 0.0] and sizes[-2:] == [1.0, 1.0]
    assert sizes[2:-1] == sorted(set(sizes[2:-1]))


def test_kinds_are_registered_by_their_names() -> None:
    assert {name: SENSORS[name] for name in OWN} == {"range": Range, "rss": Rss, "energy": Energy}
