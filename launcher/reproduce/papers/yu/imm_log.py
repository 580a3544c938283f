"""Interacting unscented Kalman filters on the logarithm of the energy: what the particle filters compare with.

Three modes with the turns' true rates, as the particle filters have. The logarithm of what is received is linear in
that of what is emitted; its noise is that of the energy, divided by what is expected. A reading below the noise of the
surroundings counts as that.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from launcher.reproduce.papers.yu.runs import reports_of
from launcher.reproduce.papers.yu.truth import STEPS, Field, T, drawn
from trackfield.filters import imm, ukf
from trackfield.filters.gaussian import Motion, predict
from trackfield.filters.rao_blackwell import foreseen
from trackfield.filters.turning import Turns
from trackfield.filters.types import Array, Gaussian
from trackfield.sensing.energy import Energy


def imm_errors(turns: Turns, q: float, sensors: int, field: Field, runs: Sequence[int]) -> Array:
    """The errors (R, T, 2) m of the position, with the ``sensors`` nearest to where the target is expected."""
    told, m = drawn(field, runs), len(turns.rates)
    motions = _motions(field, turns, q)
    bank = imm.Bank(
        np.tile(np.eye(m)[0], (len(runs), 1)),
        np.repeat(told.prior.mean[:, None], m, axis=1),
        np.repeat(told.prior.covariance[:, None], m, axis=1),
    )
    errors = np.empty((len(runs), STEPS, 2))
    for t in range(STEPS):
        mean = imm.combined(bank).mean
        away = np.square(told.places - (mean[:, :2] + T * mean[:, 2:4])[:, None]).sum(axis=-1)
        reports = reports_of(told, t, np.argsort(away, axis=-1, kind="stable")[:, :sensors])
        bank = imm.mix(bank, turns.switching)
        prior = predict(Gaussian(bank.mean, bank.covariance), motions)
        posterior, log_evidence = _update(field.kind, prior, reports.readings[0].values[..., 0], reports.positions)
        bank = imm.Bank(imm.reweigh(bank.probability, log_evidence), *posterior)
        errors[:, t] = imm.combined(bank).mean[:, :2] - told.path[:, t + 1, :2]
    return errors


def _update(kind: Energy, prior: Gaussian, readings: Array, places: Array) -> tuple[Gaussian, Array]:
    """The beliefs (R, M, 5) after readings (R, K) at (R, K, 2), and the evidence (R, M)."""

    def received(x: Array) -> Array:
        at = places.reshape(len(places), *(1,) * (x.ndim - 2), *places.shape[1:])
        return kind.h(x, at)[..., 0]

    expected = received(prior.mean)
    missing = np.isnan(readings)[:, None]
    sd = np.where(missing, np.inf, np.sqrt(kind.variance_of(expected)) / expected)
    z = np.log(np.maximum(np.where(np.isnan(readings), kind.noise, readings), kind.noise))
    return ukf.update(prior, np.broadcast_to(z[:, None], sd.shape), sd, lambda x: np.log(received(x)))


def _motions(field: Field, turns: Turns, q: float) -> Motion:
    each = [foreseen(np.zeros(5), np.array([rate]), field.model, T, q) for rate in turns.rates]
    F, Q = (np.stack(parts) for parts in zip(*each, strict=True))
    return Motion(F, Q)
