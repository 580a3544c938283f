"""What a microphone hears of a moving source, against the exact answer."""

from __future__ import annotations

import hashlib
import subprocess
import sys
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.sounds import heard, microphone, straight
from trackfield.acoustics.courses import Course
from trackfield.acoustics.microphone import Microphone
from trackfield.acoustics.signals import BLOCK, RATE, SAMPLE_NS, Sound, smooth_noise
from trackfield.acoustics.sources import engine
from trackfield.filters.types import Array
from trackfield.world.path import Path
from trackfield.world.scene import left_at

C = 340.0
QUIET = 300.0  # dB: no noise that a double holds


class Constant:
    """1, always: what is heard of it is the factor by which sound gets weaker."""

    def samples(self, first: int, count: int) -> Array:
        return np.ones(count)


class Tone:
    """A sine of 440 Hz."""

    def samples(self, first: int, count: int) -> Array:
        return np.sin(2.0 * np.pi * 440.0 / RATE * np.arange(first, first + count))


def quiet(path: Path, sound: Sound, **options: float) -> Microphone:
    return Microphone([path], (0.0, 0.0), [sound], seed=1, id="n", snr_db=QUIET, sound_m_s=C, **options)


def times(samples: Array) -> Array:
    return np.arange(len(samples)) / RATE


