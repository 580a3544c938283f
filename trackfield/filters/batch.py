"""Many runs of SP-CPF as one array operation: a Monte-Carlo campaign without a loop over runs.

Each run draws from its own generator, as it would alone, and gives the same track.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from trackfield.filters.particles import draw
from trackfield.filters.spcpf import Cloud, Draws, SpCpf, coast, fuse
from trackfield.filters.types import Gaussian, Model, Readings, Reports


def begin(tracker: SpCpf, priors: Sequence[Gaussian], rngs: Sequence[np.random.Generator]) -> Cloud:
    """The clouds of R runs before their first step, arrays (R, ...); ``rngs`` are those of the first step."""
    particles = [draw(prior, tracker.particles, rng) for prior, rng in zip(priors, rngs, strict=True)]
    mean, covariance = (np.stack(parts) for parts in zip(*priors, strict=True))
    return Cloud(Gaussian(mean, covariance), covariance, np.stack(particles))


def step(
    tracker: SpCpf,
    cloud: Cloud,
    reports: Sequence[Reports],
    model: Model,
    dt: float,
    rngs: Sequence[np.random.Generator],
) -> Cloud:
    """The clouds ``dt`` seconds later, when run r took ``reports[r]``."""
    counts = np.array([len(one) for one in reports])
    heard, silent = np.flatnonzero(counts), np.flatnonzero(counts == 0)
    parts = []
    if len(heard):
        draws = Draws(*(np.stack(parts) for parts in zip(*(tracker.draws(rngs[int(r)]) for r in heard), strict=True)))
        weights = np.where(counts[heard] == 1, tracker.single, tracker.weights)
        these = stacked([reports[int(r)] for r in heard])
        parts.append(fuse(_at(cloud, heard), these, model, dt, draws, weights == "gaussian-prior"))
    if len(silent):
        normals = np.stack([rngs[int(r)].standard_normal((tracker.particles, 2)) for r in silent])
        parts.append(coast(_at(cloud, silent), model, dt, normals))
    back = np.argsort(np.concatenate((heard, silent)))
    return _at(_joined(parts), back)


def stacked(reports: Sequence[Reports]) -> Reports:
    """The reports of R runs at one step as one, arrays (R, K, ...), K the largest number of any run.

    Each run has at least one. Runs with fewer than K are padded with their first, with a level of minus infinity.
    """
    most = max(map(len, reports))
    chosen = [np.where((k := np.arange(most)) < len(one), k, 0) for one in reports]
    bearings, positions, levels = (
        np.stack([getattr(one, name)[k] for one, k in zip(reports, chosen, strict=True)])
        for name in ("bearings", "positions", "levels")
    )
    missing = np.arange(most) >= np.array([len(one) for one in reports])[:, None]
    values = np.moveaxis(np.stack((bearings, np.where(missing, -np.inf, levels))), 0, -1)
    return Reports(reports[0].step, (), positions, (Readings(reports[0].readings[0].kind, values),))


def _at(cloud: Cloud, runs: np.ndarray[tuple[int], np.dtype[np.intp]]) -> Cloud:
    (mean, covariance), carried, particles = cloud
    return Cloud(Gaussian(mean[runs], covariance[runs]), carried[runs], particles[runs])


def _joined(clouds: Sequence[Cloud]) -> Cloud:
    flat = [(*posterior, carried, particles) for posterior, carried, particles in clouds]
    mean, covariance, carried, particles = (np.concatenate(arrays) for arrays in zip(*flat, strict=True))
    return Cloud(Gaussian(mean, covariance), carried, particles)
