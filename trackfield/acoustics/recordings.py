"""Recordings as sounds: a vehicle's pass made into what the vehicle emits; what a microphone recorded, played again."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from trackfield.acoustics.fitting import BIN_S, Curve, smoothed
from trackfield.acoustics.listener import Detection, Listener
from trackfield.acoustics.signals import BLOCK, RATE, SAMPLE_NS, Sound
from trackfield.filters.types import Array

FULL_SCALE: Final = 32_768.0
_ABOVE: Final = 4.0
"""Of a pass, what is used is where it is so many times as powerful as the noise."""
_FADE_S: Final = 0.25
_SHORTEST_S: Final = 1.0
_EVEN_S: Final = 0.5
_MACHS: Final = np.arange(-0.04, 0.1201, 0.0025)
"""Of a source; those below 0 cannot be, and show what chance comes to."""
_TELLING: Final = 0.6
"""The least correlation of the spectra before and after the peak that tells the source's speed."""
_SPECTRUM: Final = 512


class Dried(NamedTuple):
    """What a source emitted: ``samples`` (n,) of power 1.

    ``passed`` is the pass that was undone, if the recording held one; ``mach`` the speed, over that of sound, of which
    the Doppler effect was undone: None where the spectra did not tell it, and the effect is still in the samples.
    """

    samples: Array
    passed: Detection | None
    mach: float | None


