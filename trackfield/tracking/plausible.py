"""Whether what another process says of a target can be."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np

from trackfield.filters.belief import Belief, dimension, moments
from trackfield.filters.measurement import STATE
from trackfield.filters.types import Gaussian, Model

MOST_M: Final = 1e6
"""How far from the origin a target may be believed to be, and the sd of that; a ``Result`` says no more either."""
MOST_M_S: Final = 1000.0


def plausible(beliefs: Mapping[str, Belief | None], model: Model) -> bool:
    """Whether beliefs are of a target that can be, over a state of the model, so that trackers can go on with them."""
    known = [one for one in beliefs.values() if one is not None]
    return all(dimension(one) in (STATE, model.dimension) and _within(moments(one)) for one in known)


def _within(known: Gaussian) -> bool:
    mean, variances = known.mean, np.diagonal(known.covariance)
    near = bool(np.all(np.abs(mean[:2]) <= MOST_M) and np.all(np.abs(mean[2:4]) <= MOST_M_S))
    return near and bool(np.all(variances <= MOST_M**2))
