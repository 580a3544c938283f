"""Passes found in what a microphone hears, while it hears it: in bounded memory, with bounded work.

Samples are high-passed at 100 Hz and become energies of 20 ms. Ten times a second the listener looks whether a maximum
of their running mean is over: then the curve of a pass is fitted to the latest seconds, and if it is one, that is told
once a second of audio after the peak is heard.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Final, NamedTuple

import numpy as np

from trackfield.acoustics.fitting import BIN_S, Curve, Fit, fitted, smoothed
from trackfield.acoustics.signals import RATE
from trackfield.filters.types import Array

CUT_HZ: Final = 100.0
_LOOKS_A_SECOND: Final = 10
_TAPS_S: Final = 0.064
_MEMORY_S: Final = 30.0
"""Of so long the ambient floor is known."""
_FLOOR_SHARE: Final = 0.2
"""The floor is what so many of the running means are below: few of them need be without a pass."""
_WINDOW_S: Final = 8.0
"""The curve is fitted to so much, at most."""
_SHORT_S, _LONG_S = 0.26, 0.4
"""The running means that trigger, and those of the detector ``smooth``."""
_RECORDING_S: Final = 5.0
"""The recording of Yang et al., of which ``argmax`` takes the highest amplitude."""
_BEFORE_S: Final = 1.0
"""So much must have been heard before a peak."""
_LATEST_S: Final = 0.2
"""So much later than asked is a pass told at the latest."""
_LOUD: Final = 2.0
_SILENT: Final = 0.25
"""Less than that part of the ambient floor is no sound of the place, but the beginning or a gap of a recording."""
_GAIN: Final = 15.0
_WIDTHS_S: Final = (0.15, 6.0)
_RESIDUAL_DB: Final = 1.2
_EXPLAINED: Final = 0.9
_TIME_SD: Final = 0.1
"""In widths. Speech and what stands there are seldom fitted that well."""


_BEFORE_MAXIMUM_S, _AFTER_MAXIMUM_S = 2.0, 0.15
"""The highest running mean is looked for from so long before the time of a peak that would be told now, to so long ago:
that of a pass which is loud for long is seldom where the middle of its curve is."""
_FIRST_WIDTH_S: Final = 0.7
_TAILS: Final = 2
"""Of so many earlier passes, what is still heard is told from a new one."""


class Detection(NamedTuple):
    """A pass: when it is loudest, in seconds since the first sample, its strength in dB and its width d/v in seconds.

    The strength is the power at the peak, without the noise; 0 dB is a mean square of 1. ``time_sd_s`` and
    ``strength_sd_db`` are what the fit knows of its errors; ``confidence`` (0 to 1) is the share of the variance of the
    levels that the curve explains; ``known_s`` is how much had been heard when it was told.
    """

    peak_s: float
    strength_db: float
    width_s: float
    time_sd_s: float
    strength_sd_db: float
    confidence: float
    known_s: float


class Heard(NamedTuple):
    """The latest that was heard: times (n,) of the middles of the bins, mean squares, highest amplitudes and when."""

    t_s: Array
    energies: Array
    highest: Array
    highest_s: Array


def _by_argmax(heard: Heard, fit: Fit) -> float:
    """When the amplitude was highest in the last 5 s (Yang et al., section 5)."""
    last = round(_RECORDING_S / BIN_S)
    return float(heard.highest_s[-last:][np.argmax(heard.highest[-last:])])


def _by_smoothing(heard: Heard, fit: Fit) -> float:
    """When the mean square over 0.4 s was highest in the last 5 s."""
    last, bins = round(_RECORDING_S / BIN_S), round(_LONG_S / BIN_S)
    means = smoothed(heard.energies[-last:], bins)
    return float(heard.t_s[-last:][np.argmax(means)] + (bins - 1) / 2.0 * BIN_S)


def _by_fit(heard: Heard, fit: Fit) -> float:
    """The middle of the fitted curve."""
    return fit.curve.peak_s


DETECTORS: Final[Mapping[str, Callable[[Heard, Fit], float]]] = MappingProxyType(
    {"argmax": _by_argmax, "smooth": _by_smoothing, "fit": _by_fit}
)
"""By which name the time of a pass is found how; whether there was one, the trigger says, which they share."""
SPREAD: Final[Mapping[str, float]] = MappingProxyType({"argmax": 0.3, "smooth": 0.13})
"""The standard deviation of the detectors that know no better, in widths of the pass."""


class Listener:
    """Finds passes in samples that are fed to it piece by piece; the same ones whatever the pieces.

    ``rate`` is in samples a second, a multiple of 50. A pass is told once ``after_s`` of audio after its peak are
    heard, 0.2 s later at the latest.
    """

    def __init__(self, detector: str = "fit", rate: int = RATE, *, after_s: float = 1.0) -> None:
        if rate % (_LOOKS_A_SECOND * 5):
            raise ValueError(f"the rate {rate} Hz is no multiple of 50 Hz")
        self._time = DETECTORS[detector]
        self._spread = SPREAD.get(detector)
        self._rate, self._after_s = rate, after_s
        self._piece = rate // _LOOKS_A_SECOND
        self._taps = _high_pass(rate)
        self._waiting = np.zeros(0)
        self._tail = np.zeros(len(self._taps) - 1)
        self._pieces = 0
        self._heard = Heard(*(np.zeros(0) for _ in Heard._fields))
        self._passes: tuple[Curve, ...] = ()

    def feed(self, samples: Array) -> list[Detection]:
        """What is known of passes once these samples are heard, too."""
        waiting, found = np.concatenate((self._waiting, samples)), []
        whole = len(waiting) // self._piece * self._piece
        for first in range(0, whole, self._piece):
            self._hear(waiting[first : first + self._piece])
            found += self._look()
        self._waiting = waiting[whole:]
        return found

    @property
    def heard(self) -> Heard:
        """The latest 30 s."""
        return self._heard

    @property
    def passes(self) -> tuple[Curve, ...]:
        """The curves of the latest passes that were told, two at most."""
        return self._passes

    def _hear(self, piece: Array) -> None:
        """Take a tenth of a second."""
        whole = np.concatenate((self._tail, piece))
        self._tail = whole[len(piece) :]
        passed = np.convolve(whole, self._taps, mode="valid").reshape(-1, round(self._rate * BIN_S))
        away = np.abs(passed)
        # a sample comes out of the filter when the one half its length later is heard
        begun = self._pieces * self._piece / self._rate - (len(self._taps) - 1) / 2.0 / self._rate
        starts = begun + BIN_S * np.arange(len(passed))
        energies, highest_s = np.square(passed).mean(axis=1), starts + away.argmax(axis=1) / self._rate
        newer = (starts + BIN_S / 2.0, energies, away.max(axis=1), highest_s)
        most = round(_MEMORY_S / BIN_S)
        self._heard = Heard(*(np.concatenate((old, new))[-most:] for old, new in zip(self._heard, newer, strict=True)))
        self._pieces += 1

    def _look(self) -> list[Detection]:
        """The pass that can be told now, if there is one."""
        now_s = self._pieces / _LOOKS_A_SECOND
        first = self._maximum(now_s)
        if first is None:
            return []
        t_s, energies = (part[-round(_WINDOW_S / BIN_S) :] for part in self._heard[:2])
        sounds = energies > _SILENT * first.floor
        t_s, energies = t_s[sounds], energies[sounds]
        if len(t_s) < round(_BEFORE_S / BIN_S):
            return []
        known = np.zeros(len(t_s))
        for earlier in self._passes:
            known += earlier.at(t_s)
        fit = fitted(t_s, energies, known, first)
        if fit is None or not self._is_pass(fit, float(t_s[0]), now_s):
            return []
        self._passes = (*self._passes, fit.curve)[-_TAILS:]
        return [self._told(fit, now_s)]

    def _maximum(self, now_s: float) -> Curve | None:
        """Where the running mean was highest lately, if that is over, and loud: a first guess of a pass."""
        bins = round(_SHORT_S / BIN_S)
        means = smoothed(self._heard.energies, bins)
        sounding = means[means > 0.0]
        if len(sounding) < round(_BEFORE_S / BIN_S):
            return None
        floor = float(np.quantile(sounding, _FLOOR_SHARE))
        middles = self._heard.t_s[: len(means)] + (bins - 1) / 2.0 * BIN_S
        begin_s, end_s = now_s - self._after_s - _BEFORE_MAXIMUM_S, now_s - _AFTER_MAXIMUM_S
        first = int(np.searchsorted(middles, begin_s))
        at = first + int(np.argmax(means[first:]))
        at_s = float(middles[at])
        if means[at] <= _LOUD * (floor + self._tails(at_s)) or at == first or at_s > end_s:
            return None
        return Curve(at_s, _FIRST_WIDTH_S, float(means[at]), floor)

    def _tails(self, t_s: float) -> float:
        """The power of earlier passes at this time."""
        return sum(earlier.at(t_s) for earlier in self._passes)

    def _is_pass(self, fit: Fit, from_s: float, now_s: float) -> bool:
        """Whether the trigger's conditions hold for what was heard since ``from_s``, and this is when to tell of it."""
        curve, late_s = fit.curve, now_s - fit.curve.peak_s - self._after_s
        before = curve.floor + self._tails(curve.peak_s)
        return (
            0.0 <= late_s <= _LATEST_S
            and curve.peak_s - from_s >= _BEFORE_S
            and curve.power + before > _LOUD * before
            and fit.gain > _GAIN
            and _WIDTHS_S[0] < curve.width_s < _WIDTHS_S[1]
            and fit.residual_db < _RESIDUAL_DB
            and fit.explained > _EXPLAINED
            and fit.time_sd_s < _TIME_SD * curve.width_s
        )

    def _told(self, fit: Fit, now_s: float) -> Detection:
        curve = fit.curve
        return Detection(
            self._time(self._heard, fit),
            10.0 * math.log10(curve.power),
            curve.width_s,
            fit.time_sd_s if self._spread is None else self._spread * curve.width_s,
            10.0 / math.log(10.0) * fit.power_sd,
            fit.explained,
            now_s,
        )


def _high_pass(rate: int) -> Array:
    """The taps of a filter of linear phase that lets pass what is above 100 Hz: a sinc under a Hamming window."""
    half = round(_TAPS_S * rate / 2.0)
    k = np.arange(-half, half + 1)
    low = 2.0 * CUT_HZ / rate * np.sinc(2.0 * CUT_HZ / rate * k) * np.hamming(len(k))
    return np.asarray((k == 0) - low / low.sum())