class Looped:
    """A recording as a source: it begins again at its end, where a quarter of a second of both are mixed."""

    def __init__(self, samples: Array) -> None:
        fade = min(round(_FADE_S * RATE), len(samples) // 2)
        rising = np.sin(np.linspace(0.0, math.pi / 2.0, fade, endpoint=False))
        falling = np.cos(np.linspace(0.0, math.pi / 2.0, fade, endpoint=False))
        self._loop = samples[: len(samples) - fade].copy()
        self._loop[:fade] = rising * samples[:fade] + falling * samples[len(samples) - fade :]

    def samples(self, first: int, count: int) -> Array:
        """(count,) the samples from this number on."""
        return self._loop[(first + np.arange(count)) % len(self._loop)]


class Playback:
    """A microphone that plays what a real one recorded: ``samples`` of 16 bits at ``RATE`` from ``start_ns`` on."""

    def __init__(self, samples: npt.NDArray[np.int16], start_ns: int) -> None:
        self._samples, self._first = samples, -(-start_ns // SAMPLE_NS)

    def blocks(self, from_ns: int, until_ns: int) -> Iterator[tuple[int, Array]]:
        """As ``Microphone.blocks``; silence where there is no recording."""
        first, end = -(-from_ns // SAMPLE_NS), -(-until_ns // SAMPLE_NS)
        for begin in range(first, end, BLOCK):
            numbers = np.arange(begin, min(begin + BLOCK, end)) - self._first
            there = (numbers >= 0) & (numbers < len(self._samples))
            played = np.zeros(len(numbers))
            played[there] = self._samples[numbers[there]] / FULL_SCALE
            yield begin * SAMPLE_NS, played


def recorded(samples: npt.NDArray[np.int16]) -> Sound:
    """A recording of 16 bits at ``RATE`` as the dry sound of a source of power 1, without an end; see ``dried``."""
    return Looped(dried(samples / FULL_SCALE).samples)


def dried(samples: Array) -> Dried:
    """What the source emitted that a recording (n,) at ``RATE`` is of.

    If the recording is of one pass, the part where that is well above the noise, its power made constant (what is left
    of its changes within half a second, too: they would be heard as passes of their own); if spectra before and after
    the peak agree at one speed alone, the Doppler effect is undone, too. A recording without a pass is as the source
    emitted it. Raises ``ValueError`` if it is silent, or too short to be heard as a sound.
    """
    passed = max(Listener().feed(samples), key=lambda one: one.strength_db, default=None)
    mach = None
    if passed is not None:
        curve = _curve(samples, passed)
        mach = _mach(samples, curve)
        samples = _even(_undone(samples, curve, mach or 0.0))
    power = float(np.square(samples).mean()) if len(samples) else 0.0
    if len(samples) < _SHORTEST_S * RATE or not power > 0.0:
        raise ValueError(f"{len(samples) / RATE:.2f} s of it can be used, of power {power:g}")
    return Dried(samples / math.sqrt(power), passed, mach)


def _curve(samples: Array, passed: Detection) -> Curve:
    """The pass, with the noise beside it: of what its energies exceed the curve by, the median."""
    curve = Curve(passed.peak_s, passed.width_s, 10.0 ** (passed.strength_db / 10.0), 0.0)
    energies = smoothed(np.square(samples), round(BIN_S * RATE))
    over = energies - curve.at((np.arange(len(energies)) + BIN_S * RATE / 2.0) / RATE)
    return curve._replace(floor=max(float(np.median(over)), 0.0))


def _undone(samples: Array, curve: Curve, mach: float) -> Array:
    """(n,) the samples by the clock of the source, of even power, where the pass is above the noise.

    What leaves the source s seconds after the closest point of approach is heard M (sqrt(w^2 + s^2) - w) later than
    if it had been there.
    """
    last_s = len(samples) / RATE
    reach_s = curve.width_s * math.sqrt(max(curve.power / max(_ABOVE * curve.floor, 1e-30) - 1.0, 0.0))
    s = np.arange(-min(reach_s, 2.0 * last_s), min(reach_s, 2.0 * last_s), 1.0 / RATE)
    at_s = curve.peak_s + s + mach * (np.hypot(curve.width_s, s) - curve.width_s)
    inside = (at_s > _FADE_S) & (at_s < last_s - _FADE_S)
    s, at_s = s[inside], at_s[inside]
    heard = np.interp(at_s * RATE, np.arange(len(samples)), samples)
    return np.asarray(heard / np.sqrt(curve.at(curve.peak_s + s) + curve.floor))


def _even(samples: Array) -> Array:
    """(n,) the samples over the root of their mean square over half a second."""
    around = round(_EVEN_S * RATE / 2.0)
    energy = np.cumsum(np.concatenate(([0.0], np.square(samples))))
    here = np.arange(len(samples))
    low, high = np.maximum(here - around, 0), np.minimum(here + around, len(samples))
    return np.asarray(samples / np.sqrt(np.maximum((energy[high] - energy[low]) / (high - low), 1e-30)))


def _mach(samples: Array, curve: Curve) -> float | None:
    """The speed, over that of sound, at which the spectra before and after the peak agree; None if none stands out."""
    agreeing = [_agreement(_undone(samples, curve, float(mach)), curve.width_s) for mach in _MACHS]
    best = int(np.argmax(agreeing))
    return float(_MACHS[best]) if agreeing[best] > _TELLING and _MACHS[best] > 0.0 else None


def _agreement(samples: Array, width_s: float) -> float:
    """The correlation of the logarithms of both halves' spectra, each less a polynomial: of their lines."""
    middle, apart = len(samples) // 2, round(0.3 * width_s * RATE)
    halves = samples[: middle - apart], samples[middle + apart :]
    if min(map(len, halves)) < 2 * _SPECTRUM:
        return 0.0
    one, other = (_lines(half) for half in halves)
    return float(np.corrcoef(one, other)[0, 1])


def _lines(samples: Array) -> Array:
    """What is left of a spectrum in dB between 100 Hz and 1.7 kHz when a polynomial of degree 6 is taken away."""
    window = np.hanning(_SPECTRUM)
    pieces = np.lib.stride_tricks.sliding_window_view(samples, _SPECTRUM)[:: _SPECTRUM // 2]
    power = np.square(np.abs(np.fft.rfft(pieces * window))).mean(axis=0)
    hz = np.fft.rfftfreq(_SPECTRUM, 1.0 / RATE)
    band = (hz > 100.0) & (hz < 1_700.0)
    level = 10.0 * np.log10(np.maximum(power[band], 1e-30))
    place = np.linspace(-1.0, 1.0, len(level))
    return np.asarray(level - np.polyval(np.polyfit(place, level, 6), place))
