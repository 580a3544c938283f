"""Noise that is taken for larger where a reading is far from what was expected: a filter robust to outliers.

Zhou et al. (2011) have outliers of the non-line of sight; the variance of a reading is raised until its innovation is
``BEYOND`` sds. So a reading beyond that pulls the less, the farther it is off, and any other counts in full.
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
