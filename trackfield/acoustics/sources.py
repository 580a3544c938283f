"""What a vehicle emits: harmonics of its engine, and the noise of its tyres."""

from __future__ import annotations

import math
from functools import partial
from typing import Final

import numpy as np

from trackfield.acoustics.signals import BLOCK, RATE, Blocks, Sound, smooth_noise, white
from trackfield.draw import uniform
from trackfield.filters.types import Array

_FIRING_HZ: Final = (65.0, 95.0)
"""The rate of ignitions: four cylinders at 1,950 to 2,850 revolutions a minute."""
_HARMONICS: Final = 12
_ENGINE_SHARE: Final = 0.3
"""Of the power above 100 Hz; at 30 km/h and more the tyres are most of what a car is heard by."""
_WANDER_CYCLES: Final = 0.3
_WANDER_STEP: Final = RATE // 2
_SWELL: Final = 0.05
"""The relative standard deviation of a harmonic's amplitude, which changes within a second."""
_TYRES_HZ: Final = 900.0
_TAPS: Final = 129


def engine(seed: int, target_id: str) -> Sound:
    """The dry sound of a vehicle: power 1 above 100 Hz, whatever its speed.

    30 % of that are harmonics of the engine's ignitions, of amplitude 1/k, whose pitch and amplitudes wander slowly;
    the rest is the noise of the tyres, a hump an octave and a half wide around 900 Hz.
    """
    return Blocks(partial(_vehicle, seed, target_id))


def _vehicle(seed: int, target_id: str, block: int) -> Array:
    engine_part, tyre_part = _harmonics(seed, target_id, block), _tyres(seed, target_id, block)
    return math.sqrt(_ENGINE_SHARE) * engine_part + math.sqrt(1.0 - _ENGINE_SHARE) * tyre_part


def _harmonics(seed: int, target_id: str, block: int) -> Array:
    """(BLOCK,) of power 1 above 100 Hz."""
    key = ("engine", target_id)
    low, high = _FIRING_HZ
    base_hz = low + (high - low) * uniform(seed, *key, "rate")
    first = block * BLOCK
    cycles = base_hz / RATE * np.arange(first, first + BLOCK)
    cycles = cycles + _WANDER_CYCLES * smooth_noise(first, _WANDER_STEP, seed, *key, "wander")[:, 0]
    swells = 1.0 + _SWELL * smooth_noise(first, _WANDER_STEP, seed, *key, "swells", columns=_HARMONICS)
    turned = np.exp(2j * np.pi * np.mod(cycles, 1.0))
    turning, total, power = np.ones(BLOCK, complex), np.zeros(BLOCK), 0.0
    for k in range(1, _HARMONICS + 1):
        turning = turning * turned
        phase = np.exp(2j * np.pi * uniform(seed, *key, "phase", k))
        total += swells[:, k - 1] * (turning * phase).real / k
        power += (1.0 + _SWELL**2) / (2.0 * k * k) if k * base_hz > 100.0 else 0.0
    return total / math.sqrt(power)


def _tyres(seed: int, target_id: str, block: int) -> Array:
    """(BLOCK,) of power 1."""
    before, now = (white(BLOCK, number, seed, "tyres", target_id) for number in (block - 1, block))
    return np.convolve(np.concatenate((before[BLOCK - _TAPS + 1 :], now)), _HUMP, mode="valid")


def _hump() -> Array:
    """(taps,) a filter whose response falls from 900 Hz as a normal curve over the octaves."""
    hz = np.fft.rfftfreq(1_024, 1.0 / RATE)
    octaves = np.log2(np.maximum(hz, 1.0) / _TYRES_HZ)
    response = np.roll(np.fft.irfft(np.exp(-0.5 * (octaves / 0.75) ** 2)), _TAPS // 2)[:_TAPS] * np.hanning(_TAPS)
    return np.asarray(response / np.sqrt(np.square(response).sum()))


_HUMP: Final = _hump()
