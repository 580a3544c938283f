"""The field and the targets of Zhai et al. 2009 (scenarios s1 to s3), for tests of the trackers alone."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import TypeVar

import numpy as np

from tests.sensing import bearings_model
from trackfield.filters.types import Array, Estimate, Gaussian, Reports, Tracker, of_bearings
from trackfield.models import doa, motion
from trackfield.models.sound import level_db

S = TypeVar("S")

SPACING, LEVEL_DB, ALPHA, THRESHOLD_DB = 50.0, 70.0, 2.0, 0.75 * 70.0
SIGMA_W = float(np.radians(3.0))
GRID = np.array([(SPACING * column, SPACING * row) for row in range(11) for column in range(11)])
P0 = np.diag([20.0, 20.0, 4.0, 4.0]) ** 2
MODEL = bearings_model(SIGMA_W)


def s1(rng: np.random.Generator) -> Array:
    """States (61, 4): straight on, disturbed by random acceleration of 0.1 m/s^2."""
    F, gain = np.array(motion.transition(1.0)), np.array(motion.noise_gain(1.0))
    states = [np.array([50.0, 70.0, 6.0, 5.0])]
    for _ in range(60):
        states.append(F @ states[-1] + gain @ rng.normal(0.0, 0.1, 2))
    return np.array(states)


def s2(_: np.random.Generator) -> Array:
    """States (76, 4): turns of 90 degrees to the left at 20 s and to the right at 45 s, swinging speed."""
    fine = np.arange(75 * 100 + 1) / 100.0
    turn = 22.5 * (np.clip(fine - 20.0, 0.0, 4.0) - np.clip(fine - 45.0, 0.0, 4.0))
    heading, speed = np.radians(8.0 + turn), 8.0 + 2.0 * np.sin(2.0 * np.pi * fine / 15.0)
    v = speed[:, None] * np.stack((np.cos(heading), np.sin(heading)), axis=-1)
    p = np.array([45.0, 85.0]) + np.concatenate((np.zeros((1, 2)), np.cumsum((v[1:] + v[:-1]) / 200.0, axis=0)))
    return np.concatenate((p, v), axis=1)[::100]


def s3(_: np.random.Generator) -> Array:
    """States (41, 4): straight on at 40 degrees, +1 m/s^2 for 20 s and then -1."""
    t = np.arange(41.0)
    speed = 1.0 + np.minimum(t, 20.0) - np.maximum(t - 20.0, 0.0)
    way = np.where(t <= 20.0, t + t**2 / 2.0, 220.0 + 21.0 * (t - 20.0) - (t - 20.0) ** 2 / 2.0)
    ahead = np.array([np.cos(np.radians(40.0)), np.sin(np.radians(40.0))])
    return np.concatenate((np.array([70.0, 100.0]) + way[:, None] * ahead, speed[:, None] * ahead), axis=1)


SCENARIOS: dict[str, Callable[[np.random.Generator], Array]] = {"s1": s1, "s2": s2, "s3": s3}


def hear(
    position: Array,
    rng: np.random.Generator,
    *,
    step: int = 0,
    sensors: Array = GRID,
    sigma_w: float = SIGMA_W,
) -> Reports:
    """What the sensors above the threshold report of a target at ``position`` (2,)."""
    levels = level_db(np.hypot(*(position - sensors).T), LEVEL_DB, ALPHA, xp=np)
    near = np.flatnonzero(levels >= THRESHOLD_DB)
    bearings = doa.measure(position, sensors[near]) + sigma_w * rng.standard_normal(len(near))
    return of_bearings(step, tuple(f"n{i:03d}" for i in near), sensors[near], bearings, levels[near])


def only(reports: Reports, which: Sequence[int]) -> Reports:
    """These of the reports, by their place."""
    k = np.array(which, dtype=int)
    ids = tuple(reports.sensors[i] for i in k)
    return of_bearings(reports.step, ids, reports.positions[k], reports.bearings[k], reports.levels[k])


def prior_around(state: Array, rng: np.random.Generator) -> Gaussian:
    """The paper's kind of prior: N(truth + error, P0) with the error drawn from N(0, P0)."""
    return Gaussian(state + np.sqrt(np.diag(P0)) * rng.standard_normal(4), P0)


def follow(tracker: Tracker[S], truth: Array, rng: np.random.Generator, sigma_w: float = SIGMA_W) -> Iterator[Estimate]:
    """The tracker's estimates for steps 1, 2, ... of one second along ``truth`` (T+1, 4)."""
    state = tracker.init(prior_around(truth[0], rng), bearings_model(sigma_w))
    for step, target in enumerate(truth[1:], start=1):
        reports = hear(target[:2], rng, step=step, sigma_w=sigma_w)
        state, estimate = tracker.step(state, reports, 1.0, rng)
        yield estimate


def errors(tracker: Tracker[S], scenario: str, seeds: range, sigma_w: float = SIGMA_W) -> tuple[Array, Array]:
    """Errors (runs, T, 4) of the estimates and their covariances (runs, T, 4, 4)."""
    all_errors, covariances = [], []
    for seed in seeds:
        rng = np.random.default_rng(seed)
        truth = SCENARIOS[scenario](rng)
        estimates = list(follow(tracker, truth, rng, sigma_w))
        all_errors.append(np.array([e.mean for e in estimates]) - truth[1:])
        covariances.append(np.array([e.covariance for e in estimates]))
    return np.array(all_errors), np.array(covariances)
