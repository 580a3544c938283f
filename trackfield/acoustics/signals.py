"""Pieces of waveforms that can be computed anywhere in time: the same samples, in whatever order and pieces.

A signal is cut into blocks of ``BLOCK`` samples, counted from emulated time 0. Each block is computed as a whole, from
draws keyed by its number.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Final, Protocol

import numpy as np

from trackfield.draw import Key
from trackfield.filters.rng import generator
from trackfield.filters.types import Array

RATE: Final = 4_000
"""Samples a second."""
SAMPLE_NS: Final = 1_000_000_000 // RATE
BLOCK: Final = 1_000
"""Samples of a block: 0.25 s."""
_KEPT: Final = 32


class Sound(Protocol):
    """What a source emits, as it is heard at 1 m from it, at rest."""

    def samples(self, first: int, count: int) -> Array:
        """(count,) the samples from this number on; sample i is emitted at i / RATE s of emulated time."""


class Blocks:
    """A signal that is computed block by block, of which the latest blocks are kept."""

    def __init__(self, compute: Callable[[int], Array]) -> None:
        self._compute = compute
        self._kept: dict[int, Array] = {}

    def samples(self, first: int, count: int) -> Array:
        """(count,) the samples from this number on."""
        begin, end = first // BLOCK, (first + count - 1) // BLOCK
        whole = np.concatenate([self._block(number) for number in range(begin, end + 1)])
        return whole[first - begin * BLOCK :][:count]

    def _block(self, number: int) -> Array:
        found = self._kept.get(number)
        if found is None:
            if len(self._kept) >= _KEPT:
                self._kept.pop(next(iter(self._kept)))
            found = self._kept[number] = self._compute(number)
        return found


def white(count: int, block: int, seed: int, *key: Key) -> Array:
    """(count,) draws from N(0, 1) that belong to a block."""
    return generator(seed, *key, block).standard_normal(count)


def smooth_noise(first: int, step: int, seed: int, *key: Key, columns: int = 1) -> Array:
    """(BLOCK, columns) noises of mean 0 and variance 1 with little beyond RATE / (3 ``step``) Hz.

    Cubic B-splines on knots ``step`` samples apart, with coefficients drawn from N(0, 1). Their power spectrum falls as
    (sin u / u)^8 with u = pi f step / RATE. ``first`` is the first sample of a block.
    """
    knot, into = divmod(first, step)
    weights = _weights(step, into)
    low, high = knot - 1, knot - 1 + weights.shape[1]
    groups = range(low // _GROUP, (high - 1) // _GROUP + 1)
    drawn = np.concatenate([white(_GROUP * columns, group, seed, *key) for group in groups]).reshape(-1, columns)
    return np.asarray(weights @ drawn[low - groups[0] * _GROUP :][: weights.shape[1]])


@lru_cache(64)
def _weights(step: int, into: int) -> Array:
    """(BLOCK, n) how much of each coefficient is in each sample of a block that begins ``into`` samples after a knot.

    The squares of a sample's four weights are 151/315 in the mean over the interval between two knots.
    """
    knot, since = np.divmod(np.arange(into, into + BLOCK), step)
    u = since / step
    four = ((1.0 - u) ** 3, 4.0 - 6.0 * u**2 + 3.0 * u**3, 1.0 + 3.0 * u + 3.0 * u**2 - 3.0 * u**3, u**3)
    weights = np.zeros((BLOCK, int(knot[-1]) + 4))
    for offset, weight in enumerate(four):
        weights[np.arange(BLOCK), knot + offset] = weight / (6.0 * np.sqrt(151.0 / 315.0))
    return weights


_GROUP: Final = 16
"""Coefficients of a spline that are drawn together."""


def interpolated(sound: Sound, at: Array) -> Array:
    """(n,) a sound at these fractional sample numbers, ascending: a sinc of 16 samples under a Kaiser window.

    Up to 1.5 kHz it is right to 1 %; what is above fades out towards 2 kHz.
    """
    whole = np.floor(at)
    first = int(whole[0]) - _HALF + 1
    emitted = sound.samples(first, int(whole[-1]) - first + _HALF + 1)
    taps = _TAPS[np.rint((at - whole) * _PHASES).astype(np.intp)]
    around = (whole.astype(np.intp) - (_HALF - 1) - first)[:, None] + np.arange(2 * _HALF)
    return np.asarray(np.einsum("nk,nk->n", taps, emitted[around]))


_HALF: Final = 8
_PHASES: Final = 1_024


def _taps() -> Array:
    """(phases + 1, 16) the weights of the samples around a place between two of them."""
    away = np.arange(-_HALF + 1, _HALF + 1) - np.linspace(0.0, 1.0, _PHASES + 1)[:, None]
    weights = np.sinc(away) * np.i0(6.0 * np.sqrt(np.clip(1.0 - (away / _HALF) ** 2, 0.0, None)))
    return np.asarray(weights / weights.sum(axis=1, keepdims=True))


_TAPS: Final = _taps()
