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
        parts.append(
            fuse(_at(cloud, heard), these, model, dt, draws, weights == "gaussian-prior", robust=tracker.robust)
        )
    if len(silent):
        normals = np.stack([rngs[int(r)].standard_normal((tracker.particles, 2)) for r in silent])
        parts.append(coast(_at(cloud, silent), model, dt, normals))
    back = np.argsort(np.concatenate((heard, silent)))
    return _at(_joined(parts), back)


def stacked(reports: Sequence[Reports]) -> Reports:
    """The reports of R runs at one step as one, arrays (R, K, ...), K the largest number of any run.

    Each run has at least one. Runs with fewer than K are padded: with readings of NaN at the place of their first.
    """
    most = max(map(len, reports))
    first = reports[0]
    values = np.full((len(reports), most, first.readings[0].values.shape[-1]), np.nan)
    positions = np.zeros((len(reports), most, 2))
    for run, one in enumerate(reports):
        values[run, : len(one)], positions[run] = one.readings[0].values, one.positions[0]
        positions[run, : len(one)] = one.positions
    return Reports(first.step, (), positions, (Readings(first.readings[0].kind, values),), first.m, first.directional)


def _at(cloud: Cloud, runs: np.ndarray[tuple[int], np.dtype[np.intp]]) -> Cloud:
    (mean, covariance), carried, particles = cloud
    return Cloud(Gaussian(mean[runs], covariance[runs]), carried[runs], particles[runs])


def _joined(clouds: Sequence[Cloud]) -> Cloud:
    flat = [(*posterior, carried, particles) for posterior, carried, particles in clouds]
    mean, covariance, carried, particles = (np.concatenate(arrays) for arrays in zip(*flat, strict=True))
    return Cloud(Gaussian(mean, covariance), carried, particles)
