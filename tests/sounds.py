"""Recordings that are drawn from seeds: of passes, and of what is none."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path as FilePath
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.random import Generator
from scipy.signal import lfilter

from trackfield.acoustics.files import blocks
from trackfield.acoustics.microphone import Microphone
from trackfield.acoustics.signals import RATE
from trackfield.acoustics.sources import engine
from trackfield.filters.rng import generator
from trackfield.filters.types import Array
from trackfield.world.path import Path

SOUND_M_S: Final = 340.0
AMBIENT: Final = 0.01
SECONDS: Final = 40


def straight(distance_m: float, speed_m_s: float, peak_s: float) -> Path:
    """Past the origin, nearest at ``peak_s``; as long before as after that."""
    far = peak_s * speed_m_s
    return Path.of([(0.0, -far, distance_m, speed_m_s, 0.0), (2.0 * peak_s, far, distance_m, speed_m_s, 0.0)])


def microphone(path: Path, seed: int = 1, **options: float) -> Microphone:
    """At the origin, of a vehicle on this path."""
    return Microphone([path], (0.0, 0.0), [engine(seed, "a")], seed=seed, id="n", sound_m_s=SOUND_M_S, **options)


def heard(microphone: Microphone, seconds: float, from_s: float = 0.0) -> Array:
    """What it hears, in one piece."""
    return np.concatenate([piece for _, piece in microphone.blocks(round(from_s * 1e9), round(seconds * 1e9))])


def passing(seed: int, distance_m: float, speed_m_s: float, snr_db: float, peak_s: float = 8.0) -> tuple[Array, float]:
    """A pass with ``snr_db`` at its distance, twice ``peak_s`` long, and when it is loudest."""
    listening = microphone(straight(distance_m, speed_m_s, peak_s), seed, snr_db=snr_db, snr_at_m=distance_m)
    return heard(listening, 2.0 * peak_s), peak_s + distance_m / SOUND_M_S


def read(file: FilePath) -> Array:
    """A sound file in one piece."""
    return np.concatenate(list(blocks(file)))


# --- what is no pass --------------------------------------------------------------------------------------------------


def silence(rng: Generator) -> Array:
    """Nothing at all."""
    return np.zeros(SECONDS * RATE)


def ambient(rng: Generator) -> Array:
    """Noise of one power."""
    return AMBIENT * rng.standard_normal(SECONDS * RATE)


def _slow(rng: Generator, seconds: float) -> Array:
    """Noise of variance 1 that changes within so long."""
    keep = np.exp(-1.0 / (seconds * RATE))
    noise = lfilter([1.0], [1.0, -keep], rng.standard_normal(SECONDS * RATE))
    return np.asarray(noise / noise.std())


def wind(rng: Generator) -> Array:
    """Rumble twenty decibels above the ambient noise, in gusts."""
    return ambient(rng) + 10.0 * AMBIENT * _slow(rng, 0.003) * np.exp(0.8 * _slow(rng, 0.7))


def storm(rng: Generator) -> Array:
    """Gusts that whistle at all frequencies, twice the ambient noise in the mean."""
    whistle = AMBIENT * 2.0 * rng.standard_normal(SECONDS * RATE)
    return ambient(rng) + whistle * np.exp(0.6 * _slow(rng, 0.5))


def talk(rng: Generator) -> Array:
    """Phrases of voiced syllables."""
    sound, at_s = ambient(rng), 0.5
    while at_s < SECONDS - 3.0:
        for _ in range(rng.integers(3, 12)):
            length_s = rng.uniform(0.08, 0.3)
            t_s = np.arange(round(length_s * RATE)) / RATE
            pitch_hz = rng.uniform(90.0, 220.0)
            voice = sum(np.sin(2.0 * np.pi * pitch_hz * k * t_s + rng.uniform(0.0, 6.0)) / k for k in range(1, 9))
            first = round(at_s * RATE)
            here = sound[first : first + len(t_s)]
            here += (0.1 * rng.uniform(0.3, 1.0) * np.hanning(len(t_s)) * voice)[: len(here)]
            at_s += length_s + rng.uniform(0.0, 0.1)
        at_s += rng.uniform(0.3, 1.5)
    return sound


def slams(rng: Generator) -> Array:
    """Doors: at once loud, and gone within half a second."""
    sound = ambient(rng)
    for at_s in np.cumsum(rng.uniform(2.0, 6.0, 12)):
        here = sound[round(at_s * RATE) :][: 2 * RATE]
        fading = np.exp(-np.arange(len(here)) / RATE / rng.uniform(0.03, 0.4))
        here += rng.uniform(0.1, 1.0) * fading * rng.standard_normal(len(here))
    return sound


def _cut(rng: Generator) -> tuple[Array, int, int, float]:
    """A pass, the number of the sample at its peak, up to a width and a half in samples, and the ambient noise."""
    distance_m, speed_m_s = rng.uniform(3.0, 25.0), rng.uniform(8.0, 25.0)
    sound, peak_s = passing(int(rng.integers(1_000_000)), distance_m, speed_m_s, 10.0)
    away = round(rng.uniform(0.2, 1.5) * distance_m / speed_m_s * RATE)
    return sound, round(peak_s * RATE), away, 10.0 ** (-10.0 / 20.0) / distance_m


def ends_before(rng: Generator) -> Array:
    """A pass whose recording ends before its peak."""
    sound, peak, away, _ = _cut(rng)
    return sound[: peak - away]


def ends_soon(rng: Generator) -> Array:
    """A pass of which less than a second after its peak is recorded."""
    sound, peak, _, _ = _cut(rng)
    return sound[: peak + round(rng.uniform(0.05, 0.85) * RATE)]


def starts_after(rng: Generator) -> Array:
    """A pass whose recording starts after its peak."""
    sound, peak, away, _ = _cut(rng)
    return sound[peak + away :]


def stops(rng: Generator) -> Array:
    """A vehicle that comes near and is switched off before it passes."""
    sound, peak, away, noise = _cut(rng)
    quiet = sound.copy()
    quiet[peak - away :] = noise * rng.standard_normal(len(sound) - peak + away)
    return quiet


NO_PASS: Final[Mapping[str, Callable[[Generator], Array]]] = MappingProxyType(
    {
        made.__name__: made
        for made in (silence, ambient, wind, storm, talk, slams, ends_before, ends_soon, starts_after, stops)
    }
)


def no_pass(name: str, seed: int) -> Array:
    """One of these, drawn from its seed."""
    return NO_PASS[name](generator(seed, "no pass", name))