@given(st.lists(st.integers(0, 3 * RATE), min_size=0, max_size=6), st.integers(0, 10**9))
@settings(max_examples=20)
def test_each_sample_is_the_same_in_whatever_pieces(cuts: list[int], from_ns: int) -> None:
    whole = heard(microphone(straight(10.0, 20.0, 2.0)), 4.0)
    edges = [from_ns, *(from_ns + cut * SAMPLE_NS for cut in sorted(cuts)), 4 * 10**9]
    edges = [min(edge, edges[-1]) for edge in edges]
    fresh = microphone(straight(10.0, 20.0, 2.0))
    pieces = [piece for begin, end in pairwise(edges) for piece in fresh.blocks(begin, end)]
    first = -(-from_ns // SAMPLE_NS)
    assert np.array_equal(np.concatenate([samples for _, samples in pieces]), whole[first:])
    assert [at_ns for at_ns, _ in pieces] == [
        (first + done) * SAMPLE_NS for done in np.cumsum([0, *(len(samples) for _, samples in pieces[:-1])])
    ]
    assert max(len(samples) for _, samples in pieces) <= BLOCK


def test_another_process_hears_the_same() -> None:
    code = (
        "import hashlib; from tests.sounds import heard, microphone, straight;"
        "print(hashlib.sha256(heard(microphone(straight(10.0, 20.0, 2.0)), 3.0, 1.0).tobytes()).hexdigest())"
    )
    there = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.strip()
    here = heard(microphone(straight(10.0, 20.0, 2.0)), 3.0, 1.0)
    assert there == hashlib.sha256(here.tobytes()).hexdigest()


def test_what_arrives_left_when_the_exact_answer_says() -> None:
    knots = [(0.0, -50.0, 5.0, 20.0, 0.0), (2.0, -12.0, 9.0, 15.0, 5.0), (2.0, -12.0, 9.0, 0.0, -8.0)]
    path = Path.of([*knots, (5.0, 10.0, -6.0, 12.0, 3.0), (8.0, 60.0, 4.0, 30.0, 0.0)])
    t_s = np.linspace(-0.5, 8.8, 700)
    came = Course(path).heard(t_s, (3.0, -2.0), C)
    exact = np.array([left_at(path, float(t), (3.0, -2.0), C) for t in t_s])
    assert came.there.tolist() == [0.0 < left < 8.0 for left in exact]
    assert np.abs(came.left_s - exact)[came.there].max() < 3e-9
    states = [path.at(float(left)) for left in exact[came.there]]
    away = np.array([np.hypot(state[0] - 3.0, state[1] + 2.0) for state in states if state is not None])
    assert came.distance_m[came.there] == pytest.approx(away, abs=1e-6)


def test_of_a_stretch_that_was_cut_away_nothing_is_heard() -> None:
    path = Path.of([(float(t), 10.0 * t, 1.0, 10.0, 0.0) for t in range(11)]).cut([(1.0, 3.0), (6.0, 8.0)])
    assert path.missing
    samples = heard(quiet(path, Constant()), 12.0)
    sounding = times(samples)[samples > 1e-6]
    left = np.array([left_at(path, float(t), (0.0, 0.0), C) for t in sounding])
    assert all(path.at(float(one)) is not None for one in left)
    assert len(sounding) / RATE == pytest.approx(8.0 + 2.0 * 4.0 * 10.0 / C, abs=0.01)  # eight seconds, going away
    assert not ((left > 4.001) & (left < 4.999)).any()


def test_a_source_at_rest_is_heard_later_and_weaker() -> None:
    resting = Path.of([(-10.0, 34.0, 0.0, 0.0, 0.0), (20.0, 34.0, 0.0, 0.0, 0.0)])
    samples = heard(quiet(resting, Tone()), 1.0)
    exact = np.sin(2.0 * np.pi * 440.0 * (times(samples) - 0.1)) / 34.0
    assert np.abs(samples - exact).max() < 0.01 / 34.0


def test_a_source_in_motion_is_heard_by_its_own_clock() -> None:
    """t = t' + sqrt(d^2 + (v (t' - t0))^2) / c, solved for t'."""
    d, v, t0 = 10.0, 30.0, 2.0
    samples = heard(quiet(straight(d, v, t0), Tone()), 3.9, 0.6)
    t = times(samples) + 0.6
    s = t - t0
    left = (s - np.sqrt(s**2 - (1.0 - (v / C) ** 2) * (s**2 - (d / C) ** 2))) / (1.0 - (v / C) ** 2)
    exact = np.sin(2.0 * np.pi * 440.0 * (left + t0)) / np.hypot(d, v * left)
    assert np.abs(samples - exact).max() < 0.01 / d


@pytest.mark.parametrize("power", [0, 1, 2])
def test_convection_makes_the_peak_earlier(power: int) -> None:
    """By d/c for each unit of its exponent; without it, it is heard d/c after the closest point of approach."""
    samples = heard(quiet(straight(20.0, 15.0, 3.0), Constant(), convection=float(power)), 6.0)
    assert np.argmax(samples) / RATE - 3.0 == pytest.approx((1 - power) * 20.0 / C, abs=0.003)


def test_sources_add_up_and_none_grows_without_bound() -> None:
    near, far = straight(0.0, 10.0, 2.0), straight(5.0, 20.0, 2.0)
    both = Microphone([near, far], (0.0, 0.0), [Constant(), Tone()], seed=1, id="n", snr_db=QUIET, sound_m_s=C)
    one, other = heard(quiet(near, Constant()), 3.0), heard(quiet(far, Tone()), 3.0)
    assert heard(both, 3.0) == pytest.approx(one + other, abs=1e-12)
    assert one.max() == pytest.approx(1.0, abs=1e-9)


def above_100_hz(samples: Array) -> float:
    power = np.square(np.abs(np.fft.rfft(samples * np.hanning(len(samples))))) / (0.375 * len(samples))
    return float(power[np.fft.rfftfreq(len(samples), 1.0 / RATE) > 100.0].sum() * 2.0 / len(samples))


@pytest.mark.parametrize("target", ["a", "b"])
def test_a_vehicle_has_power_one_above_100_hz(target: str) -> None:
    sound = engine(3, target)
    assert above_100_hz(sound.samples(5 * BLOCK + 7, 20 * RATE)) == pytest.approx(1.0, abs=0.1)
    assert np.array_equal(sound.samples(-300, 900)[:500], engine(3, target).samples(-300, 500))


def test_vehicles_differ_and_so_do_microphones() -> None:
    one, other = engine(3, "a").samples(0, 8 * RATE), engine(3, "b").samples(0, 8 * RATE)
    assert abs(np.corrcoef(one, other)[0, 1]) < 0.1
    path, sound = straight(500.0, 1.0, 4.0), engine(1, "a")
    here, there = (Microphone([path], (0.0, 0.0), [sound], seed=1, id=name) for name in ("n", "m"))
    assert abs(np.corrcoef(heard(here, 8.0), heard(there, 8.0))[0, 1]) < 0.1


def test_the_ambient_noise_is_as_far_below_a_vehicle_as_asked() -> None:
    nowhere = Path.of([(100.0, 0.0, 0.0, 1.0, 0.0), (101.0, 1.0, 0.0, 1.0, 0.0)])
    floor = Microphone([nowhere], (0.0, 0.0), [engine(1, "a")], seed=1, id="n", snr_db=10.0, snr_at_m=20.0, wind_db=6.0)
    samples = heard(floor, 20.0)
    # white noise has 95 % of its power above 100 Hz; the wind adds less than a tenth there
    assert 10.0 * np.log10(1.0 / 20.0**2 / above_100_hz(samples)) == pytest.approx(10.0, abs=0.5)
    assert np.square(samples).mean() > 2.0 * above_100_hz(samples)


def test_smooth_noise_has_variance_one_and_is_slow() -> None:
    noise = np.concatenate([smooth_noise(block * BLOCK, 40, 1, "x", columns=2) for block in range(-100, 100)])
    assert noise.var(axis=0) == pytest.approx([1.0, 1.0], abs=0.1)
    spectrum = np.square(np.abs(np.fft.rfft(noise[:, 0])))
    hz = np.fft.rfftfreq(len(noise), 1.0 / RATE)
    assert spectrum[hz > 100.0].sum() < 0.001 * spectrum.sum()
    assert np.abs(np.diff(noise, axis=0)).max() < 0.3  # no step between blocks
