"""Bounds of the paper's s1: ``python -m tests.s1_bounds`` prints them over 30 to 1000 paths."""

from __future__ import annotations

from functools import cache

import numpy as np

from tests.zhai_field import ALPHA, GRID, LEVEL_DB, P0, SIGMA_W, THRESHOLD_DB, s1
from trackfield.filters.bounds import information, pcrlb, position_sd, trajectory_crlb
from trackfield.filters.gaussian import Motion, constant_velocity
from trackfield.filters.types import Array
from trackfield.models import doa, motion
from trackfield.models.sound import level_db

MOTION = constant_velocity(1.0, 0.1)


@cache
def paths(runs: int) -> Array:
    """(R, 61, 4) of the seeds 0, 1, ..."""
    return np.array([s1(np.random.default_rng(seed)) for seed in range(runs)])


@cache
def informations(runs: int) -> Array:
    """(R, 60, 4, 4) along these paths, of the sensors that hear the target there."""
    states = paths(runs)[:, 1:]
    distance = np.hypot(states[..., None, 0] - GRID[:, 0], states[..., None, 1] - GRID[:, 1])
    heard = level_db(distance, LEVEL_DB, ALPHA, xp=np) >= THRESHOLD_DB
    return information(doa.jacobian(states, GRID), np.where(heard, SIGMA_W, np.inf))


def along(runs: int) -> float:
    """The bound along each path, m: root mean square over paths and steps."""
    return rms(trajectory_crlb(P0, MOTION, informations(runs)))


def beforehand(runs: int) -> float:
    """The bound before the path is known, m."""
    return rms(pcrlb(P0, MOTION, informations(runs)))


def knowing_how_hard(runs: int) -> float:
    """Along each path, with its own acceleration's size at each step instead of the model's 0.1 m/s^2."""
    square = np.square(np.diff(paths(runs)[..., 2:], axis=1)).mean(axis=-1)
    noise = square[..., None, None] * np.array(motion.process_noise(1.0, 1.0))
    return rms(trajectory_crlb(P0, Motion(MOTION.F, noise), informations(runs)))


def rms(bounds: Array) -> float:
    """Of the position, over all of ``bounds`` (..., 4, 4)."""
    return float(np.sqrt(np.square(position_sd(bounds)).mean()))


def main() -> None:
    """One line for each number of paths."""
    for runs in (30, 100, 300, 1000):
        values = f"{beforehand(runs):.3f} | {along(runs):.3f} | {knowing_how_hard(runs):.3f}"
        print(f"| {runs} | {values} |")


if __name__ == "__main__":
    main()
