"""What the paper sets its algorithm beside (sec. 2, 5.1): Kalman filters, differences and directions of arrival.

The Kalman filters are for the same reports; the other two need audio, and are here for what they compute.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Final

import numpy as np

from launcher.reproduce.papers.yang.trials.sensitivity import C
from trackfield.filters import ekf
from trackfield.filters.passes.types import Passes
from trackfield.filters.types import Array, Gaussian
from trackfield.models import passing

WINDOW_S: Final = 0.5
"""Differences and directions of arrival are taken of so much audio at a time."""
DIRECTIONS: Final = 360
"""Of arrival that are tried."""
_PRIOR_SD: Final = (10.0, 10.0, 5.0, 5.0, 1.0)
"""Of ``ekf_fit``: m, m/s, and that of the logarithm."""


def node_fit(passes: Passes) -> Array:
    """States (R, 4) at the mean of the times, on the line that is nearest to "at its time the target is at the node".

    A Kalman filter with that measurement and no prior has the same estimate: regression of places on times.
    """
    times = passes.times_s - passes.times_s.mean(axis=-1, keepdims=True)
    places = passes.places.mean(axis=-2)
    velocity = (times[..., None] * passes.places).sum(axis=-2) / np.square(times).sum(axis=-1)[..., None]
    return np.concatenate([places, velocity], axis=-1)


def ekf_fit(passes: Passes) -> Array:
    """States (R, 4) of an extended Kalman filter that gets time and strength of one node after the other, by time.

    It starts from ``node_fit``. Its fifth state is the logarithm of the source's amplitude at 1 m, which it is told by
    the strengths and the distances from that start.
    """
    start = node_fit(passes)
    level = (np.log(passes.strengths) + np.log(_far(passing.distances(start, passes.places)))).mean(axis=-1)
    mean = np.concatenate([start, level[:, None]], axis=-1)
    belief = Gaussian(mean, np.broadcast_to(np.diag(np.square(_PRIOR_SD)), (len(mean), 5, 5)))
    since = passes.times_s - passes.times_s.mean(axis=-1, keepdims=True)
    order = np.argsort(since, axis=-1)
    for k in range(order.shape[-1]):
        one = np.arange(len(order)), order[:, k]
        z = np.stack([since[one], np.log(passes.strengths[one])], axis=-1)
        sd = np.stack([passes.time_sd_s[one], passes.strength_sd[one]], axis=-1)
        measure, slopes = _measured(passes.places[one][:, None])
        belief = ekf.posterior(belief, z, sd, measure, slopes)
    return belief.mean[:, :4]


def _measured(at: Array) -> tuple[ekf.Map, ekf.Map]:
    """h and its derivatives: from states (R, 5) to time and log strength at ``at`` (R, 1, 2)."""

    def measure(x: Array) -> Array:
        strengths = x[:, 4:] - np.log(_far(passing.distances(x, at)))
        return np.concatenate([passing.times(x, at, C), strengths], axis=-1)

    def slopes(x: Array) -> Array:
        away, towards = passing.distances_and_slopes(x, at)
        strengths = -towards / _far(away)[..., None]
        strengths[..., 4] = 1.0
        return np.concatenate([passing.times_and_slopes(x, at, C)[1], strengths], axis=-2)

    return measure, slopes


def _far(distances: Array) -> Array:
    """Distances of at least 1 m: nearer, no linear filter follows their logarithm."""
    return np.maximum(distances, 1.0)


def delays(audio: Array, rate: int) -> Array:
    """By how many seconds what each of ``audio`` (K, N) has is later than what each other one has, (K, K).

    The lag with the largest cross-correlation, whose spectrum is whitened (Knapp & Carter 1976).
    """
    count = audio.shape[-1]
    spectra = np.fft.rfft(audio, 2 * count)
    cross = spectra[:, None] * spectra[None].conj()
    correlation = np.fft.irfft(cross / np.maximum(np.abs(cross), 1e-12), 2 * count)
    lag = np.argmax(correlation, axis=-1)
    return np.asarray(np.where(lag < count, lag, lag - 2 * count) / rate)


def steering(microphones: Array, count: int, rate: int) -> Array:
    """(directions, K, F): by how much to turn the F frequencies of ``count`` samples, so that a plane wave adds up."""
    angles = 2 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    late = -(np.stack([np.cos(angles), np.sin(angles)], axis=-1) @ microphones.T) / C
    return np.asarray(np.exp(2j * np.pi * late[..., None] * np.fft.rfftfreq(count, 1.0 / rate)))


def direction(audio: Array, steered: Array) -> float:
    """From where (rad, counter-clockwise from +x) a plane wave comes, of ``audio`` (K, N), ``steered`` as above.

    The direction in which the delayed and summed signal is strongest (Van Trees 2002, sec. 2.3).
    """
    summed = np.einsum("dkf,kf->df", steered, np.fft.rfft(audio))
    power = np.square(np.abs(summed)).sum(axis=-1)
    return float(2 * np.pi * np.argmax(power) / DIRECTIONS)


def windows(audio: Array, rate: int) -> list[Array]:
    """The audio (K, N) in windows of ``WINDOW_S``; what is left over is left out."""
    ends = range(0, audio.shape[-1] + 1, int(WINDOW_S * rate))
    return [audio[:, begin:end] for begin, end in pairwise(ends)]
