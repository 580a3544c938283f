"""Noise with outliers: what a filter that is robust to them takes a reading's noise for.

Zhou et al. (2011) have outliers of the non-line of sight; the variance of a reading is raised until its innovation is
``BEYOND`` sds. So a reading beyond that pulls the less, the farther it is off, and any other counts in full.

Filters with particles weigh by a density. The one that pulls like this is normal up to ``BEYOND`` = c sds, and beyond
it falls with the power c^2: with u the innovation in sds, -d log p/du is u up to c and c^2/u beyond, which is u over
the raised variance u^2/c^2 (the weights of an M-estimate; Huber 1964). It is the density that particle physics calls
the crystal ball, to both sides.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from trackfield.filters.types import Array

BEYOND: Final = 2.5
"""The largest innovation of a reading that is taken at its word, in sds of what was expected."""


def inflated(sd: Array, innovation: Array, spread: Array) -> Array:
    """The sd (..., K) of the noise of each number, raised where its ``innovation`` (..., K) asks for it.

    ``spread`` (..., K) is the variance that the belief about the state gives each expected number.
    """
    missing = np.square(innovation / BEYOND) - spread - np.square(sd)
    return np.asarray(np.sqrt(np.square(sd) + np.maximum(missing, 0.0)))


def tailed(squares: Array) -> Array:
    """-2 log p (...) of numbers with these squared misses (...) in units of their variance; 0 without a miss.

    As they are up to ``BEYOND``^2; beyond it they grow with their logarithm.
    """
    limit = BEYOND**2
    return np.asarray(np.minimum(squares, limit) + limit * np.log(np.maximum(squares / limit, 1.0)))
