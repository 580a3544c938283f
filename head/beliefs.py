"""Beliefs on their way from master to master."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np

from trackfield.filters.belief import Belief, Modes, Particles, moments
from trackfield.filters.types import Gaussian
from trackfield.tracking.stored import pack

MOST_BYTES: Final = 3700
"""Of a hand-over."""


MOST_M: Final = 1e6
"""How far from the origin a target may be believed to be, and the sd of that; a ``Result`` says no more either."""
MOST_M_S: Final = 1000.0


def plausible(beliefs: Mapping[str, Belief | None]) -> bool:
    """Whether beliefs are of a target that can be, so that trackers can go on with them."""
    return all(_within(moments(one)) for one in beliefs.values() if one is not None)


def _within(known: Gaussian) -> bool:
    mean, variances = known.mean, np.diagonal(known.covariance)
    near = bool(np.all(np.abs(mean[:2]) <= MOST_M) and np.all(np.abs(mean[2:4]) <= MOST_M_S))
    return near and bool(np.all(variances <= MOST_M**2))


def packed_beliefs(
    step: int, beliefs: Mapping[str, Belief | None], *, particles: bool = False, modes: bool = False
) -> bytes:
    """The beliefs after a step, each as a Gaussian; or as ``particles``, where trackers have them, as far as they fit.

    More particles than that are thinned evenly. With ``modes`` the Gaussians of single motion models stay apart.
    """
    kept = Modes if modes else ()
    small = {name: one if one is None or isinstance(one, kept) else moments(one) for name, one in beliefs.items()}
    gaussian = pack(step, None, small)
    clouds = {name: one for name, one in beliefs.items() if particles and isinstance(one, Particles)}
    if not clouds:
        return gaussian
    room = (MOST_BYTES - len(gaussian)) // len(clouds)
    return pack(step, None, {**small, **{name: _thinned(one, room) for name, one in clouds.items()}})


def _thinned(cloud: Particles, room: int) -> Particles:
    """As many particles as so many bytes hold, drawn evenly by weight (systematic resampling, without a draw)."""
    most = room // (4 * (1 + cloud.points.shape[1]))
    if len(cloud.points) <= most:
        return cloud
    chosen = np.searchsorted(np.cumsum(cloud.weights), (np.arange(most) + 0.5) / most * cloud.weights.sum())
    return Particles(np.full(most, 1.0 / most), cloud.points[np.minimum(chosen, len(cloud.points) - 1)])
