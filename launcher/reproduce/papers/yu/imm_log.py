"""Interacting unscented Kalman filters on the logarithm of the energy: what the particle filters compare with.

Three modes with the turns' true rates, as the particle filters have. The logarithm of what is received is linear in
that of what is emitted; its noise is that of the energy, divided by what is expected. A reading below the noise of the
surroundings counts as that.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from launcher.reproduce.papers.yu.runs import reports_of, taking_part
from launcher.reproduce.papers.yu.truth import STEPS, Field, T, drawn
from trackfield.filters import imm, ukf
from trackfield.filters.gaussian import Motion, predict
from trackfield.filters.measurement import heard
from trackfield.filters.rao_blackwell import AROUND_M, SPEED_M_S, centroid, foreseen
from trackfield.filters.turning import Turns
from trackfield.filters.types import Array, Gaussian, Reports
from trackfield.sensing.energy import Energy


def imm_errors(turns: Turns, q: float, sensors: int, after: int, field: Field, runs: Sequence[int]) -> Array:
    """The errors (R, T, 2) m of the position, with the ``sensors`` taking_part to where the target is expected.

    After ``after`` steps without a reading a track starts anew, as those of particles do.
    """
    told, m = drawn(field, runs), len(turns.rates)
    motions = _motions(field, turns, q)
    bank, silent = _begun(told.prior, m), np.zeros(len(runs), int)
    errors = np.empty((len(runs), STEPS, 2))
    for t in range(STEPS):
        late = silent >= after
        reports = reports_of(told, t, taking_part(imm.combined(bank).mean, told, t, sensors, late))
        bank = imm.mix(bank, turns.switching)
        bank = imm.Bank(bank.probability, *predict(Gaussian(bank.mean, bank.covariance), motions))
        there = heard(reports)
        anew, silent = there & late, np.where(there, 0, silent + 1)
        if anew.any():
            bank = imm.Bank(*(_where(anew, *both) for both in zip(_anew(reports, field, m), bank, strict=True)))
        prior = Gaussian(bank.mean, bank.covariance)
        posterior, log_evidence = _update(field.kind, prior, reports.readings[0].values[..., 0], reports.positions)
        bank = imm.Bank(imm.reweigh(bank.probability, log_evidence), *posterior)
        errors[:, t] = imm.combined(bank).mean[:, :2] - told.path[:, t + 1, :2]
    return errors


def _begun(prior: Gaussian, m: int) -> imm.Bank:
    """All modes with the same belief (R, n), the first for certain."""
    first = np.tile(np.eye(m)[0], (len(prior.mean), 1))
    return imm.Bank(first, *(np.repeat(part[:, None], m, axis=1) for part in prior))


def _anew(reports: Reports, field: Field, m: int) -> imm.Bank:
    """The start around the loudest sensors, of what is emitted as the kind says (``rao_blackwell.renewed``)."""
    (emitted,) = field.model.unknowns
    places = centroid(reports, field.model)
    mean = np.column_stack((places, np.tile((0.0, 0.0, emitted.mean), (len(places), 1))))
    sds = (AROUND_M, AROUND_M, SPEED_M_S, SPEED_M_S, emitted.sd)
    return _begun(Gaussian(mean, np.tile(np.diag(np.square(sds)), (len(places), 1, 1))), m)


def _where(which: npt.NDArray[np.bool_], one: Array, other: Array) -> Array:
    """The one where ``which`` (R,) is true, else the other."""
    return np.where(which.reshape(-1, *(1,) * (one.ndim - 1)), one, other)


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
