"""What a microphone hears: every source as it left it, weaker with the distance, and the noise of the place."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

from trackfield.acoustics.courses import Course
from trackfield.acoustics.signals import BLOCK, RATE, SAMPLE_NS, Sound, interpolated, smooth_noise, white
from trackfield.filters.types import Array

if TYPE_CHECKING:
    from trackfield.world.path import Path

NEAREST_M: Final = 1.0
"""No nearer than that does sound grow."""
_WIND_STEPS: Final = (80, 40, 20)
"""Eddies of wind, in samples: noise below about 17, 33 and 67 Hz."""
_GUST_STEP: Final = 2 * RATE
_GUST: Final = 0.5
"""The standard deviation of the logarithm of the wind's amplitude."""


class Microphone:
    """What a microphone at ``place`` (m) hears of targets on ``paths``, of which each emits one of the ``sounds``.

    A source of power 1 at 1 m is ``snr_db`` above the ambient noise at ``snr_at_m``; the noise is white. Wind is noise
    below 100 Hz, in gusts, in the mean ``wind_db`` above the ambient noise. A sound's amplitude falls as
    1 / (R (1 - M_r)^convection), where R is the distance it has come and M_r the Mach number at which the source
    approached; the exponent of a simple source in motion is 1 or 2, and with 0 the peak is heard when what left the
    closest point of approach arrives, d/c after that; each unit makes it earlier by d/c. ``seed``, ``id`` and
    ``incarnation`` are the key of the noise.
    """

    def __init__(
        self,
        paths: Sequence[Path],
        place: tuple[float, float],
        sounds: Sequence[Sound],
        *,
        seed: int,
        id: str,
        incarnation: int = 0,
        snr_db: float = 10.0,
        snr_at_m: float = 20.0,
        wind_db: float = 6.0,
        sound_m_s: float = 340.0,
        convection: float = 0.0,
    ) -> None:
        self._sources = [(Course(path), sound) for path, sound in zip(paths, sounds, strict=True)]
        self._place, self._seed, self._key = place, seed, (id, incarnation)
        self._ambient = 10.0 ** (-snr_db / 20.0) / snr_at_m
        self._wind = self._ambient * 10.0 ** (wind_db / 20.0)
        self._sound_m_s, self._convection = sound_m_s, convection

    def blocks(self, from_ns: int, until_ns: int) -> Iterator[tuple[int, Array]]:
        """What it hears from one true time until another (excluded): pieces of at most a quarter of a second.

        Each is the time of its first sample and the samples, at ``RATE``, at whole multiples of ``SAMPLE_NS``.
        """
        first, end = -(-from_ns // SAMPLE_NS), -(-until_ns // SAMPLE_NS)
        while first < end:
            block = first // BLOCK
            last = min((block + 1) * BLOCK, end)
            yield first * SAMPLE_NS, self._block(block)[first - block * BLOCK : last - block * BLOCK]
            first = last

    def _block(self, number: int) -> Array:
        """(BLOCK,) all that it hears."""
        first = number * BLOCK
        heard: Array = self._ambient * white(BLOCK, number, self._seed, "ambient", *self._key) + self._gusts(first)
        t_s = np.arange(first, first + BLOCK) / RATE
        for course, sound in self._sources:
            heard += self._of(course, sound, t_s)
        return heard

    def _of(self, course: Course, sound: Sound, t_s: Array) -> Array:
        """(n,) what arrives of one source."""
        came = course.heard(t_s, self._place, self._sound_m_s)
        arrived = np.zeros(len(t_s))
        if came.there.any():
            left_s, away = came.left_s[came.there], np.maximum(came.distance_m[came.there], NEAREST_M)
            approach = (1.0 - came.closing_m_s[came.there] / self._sound_m_s) ** self._convection
            arrived[came.there] = interpolated(sound, left_s * RATE) / (away * approach)
        return arrived

    def _gusts(self, first: int) -> Array:
        """(BLOCK,) the wind: eddies, of power falling by 5/3 with their frequency, that gusts make louder."""
        key = ("wind", *self._key)
        powers = np.array([step ** (2.0 / 3.0) for step in _WIND_STEPS])  # of an octave: f^-5/3 times f
        eddies = sum(
            np.sqrt(power / powers.sum()) * smooth_noise(first, step, self._seed, *key, step)
            for power, step in zip(powers, _WIND_STEPS, strict=True)
        )
        gust = np.exp(_GUST * smooth_noise(first, _GUST_STEP, self._seed, *key, "gusts") - _GUST**2)
        return np.asarray(self._wind * gust * eddies)[:, 0]
