"""Path loss, shadowing and asymmetry from the RSSI of links, of which those that are too weak were never heard.

The model is that of ``trackfield.link.shadowing``: loss = PL0 + 10 n log10(d) + S + A, with S ~ N(0, sigma^2) for a
pair and A ~ N(0, a^2) for each direction. A link is heard if its RSSI is above a threshold, which is taken to be the
lowest RSSI of all links: the maximum likelihood estimate of where a sample is cut off.
"""

from __future__ import annotations

from math import log, sqrt
from typing import Final

import numpy as np
from scipy.optimize import minimize, minimize_scalar
from scipy.special import log_ndtr, ndtr, owens_t

from launcher.calibrate.samples import Floats

_LEAST_DB: Final = 0.01
_MOST_DB: Final = 50.0


def asymmetry_db(there: Floats, back: Floats, threshold: float) -> float:
    """The sd a of A, from the RSSI (P,) of pairs that were heard in both directions.

    Their difference is N(0, 2 a^2), independent of their mean m, and both are above the threshold if it is less than
    2 (m - threshold) in size: a truncated normal distribution, whose likelihood is at its maximum at a.
    """
    difference, room = there - back, there + back - 2 * threshold

    def unlikely(ln_sd: float) -> float:
        sd = sqrt(2) * np.exp(ln_sd)
        inside = np.log(np.maximum(2 * ndtr(room / sd) - 1, 1e-300))
        return float(np.sum(np.log(sd) + 0.5 * (difference / sd) ** 2 + inside))

    best = minimize_scalar(unlikely, bounds=(log(_LEAST_DB), log(_MOST_DB)), method="bounded")
    return float(np.exp(best.x))


def path_loss(
    ranges: Floats, there: Floats, back: Floats, asymmetry: float, threshold: float, tx_dbm: float
) -> tuple[float, float, float]:
    """PL0 at 1 m in dB, the exponent n, and sigma in dB, of greatest likelihood.

    ``ranges`` (P,) are the distances in metres of all pairs, ``there`` and ``back`` their RSSI in dBm, NaN where
    nothing was heard. A pair that was heard both ways counts by its mean, one that was heard one way by that RSSI and
    by the other one being below the threshold, and one that was not heard by both being below it (Owen 1956).
    """
    decades = 10 * np.log10(np.maximum(ranges, 1.0))
    heard = np.isfinite(there).astype(int) + np.isfinite(back)
    mean = np.where(heard == 2, (there + back) / 2, np.where(np.isfinite(there), there, back))

    def unlikely(parameters: Floats) -> float:
        pl0, n, ln_sigma = parameters
        expected, sigma2 = tx_dbm - pl0 - n * decades, np.exp(2 * np.clip(ln_sigma, log(_LEAST_DB), log(_MOST_DB)))
        one2, both2 = sigma2 + asymmetry**2, sigma2 + asymmetry**2 / 2
        rho = sigma2 / one2
        off, below = mean - expected, threshold - expected
        other = (below - rho * off) / sqrt(one2 * (1 - rho**2))
        h = below / sqrt(one2)
        neither = ndtr(h) - 2 * owens_t(h, sqrt((1 - rho) / (1 + rho)))
        each = np.select(
            [heard == 2, heard == 1],
            [
                -0.5 * off**2 / both2 - 0.5 * np.log(both2),
                -0.5 * off**2 / one2 - 0.5 * np.log(one2) + log_ndtr(other),
            ],
            np.log(np.maximum(neither, 1e-300)),
        )
        return -float(np.sum(each))

    first = _first_guess(decades, mean, tx_dbm)
    best = minimize(unlikely, first, method="Nelder-Mead", options={"xatol": 1e-4, "fatol": 1e-6, "maxiter": 4000})
    pl0, n, ln_sigma = best.x
    return float(pl0), float(n), float(np.exp(ln_sigma))


def _first_guess(decades: Floats, mean: Floats, tx_dbm: float) -> Floats:
    """A straight line through the pairs that were heard."""
    some = np.isfinite(mean)
    design = np.stack([np.ones(some.sum()), decades[some]], axis=1)
    line, *_ = np.linalg.lstsq(design, tx_dbm - mean[some], rcond=None)
    off = tx_dbm - mean[some] - design @ line
    return np.array([*line, log(max(float(off.std()), 0.5))])
