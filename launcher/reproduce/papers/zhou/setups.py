"""The experiments' targets, nodes and readings. Zhou et al. (2011) say little of them.

The paper's eq. 11 measures the distance from the origin, which leaves the bearing unobservable; here it is that to the
nodes of the cluster. Where it is silent, three setups stand for what it may have had: ``walk``, in which readings say
little in a step, ``sharp``, in which they say much, and ``paperlike``, with errors of the size of the paper's.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from launcher.reproduce.kernels.draws import generators, normals, uniforms
from trackfield.filters.particles import moved
from trackfield.filters.types import Array, Gaussian, Model, Readings, Reports
from trackfield.sensing.kinds import make_sensor

DT: Final = 1.0
"""The sampling interval, s (sec. III-B)."""
X0: Final = (0.5, 0.5, 0.8, 0.9)
"""The mean of the initial state (x, y, vx, vy), m and m/s (sec. III-B: x, vx, y, vy)."""
CLUSTER: Final = 3
"""The nodes of a cluster (sec. III-A): the nearest to the target."""
WITHIN: Final = 10
"""A run is lost if it is off the target by more than a node's range in any of so many last steps."""


@dataclass(frozen=True)
class Setup:
    """A target and the nodes around it.

    ``q`` is the sd of the acceleration that filters expect (m/s^2), ``true_q`` that of the target, None if the same.
    ``noise`` is the sd of a distance (m) of kind ``range``, and that of a level (dB) of kind ``rss``. ``prior_sd`` is
    that of (x, y, vx, vy), from which the true initial state is drawn. Each square of ``cell_m`` has one node, which
    senses the target up to ``sense_m``. With ``origin``, the only node is at the origin, as in eq. 11.
    A share ``outliers`` of the readings is too large by up to ``sense_m``.
    """

    q: float
    noise: float
    steps: int
    prior_sd: tuple[float, float, float, float]
    cell_m: float = 10.0
    sense_m: float = 20.0
    kind: str = "range"
    true_q: float | None = None
    outliers: float = 0.0
    origin: bool = False

    @property
    def model(self) -> Model:
        """What filters know."""
        options = {"floor_sd_m": self.noise, "growth_m": 0.0}
        if self.kind == "rss":
            options = {"shadow_sd_db": self.noise, "level_dbm": -40.0, "exponent": 3.0, "floor_m": 0.1}
        return Model({self.kind: make_sensor(self.kind, {"range_m": self.sense_m, **options})}, self.q)

    @property
    def prior(self) -> Gaussian:
        """What filters know of the initial state."""
        return Gaussian(np.array(X0), np.diag(np.square(self.prior_sd)))


WALK: Final = Setup(0.1, 1.0, 60, (0.5, 0.5, 0.1, 0.1))
SHARP: Final = Setup(0.5, 0.1, 60, (0.5, 0.5, 0.5, 0.5))
PAPERLIKE: Final = Setup(12.0, 3.0, 50, (5.0, 5.0, 5.0, 5.0), cell_m=100.0, sense_m=200.0)
SETUPS: Final[Mapping[str, Setup]] = {"walk": WALK, "sharp": SHARP, "paperlike": PAPERLIKE}
LINEAR: Final = replace(WALK, true_q=0.0)
"""The target moves "uniformly and linearly", as the abstract says; filters do not know."""
ORIGIN: Final = replace(WALK, origin=True)
"""Eq. 11 as printed."""
OUTLIERS: Final = replace(WALK, outliers=0.1)
SHADOWING_DB: Final = (2, 4, 6)
RSS: Final[Mapping[str, Setup]] = {f"rss {sd} dB": replace(WALK, kind="rss", noise=float(sd)) for sd in SHADOWING_DB}


class World(NamedTuple):
    """R runs: ``truth`` (R, T, 4) at steps 1 to T, and the ``reports`` of each step, arrays (R, K, ...)."""

    truth: Array
    reports: Sequence[Reports]


