"""Recordings as sources and as what a microphone hears, and the files that they come from."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import soundfile

from tests.sounds import heard, passing, read, straight
from trackfield.acoustics.fitting import smoothed
from trackfield.acoustics.listener import Listener
from trackfield.acoustics.microphone import Microphone
from trackfield.acoustics.recordings import FULL_SCALE, Looped, Playback, dried, recorded
from trackfield.acoustics.signals import RATE
from trackfield.acoustics.sources import engine
from trackfield.filters.types import Array

DataFile = Callable[[str], Path]


def as_file(samples: Array) -> np.ndarray[tuple[int], np.dtype[np.int16]]:
    return np.rint(0.5 * samples / np.abs(samples).max() * FULL_SCALE).astype(np.int16)


@pytest.fixture(scope="module")
def near() -> Array:
    """A pass at 4 m and 13.4 m/s, loud above the noise."""
    return passing(3, 4.0, 13.4, 25.0, peak_s=6.0)[0]


def test_a_pass_is_made_into_what_the_source_emits(near: Array) -> None:
    dry = dried(near)
    assert dry.passed is not None
    assert dry.passed.peak_s == pytest.approx(6.0, abs=0.05)
    assert dry.mach == pytest.approx(13.4 / 340.0, abs=0.0101)
    assert len(dry.samples) > 2 * RATE
    levels = 10.0 * np.log10(smoothed(np.square(dry.samples), RATE))
    assert np.abs(levels).max() < 1.0


def test_a_recording_without_a_pass_is_left_as_it_is() -> None:
    samples = engine(1, "a").samples(0, 5 * RATE)
    dry = dried(samples)
    assert (dry.passed, dry.mach) == (None, None)
    assert dry.samples == pytest.approx(samples / np.sqrt(np.square(samples).mean()))


@pytest.mark.parametrize("samples", [np.zeros(5 * RATE), np.ones(100), np.zeros(0)], ids=["silent", "short", "empty"])
def test_what_is_no_sound_is_no_source(samples: Array) -> None:
    with pytest.raises(ValueError, match="s of it can be used"):
        dried(samples)


def test_the_speed_of_a_real_car_is_not_guessed(data_file: DataFile) -> None:
    """The noise of its tyres has no lines that would tell it: spectra agree at one speed no better than by chance."""
    assert dried(read(data_file("car_28mph.wav"))).mach is None


@pytest.mark.parametrize("distance_m", [5.0, 20.0])
def test_a_vehicle_that_sounds_like_a_recording_is_heard_to_pass(data_file: DataFile, distance_m: float) -> None:
    sound = recorded(as_file(read(data_file("car_28mph.wav"))))
    there = Microphone([straight(distance_m, 12.5, 10.0)], (0.0, 0.0), [sound], seed=1, id="n", snr_at_m=distance_m)
    (one,) = Listener().feed(heard(there, 20.0))
    width_s = distance_m / 12.5
    assert one.peak_s - distance_m / 340.0 == pytest.approx(10.0, abs=0.1 * width_s)
    assert one.width_s == pytest.approx(width_s, rel=0.15)
    assert one.strength_db == pytest.approx(-20.0 * np.log10(distance_m), abs=1.0)


def test_a_loop_has_no_seam() -> None:
    """A tone and its copy at another phase: between them it is never louder, and steps no farther, than both."""
    tone = np.sin(2.0 * np.pi * 100.3 / RATE * np.arange(3 * RATE))
    loop = Looped(tone)
    around = loop.samples(-RATE, 8 * RATE)
    assert np.abs(np.diff(around)).max() < 1.5 * np.abs(np.diff(tone)).max()
    assert np.array_equal(around[RATE:], loop.samples(0, 7 * RATE))
    period = 3 * RATE - RATE // 4
    assert np.array_equal(loop.samples(5, 100), loop.samples(5 + 7 * period, 100))


def test_a_playback_is_the_recording_at_its_time() -> None:
    samples = as_file(np.random.default_rng(1).standard_normal(5_000))
    played = Playback(samples, start_ns=2 * 10**9)
    pieces = list(played.blocks(10**9, 4 * 10**9))
    whole = np.concatenate([piece for _, piece in pieces])
    assert pieces[0][0] == 10**9
    assert max(len(piece) for _, piece in pieces) <= 1_000
    assert np.array_equal(whole, np.concatenate((np.zeros(RATE), samples / FULL_SCALE, np.zeros(2 * RATE - 5_000))))


@pytest.mark.parametrize("rate", [8_000, 11_025, 44_100, 96_000])
def test_files_of_other_rates_are_the_same_sound(tmp_path: Path, rate: int) -> None:
    t_s = np.arange(3 * rate) / rate
    soundfile.write(tmp_path / "a.wav", 0.5 * np.sin(2.0 * np.pi * 440.0 * t_s), rate, subtype="FLOAT")
    samples = read(tmp_path / "a.wav")
    exact = 0.5 * np.sin(2.0 * np.pi * 440.0 * np.arange(3 * RATE) / RATE)
    assert abs(len(samples) - 3 * RATE) <= 1
    assert np.abs(samples[400:-400] - exact[400 : len(samples) - 400]).max() < 1e-3


def test_channels_are_averaged(tmp_path: Path) -> None:
    samples = np.random.default_rng(1).uniform(-0.5, 0.5, (3 * RATE, 2))
    soundfile.write(tmp_path / "a.wav", samples, RATE, subtype="DOUBLE")
    assert read(tmp_path / "a.wav") == pytest.approx(samples.mean(axis=1), abs=1e-3)
