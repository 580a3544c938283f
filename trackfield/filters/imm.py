"""Interacting multiple models (Blom & Bar-Shalom 1988; Bar-Shalom, Li & Kirubarajan 2001, sec. 11.6).

The filters of the bank are the caller's: ``mix`` before their step, ``reweigh`` after it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from trackfield.filters.gaussian import Motion, collapse
from trackfield.filters.resampling import normalised
from trackfield.filters.types import Array, Gaussian


class Bank(NamedTuple):
    """M models' ``probability`` (..., M), ``mean`` (..., M, n) and ``covariance`` (..., M, n, n)."""

    probability: Array
    mean: Array
    covariance: Array


def mix(bank: Bank, switching: Array) -> Bank:
    """Each model's initial belief: the beliefs of all, mixed by the probability that the target came from them.

    ``switching`` (M, M): row i holds the probabilities of going from model i to each model. The result's
    ``probability`` is that predicted for the coming step.
    """
    joint = bank.probability[..., :, None] * switching
    predicted = joint.sum(axis=-2)
    likely = np.maximum(predicted, np.finfo(np.float64).tiny)  # avoids 0 / 0 for a model that cannot be reached
    origin = np.swapaxes(joint / likely[..., None, :], -1, -2)
    mixed = collapse(origin, bank.mean[..., None, :, :], bank.covariance[..., None, :, :, :])
    return Bank(predicted, mixed.mean, mixed.covariance)


def expected(bank: Bank, switching: Array, motions: Motion) -> Motion:
    """One linear motion for the step to come, of the moments that the bank's prediction has.

    ``switching`` as for ``mix``; ``motions`` has each model's F and Q, (M, n, n). With J the model of the step, x the
    state and both taken as independent, F is the mean of F_J, and Q the mean of Q_J and cov(F_J x - F x).
    """
    likely = bank.probability @ switching
    F = np.einsum("...m,mij->...ij", likely, motions.F)
    belief = combined(bank)
    square = belief.covariance + belief.mean[..., :, None] * belief.mean[..., None, :]
    apart = motions.F - F[..., None, :, :]
    noise = motions.Q + apart @ square[..., None, :, :] @ np.swapaxes(apart, -1, -2)
    return Motion(F, np.einsum("...m,...mij->...ij", likely, noise))


def reweigh(predicted: Array, log_evidence: Array) -> Array:
    """Probabilities (..., M) of the models after measurements, by Bayes' rule."""
    with np.errstate(divide="ignore"):  # a model of probability 0 keeps it
        return normalised(np.log(predicted) + log_evidence)


def combined(bank: Bank) -> Gaussian:
    """The estimate over all models."""
    return collapse(bank.probability, bank.mean, bank.covariance)