def world(setup: Setup, seeds: Sequence[int]) -> World:
    """The runs with these seeds."""
    truth = paths(setup, seeds)[:, 1:]
    places = np.zeros((*truth.shape[:2], 1, 2)) if setup.origin else cluster(setup, seeds, truth[..., :2])
    kind = setup.model.sensor
    z = kind.h(truth, places)[..., 0]
    z = z + setup.noise * normals(generators(seeds, "readings"), *z.shape[1:])
    if setup.outliers:
        chance, size = np.moveaxis(uniforms(generators(seeds, "outliers"), 2, *z.shape[1:]), 1, 0)
        z = z + np.where(chance < setup.outliers, setup.sense_m * size, 0.0)
    steps = range(1, setup.steps + 1)
    return World(truth, [_reports(setup.kind, step, places[:, step - 1], z[:, step - 1]) for step in steps])


def _reports(kind: str, step: int, places: Array, z: Array) -> Reports:
    names = tuple(f"n{k}" for k in range(z.shape[-1]))
    return Reports(step, names, places, (Readings(kind, z[..., None]),), 1, directional=False)


def paths(setup: Setup, seeds: Sequence[int]) -> Array:
    """The true states (R, T + 1, 4), from step 0, by eq. 10."""
    rngs = generators(seeds, "path")
    states: list[Array] = [np.array(X0) + np.array(setup.prior_sd) * normals(rngs, 4)]
    q = setup.q if setup.true_q is None else setup.true_q
    for _ in range(setup.steps):
        states.append(moved(states[-1][:, None], DT, q, normals(rngs, 1, 2))[:, 0])
    return np.stack(states, axis=1)


# --- nodes ------------------------------------------------------------------------------------------------------------


def cluster(setup: Setup, seeds: Sequence[int], targets: Array) -> Array:
    """The places (R, T, K, 2) of the nodes nearest to ``targets`` (R, T, 2)."""
    around = neighbours(setup, seeds, targets)
    nearest = np.argsort(np.linalg.norm(around - targets[..., None, :], axis=-1), axis=-1)[..., :CLUSTER]
    return np.take_along_axis(around, nearest[..., None], axis=-2)


def neighbours(setup: Setup, seeds: Sequence[int], targets: Array) -> Array:
    """The nodes (R, T, 25, 2) of the cells around ``targets`` (R, T, 2): all within two cells' width, at least."""
    cells = np.floor(targets / setup.cell_m).astype(np.int64)[..., None, :] + _AROUND
    return setup.cell_m * (cells + jitter(np.asarray(seeds)[:, None, None], cells))


_AROUND: Final = np.stack(np.meshgrid(np.arange(-2, 3), np.arange(-2, 3)), axis=-1).reshape(-1, 2)


def jitter(seeds: npt.NDArray[np.int64], cells: npt.NDArray[np.int64]) -> Array:
    """Where in its cell each node is, (..., 2) in [0, 1): a hash of the run's seed (...,) and the cell (..., 2).

    So the field has no end, wherever a target walks.
    """
    key = _mixed(
        _mixed(_mixed(seeds.astype(np.uint64)) ^ cells[..., 0].astype(np.uint64)) ^ cells[..., 1].astype(np.uint64)
    )
    both = np.stack((_mixed(key), _mixed(key ^ np.uint64(1))), axis=-1)
    return np.asarray((both >> np.uint64(11)) * 2.0**-53, float)


def _mixed(bits: npt.NDArray[np.uint64]) -> npt.NDArray[np.uint64]:
    """64 bits, each of which depends on all of ``bits``: a step of SplitMix64 (Steele, Lea & Flood 2014)."""
    with np.errstate(over="ignore"):
        bits = bits + np.uint64(0x9E3779B97F4A7C15)
        bits = (bits ^ (bits >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        bits = (bits ^ (bits >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        mixed: npt.NDArray[np.uint64] = bits ^ (bits >> np.uint64(31))
    return mixed
