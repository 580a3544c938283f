"""The field of five nodes, targets that cross it, and what the nodes report: many runs as arrays.

The paper says little of its simulation (sec. 6); places, jitter and noise are those of an independent prototype.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from launcher.reproduce.kernels.draws import Generators, generators, normals, uniforms
from launcher.reproduce.papers.yang.trials.sensitivity import C
from trackfield.filters.passes.types import Passes
from trackfield.filters.types import Array
from trackfield.models import passing
from trackfield.models.noise import time_sd

JITTER: Final = np.array([[0.05, -0.08], [0.10, 0.05], [-0.08, 0.10], [0.06, -0.05], [-0.10, 0.02]])
"""How far each node is from the corner of a regular pentagon, in units of its radius."""
MPH: Final = 0.44704
"""m/s."""
SPEED: Final = 30 * MPH
"""Of the paper's target (sec. 5.1)."""
LEAST_M: Final = 2.0
"""No target passes a node closer."""
FLOOR_M: Final = 3.0
"""The error of a time is no smaller at nodes that are nearer."""
_TRIES: Final = 64
"""A run draws so many lines, and takes the first that no node is too close to."""


@dataclass(frozen=True)
class Setup:
    """A field of ``nodes`` on a circle of ``radius_m``, and how well they measure.

    A time has the sd ``time_s * (max(d, 3 m) / at_m)**p * (13.4 m/s / speed)**q``, with ``d`` the distance at which the
    target passes, and a node's clock an error of sd ``clock_s``. A strength has the relative sd ``strength``. A node is
    not where it says: by up to ``place_m``, uniformly, in any direction. So many nodes are ``silent``, any ones.
    """

    speed: float = SPEED
    time_s: float = 0.1
    p: float = 0.0
    q: float = 0.0
    at_m: float = 12.0
    strength: float = 0.1
    place_m: float = 0.0
    clock_s: float = 0.0
    radius_m: float = 20.0
    nodes: int = 5
    silent: int = 0

    @property
    def places(self) -> Array:
        """(K, 2): the first node is north, the others follow counter-clockwise."""
        angles = np.pi / 2 + 2 * np.pi * np.arange(self.nodes) / self.nodes
        circle = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
        return self.radius_m * (circle + np.resize(JITTER, circle.shape))

    def time_sd(self, distances: Array) -> Array:
        """The sd (s) of the times of passes at these distances (m)."""
        law = {"sd": self.time_s, "floor_m": FLOOR_M, "at_m": self.at_m, "p": self.p, "q": self.q}
        return time_sd(distances, np.array(self.speed), **law, larger=np.maximum)

    @property
    def place_sd_m(self) -> float:
        """Of each coordinate of a place: a distance uniform up to ``place_m`` has the mean square place_m**2 / 3."""
        return self.place_m / math.sqrt(6.0)


class Trials(NamedTuple):
    """R runs: the true state (R, 4), when the target is nearest to the nodes' centroid, at time 0; places (R, K, 2)."""

    truth: Array
    places: Array
    passes: Passes


def trials(setup: Setup, seeds: Sequence[int], line: tuple[Array, float] | None = None) -> Trials:
    """Targets that cross the field, and the reports of its nodes.

    All take the same ``line``, through a point (2,) at a heading (rad, clockwise from north), or random ones.
    """
    count, nodes = len(seeds), setup.nodes
    if line is None:
        truth = crossing(setup.places, setup.speed, generators(seeds, "line"))
    else:
        truth = np.tile(along(setup, *line), (count, 1))
    places = np.broadcast_to(setup.places, (count, nodes, 2))
    distances = passing.distances(truth, places)
    told_sd = setup.time_sd(distances)
    measured = passing.times(truth, places, C) + told_sd * normals(generators(seeds, "times"), nodes)
    measured += setup.clock_s * normals(generators(seeds, "clocks"), nodes)
    order = np.argsort(uniforms(generators(seeds, "silent"), nodes), axis=-1)
    measured = np.where(order < setup.silent, np.nan, measured)
    strengths = np.exp(setup.strength * normals(generators(seeds, "strengths"), nodes)) / distances
    told = places + misplaced(setup.place_m, generators(seeds, "places"), nodes)
    passes = Passes(
        places=told,
        times_s=measured,
        strengths=strengths,
        time_sd_s=np.maximum(told_sd, 1e-4),
        strength_sd=np.full((count, nodes), max(setup.strength, 1e-3)),
        place_sd_m=setup.place_sd_m,
    )
    return Trials(truth, places, passes)


def along(setup: Setup, through: Array, heading: float) -> Array:
    """The state (4,) on a line where it is nearest to the nodes' centroid."""
    e = np.array([np.sin(heading), np.cos(heading)])
    at = through + ((setup.places.mean(axis=0) - through) @ e) * e
    return np.concatenate([at, setup.speed * e])


def crossing(places: Array, speed: float, rngs: Generators) -> Array:
    """States (R, 4) at the point of a line nearest to the centroid of ``places`` (K, 2), a line through their hull.

    Its direction is uniform, and so is where it crosses the hull's width; no node is closer than ``LEAST_M``.
    """
    centre = places.mean(axis=0)
    drawn = uniforms(rngs, _TRIES, 2)
    heading = 2 * np.pi * drawn[..., 0]
    along = np.stack([np.cos(heading), np.sin(heading)], axis=-1)
    across = np.stack([-along[..., 1], along[..., 0]], axis=-1)
    aside = (places - centre) @ np.swapaxes(across, -1, -2)  # (R, K, tries)
    low, high = aside.min(axis=1), aside.max(axis=1)
    offset = low + (high - low) * drawn[..., 1]
    good = (np.abs(aside - offset[:, None]) >= LEAST_M).all(axis=1)
    if not good.any(axis=1).all():
        raise ValueError(f"no line of {_TRIES} passes every node at {LEAST_M:g} m or more")
    first = np.argmax(good, axis=1)
    chosen = np.arange(len(first)), first
    at = centre + offset[chosen][:, None] * across[chosen]
    return np.concatenate([at, speed * along[chosen]], axis=-1)


def misplaced(most_m: float, rngs: Generators, nodes: int) -> Array:
    """Errors of places (R, K, 2): of a length uniform up to ``most_m``, in any direction."""
    drawn = uniforms(rngs, nodes, 2)
    length, angle = most_m * drawn[..., :1], 2 * np.pi * drawn[..., 1:]
    return np.asarray(length * np.concatenate([np.cos(angle), np.sin(angle)], axis=-1))
