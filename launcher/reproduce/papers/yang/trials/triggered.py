"""How many nodes a target triggers (Yang et al., sec. 3.1): 25 in 100 m x 100 m that hear it within 20 m, in 5 s."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from launcher.reproduce.kernels.draws import generators, uniforms
from launcher.reproduce.kernels.study import Figures
from launcher.reproduce.papers.yang.trials.field import SPEED
from trackfield.filters.types import Array

NODES: Final = 25
SIDE_M: Final = 100.0
RANGE_M: Final = 20.0
WITHIN_S: Final = 5.0
_TRIES: Final = 64


def triggered(seeds: Sequence[int]) -> Figures:
    """Counts (R,) of the nodes in random fields, in ``WITHIN_S`` of a straight path that lies inside of the field.

    ``passed``: the target passes them in that time, so they have a closest point of approach to report. ``heard``: it
    is in their range at some time of it. ``crossed`` is 1 where nodes on both sides of the path are passed.
    """
    nodes = SIDE_M * uniforms(generators(seeds, "nodes"), NODES, 2)
    start, along = _paths(seeds)
    away = nodes - start[:, None]
    length = SPEED * WITHIN_S
    ahead = np.vecdot(away, along[:, None])
    aside = away[..., 1] * along[:, None, 0] - away[..., 0] * along[:, None, 1]
    before = np.hypot(ahead - np.clip(ahead, 0.0, length), aside)
    passed = (ahead >= 0) & (ahead <= length) & (np.abs(aside) <= RANGE_M)
    sides = (passed & (aside > 0)).any(axis=1) & (passed & (aside < 0)).any(axis=1)
    return {
        "passed": passed.sum(axis=1).astype(float),
        "heard": (before <= RANGE_M).sum(axis=1).astype(float),
        "crossed": sides.astype(float),
    }


def _paths(seeds: Sequence[int]) -> tuple[Array, Array]:
    """Starts (R, 2) and directions (R, 2), uniform among those of paths that lie inside of the field."""
    drawn = uniforms(generators(seeds, "paths"), _TRIES, 3)
    start, heading = SIDE_M * drawn[..., :2], 2 * np.pi * drawn[..., 2]
    along = np.stack([np.cos(heading), np.sin(heading)], axis=-1)
    end = start + SPEED * WITHIN_S * along
    chosen = np.arange(len(drawn)), np.argmax(((end >= 0) & (end <= SIDE_M)).all(axis=-1), axis=1)
    return start[chosen], along[chosen]
