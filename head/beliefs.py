"""Beliefs on their way from master to master."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np

from trackfield.filters.belief import Belief, Modes, Particles, moments
from trackfield.tracking.stored import pack

MOST_BYTES: Final = 3700
"""Of a hand-over."""


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
