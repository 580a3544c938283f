"""The field of Özfidan et al. (2018) and what happens in it: drawn for each run by its number.

Masters and slaves lie anywhere in a square; each slave belongs to the nearest master that has a place left (Table I).
The target starts in the middle; a path that leaves the square is drawn again. Every draw is keyed by run and purpose.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, hypot, inf, sin, tau
from typing import Final, NamedTuple

import numpy as np

from trackfield.filters.gate import Indices
from trackfield.filters.gaussian import Motion
from trackfield.filters.rng import generator
from trackfield.filters.types import Array, Gaussian, Model
from trackfield.sensing.complete import Kind
from trackfield.sensing.range import Range

T: Final = 2.0
"""Seconds between steps."""
Q: Final = 0.01
"""m^2/s^3, the density of the acceleration's noise; eq. 18 prints the matrix of 1."""
STEPS: Final = 1000
SPEED: Final = 2.0
"""m/s at the start, in any direction: the paper has none."""
PRIOR_SD: Final = (1.0, 1.0, 0.5, 0.5)
R_COEFF: Final = 100.0
R_FLOOR: Final = 0.01
NOBODY: Final = -1
"""In place of a master."""


@dataclass(frozen=True)
class Setup:
    """A square of sides twice ``half_m``; each of the ``masters`` has at most ``capacity`` of the ``slaves``.

    A slave that is farther than ``detect_m`` from the target reports that there is none.
    """

    masters: int = 64
    slaves: int = 256
    capacity: int = 5
    half_m: float = 8000.0
    steps: int = STEPS
    detect_m: float = inf

    @property
    def kind(self) -> Range:
        """Ranges, whose variance is 100 m^2 times the share of the distance in the diagonal (eqs. 19, 20)."""
        growth_m = R_COEFF / (2.0 * hypot(self.half_m, self.half_m))
        return Range(range_m=10.0 * self.half_m, floor_sd_m=R_FLOOR**0.5, growth_m=growth_m)

    @property
    def model(self) -> Model:
        """What filters know."""
        return Model({"range": Kind("range", self.kind)}, sigma_v=Q**0.5)


def motion() -> Motion:
    """Nearly constant velocity (eqs. 5 and 6), with the density ``Q``."""
    F, noise = np.array([[1.0, T], [0.0, 1.0]]), Q * np.array([[T**3 / 3.0, T**2 / 2.0], [T**2 / 2.0, T]])
    return Motion(*(np.asarray(np.kron(one, np.eye(2)), float) for one in (F, noise)))


class Truth(NamedTuple):
    """R runs: ``masters`` (R, M, 2) and ``slaves`` (R, S, 2), whose ``owner`` (R, S) is a master's number or nobody.

    ``path`` (R, T + 1, 4) has the start first, ``normals`` (R, T, S) are the noise of the readings, and the ``prior``
    is over (x, y, vx, vy) at the start.
    """

    masters: Array
    slaves: Array
    owner: Indices
    path: Array
    normals: Array
    prior: Gaussian


def drawn(setup: Setup, runs: Sequence[int]) -> Truth:
    """The truth of these runs."""
    masters, slaves, paths, normals, means = [], [], [], [], []
    for run in runs:
        places, noise, off = (generator(run, "ozfidan", what) for what in ("places", "readings", "prior"))
        masters.append(places.uniform(-setup.half_m, setup.half_m, (setup.masters, 2)))
        slaves.append(places.uniform(-setup.half_m, setup.half_m, (setup.slaves, 2)))
        paths.append(_path(setup, run))
        normals.append(noise.standard_normal((setup.steps, setup.slaves)))
        means.append(paths[-1][0] + off.standard_normal(4) * PRIOR_SD)
    owner = np.stack([associated(*one, setup.capacity) for one in zip(masters, slaves, strict=True)])
    covariance = np.broadcast_to(np.diag(np.square(PRIOR_SD)), (len(runs), 4, 4))
    prior = Gaussian(np.stack(means), covariance)
    return Truth(np.stack(masters), np.stack(slaves), owner, np.stack(paths), np.stack(normals), prior)


def associated(masters: Array, slaves: Array, capacity: int) -> Indices:
    """The master (S,) of each slave, in the order of their numbers: the nearest that has fewer than ``capacity``."""
    away = np.hypot(*(slaves[:, None] - masters[None]).transpose(2, 0, 1))
    load, owner = np.zeros(len(masters), int), np.full(len(slaves), NOBODY)
    for slave, order in enumerate(np.argsort(away, axis=1, kind="stable")):
        free = order[load[order] < capacity]
        if len(free):
            owner[slave] = free[0]
            load[free[0]] += 1
    return owner


def _path(setup: Setup, run: int) -> Array:
    """A path (T + 1, 4) that stays in the square: exactly the motion that the filters expect."""
    root = np.linalg.cholesky(Q * np.array([[T**3 / 3.0, T**2 / 2.0], [T**2 / 2.0, T]]))
    for attempt in range(10_000):
        rng = generator(run, "ozfidan", "path", attempt)
        heading = tau * rng.random()
        kicks = np.einsum("ij,tjk->tik", root, rng.standard_normal((setup.steps, 2, 2)))
        speeds = np.array([cos(heading), sin(heading)]) * SPEED + np.cumsum(kicks[:, 1], axis=0)
        before = np.concatenate(([[cos(heading) * SPEED, sin(heading) * SPEED]], speeds[:-1]))
        places = np.cumsum(before * T + kicks[:, 0], axis=0)
        path = np.vstack(([[0.0, 0.0, *before[0]]], np.hstack((places, speeds))))
        if np.abs(path[:, :2]).max() <= setup.half_m:
            return path
    raise RuntimeError(f"no path of {setup.steps} steps stays within {setup.half_m} m")
